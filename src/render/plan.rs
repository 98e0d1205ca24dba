//! How many trials each tile gets in each pass: decided by a pilot, whose trials are not part of the image.

use super::RenderParams;
use super::film::{Film, Tile};

/// Trials of each pixel in the pilot, when the image has at least four times as many to spend.
const PILOT_TRIALS: u32 = 16;

/// Pixels darker than this share of the image's mean are held to its absolute error instead of their own relative one.
const DARK: f64 = 0.1;

/// Trials of one tile's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Allocation {
    /// In HIRES.
    pub hires: u32,
    /// In LORES.
    pub lores: u32,
}

impl Allocation {
    /// The larger of both.
    pub fn most(&self) -> u32 {
        self.hires.max(self.lores)
    }
}

/// Number of pilot trials: enough to estimate a tile's variance, little against the image.
pub fn pilot_trials(params: &RenderParams) -> u32 {
    PILOT_TRIALS.min((params.max_trials / 4).max(2))
}

/// Variance of a single trial and mean radiance of a tile, pooled over its pixels and bands.
#[derive(Clone, Copy, Default)]
struct Statistics {
    hires: f64,
    lores: f64,
    mean: f64,
}

/// Chooses trials for the requested relative errors: HIRES until `dev_H / L_H`, then LORES until
/// `(dev_H + dev_L) / (L_H + L_L)` is met, both rounded up to powers of two between the limits.
///
/// Variances are pooled over a tile and, where larger, half of its neighbours': a pilot that missed a feature at the edge of one
/// tile has seen it in the next.
pub fn allocate(pilot: &Film, params: &RenderParams) -> Vec<Allocation> {
    let tiles: Vec<Statistics> = pilot.tiles.iter().map(statistics).collect();
    let image_mean = tiles.iter().map(|t| t.mean).sum::<f64>() / tiles.len().max(1) as f64;
    let across = pilot.tiles_across();
    let trials = |needed: f64| {
        let needed = if needed.is_finite() { needed.ceil() as u32 } else { params.max_trials };
        needed.clamp(params.min_trials, params.max_trials).next_power_of_two().min(params.max_trials)
    };
    (0..tiles.len())
        .map(|i| {
            let own = tiles[i];
            let (x, y) = ((i % across) as isize, (i / across) as isize);
            let (mut hires, mut lores) = (own.hires, own.lores);
            for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
                let (nx, ny) = (x + dx, y + dy);
                let inside = nx >= 0 && ny >= 0 && nx < across as isize;
                if let Some(t) = inside.then(|| tiles.get(ny as usize * across + nx as usize)).flatten() {
                    hires = hires.max(0.5 * t.hires);
                    lores = lores.max(0.5 * t.lores);
                }
            }
            let radiance = own.mean.hypot(DARK * image_mean);
            if radiance == 0.0 {
                return Allocation { hires: params.min_trials, lores: params.min_trials };
            }
            let hires_trials = trials(hires / (f64::from(params.hires_error) * radiance).powi(2));
            let dev_hires = (hires / f64::from(hires_trials)).sqrt();
            // Where HIRES alone is above the target, LORES is held to half of it.
            let target = f64::from(params.lores_error) * radiance;
            let rest = (target - dev_hires).max(0.5 * target);
            Allocation { hires: hires_trials, lores: trials(lores / (rest * rest)) }
        })
        .collect()
}

fn statistics(tile: &Tile) -> Statistics {
    let n = 3.0 * tile.pixels.len() as f64;
    let mean3 = |v: [f64; 3]| v.iter().sum::<f64>() / n;
    tile.pixels.iter().fold(Statistics::default(), |s, p| Statistics {
        hires: s.hires + mean3(p.hires.variance()),
        lores: s.lores + mean3(p.lores.variance()),
        mean: s.mean + mean3(p.hires.mean()) + mean3(p.lores.mean()),
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn params() -> RenderParams {
        RenderParams {
            width: 24,
            height: 8,
            min_trials: 4,
            max_trials: 1024,
            hires_error: 0.1,
            lores_error: 0.1,
            time_limit: None,
            features: false,
            interpolate: false,
            seed: 0,
        }
    }

    /// A pilot whose middle tile has the given spread in both passes.
    fn pilot(spread: f32) -> Film {
        let mut film = Film::new(24, 8);
        for (i, tile) in film.tiles.iter_mut().enumerate() {
            for pixel in &mut tile.pixels {
                for t in 0..16 {
                    let sign = if t % 2 == 0 { 1.0 } else { -1.0 };
                    let value = Vec3::splat(1.0 + if i == 1 { sign * spread } else { 0.0 });
                    pixel.hires.add(value, t % 2 == 0);
                    pixel.lores.add(value, t % 2 == 0);
                }
            }
        }
        film
    }

    #[test]
    fn quiet_tiles_get_the_minimum_and_noisy_ones_what_the_error_asks_for() {
        let quiet = allocate(&pilot(0.0), &params());
        assert!(quiet.iter().all(|a| *a == Allocation { hires: 4, lores: 4 }));
        let noisy = allocate(&pilot(1.0), &params());
        // Variance 16/15 a trial, radiance about 2: HIRES needs 1.07 / 0.2^2 = 27 trials.
        assert_eq!(noisy[1].hires, 32);
        assert!(noisy[1].lores > noisy[1].hires);
        assert!(noisy[0].hires > 4, "a noisy neighbour is a warning");
    }

    #[test]
    fn black_images_stop_at_the_minimum() {
        let film = Film::new(24, 8);
        assert!(allocate(&film, &params()).iter().all(|a| a.most() == 4));
    }
}
