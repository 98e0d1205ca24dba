//! How far off what the cache says is: noise of its records, and what changes between them.

use rayon::prelude::*;

use super::IrradianceCache;

/// Fewest places that are asked for an error that means something.
const LEAST_PLACES: usize = 16;

impl IrradianceCache {
    /// Relative error of a look-up, root of its mean square over the view, as the places of the first pass tell, which lie on a grid of pixels:
    /// what the others say there less what was measured there, without the noise of the latter, which two measurements tell. A little more than
    /// that of a pixel, as the record that is compared with has no say. At least the standard error of what the places tell: an error below that
    /// cannot be told from none. `None` where too few places can be asked.
    pub fn error(&self) -> Option<f64> {
        self.square_error().map(|[mean, of_mean]| mean.max(of_mean).sqrt())
    }

    /// Mean of its square, without bias, and the standard error of that.
    fn square_error(&self) -> Option<[f64; 2]> {
        let square = |own: &super::Record| {
            let (noise, told) = (own.noise()?, self.told(own, |other| !other.refuses)?);
            let (told, measured) = (f64::from(told.element_sum()), f64::from(own.radiance.element_sum()));
            let scale = (0.5 * (told + measured)).powi(2);
            (scale > 0.0).then(|| ((told - measured).powi(2) - noise * measured * measured) / scale)
        };
        let squares: Vec<f64> = self.records.par_iter().filter(|own| !own.refuses).filter_map(square).collect();
        if squares.len() < LEAST_PLACES {
            return None;
        }
        // Without an error, noise makes the mean as often negative as not.
        let n = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / n;
        let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Some([mean, (variance / n).sqrt()])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::index::Index;
    use super::super::record::{Record, Strata};
    use super::*;
    use crate::sampling::{hash_all, unit};

    const SIDE: u32 = 20;
    /// Standard deviation of a record.
    const SIGMA: f32 = 0.05;

    /// A wall with the same light everywhere, measured twice at each place of a grid, with noise.
    fn wall(seed: u32) -> IrradianceCache {
        let strata = Strata::of(48.0);
        let record = |i: u32, half: u32| {
            // Uniform, with the standard deviation of one of two halves.
            let noise = 6.0_f32.sqrt() * SIGMA * (2.0 * unit(hash_all(&[seed, i, half])) - 1.0);
            let (radiance, distances) = (vec![Vec3::splat(1.0 + noise); strata.len()], vec![10.0; strata.len()]);
            let position = Vec3::new((i % SIDE) as f32, (i / SIDE) as f32, 0.0);
            Record::new(position, Vec3::Z, 2.5, strata, &radiance, &distances).unwrap()
        };
        let records: Vec<Record> =
            (0..SIDE * SIDE).map(|i| record(i, 0).averaged(&record(i, 1), strata.len())).collect();
        IrradianceCache { index: Index::new(&records), records, ..IrradianceCache::default() }
    }

    /// What the others say about a place is their weighted mean, whose variance follows from the weights.
    #[test]
    fn the_noise_of_what_the_others_say_is_found() {
        let cache = wall(0);
        let expected = cache.records.iter().map(|own| {
            let others = cache.around(own.position, own.normal).filter(|(_, other)| !std::ptr::eq(*other, own));
            let (sum, squares) = others.fold((0.0, 0.0), |(s, q), (w, _)| (s + f64::from(w), q + f64::from(w * w)));
            f64::from(SIGMA).powi(2) * squares / (sum * sum)
        });
        let expected = expected.sum::<f64>() / f64::from(SIDE * SIDE);
        let squares: Vec<f64> = (0..64).map(|seed| wall(seed).square_error().unwrap()[0]).collect();
        let n = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / n;
        let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // Four standard errors: a false alarm in 6,000. Denominators with noise of 5 % move the mean by less than a per cent.
        assert!((mean - expected).abs() < 4.0 * (variance / n).sqrt() + 0.01 * expected, "{mean} {expected}");
    }

    /// Where two measurements of each place are so far apart that they leave nothing of what the others say differently, it is their noise that is
    /// small or large, and no error of zero.
    #[test]
    fn no_error_is_smaller_than_it_can_be_told() {
        let mut cache = wall(0);
        for record in &mut cache.records {
            record.variance = record.variance.map(|v| 100.0 * v);
        }
        let squares: Vec<f64> = cache.records.iter().filter_map(Record::noise).collect();
        let n = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / n;
        let of_mean = (squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt().sqrt();
        let found = cache.error().unwrap();
        // Squares are relative to the mean of two values that are 1 but for 5 % of noise, and differences add 1 % to them.
        assert!((found / of_mean - 1.0).abs() < 0.1, "{found} {of_mean}");
    }

    #[test]
    fn few_places_say_nothing() {
        assert_eq!(IrradianceCache::default().error(), None);
    }
}
