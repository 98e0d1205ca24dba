//! Progressive refinement radiosity on the simplified scene, with form factors by ray casting.
//!
//! [`solve`] cuts the geometry into `patches`, finds what they reflect (`optics`), lights them (`direct` by shadow rays or
//! `emit` by shooting) and lets the largest unshot flux shoot first (`refine`, `shoot`). Everything is done twice with
//! independent random numbers, so that the [`Solution`] knows its statistical error.

mod arrived;
mod direct;
mod emit;
mod ledger;
mod optics;
mod patches;
mod refine;
mod sampled;
mod shoot;
mod slope;
mod solution;
#[cfg(test)]
mod tests;
mod uneven;

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3, Vec3};

use crate::backend::RayScene;
use crate::error::{Error, Result};
use crate::lighting::Lights;
use crate::progress::Progress;
use crate::sampling;
use crate::scene::Scene;
use crate::simplify::{Cluster, SimplifiedGeometry};
use arrived::{Arrived, Whereabouts};
use direct::Direct;
pub use ledger::Ledger;
use ledger::Tally;
use optics::Optics;
use patches::Patches;
use refine::Run;
use shoot::Tracer;
use slope::Moments;
use solution::PatchSolution;
pub use solution::Solution;

/// Parameters of [`solve`].
#[derive(Clone, Debug, PartialEq)]
pub struct RadiosityParams {
    /// Target edge length of patches, scene length units.
    pub patch_size: f32,
    /// Fewest patches that a surface is cut into, about, however small it is against `patch_size`; 1 or more. Faces of equivalent
    /// boxes have as many as their fit says. The paper's surfaces have 7 on average (74,924 of 10,948).
    pub least_patches: u32,
    /// Number of patches that makes `patch_size` grow, about; surfaces smaller than a patch count as `least_patches` each.
    pub max_patches: usize,
    /// Stop when this share of the emitted flux is unshot; the paper's is 0.01.
    pub unshot: f64,
    /// Whether the effect of the unshot flux is estimated and added at the end. Without it radiosities are too low: in a
    /// closed room of reflectance rho by rho times the unshot share.
    pub ambient: bool,
    /// Whether parts of a patch that something covers closely (within a tenth of its diameter) are left out of it. Without that a patch
    /// is its whole area, as in the textbooks' form factors: exact for large patches that meet at an angle, too dark where furniture
    /// stands against a wall.
    pub leave_out_covered: bool,
    /// Whether it is known where on a patch light arrived, and from where: reflected light leaves from there, as the material reflects
    /// it, and direct light that varies over a patch is told apart ([`Solution::look_up`]). Without that a patch is lit evenly and shines
    /// evenly into all directions, as the textbooks' form factors have it: light spreads over each patch that it meets, and through walls
    /// that patches reach beyond.
    pub keep_places: bool,
    /// How direct light reaches the patches.
    pub direct: DirectLight,
    /// Relative statistical error to aim for: decides how many rays are shot.
    pub error: f32,
    /// Where the solution must be good. Rays, error and the stop at `unshot` are weighted by closeness to it: under a bright sky most
    /// of the flux is outdoors, and without this a room would be left with a share of a per cent. `None`: everywhere alike.
    pub focus: Option<Focus>,
    /// Most rays that the light of the first bounce is shot with: where the error needs more, a warning says so.
    pub max_rays: u64,
    /// Seed.
    pub seed: u32,
}

impl RadiosityParams {
    /// The usual parameters with patches of a given size.
    pub fn new(patch_size: f32) -> Self {
        RadiosityParams {
            patch_size,
            least_patches: 1,
            max_patches: 400_000,
            unshot: 0.01,
            ambient: true,
            leave_out_covered: true,
            keep_places: true,
            direct: DirectLight::Gather,
            error: 0.02,
            focus: None,
            max_rays: 1 << 36,
            seed: 0,
        }
    }

    fn check(&self) -> Result<()> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.patch_size.into()) {
            return Err(Error::Usage(format!("the patch size must be positive, not {}", self.patch_size)));
        }
        if self.least_patches == 0 {
            return Err(Error::Usage("a surface has at least one patch, not 0".to_owned()));
        }
        if !positive(self.unshot) || self.unshot >= 1.0 {
            return Err(Error::Usage(format!("the unshot share must lie between 0 and 1, not be {}", self.unshot)));
        }
        if !positive(self.error.into()) {
            return Err(Error::Usage(format!("the radiosity error must be positive, not {}", self.error)));
        }
        Ok(())
    }
}

/// The part of a scene that will be looked at, with what lights it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// Its middle.
    pub centre: Vec3,
    /// How far it reaches, scene length units, above 0.
    pub radius: f32,
}

impl Focus {
    /// Weight of what lies at `point`: 1 within the radius, then falling with the fourth power of distance, so that an endless plain
    /// around a room counts about as much as the room.
    fn weight(&self, point: Vec3) -> f64 {
        let distance = point.distance(self.centre).max(self.radius);
        f64::from(self.radius / distance).powi(4)
    }
}

/// How light sources light the patches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum DirectLight {
    /// Each patch samples the light sources with shadow rays. Far less noise at equal cost; light that arrives through
    /// mirrors or refracting glass is shot. The default.
    #[default]
    Gather,
    /// Light sources shoot like any patch, first, as in the paper: emitted flux is conserved to rounding.
    Shoot,
}

/// What a radiosity solution is solved on.
#[derive(Clone, Copy)]
pub struct RadiosityScene<'a> {
    /// Materials and textures.
    pub scene: &'a Scene,
    /// Light sources.
    pub lights: &'a Lights,
    /// Triangles.
    pub geometry: &'a SimplifiedGeometry,
    /// Boxes that the geometry refers to; empty for N+C.
    pub clusters: &'a [Cluster],
    /// The geometry, ready for rays.
    pub rays: &'a dyn RayScene,
}

/// Rays of the first solution for each lit side, in proportion to its relevance: most, which are enough to estimate the error, and fewest
/// where a large one is asked for.
const FIRST_RAYS: [f64; 2] = [4.0, 1.5];
/// Error that the most usually come to.
const FIRST_ERROR: f64 = 0.15;
/// Fewest rays that the light of the first bounce is shot with.
const LEAST_RAYS: u64 = 1 << 13;
/// Solutions that may be averaged to reach the error.
const MAX_ROUNDS: u32 = 4;

/// The number of patches that [`solve`] would have on this geometry.
///
/// # Errors
/// As [`solve`], for parameters out of range.
pub fn count_patches(geometry: &SimplifiedGeometry, clusters: &[Cluster], params: &RadiosityParams) -> Result<usize> {
    params.check()?;
    Ok(Patches::new(geometry, clusters, params)?.len())
}

/// Solves for all radiosities.
///
/// # Errors
/// [`Error::Unsolvable`] when a closed scene cannot lose energy or a surface reflects more than it receives;
/// [`Error::Usage`] for parameters out of range.
pub fn solve(input: &RadiosityScene<'_>, params: &RadiosityParams, progress: &Progress) -> Result<Solution> {
    params.check()?;
    let asked = f64::from(params.patch_size);
    let mut patches = Patches::new(input.geometry, input.clusters, params)?;
    let optics = Optics::new(input, &patches)?;
    let mut average = Average::new(2 * patches.len());
    if patches.size > asked {
        average.warnings.push(format!(
            "radiosity patches have size {:.3} instead of {asked:.3}, which would give more than {}",
            patches.size, params.max_patches
        ));
    }
    if !input.lights.is_empty() && patches.len() > 0 {
        if params.leave_out_covered {
            patches.leave_out_covered(input, params.seed);
        }
        if let Some(focus) = &params.focus {
            patches.weigh(input.geometry, focus);
        }
        let tracer = Tracer { input, patches: &patches, optics: &optics };
        average.solve(&tracer, params, progress)?;
    }
    Ok(average.into_solution(patches, &optics))
}

/// Mean of independent solutions, in two halves.
struct Average {
    /// Sum of incident flux of each side, weighted with `weight`.
    sums: [Vec<DVec3>; 2],
    /// Incident flux of each side straight from light sources, where it is uneven.
    uneven: Vec<Option<DVec3>>,
    /// Where the light of both halves arrived that is looked up, with the same weight; empty where it is not known.
    moments: Vec<Moments>,
    /// What coated sides reflected of it ([`shoot::Coated`]), with the same weight; empty where it is not known.
    coated: Vec<DVec2>,
    weight: f64,
    ledger: Ledger,
    rays: u64,
    shots: u64,
    warnings: Vec<String>,
}

impl Average {
    fn new(sides: usize) -> Self {
        Average {
            sums: [vec![DVec3::ZERO; sides], vec![DVec3::ZERO; sides]],
            uneven: vec![None; sides],
            moments: Vec::new(),
            coated: Vec::new(),
            weight: 0.0,
            ledger: Ledger::default(),
            rays: 0,
            shots: 0,
            warnings: Vec::new(),
        }
    }

    /// Adds solutions until their mean has the error asked for: the first with few rays, the next with as many as its error
    /// shows to be needed.
    fn solve(&mut self, tracer: &Tracer<'_>, params: &RadiosityParams, progress: &Progress) -> Result<()> {
        let target = f64::from(params.error);
        let mut direct = match params.direct {
            DirectLight::Gather => {
                Some(direct::gather(tracer.input, tracer.patches, params.keep_places, params.seed, 0.5 * target))
            }
            DirectLight::Shoot => None,
        };
        if let Some(direct) = &mut direct {
            self.rays += direct.rays;
            self.uneven = std::mem::take(&mut direct.uneven);
        }
        let relevance = |side: usize| tracer.patches.relevance[side / 2];
        let lit: f64 = match &direct {
            Some(direct) => {
                let sides = 0..direct.incident[0].len();
                sides.filter(|&side| direct.incident[0][side] != DVec3::ZERO).map(relevance).sum()
            }
            None => tracer.patches.relevance.iter().sum(),
        };
        // Direct light is gathered once; more shooting does not reduce its error.
        let of_direct = direct.as_ref().map_or(0.0, |d| d.error).min(0.9 * target);
        // As below: the variance to the power of 0.8.
        let first = (FIRST_RAYS[0] * (FIRST_ERROR / target).powf(1.6)).clamp(FIRST_RAYS[1], FIRST_RAYS[0]);
        let mut rays = ((first * lit) as u64).max(LEAST_RAYS);
        let mut total = 0;
        for round in 0..MAX_ROUNDS {
            self.add_pair(tracer, params, direct.as_ref(), rays, round, progress)?;
            total += rays;
            // Few patches make the estimate itself uncertain, and stopping when it happens to be low would favour that.
            let error = self.error(tracer.patches, tracer.optics) * (1.0 + 1.5 / lit.max(1.0).sqrt());
            if error <= target || progress.stopped() {
                return Ok(());
            }
            let excess = (error.powi(2) - of_direct.powi(2)).max(0.0) / (target.powi(2) - of_direct.powi(2));
            // Low-discrepancy rays converge faster than the square root: measured slopes are near -0.63. A tenth more, as the
            // estimate is itself uncertain.
            let needed = 1.1 * excess.powf(0.8) * total as f64;
            rays = ((needed - total as f64).max(0.25 * total as f64) as u64).min(params.max_rays.saturating_sub(total));
            if rays == 0 {
                break;
            }
        }
        let error = self.error(tracer.patches, tracer.optics);
        if error > 1.25 * target {
            self.warnings.push(format!("the radiosity solution's error is {error:.4}, not the {target} asked for"));
        }
        Ok(())
    }

    /// Adds two independent solutions of half of `rays` each.
    fn add_pair(
        &mut self,
        tracer: &Tracer<'_>,
        params: &RadiosityParams,
        gathered: Option<&Direct>,
        rays: u64,
        round: u32,
        progress: &Progress,
    ) -> Result<()> {
        let weight = rays as f64;
        let sides = 2 * tracer.patches.len();
        let solution = |half: usize, progress: &Progress| {
            let stream = |what: u32| sampling::hash_all(&[params.seed, round, half as u32, what]);
            let start = |flux, at| Arrived::new(flux, at, rays as usize / sides, stream(2));
            let mut run = match gathered {
                Some(gathered) => {
                    let mut arrived = start(gathered.incident[half].clone(), gathered.at[half].clone());
                    let emitted = arrived.flux.iter().sum();
                    let mut tally = Tally::default();
                    if tracer.optics.any_specular {
                        tally = emit::shoot_bent(tracer, rays / 2, &mut arrived, stream(0));
                    }
                    Run::new(tracer, arrived, emitted, tally, stream(1))
                }
                None => {
                    let at = if params.keep_places { Whereabouts::nowhere(sides) } else { Whereabouts::default() };
                    let mut arrived = start(vec![DVec3::ZERO; sides], at);
                    let light = emit::shoot_all(tracer, rays / 2, &mut arrived, stream(0));
                    let mut run = Run::new(tracer, arrived, light.flux, light.tally, stream(1));
                    run.shots += light.shots;
                    run
                }
            };
            run.refine(rays / 2, params.unshot, progress).map(|()| run)
        };
        // Side by side: what one does alone, between batches of perhaps few rays, does not keep all threads waiting.
        let (first, second) = rayon::join(|| solution(0, progress), || solution(1, &progress.quietly()));
        for (half, run) in [first?, second?].into_iter().enumerate() {
            for (sum, flux) in self.sums[half].iter_mut().zip(run.incident(params.ambient)) {
                *sum += weight * flux;
            }
            let arrived = run.arrived();
            self.moments.resize(arrived.moments().len(), Moments::default());
            for (sum, moments) in self.moments.iter_mut().zip(arrived.moments()) {
                sum.add_times(weight, *moments);
            }
            self.coated.resize(arrived.coated().len(), DVec2::ZERO);
            for (sum, coated) in self.coated.iter_mut().zip(arrived.coated()) {
                *sum += weight * coated;
            }
            self.ledger.add(&run.ledger(), 0.5 * weight);
            self.rays += run.rays();
            self.shots += run.shots;
        }
        self.weight += weight;
        Ok(())
    }

    /// Flux-weighted relative standard error of the mean: for a normal distribution the mean magnitude of half the difference of
    /// two halves is sqrt(2 / pi) standard errors of their mean.
    fn error(&self, patches: &Patches, optics: &Optics) -> f64 {
        let (mut difference, mut sum) = (0.0, 0.0);
        for (side, (a, b)) in self.sums[0].iter().zip(&self.sums[1]).enumerate() {
            let reflectance = optics.reflectance[side / 2].as_dvec3() * patches.relevance[side / 2];
            difference += (reflectance * (a - b)).element_sum().abs();
            sum += (reflectance * (a + b)).element_sum();
        }
        if sum > 0.0 { FRAC_PI_2.sqrt() * difference / sum } else { 0.0 }
    }

    /// How much more of the light that arrived at a side is reflected diffusely than of light from everywhere. One where direct light is looked up
    /// apart: the rest comes from everywhere, about.
    fn over_mean(&self, side: usize) -> f64 {
        match self.coated.get(side) {
            Some(&DVec2 { x: all, y: diffuse }) if all > 0.0 && self.uneven[side].is_none() => diffuse / all,
            _ => 1.0,
        }
    }

    fn into_solution(self, patches: Patches, optics: &Optics) -> Solution {
        let error = self.error(&patches, optics) as f32;
        let scale = if self.weight > 0.0 { 0.5 / self.weight } else { 0.0 };
        let mut ledger = Ledger::default();
        ledger.add(&self.ledger, 2.0 * scale);
        let mut of_patch: Vec<PatchSolution> = (0..patches.len())
            .map(|patch| {
                let mut solution = PatchSolution { diameter: patches.diameter[patch], ..PatchSolution::default() };
                for k in 0..2 {
                    let (a, b) = (self.sums[0][2 * patch + k], self.sums[1][2 * patch + k]);
                    let area = patches.open_area((2 * patch + k) as u32);
                    let factor = optics.reflectance[patch].as_dvec3() * (scale / area * self.over_mean(2 * patch + k));
                    solution.radiosity[k] = (factor * (a + b)).as_vec3();
                    let reflected = optics.reflectance[patch].as_dvec3() / area;
                    solution.uneven[k] = self.uneven[2 * patch + k].map(|flux| (reflected * flux).as_vec3());
                    solution.deviation[k] = ((factor * (a - b)).element_sum() / 3.0).abs() as f32;
                }
                solution
            })
            .collect();
        let found = slope::find(&patches, &self.moments, |side| self.uneven[side as usize].is_some());
        log::debug!("light slopes on {} of {} sides", found.len(), 2 * patches.len());
        let mut slopes = Vec::with_capacity(found.len());
        for (number, (side, slope)) in (0..).zip(found) {
            of_patch[side as usize / 2].slope[side as usize % 2] = Some(number);
            slopes.push(slope);
        }
        Solution {
            of_patch,
            slopes,
            largest_diameter: patches.diameter.iter().copied().fold(0.0, f32::max),
            ledger,
            patches: patches.len(),
            patch_size: patches.size as f32,
            map: patches.map,
            normals: patches.planes.iter().map(|plane| plane.normal).collect(),
            rays: self.rays,
            shots: self.shots,
            error,
            warnings: self.warnings,
        }
    }
}
