//! Light sources without area: what arrives from them, and how much they emit.

use std::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::sampling::{basis, uniform_sphere};
use crate::scene::{LightKind, PunctualLight};

/// Least difference of the cosines of a spot's cone, below which its edge is as sharp as this (KHR_lights_punctual).
const MIN_SPOT_RAMP: f32 = 1e-3;

/// Share of its intensity that a spot emits at `cos` from its axis: the angular attenuation that KHR_lights_punctual
/// recommends, the square of a linear ramp in the cosine.
pub(super) fn spot_attenuation(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let ramp = ((cos - cos_outer) / (cos_inner - cos_outer).max(MIN_SPOT_RAMP)).clamp(0.0, 1.0);
    ramp * ramp
}

/// Direction to a point or spot light, distance, and irradiance on a facing surface at `position`. `None` for directional
/// lights, outside of a spot's cone, and at the light itself.
pub(super) fn incident(light: &PunctualLight, position: Vec3) -> Option<(Vec3, f32, Vec3)> {
    let at = match light.kind {
        LightKind::Point { position } | LightKind::Spot { position, .. } => position,
        LightKind::Directional { .. } => return None,
    };
    let offset = at.as_dvec3() - position.as_dvec3();
    let distance = offset.length();
    let direction = (offset / distance).as_vec3();
    let intensity = intensity_towards(light, -direction);
    let irradiance = (intensity.as_dvec3() / (distance * distance)).as_vec3();
    (irradiance.is_finite() && irradiance.max_element() > 0.0).then_some((direction, distance as f32, irradiance))
}

/// Radiant intensity of a point or spot light into a unit direction, W/sr.
pub(crate) fn intensity_towards(light: &PunctualLight, direction: Vec3) -> Vec3 {
    match light.kind {
        LightKind::Spot { direction: axis, cos_inner, cos_outer, .. } => {
            light.intensity * spot_attenuation(direction.dot(axis), cos_inner, cos_outer)
        }
        _ => light.intensity,
    }
}

/// Solid angle that would emit the light's flux at full intensity; for directional lights the area of a disk of `radius`.
pub(crate) fn effective_extent(light: &PunctualLight, radius: f64) -> f64 {
    match light.kind {
        LightKind::Point { .. } => 4.0 * PI,
        LightKind::Spot { cos_inner, cos_outer, .. } => {
            let spot = SpotRamp::new(cos_inner, cos_outer);
            TAU * (spot.ramp_integral() + spot.core())
        }
        LightKind::Directional { .. } => PI * radius * radius,
    }
}

/// A direction from a point or spot light with density proportional to its intensity.
pub(crate) fn emitted_direction(light: &PunctualLight, u: Vec2) -> Vec3 {
    match light.kind {
        LightKind::Point { .. } => uniform_sphere(u),
        LightKind::Spot { direction, cos_inner, cos_outer, .. } => {
            let spot = SpotRamp::new(cos_inner, cos_outer);
            let cos = spot.sample(f64::from(u.x)) as f32;
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            let (y, x) = (std::f32::consts::TAU * u.y).sin_cos();
            (basis(direction) * Vec3::new(sin * x, sin * y, cos)).normalize()
        }
        LightKind::Directional { direction } => direction,
    }
}

/// The profile of a spot over the cosine: a squared ramp from `outer` up to `full`, then constant up to 1.
struct SpotRamp {
    outer: f64,
    /// Width that the ramp would have; it ends earlier when it reaches the axis.
    width: f64,
    full: f64,
}

impl SpotRamp {
    fn new(cos_inner: f32, cos_outer: f32) -> Self {
        let (outer, width) = (f64::from(cos_outer), f64::from((cos_inner - cos_outer).max(MIN_SPOT_RAMP)));
        SpotRamp { outer, width, full: (outer + width).min(1.0) }
    }

    fn ramp_integral(&self) -> f64 {
        let reached = (self.full - self.outer) / self.width;
        reached * reached * reached * self.width / 3.0
    }

    fn core(&self) -> f64 {
        1.0 - self.full
    }

    fn sample(&self, u: f64) -> f64 {
        let (ramp, core) = (self.ramp_integral(), self.core());
        let target = u * (ramp + core);
        if target < ramp {
            self.outer + (self.full - self.outer) * (target / ramp).cbrt()
        } else {
            (self.full + (target - ramp)).min(1.0)
        }
    }
}
