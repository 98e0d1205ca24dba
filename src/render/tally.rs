//! What rendering costs: rays and time, by pass.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Rays traced, by purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RayCounts {
    /// Camera rays and their highly directional chains.
    pub view: u64,
    /// Near parts of gather rays, in the detailed scene.
    pub near: u64,
    /// Far parts of gather rays, in the simplified scene.
    pub far: u64,
    /// Shadow rays at points seen by the camera.
    pub shadow_hires: u64,
    /// Shadow rays at points that gather rays hit.
    pub shadow_lores: u64,
}

impl RayCounts {
    /// Rays of the HIRES pass.
    pub fn hires(&self) -> u64 {
        self.view + self.shadow_hires
    }

    /// Rays of the LORES pass.
    pub fn lores(&self) -> u64 {
        self.near + self.far + self.shadow_lores
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, o: Self) {
        self.view += o.view;
        self.near += o.near;
        self.far += o.far;
        self.shadow_hires += o.shadow_hires;
        self.shadow_lores += o.shadow_lores;
    }
}

/// Time spent in the two passes. A round of view rays with its shadow rays is HIRES, the rounds after it are LORES.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PassTimes {
    /// In HIRES.
    pub hires: Duration,
    /// In LORES.
    pub lores: Duration,
}

impl PassTimes {
    /// Share of HIRES, 0..=1.
    pub fn hires_share(self) -> f64 {
        let sum = (self.hires + self.lores).as_secs_f64();
        if sum > 0.0 { self.hires.as_secs_f64() / sum } else { 0.0 }
    }

    /// The same shares of another total.
    pub fn scaled_to(self, total: Duration) -> PassTimes {
        let hires = total.mul_f64(self.hires_share());
        PassTimes { hires, lores: total - hires }
    }

    /// The same shares of `total`, less what filling the irradiance cache took: that is LORES.
    pub(super) fn after_cache(self, total: Duration, filled: Duration) -> PassTimes {
        let mut times = self.scaled_to(total.saturating_sub(filled));
        times.lores += filled;
        times
    }
}

/// What some work has cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// Rays traced.
    pub rays: RayCounts,
    /// Time that threads spent.
    pub times: PassTimes,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, o: Self) {
        self.rays += o.rays;
        self.times += o.times;
    }
}

impl std::iter::Sum for Tally {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Tally::default(), |mut sum, one| {
            sum += one;
            sum
        })
    }
}

impl std::ops::AddAssign for PassTimes {
    fn add_assign(&mut self, o: Self) {
        self.hires += o.hires;
        self.lores += o.lores;
    }
}
