//! `gsii compare`: error metrics of two images.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::json;

use super::page::Page;
use crate::error::Result;
use crate::image::{self, Metrics};

/// Options of `gsii compare`.
#[derive(Args, Debug)]
pub struct Options {
    /// Reference image
    reference: PathBuf,
    /// Image to judge
    image: PathBuf,
    /// Second, independent half of the reference: takes the reference's own noise out of the errors
    #[arg(long, value_name = "FILE")]
    other_half: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// When an image cannot be read or the sizes differ.
pub fn run(options: &Options) -> Result<ExitCode> {
    let (reference, image) = (image::read(&options.reference)?, image::read(&options.image)?);
    let metrics = image::compare(&reference, &image)?;
    let other = options.other_half.as_deref().map(image::read).transpose()?;
    let cross = other.map(|other| image::compare_halves([&reference, &other], &image)).transpose()?;
    let mut page = Page::default();
    if options.json {
        page.line(format_args!("{:#}", json!({ "metrics": metrics, "without_reference_noise": cross })));
        return page.print().map(|()| ExitCode::SUCCESS);
    }
    describe(&metrics, &mut page);
    if let Some(cross) = cross {
        page.line(format_args!("without the reference's own noise:"));
        page.line(format_args!("  relMSE               {:.4e}", cross.rel_mse));
        page.line(format_args!("  MSE                  {:.4e} +- {:.1e}", cross.mse, cross.mse_standard_error));
    }
    page.print().map(|()| ExitCode::SUCCESS)
}

fn describe(m: &Metrics, page: &mut Page) {
    let [r, g, b] = m.relative_bias.map(|b| 100.0 * b);
    page.line(format_args!("relMSE                 {:.4e}", m.rel_mse));
    page.line(format_args!("RMSE                   {:.4e}", m.rmse));
    page.line(format_args!("mean relative error    {:.3} %", 100.0 * m.mean_relative_error));
    page.line(format_args!("mean ratio less 1      {r:+.3} % {g:+.3} % {b:+.3} % (R G B)"));
    if let Some(psnr) = m.psnr_db {
        page.line(format_args!("PSNR                   {psnr:.2} dB"));
    }
    page.line(format_args!("largest difference     {:.4} at {:?}", m.max_difference, m.max_difference_at));
    for (count, which) in [(m.non_finite_image, "image"), (m.non_finite_reference, "reference")] {
        if count > 0 {
            page.line(format_args!("not finite             {count} pixels of the {which}, left out"));
        }
    }
}
