//! What one thread needs while it follows paths.

use glam::Vec3;

use super::cache::Nearby;
use super::film::Feature;
use super::path::{Met, Path, Shadow};
use super::tally::{PassTimes, RayCounts};
use crate::backend::{Hit, Ray};
use crate::lighting::guide::LightGuide;
use crate::lighting::shadow::{ShadowBuffers, ShadowRay};
use crate::lighting::{LightSample, Lit};

/// Buffers of one thread, reused from batch to batch.
#[derive(Default)]
pub struct Workspace {
    pub(super) paths: Vec<Path>,
    pub(super) next: Vec<Path>,
    /// Indices into `paths` of the rays in `rays`.
    pub(super) traced: Vec<u32>,
    pub(super) rays: Vec<Ray>,
    pub(super) hits: Vec<Hit>,
    pub(super) far: Vec<u32>,
    /// What is shaded next, with a light sample for each that is lit.
    pub(super) met: Vec<Met>,
    pub(super) lit: Vec<Lit>,
    pub(super) lights: Vec<Option<LightSample>>,
    pub(super) shadows: Vec<Shadow>,
    pub(super) shadow_rays: Vec<ShadowRay>,
    pub(super) shadow_buffers: ShadowBuffers,
    pub(super) transmittance: Vec<Vec3>,
    pub(super) hires: Vec<Vec3>,
    pub(super) lores: Vec<Vec3>,
    /// What view rays meet first, one a trial; empty when nobody wants to know.
    pub(super) features: Vec<Feature>,
    /// How far each trial's first ray went; empty when nobody wants to know.
    pub(super) distances: Vec<f32>,
    /// Where the points that view rays meet find light, where they ask for it.
    pub(super) guide: Option<LightGuide>,
    /// What the irradiance cache says around the points of this batch.
    pub(super) nearby: Nearby,
    /// Width of a pixel at the start of view rays and its growth over distance; zero reads textures at their full resolution.
    pub(super) cone: [f32; 2],
    /// Rays traced since this was last reset.
    pub counts: RayCounts,
    /// Time spent since this was last reset.
    pub times: PassTimes,
}

impl Workspace {
    /// A ray met something at distance `t`.
    pub(super) fn note_distance(&mut self, path: u32, t: f32) {
        let trial = self.paths[path as usize].trial;
        if let Some(distance) = self.distances.get_mut(trial as usize)
            && distance.is_infinite()
        {
            *distance = t;
        }
    }

    /// A gather ray ended in the detailed scene.
    pub(super) fn note_near(&mut self, path: u32) {
        let path = &self.paths[path as usize];
        if path.gathers
            && let Some(feature) = self.features.get_mut(path.trial as usize)
        {
            feature.near += 1;
        }
    }

    /// A gather ray of length `distance` looked a radiosity up.
    pub(super) fn note_lookup(&mut self, path: u32, distance: f32) {
        let trial = self.paths[path as usize].trial;
        if let Some(feature) = self.features.get_mut(trial as usize) {
            feature.lookups += 1;
            feature.lookup_distance += distance;
        }
    }

    /// Forgets the last batch and makes room for the sums of `trials` trials.
    pub(super) fn start(&mut self, trials: usize) {
        self.paths.clear();
        self.features.clear();
        self.distances.clear();
        self.nearby.clear();
        self.guide = None;
        self.cone = [0.0; 2];
        for sums in [&mut self.hires, &mut self.lores] {
            sums.clear();
            sums.resize(trials, Vec3::ZERO);
        }
    }
}
