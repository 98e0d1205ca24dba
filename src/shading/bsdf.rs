//! The scattering function at a point.

use glam::Vec3;

use super::SurfacePoint;
use crate::scene::Scene;

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction towards which light is followed.
    pub direction: Vec3,
    /// `f cos / pdf` per band.
    pub weight: Vec3,
    /// Density per solid angle; `None` for a delta lobe.
    pub pdf: Option<f32>,
    /// Whether the direction lies on the other side of the surface.
    pub transmitted: bool,
    /// Transmitted without bending: shadow rays account for this path already.
    pub straight: bool,
}

/// The scattering function at a point seen from one side. All directions are unit, world space, and point away
/// from the surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    // fields are the shading helper's
}

impl Bsdf {
    /// The scattering function at `point` of material `scene.mesh.object(point.triangle).material` for light leaving
    /// towards `outgoing`; `glossy_threshold` is the roughness below which a specular lobe counts as highly directional.
    pub fn new(scene: &Scene, point: &SurfacePoint, outgoing: Vec3, glossy_threshold: f32) -> Self {
        let _ = (scene, point, outgoing, glossy_threshold);
        todo!("shading helper")
    }

    /// Emitted radiance towards `outgoing`, W/(sr m^2).
    pub fn emission(&self) -> Vec3 {
        todo!("shading helper")
    }

    /// `Some(reflectance)` when the point is Lambertian: the fast path.
    pub fn lambertian(&self) -> Option<Vec3> {
        todo!("shading helper")
    }

    /// Directional-hemispherical reflectance of the weakly directional part for this outgoing direction, in 0..=1.
    pub fn albedo_low(&self) -> Vec3 {
        todo!("shading helper")
    }

    /// The same of the highly directional part (reflection and transmission).
    pub fn albedo_high(&self) -> Vec3 {
        todo!("shading helper")
    }

    /// `f_l cos` for light arriving from `incoming`.
    pub fn eval_low(&self, incoming: Vec3) -> Vec3 {
        let _ = incoming;
        todo!("shading helper")
    }

    /// `f_h cos` of the part of f_h that is no delta function, and its sampling density.
    pub fn eval_high(&self, incoming: Vec3) -> (Vec3, f32) {
        let _ = incoming;
        todo!("shading helper")
    }

    /// Samples `f_l cos`; `u` uniform in 0..1.
    pub fn sample_low(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let _ = u;
        todo!("shading helper")
    }

    /// Samples `f_h cos`; `u` uniform in 0..1.
    pub fn sample_high(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let _ = u;
        todo!("shading helper")
    }
}
