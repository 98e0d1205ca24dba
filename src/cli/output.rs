//! Options for the files that images are written to.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::error::Result;
use crate::image::{self, Compression, Image, Metadata, ViewTransform, WriteOptions};

/// Tone curves by their names on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// AgX: bright light bleaches instead of clipping.
    Filmic,
    /// Plain sRGB, clipped.
    Srgb,
    /// Tumblin and Rushmeier's tone reproduction: dark scenes look dark, bright ones bright.
    Perceptual,
}

/// Where images go, and how.
#[derive(Args, Debug)]
pub struct OutputOptions {
    /// Image to write, in any format OpenImageIO writes, by extension; may be repeated
    #[arg(short, long, value_name = "IMAGE", required = true)]
    pub output: Vec<PathBuf>,
    /// Stops by which formats for screens are brightened [default: automatic; 0 for the perceptual view]
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, help_heading = "Output")]
    exposure: Option<f32>,
    /// Tone curve of formats for screens
    #[arg(long, value_enum, default_value_t = View::Filmic, help_heading = "Output")]
    view: View,
    /// EXR: colours in half precision
    #[arg(long, help_heading = "Output")]
    half: bool,
    /// EXR and TIFF: tiles of 64 x 64 pixels instead of rows
    #[arg(long, help_heading = "Output")]
    tiled: bool,
    /// Compression of EXR and TIFF [default: zip]
    #[arg(long, value_enum, help_heading = "Output")]
    compression: Option<Compression>,
}

impl OutputOptions {
    /// Writes an image to each of `paths`.
    ///
    /// # Errors
    /// When one of them cannot be written; those before it are.
    pub fn write(&self, paths: &[PathBuf], image: &Image, metadata: &Metadata) -> Result<()> {
        let view = match self.view {
            View::Filmic => ViewTransform::Filmic,
            View::Srgb => ViewTransform::Srgb,
            View::Perceptual => ViewTransform::perceptual(image),
        };
        let automatic = || match view {
            ViewTransform::Perceptual { .. } => 0.0,
            _ => image::auto_exposure(image),
        };
        let options = WriteOptions {
            exposure_stops: self.exposure.unwrap_or_else(automatic),
            view,
            dither: true,
            half: self.half,
            compression: self.compression,
            tiled: self.tiled,
        };
        paths.iter().try_for_each(|path| image::write(path, image, metadata, &options))
    }
}
