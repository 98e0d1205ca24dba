//! Progressive refinement radiosity on the simplified scene, with form factors by ray casting.

use glam::Vec3;

use crate::backend::RayScene;
use crate::error::Result;
use crate::lighting::Lights;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::simplify::{Cluster, SimplifiedGeometry};

/// Parameters of [`solve`].
#[derive(Clone, Debug, PartialEq)]
pub struct RadiosityParams {
    /// Target edge length of patches, scene length units.
    pub patch_size: f32,
    /// Stop when this share of the emitted flux is unshot; the paper's is 0.01.
    pub unshot: f64,
    /// How direct light reaches the patches.
    pub direct: DirectLight,
    /// Relative statistical error to aim for: decides how many rays are shot.
    pub error: f32,
    /// Seed.
    pub seed: u32,
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

/// Where the flux went, W per band, f64. `emitted = absorbed + escaped + unshot` to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Ledger {
    /// Flux that light sources put into the scene (with [`DirectLight::Gather`]: that reached a patch).
    pub emitted: [f64; 3],
    /// Flux absorbed by surfaces.
    pub absorbed: [f64; 3],
    /// Flux that met nothing.
    pub escaped: [f64; 3],
    /// Flux not shot yet.
    pub unshot: [f64; 3],
}

/// Radiosities of both sides of every patch, and the way from a hit to its patch.
#[derive(Clone, Debug)]
pub struct Solution {
    // fields are the radiosity helper's
    /// Energy balance.
    pub ledger: Ledger,
    /// Number of patches.
    pub patches: usize,
    /// Rays traced.
    pub rays: u64,
    /// Number of shots.
    pub shots: u64,
    /// Relative standard error of the solution (flux-weighted mean over patches), from independent halves.
    pub error: f32,
    /// Sentences for the user.
    pub warnings: Vec<String>,
}

impl Solution {
    /// Radiosity minus emission (W/m^2) of the patch at barycentrics `u`, `v` of a triangle of the geometry, on its front
    /// (counter-clockwise) or back side.
    pub fn radiosity(&self, triangle: u32, u: f32, v: f32, front: bool) -> Vec3 {
        let _ = (triangle, u, v, front);
        todo!("radiosity helper")
    }

    /// Diameter of that patch.
    pub fn patch_diameter(&self, triangle: u32, u: f32, v: f32) -> f32 {
        let _ = (triangle, u, v);
        todo!("radiosity helper")
    }
}

/// Solves for all radiosities.
///
/// # Errors
/// [`Error::Unsolvable`](crate::error::Error::Unsolvable) when a closed scene cannot lose energy.
pub fn solve(input: &RadiosityScene<'_>, params: &RadiosityParams, progress: &Progress) -> Result<Solution> {
    let _ = (input, params, progress);
    todo!("radiosity helper")
}
