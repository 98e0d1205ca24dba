//! Where the flux went.

use glam::DVec3;

/// Where the flux went, W per band, f64. `emitted = absorbed + escaped + unshot` to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Ledger {
    /// Flux that light sources put into the scene (with [`DirectLight::Gather`](super::DirectLight::Gather): that reached a
    /// patch).
    pub emitted: [f64; 3],
    /// Flux absorbed by surfaces.
    pub absorbed: [f64; 3],
    /// Flux that met nothing.
    pub escaped: [f64; 3],
    /// Flux not shot when the solution stopped. With [`RadiosityParams::ambient`](super::RadiosityParams::ambient) its effect
    /// is in the radiosities nevertheless.
    pub unshot: [f64; 3],
}

impl Ledger {
    /// `emitted - absorbed - escaped - unshot` over `emitted`, the largest of the bands by magnitude; 0 without light.
    pub fn imbalance(&self) -> f64 {
        let band = |c: usize| {
            let rest = self.emitted[c] - self.absorbed[c] - self.escaped[c] - self.unshot[c];
            if self.emitted[c] > 0.0 { (rest / self.emitted[c]).abs() } else { rest.abs() }
        };
        (0..3).map(band).fold(0.0, f64::max)
    }

    /// Unshot over emitted flux, the largest of the bands.
    pub fn unshot_share(&self) -> f64 {
        let band = |c: usize| if self.emitted[c] > 0.0 { self.unshot[c] / self.emitted[c] } else { 0.0 };
        (0..3).map(band).fold(0.0, f64::max)
    }

    /// Adds `weight` times another ledger.
    pub(super) fn add(&mut self, other: &Ledger, weight: f64) {
        for c in 0..3 {
            self.emitted[c] += weight * other.emitted[c];
            self.absorbed[c] += weight * other.absorbed[c];
            self.escaped[c] += weight * other.escaped[c];
            self.unshot[c] += weight * other.unshot[c];
        }
    }
}

/// What became of photons besides what they brought to patches, W per band.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// Left the scene.
    pub escaped: DVec3,
    /// Left a patch again in a specular direction: counted as incident there, but neither absorbed nor reflected diffusely.
    pub passed_on: DVec3,
    /// Counts as shot but was absorbed, more than the mean reflectance of patches says; negative where it was less.
    pub kept: DVec3,
    /// Given up after too many specular reflections; counts as absorbed.
    pub lost: DVec3,
    /// Rays traced.
    pub rays: u64,
}

impl Tally {
    /// Adds another tally.
    pub fn add(&mut self, other: &Tally) {
        self.escaped += other.escaped;
        self.passed_on += other.passed_on;
        self.kept += other.kept;
        self.lost += other.lost;
        self.rays += other.rays;
    }
}
