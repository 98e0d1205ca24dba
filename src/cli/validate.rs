//! `gsii validate`: Embree against obvhs.
use std::process::ExitCode;
use clap::Args;
use crate::error::Result;
/// Options of `gsii validate`.
#[derive(Args, Debug)]
pub struct Options {}
/// Runs.
pub fn run(_: &Options) -> Result<ExitCode> { todo!() }
