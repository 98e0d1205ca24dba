//! Rays that carry light away from the light sources, for light that is shot rather than gathered.

use glam::{Vec2, Vec3};

use super::Lights;
use super::punctual::{effective_extent, emitted_direction};
use crate::backend::{Hit, Ray};
use crate::sampling::{basis, concentric_disk, cosine_hemisphere};
use crate::scene::{Aabb, LightKind, PunctualLight, Scene};

/// A ray that leaves a light source.
#[derive(Clone, Copy, Debug)]
pub struct EmittedRay {
    /// The ray. Its origin lies on the emitting triangle itself: before tracing, move it off the surface with
    /// [`SurfacePoint::ray_origin`](crate::shading::point::SurfacePoint::ray_origin). Rays of directional lights and the
    /// environment start outside of all triangles.
    pub ray: Ray,
    /// Flux that the ray stands for, W per band: the mean over rays is the flux of all lights.
    pub flux: Vec3,
    /// The emitting triangle, or `Hit::NONE`.
    pub triangle: u32,
    /// Barycentric weights of the triangle's second and third vertex at the origin.
    pub uv: Vec2,
    /// Whether the ray leaves the counter-clockwise face.
    pub front: bool,
}

/// An emitting triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittingTriangle {
    /// Index into the scene's triangles.
    pub triangle: u32,
    /// Mean emitted radiance over the triangle's light source (a triangle or a rectangle of two), W/(sr m^2) per band.
    pub radiance: Vec3,
    /// Whether the clockwise face emits, too.
    pub both_faces: bool,
}

/// Choice of a light in proportion to its flux.
#[derive(Debug, Default)]
pub(super) struct FluxTable {
    /// Running sums of what decides the choice: flux in shares of the total of each band.
    cumulative: Vec<f64>,
    /// Flux of all lights, W per band.
    pub total: [f64; 3],
    /// Sphere around all triangles; directional lights and the environment emit from a disk of its radius.
    pub centre: Vec3,
    pub radius: f32,
}

impl FluxTable {
    pub(super) fn new(lights: &Lights, bounds: &Aabb) -> Self {
        let (centre, radius) =
            if bounds.is_empty() { (Vec3::ZERO, 0.0) } else { (bounds.centre(), 0.5 * bounds.diagonal()) };
        let areas = lights.areas.lights.iter().map(|light| {
            let faces = if light.both_faces { 2.0 } else { 1.0 };
            light.radiance.as_dvec3() * (std::f64::consts::PI * light.area() * faces)
        });
        let others = lights.punctual().map(|l| l.intensity.as_dvec3() * effective_extent(l, f64::from(radius)));
        let mut table = FluxTable { centre, radius, ..FluxTable::default() };
        let outside = lights.environment.iter().map(|light| light.total * table.disk());
        let fluxes: Vec<[f64; 3]> = areas.chain(others).chain(outside).map(|f| f.to_array()).collect();
        for flux in &fluxes {
            for (sum, f) in table.total.iter_mut().zip(flux) {
                *sum += f;
            }
        }
        let mut sum = 0.0;
        table.cumulative = fluxes
            .iter()
            .map(|flux| {
                sum += super::band_shares(*flux, table.total);
                sum
            })
            .collect();
        table
    }

    /// Area of the disk from which light from infinity sets out.
    fn disk(&self) -> f64 {
        std::f64::consts::PI * f64::from(self.radius).powi(2)
    }

    /// A point of that disk for light that travels into `direction`.
    fn on_disk(&self, direction: Vec3, u: [f32; 2]) -> Vec3 {
        let disk = self.radius * concentric_disk(Vec2::from(u));
        // A tenth farther than needed, so that rounding cannot put the disk inside
        self.centre + basis(direction) * disk.extend(-1.1 * self.radius)
    }

    /// A light, its probability, and where within its share `u` lies, 0..1.
    fn choose(&self, u: f64) -> Option<(usize, f64, f64)> {
        let sum = *self.cumulative.last()?;
        let target = u * sum;
        let i = self.cumulative.partition_point(|&c| c <= target).min(self.cumulative.len() - 1);
        let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        let probability = (self.cumulative[i] - before) / sum;
        let rest = ((target - before) / (self.cumulative[i] - before)).clamp(0.0, 1.0 - f64::EPSILON);
        (probability > 0.0).then_some((i, probability, rest))
    }
}

impl Lights {
    /// Flux that all light sources emit, W per band. Directional lights and the environment count with the part that meets a disk
    /// around the scene's bounds.
    pub fn flux(&self) -> [f64; 3] {
        self.emission.total
    }

    /// The emitting triangles.
    pub fn triangles(&self) -> impl Iterator<Item = EmittingTriangle> {
        self.areas.lights.iter().flat_map(|light| {
            let (radiance, both_faces) = (light.radiance, light.both_faces);
            let own = light.triangles.into_iter().filter(|&t| t != Hit::NONE);
            own.map(move |triangle| EmittingTriangle { triangle, radiance, both_faces })
        })
    }

    /// The light sources without area: point and spot lights first, then directional ones.
    pub fn punctual(&self) -> impl Iterator<Item = &PunctualLight> {
        self.finite.iter().chain(&self.directional)
    }

    /// A ray that leaves a light source, with a density proportional to the flux. `u[0]` chooses the light,
    /// `u[1..3]` the point, `u[3..5]` the direction. `None` where the chosen point of a textured light is black.
    pub fn sample_emission(&self, scene: &Scene, u: [f32; 5]) -> Option<EmittedRay> {
        let (chosen, probability, choice) = self.emission.choose(super::refined(u[0], [u[1], u[2]]))?;
        if let Some(light) = self.areas.lights.get(chosen) {
            let point = light.uniform_point([u[1], u[2]]);
            // Both faces: half of the first number's range each
            let (front, v) = match (light.both_faces, u[3] < 0.5) {
                (false, _) => (true, u[3]),
                (true, front) => (front, if front { 2.0 * u[3] } else { 2.0 * u[3] - 1.0 }),
            };
            let normal = light.normal().as_vec3() * if front { 1.0 } else { -1.0 };
            let direction = (basis(normal) * cosine_hemisphere(Vec2::new(v, u[4]))).normalize();
            let faces = if light.both_faces { 2.0 } else { 1.0 };
            let extent = std::f64::consts::PI * light.area() * faces / probability;
            let flux = (light.radiance_at(scene, point.triangle, point.uv).as_dvec3() * extent).as_vec3();
            let ray = Ray::new(point.position.as_vec3(), direction);
            let emitted = EmittedRay { ray, flux, triangle: point.triangle, uv: point.uv, front };
            return (flux.max_element() > 0.0).then_some(emitted);
        }
        let Some(light) = self.punctual().nth(chosen - self.areas.lights.len()) else {
            let sample = self.environment.as_ref()?.sample_any(choice, [u[3], u[4]])?;
            let extent = self.emission.disk() / (sample.pdf * probability);
            let flux = (sample.radiance.as_dvec3() * extent).as_vec3();
            let ray = Ray::new(self.emission.on_disk(-sample.direction, [u[1], u[2]]), -sample.direction);
            let emitted = EmittedRay { ray, flux, triangle: Hit::NONE, uv: Vec2::ZERO, front: true };
            return (flux.is_finite() && flux.max_element() > 0.0).then_some(emitted);
        };
        let radius = self.emission.radius;
        let direction = emitted_direction(light, Vec2::new(u[3], u[4]));
        let origin = match light.kind {
            LightKind::Point { position } | LightKind::Spot { position, .. } => position,
            LightKind::Directional { .. } => self.emission.on_disk(direction, [u[1], u[2]]),
        };
        let extent = effective_extent(light, f64::from(radius)) / probability;
        let flux = (light.intensity.as_dvec3() * extent).as_vec3();
        let ray = Ray::new(origin, direction);
        Some(EmittedRay { ray, flux, triangle: Hit::NONE, uv: Vec2::ZERO, front: true })
    }
}
