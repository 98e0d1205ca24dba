//! `gsii validate`: Embree against obvhs.
use crate::error::Result;
use clap::Args;
use std::process::ExitCode;
/// Options of `gsii validate`.
#[derive(Args, Debug)]
pub struct Options {}
/// Runs.
pub fn run(_: &Options) -> Result<ExitCode> {
    todo!()
}
