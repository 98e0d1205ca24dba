//! `gsii compare`: error metrics of two images.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use crate::error::Result;
use crate::image;

/// Options of `gsii compare`.
#[derive(Args, Debug)]
pub struct Options {
    /// Reference image
    reference: PathBuf,
    /// Image to judge
    image: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// When an image cannot be read or the sizes differ.
pub fn run(options: &Options) -> Result<ExitCode> {
    let metrics = image::metrics::compare(&image::read(&options.reference)?, &image::read(&options.image)?)?;
    if options.json {
        println!("{:#}", serde_json::json!(metrics));
    } else {
        println!("{metrics}");
    }
    Ok(ExitCode::SUCCESS)
}
