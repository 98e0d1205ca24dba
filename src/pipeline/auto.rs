//! Choices the user left open, made from the scene.

use glam::{Vec2, Vec3};

use super::{Method, Settings};
use crate::backend::{Coherence, Hit, Ray, RayScene, Visible};
use crate::radiosity::Focus;
use crate::sampling::{basis, cosine_hemisphere, sobol};
use crate::scene::{Camera, Scene};
use crate::shading::SurfacePoint;

/// View rays that measure the room.
const PROBES: u32 = 1024;

/// Automatic `r_thresh` over the median length of a gather ray. The paper's 0.053 of its room's length is about this share of
/// the median there.
const R_THRESH_SHARE: f32 = 0.12;

/// Automatic patch size over `r_thresh`: the patch that a far ray looks up must be small against the ray.
const PATCH_SHARE: f32 = 0.75;

/// Patch size over the median gather ray where nothing is simplified.
const COMPLETE_PATCH_SHARE: f32 = 0.08;

/// What the cameras' first gather rays tell about the room.
struct Surroundings {
    /// Median length of a gather ray.
    median: f32,
    /// Where they end.
    focus: Focus,
}

/// Fills in what is `None`.
pub fn fill_in(settings: &mut Settings, scene: &Scene, detailed: &dyn RayScene, cameras: &[Camera]) {
    if settings.method == Method::Mcpt {
        settings.r_thresh = Some(f32::INFINITY);
        return;
    }
    let surroundings = look_around(scene, detailed, cameras);
    settings.focus = settings.focus.or(surroundings.as_ref().map(|s| s.focus));
    let median = surroundings.map_or(0.5 * scene.mesh.bounds.diagonal(), |s| s.median).max(f32::MIN_POSITIVE);
    if settings.method == Method::Pmm {
        settings.r_thresh = Some(0.0);
    }
    let r_thresh = *settings.r_thresh.get_or_insert(R_THRESH_SHARE * median);
    let by_distance = COMPLETE_PATCH_SHARE * median;
    settings.patch_size.get_or_insert(if r_thresh > 0.0 && r_thresh.is_finite() {
        (PATCH_SHARE * r_thresh).min(2.0 * by_distance)
    } else {
        by_distance
    });
}

/// Follows cosine-distributed rays from what the cameras see; `None` when they meet nothing.
fn look_around(scene: &Scene, detailed: &dyn RayScene, cameras: &[Camera]) -> Option<Surroundings> {
    const STREAM: u32 = 0x6175_746f;
    let probes = if cameras.is_empty() { 0 } else { PROBES };
    let views: Vec<Ray> = (0..probes)
        .map(|i| {
            let u = sobol(i, 0, STREAM);
            let camera = &cameras[i as usize * cameras.len() / PROBES as usize];
            camera.ray(Vec2::new(u[0], u[1]), camera.aspect.unwrap_or(1.5))
        })
        .collect();
    let mut hits = vec![Hit::MISS; views.len()];
    detailed.closest(&views, Visible::All, Coherence::Coherent, &mut hits);
    let gathers: Vec<Ray> = views
        .iter()
        .zip(&hits)
        .enumerate()
        .filter(|(_, (_, hit))| hit.is_hit())
        .map(|(i, (view, hit))| {
            let point = SurfacePoint::new(scene, hit);
            let normal = if point.geometric_normal.dot(view.direction) < 0.0 {
                point.geometric_normal
            } else {
                -point.geometric_normal
            };
            let u = sobol(i as u32, 1, STREAM);
            let direction: Vec3 = basis(normal) * cosine_hemisphere(Vec2::new(u[0], u[1]));
            Ray::new(point.ray_origin(direction), direction)
        })
        .collect();
    let mut hits = vec![Hit::MISS; gathers.len()];
    detailed.closest(&gathers, Visible::All, Coherence::Incoherent, &mut hits);
    let ends: Vec<(f32, Vec3)> =
        gathers.iter().zip(&hits).filter(|(_, h)| h.is_hit()).map(|(ray, h)| (h.t, ray.at(h.t))).collect();
    let median = quantile(ends.iter().map(|e| e.0), 0.5)?;
    let axis = |k: usize| quantile(ends.iter().map(|e| e.1[k]), 0.5);
    let centre = Vec3::new(axis(0)?, axis(1)?, axis(2)?);
    // Nine tenths of where gather rays end: far things seen through a window do not count.
    let radius = quantile(ends.iter().map(|e| e.1.distance(centre)), 0.9)?.max(median);
    Some(Surroundings { median, focus: Focus { centre, radius } })
}

/// The value below which the share `q` of all values lies; `None` for no values.
fn quantile(values: impl Iterator<Item = f32>, q: f32) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get((q * values.len() as f32) as usize).copied()
}
