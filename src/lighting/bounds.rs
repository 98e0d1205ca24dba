//! Where the light of a group of light sources comes from and goes to, and an upper-bound-like estimate of what reaches a
//! point: Conty Estevez and Kulla, "Importance sampling of many lights with adaptive tree splitting" (2018),
//! in the form of pbrt 4ed 12.6.3.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use crate::scene::Aabb;

/// Widening of cones around several lights, in the cosine: the sine of an angle whose cosine is 1 to rounding is only known
/// to 3e-4, and no light may fall outside.
const COS_MARGIN: f32 = 2e-4;

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

    /// Opens the cone, the axis stays, until it holds `other`. Without trigonometry.
    pub(super) fn widen(&mut self, other: &Cone) {
        let cos_d = self.axis.dot(other.axis);
        let cos_d = if self.both { cos_d.abs() } else { cos_d }.clamp(-1.0, 1.0);
        // cos(d + o), or -1 beyond pi
        let cos = if cos_d < -other.cos_o {
            -1.0
        } else {
            cos_d * other.cos_o - ((1.0 - cos_d * cos_d) * (1.0 - other.cos_o * other.cos_o)).max(0.0).sqrt()
        };
        self.cos_o = self.cos_o.min(cos);
        self.cos_e = self.cos_e.min(other.cos_e);
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
    /// Bounds of all. `all` is gone through twice.
    pub(super) fn around<'a>(all: impl Iterator<Item = &'a Bounds> + Clone) -> Bounds {
        let mut sum = BoundsSum::default();
        all.clone().for_each(|b| sum.add(b));
        let mut bounds = sum.start();
        all.for_each(|b| bounds.cone.widen(&b.cone));
        bounds.finish()
    }

    /// After the second pass.
    pub(super) fn finish(mut self) -> Bounds {
        if self.cone.cos_o < 1.0 {
            self.cone.cos_o = (self.cone.cos_o - COS_MARGIN).max(-1.0);
        }
        self
    }

    /// Whether it bounds nothing.
    pub(super) fn is_empty(&self) -> bool {
        self.aabb.is_empty()
    }

    /// Cost of descending into this group, up to a factor that all splits of a node share. The squared diagonal stands for the
    /// surface area: it does not vanish for lights in a row.
    pub(super) fn cost(&self) -> f32 {
        if self.aabb.is_empty() { 0.0 } else { self.power * self.cone.measure() * self.aabb.size().length_squared() }
    }
}

/// First of two passes that bound a group: everything but the width of the cone.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BoundsSum {
    aabb: Aabb,
    power: f32,
    first: Vec3,
    axes: Vec3,
    both: bool,
}

impl BoundsSum {
    /// First pass.
    pub(super) fn add(&mut self, bounds: &Bounds) {
        let cone = &bounds.cone;
        if self.aabb.is_empty() {
            self.first = cone.axis;
        }
        self.aabb = self.aabb.union(bounds.aabb);
        self.power += bounds.power;
        self.both |= cone.both;
        // Which way a two-sided light points does not matter
        self.axes += if cone.both && self.first.dot(cone.axis) < 0.0 { -cone.axis } else { cone.axis };
    }

    /// Bounds whose cone holds only the mean axis, to be widened in the second pass.
    pub(super) fn start(&self) -> Bounds {
        let axis = self.axes.try_normalize().unwrap_or(Vec3::Z);
        Bounds { aabb: self.aabb, cone: Cone { axis, cos_o: 1.0, cos_e: 1.0, both: self.both }, power: self.power }
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
    /// Emits nothing.
    pub(super) const NOTHING: Emitter =
        Emitter { centre: Vec3::ZERO, radius: 0.0, cone: Cone::SPHERE, power: 0.0, flat: false };

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
