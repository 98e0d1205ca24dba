//! Light sources that send photons, and how a photon sets out.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

use super::aim::{Seen, in_shadow, shadow_area};
use super::targets::Target;
use crate::backend::{Hit, Ray};
use crate::lighting::Lights;
use crate::lighting::punctual::{effective_extent, emitted_direction, intensity_towards};
use crate::sampling::{basis, cosine_hemisphere};
use crate::scene::{LightKind, PunctualLight, Scene};
use crate::shading::SurfacePoint;

/// Least share of its light that a source is taken to send towards targets: its middle need not see what its edge sees.
const LEAST_SHARE: f32 = 0.01;

/// One light source.
#[derive(Clone, Debug)]
enum Source {
    Triangle { triangle: u32, area: f64, both_faces: bool },
    Punctual(PunctualLight),
}

/// Light sources, chosen in proportion to the flux that may meet targets.
#[derive(Clone, Debug)]
pub(super) struct Sources {
    all: Vec<Source>,
    /// Running sums of the probabilities.
    cumulative: Vec<f64>,
    /// Distance beyond which nothing lies.
    outside: f32,
}

impl Sources {
    /// The emitting triangles that are `small`.
    pub fn of_areas(scene: &Scene, lights: &Lights, small: &[bool], targets: &[Target]) -> Sources {
        let mut seen = Seen::default();
        let mut weighted = Vec::new();
        for emitting in lights.triangles().filter(|e| small[e.triangle as usize]) {
            let (triangle, both_faces) = (emitting.triangle, emitting.both_faces);
            let [a, b, c] = scene.mesh.corners(triangle);
            let plane = if both_faces { Vec3::ZERO } else { scene.mesh.normal(triangle) };
            seen.look(targets, (a + b + c) / 3.0, plane);
            let area = scene.mesh.area(triangle);
            let faces = if both_faces { 2.0 } else { 1.0 };
            let share = seen.share(faces * PI).max(LEAST_SHARE);
            let flux = emitting.radiance * (PI * faces * share * area as f32);
            weighted.push((Source::Triangle { triangle, area, both_faces }, flux));
        }
        Self::weighted(scene, weighted)
    }

    /// The lights without area.
    pub fn of_points(scene: &Scene, lights: &Lights, targets: &[Target]) -> Sources {
        let mut seen = Seen::default();
        let mut weighted = Vec::new();
        for light in lights.punctual() {
            let extent = match light.kind {
                LightKind::Directional { .. } => shadow_area(targets),
                LightKind::Point { position } | LightKind::Spot { position, .. } => {
                    let extent = effective_extent(light, 0.0) as f32;
                    seen.look(targets, position, Vec3::ZERO);
                    extent * seen.share(extent).max(LEAST_SHARE)
                }
            };
            weighted.push((Source::Punctual(light.clone()), light.intensity * extent));
        }
        Self::weighted(scene, weighted)
    }

    fn weighted(scene: &Scene, weighted: Vec<(Source, Vec3)>) -> Sources {
        let total: Vec3 = weighted.iter().map(|w| w.1).sum();
        let shares =
            |flux: Vec3| (0..3).filter(|&b| total[b] > 0.0).map(|b| f64::from(flux[b] / total[b])).sum::<f64>();
        let sum: f64 = weighted.iter().map(|w| shares(w.1)).sum();
        let mut cumulative = 0.0;
        let (all, cumulative) = weighted
            .into_iter()
            .map(|(source, flux)| {
                cumulative += shares(flux) / sum;
                (source, cumulative)
            })
            .unzip();
        Sources { all, cumulative, outside: 2.0 * scene.mesh.bounds.diagonal() }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// A ray that leaves a light source, towards a target where that is possible, and its flux: the mean over rays is the flux of all
    /// light that meets targets. `None` where the source is dark.
    pub fn emit(
        &self,
        scene: &Scene,
        targets: &[Target],
        seen: &mut Seen,
        [choice, which, face, _]: [f32; 4],
        u: [f32; 4],
    ) -> Option<(Ray, Vec3)> {
        let chosen = self.cumulative.partition_point(|&c| c <= f64::from(choice)).min(self.all.len() - 1);
        let before = if chosen == 0 { 0.0 } else { self.cumulative[chosen - 1] };
        let probability = (self.cumulative[chosen] - before) as f32;
        let (ray, flux) = match &self.all[chosen] {
            &Source::Triangle { triangle, area, both_faces } => {
                // Uniform on the triangle (Turk 1990)
                let root = u[0].sqrt();
                let (v, w) = (root * (1.0 - u[1]), root * u[1]);
                let point = SurfacePoint::new(scene, &Hit { t: 0.0, u: v, v: w, triangle });
                let back = both_faces && face < 0.5;
                let normal = if back { -point.geometric_normal } else { point.geometric_normal };
                seen.look(targets, point.position, normal);
                let (direction, density) = if seen.fills(PI) {
                    let local = cosine_hemisphere(Vec2::new(u[2], u[3]));
                    (basis(normal) * local, local.z * FRAC_1_PI)
                } else {
                    seen.direction(which, [u[2], u[3]])?
                };
                let extent = area as f32 * if both_faces { 2.0 } else { 1.0 };
                let cos = normal.dot(direction);
                let flux = scene.emission(triangle, v, w) * (extent * cos.max(0.0) / density);
                (Ray::new(point.ray_origin(direction), direction), flux)
            }
            Source::Punctual(light) => match light.kind {
                LightKind::Directional { direction } => {
                    let (point, density) = in_shadow(targets, direction, which, [u[0], u[1]])?;
                    (Ray::new(point - self.outside * direction, direction), light.intensity / density)
                }
                LightKind::Point { position } | LightKind::Spot { position, .. } => {
                    let extent = effective_extent(light, 0.0) as f32;
                    seen.look(targets, position, Vec3::ZERO);
                    if seen.fills(extent) {
                        let direction = emitted_direction(light, Vec2::new(u[2], u[3]));
                        (Ray::new(position, direction), light.intensity * extent)
                    } else {
                        let (direction, density) = seen.direction(which, [u[2], u[3]])?;
                        (Ray::new(position, direction), intensity_towards(light, direction) / density)
                    }
                }
            },
        };
        let flux = flux / probability;
        (flux.is_finite() && flux.max_element() > 0.0).then_some((ray, flux))
    }
}
