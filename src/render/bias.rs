//! The bias meter: what the far field's approximations change, measured without knowing the answer.
//!
//! From the same first gather (same point, same direction) one path is followed with the far field and one without. The
//! difference of the two is an unbiased sample of the bias of GSII at that point; its mean over random points of the image is the
//! image's bias, with a standard error.

use rayon::prelude::*;

use super::RenderParams;
use super::caustics::Caustics;
use super::path::Path;
use super::workspace::Workspace;
use super::world::World;
use crate::sampling::{SobolPoint, hash_all};
use crate::scene::{Camera, Lens};
use crate::shading::Lobes;
use glam::{Vec2, Vec3};

/// Paths that are traced as one batch.
const BATCH: u32 = 2048;

/// Keeps the meter's random numbers apart from the image's.
const STREAM: u32 = 0x6269_6173;

/// Signed bias of the image's mean radiance: GSII less path traced, per band.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bias {
    /// Mean difference, W/(sr m^2).
    pub mean: [f64; 3],
    /// Standard error of that.
    pub standard_error: [f64; 3],
    /// Mean LORES radiance by path tracing, for comparison.
    pub reference: [f64; 3],
    /// Pairs of paths.
    pub samples: u64,
}

impl Bias {
    /// Bias over the mean radiance `total`, all bands together, and half of its 95 % confidence interval.
    pub fn relative_to(&self, total: f64) -> (f64, f64) {
        if total <= 0.0 {
            return (0.0, 0.0);
        }
        let mean = self.mean.iter().sum::<f64>() / 3.0;
        // Bands are strongly correlated: their mean has at most the mean of their standard errors.
        let error = self.standard_error.iter().sum::<f64>() / 3.0;
        (mean / total, 1.96 * error / total)
    }
}

/// Measures the bias with `samples` pairs of paths over the part of the image that `params` ask for.
pub fn measure(world: &World<'_>, camera: &Camera, params: &RenderParams, samples: u32) -> Bias {
    let view = View::new(camera, params);
    let gather_lobes = Lobes { least_roughness: 0.0, ..world.gather_lobes };
    let reference = World { far: None, caustics: None, gather_lobes, ..*world };
    // Caustics of lights without area are not to be had by path tracing.
    let caustics = world.caustics.map(Caustics::of_areas_only);
    let world = &World { caustics: caustics.as_ref(), ..*world };
    let batches: Vec<Sums> = (0..samples.div_ceil(BATCH))
        .into_par_iter()
        .map_init(Workspace::default, |ws, batch| {
            let first = batch * BATCH;
            let count = BATCH.min(samples - first);
            let stream = hash_all(&[params.seed, STREAM, batch]);
            let views: Vec<Path> = (0..count).map(|i| view.path(i, stream)).collect();
            let gathers: Vec<Path> = world.first_gathers(ws, &views).into_iter().map(|c| c.path).collect();
            let of_photons = ws.lores.clone();
            // With a cache only the point is shared
            let start = if world.cache.is_some() { &views } else { &gathers };
            let mut with_far = world.gather(ws, start, count as usize).to_vec();
            with_far.iter_mut().zip(of_photons).for_each(|(sum, photons)| *sum += photons);
            // Other random numbers than the first path's: only the first point and direction are shared.
            let detailed: Vec<Path> = gathers
                .iter()
                .map(|g| Path { near: f32::INFINITY, numbers: g.numbers.elsewhere(STREAM), ..*g })
                .collect();
            let traced = reference.gather(ws, &detailed, count as usize);
            let mut sums = Sums::default();
            for (far, path) in with_far.iter().zip(traced) {
                sums.add(*far, *path);
            }
            sums
        })
        .collect();
    let total = batches.into_iter().fold(Sums::default(), Sums::merged);
    total.bias()
}

/// Paths through random points of a part of an image.
struct View {
    lens: Lens,
    /// Where it begins and how large it is, as shares of the whole image.
    low: Vec2,
    size: Vec2,
}

impl View {
    fn new(camera: &Camera, params: &RenderParams) -> Self {
        let whole = Vec2::new(params.width as f32, params.height as f32);
        let region = params.region();
        let share = |of: [u32; 2]| Vec2::new(of[0] as f32, of[1] as f32) / whole;
        View { lens: camera.lens(whole.x / whole.y), low: share(region.low), size: share(region.size()) }
    }

    fn path(&self, index: u32, stream: u32) -> Path {
        let numbers = SobolPoint::new(index, stream);
        let u = numbers.block(0);
        Path::view(self.lens.ray(self.low + Vec2::new(u[0], u[1]) * self.size), index, numbers)
    }
}

#[derive(Clone, Copy, Default)]
struct Sums {
    difference: [f64; 3],
    square: [f64; 3],
    reference: [f64; 3],
    samples: u64,
}

impl Sums {
    fn add(&mut self, far: Vec3, path: Vec3) {
        if !(far.is_finite() && path.is_finite()) {
            return;
        }
        for band in 0..3 {
            let d = f64::from(far[band]) - f64::from(path[band]);
            self.difference[band] += d;
            self.square[band] += d * d;
            self.reference[band] += f64::from(path[band]);
        }
        self.samples += 1;
    }

    fn merged(self, o: Sums) -> Sums {
        let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] + b[i]);
        Sums {
            difference: add(self.difference, o.difference),
            square: add(self.square, o.square),
            reference: add(self.reference, o.reference),
            samples: self.samples + o.samples,
        }
    }

    fn bias(&self) -> Bias {
        let n = self.samples.max(2) as f64;
        let mean = self.difference.map(|d| d / n);
        Bias {
            mean,
            standard_error: std::array::from_fn(|b| {
                ((self.square[b] / n - mean[b] * mean[b]).max(0.0) / (n - 1.0)).sqrt()
            }),
            reference: self.reference.map(|r| r / n),
            samples: self.samples,
        }
    }
}
