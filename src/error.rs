//! The one error type of the library.

use std::path::PathBuf;

/// Everything that can go wrong, worded for the person at the terminal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene or image file cannot be used: bad contents, missing parts, unsupported features.
    #[error("{}: {reason}", path.display())]
    Input {
        /// The file that was read.
        path: PathBuf,
        /// What is wrong, where in the file (node, material, accessor), and what to do about it.
        reason: String,
    },
    /// An option has a value that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// An image or report could not be written.
    #[error("cannot write {}: {reason}", path.display())]
    Output {
        /// The file that was to be written.
        path: PathBuf,
        /// The reason given by the system or by OpenImageIO.
        reason: String,
    },
    /// The ray-tracing library failed.
    #[error("ray tracing with {backend} failed: {reason}")]
    Backend {
        /// `embree` or `obvhs`.
        backend: &'static str,
        /// The library's own words.
        reason: String,
    },
    /// The scene has no steady state or breaks another assumption of the solution.
    #[error("no solution exists: {0}")]
    Unsolvable(String),
}

impl Error {
    /// Process exit code: 2 for bad usage or bad input, 1 for a failure while running.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input { .. } | Error::Usage(_) | Error::Unsolvable(_) => 2,
            Error::Output { .. } | Error::Backend { .. } => 1,
        }
    }
}

/// Result with the library's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
