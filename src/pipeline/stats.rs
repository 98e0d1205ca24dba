//! What a run did, cost and measured: the `--stats` file.

use serde::Serialize;
use serde_json::{Map, Value};

use super::cache::Fetched;
use crate::clock::Stopwatch;
use crate::radiosity::Solution;
use crate::render::{Film, IrradianceCache, Rendering, bias::Bias};
use crate::simplify::{Class, Simplified};

/// The `--stats` file. Keys are stable; new ones may be added.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Stats {
    /// Version of gsii.
    pub version: &'static str,
    /// Ray-tracing library and version.
    pub backend: String,
    /// Wall-clock seconds by stage.
    pub seconds: Seconds,
    /// Seconds of all cores together by stage.
    pub cpu_seconds: Seconds,
    /// Rays by stage.
    pub rays: Rays,
    /// How much there is of what.
    pub counts: Counts,
    /// Measured errors.
    pub error: Errors,
    /// Everything needed to repeat the run.
    pub parameters: Map<String, Value>,
    /// Where the preparation came from; `None` without a cache folder.
    pub cache: Option<CacheUse>,
    /// Energy balance of the radiosity solution, W per band.
    pub ledger: Option<crate::radiosity::Ledger>,
    /// Largest memory use of the process, bytes.
    pub peak_rss_bytes: u64,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Where the preparation came from; `None` for what was not needed.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct CacheUse {
    /// The simplified scene.
    pub simplify: Option<Fetched>,
    /// The radiosity solution.
    pub radiosity: Option<Fetched>,
    /// The irradiance cache that frames share.
    pub flight: Option<Fetched>,
}

/// Seconds by stage.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Seconds {
    /// Reading the scene.
    pub load: f64,
    /// Classifying, clustering, fitting boxes.
    pub simplify: f64,
    /// Building acceleration structures.
    pub build: f64,
    /// Radiosity solution.
    pub radiosity: f64,
    /// Photons for caustics.
    pub caustics: f64,
    /// Irradiance cache that frames share.
    pub flight: f64,
    /// HIRES pass.
    pub hires: f64,
    /// LORES pass.
    pub lores: f64,
    /// Measuring the bias.
    pub bias: f64,
    /// Writing images.
    pub write: f64,
    /// Everything.
    pub total: f64,
}

/// Rays by stage.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Rays {
    /// Fitting boxes.
    pub simplify: u64,
    /// Form factors and direct light of patches.
    pub radiosity: u64,
    /// HIRES pass.
    pub hires: u64,
    /// LORES pass.
    pub lores: u64,
}

/// How much there is of what.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
    /// Triangles of the detailed scene.
    pub triangles: u64,
    /// Surfaces of the detailed scene.
    pub surfaces: u64,
    /// Normal surfaces.
    pub normal: u64,
    /// Complex surfaces.
    pub complex: u64,
    /// Simple surfaces (faces of boxes).
    pub simple: u64,
    /// Clusters.
    pub clusters: u64,
    /// Patches of the radiosity solution.
    pub patches: u64,
    /// Photons for caustics.
    pub photons: u64,
    /// Trials that were not finite and were dropped.
    pub dropped_trials: u64,
}

/// Measured errors, all relative.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Errors {
    /// Standard error of HIRES over the image (root of relMSE).
    pub hires: f64,
    /// Standard error of LORES over the image.
    pub lores: f64,
    /// Standard error of the image.
    pub total: f64,
    /// Error of indirect light by interpolation between places, over the image: noise of the places and what changes between them.
    pub interpolation: Option<f64>,
    /// Noise and interpolation together: how far the image's pixels are off, but for bias of the far field.
    pub image: f64,
    /// Standard error of the radiosity solution.
    pub radiosity: f64,
    /// Mean over clusters of |intercepted flux of the box / of the cluster - 1|.
    pub fit: f64,
    /// Signed bias of the image's mean, where it was measured.
    pub bias: Option<f64>,
    /// Half of the bias' 95 % confidence interval.
    pub bias_ci: Option<f64>,
    /// Signed bias of the mean indirect component.
    pub bias_lores: Option<f64>,
    /// Half of its 95 % confidence interval.
    pub bias_lores_ci: Option<f64>,
}

impl Stats {
    /// Nothing done yet.
    pub fn new() -> Self {
        Stats { version: env!("CARGO_PKG_VERSION"), ..Stats::default() }
    }

    /// Adds the time since `start` to a stage.
    pub fn record_time(&mut self, start: Stopwatch, stage: impl Fn(&mut Seconds) -> &mut f64) {
        let spent = start.spent();
        *stage(&mut self.seconds) += spent.wall;
        *stage(&mut self.cpu_seconds) += spent.cpu;
    }

    /// The same facts at no cost: for an image from a preparation that was paid for by an earlier one.
    pub fn at_no_cost(self) -> Self {
        Stats { seconds: Seconds::default(), cpu_seconds: Seconds::default(), rays: Rays::default(), ..self }
    }

    /// Records what simplification found.
    pub fn record_simplified(&mut self, simplified: &Simplified) {
        let complex = simplified.surfaces.iter().filter(|s| s.class != Class::Normal).count() as u64;
        let clusters = &simplified.clusters;
        self.rays.simplify += simplified.rays;
        self.counts.surfaces = simplified.surfaces.len() as u64;
        self.counts.complex = complex;
        self.counts.normal = simplified.surfaces.len() as u64 - complex;
        self.counts.clusters = clusters.len() as u64;
        self.counts.simple = 6 * clusters.len() as u64;
        let misfit: f64 = clusters.iter().map(|c| f64::from(c.residual.intercepted.abs())).sum();
        self.error.fit = misfit / clusters.len().max(1) as f64;
        self.warnings.extend(simplified.warnings.iter().cloned());
    }

    /// Records the radiosity solution.
    pub fn record_solution(&mut self, solution: &Solution) {
        self.rays.radiosity += solution.rays;
        self.counts.patches = solution.patches as u64;
        self.error.radiosity = f64::from(solution.error);
        self.ledger = Some(solution.ledger);
        self.warnings.extend(solution.warnings.iter().cloned());
    }

    /// Records both passes.
    pub fn record_rendering(&mut self, rendering: &Rendering) {
        for (seconds, times) in [(&mut self.seconds, rendering.times), (&mut self.cpu_seconds, rendering.cpu_times)] {
            seconds.hires += times.hires.as_secs_f64();
            seconds.lores += times.lores.as_secs_f64();
        }
        self.rays.hires += rendering.rays.hires();
        self.rays.lores += rendering.rays.lores();
        self.record_film(&rendering.film);
    }

    /// Records how noisy an image is.
    pub fn record_film(&mut self, film: &Film) {
        let errors = film.relative_errors();
        (self.error.hires, self.error.lores, self.error.total) = (errors.hires, errors.lores, errors.total);
        self.error.image = errors.total;
        self.counts.dropped_trials = film.tiles.iter().map(|t| t.dropped).sum();
    }

    /// Records what `film` may be off by interpolation between the places of `cache`.
    pub fn record_interpolation(&mut self, cache: &IrradianceCache, film: &Film) {
        self.error.interpolation = cache.error().map(|error| error * film.share_of_lores());
        self.error.image = self.error.total.hypot(self.error.interpolation.unwrap_or(0.0));
    }

    /// Records the bias meter, relative to the radiance of `film`.
    pub fn record_bias(&mut self, bias: &Bias, film: &Film) {
        let hires = film.mean(|p| p.hires.mean());
        let lores = bias.reference.iter().sum::<f64>() / 3.0;
        let (mean, ci) = bias.relative_to(hires + lores);
        (self.error.bias, self.error.bias_ci) = (Some(mean), Some(ci));
        let (mean, ci) = bias.relative_to(lores);
        (self.error.bias_lores, self.error.bias_lores_ci) = (Some(mean), Some(ci));
    }
}
