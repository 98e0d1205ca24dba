//! Small pictures for the page: images of the methods, and how they differ from the reference.

use std::path::Path;

use glam::Vec3;

use super::error::{Plane, rounded};
use crate::error::Result;
use crate::image::{self, Image, Metadata, ViewTransform, WriteOptions};
use crate::srgb::srgb_decode;

/// Relative difference that has the full colour in a difference image.
pub const FULL_DIFFERENCE: f64 = 0.5;

/// Writes an image as seen through the film's tone curve.
///
/// # Errors
/// As [`image::write`].
pub fn photograph(path: &Path, width: u32, radiance: &Plane, exposure_stops: f32) -> Result<()> {
    let options = WriteOptions { exposure_stops, view: ViewTransform::Filmic, dither: true, ..WriteOptions::default() };
    image::write(path, &to_image(width, radiance), &Metadata::new(), &options)
}

/// The exposure that shows a reference well.
pub fn exposure(width: u32, reference: &Plane) -> f32 {
    image::auto_exposure(&to_image(width, reference))
}

/// Writes the relative difference of the mean of the bands: red where the image is too bright, blue where it is too dark, full colour
/// from [`FULL_DIFFERENCE`] on.
///
/// # Errors
/// As [`image::write`].
pub fn difference(path: &Path, width: u32, image: &Plane, reference: &Plane) -> Result<()> {
    let grey = |v: &[f64; 3]| v.iter().sum::<f64>() / 3.0;
    let floor = 0.05 * reference.iter().map(grey).sum::<f64>() / reference.len().max(1) as f64;
    let colours = image.iter().zip(reference).map(|(i, r)| {
        let d = (grey(i) - grey(r)) / (grey(r) + floor).max(f64::MIN_POSITIVE);
        diverging((d / FULL_DIFFERENCE).clamp(-1.0, 1.0) as f32)
    });
    let mut picture = Image::new(width, reference.len() as u32 / width);
    picture.push_rgb("", &colours.collect::<Vec<_>>());
    let options = WriteOptions { view: ViewTransform::Srgb, ..WriteOptions::default() };
    image::write(path, &picture, &Metadata::new(), &options)
}

/// Blue over near-white to red for -1..=1, linear light; equally far from white on both sides.
fn diverging(x: f32) -> Vec3 {
    let ends = if x < 0.0 { [0x21, 0x5d, 0xb5] } else { [0xc2, 0x3b, 0x22] };
    let white = Vec3::splat(0.96);
    let end = Vec3::from_array(ends.map(|v| v as f32 / 255.0));
    let encoded = white.lerp(end, x.abs().powf(0.7));
    Vec3::from_array(encoded.to_array().map(srgb_decode))
}

fn to_image(width: u32, radiance: &Plane) -> Image {
    let mut image = Image::new(width, radiance.len() as u32 / width);
    image.push_rgb("", &rounded(radiance));
    image
}

/// Reads the image of a point: all light, and indirect light.
///
/// # Errors
/// As [`image::read`].
pub fn read(path: &Path) -> Result<[Plane; 2]> {
    let image = image::read(path)?;
    let plane = |layer| -> Plane {
        let bands = image.rgb(layer);
        (0..image.pixels()).map(|p| bands.map_or([0.0; 3], |b| b.map(|b| f64::from(b[p])))).collect()
    };
    Ok([plane(""), plane("lores")])
}
