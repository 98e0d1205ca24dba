//! Decoded textures.

use glam::{Vec2, Vec4};

/// What texture coordinates outside of 0..1 mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Repeats.
    #[default]
    Repeat,
    /// Repeats, every other time mirrored.
    Mirror,
    /// The edge goes on.
    Clamp,
}

/// A decoded image with its sampler.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name, for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// RGBA, `width * height * 4` values, row by row from the top.
    pub texels: Texels,
    /// Meaning of coordinates outside of 0..1, horizontally and vertically.
    pub wrap: [Wrap; 2],
}

/// Texel storage.
#[derive(Clone, Debug)]
pub enum Texels {
    /// Eight bits, colour sRGB-encoded (alpha linear).
    Srgb8(Vec<u8>),
    /// Eight bits, linear.
    Linear8(Vec<u8>),
    /// Linear floats.
    Float(Vec<f32>),
}

impl Texture {
    /// Bilinearly filtered linear RGBA at texture coordinates `uv` (v down, as in glTF).
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let _ = uv;
        todo!("scene import helper")
    }
}
