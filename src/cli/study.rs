//! `gsii study`: speed against error of all methods.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::options::{Talk, set_threads};
use super::render::stop_on_ctrl_c;
use crate::error::{Error, Result};
use crate::pipeline::{BackendKind, Settings};
use crate::study;

/// Options of `gsii study`.
#[derive(Args, Debug)]
pub struct Options {
    /// glTF 2.0 files (.glb or .gltf) to compare all methods on
    #[arg(required_unless_present_any = ["curves", "scaling"], value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Folder for the report; what is finished is kept in its folder 'work', and a study that was stopped goes on
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Camera, by name or number (default: the first)
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,
    /// Scenes on which only MCPT, PMM and GSII are compared, as they are by default; may be repeated
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    curves: Vec<PathBuf>,
    /// Scenes of growing detail, for time against the number of triangles; may be repeated
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    scaling: Vec<PathBuf>,
    /// Width of all images in pixels
    #[arg(long, value_name = "N", default_value_t = 240)]
    width: u32,
    /// Trials of each pixel of the path-traced references
    #[arg(long, value_name = "N", default_value_t = 1024)]
    reference_trials: u32,
    /// Most trials of each pixel of MCPT, PMM and GSII as they are by default
    #[arg(long, value_name = "N", default_value_t = 512)]
    max_trials: u32,
    /// Most trials of each pixel of all other settings
    #[arg(long, value_name = "N", default_value_t = 64)]
    other_trials: u32,
    /// Forget finished runs (references stay): after a change of the program
    #[arg(long)]
    fresh: bool,
    /// Threads [default: all]
    #[arg(long, value_name = "N", help_heading = "Run")]
    threads: Option<usize>,
    /// Ray-tracing library
    #[arg(long, value_enum, default_value_t, help_heading = "Run")]
    backend: BackendKind,
    #[command(flatten)]
    talk: Talk,
}

/// Runs the command.
///
/// # Errors
/// Bad options, bad input, a failing library, a report that cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    if !(8..=1 << 14).contains(&options.width) {
        return Err(Error::Usage("--width must be between 8 and 16384".to_owned()));
    }
    if options.reference_trials == 0 || options.max_trials < 2 || options.other_trials < 2 {
        return Err(Error::Usage(
            "--max-trials and --other-trials must be at least 2, --reference-trials 1".to_owned(),
        ));
    }
    set_threads(options.threads)?;
    let progress = options.talk.progress();
    stop_on_ctrl_c(&progress);
    let base = Settings { backend: options.backend, threads: options.threads.unwrap_or(0), ..Settings::default() };
    let finished = study::run(
        &study::Options {
            scenes: options.scenes.clone(),
            camera: options.camera.clone(),
            curves: options.curves.clone(),
            scaling: options.scaling.clone(),
            output: options.output.clone(),
            width: options.width,
            reference_trials: options.reference_trials,
            main_trials: options.max_trials,
            other_trials: options.other_trials,
            base,
            fresh: options.fresh,
        },
        &progress,
        &|line| options.talk.say(line),
    )?;
    if !finished {
        options.talk.say("gsii: stopped; the same command goes on where this was");
        return Ok(ExitCode::FAILURE);
    }
    options.talk.say(format!("{}", options.output.join("index.html").display()));
    Ok(ExitCode::SUCCESS)
}
