//! Shadow rays: what share of light comes through.

use glam::Vec3;

use crate::backend::{Coherence, Hit, PartKind, Ray, RayScene, Visible};
use crate::scene::Scene;
use crate::shading::{Bsdf, SurfacePoint};
use crate::simplify::TriangleSource;

/// Panes that a shadow ray passes before it is given up as blocked.
const MAX_PANES: usize = 64;

/// Share of light that comes through along each of `batch`, for use with any number of rays at once: 0 where something
/// opaque lies between `t_near` and `t_far`, else the product of the transmittances of all panes in between.
///
/// `rays` was built from the triangles of `scene`, or from others whose sources are given as `sources`.
pub fn visibility(
    rays: &dyn RayScene,
    scene: &Scene,
    sources: Option<&[TriangleSource]>,
    batch: &[Ray],
    through: &mut [Vec3],
) {
    let panes = scene.mesh.objects.iter().any(|o| o.kind == PartKind::Pane);
    let visible = if panes { Visible::WithoutPanes } else { Visible::All };
    let mut occluded = vec![false; batch.len()];
    rays.occluded(batch, visible, Coherence::Coherent, &mut occluded);
    for (share, blocked) in through.iter_mut().zip(&occluded) {
        *share = if *blocked { Vec3::ZERO } else { Vec3::ONE };
    }
    if panes {
        pass_panes(rays, scene, sources, batch, through);
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
            let triangle = match sources.map(|s| s[hit.triangle as usize]) {
                None => hit.triangle,
                Some(TriangleSource::Scene { triangle }) => triangle,
                Some(TriangleSource::BoxFace { .. }) => return false, // boxes are no panes
            };
            let point = SurfacePoint::new(scene, &Hit { triangle, ..*hit });
            // The threshold only sorts reflections.
            through[*i] *= Bsdf::new(scene, &point, -ray.direction, 0.0).straight_transmittance();
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
