//! The command line: a thin face over the library.

pub mod compare;
pub mod frames;
pub mod info;
pub mod long;
pub mod manual;
pub mod merge;
pub mod options;
pub mod output;
pub mod outside;
pub mod page;
pub mod places;
pub mod render;
pub mod simplify;
pub mod study;
pub mod validate;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Arg, Command as Definition, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::error::Error;

/// Physically accurate images of cluttered scenes on a CPU, fast, with a stated error.
#[derive(Debug, Parser)]
#[command(
    name = "gsii",
    version,
    about,
    after_help = "Exit codes: 0 done, 1 failed while running, 2 bad usage or bad input."
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render an image of a glTF scene
    Render(Box<render::Options>),
    /// Join the parts of an image that were rendered with --tile or --crop
    Merge(merge::Options),
    /// Show what is in a scene and what would be done with it
    Info(info::Options),
    /// Write the simplified scene and say how well it stands for the detailed one
    Simplify(simplify::Options),
    /// Speed against error of all methods: tables, plots and one page that shows them
    Study(study::Options),
    /// Compare Embree with obvhs, ray by ray, on a scene's own rays
    Validate(validate::Options),
    /// Error metrics of an image against a reference
    Compare(compare::Options),
    /// Print a manual page (troff: read it with 'gsii man render | man -l -')
    Man(manual::ManOptions),
    /// Print a script that completes commands and options in a shell
    Completions(manual::CompletionOptions),
}

/// All commands and options. A negative number after an option is its value, so that a wrong one is called wrong by the option's
/// own rule and not taken for an unknown option.
fn definition() -> Definition {
    let with_negatives =
        |arg: Arg| if arg.get_action().takes_values() { arg.allow_negative_numbers(true) } else { arg };
    Arguments::command().mut_subcommands(|command| command.mut_args(with_negatives))
}

/// Runs the process's command line and returns its exit code.
pub fn run() -> ExitCode {
    run_with(std::env::args_os())
}

/// Runs a command line, the program's name first, and returns its exit code.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let matches = definition().try_get_matches_from(arguments);
    let arguments = match matches.and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors; clap prints them to standard output.
            let code = if error.use_stderr() { 2 } else { 0 };
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    let outcome = match &arguments.command {
        Command::Render(options) => render::run(options),
        Command::Merge(options) => merge::run(options),
        Command::Info(options) => info::run(options),
        Command::Simplify(options) => simplify::run(options),
        Command::Study(options) => study::run(options),
        Command::Validate(options) => validate::run(options),
        Command::Compare(options) => compare::run(options),
        Command::Man(options) => manual::man(options, definition()),
        Command::Completions(options) => manual::completions(options, definition()),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            report(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn report(error: &Error) {
    eprintln!("gsii: {error}");
}
