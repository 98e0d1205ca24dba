//! What a run gave, kept on disk: a study that was stopped goes on where it was.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::error::Errors;
use super::plan::Role;
use crate::clock::Spent;
use crate::error::{Error, Result};
use crate::unfinished;

/// The result of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Names what this is a result of.
    pub key: String,
    /// The scene's name.
    pub scene: String,
    /// What the run is for.
    pub role: Role,
    /// How the report calls it.
    pub label: String,
    /// Settings, automatic choices filled in.
    pub parameters: Map<String, Value>,
    /// Threads that worked.
    pub threads: usize,
    /// Version of gsii.
    pub version: String,
    /// Triangles of the detailed scene.
    pub triangles: u64,
    /// What came before the first pixel of the first image.
    pub preparation: Preparation,
    /// Image after image, each with more trials.
    pub points: Vec<Point>,
}

/// What came before the first pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Preparation {
    /// All of it.
    pub all: Spent,
    /// Classifying, clustering, fitting boxes.
    pub simplify: Spent,
    /// Acceleration structures.
    pub build: Spent,
    /// The radiosity solution.
    pub radiosity: Spent,
    /// Surfaces that radiosity was solved on.
    pub surfaces: u64,
    /// Patches.
    pub patches: u64,
    /// Clusters.
    pub clusters: u64,
    /// Share of the emitted flux that stayed unshot.
    pub unshot: f64,
    /// Relative statistical error of the solution.
    pub error: f64,
    /// Rays of the solution.
    pub rays: u64,
}

/// One image of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Trials of each pixel (the mean, where it varies).
    pub trials: f64,
    /// Time for all that came before the first pixel.
    pub preparation: Spent,
    /// Time for the passes, preparation not included.
    pub rendering: Spent,
    /// Share of HIRES in that.
    pub hires_share: f64,
    /// Rays traced.
    pub rays: u64,
    /// Relative standard error of the image, as measured from its own halves.
    pub noise: f64,
    /// Mean of the paper's `L_dev / L` over pixels and bands: HIRES, LORES.
    pub dev: [f64; 2],
    /// Error of the image; none where there is no reference.
    pub whole: Option<Errors>,
    /// Error of the direct light alone.
    pub direct: Option<Errors>,
    /// Error of the indirect light alone.
    pub indirect: Option<Errors>,
}

impl Point {
    /// Time until the image was there, preparation included.
    pub fn total(&self) -> Spent {
        let mut all = self.preparation;
        all += self.rendering;
        all
    }
}

impl Record {
    /// The image with the most trials.
    pub fn last(&self) -> Option<&Point> {
        self.points.last()
    }

    /// A number among the settings.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name)?.as_f64()
    }
}

/// Folder of finished runs and their images.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// Opens a folder, which is made where it is missing.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(folder: &Path) -> Result<Store> {
        make_folder(folder)?;
        Ok(Store { folder: folder.to_owned() })
    }

    fn file(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.json"))
    }

    /// Where the image of a run with so many trials is.
    pub fn image(&self, key: &str, trials: f64) -> PathBuf {
        self.folder.join(format!("{key}-{trials:.1}.exr"))
    }

    /// A finished run, where it is there and can be read.
    pub fn get(&self, key: &str) -> Option<Record> {
        let text = std::fs::read(self.file(key)).ok()?;
        serde_json::from_slice(&text)
            .inspect_err(|e| log::warn!("{}: {e}; it runs again", self.file(key).display()))
            .ok()
    }

    /// Keeps a finished run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn put(&self, record: &Record) -> Result<()> {
        let path = self.file(&record.key);
        let json = serde_json::to_string_pretty(record).map_err(|e| cannot_write(&path, &e))?;
        write_file(&path, json.as_bytes())
    }
}

/// Makes a folder and those above it.
///
/// # Errors
/// When the system refuses.
pub fn make_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| cannot_write(folder, &e))
}

/// Writes a file that appears under its name when it is complete.
///
/// # Errors
/// When the system refuses.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    unfinished::write(path, |file| file.write_all(bytes))
}

fn cannot_write(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::Output { path: path.to_owned(), reason: reason.to_string() }
}
