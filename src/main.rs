//! `gsii`: see `gsii --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    gsii::cli::run()
}
