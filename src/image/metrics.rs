//! How far an image is from a reference.

use serde::Serialize;

use super::buffer::Image;
use crate::error::{Error, Result};

/// Share of the reference's mean that keeps the denominators of relative errors away from 0.
///
/// As `epsilon = 0.01 mean(b)^2` it is what relMSE is commonly regularised with (Rousselle et al. 2011 use a constant).
const FLOOR: f64 = 0.01;

/// Differences between an image and its reference over the bands R, G and B of all pixels where both are finite.
///
/// Ratios to a reference that is black throughout are infinite, or undefined if the image is black too; both are
/// `null` in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Pixels per row and rows.
    pub size: [u32; 2],
    /// Mean of `(a-b)^2 / (b^2 + 0.01 mean(b)^2)`, `a` the image, `b` the reference, `mean` over all bands.
    pub rel_mse: f64,
    /// Mean of `(a-b)^2`.
    pub mse: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Mean of `|a-b| / (|b| + 0.01 mean(b))`.
    pub mean_relative_error: f64,
    /// Per band `mean(a) / mean(b) - 1`: positive where the image is too bright as a whole.
    pub relative_bias: [f64; 3],
    /// Peak signal-to-noise ratio in dB, with the reference's largest value as the peak; none for equal images.
    pub psnr_db: Option<f64>,
    /// Largest `|a-b|` and the pixel (column, row from the top) where it is first met.
    pub max_difference: f64,
    /// See [`Metrics::max_difference`].
    pub max_difference_at: [u32; 2],
    /// Pixels with an infinite or undefined band in the image; they are left out.
    pub non_finite_image: usize,
    /// The same of the reference.
    pub non_finite_reference: usize,
}

/// The squared error against a reference that is itself noisy, given as two independent halves `a` and `b`.
///
/// `mean((image-a)(image-b))` has the expectation of the mean squared error against the true image, since the halves'
/// errors are independent of each other; a plain comparison with their mean would add the reference's own variance.
/// The image must be independent of both halves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossMetrics {
    /// Estimate of the mean squared error; noise can make it negative.
    pub mse: f64,
    /// Standard error of that estimate, from the spread over the pixels, taken as independent.
    pub mse_standard_error: f64,
    /// The same products over `r^2 + 0.01 mean(r)^2`, where `r` is the mean of the halves.
    pub rel_mse: f64,
    /// Pixels that are not finite in one of the three images; they are left out.
    pub non_finite: usize,
}

type Bands<'a> = [&'a [f32]; 3];

fn bands<'a>(image: &'a Image, which: &str) -> Result<Bands<'a>> {
    image.rgb_or_grey().ok_or_else(|| Error::Usage(format!("the {which} has no channels R, G and B to compare")))
}

fn same_size(reference: &Image, image: &Image) -> Result<()> {
    let size = |image: &Image| (image.width(), image.height());
    if size(reference) == size(image) && image.pixels() > 0 {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "images of one size are needed: the reference has {} x {} pixels, the image {} x {}",
        reference.width(),
        reference.height(),
        image.width(),
        image.height()
    )))
}

fn finite(bands: &Bands, pixel: usize) -> bool {
    bands.iter().all(|band| band[pixel].is_finite())
}

/// Mean per band over the pixels given.
fn means(bands: &Bands, pixels: &[usize]) -> [f64; 3] {
    bands.map(|band| pixels.iter().map(|&pixel| f64::from(band[pixel])).sum::<f64>() / pixels.len() as f64)
}

/// `numerator / denominator`, and 0 where there is nothing to compare: both black.
fn ratio(numerator: f64, denominator: f64) -> f64 {
    if numerator == 0.0 { 0.0 } else { numerator / denominator }
}

/// Compares the colour of two images; everything is done in double precision.
pub fn compare(reference: &Image, image: &Image) -> Result<Metrics> {
    same_size(reference, image)?;
    let (a, b) = (bands(image, "image")?, bands(reference, "reference")?);
    let all = 0..image.pixels();
    let pixels: Vec<usize> = all.clone().filter(|&pixel| finite(&a, pixel) && finite(&b, pixel)).collect();
    if pixels.is_empty() {
        return Err(Error::Usage("no pixel is finite in both images".to_owned()));
    }
    let (mean_a, mean_b) = (means(&a, &pixels), means(&b, &pixels));
    let mean = mean_b.iter().sum::<f64>() / 3.0;

    let (mut squares, mut relative_squares, mut relative) = (0.0, 0.0, 0.0);
    let (mut max_difference, mut max_pixel, mut peak) = (0.0f64, pixels[0], 0.0f64);
    for &pixel in &pixels {
        for band in 0..3 {
            let (a, b) = (f64::from(a[band][pixel]), f64::from(b[band][pixel]));
            let difference = (a - b).abs();
            let square = difference * difference;
            squares += square;
            relative_squares += ratio(square, b * b + FLOOR * mean * mean);
            relative += ratio(difference, b.abs() + FLOOR * mean.abs());
            peak = peak.max(b.abs());
            if difference > max_difference {
                (max_difference, max_pixel) = (difference, pixel);
            }
        }
    }
    let values = 3.0 * pixels.len() as f64;
    let mse = squares / values;
    let width = image.width() as usize;
    Ok(Metrics {
        size: [image.width(), image.height()],
        rel_mse: relative_squares / values,
        mse,
        rmse: mse.sqrt(),
        mean_relative_error: relative / values,
        relative_bias: std::array::from_fn(|band| mean_a[band] / mean_b[band] - 1.0),
        psnr_db: (mse > 0.0).then(|| 10.0 * (peak * peak / mse).log10()),
        max_difference,
        max_difference_at: [(max_pixel % width) as u32, (max_pixel / width) as u32],
        non_finite_image: all.clone().filter(|&pixel| !finite(&a, pixel)).count(),
        non_finite_reference: all.filter(|&pixel| !finite(&b, pixel)).count(),
    })
}

/// Compares an image with a reference that is given as two independent halves of its samples.
pub fn compare_halves(halves: [&Image; 2], image: &Image) -> Result<CrossMetrics> {
    for half in halves {
        same_size(half, image)?;
    }
    let [a, b] = [bands(halves[0], "reference")?, bands(halves[1], "reference")?];
    let image_bands = bands(image, "image")?;
    let pixels: Vec<usize> = (0..image.pixels())
        .filter(|&pixel| [&a, &b, &image_bands].into_iter().all(|bands| finite(bands, pixel)))
        .collect();
    if pixels.is_empty() {
        return Err(Error::Usage("no pixel is finite in all three images".to_owned()));
    }
    let mean = [means(&a, &pixels), means(&b, &pixels)].as_flattened().iter().sum::<f64>() / 6.0;

    let mut relative = 0.0;
    let products: Vec<f64> = pixels
        .iter()
        .map(|&pixel| {
            let mut sum = 0.0;
            for band in 0..3 {
                let [a, b, image] = [&a, &b, &image_bands].map(|bands| f64::from(bands[band][pixel]));
                let product = (image - a) * (image - b);
                let reference = 0.5 * (a + b);
                sum += product;
                relative += ratio(product, reference * reference + FLOOR * mean * mean);
            }
            // The bands of a pixel share their paths, so the pixel is the unit of the standard error.
            sum / 3.0
        })
        .collect();
    let count = products.len() as f64;
    let mse = products.iter().sum::<f64>() / count;
    let variance = products.iter().map(|product| (product - mse).powi(2)).sum::<f64>() / (count - 1.0);
    Ok(CrossMetrics {
        mse,
        mse_standard_error: (variance / count).sqrt(),
        rel_mse: relative / (3.0 * count),
        non_finite: image.pixels() - pixels.len(),
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::sampling::{hash_all, unit};

    fn image(width: u32, values: &[Vec3]) -> Image {
        let mut image = Image::new(width, values.len() as u32 / width);
        image.push_rgb("", values);
        image
    }

    #[test]
    fn known_differences() {
        let reference = image(2, &[Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::splat(f32::NAN)]);
        let same = compare(&reference, &reference).unwrap();
        assert_eq!((same.mse, same.rel_mse, same.psnr_db, same.non_finite_reference), (0.0, 0.0, None, 1));
        let other = image(2, &[Vec3::ONE, Vec3::new(1.5, 1.0, 0.75), Vec3::ONE, Vec3::ONE]);
        let metrics = compare(&reference, &other).unwrap();
        let squares = 0.25 + 0.0625;
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} is not {b}");
        close(metrics.mse, squares / 9.0);
        close(metrics.rmse, (squares / 9.0).sqrt());
        close(metrics.rel_mse, squares / 9.0 / 1.01);
        close(metrics.mean_relative_error, 0.75 / 9.0 / 1.01);
        close(metrics.relative_bias[0], 0.5 / 3.0);
        close(metrics.relative_bias[1], 0.0);
        close(metrics.relative_bias[2], -0.25 / 3.0);
        close(metrics.psnr_db.unwrap(), -10.0 * (squares / 9.0).log10());
        assert_eq!((metrics.max_difference, metrics.max_difference_at), (0.5, [1, 0]));
        assert_eq!((metrics.non_finite_image, metrics.non_finite_reference), (0, 1));
        assert!(compare(&reference, &image(1, &[Vec3::ONE])).is_err());
        let black = image(1, &[Vec3::ZERO]);
        assert_eq!(compare(&black, &black).unwrap().rel_mse, 0.0);
        assert_eq!(compare(&black, &image(1, &[Vec3::ONE])).unwrap().rel_mse, f64::INFINITY);
    }

    #[test]
    fn halves_cancel_the_noise_of_the_reference() {
        let noise = |salt: u32| {
            let value = |i: u32| Vec3::from_array([0, 1, 2].map(|band| 1.0 + unit(hash_all(&[i, salt, band])) - 0.5));
            image(64, &(0..4096).map(value).collect::<Vec<_>>())
        };
        let exact = image(64, &[Vec3::splat(1.1); 4096]);
        let metrics = compare_halves([&noise(1), &noise(2)], &exact).unwrap();
        // The truth is 1, so the squared error is 0.01; 4 standard errors fail falsely once in 16000 (fixed numbers).
        assert!((metrics.mse - 0.01).abs() < 4.0 * metrics.mse_standard_error, "{metrics:?}");
        // Product (0.1 - u)(0.1 - v) of uniform u, v: variance 2 * 0.01 / 12 + 1 / 144, over 3 bands and 4096 pixels.
        let expected = ((0.02f64 / 12.0 + 1.0 / 144.0) / (3.0 * 4096.0)).sqrt();
        assert!((metrics.mse_standard_error / expected - 1.0).abs() < 0.1);
    }
}
