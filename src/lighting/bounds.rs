//! Where the light of a group of light sources comes from and goes to, and an upper-bound-like estimate of what reaches a
//! point: Conty Estevez and Kulla, "Importance sampling of many lights with adaptive tree splitting" (2018),
//! in the form of pbrt 4ed 12.6.3.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use super::Lit;
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
}

/// Number of emitters whose importance is estimated together.
pub(super) const LANES: usize = 8;

/// What each of eight emitters may bring to a point.
pub(super) type Importance = [f32; LANES];

/// Eight emitters side by side, each quantity an array over them: compilers turn the loop over lanes into vector instructions.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Emitters {
    centre: [[f32; LANES]; 3],
    axis: [[f32; LANES]; 3],
    radius: [f32; LANES],
    /// Zero in lanes without an emitter.
    power: [f32; LANES],
    cos_o: [f32; LANES],
    sin_o: [f32; LANES],
    cos_e: [f32; LANES],
    /// Squared sine of the angle below the plane from which nothing arrives; infinite where light leaves to the back, too.
    dark: [f32; LANES],
    /// One where light leaves into the opposite directions, too; else zero.
    both: [f32; LANES],
    /// Whether the cone of any lane holds more than its axis.
    cones: bool,
}

impl Emitters {
    /// No emitter in any lane.
    pub(super) const NOTHING: Emitters = Emitters {
        centre: [[0.0; LANES]; 3],
        axis: [[0.0; LANES]; 3],
        radius: [0.0; LANES],
        power: [0.0; LANES],
        cos_o: [1.0; LANES],
        sin_o: [0.0; LANES],
        cos_e: [1.0; LANES],
        dark: [f32::INFINITY; LANES],
        both: [0.0; LANES],
        cones: false,
    };

    /// Puts an emitter into a lane.
    pub(super) fn set(&mut self, lane: usize, emitter: &Emitter) {
        let cone = &emitter.cone;
        for axis in 0..3 {
            self.centre[axis][lane] = emitter.centre[axis];
            self.axis[axis][lane] = cone.axis[axis];
        }
        self.radius[lane] = emitter.radius;
        self.power[lane] = emitter.power;
        self.cos_o[lane] = cone.cos_o;
        self.sin_o[lane] = sin(cone.cos_o);
        self.cos_e[lane] = cone.cos_e;
        let one_sided = emitter.flat && !cone.both;
        self.dark[lane] = if one_sided { SIDE_MARGIN * SIDE_MARGIN } else { f32::INFINITY };
        self.cones |= cone.cos_o < 1.0;
        self.both[lane] = f32::from(u8::from(cone.both));
    }

    /// Estimates of the irradiance at `position` on a surface with unit `normal` (zero: on any), occlusion left out. Zero
    /// only where nothing can arrive.
    ///
    /// Over the sphere of a light whose radius appears under the angle b, cosines differ from the centre's by at most
    /// `w = sin b + sin^2 b`; what counts is the mean of their positive parts, as if they were spread evenly.
    pub(super) fn importance(&self, position: Vec3, normal: Vec3) -> Importance {
        if self.cones {
            self.importance_of::<true>(position, normal)
        } else {
            self.importance_of::<false>(position, normal)
        }
    }

    /// The same at many points: processors work on several at a time.
    pub(super) fn importance_at(&self, lit: &[Lit], importance: &mut [Importance]) {
        if self.cones {
            importance.iter_mut().zip(lit).for_each(|(i, l)| *i = self.importance_of::<true>(l.position, l.normal));
        } else {
            importance.iter_mut().zip(lit).for_each(|(i, l)| *i = self.importance_of::<false>(l.position, l.normal));
        }
    }

    /// `CONES`: whether any lane emits within a cone around more directions than one.
    #[inline(always)]
    fn importance_of<const CONES: bool>(&self, position: Vec3, normal: Vec3) -> Importance {
        let mut importance = [0.0; LANES];
        let any_side = f32::from(u8::from(normal == Vec3::ZERO));
        for (i, value) in importance.iter_mut().enumerate() {
            let x = position.x - self.centre[0][i];
            let y = position.y - self.centre[1][i];
            let z = position.z - self.centre[2][i];
            let d2 = x * x + y * y + z * z;
            let radius = self.radius[i];
            let r2 = radius * radius;
            let near = d2 <= larger(r2, MIN_DISTANCE_SQUARED);
            let estimate = self.power[i] / larger(larger(d2, r2), MIN_DISTANCE_SQUARED);
            // Inside the sphere the angles mean nothing, and are not used
            let inverse = 1.0 / larger(d2, MIN_DISTANCE_SQUARED).sqrt();
            let height = x * self.axis[0][i] + y * self.axis[1][i] + z * self.axis[2][i];
            // The margin keeps points whose side is lost in rounding
            let behind = height < 0.0 && height * height > self.dark[i] * d2;
            let sin_b = radius * inverse;
            let w = sin_b + sin_b * sin_b;
            let scale = 0.25 / larger(w, f32::MIN_POSITIVE);
            let along = height * inverse;
            let cos_w = if self.both[i] > 0.0 { along.abs() } else { along };
            let cos_x = if CONES { cos_of_difference(cos_w, sin(cos_w), self.cos_o[i], self.sin_o[i]) } else { cos_w };
            let cos_i = -(x * normal.x + y * normal.y + z * normal.z) * inverse;
            // Not `<=`: inside a spot's cone both are 1
            let dark = smaller(cos_x + w, 1.0) < self.cos_e[i];
            let leaving = mean_positive(cos_x, w, scale);
            let arriving = larger(mean_positive(cos_i, w, scale), any_side);
            let outside = if dark { 0.0 } else { estimate * leaving * arriving };
            let value_here = if near { estimate } else { outside };
            *value = if behind { 0.0 } else { value_here };
        }
        importance
    }
}

/// The sine that belongs to a cosine, or the other way round.
fn sin(cos: f32) -> f32 {
    larger(1.0 - cos * cos, 0.0).sqrt()
}

/// As `f32::max`, for numbers: one instruction.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Mean of the positive part of numbers spread evenly within `w` of `x`; `scale` is 1 / (4 w).
#[inline(always)]
fn mean_positive(x: f32, w: f32, scale: f32) -> f32 {
    let positive = larger(x + w, 0.0);
    if x < w { positive * positive * scale } else { x }
}

/// As `f32::min`, for numbers: one instruction.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// `cos(max(0, a - b))` for angles in 0..pi.
fn cos_of_difference(cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32) -> f32 {
    if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
}
