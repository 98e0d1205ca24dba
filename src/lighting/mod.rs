//! Direct light: choosing a light source and a point on it (next-event estimation).

pub mod shadow;

use glam::Vec3;

use crate::scene::Scene;

/// A sampled light source, seen from a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// Distance to the light; infinite for directional lights.
    pub distance: f32,
    /// Radiance divided by the density of the sample (per solid angle), or for lights without area the irradiance on a
    /// facing surface divided by the probability of the light: multiply with `f cos` for an unbiased estimate.
    pub weight: Vec3,
    /// Density per solid angle; `None` for lights without area, which no ray can hit.
    pub pdf: Option<f32>,
    /// The emitting triangle, or `Hit::NONE`.
    pub triangle: u32,
}

/// All light sources of a scene, ready to be sampled.
#[derive(Debug)]
pub struct Lights {
    // fields are the lighting helper's
}

impl Lights {
    /// Collects emitting triangles and punctual lights of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let _ = scene;
        todo!("lighting helper")
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        todo!("lighting helper")
    }

    /// Samples a light for a surface point with shading normal `normal` (on the side that is lit).
    /// `u[0]` chooses the light, `u[1..3]` the point on it. `None` when nothing can arrive from the chosen light.
    pub fn sample(&self, scene: &Scene, position: Vec3, normal: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let _ = (scene, position, normal, u);
        todo!("lighting helper")
    }

    /// Density per solid angle with which [`Lights::sample`] would have chosen `direction` towards `triangle`, which a ray
    /// from `position` hit at `distance`; 0 for triangles that are no light source.
    pub fn pdf(
        &self,
        scene: &Scene,
        position: Vec3,
        normal: Vec3,
        direction: Vec3,
        distance: f32,
        triangle: u32,
    ) -> f32 {
        let _ = (scene, position, normal, direction, distance, triangle);
        todo!("lighting helper")
    }
}
