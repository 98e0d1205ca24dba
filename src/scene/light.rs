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
