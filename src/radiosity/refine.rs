//! Progressive refinement: the sides with the largest unshot flux shoot first, until little is left.

use glam::DVec3;
use rayon::prelude::*;

use super::arrived::Arrived;
use super::ledger::{Ledger, Tally};
use super::shoot::{Shot, Tracer};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::sampling;

/// Share of the unshot flux that one batch of shots takes at least: as many sides as are needed, largest first.
const BATCH: f64 = 0.75;
/// Sides that are looked at by one job.
const SIDES_OF_A_JOB: usize = 4096;
/// Leading bits of an importance, behind its sign, that tell how large it is: exponent and four bits, steps of 3 to 6 %.
const STEP_BITS: u32 = 8 + 4;
/// A scene is given up when it has shot its light this many times over ...
const HOPELESS_SHOTS: f64 = 10.0;
/// ... and lost less than this share of what it shot.
const HOPELESS_LOSS: f64 = 1e-5;

/// What has arrived and was not shot yet.
#[derive(Default)]
pub(super) struct Unshot {
    /// Of all sides, W.
    flux: DVec3,
    /// The same in all bands, each side weighted with its relevance.
    relevant: f64,
    /// Importance of what each side has.
    importance: Vec<f32>,
}

impl Unshot {
    /// The importance from which on sides together have at least `share` of all of it; above 0. Found to one step of [`STEP_BITS`], so
    /// that nothing need be sorted.
    fn least_of_largest(&self, share: f64) -> f32 {
        let shift = 31 - STEP_BITS;
        let mut steps = [0.0; 1 << STEP_BITS];
        for &importance in self.importance.iter().filter(|&&x| x > 0.0) {
            steps[(importance.to_bits() >> shift) as usize] += f64::from(importance);
        }
        let total: f64 = steps.iter().sum();
        let mut sum = 0.0;
        for (step, within) in steps.iter().enumerate().rev() {
            sum += within;
            if sum >= share * total {
                return f32::from_bits((step as u32) << shift).max(f32::MIN_POSITIVE);
            }
        }
        f32::MIN_POSITIVE
    }
}

/// One independent solution in the making. Flux in W, one entry a side.
pub(super) struct Run<'a> {
    tracer: &'a Tracer<'a>,
    /// Light from light sources that arrived.
    direct: Vec<DVec3>,
    /// All light that arrived.
    arrived: Arrived,
    /// Reflected light that was shot.
    shot: Vec<DVec3>,
    /// The sum of it.
    all_shot: DVec3,
    /// Light that the ledger starts from.
    emitted: DVec3,
    /// Its inverse, 0 in bands without light.
    per_emitted: DVec3,
    tally: Tally,
    /// `tally` when only the light sources had shot.
    tally_direct: Tally,
    /// How much of `direct`, in all bands, is relevant; 1 with equal weights.
    relevant_direct: f64,
    /// Number of shots.
    pub shots: u64,
    stream: u32,
}

impl<'a> Run<'a> {
    /// Starts from direct light that `arrived`; `emitted` of it left the light sources and `tally` is what else became of
    /// that.
    pub fn new(tracer: &'a Tracer<'a>, arrived: Arrived, emitted: DVec3, tally: Tally, stream: u32) -> Self {
        let direct = arrived.flux.clone();
        let shot = vec![DVec3::ZERO; direct.len()];
        let (mut all, mut relevant) = (0.0, 0.0);
        for (patch, sides) in direct.chunks(2).enumerate() {
            let flux: f64 = sides.iter().map(|flux| flux.element_sum()).sum();
            all += flux;
            relevant += tracer.patches.relevance[patch] * flux;
        }
        Run {
            tracer,
            direct,
            arrived,
            shot,
            all_shot: DVec3::ZERO,
            emitted,
            per_emitted: DVec3::select(emitted.cmpgt(DVec3::ZERO), 1.0 / emitted, DVec3::ZERO),
            tally,
            tally_direct: tally,
            relevant_direct: if all > 0.0 { relevant / all } else { 1.0 },
            shots: 0,
            stream,
        }
    }

    /// All light that arrived.
    pub fn arrived(&self) -> &Arrived {
        &self.arrived
    }

    /// Rays traced so far.
    pub fn rays(&self) -> u64 {
        self.tally.rays
    }

    fn reflectance(&self, side: usize) -> DVec3 {
        self.tracer.optics.reflectance[side / 2].as_dvec3()
    }

    fn unshot(&self, side: usize) -> DVec3 {
        self.reflectance(side) * self.arrived.flux[side] - self.shot[side]
    }

    /// Energy balance.
    pub fn ledger(&self) -> Ledger {
        let (mut absorbed, mut unshot) = (self.tally.lost + self.tally.kept - self.tally.passed_on, DVec3::ZERO);
        for (side, incident) in self.arrived.flux.iter().enumerate() {
            absorbed += (1.0 - self.reflectance(side)) * incident;
            unshot += self.unshot(side);
        }
        Ledger {
            emitted: self.emitted.to_array(),
            absorbed: absorbed.to_array(),
            escaped: self.tally.escaped.to_array(),
            unshot: unshot.to_array(),
        }
    }

    /// What flux of a side counts in choosing what to shoot and with how many rays: each band by its share in the emitted flux,
    /// so that none is left behind, and by how relevant the side is.
    fn importance(&self, side: usize, flux: DVec3) -> f64 {
        self.tracer.patches.relevance[side / 2] * flux.dot(self.per_emitted)
    }

    /// Finds out what is unshot now.
    pub fn survey(&self, unshot: &mut Unshot) {
        unshot.importance.resize(self.arrived.flux.len(), 0.0);
        let of_job = |(job, importance): (usize, &mut [f32])| {
            let (mut flux, mut relevant) = (DVec3::ZERO, 0.0);
            for (side, importance) in (job * SIDES_OF_A_JOB..).zip(importance) {
                let of_side = self.unshot(side);
                flux += of_side;
                relevant += self.tracer.patches.relevance[side / 2] * of_side.element_sum();
                *importance = self.importance(side, of_side) as f32;
            }
            (flux, relevant)
        };
        let jobs: Vec<(DVec3, f64)> =
            unshot.importance.par_chunks_mut(SIDES_OF_A_JOB).enumerate().map(of_job).collect();
        // In order, for the same sum with any number of threads.
        let sum = |sum: (DVec3, f64), job: (DVec3, f64)| (sum.0 + job.0, sum.1 + job.1);
        (unshot.flux, unshot.relevant) = jobs.into_iter().fold((DVec3::ZERO, 0.0), sum);
    }

    /// How much more (or less) of what is relevant is unshot than of everything, each in proportion to the light it got from light
    /// sources; 1 with equal weights.
    fn relevant_unshot(&self, unshot: &Unshot) -> f64 {
        let all = unshot.flux.element_sum();
        if all > 0.0 && self.relevant_direct > 0.0 { unshot.relevant / all / self.relevant_direct } else { 1.0 }
    }

    /// Unshot over emitted flux, the largest of the bands.
    fn unshot_share(&self, unshot: &Unshot) -> f64 {
        Ledger { emitted: self.emitted.to_array(), unshot: unshot.flux.to_array(), ..Ledger::default() }.unshot_share()
    }

    /// Shoots with `rays` rays for the light that is unshot at the start, until the share of unshot flux is below `limit`.
    ///
    /// Of light that is reflected often, later shots are ever smaller parts of all that has been shot, and get fewer rays: of flux f, after S
    /// has been shot, n = N f / sqrt(f0 S), with N the rays and f0 the flux at the start. The relative variance of the sum, the sum of
    /// f^2 / n over its square, is then at most 4/3 of that of as many rays in equal density, while their number grows only with the
    /// root of the number of reflections: where there are a thousand, 63 N and not 1000 N.
    ///
    /// # Errors
    /// [`Error::Unsolvable`] when the light does not decrease.
    pub fn refine(&mut self, rays: u64, limit: f64, progress: &Progress) -> Result<()> {
        let mut unshot = Unshot::default();
        self.survey(&mut unshot);
        let initial: f64 = unshot.importance.iter().copied().map(f64::from).sum();
        let mut shot = 0.0;
        let total_steps = 1000.0;
        let bar = progress.stage("radiosity", total_steps as u64);
        loop {
            debug_assert!(self.ledger().imbalance() < 1e-6, "energy is not conserved: {:?}", self.ledger());
            let share = self.unshot_share(&unshot) * self.relevant_unshot(&unshot);
            if share < limit || progress.stopped() {
                break;
            }
            bar.set_position((total_steps * (share.min(1.0).ln() / limit.ln()).clamp(0.0, 1.0)) as u64);
            self.check_solvable(&unshot)?;
            shot += self.step(&unshot, rays as f64 / (initial * initial.max(shot)).sqrt());
            self.survey(&mut unshot);
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// One batch of shots, with `density` rays for each unit of importance. Returns their importance.
    pub fn step(&mut self, unshot: &Unshot, density: f64) -> f64 {
        let (shots, importance) = self.next_shots(unshot, density);
        for shot in &shots {
            let side = shot.side as usize;
            self.all_shot += self.unshot(side);
            self.shot[side] = self.reflectance(side) * self.arrived.flux[side];
        }
        let tally = self.tracer.shoot(&shots, &mut self.arrived);
        self.tally.add(&tally);
        self.shots += shots.len() as u64;
        importance
    }

    /// The sides with the largest unshot flux that hold a share of [`BATCH`] of it, and the importance of what they shoot.
    fn next_shots(&mut self, unshot: &Unshot, density: f64) -> (Vec<Shot>, f64) {
        let least = unshot.least_of_largest(BATCH);
        let (mut shots, mut sum) = (Vec::new(), 0.0);
        for (side, &importance) in (0u32..).zip(&unshot.importance) {
            if importance < least {
                continue;
            }
            let importance = f64::from(importance);
            sum += importance;
            let rays = (importance * density).round().clamp(1.0, u32::MAX.into()) as u32;
            let stream = sampling::hash_all(&[self.stream, side, (self.shots + shots.len() as u64) as u32]);
            let from = self.arrived.take_places(side);
            shots.push(Shot { side, rays, flux: self.unshot(side as usize) / f64::from(rays), stream, from });
        }
        (shots, sum)
    }

    fn check_solvable(&self, unshot: &Unshot) -> Result<()> {
        let shot = self.all_shot;
        for c in 0..3 {
            let start = self.emitted[c];
            let lost = start - unshot.flux[c];
            if start > 0.0 && shot[c] > HOPELESS_SHOTS * start && lost < HOPELESS_LOSS * shot[c] {
                return Err(Error::Unsolvable(format!(
                    "light cannot leave the scene: it was reflected {:.0} times over and lost {:.1e} of it; surfaces that \
                     enclose a light source need a reflectance below 1, or an opening",
                    shot[c] / start,
                    lost / shot[c]
                )));
            }
        }
        Ok(())
    }

    /// Incident flux of each side. With `ambient` including an estimate of what the unshot flux would still bring: as much, in
    /// proportion to the flux lost so far by reflected light, as reflected light has brought each side so far. Adding it once
    /// removes the mean of the truncation error (Cohen et al. 1988 spread it evenly; that would light sealed rooms).
    pub fn incident(&self, ambient: bool) -> Vec<DVec3> {
        if !ambient {
            return self.arrived.flux.clone();
        }
        let mut unshot = Unshot::default();
        self.survey(&mut unshot);
        let lost = |tally: &Tally| tally.escaped + tally.lost + tally.kept - tally.passed_on;
        let mut lost = lost(&self.tally) - lost(&self.tally_direct);
        for (side, (incident, direct)) in self.arrived.flux.iter().zip(&self.direct).enumerate() {
            lost += (1.0 - self.reflectance(side)) * (incident - direct);
        }
        let unshot = unshot.flux * self.relevant_unshot(&unshot);
        let factor = DVec3::from_array(std::array::from_fn(|c| if lost[c] > 0.0 { unshot[c] / lost[c] } else { 0.0 }));
        self.arrived.flux.iter().zip(&self.direct).map(|(i, d)| i + factor * (i - d)).collect()
    }
}
