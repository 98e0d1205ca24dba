//! Text on standard output.

use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

use crate::error::{Error, Result};

/// Lines that are printed together.
#[derive(Debug, Default)]
pub struct Page(String);

impl Page {
    /// Adds a line.
    pub fn line(&mut self, text: impl Display) {
        self.0 += &format!("{text}\n");
    }

    /// Prints all lines.
    ///
    /// # Errors
    /// As [`print()`].
    pub fn print(&self) -> Result<()> {
        print(self.0.as_bytes())
    }
}

/// Writes to standard output.
///
/// # Errors
/// When it cannot be written to; a reader that has seen enough (`| head`) is no error.
pub fn print(text: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(failed),
    }
}

/// Standard output cannot be written to.
pub fn failed(error: io::Error) -> Error {
    Error::Output { path: Path::new("standard output").to_owned(), reason: error.to_string() }
}
