//! `gsii man` and `gsii completions`: made from the same definitions as `--help`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command};
use clap_complete::Shell;

use super::page;
use crate::error::{Error, Result};

/// Options of `gsii man`.
#[derive(Args, Debug)]
pub struct ManOptions {
    /// Command whose page to print; without it that of gsii itself
    command: Option<String>,
    /// Write all pages into this folder, made where there is none, instead (gsii.1, gsii-render.1, ...)
    #[arg(long, value_name = "FOLDER", conflicts_with = "command")]
    all: Option<PathBuf>,
}

/// Options of `gsii completions`.
#[derive(Args, Debug)]
pub struct CompletionOptions {
    /// Shell to complete options for
    shell: Shell,
}

/// Prints or writes manual pages of `command`, the whole program.
///
/// # Errors
/// An unknown command, a folder that cannot be written to.
pub fn man(options: &ManOptions, mut command: Command) -> Result<ExitCode> {
    command.build();
    if let Some(folder) = &options.all {
        let failed = |error: std::io::Error| Error::Output { path: folder.clone(), reason: error.to_string() };
        std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder)).map_err(failed)?;
        return Ok(ExitCode::SUCCESS);
    }
    let chosen = match &options.command {
        None => command,
        Some(name) => match command.find_subcommand(name) {
            Some(found) => found.clone(),
            None => {
                let names: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
                return Err(Error::Usage(format!("there is no command '{name}', only {}", names.join(", "))));
            }
        },
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(chosen).render(&mut text).map_err(page::failed)?;
    page::print(&text).map(|()| ExitCode::SUCCESS)
}

/// Prints a completion script of `command`, the whole program.
///
/// # Errors
/// When standard output cannot be written to.
pub fn completions(options: &CompletionOptions, mut command: Command) -> Result<ExitCode> {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, name, &mut script);
    page::print(&script).map(|()| ExitCode::SUCCESS)
}
