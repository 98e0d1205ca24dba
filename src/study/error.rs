//! How far an image is from the truth, when the truth is only known with noise: error, noise and bias apart.
//!
//! Image and reference come as two independent halves each. A product of differences to different halves has the expectation of
//! the squared difference of what the halves estimate, without the noise that a plain square would add. Which halves are mixed
//! decides what is left in: `(i-a)(i-b)` keeps the image's own noise (its error), `(i1-a)(i2-b)` does not (its bias).

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::image::Image;
use crate::render::Film;

/// Share of the reference's mean that keeps denominators of relative errors away from 0, as in [`crate::image::metrics`].
const FLOOR: f64 = 0.01;

/// Radiance of all pixels, row by row, one entry a band.
pub type Plane = Vec<[f64; 3]>;

/// A plane in single precision, as images hold it.
pub fn rounded(plane: &Plane) -> Vec<Vec3> {
    plane.iter().map(|v| DVec3::from(*v).as_vec3()).collect()
}

/// What `all` has more than `part`.
pub fn difference(all: &Plane, part: &Plane) -> Plane {
    all.iter().zip(part).map(|(a, p)| std::array::from_fn(|c| a[c] - p[c])).collect()
}

/// Two independent estimates of the same radiance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Halves(pub [Plane; 2]);

/// An image as two independent halves of its trials: all light, and indirect light (LORES) alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// HIRES + LORES.
    pub whole: Halves,
    /// LORES.
    pub indirect: Halves,
}

impl Halves {
    /// The better estimate from both.
    pub fn mean(&self) -> Plane {
        self.0[0].iter().zip(&self.0[1]).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
    }

    /// Means over squares of `factor` x `factor` pixels of an image that is `width` pixels wide; what does not fill a square
    /// on the right and at the bottom is left out.
    pub fn coarser(&self, width: usize, factor: usize) -> Halves {
        Halves(self.0.each_ref().map(|plane| {
            let (columns, rows) = (width / factor, plane.len() / width / factor);
            let mut sums = vec![[0.0; 3]; columns * rows];
            for (i, value) in plane.iter().enumerate() {
                let (x, y) = (i % width / factor, i / width / factor);
                if x < columns && y < rows {
                    let sum = &mut sums[y * columns + x];
                    (0..3).for_each(|c| sum[c] += value[c] / (factor * factor) as f64);
                }
            }
            sums
        }))
    }
}

impl Picture {
    /// From the even and the odd trials of a film; `None` where a pixel has fewer than two trials.
    pub fn of(film: &Film) -> Option<Picture> {
        let mut picture = Picture::default();
        for pixel in film.pixels() {
            let hires = pixel.hires.halves()?;
            // The radiosity solution shown directly has no second pass.
            let lores = pixel.lores.halves().unwrap_or_default();
            for (k, (h, l)) in [(hires.0, lores.0), (hires.1, lores.1)].into_iter().enumerate() {
                picture.whole.0[k].push(std::array::from_fn(|c| h[c] + l[c]));
                picture.indirect.0[k].push(l);
            }
        }
        Some(picture)
    }

    /// HIRES alone.
    pub fn direct(&self) -> Halves {
        Halves(std::array::from_fn(|k| difference(&self.whole.0[k], &self.indirect.0[k])))
    }

    /// Channels `R,G,B` and the layer `lores`, means of both halves.
    pub fn develop(&self, width: u32) -> Image {
        let mut image = Image::new(width, self.whole.0[0].len() as u32 / width);
        for (layer, halves) in [("", &self.whole), ("lores", &self.indirect)] {
            image.push_rgb(layer, &rounded(&halves.mean()));
        }
        image
    }
}

/// Error of an image, relative to the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Mean of `(i - r)^2 / (r^2 + 0.01 mean(r)^2)` over pixels and bands, without the reference's noise.
    pub rel_mse: f64,
    /// Standard error of that, from the spread over pixels.
    pub rel_mse_error: f64,
    /// The part of it that more trials do not remove: without the image's own noise too. Can come out below 0 when there is
    /// next to none.
    pub bias_rel_mse: f64,
    /// Standard error of that.
    pub bias_rel_mse_error: f64,
    /// `mean(i) / mean(r) - 1`.
    pub relative_bias: f64,
    /// Standard error of that, from the differences of halves, image and reference together.
    pub relative_bias_error: f64,
    /// Mean relative difference of each band, as in the paper's Table 4; see [`MeanRelative`].
    pub mean_relative: MeanRelative,
}

/// Mean of `|i - r| / (r + 0.01 mean(r))` of each band.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeanRelative {
    /// As measured: noise of image and reference only makes it larger.
    pub measured: [f64; 3],
    /// A lower bound that noise does not raise: one pair of halves says which is brighter, the other by how much.
    pub at_least: [f64; 3],
    /// What noise of image and reference together would make of an image without any bias.
    pub noise: [f64; 3],
    /// The reference's own noise: mean of its standard error over its radiance.
    pub reference_noise: [f64; 3],
}

/// Mean and standard error of a number per pixel.
#[derive(Default)]
struct Spread {
    sum: f64,
    square: f64,
    count: f64,
}

impl Spread {
    fn add(&mut self, x: f64) {
        self.sum += x;
        self.square += x * x;
        self.count += 1.0;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1.0)
    }

    fn error(&self) -> f64 {
        let variance = self.square / self.count.max(1.0) - self.mean().powi(2);
        (variance.max(0.0) / (self.count - 1.0).max(1.0)).sqrt()
    }
}

fn mean_of(plane: &Plane) -> f64 {
    plane.iter().flatten().sum::<f64>() / (3.0 * plane.len().max(1) as f64)
}

/// Compares an image with the reference. The mean relative difference is taken at a coarser resolution: over squares of `factor` x
/// `factor` pixels.
pub fn compare(image: &Halves, reference: &Halves, width: usize, factor: usize) -> Errors {
    let (i, r) = (image.mean(), reference.mean());
    let ([i1, i2], [a, b]) = (&image.0, &reference.0);
    let floor = FLOOR * mean_of(&r).powi(2);
    let (mut error, mut bias) = (Spread::default(), Spread::default());
    let (mut image_noise, mut reference_noise) = (0.0, 0.0);
    for p in 0..i.len() {
        let (mut e, mut s, mut di, mut dr) = (0.0, 0.0, 0.0, 0.0);
        for c in 0..3 {
            let scale = r[p][c].powi(2) + floor;
            if scale > 0.0 {
                e += (i[p][c] - a[p][c]) * (i[p][c] - b[p][c]) / scale;
                let crossed = (i1[p][c] - a[p][c]) * (i2[p][c] - b[p][c]) + (i1[p][c] - b[p][c]) * (i2[p][c] - a[p][c]);
                s += 0.5 * crossed / scale;
            }
            di += (i1[p][c] - i2[p][c]) / 6.0;
            dr += (a[p][c] - b[p][c]) / 6.0;
        }
        // The bands of a pixel share their paths, so the pixel is the unit of standard errors.
        error.add(e / 3.0);
        bias.add(s / 3.0);
        image_noise += di * di;
        reference_noise += dr * dr;
    }
    let mean = mean_of(&r);
    let pixels = i.len().max(1) as f64;
    let relative = |x: f64| if mean > 0.0 { x / mean } else { 0.0 };
    Errors {
        rel_mse: error.mean(),
        rel_mse_error: error.error(),
        bias_rel_mse: bias.mean(),
        bias_rel_mse_error: bias.error(),
        relative_bias: relative(mean_of(&i) - mean),
        relative_bias_error: relative((image_noise + reference_noise).sqrt() / pixels),
        mean_relative: mean_relative(&image.coarser(width, factor), &reference.coarser(width, factor)),
    }
}

fn mean_relative(image: &Halves, reference: &Halves) -> MeanRelative {
    let (i, r) = (image.mean(), reference.mean());
    let ([i1, i2], [a, b]) = (&image.0, &reference.0);
    let n = i.len().max(1) as f64;
    // The mean magnitude of a normal deviate is sqrt(2 / pi) standard deviations; half the difference of two halves is a
    // deviate with the standard deviation of their mean.
    let to_deviation = std::f64::consts::FRAC_PI_2.sqrt();
    let mut result = MeanRelative::default();
    for c in 0..3 {
        let floor = FLOOR * r.iter().map(|v| v[c]).sum::<f64>() / n;
        for p in 0..i.len() {
            let scale = r[p][c] + floor;
            if scale <= 0.0 {
                continue;
            }
            let (half_i, half_r) = (0.5 * (i1[p][c] - i2[p][c]), 0.5 * (a[p][c] - b[p][c]));
            let [first, second] = [i1[p][c] - a[p][c], i2[p][c] - b[p][c]];
            result.measured[c] += (i[p][c] - r[p][c]).abs() / scale / n;
            result.at_least[c] += 0.5 * (first.signum() * second + second.signum() * first) / scale / n;
            result.noise[c] += (half_i - half_r).abs() / scale / n;
            result.reference_noise[c] += to_deviation * half_r.abs() / scale / n;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, unit};

    /// 64 x 64 pixels of `value` with uniform noise of standard deviation `noise` in each half.
    fn halves(value: f64, noise: f64, salt: u32) -> Halves {
        let width = noise * 12.0_f64.sqrt();
        let plane = |half: u32| {
            let band = |p: u32, c: u32| value + width * (f64::from(unit(hash_all(&[salt, half, p, c]))) - 0.5);
            (0..4096).map(|p| std::array::from_fn(|c| band(p, c as u32))).collect()
        };
        Halves([plane(0), plane(1)])
    }

    #[test]
    fn noise_of_both_sides_is_told_from_bias() {
        let (noise, bias) = (0.2, 0.1);
        let e = compare(&halves(1.0 + bias, noise, 1), &halves(1.0, 0.1, 2), 64, 1);
        // Four standard errors fail once in 16,000 (fixed numbers). Denominators carry the reference's noise of 0.07 a pixel:
        // With r = 1 + e, e^2 = 0.005 in the mean, E[1/r^2] is 1 + 3 e^2 to first order, and E[-2 bias e / r^2] is 4 bias e^2.
        let e2 = 0.005;
        let scale = (1.0 + 3.0 * e2) / 1.01;
        let exact = scale * (bias * bias + noise * noise / 2.0) + 4.0 * bias * e2 / 1.01;
        assert!((e.rel_mse - exact).abs() < 4.0 * e.rel_mse_error + 0.02 * exact, "{e:?}, {exact}");
        let exact = scale * bias * bias + 4.0 * bias * e2 / 1.01;
        assert!((e.bias_rel_mse - exact).abs() < 4.0 * e.bias_rel_mse_error + 0.02 * exact, "{e:?}, {exact}");
        assert!((e.relative_bias - bias).abs() < 4.0 * e.relative_bias_error, "{e:?}");
        // Means of 4096 pixels and three bands of two halves each.
        let exact = ((0.04 + 0.01) / (2.0 * 3.0 * 4096.0_f64)).sqrt();
        assert!((e.relative_bias_error / exact - 1.0).abs() < 0.1, "{e:?}, {exact}");
    }

    #[test]
    fn the_mean_relative_difference_lies_between_its_bounds() {
        for (bias, noise) in [(0.0, 0.1), (0.02, 0.05), (0.1, 0.02)] {
            let m = compare(&halves(1.0 + bias, noise, 3), &halves(1.0, 0.02, 4), 64, 1).mean_relative;
            for c in 0..3 {
                let exact = bias / 1.01;
                // Spread of a mean over 4096 pixels: at most 0.11 / 64 each, four of them.
                let slack = 4.0 * 0.11 / 64.0;
                assert!(m.at_least[c] < exact + slack && exact < m.measured[c] + slack, "{bias} {noise} {m:?}");
            }
        }
    }

    #[test]
    fn coarser_images_are_means() {
        let plane: Plane = (0..5 * 4).map(|i| [f64::from(i), 1.0, 0.0]).collect();
        let coarse = Halves([plane.clone(), plane]).coarser(5, 2);
        assert_eq!(coarse.0[0], vec![[3.0, 1.0, 0.0], [5.0, 1.0, 0.0], [13.0, 1.0, 0.0], [15.0, 1.0, 0.0]]);
    }
}
