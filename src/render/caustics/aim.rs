//! Directions and places from which photons meet the targets.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::targets::Target;
use crate::sampling::{basis, concentric_disk};

/// A target as seen from a point: the cone around it.
#[derive(Clone, Copy, Debug)]
struct Cone {
    axis: Vec3,
    /// Cosine of half of its opening.
    cos: f32,
    /// One less that: exact for narrow cones.
    height: f32,
    weight: f32,
}

impl Cone {
    fn solid_angle(&self) -> f32 {
        TAU * self.height
    }
}

/// The targets as seen from one point.
#[derive(Debug, Default)]
pub(super) struct Seen {
    cones: Vec<Cone>,
    /// Weighted sum of the solid angles.
    total: f32,
    /// Sum without weights; infinite from within a target.
    solid_angle: f32,
}

impl Seen {
    /// Looks from `origin` at targets that are not all behind the plane with `normal` (zero: no plane).
    pub fn look(&mut self, targets: &[Target], origin: Vec3, normal: Vec3) {
        self.cones.clear();
        (self.total, self.solid_angle) = (0.0, 0.0);
        for target in targets {
            let offset = target.centre - origin;
            if normal != Vec3::ZERO && offset.dot(normal) <= -target.radius {
                continue;
            }
            let (d2, r2) = (offset.length_squared(), target.radius * target.radius);
            if d2 <= r2 {
                self.solid_angle = f32::INFINITY;
                continue;
            }
            let sin2 = r2 / d2;
            let cos = (1.0 - sin2).sqrt();
            let cone = Cone { axis: offset / d2.sqrt(), cos, height: sin2 / (1.0 + cos), weight: target.weight };
            self.total += cone.weight * cone.solid_angle();
            self.solid_angle += cone.solid_angle();
            self.cones.push(cone);
        }
    }

    /// Whether nothing is to be gained against a light source that shines into `extent` sr: aimed photons would fly everywhere, too.
    pub fn fills(&self, extent: f32) -> bool {
        self.solid_angle >= extent
    }

    /// Share of the light of a source that shines into `extent` sr that meets targets, by weight, about: 0..=1.
    pub fn share(&self, extent: f32) -> f32 {
        if self.fills(extent) { 1.0 } else { self.total / extent }
    }

    /// A direction into one of the cones, and its density per solid angle; uniform in each cone, with its weight. `None` without cones.
    pub fn direction(&self, choice: f32, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let mut rest = choice * self.total;
        let chosen = self.cones.iter().find(|cone| {
            rest -= cone.weight * cone.solid_angle();
            rest < 0.0
        });
        let cone = chosen.or(self.cones.last())?;
        let height = u[0] * cone.height;
        let sin = (height * (2.0 - height)).max(0.0).sqrt();
        let (y, x) = (TAU * u[1]).sin_cos();
        let direction = (basis(cone.axis) * Vec3::new(sin * x, sin * y, 1.0 - height)).normalize();
        // The chosen cone holds it, whatever rounding says
        let holds = |other: &Cone| std::ptr::eq(other, cone) || other.axis.dot(direction) > other.cos;
        let density: f32 = self.cones.iter().filter(|c| holds(c)).map(|c| c.weight).sum();
        Some((direction, density / self.total))
    }
}

/// Weighted area in which the targets meet parallel light.
pub(super) fn shadow_area(targets: &[Target]) -> f32 {
    targets.iter().map(|t| t.weight * PI * t.radius * t.radius).sum()
}

/// A point in the shadow that parallel light into `direction` throws of one of the targets, on a plane through its centre, and the density
/// per area. `None` without targets.
pub(super) fn in_shadow(targets: &[Target], direction: Vec3, choice: f32, u: [f32; 2]) -> Option<(Vec3, f32)> {
    let total = shadow_area(targets);
    let mut rest = choice * total;
    let chosen = targets.iter().find(|target| {
        rest -= target.weight * PI * target.radius * target.radius;
        rest < 0.0
    });
    let target = chosen.or(targets.last())?;
    let disk = target.radius * concentric_disk(Vec2::from(u));
    let point = target.centre + basis(direction) * disk.extend(0.0);
    let holds = |other: &Target| {
        let offset = point - other.centre;
        std::ptr::eq(other, target) || offset.reject_from_normalized(direction).length() < other.radius
    };
    let density: f32 = targets.iter().filter(|t| holds(t)).map(|t| t.weight).sum();
    Some((point, density / total))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{sobol, uniform_sphere};

    fn some_targets() -> Vec<Target> {
        [
            (Vec3::new(2.0, 0.0, 0.0), 0.5, 1.0),
            (Vec3::new(2.0, 0.4, 0.3), 0.3, 0.2),
            (Vec3::new(0.0, -3.0, 1.0), 1.0, 0.5),
        ]
        .map(|(centre, radius, weight)| Target { centre, radius, weight })
        .to_vec()
    }

    /// `1 / density` over samples is the solid angle (the area) that the targets cover together, here found by uniform directions.
    #[test]
    fn densities_are_right() {
        const N: u32 = 1 << 16;
        let targets = some_targets();
        let mut seen = Seen::default();
        seen.look(&targets, Vec3::ZERO, Vec3::ZERO);
        let (mut aimed, mut uniform) = (0.0, 0.0);
        let (mut area, mut shadow) = (0.0, 0.0);
        let down = Vec3::new(0.6, -0.8, 0.0);
        for i in 0..N {
            let u = sobol(i, 0, 1);
            let (_, density) = seen.direction(u[2], [u[0], u[1]]).unwrap();
            aimed += 1.0 / f64::from(density) / f64::from(N);
            let d = uniform_sphere(Vec2::new(u[0], u[1]));
            let meets = |t: &Target, p: Vec3, d: Vec3| (t.centre - p).reject_from_normalized(d).length() < t.radius;
            let ahead = |t: &Target| t.centre.dot(d) > 0.0 && meets(t, Vec3::ZERO, d);
            uniform += f64::from(4.0 * PI) * f64::from(u8::from(targets.iter().any(ahead))) / f64::from(N);
            let (_, density) = in_shadow(&targets, down, u[2], [u[0], u[1]]).unwrap();
            area += 1.0 / f64::from(density) / f64::from(N);
            let p = basis(down) * ((Vec2::new(u[0], u[1]) * 10.0 - 5.0).extend(0.0));
            shadow += 100.0 * f64::from(u8::from(targets.iter().any(|t| meets(t, p, down)))) / f64::from(N);
        }
        // Four standard deviations of random points, of which these are better: shares of 0.06 and 0.04.
        let error = |whole: f64, share: f64| 4.0 * whole * (share / f64::from(N)).sqrt();
        assert!((aimed - uniform).abs() < error(4.0 * f64::from(PI), 0.06), "{aimed} {uniform}");
        assert!((area - shadow).abs() < error(100.0, 0.04), "{area} {shadow}");
    }

    #[test]
    fn from_within_a_target_light_goes_everywhere() {
        let mut seen = Seen::default();
        seen.look(&some_targets(), Vec3::new(2.0, 0.1, 0.0), Vec3::ZERO);
        assert!(seen.fills(4.0 * PI));
    }
}
