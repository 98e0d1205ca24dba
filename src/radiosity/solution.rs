//! What [`solve`](super::solve) finds.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::ledger::Ledger;
use super::patches::PatchMap;
use super::slope::Slope;

/// Radiosities of both sides of every patch, and the way from a hit to its patch.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Solution {
    pub(super) map: PatchMap,
    pub(super) of_patch: Vec<PatchSolution>,
    pub(super) slopes: Vec<Slope>,
    /// Of all patches.
    pub(super) largest_diameter: f32,
    /// Unit normal of each triangle.
    pub(super) normals: Vec<Vec3>,
    /// Energy balance.
    pub ledger: Ledger,
    /// Number of patches.
    pub patches: usize,
    /// Edge length of the patches, scene length units: the one asked for, or larger where that gave too many.
    pub patch_size: f32,
    /// Rays traced.
    pub rays: u64,
    /// Number of shots: times that a side shot its unshot flux.
    pub shots: u64,
    /// Relative standard error of the solution (flux-weighted mean over patches), from independent halves.
    pub error: f32,
    /// Sentences for the user.
    pub warnings: Vec<String>,
}

/// The solution on one patch; front first.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct PatchSolution {
    /// Radiosity without emission, W/m^2. Under a coat, and where it is known from where light arrived, it is that of which the diffuse part is right:
    /// as much more or less of all of it is taken as of light from there is reflected diffusely.
    pub radiosity: [Vec3; 2],
    /// The part of `radiosity` that came straight from light sources, where that varies over the patch.
    pub uneven: [Option<Vec3>; 2],
    /// Standard error of the mean over bands of `radiosity`.
    pub deviation: [f32; 2],
    /// Number of the slope of what is looked up, where there is one.
    pub slope: [Option<u32>; 2],
    /// Diameter.
    pub diameter: f32,
}

impl Solution {
    /// A solution that was in a file; `None` if it cannot be one for a geometry of so many triangles. No rays were traced for it.
    pub(crate) fn restored(self, triangles: usize) -> Option<Solution> {
        let whole = self.patches == self.of_patch.len()
            && self.normals.len() == triangles
            && self.of_patch.iter().flat_map(|p| p.slope).flatten().all(|slope| (slope as usize) < self.slopes.len())
            && self.map.is_whole(triangles, self.patches);
        whole.then_some(Solution { rays: 0, ..self })
    }

    fn at(&self, triangle: u32, u: f32, v: f32) -> &PatchSolution {
        &self.of_patch[self.map.at(triangle, u, v) as usize]
    }

    /// Radiosity minus emission (W/m^2) of the patch at barycentrics `u`, `v` of a triangle of the geometry, on its front
    /// (counter-clockwise) or back side.
    pub fn radiosity(&self, triangle: u32, u: f32, v: f32, front: bool) -> Vec3 {
        self.at(triangle, u, v).radiosity[usize::from(!front)]
    }

    /// Radiosity minus emission at that point, W/m^2, as far as it is known to first order how it changes over the patch; and whether direct
    /// light is left out of it, because the patch's mean says little of a point: where it lies partly in shadow, or close to a light
    /// source. Without [`RadiosityParams::keep_places`](super::RadiosityParams) it is [`Solution::radiosity`], and with
    /// [`DirectLight::Shoot`](super::DirectLight) nothing is left out.
    pub fn look_up(&self, triangle: u32, u: f32, v: f32, front: bool) -> (Vec3, bool) {
        let (number, local) = self.map.locate(triangle, u, v);
        let (patch, side) = (&self.of_patch[number as usize], usize::from(!front));
        let slope = patch.slope[side].map_or(1.0, |slope| self.slopes[slope as usize].at(local));
        (slope * (patch.radiosity[side] - patch.uneven[side].unwrap_or_default()), patch.uneven[side].is_some())
    }

    /// Whether a ray into `direction` meets the front of a triangle of the geometry.
    pub fn is_front(&self, triangle: u32, direction: Vec3) -> bool {
        self.normals[triangle as usize].dot(direction) < 0.0
    }

    /// Cosine between `direction` and the normal of a triangle of the geometry, 0..=1.
    pub fn cosine(&self, triangle: u32, direction: Vec3) -> f32 {
        self.normals[triangle as usize].dot(direction).abs()
    }

    /// Standard error of the mean over bands of [`Solution::radiosity`], W/m^2: half the difference of two independent halves,
    /// itself a random number with one degree of freedom.
    pub fn deviation(&self, triangle: u32, u: f32, v: f32, front: bool) -> f32 {
        self.at(triangle, u, v).deviation[usize::from(!front)]
    }

    /// Index of that patch, less than [`Solution::patches`].
    pub fn patch(&self, triangle: u32, u: f32, v: f32) -> u32 {
        self.map.at(triangle, u, v)
    }

    /// Whether that patch has a larger diameter than `length`.
    #[inline]
    pub fn is_larger(&self, length: f32, triangle: u32, u: f32, v: f32) -> bool {
        // Patches lie all over the memory: most questions are answered without looking.
        length < self.largest_diameter && length < self.at(triangle, u, v).diameter
    }
}
