//! Decoded textures.

use std::sync::LazyLock;

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use crate::srgb::{srgb_decode, srgb_encode};

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
    /// The same at half the size, a quarter and so on down to one texel, as [`Texture::with_smaller`] makes it; may be empty.
    pub smaller: Vec<Texture>,
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

/// A texel along one axis, and its share.
type Share = (u32, f32);

/// The texels of an axis with `of` of them that texel `i` covers where there are `size`, at least half as many. Shares add up to one.
fn shares(i: u32, size: u32, of: u32) -> [Share; 3] {
    // In units of 1 / size of a texel, so that all is exact.
    let (start, end) = (u64::from(i) * u64::from(of), u64::from(i + 1) * u64::from(of));
    let first = start / u64::from(size);
    std::array::from_fn(|k| {
        let at = first + k as u64;
        let (low, high) = (at * u64::from(size), (at + 1) * u64::from(size));
        let covered = high.min(end).saturating_sub(low.max(start));
        (at.min(u64::from(of) - 1) as u32, covered as f32 / of as f32)
    })
}

fn eight_bits(x: f32) -> u8 {
    (x * 255.0 + 0.5) as u8
}

/// sRGB-encoded bytes by the square root of the linear value, so finely that rounding is exact within a twelfth of a step.
static SRGB8_OF_ROOT: LazyLock<[u8; 4096]> =
    LazyLock::new(|| std::array::from_fn(|i| eight_bits(srgb_encode((i as f32 / 4095.0).powi(2)))));

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

    /// The same averaged over about `width` texels around `uv`: a box of at least half that, and no more.
    pub fn sample_over(&self, uv: Vec2, width: f32) -> Vec4 {
        // Saturates: none of what is infinite or no number is an index beyond the end.
        let level = (width.log2() as usize).min(self.smaller.len());
        if level == 0 { self.sample(uv) } else { self.smaller[level - 1].sample(uv) }
    }

    /// Adds smaller images, each the mean of the one before in linear light.
    pub fn with_smaller(mut self) -> Self {
        self.smaller.clear();
        while let largest = self.smaller.last().unwrap_or(&self)
            && largest.width.max(largest.height) > 1
        {
            let half = largest.halved();
            self.smaller.push(half);
        }
        self
    }

    fn halved(&self) -> Texture {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let columns: Vec<[Share; 3]> = (0..width).map(|x| shares(x, width, self.width)).collect();
        let rows: Vec<Vec<Vec4>> = (0..height)
            .into_par_iter()
            .map(|y| {
                let rows = shares(y, height, self.height);
                let mean = |columns: &[Share; 3]| {
                    let mut sum = Vec4::ZERO;
                    for (row, down) in rows {
                        for &(column, across) in columns {
                            let weight = down * across;
                            if weight > 0.0 {
                                sum += weight * self.texel((row * self.width + column) as usize);
                            }
                        }
                    }
                    sum
                };
                columns.iter().map(mean).collect()
            })
            .collect();
        let texels = rows.iter().flatten();
        let texels = match &self.texels {
            Texels::Srgb8(_) => {
                let color = |x: f32| SRGB8_OF_ROOT[(x.sqrt() * (SRGB8_OF_ROOT.len() - 1) as f32 + 0.5) as usize];
                Texels::Srgb8(texels.flat_map(|t| [color(t.x), color(t.y), color(t.z), eight_bits(t.w)]).collect())
            }
            Texels::Linear8(_) => Texels::Linear8(texels.flat_map(|t| t.to_array().map(eight_bits)).collect()),
            Texels::Float(_) => Texels::Float(texels.flat_map(|t| t.to_array()).collect()),
        };
        Texture { name: String::new(), width, height, texels, wrap: self.wrap, smaller: Vec::new() }
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
        Texture { name: "t".into(), width: 2, height: 2, texels, wrap: [wrap; 2], smaller: Vec::new() }
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

    /// The mean of every level is that of the image, whatever its size; a constant stays what it is.
    #[test]
    fn smaller_images_have_the_same_mean() {
        for [width, height] in [[1, 1], [2, 2], [5, 3], [7, 1], [16, 9], [33, 64]] {
            let values = (0..width * height * 4).map(|i| (i * 37 % 101) as f32 / 101.0).collect();
            let made = |texels| Texture {
                name: "t".into(),
                width,
                height,
                texels,
                wrap: [Wrap::Clamp; 2],
                smaller: Vec::new(),
            };
            let t = made(Texels::Float(values)).with_smaller();
            assert_eq!(t.smaller.len(), width.max(height).next_power_of_two().ilog2() as usize);
            for smaller in &t.smaller {
                smaller.check().unwrap();
                // Nine products and sums of values below one, six levels deep.
                assert!((smaller.mean() - t.mean()).abs().max_element() < 54.0 * f32::EPSILON, "{width} {height}");
            }
            for byte in [0, 1, 7, 100, 188, 255] {
                for texels in [Texels::Srgb8, Texels::Linear8] {
                    let grey = made(texels(vec![byte; (width * height * 4) as usize])).with_smaller();
                    for smaller in &grey.smaller {
                        let (Texels::Srgb8(t) | Texels::Linear8(t)) = &smaller.texels else { panic!("eight bits") };
                        assert!(t.iter().all(|&t| t == byte), "{byte} became {t:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn wide_samples_are_means() {
        let checker = |i: u32| if (i % 64 + i / 64).is_multiple_of(2) { [1.0; 4] } else { [0.0, 0.0, 0.0, 1.0] };
        let texels = Texels::Float((0..64 * 64).flat_map(checker).collect());
        let t = Texture { width: 64, height: 64, ..texture(texels, Wrap::Repeat) }.with_smaller();
        let at = Vec2::splat(0.5 / 64.0);
        for sharp in [0.0, 0.5, 1.9, -1.0, f32::NAN] {
            assert_eq!(t.sample_over(at, sharp), Vec4::ONE);
        }
        for wide in [2.0, 3.0, 64.0, 1e9, f32::INFINITY] {
            assert_eq!(t.sample_over(at, wide), Vec4::new(0.5, 0.5, 0.5, 1.0), "{wide}");
        }
    }

    #[test]
    fn wild_coordinates_give_a_texel() {
        for x in [f32::NAN, f32::INFINITY, -f32::MAX, 1e9, -123_456.7] {
            assert!(ramp(Wrap::Repeat).sample(Vec2::new(x, x)).is_finite());
        }
    }
}
