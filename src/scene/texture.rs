//! Decoded textures.

use std::sync::LazyLock;

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use crate::srgb::srgb_decode;

/// What texture coordinates outside of 0..1 mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
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

static SRGB8: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| srgb_decode(i as f32 / 255.0)));

impl Wrap {
    /// Texel number for any integer texel position of an axis with `size` texels.
    fn texel(self, i: i64, size: i64) -> usize {
        let i = match self {
            Wrap::Repeat => i.rem_euclid(size),
            Wrap::Clamp => i.clamp(0, size - 1),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * size);
                i.min(2 * size - 1 - i)
            }
        };
        i as usize
    }
}

impl Texture {
    /// Whether the texels are as many as the size says.
    pub(super) fn check(&self) -> Result<(), String> {
        let have = match &self.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => t.len(),
            Texels::Float(t) => t.len(),
        };
        let want = (self.width as usize).checked_mul(self.height as usize).and_then(|n| n.checked_mul(4));
        match want {
            Some(want) if want == have && want > 0 => Ok(()),
            _ => Err(format!("texture '{}': {have} values for {} x {} texels", self.name, self.width, self.height)),
        }
    }

    /// Linear RGBA of texel `index` (row by row).
    fn texel(&self, index: usize) -> Vec4 {
        let at = 4 * index;
        match &self.texels {
            Texels::Srgb8(t) => {
                let color = |c: usize| SRGB8[usize::from(t[at + c])];
                Vec4::new(color(0), color(1), color(2), f32::from(t[at + 3]) / 255.0)
            }
            Texels::Linear8(t) => Vec4::from_array([0, 1, 2, 3].map(|c| f32::from(t[at + c]))) / 255.0,
            Texels::Float(t) => Vec4::from_slice(&t[at..at + 4]),
        }
    }

    /// Bilinearly filtered linear RGBA at texture coordinates `uv` (v down, as in glTF).
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        // Coordinates beyond this have no fraction left; and a NaN must pick some texel, not panic.
        let limit = |x: f32| if x.abs() < 1e9 { f64::from(x) } else { 0.0 };
        let x = limit(uv.x) * f64::from(self.width) - 0.5;
        let y = limit(uv.y) * f64::from(self.height) - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = ((x - x0) as f32, (y - y0) as f32);
        let (w, h) = (i64::from(self.width), i64::from(self.height));
        let column = [0, 1].map(|d| self.wrap[0].texel(x0 as i64 + d, w));
        let row = [0, 1].map(|d| self.wrap[1].texel(y0 as i64 + d, h) * w as usize);
        let top = self.texel(row[0] + column[0]).lerp(self.texel(row[0] + column[1]), fx);
        let bottom = self.texel(row[1] + column[0]).lerp(self.texel(row[1] + column[1]), fx);
        top.lerp(bottom, fy)
    }

    /// Mean linear RGBA of all texels.
    pub fn mean(&self) -> Vec4 {
        let texels = self.width as usize * self.height as usize;
        // Rows are fixed chunks, summed in order: the same result on any number of threads.
        let rows: Vec<glam::DVec4> = (0..self.height as usize)
            .into_par_iter()
            .map(|y| (0..self.width as usize).map(|x| self.texel(y * self.width as usize + x).as_dvec4()).sum())
            .collect();
        (rows.into_iter().sum::<glam::DVec4>() / texels as f64).as_vec4()
    }

    /// Smallest alpha of all texels.
    pub fn min_alpha(&self) -> f32 {
        match &self.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => {
                t.iter().skip(3).step_by(4).min().map_or(1.0, |&a| f32::from(a) / 255.0)
            }
            Texels::Float(t) => t.iter().skip(3).step_by(4).copied().fold(1.0, f32::min),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(texels: Texels, wrap: Wrap) -> Texture {
        Texture { name: "t".into(), width: 2, height: 2, texels, wrap: [wrap; 2] }
    }

    /// Red is the column, green the row.
    fn ramp(wrap: Wrap) -> Texture {
        let t = vec![0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.5];
        texture(Texels::Float(t), wrap)
    }

    #[test]
    fn texel_centres_give_texels_and_the_middle_their_mean() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let t = ramp(wrap);
            assert_eq!(t.sample(Vec2::new(0.25, 0.25)), Vec4::new(0.0, 0.0, 0.0, 1.0));
            assert_eq!(t.sample(Vec2::new(0.75, 0.75)), Vec4::new(1.0, 1.0, 0.0, 0.5));
            assert_eq!(t.sample(Vec2::new(0.5, 0.5)), Vec4::new(0.5, 0.5, 0.0, 0.875));
        }
    }

    #[test]
    fn wrap_modes_differ_outside() {
        let at = |wrap, x| ramp(wrap).sample(Vec2::new(x, 0.25)).x;
        assert_eq!(at(Wrap::Repeat, 1.25), 0.0);
        assert_eq!(at(Wrap::Mirror, 1.25), 1.0);
        assert_eq!(at(Wrap::Clamp, 1.25), 1.0);
        assert_eq!(at(Wrap::Repeat, -0.25), 1.0);
        assert_eq!(at(Wrap::Mirror, -0.25), 0.0);
        assert_eq!(at(Wrap::Clamp, -0.25), 0.0);
        // On the border itself, repeating mixes the two edges.
        assert_eq!(at(Wrap::Repeat, 0.0), 0.5);
        assert_eq!(at(Wrap::Mirror, 0.0), 0.0);
    }

    #[test]
    fn srgb_is_decoded_before_filtering_and_alpha_is_linear() {
        let t = texture(Texels::Srgb8([[0, 0, 0, 0], [255, 255, 255, 255]].concat().repeat(2)), Wrap::Clamp);
        assert_eq!(t.sample(Vec2::splat(0.5)), Vec4::splat(0.5));
        let grey = texture(Texels::Srgb8(vec![188; 16]), Wrap::Clamp).sample(Vec2::ZERO);
        // 188 encodes ((188/255 + 0.055)/1.055)^2.4 = 0.50289.
        assert!((grey.x - 0.50289).abs() < 1e-5 && (grey.w - 188.0 / 255.0).abs() < 1e-7);
        assert_eq!(t.mean(), Vec4::splat(0.5));
        assert_eq!(t.min_alpha(), 0.0);
    }

    #[test]
    fn wild_coordinates_give_a_texel() {
        for x in [f32::NAN, f32::INFINITY, -f32::MAX, 1e9, -123_456.7] {
            assert!(ramp(Wrap::Repeat).sample(Vec2::new(x, x)).is_finite());
        }
    }
}
