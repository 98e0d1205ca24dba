//! Progressive refinement: the sides with the largest unshot flux shoot first, until little is left.

use glam::DVec3;
use rayon::prelude::*;

use super::ledger::{Ledger, Tally};
use super::shoot::{Shot, Tracer};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::sampling;

/// Share of the unshot flux that one batch of shots takes: as many sides as are needed, largest first.
const BATCH: f64 = 0.5;
/// Fewest sides that are worth another thread.
const SIDES_OF_A_JOB: usize = 1024;
/// A scene is given up when it has shot its light this many times over ...
const HOPELESS_SHOTS: f64 = 10.0;
/// ... and lost less than this share of what it shot.
const HOPELESS_LOSS: f64 = 1e-5;

/// One independent solution in the making. Flux in W, one entry a side.
pub(super) struct Run<'a> {
    tracer: &'a Tracer<'a>,
    /// Light from light sources that arrived.
    direct: Vec<DVec3>,
    /// All light that arrived.
    incident: Vec<DVec3>,
    /// Reflected light that was shot.
    shot: Vec<DVec3>,
    /// Light that the ledger starts from.
    emitted: DVec3,
    tally: Tally,
    /// `tally` when only the light sources had shot.
    tally_direct: Tally,
    /// Number of shots.
    pub shots: u64,
    stream: u32,
}

impl<'a> Run<'a> {
    /// Starts from `direct` light on each side; `emitted` of it left the light sources and `tally` is what else became of
    /// that.
    pub fn new(tracer: &'a Tracer<'a>, direct: Vec<DVec3>, emitted: DVec3, tally: Tally, stream: u32) -> Self {
        let incident = direct.clone();
        let shot = vec![DVec3::ZERO; direct.len()];
        Run { tracer, direct, incident, shot, emitted, tally, tally_direct: tally, shots: 0, stream }
    }

    /// Rays traced so far.
    pub fn rays(&self) -> u64 {
        self.tally.rays
    }

    fn reflectance(&self, side: usize) -> DVec3 {
        self.tracer.optics.reflectance[side / 2].as_dvec3()
    }

    fn unshot(&self, side: usize) -> DVec3 {
        self.reflectance(side) * self.incident[side] - self.shot[side]
    }

    /// Energy balance.
    pub fn ledger(&self) -> Ledger {
        let (mut absorbed, mut unshot) = (self.tally.lost - self.tally.passed_on, DVec3::ZERO);
        for (side, incident) in self.incident.iter().enumerate() {
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
        let shares = (0..3).filter(|&c| self.emitted[c] > 0.0).map(|c| flux[c] / self.emitted[c]);
        self.tracer.patches.relevance[side / 2] * shares.sum::<f64>()
    }

    /// How much more (or less) of what is relevant is unshot than of everything, each in proportion to the light it got from light
    /// sources; 1 with equal weights.
    fn relevant_unshot(&self) -> f64 {
        let weigh = |flux: &dyn Fn(usize) -> DVec3| -> [f64; 2] {
            (0..self.incident.len()).fold([0.0; 2], |[all, relevant], side| {
                let flux = flux(side).element_sum();
                [all + flux, relevant + self.tracer.patches.relevance[side / 2] * flux]
            })
        };
        let (unshot, direct) = (weigh(&|side| self.unshot(side)), weigh(&|side| self.direct[side]));
        if unshot[0] > 0.0 && direct[1] > 0.0 { unshot[1] / unshot[0] * (direct[0] / direct[1]) } else { 1.0 }
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
        // In a thread of the pool, which then need not be woken for each of perhaps thousands of small batches.
        rayon::scope(|_| self.refine_within_pool(rays, limit, progress))
    }

    fn refine_within_pool(&mut self, rays: u64, limit: f64, progress: &Progress) -> Result<()> {
        let initial: f64 = (0..self.incident.len()).map(|s| self.importance(s, self.unshot(s))).sum();
        let mut shot = 0.0;
        let total_steps = 1000.0;
        let bar = progress.stage("radiosity", total_steps as u64);
        loop {
            let ledger = self.ledger();
            debug_assert!(ledger.imbalance() < 1e-6, "energy is not conserved: {ledger:?}");
            let share = ledger.unshot_share() * self.relevant_unshot();
            if share < limit || progress.stopped() {
                break;
            }
            bar.set_position((total_steps * (share.min(1.0).ln() / limit.ln()).clamp(0.0, 1.0)) as u64);
            self.check_solvable(&ledger)?;
            shot += self.step(rays as f64 / (initial * initial.max(shot)).sqrt());
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// One batch of shots, with `density` rays for each unit of importance. Returns their importance.
    pub fn step(&mut self, density: f64) -> f64 {
        let (shots, importance) = self.next_shots(density);
        for shot in &shots {
            let side = shot.side as usize;
            self.shot[side] = self.reflectance(side) * self.incident[side];
        }
        let tally = self.tracer.shoot(&shots, &mut self.incident);
        self.tally.add(&tally);
        self.shots += shots.len() as u64;
        importance
    }

    /// The smallest set of sides that holds a share of [`BATCH`] of the unshot flux, and the importance of what they shoot.
    fn next_shots(&self, density: f64) -> (Vec<Shot>, f64) {
        let mut order: Vec<(f64, u32)> = (0..self.incident.len())
            .into_par_iter()
            .with_min_len(SIDES_OF_A_JOB)
            .map(|side| (self.importance(side, self.unshot(side)), side as u32))
            .filter(|&(importance, _)| importance > 0.0)
            .collect();
        order.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let total: f64 = order.iter().map(|o| o.0).sum();
        let (mut count, mut sum) = (0, 0.0);
        while count < order.len() && sum < BATCH * total {
            sum += order[count].0;
            count += 1;
        }
        let shots = order[..count]
            .iter()
            .zip(self.shots..)
            .map(|(&(importance, side), number)| {
                let rays = (importance * density).round().clamp(1.0, u32::MAX.into()) as u32;
                let stream = sampling::hash_all(&[self.stream, side, number as u32]);
                Shot { side, rays, flux: self.unshot(side as usize) / f64::from(rays), stream }
            })
            .collect();
        (shots, sum)
    }

    fn check_solvable(&self, ledger: &Ledger) -> Result<()> {
        let shot: DVec3 = self.shot.iter().sum();
        for c in 0..3 {
            let start = self.emitted[c];
            let lost = ledger.emitted[c] - ledger.unshot[c];
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
            return self.incident.clone();
        }
        let ledger = self.ledger();
        let mut lost = self.tally.escaped - self.tally_direct.escaped + self.tally.lost
            - self.tally_direct.lost
            - (self.tally.passed_on - self.tally_direct.passed_on);
        for (side, (incident, direct)) in self.incident.iter().zip(&self.direct).enumerate() {
            lost += (1.0 - self.reflectance(side)) * (incident - direct);
        }
        let unshot = DVec3::from_array(ledger.unshot) * self.relevant_unshot();
        let factor = DVec3::from_array(std::array::from_fn(|c| if lost[c] > 0.0 { unshot[c] / lost[c] } else { 0.0 }));
        self.incident.iter().zip(&self.direct).map(|(i, d)| i + factor * (i - d)).collect()
    }
}
