//! Direct light on patches by sampling the light sources.

use glam::DVec3;
use rayon::prelude::*;

use super::RadiosityScene;
use super::arrived::{Places, Whereabouts};
use super::patches::Patches;
use super::sampled::{Arriving, Draw, Sampled};
use super::slope::Moments;
use super::uneven::uneven;
use crate::sampling;

/// Samples a side gets before it is known how much it varies ...
const PILOT: u32 = 8;
/// ... once more where none of them found light ...
const PILOT_DARK: u32 = 16;
/// ... and where it hardly matters.
const PILOT_FAR: u32 = 2;
/// Fewest samples of a side, and where it hardly matters.
const LEAST: [u32; 2] = [4, 1];
/// Most samples of a side.
const MOST: u32 = 1 << 14;
/// Relative standard deviation over a side above which its direct light counts as uneven.
const UNEVEN: f64 = 0.6;
/// Relevance below which a side hardly matters.
const FAR: f64 = 0.05;
/// Sides looked at by one job.
const JOB: usize = 64;

/// Direct light on all sides.
pub(super) struct Direct {
    /// Incident flux of each side, two independent estimates, W.
    pub incident: [Vec<DVec3>; 2],
    /// Where that arrived.
    pub at: [Whereabouts; 2],
    /// The mean of `incident` on sides where irradiance differs so much that it says little of a point, W. `None` elsewhere, and without
    /// places.
    pub uneven: Vec<Option<DVec3>>,
    /// Relative error expected of their mean (flux-weighted, as [`Solution::error`](super::Solution::error)).
    pub error: f64,
    /// Shadow rays traced.
    pub rays: u64,
}

/// Mean irradiance of a side and the variance of one sample, summed over bands.
#[derive(Clone, Default)]
struct Estimate {
    mean: DVec3,
    /// Zero when there was only one sample.
    variance: f64,
    rays: u64,
    /// Where the light was found, if that is asked for.
    places: Option<Places>,
    moments: Moments,
}

impl Estimate {
    /// Whether single samples have a larger relative standard deviation than `limit`.
    fn differ(&self, limit: f64) -> bool {
        self.variance > (limit * self.mean.element_sum()).powi(2)
    }
}

/// Gathers direct light with samples placed so that the mean of both estimates has the relative error `target`.
///
/// A pilot decides how many samples each side gets and is then forgotten: deciding by the samples that are used would
/// bias the mean. With `places` it is remembered where the light arrived.
pub(super) fn gather(input: &RadiosityScene<'_>, patches: &Patches, places: bool, seed: u32, target: f64) -> Direct {
    let sides = 2 * patches.len();
    let area = |side: usize| patches.open_area(side as u32);
    let stream = |what: u32| sampling::hash_all(&[seed, 0x00d1_9ec7, what]);
    let far = |side: usize| patches.relevance[side / 2] < FAR;
    let pilot_counts: Vec<u32> = (0..sides).map(|s| if far(s) { PILOT_FAR } else { PILOT }).collect();
    let mut pilot = estimate(input, patches, &pilot_counts, false, stream(2));
    let mut pilot_rays: u64 = pilot.iter().map(|e| e.rays).sum();
    // Where half of the samples choose a light source behind the side, all eight do so on one side in 256, which would then get the fewest
    // samples: what looks dark is looked at again.
    let again = |side: usize| if pilot[side].mean == DVec3::ZERO && !far(side) { PILOT_DARK } else { 0 };
    let again: Vec<u32> = (0..sides).map(again).collect();
    for (side, second) in estimate(input, patches, &again, false, stream(3)).into_iter().enumerate() {
        pilot_rays += second.rays;
        if again[side] > 0 {
            pilot[side] = second;
        }
    }
    // Sum of standard errors is least for samples in proportion to (A sigma)^(2/3).
    let weighted = |side: usize| area(side) * patches.relevance[side / 2];
    let spread: Vec<f64> = pilot.iter().enumerate().map(|(s, e)| weighted(s) * e.variance.sqrt()).collect();
    let flux: f64 = pilot.iter().enumerate().map(|(s, e)| weighted(s) * e.mean.element_sum()).sum();
    let weight: f64 = spread.iter().map(|x| x.cbrt().powi(2)).sum();
    let per_weight = if flux > 0.0 { (weight / (target * flux)).powi(2) / 2.0 } else { 0.0 };
    let counts: Vec<u32> = spread
        .iter()
        .enumerate()
        .map(|(side, x)| {
            let least = LEAST[usize::from(far(side))];
            (per_weight * x.cbrt().powi(2)).ceil().clamp(least.into(), MOST.into()) as u32
        })
        .map(u32::next_power_of_two)
        .collect();
    let expected: f64 = spread.iter().zip(&counts).map(|(x, &n)| x / f64::from(2 * n).sqrt()).sum();
    let mut rays = pilot_rays;
    let halves = [0, 1].map(|half| {
        let mut estimates = estimate(input, patches, &counts, places, stream(half));
        rays += estimates.iter().map(|e| e.rays).sum::<u64>();
        let mut at = Whereabouts::default();
        if places {
            at.places = estimates.iter_mut().map(|e| e.places.take()).collect();
            at.moments = estimates.iter().map(|e| e.moments).collect();
        }
        let incident: Vec<DVec3> = estimates.iter().enumerate().map(|(s, e)| area(s) * e.mean).collect();
        (incident, at)
    });
    let [(a, at_a), (b, at_b)] = halves;
    // By samples of their own, for the same reason: of sides whose own samples miss a patch of sunlight, all would stay dark.
    let differing: Vec<u32> =
        (0..).zip(&pilot).filter(|(_, e)| places && e.differ(UNEVEN)).map(|(side, _)| side).collect();
    let (found, rays_for_uneven) = uneven(input, patches, &differing, UNEVEN, stream(4));
    log::debug!("direct light: uneven on {} of {} sides, samples differ on {}", found.len(), sides, differing.len());
    let (mut uneven, mut at) = (vec![None; sides], [at_a, at_b]);
    for side in found.into_iter().map(|side| side as usize) {
        uneven[side] = Some(0.5 * (a[side] + b[side]));
        // What is looked up there is reflected light alone.
        for half in &mut at {
            half.moments[side] = Moments::default();
        }
    }
    Direct {
        uneven,
        incident: [a, b],
        at,
        error: if flux > 0.0 { expected / flux } else { 0.0 },
        rays: rays + rays_for_uneven,
    }
}

/// Irradiance of every side from `counts` samples each.
fn estimate(input: &RadiosityScene<'_>, patches: &Patches, counts: &[u32], places: bool, stream: u32) -> Vec<Estimate> {
    let one = |sampled: &mut Sampled, (job, counts): (usize, &[u32])| {
        let side = |k: u32| (job * JOB) as u32 + k;
        let draws = (0..).zip(counts).flat_map(|(k, &count)| {
            let stream = sampling::hash_all(&[stream, side(k)]);
            (0..count).map(move |i| {
                let [u, v, light @ ..] = sampling::sobol(i, 0, stream);
                let [choice, ..] = sampling::sobol(i, 1, stream);
                Draw { side: side(k), point: [u, v], light: [choice, light[0], light[1]] }
            })
        });
        let mut estimates = vec![Estimate::default(); counts.len()];
        let mut squares = [0.0; JOB];
        for &Arriving { side, place, irradiance, .. } in sampled.light(input, patches, draws) {
            let k = side as usize - job * JOB;
            let estimate = &mut estimates[k];
            estimate.mean += irradiance;
            estimate.rays += 1;
            if places && irradiance != DVec3::ZERO {
                let random = sampling::unit(sampling::hash_all(&[stream, side, estimate.rays as u32]));
                let flux = patches.open_area(side) / f64::from(counts[k]) * irradiance.element_sum();
                estimate.places.get_or_insert_with(|| Places::new(counts[k] as usize)).offer(place, flux, random);
                estimate.moments.add(flux, patches.map.locate(place.triangle, place.uv.x, place.uv.y).1);
            }
            squares[k] += irradiance.element_sum().powi(2);
        }
        for ((estimate, square), &count) in estimates.iter_mut().zip(squares).zip(counts) {
            let n = f64::from(count.max(1));
            estimate.mean /= n;
            if count > 1 {
                estimate.variance = (square / n - estimate.mean.element_sum().powi(2)).max(0.0) * n / (n - 1.0);
            }
        }
        estimates
    };
    counts.par_chunks(JOB).enumerate().map_init(Sampled::default, one).flatten_iter().collect()
}
