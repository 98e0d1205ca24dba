//! What a rendering is of, and what it is asked for.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::cache::IrradianceCache;
use super::caustics::Caustics;
use super::look_up::{LookUp, most_specular, rough_probability};
use super::nearness::Nearness;
use super::path::{Passes, Path};
use crate::backend::{Hit, RayScene};
use crate::lighting::Lights;
use crate::radiosity::Solution;
use crate::scene::{Material, Scene};
use crate::shading::{Lobes, SurfacePoint};
use crate::simplify::{Simplified, SimplifiedGeometry};

/// Everything that does not change while an image is rendered.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// Geometry and materials.
    pub scene: &'a Scene,
    /// Light sources.
    pub lights: &'a Lights,
    /// Normal and complex surfaces.
    pub detailed: &'a dyn RayScene,
    /// How the far field's scene came about, for layers that show it.
    pub simplified: Option<&'a Simplified>,
    /// The far field; without one all light is path traced (MCPT).
    pub far: Option<FarField<'a>>,
    /// Specular lobes at points that gather rays meet. View chains use the same threshold but see every surface as smooth
    /// as it is.
    pub gather_lobes: Lobes,
    /// Indirect light of diffuse surfaces that the camera sees, where it is not gathered by each path.
    pub cache: Option<&'a IrradianceCache>,
    /// Photons from small light sources; without any, gather rays must meet all light sources.
    pub caustics: Option<&'a Caustics>,
    /// Scattering events after which paths end.
    pub max_depth: u32,
}

/// A gather path that is about to start, and where.
#[derive(Clone, Debug)]
pub struct Captured {
    /// The path.
    pub path: Path,
    /// Where it starts.
    pub point: SurfacePoint,
    /// Shading normal on the side that the camera sees.
    pub normal: Vec3,
    /// Whether any part of the surface is diffuse.
    pub diffuse: bool,
}

/// Where radiance beyond `r_thresh` comes from.
#[derive(Clone, Copy)]
pub struct FarField<'a> {
    /// Normal and simple surfaces (or normal and complex: PMM).
    pub rays: &'a dyn RayScene,
    /// The same as triangles.
    pub geometry: &'a SimplifiedGeometry,
    /// Radiosities of their patches.
    pub solution: &'a Solution,
    /// Which of its triangles emit nothing and reflect nothing but what is looked up.
    pub plain: &'a [bool],
    /// Mean length of a gather ray's near part; 0 for PMM.
    pub r_thresh: f32,
    /// Where near parts need the detailed scene; `None` when the geometry is complete.
    pub nearness: Option<&'a Nearness>,
}

impl World<'_> {
    /// Whether there is a far field beyond a near one, as an irradiance cache needs.
    pub fn has_two_fields(&self) -> bool {
        self.far.is_some_and(|far| far.r_thresh > 0.0 && far.r_thresh.is_finite())
    }
}

impl FarField<'_> {
    /// Radiance without emission that a ray into `direction` meets at a hit on the far field's geometry, W/(sr m^2).
    pub fn reflected(&self, hit: &Hit, direction: Vec3) -> Vec3 {
        let front = self.solution.is_front(hit.triangle, direction);
        self.solution.radiosity(hit.triangle, hit.u, hit.v, front) * FRAC_1_PI
    }

    /// What is used of that on a triangle of the scene: without direct light where the patch's mean says little of this very point, and without
    /// rough reflection where there is a near field. PMM is the paper's.
    pub fn look_up(&self, hit: &Hit, direction: Vec3, material: &Material) -> LookUp {
        let front = self.solution.is_front(hit.triangle, direction);
        let (radiosity, unlit) = self.solution.look_up(hit.triangle, hit.u, hit.v, front);
        let probability = if unlit || self.plain[hit.triangle as usize] {
            1.0
        } else {
            rough_probability(most_specular(material, self.solution.cosine(hit.triangle, direction)))
        };
        let rough = self.r_thresh > 0.0 && !material.is_lambertian();
        LookUp { radiance: radiosity * FRAC_1_PI, unlit, rough, probability }
    }
}

/// A batch of trials of one tile.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Numbers of the pixels.
    pub pixels: &'a [u32],
    /// Number of the first trial.
    pub first: u32,
    /// Number of trials for each pixel.
    pub trials: u32,
    /// Passes to feed.
    pub passes: Passes,
    /// Whether to record what view rays meet first.
    pub features: bool,
    /// Seed of the image.
    pub seed: u32,
}
