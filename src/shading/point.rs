//! Surface points with error bounds, and ray origins that stay on the right side.

use glam::{Vec2, Vec3};

use crate::backend::Hit;
use crate::scene::Scene;

/// Geometry of a point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position, recomputed from barycentrics.
    pub position: Vec3,
    /// Bound on the absolute error of `position` along each axis, and of a ray started there against the plane of
    /// its own triangle.
    pub error: Vec3,
    /// Unit geometric normal of the counter-clockwise face (not flipped towards the viewer).
    pub geometric_normal: Vec3,
    /// Unit shading normal on the side of `geometric_normal`.
    pub shading_normal: Vec3,
    /// First and second texture coordinates.
    pub uv: [Vec2; 2],
    /// Triangle.
    pub triangle: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

impl SurfacePoint {
    /// The point that `hit` names. `hit` must be a hit on `scene.mesh`.
    pub fn new(scene: &Scene, hit: &Hit) -> Self {
        let _ = (scene, hit);
        todo!("shading helper")
    }

    /// Origin for a ray that leaves into `direction`: moved along the geometric normal to the side of `direction`
    /// by the error bound, and rounded away from the surface (pbrt 4ed 6.8.6).
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        let _ = direction;
        todo!("shading helper")
    }
}
