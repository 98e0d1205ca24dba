//! Sides whose direct light differs from point to point, told apart from those whose samples differ for other reasons.

use rayon::prelude::*;

use super::RadiosityScene;
use super::patches::Patches;
use super::sampled::{Arriving, Draw, Sampled};
use crate::sampling;

/// Points that are looked at on a side.
const POINTS: u32 = 32;
/// Sides looked at by one job.
const JOB: usize = 16;

/// Light on a side: pairs of independent samples, both of a pair at the same point.
#[derive(Clone, Copy, Default)]
struct Pairs {
    /// Sums of the first ones and of the second ones.
    sums: [f64; 2],
    /// Sum of their products.
    products: f64,
}

impl Pairs {
    /// Whether the irradiance of points has a larger relative standard deviation over the side than `limit`. What samples of one and the same
    /// point differ by averages out in the products: their covariance is the variance of what they are both samples of.
    fn differ(&self, limit: f64) -> bool {
        let n = f64::from(POINTS);
        let [first, second] = self.sums.map(|sum| sum / n);
        let variance = (self.products - n * first * second) / (n - 1.0);
        variance > (limit * 0.5 * (first + second)).powi(2)
    }
}

/// Those of `sides` whose irradiance from light sources has a larger relative standard deviation than `limit` over the side, in the same order,
/// and the number of shadow rays that took.
pub(super) fn uneven(
    input: &RadiosityScene<'_>,
    patches: &Patches,
    sides: &[u32],
    limit: f64,
    stream: u32,
) -> (Vec<u32>, u64) {
    let look = |sampled: &mut Sampled, sides: &[u32]| {
        let draws = sides.iter().flat_map(|&side| {
            let stream = sampling::hash_all(&[stream, side]);
            (0..2 * POINTS).map(move |i| {
                let [u, v, ..] = sampling::sobol(i / 2, 0, stream);
                let [choice, x, y, _] = sampling::sobol(i / 2, 1 + i % 2, stream);
                Draw { side, point: [u, v], light: [choice, x, y] }
            })
        });
        let mut pairs = vec![Pairs::default(); sides.len()];
        let arriving = sampled.light(input, patches, draws);
        let light = |one: &Arriving| one.irradiance.element_sum();
        for of_point in arriving.chunk_by(|a, b| a.draw / 2 == b.draw / 2) {
            let of_side = &mut pairs[(of_point[0].draw / (2 * POINTS)) as usize];
            for one in of_point {
                of_side.sums[(one.draw % 2) as usize] += light(one);
            }
            if let [first, second] = of_point {
                of_side.products += light(first) * light(second);
            }
        }
        let found = sides.iter().zip(&pairs).filter(|(_, pairs)| pairs.differ(limit)).map(|(&side, _)| side);
        (found.collect::<Vec<u32>>(), arriving.len() as u64)
    };
    let jobs: Vec<(Vec<u32>, u64)> = sides.par_chunks(JOB).map_init(Sampled::default, look).collect();
    let rays = jobs.iter().map(|job| job.1).sum();
    (jobs.into_iter().flat_map(|job| job.0).collect(), rays)
}
