//! Ray against triangle in f64: what [`obvhs`](super::obvhs) traces with and what [`compare`](super::compare) judges by.

use glam::{DVec3, Vec3};

use super::Ray;

/// Where a ray meets the plane of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneHit {
    /// Ray parameter.
    pub t: f64,
    /// Barycentric weights of the first, second and third vertex; they sum to one, and all are >= 0 inside.
    pub weights: [f64; 3],
    /// Direction times unnormalised geometric normal; negative when the ray arrives at the front.
    pub facing: f64,
}

impl PlaneHit {
    /// Whether the hit lies in the triangle, edges included.
    pub fn inside(&self) -> bool {
        self.weights.iter().all(|&weight| weight >= 0.0)
    }
}

/// Meets `ray` with the plane of the triangle; `None` when they are parallel or the triangle has no area.
///
/// The weights are signed volumes of ray and edge (Plücker). Those of an edge are the same number with the opposite
/// sign for the neighbour that runs along it the other way, so no ray slips between two triangles that share it.
pub(super) fn meet_plane(ray: &Ray, corners: [Vec3; 3]) -> Option<PlaneHit> {
    let origin = ray.origin.as_dvec3();
    let direction = ray.direction.as_dvec3();
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - origin);
    let volume = |p: DVec3, q: DVec3| direction.dot(p.cross(q));
    let volumes = [volume(b, c), volume(c, a), volume(a, b)];
    let facing = volumes[0] + volumes[1] + volumes[2];
    if facing == 0.0 {
        return None;
    }
    let weights = volumes.map(|volume| volume / facing);
    // From the edges rather than from the weights: exact cancellation keeps t right on slivers seen from afar.
    let normal = (b - a).cross(c - a);
    let t = normal.dot(a) / normal.dot(direction);
    t.is_finite().then_some(PlaneHit { t, weights, facing })
}
