//! Shadow rays: what share of light comes through.

use glam::Vec3;

use super::LightSample;
use crate::backend::{Coherence, Hit, PartKind, Ray, RayScene, Visible};
use crate::scene::Scene;
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use crate::simplify::TriangleSource;

/// Panes that a shadow ray passes before it is given up as blocked.
const MAX_PANES: usize = 64;

/// How far from the light a hit may lie that is put down to rounding, as a share of the distance.
const NEAR_LIGHT: f32 = 1.0 / 4096.0;
/// Cosine of the angle up to which a surface at the light counts as lying in its plane.
const COPLANAR: f32 = 0.999;

/// A shadow ray: from a surface to a sampled point on a light.
#[derive(Clone, Copy, Debug)]
pub struct ShadowRay {
    /// The ray, unit direction, with [`Ray::t_far`] at the light.
    pub ray: Ray,
    /// The emitting triangle of the scene ([`LightSample::triangle`]), or [`Hit::NONE`].
    pub light: u32,
}

/// Share of light that comes through along each of `batch`: 0 where something opaque lies between the surface and the
/// light, else the product of the transmittances of all panes in between.
///
/// Next to the light the nearest hit decides, and not whether there is one before a margin: with a margin alone, light sampled
/// close to a wall would shine on what lies behind the wall.
///
/// `rays` was built from the triangles of `scene`, or from others whose sources are given as `sources`.
pub fn light_visibility(
    rays: &dyn RayScene,
    scene: &Scene,
    sources: Option<&[TriangleSource]>,
    batch: &[ShadowRay],
    coherence: Coherence,
    buffers: &mut ShadowBuffers,
    through: &mut [Vec3],
) {
    // Kinds are in order, see `Mesh`.
    let panes = scene.mesh.objects.last().is_some_and(|o| o.kind == PartKind::Pane);
    let visible = if panes { Visible::WithoutPanes } else { Visible::All };
    let ShadowBuffers { before, occluded, at_light, last, hits } = buffers;
    before.clear();
    before.extend(batch.iter().map(ShadowRay::before_light));
    occluded.resize(batch.len(), false);
    rays.occluded(before, visible, coherence, occluded);
    at_light.clear();
    last.clear();
    for (i, shadow) in batch.iter().enumerate() {
        through[i] = if occluded[i] { Vec3::ZERO } else { Vec3::ONE };
        if !occluded[i] && shadow.light != Hit::NONE {
            at_light.push(i as u32);
            last.push(shadow.around_light());
        }
    }
    hits.resize(last.len(), Hit::MISS);
    rays.closest(last, visible, coherence, hits);
    for (&i, hit) in at_light.iter().zip(hits.iter()) {
        let i = i as usize;
        if !reaches(scene, sources, &batch[i], hit) {
            through[i] = Vec3::ZERO;
        }
    }
    if panes {
        pass_panes(rays, scene, sources, before, through);
    }
}

/// Memory of [`light_visibility`], to be used again for the next batch.
#[derive(Debug, Default)]
pub struct ShadowBuffers {
    before: Vec<Ray>,
    occluded: Vec<bool>,
    /// Numbers of the rays that arrive at their light, as far as the first look tells, and the ends of these rays.
    at_light: Vec<u32>,
    last: Vec<Ray>,
    hits: Vec<Hit>,
}

impl ShadowRay {
    /// From a point to what was sampled for it.
    pub fn towards(light: &LightSample, point: &SurfacePoint) -> ShadowRay {
        let ray = Ray::new(point.ray_origin(light.direction), light.direction);
        ShadowRay { ray: Ray { t_far: light.distance, ..ray }, light: light.triangle }
    }

    /// The ray up to where rounding begins to matter for a hit on the light itself.
    fn before_light(&self) -> Ray {
        match self.light {
            Hit::NONE => self.ray,
            _ => Ray { t_far: self.ray.t_far * (1.0 - NEAR_LIGHT), ..self.ray },
        }
    }

    /// The rest of it, and as much beyond the light.
    fn around_light(&self) -> Ray {
        let t = self.ray.t_far;
        Ray { t_near: t * (1.0 - NEAR_LIGHT), t_far: t * (1.0 + NEAR_LIGHT), ..self.ray }
    }
}

/// Whether a shadow ray reaches its light, when `hit` is the nearest around the light.
fn reaches(scene: &Scene, sources: Option<&[TriangleSource]>, shadow: &ShadowRay, hit: &Hit) -> bool {
    if !hit.is_hit() {
        return true;
    }
    let Some(triangle) = in_scene(sources, hit.triangle) else {
        return false;
    };
    let mesh = &scene.mesh;
    // Next to the light: the light itself, its neighbour, or what lies in one plane with it.
    triangle == shadow.light
        || scene.materials[mesh.object(triangle).material as usize].is_emitter()
        || mesh.normal(triangle).dot(mesh.normal(shadow.light)).abs() > COPLANAR
}

/// The triangle of the scene that a hit is on; `None` for equivalent boxes.
fn in_scene(sources: Option<&[TriangleSource]>, triangle: u32) -> Option<u32> {
    match sources.map(|s| s[triangle as usize]) {
        None => Some(triangle),
        Some(TriangleSource::Scene { triangle }) => Some(triangle),
        Some(TriangleSource::BoxFace { .. }) => None,
    }
}

/// Multiplies with the transmittance of one pane after the other.
fn pass_panes(
    rays: &dyn RayScene,
    scene: &Scene,
    sources: Option<&[TriangleSource]>,
    batch: &[Ray],
    through: &mut [Vec3],
) {
    let mut active: Vec<(usize, Ray)> =
        batch.iter().copied().enumerate().filter(|&(i, _)| through[i] != Vec3::ZERO).collect();
    let (mut queries, mut hits) = (Vec::new(), Vec::new());
    for _ in 0..MAX_PANES {
        if active.is_empty() {
            return;
        }
        queries.clear();
        queries.extend(active.iter().map(|&(_, ray)| ray));
        hits.resize(queries.len(), Hit::MISS);
        rays.closest(&queries, Visible::OnlyPanes, Coherence::Coherent, &mut hits);
        let mut hit = hits.iter();
        active.retain_mut(|(i, ray)| {
            let Some(hit) = hit.next().filter(|h| h.is_hit()) else {
                return false;
            };
            let Some(triangle) = in_scene(sources, hit.triangle) else {
                return false; // boxes are no panes
            };
            let point = SurfacePoint::new(scene, &Hit { triangle, ..*hit });
            through[*i] *= point.absorption(scene, -ray.direction, hit.t);
            // The threshold only sorts reflections.
            through[*i] *= Bsdf::new(scene, &point, -ray.direction, Lobes::MIRRORS).straight_transmittance();
            let origin = point.ray_origin(ray.direction);
            ray.t_far -= (origin - ray.origin).dot(ray.direction);
            ray.origin = origin;
            ray.t_near = 0.0;
            through[*i] != Vec3::ZERO && ray.t_far > 0.0
        });
    }
    for (i, _) in active {
        through[i] = Vec3::ZERO;
    }
}
