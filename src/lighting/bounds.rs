//! Where the light of a group of light sources comes from and goes to, and an upper-bound-like estimate of what reaches a
//! point: Conty Estevez and Kulla, "Importance sampling of many lights with adaptive tree splitting" (2018),
//! in the form of pbrt 4ed 12.6.3.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use crate::scene::Aabb;

/// Widening of united cones, radians: more than the rounding of the angles, so that no light falls outside.
const CONE_MARGIN: f32 = 1e-5;

/// Least squared distance in estimates. Keeps them finite at a light's own position; far below any scene's resolution.
const MIN_DISTANCE_SQUARED: f32 = 1e-20;

/// Sine of the angle below a light's plane from which a point counts as behind it.
const SIDE_MARGIN: f32 = 1e-5;

/// Directions into which a group emits: within `theta_e` of any direction within `theta_o` of the axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub axis: Vec3,
    pub cos_o: f32,
    pub cos_e: f32,
    /// Whether it emits as much into the opposite directions.
    pub both: bool,
}

impl Cone {
    /// All directions.
    pub(super) const SPHERE: Cone = Cone { axis: Vec3::Z, cos_o: -1.0, cos_e: 0.0, both: false };

    /// The smallest cone (nearly) around both.
    pub(super) fn union(self, other: Cone) -> Cone {
        let cos_e = self.cos_e.min(other.cos_e);
        let both = self.both || other.both;
        let (a, mut b) = if self.cos_o <= other.cos_o { (self, other) } else { (other, self) };
        if both && a.axis.dot(b.axis) < 0.0 {
            b.axis = -b.axis;
        }
        let wide = Cone { cos_e, both, ..Cone::SPHERE };
        if a.cos_o <= -1.0 {
            return wide;
        }
        if a.axis == b.axis {
            return Cone { cos_e, both, ..a };
        }
        let (theta_a, theta_b) = (a.cos_o.acos(), b.cos_o.clamp(-1.0, 1.0).acos());
        let theta_d = a.axis.angle_between(b.axis);
        if theta_d + theta_b <= theta_a {
            return Cone { cos_e, both, ..a };
        }
        let theta_o = 0.5 * (theta_a + theta_d + theta_b) + CONE_MARGIN;
        let turn = a.axis.cross(b.axis).normalize_or_zero();
        if theta_o >= PI || turn == Vec3::ZERO {
            return wide;
        }
        let axis = (Quat::from_axis_angle(turn, theta_o - theta_a) * a.axis).normalize();
        Cone { axis, cos_o: theta_o.cos(), cos_e, both }
    }

    /// Solid angle of the directions, weighted by the cosine of the angle beyond `theta_o` (Conty and Kulla, eq. 1).
    fn measure(&self) -> f32 {
        let (o, e) = (self.cos_o.clamp(-1.0, 1.0).acos(), self.cos_e.acos());
        let w = (o + e).min(PI);
        let (sin_o, cos_o) = o.sin_cos();
        2.0 * PI * (1.0 - cos_o) + FRAC_PI_2 * (2.0 * w * sin_o - (o - 2.0 * w).cos() - 2.0 * o * sin_o + cos_o)
    }
}

/// A group of light sources, or one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub aabb: Aabb,
    pub cone: Cone,
    /// Sum of what the lights would send to a facing surface at unit distance, every band weighted with the inverse of the
    /// scene's total in that band: a faint green light is as important as a bright red one if no other is green.
    pub power: f32,
}

impl Bounds {
    pub(super) const EMPTY: Bounds =
        Bounds { aabb: Aabb::EMPTY, cone: Cone { axis: Vec3::Z, cos_o: 1.0, cos_e: 1.0, both: false }, power: 0.0 };

    pub(super) fn union(self, other: Bounds) -> Bounds {
        if self.aabb.is_empty() {
            return other;
        }
        if other.aabb.is_empty() {
            return self;
        }
        Bounds { aabb: self.aabb.union(other.aabb), cone: self.cone.union(other.cone), power: self.power + other.power }
    }

    /// Cost of descending into this group, up to a factor that all splits of a node share. The squared diagonal stands for the
    /// surface area: it does not vanish for lights in a row.
    pub(super) fn cost(&self) -> f32 {
        if self.aabb.is_empty() { 0.0 } else { self.power * self.cone.measure() * self.aabb.size().length_squared() }
    }
}

/// What is needed to estimate how much light of a group reaches a point; the group fits into a sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitter {
    pub centre: Vec3,
    pub radius: f32,
    pub cone: Cone,
    pub power: f32,
    /// Whether it is flat, with the cone's axis for its normal: then nothing leaves to its back.
    pub flat: bool,
}

impl Emitter {
    /// From bounds: the sphere around the box.
    pub(super) fn of(bounds: &Bounds) -> Emitter {
        Emitter {
            centre: bounds.aabb.centre(),
            radius: 0.5 * bounds.aabb.diagonal(),
            cone: bounds.cone,
            power: bounds.power,
            flat: false,
        }
    }

    /// Estimate of the irradiance at `position` on a surface with unit `normal` (zero: on any), occlusion left out. Zero
    /// only where nothing can arrive.
    pub(super) fn importance(&self, position: Vec3, normal: Vec3) -> f32 {
        let offset = position - self.centre;
        let d2 = offset.length_squared();
        let r2 = self.radius * self.radius;
        // The margin keeps points whose side is lost in rounding
        let height = offset.dot(self.cone.axis);
        if self.flat && !self.cone.both && height < 0.0 && height * height > SIDE_MARGIN * SIDE_MARGIN * d2 {
            return 0.0;
        }
        let estimate = self.power / d2.max(r2).max(MIN_DISTANCE_SQUARED);
        if d2 <= r2.max(MIN_DISTANCE_SQUARED) {
            return estimate;
        }
        let inverse = 1.0 / d2.sqrt();
        let away = offset * inverse;
        let sin_b = self.radius * inverse;
        let cos_b = (1.0 - sin_b * sin_b).max(0.0).sqrt();

        let cone = &self.cone;
        let cos_w = if cone.both { away.dot(cone.axis).abs() } else { away.dot(cone.axis) };
        let sin = |cos: f32| (1.0 - cos * cos).max(0.0).sqrt();
        let cos_x = cos_of_difference(cos_w, sin(cos_w), cone.cos_o, sin(cone.cos_o));
        let cos_p = cos_of_difference(cos_x, sin(cos_x), cos_b, sin_b);
        // Not `<=`: inside a spot's cone both are 1
        if cos_p < cone.cos_e {
            return 0.0;
        }
        if normal == Vec3::ZERO {
            return estimate * cos_p;
        }
        let cos_i = -away.dot(normal);
        let cos_r = cos_of_difference(cos_i, sin(cos_i), cos_b, sin_b);
        if cos_r > 0.0 { estimate * cos_p * cos_r } else { 0.0 }
    }
}

/// `cos(max(0, a - b))` for angles in 0..pi.
fn cos_of_difference(cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32) -> f32 {
    if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
}
