//! Files that a command writes.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::{image, unfinished};

/// Finds out before the work whether all of them can be written, and that no two options name one file.
///
/// # Errors
/// [`Error::Output`] where one cannot be written, [`Error::Usage`] where one is named twice or is no image that can be written.
pub fn check<'a>(images: &'a [PathBuf], others: impl IntoIterator<Item = Option<&'a Path>>) -> Result<()> {
    let others: Vec<&Path> = others.into_iter().flatten().collect();
    images.iter().try_for_each(|path| image::check_writable(path))?;
    others.iter().try_for_each(|path| unfinished::check(path))?;
    let all: Vec<&Path> = images.iter().map(PathBuf::as_path).chain(others).collect();
    for (i, path) in all.iter().enumerate() {
        if all[..i].iter().any(|before| unfinished::same(before, path)) {
            return Err(Error::Usage(format!("{}: asked for twice; each file can hold one thing", path.display())));
        }
    }
    Ok(())
}

/// Files by name, for messages.
pub fn names(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
