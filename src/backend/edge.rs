//! Hits on the edges of triangles, which cannot be trusted, and rays lost at vertices.
//!
//! Where a wall ends at a floor, the floor beyond the wall is met at the same rounded distance as the wall, and either may come out as
//! the nearest; light that goes on from the one or the other is in one room or the next. Rays that meet an edge are traced again,
//! slightly turned. The share of such rays is a few millionths.
//!
//! Of rays aimed exactly at a vertex Embree loses some in a hundred even in its robust mode: each triangle decides that the ray passes
//! beside it. Where hardly any ray misses everything, one that does is traced again, too, so that no sky shines into a closed room.

use glam::Vec3;

use super::{Coherence, Hit, Ray, RayScene, Visible};
use crate::sampling::{hash_all, unit};

/// Barycentric distance from a triangle's edge within which a hit is not trusted.
const EDGE: f32 = 1e-6;
/// How far a ray is turned, radians at most.
const TURN: f32 = 1e-4;
/// How often a ray is traced again.
pub const RETRIES: u8 = 4;
/// Rays for each one that misses everything where misses are doubted.
const RAYS_PER_DOUBT: usize = 64;

/// Whether a hit lies on an edge of its triangle, or off it.
pub fn is_on_edge(hit: &Hit) -> bool {
    hit.is_hit() && hit.u.min(hit.v).min(1.0 - hit.u - hit.v) <= EDGE
}

/// Whether so few of the rays of a batch miss everything that some may have been lost.
pub fn misses_are_doubtful(hits: &[Hit]) -> bool {
    hits.iter().filter(|hit| !hit.is_hit()).count() * RAYS_PER_DOUBT <= hits.len()
}

/// The ray, turned by random numbers in 0..1. Scaling the axes apart keeps a grazing ray above the surface it left, for surfaces along
/// the axes at least.
pub fn turned(ray: &Ray, random: [f32; 3]) -> Ray {
    let scale = Vec3::from_array(random) * TURN + 1.0;
    Ray { direction: (ray.direction * scale).normalize(), ..*ray }
}

/// Traces those of `rays` again whose hit lies on an edge, and where misses are doubtful those that missed, once; the turned rays and their
/// hits take their places. What is on an edge every time stays so. Directions have unit length.
pub fn settle_edges(scene: &dyn RayScene, rays: &mut [Ray], hits: &mut [Hit]) {
    let doubtful = misses_are_doubtful(hits);
    for (ray, hit) in rays.iter_mut().zip(hits) {
        for retry in 0..RETRIES {
            let lost = doubtful && retry == 0 && !hit.is_hit();
            if !lost && !is_on_edge(hit) {
                break;
            }
            let [x, y, z] = ray.direction.to_array().map(f32::to_bits);
            let random = [0, 1, 2].map(|axis| unit(hash_all(&[x, y, z, hit.triangle, u32::from(retry), axis])));
            *ray = turned(ray, random);
            scene.closest(std::slice::from_ref(ray), Visible::All, Coherence::Incoherent, std::slice::from_mut(hit));
        }
    }
}
