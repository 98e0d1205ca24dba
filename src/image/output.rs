//! Writing an image file: all of it or nothing.

use std::path::Path;

use super::buffer::Image;
use super::metadata::Metadata;
use super::oiio::{self, Layout, Samples};
use super::view::ViewTransform;
use crate::error::{Error, Result};
use crate::sampling::{hash_all, unit};
use crate::unfinished::Unfinished;

/// What [`write()`] does to the values on their way to the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteOptions {
    /// Stops by which the image is brightened. Only in formats for screens; linear formats keep the radiance.
    pub exposure_stops: f32,
    /// Tone curve, for screens only.
    pub view: ViewTransform,
    /// Rounds to eight bits with a fixed pattern of noise, which hides bands in smooth shading.
    pub dither: bool,
    /// EXR: colours in half precision, unless a channel has values above its largest, 65504. Everything else (depth,
    /// counts) stays in single precision.
    pub half: bool,
    /// EXR and TIFF: compression; otherwise what OpenImageIO takes for the format (lossless `zip` for EXR).
    pub compression: Option<Compression>,
    /// EXR and TIFF: square tiles instead of rows, for programs that read a large image in parts.
    pub tiled: bool,
}

/// Compression of EXR files (TIFF knows `None` and `Zip`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Compression {
    /// None: fastest, largest.
    None,
    /// Deflate over 16 rows, lossless.
    Zip,
    /// Deflate over one row, lossless.
    Zips,
    /// Run lengths, lossless.
    Rle,
    /// Wavelets, lossless, best for noise.
    Piz,
    /// Lossy for single precision (24 bits are kept).
    Pxr24,
    /// Lossy, like JPEG, small.
    Dwaa,
    /// Lossy, as `Dwaa` over 256 rows.
    Dwab,
}

impl Compression {
    /// Every value, for option lists.
    pub const ALL: [Compression; 8] = {
        use Compression::*;
        [None, Zip, Zips, Rle, Piz, Pxr24, Dwaa, Dwab]
    };

    /// OpenImageIO's name.
    pub fn name(self) -> &'static str {
        match self {
            Compression::None => "none",
            Compression::Zip => "zip",
            Compression::Zips => "zips",
            Compression::Rle => "rle",
            Compression::Piz => "piz",
            Compression::Pxr24 => "pxr24",
            Compression::Dwaa => "dwaa",
            Compression::Dwab => "dwab",
        }
    }
}

/// Edge of the tiles of a tiled file, pixels: what texture systems expect.
const TILE: u32 = 64;

/// What a format stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    /// All channels by name, linear.
    Layers,
    /// `R,G,B`, linear.
    Linear,
    /// `R,G,B` in eight bits through the view transform.
    Screen,
}

/// Extensions of formats that hold linear single-precision floats, besides those with named channels. All others are
/// looked at as they are, so they get the view transform.
const LINEAR: [&str; 10] = ["hdr", "rgbe", "tif", "tiff", "tx", "env", "sm", "vsm", "pfm", "fits"];

impl Encoding {
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("").to_ascii_lowercase();
        let known = oiio::writable_extensions()?;
        if !known.contains(&extension) {
            let problem = if extension.is_empty() { "no extension" } else { "an extension that cannot be written" };
            return Err(Error::Usage(format!("{} has {problem}; use one of {}", path.display(), known.join(", "))));
        }
        if oiio::has_named_channels(path).map_err(|reason| failure(path, reason))? {
            Ok(Encoding::Layers)
        } else if LINEAR.contains(&extension.as_str()) {
            Ok(Encoding::Linear)
        } else {
            Ok(Encoding::Screen)
        }
    }
}

fn failure(path: &Path, reason: impl ToString) -> Error {
    Error::Output { path: path.to_owned(), reason: reason.to_string() }
}

/// Finds out before the work whether [`write()`] can succeed: extension known, folder there and writable, nothing in the
/// way, the format willing. A tiny image is written beside the target and removed.
pub fn check_writable(path: &Path) -> Result<()> {
    let mut probe = Image::new(16, 16);
    probe.push_rgb("", &[glam::Vec3::splat(0.5); 256]);
    write_beside(path, &probe, &Metadata::new(), &WriteOptions::default()).map(drop)
}

/// Writes an image in the format of the path's extension.
///
/// EXR gets every channel, `R,G,B` first; other formats get `R,G,B`, linear (HDR, TIFF, PFM, FITS) or for the screen
/// (PNG, JPEG, WebP and the rest). The file appears under its name when it is complete, replacing an older one; after a
/// failure nothing has changed.
pub fn write(path: &Path, image: &Image, metadata: &Metadata, options: &WriteOptions) -> Result<()> {
    let file = write_beside(path, image, metadata, options)?;
    file.finish(path).map_err(|error| failure(path, error))
}

/// Writes to a temporary file in the folder of the target, which goes when it is dropped.
fn write_beside(path: &Path, image: &Image, metadata: &Metadata, options: &WriteOptions) -> Result<Unfinished> {
    let encoding = Encoding::of(path)?;
    // The extension stays: OpenImageIO chooses the format by it.
    let file = Unfinished::new(path).map_err(|error| failure(path, error))?;
    let size = (image.width(), image.height());
    let tile = if options.tiled { TILE } else { 0 };
    let layout = Layout { compression: options.compression.map(Compression::name), tile };
    let (names, samples) = match encoding {
        Encoding::Layers => {
            let mut channels: Vec<_> = image.channels().iter().collect();
            channels.sort_by_key(|channel| rank(&channel.name));
            let half = channels.iter().map(|channel| options.half && fits_half(&channel.name, &channel.values));
            let half = half.collect();
            let planes: Vec<&[f32]> = channels.iter().map(|channel| channel.values.as_slice()).collect();
            let names: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
            (names, Samples::F32 { values: interleave(&planes), half })
        }
        Encoding::Linear => {
            let samples = Samples::F32 { values: interleave(&rgb(path, image)?), half: vec![false; 3] };
            (vec!["R", "G", "B"], samples)
        }
        Encoding::Screen => (vec!["R", "G", "B"], Samples::U8(for_screen(rgb(path, image)?, image.width(), options))),
    };
    oiio::write(file.path(), size, &names, &samples, metadata, layout).map_err(|reason| failure(path, reason))?;
    Ok(file)
}

/// Programs that know one image per file take the first channels.
fn rank(name: &str) -> usize {
    ["R", "G", "B"].iter().position(|band| *band == name).unwrap_or(3)
}

/// The largest finite number in half precision.
const LARGEST_HALF: f32 = 65504.0;

fn fits_half(name: &str, values: &[f32]) -> bool {
    let colour = matches!(name.rsplit('.').next(), Some("R" | "G" | "B"));
    colour && values.iter().all(|value| value.abs() <= LARGEST_HALF || !value.is_finite())
}

fn rgb<'a>(path: &Path, image: &'a Image) -> Result<[&'a [f32]; 3]> {
    image.rgb_or_grey().ok_or_else(|| failure(path, "the image has no channels R, G and B"))
}

fn interleave(planes: &[&[f32]]) -> Vec<f32> {
    let pixels = planes.first().map_or(0, |plane| plane.len());
    let mut values = Vec::with_capacity(pixels * planes.len());
    for pixel in 0..pixels {
        values.extend(planes.iter().map(|plane| plane[pixel]));
    }
    values
}

fn for_screen([r, g, b]: [&[f32]; 3], width: u32, options: &WriteOptions) -> Vec<u8> {
    let scale = options.exposure_stops.exp2();
    let mut bytes = Vec::with_capacity(r.len() * 3);
    for pixel in 0..r.len() {
        let encoded = options.view.encode([r[pixel], g[pixel], b[pixel]].map(|value| value * scale));
        for (band, value) in encoded.into_iter().enumerate() {
            // Rounding to the nearest, or up with the probability of the remainder.
            let offset = if options.dither {
                let (x, y) = (pixel as u32 % width, pixel as u32 / width);
                unit(hash_all(&[x, y, band as u32]))
            } else {
                0.5
            };
            // `as` saturates at 255, which only 1 plus an offset exceeds.
            bytes.push((value * 255.0 + offset) as u8);
        }
    }
    bytes
}
