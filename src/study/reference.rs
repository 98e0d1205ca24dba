//! The converged path-traced image that everything is compared with, kept on disk.

use std::path::{Path, PathBuf};

use super::error::{Halves, Picture, Plane};
use super::subject::{Subject, key};
use crate::error::Result;
use crate::image::{self, Image, Metadata, Value, WriteOptions};
use crate::pipeline::{BackendKind, Method, Prepared, Settings, Stats};
use crate::progress::Progress;
use crate::render::RenderParams;
use crate::sampling::hash_all;

/// Changes when what path tracing computes changes: older references are then not used any more.
const VERSION: u32 = 1;

/// Trials of each pixel between two looks at the clock.
const PASS: u32 = 64;

/// Keeps the reference's random numbers apart from those of images that are compared with it.
const STREAM: u32 = 0x7265_6665;

/// Seconds between two times that the unfinished reference is written.
const SAVE_EVERY: f64 = 30.0;

/// A reference in the making, or done.
pub struct Reference {
    /// The image.
    pub picture: Picture,
    /// Trials of each pixel.
    pub trials: u32,
}

/// Where the reference of a subject is kept.
pub fn path(folder: &Path, subject: &Subject) -> PathBuf {
    folder.join(format!("{}-{}.exr", subject.name, key(&format!("{VERSION} {}", subject.view()))))
}

/// Number of passes that are missing to `trials`.
pub fn missing(folder: &Path, subject: &Subject, trials: u32) -> u32 {
    let there = read(&path(folder, subject), subject).map_or(0, |r| r.trials);
    trials.saturating_sub(there).div_ceil(PASS)
}

/// Trials of a pass.
pub fn pass_trials() -> u32 {
    PASS
}

/// Reads what is on disk and renders what is missing to `trials` of each pixel; `advance` is called after each pass. Stops early
/// with what is there when `progress` says so.
///
/// # Errors
/// As preparing a scene and writing an image.
pub fn make(
    folder: &Path,
    subject: &Subject,
    trials: u32,
    backend: BackendKind,
    progress: &Progress,
    advance: &mut dyn FnMut(),
) -> Result<Reference> {
    let path = path(folder, subject);
    let empty = || Reference { picture: Picture::default(), trials: 0 };
    let mut reference = read(&path, subject).unwrap_or_else(empty);
    if reference.trials >= trials {
        return Ok(reference);
    }
    let settings = Settings { method: Method::Mcpt, backend, ..Settings::default() };
    let prepared = Prepared::new(subject.scene.clone(), &subject.camera, settings, progress, &mut Stats::new())?;
    let mut saved = std::time::Instant::now();
    while reference.trials < trials && !progress.stopped() {
        let params = RenderParams {
            width: subject.size[0],
            height: subject.size[1],
            region: None,
            min_trials: PASS,
            max_trials: PASS,
            error: f32::INFINITY,
            hires_error: f32::INFINITY,
            lores_error: f32::INFINITY,
            time_limit: None,
            features: false,
            interpolate: false,
            seed: hash_all(&[STREAM, reference.trials / PASS]),
            frame: None,
        };
        let rendering = prepared.render(&subject.camera, &params, progress);
        if rendering.stopped {
            break;
        }
        if let Some(picture) = Picture::of(&rendering.film) {
            reference.add(&picture);
        }
        advance();
        if saved.elapsed().as_secs_f64() > SAVE_EVERY {
            write(&path, subject, &reference)?;
            saved = std::time::Instant::now();
        }
    }
    write(&path, subject, &reference)?;
    Ok(reference)
}

impl Reference {
    fn add(&mut self, picture: &Picture) {
        let share = f64::from(PASS) / f64::from(self.trials + PASS);
        if self.trials == 0 {
            self.picture = picture.clone();
        } else {
            for (mine, new) in
                [(&mut self.picture.whole, &picture.whole), (&mut self.picture.indirect, &picture.indirect)]
            {
                for (mine, new) in mine.0.iter_mut().flatten().zip(new.0.iter().flatten()) {
                    (0..3).for_each(|c| mine[c] += share * (new[c] - mine[c]));
                }
            }
        }
        self.trials += PASS;
    }
}

/// Layers of the file: both halves of all light and of indirect light.
const LAYERS: [&str; 4] = ["a", "b", "a.lores", "b.lores"];

fn write(path: &Path, subject: &Subject, reference: &Reference) -> Result<()> {
    let [width, height] = subject.size;
    let mut image = Image::new(width, height);
    let vectors = |plane: &Plane| plane.iter().map(|v| glam::DVec3::from(*v).as_vec3()).collect::<Vec<_>>();
    image.push_rgb("", &vectors(&reference.picture.whole.mean()));
    let halves = reference.picture.whole.0.iter().chain(&reference.picture.indirect.0);
    for (layer, plane) in LAYERS.iter().zip(halves) {
        image.push_rgb(layer, &vectors(plane));
    }
    let mut metadata = Metadata::new();
    metadata.set("gsii:scene", subject.name.as_str());
    metadata.set("gsii:view", subject.view());
    metadata.set("gsii:trials", i64::from(reference.trials));
    image::write(path, &image, &metadata, &WriteOptions::default())
}

/// What is on disk; `None` when there is nothing that can be used.
fn read(path: &Path, subject: &Subject) -> Option<Reference> {
    let (image, metadata) = image::read_with_metadata(path).ok()?;
    let trials = match metadata.get("gsii:trials")? {
        Value::Integer(n) => u32::try_from(*n).ok()?,
        _ => return None,
    };
    if [image.width(), image.height()] != subject.size {
        return None;
    }
    let plane = |layer: &str| -> Option<Plane> {
        let bands = image.rgb(layer)?;
        Some((0..image.pixels()).map(|p| bands.map(|b| f64::from(b[p]))).collect())
    };
    let [a, b, a_lores, b_lores] = LAYERS.map(plane);
    let picture = Picture { whole: Halves([a?, b?]), indirect: Halves([a_lores?, b_lores?]) };
    Some(Reference { picture, trials })
}
