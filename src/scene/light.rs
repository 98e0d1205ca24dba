//! Lights without area (`KHR_lights_punctual`).

use glam::Vec3;

/// A light without area.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Name, for messages.
    pub name: String,
    /// Colour times intensity: radiant intensity (W/sr) for point and spot, irradiance on a facing surface (W/m^2)
    /// for directional; photometric files give candela and lux, taken as they are.
    pub intensity: Vec3,
    /// Where it is and where it shines.
    pub kind: LightKind,
}

/// Kinds of punctual lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in all directions.
    Point {
        /// Position.
        position: Vec3,
    },
    /// Shines into a cone.
    Spot {
        /// Position.
        position: Vec3,
        /// Unit axis of the cone.
        direction: Vec3,
        /// Cosine of the angle up to which intensity is full.
        cos_inner: f32,
        /// Cosine of the angle at which it reaches zero.
        cos_outer: f32,
    },
    /// Shines everywhere from infinity.
    Directional {
        /// Unit direction in which light travels.
        direction: Vec3,
    },
}

impl PunctualLight {
    /// Whether all values are possible.
    pub(super) fn check(&self) -> Result<(), String> {
        let fail = |what: String| Err(format!("light '{}': {what}", self.name));
        if !(self.intensity.is_finite() && self.intensity.min_element() >= 0.0) {
            return fail(format!("the intensity is {}, must be finite and not negative", self.intensity));
        }
        let (position, direction) = match self.kind {
            LightKind::Point { position } => (position, Vec3::Z),
            LightKind::Spot { position, direction, cos_inner, cos_outer } => {
                // The extension demands 0 <= inner < outer <= 90 degrees.
                if !(cos_inner <= 1.0 && cos_inner > cos_outer && cos_outer > -1e-6) {
                    return fail("the cone angles must be 0 <= inner < outer <= 90 degrees".into());
                }
                (position, direction)
            }
            LightKind::Directional { direction } => (Vec3::ZERO, direction),
        };
        if !position.is_finite() || !direction.is_normalized() {
            return fail("position or direction is not finite".into());
        }
        Ok(())
    }
}
