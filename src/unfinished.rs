//! Files that get their names when they are complete.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// What is being written at the moment.
static WRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// The entry of a file that is being written; [`remove_all`] finds it until this is dropped.
#[derive(Debug)]
pub struct Listed(PathBuf);

impl Listed {
    /// Lists a file.
    pub fn new(path: &Path) -> Self {
        WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        Listed(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).retain(|path| *path != self.0);
    }
}

/// Removes what is being written at the moment: for a process that ends at once.
pub fn remove_all() {
    for path in WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).iter() {
        // It may just have got its name.
        let _ = std::fs::remove_file(path);
    }
}

/// A file without its name yet, in the folder where it will have one. Goes when it is dropped.
#[derive(Debug)]
pub struct Unfinished {
    file: NamedTempFile,
    _listed: Listed,
}

impl Unfinished {
    /// An empty file that is to become `target`, with the same extension.
    ///
    /// # Errors
    /// When no file can be there: no such folder, one that is not writable, something in the way.
    pub fn new(target: &Path) -> io::Result<Self> {
        match std::fs::metadata(target) {
            // A rename would replace a device or a pipe by a file.
            Ok(there) if !there.is_file() => {
                return Err(io::Error::other("something that is not a regular file is there"));
            }
            Ok(there) if there.permissions().readonly() => {
                return Err(io::Error::other("it exists and is write-protected"));
            }
            _ => (),
        }
        let folder = folder(target);
        if !folder.is_dir() {
            return Err(io::Error::other(format!("there is no folder {}", folder.display())));
        }
        let suffix = target.extension().map(|extension| format!(".{}", extension.to_string_lossy()));
        let suffix = suffix.unwrap_or_default();
        let mut builder = tempfile::Builder::new();
        builder.prefix(".gsii-").suffix(&suffix);
        // Temporary files are private by default; this one is to be as open as the user's umask says.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let refused = |error: io::Error| io::Error::other(format!("{} is not writable: {error}", folder.display()));
        let file = builder.tempfile_in(folder).map_err(refused)?;
        Ok(Unfinished { _listed: Listed::new(file.path()), file })
    }

    /// Its name for now.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Gives it its name; an older file of that name is replaced.
    ///
    /// # Errors
    /// When the system refuses; then nothing has changed.
    pub fn finish(self, target: &Path) -> io::Result<()> {
        self.file.persist(target).map(drop).map_err(|error| error.error)
    }
}

/// Where a file is.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Finds out before the work whether [`write()`] can begin.
///
/// # Errors
/// As [`Unfinished::new`].
pub fn check(target: &Path) -> Result<()> {
    Unfinished::new(target).map(drop).map_err(|error| failure(target, &error))
}

/// Whether two names are those of one file.
pub fn same(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| Some((folder(path).canonicalize().ok()?, path.file_name()?.to_owned()));
    place(a).is_some_and(|a| Some(a) == place(b))
}

fn failure(target: &Path, error: &io::Error) -> Error {
    Error::Output { path: target.to_owned(), reason: error.to_string() }
}

/// Writes a file that appears under its name when it is complete.
///
/// # Errors
/// When the system refuses; then nothing has changed.
pub fn write(target: &Path, fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> Result<()> {
    let written = Unfinished::new(target).and_then(|unfinished| {
        let mut out = BufWriter::new(unfinished.file.as_file());
        fill(&mut out)?;
        out.flush()?;
        drop(out);
        unfinished.finish(target)
    });
    written.map_err(|error| failure(target, &error))
}
