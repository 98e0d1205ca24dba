//! `gsii merge`: joins the parts of an image.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::options::Talk;
use super::output::OutputOptions;
use super::places;
use crate::error::Result;
use crate::image;

/// Options of `gsii merge`.
#[derive(Args, Debug)]
pub struct Options {
    /// EXR images that were rendered with --tile or --crop and hold the whole image between them
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    #[command(flatten)]
    output: OutputOptions,
    #[command(flatten)]
    talk: Talk,
}

/// Runs the command.
///
/// # Errors
/// Parts that are missing, overlap or do not belong together; images that cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    places::check(&options.output.output, [])?;
    let (whole, metadata) = image::merge(&options.parts)?;
    options.output.write(&options.output.output, &whole, &metadata)?;
    options.talk.say(format!("{}: {} parts", places::names(&options.output.output), options.parts.len()));
    Ok(ExitCode::SUCCESS)
}
