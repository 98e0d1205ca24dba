//! The state of one path between two batches of rays.

use glam::Vec3;

use super::look_up::LookUp;
use crate::backend::{Hit, Ray};
use crate::lighting::guide::Guided;
use crate::sampling::SobolPoint;
use crate::shading::SurfacePoint;

/// Blocks of four random numbers for each scattering event: one for light, one for the path.
const BLOCKS_PER_EVENT: u32 = 2;

/// Which passes a batch of trials feeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passes {
    /// Emission, highly directional chains and direct light.
    pub hires: bool,
    /// Indirect light.
    pub lores: bool,
}

impl Passes {
    /// Both from the same view rays.
    pub const BOTH: Passes = Passes { hires: true, lores: true };
    /// Only HIRES.
    pub const HIRES: Passes = Passes { hires: true, lores: false };
    /// Only LORES.
    pub const LORES: Passes = Passes { hires: false, lores: true };
}

/// How the current ray of a path came to be: decides whether emission that it meets was already counted by next-event
/// estimation at the ray's start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrival {
    /// From the camera, a mirror or refracting glass: emission counts in full.
    Sharp,
    /// From a glossy lobe, or a rough one where a gather goes on, with this density: emission is weighted against next-event estimation (balance heuristic).
    Glossy {
        /// Density per solid angle with which the direction was sampled.
        pdf: f32,
        /// Where the lobe was sampled.
        position: Vec3,
        /// Shading normal there, on the lit side.
        normal: Vec3,
    },
    /// From another weakly directional lobe: next-event estimation has all of it.
    Soft,
}

/// One path.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// The ray to trace next.
    pub ray: Ray,
    /// What the radiance that this ray brings is multiplied with.
    pub throughput: Vec3,
    /// Rest of the distance over which the ray meets the detailed scene: infinite for view rays and path tracing, r_thresh
    /// (randomised, less what the path already went since its last weakly directional bounce) for gather rays.
    pub near: f32,
    /// How the ray came to be.
    pub arrival: Arrival,
    /// Whether a weakly directional bounce lies behind: the path belongs to LORES.
    pub gathers: bool,
    /// Whether the last event since then bent light in a way that photons follow, too (see [`caustics`](super::caustics)).
    pub bent: bool,
    /// Scattering events so far.
    pub depth: u32,
    /// Index of the trial in its batch.
    pub trial: u32,
    /// Random numbers of the trial.
    pub numbers: SobolPoint,
}

impl Path {
    /// A path that leaves the camera along `ray`.
    #[inline]
    pub fn view(ray: Ray, trial: u32, numbers: SobolPoint) -> Self {
        Path {
            ray,
            throughput: Vec3::ONE,
            near: f32::INFINITY,
            arrival: Arrival::Sharp,
            gathers: false,
            bent: false,
            depth: 0,
            trial,
            numbers,
        }
    }

    /// Four random numbers of this scattering event, of `block` 0 or 1. The camera has the block before the first event's.
    #[inline]
    pub(super) fn random(&self, block: u32) -> [f32; 4] {
        self.numbers.block(1 + self.depth * BLOCKS_PER_EVENT + block)
    }
}

/// A shadow ray and what it brings when nothing is in its way.
#[derive(Clone, Copy, Debug)]
pub struct Shadow {
    /// Radiance to add to the trial.
    pub radiance: Vec3,
    /// Index of the trial in its batch.
    pub trial: u32,
    /// Whether it goes to LORES.
    pub gathers: bool,
    /// How its light source was chosen.
    pub guided: Guided,
}

/// Where a path's ray met a surface of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// Index of the path in its batch.
    pub path: u32,
    /// The hit.
    pub hit: Hit,
    /// What radiosity says is weakly directional there, where it is not worked out.
    pub look_up: Option<LookUp>,
    /// The point.
    pub point: SurfacePoint,
    /// Whether its light is sampled, and how the random numbers for that came about.
    pub lit: Option<Guided>,
}
