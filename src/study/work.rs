//! One run: preparation, and images with more and more trials, each compared with the reference.

use std::path::Path;

use super::error::{Errors, Halves, Picture, compare};
use super::plan::{ENOUGH, ERRORS, Role, Run, Sampling};
use super::record::{Point, Preparation, Record, Store};
use super::reference::Reference;
use super::subject::Subject;
use crate::clock::{Spent, Stopwatch};
use crate::error::Result;
use crate::image::{self, Metadata, WriteOptions};
use crate::pipeline::{Prepared, Settings, Stats};
use crate::progress::Progress;
use crate::render::film::PixelSum;
use crate::render::{Film, LEAST_TRIALS, RayCounts, RenderParams, WORST_PIXEL};

/// Share of the most trials from which on no more can be asked for.
const MOSTLY: f64 = 0.9;

/// Keeps the images apart from the default seed's, which everybody looks at.
const SEED: u32 = 1993;

/// A scene, prepared for a run: kept for the next one, which may differ in its trials only.
pub struct Kit {
    /// Names what it is prepared for.
    key: String,
    prepared: Prepared,
    stats: Stats,
    all: Spent,
}

impl Kit {
    /// The kit for `settings`: what is there, if that was made for them.
    fn fit<'k>(
        kit: &'k mut Option<Kit>,
        settings: &Settings,
        run: &Run,
        subject: &Subject,
        progress: &Progress,
    ) -> Result<&'k mut Kit> {
        let key = format!("{} {}", subject.view(), serde_json::Value::Object(settings.parameters()));
        // What was there is given up before its successor needs the memory.
        Ok(match kit.take().filter(|kit| kit.key == key) {
            Some(fitting) => kit.insert(fitting),
            None => kit.insert(Kit::new(key, settings, run, subject, progress)?),
        })
    }

    fn new(key: String, settings: &Settings, run: &Run, subject: &Subject, progress: &Progress) -> Result<Kit> {
        let mut stats = Stats::new();
        let watch = Stopwatch::start();
        let prepared = Prepared::new(subject.scene.clone(), &subject.camera, settings.clone(), progress, &mut stats)?;
        let all = watch.spent();
        for warning in &stats.warnings {
            log::info!("{}, {}: {warning}", subject.name, run.label);
        }
        Ok(Kit { key, prepared, stats, all })
    }
}

/// Carries a run out. `None` when it was stopped before it was finished. `kit` is what the run before was prepared with, and what
/// this one is.
///
/// # Errors
/// As preparing a scene; images that cannot be written.
pub fn perform(
    run: &Run,
    subject: &Subject,
    reference: Option<&Reference>,
    store: &Store,
    kit: &mut Option<Kit>,
    progress: &Progress,
) -> Result<Option<Record>> {
    let first = match run.sampling {
        Sampling::Planned { .. } => settings_for(run, ERRORS[0]),
        _ => run.settings.clone(),
    };
    let Kit { prepared, stats, all, .. } = Kit::fit(kit, &first, run, subject, progress)?;
    let all = *all;
    let key = run.key(subject, reference.map_or(0, |r| r.trials));
    let mut parameters = stats.parameters.clone();
    parameters.insert("pixels".to_owned(), (subject.size[0] * subject.size[1]).into());
    let mut record = Record {
        key,
        scene: subject.name.clone(),
        role: run.role,
        label: run.label.clone(),
        parameters,
        threads: rayon::current_num_threads(),
        version: stats.version.to_owned(),
        triangles: stats.counts.triangles,
        preparation: preparation(prepared, stats, all),
        points: Vec::new(),
    };
    let keep = Keep { store, subject, reference: reference.map(|r| &r.picture) };
    match run.sampling {
        Sampling::Planned { most } => {
            for asked in ERRORS {
                let Kit { prepared, all, .. } = Kit::fit(kit, &settings_for(run, asked), run, subject, progress)?;
                let watch = Stopwatch::start();
                let image = prepared.render(&subject.camera, &planned(run, subject, most, asked), progress);
                if image.stopped {
                    break;
                }
                let share = image.times.hires_share();
                let point = keep.point(&record.key, &image.film, [*all, watch.spent()], share, image.rays)?;
                let enough = is_enough(run, &point) || point.trials > MOSTLY * f64::from(most);
                record.points.push(point);
                if enough {
                    break;
                }
            }
        }
        Sampling::Rounds { most } => {
            let mut failed = None;
            let mut watch = Stopwatch::start();
            let mut rendering = Spent::default();
            prepared.render_rounds(&subject.camera, &params(run, subject, 2, most, 0.0), progress, &mut |round| {
                rendering += watch.spent();
                let share = round.times.hires_share();
                let result = keep.point(&record.key, round.film, [all, rendering], share, round.rays);
                match result {
                    Ok(point) => record.points.push(point),
                    Err(error) => failed = Some(error),
                }
                watch = Stopwatch::start();
                failed.is_none() && !progress.stopped()
            });
            if let Some(error) = failed {
                return Err(error);
            }
        }
        Sampling::Paper => {
            let watch = Stopwatch::start();
            let rendering = prepared.render(&subject.camera, &params(run, subject, 10, 30, 0.05), progress);
            let share = rendering.times.hires_share();
            record.points.push(keep.point(
                &record.key,
                &rendering.film,
                [all, watch.spent()],
                share,
                rendering.rays,
            )?);
        }
    }
    Ok((!progress.stopped()).then_some(record))
}

/// Whether curves through a point have nothing more to show.
fn is_enough(run: &Run, point: &Point) -> bool {
    let [all, part] = ENOUGH;
    let below = |errors: Option<Errors>, level: f64| errors.is_none_or(|e| e.rel_mse < level);
    let parts = below(point.direct, part) && below(point.indirect, part);
    // Prices of direct and indirect light, and the paper's difference of indirect light, are asked of GSII only.
    below(point.whole, all) && (parts || !matches!(run.role, Role::Gsii | Role::AtPaperRThresh))
}

/// As `gsii render --error` prepares a scene.
fn settings_for(run: &Run, error: f32) -> Settings {
    Settings { radiosity_error: Settings::radiosity_error_for(error), ..run.settings.clone() }
}

/// As `gsii render --error` does.
fn planned(run: &Run, subject: &Subject, most: u32, error: f32) -> RenderParams {
    RenderParams { error, ..params(run, subject, LEAST_TRIALS, most, WORST_PIXEL * error) }
}

fn params(run: &Run, subject: &Subject, min_trials: u32, max_trials: u32, error: f32) -> RenderParams {
    RenderParams {
        width: subject.size[0],
        height: subject.size[1],
        region: None,
        min_trials,
        max_trials,
        error: f32::INFINITY,
        hires_error: error,
        lores_error: error,
        time_limit: None,
        features: false,
        interpolate: run.interpolate,
        seed: SEED,
        frame: None,
    }
}

fn preparation(prepared: &Prepared, stats: &Stats, all: Spent) -> Preparation {
    let spent = |stage: fn(&crate::pipeline::stats::Seconds) -> f64| Spent {
        wall: stage(&stats.seconds),
        cpu: stage(&stats.cpu_seconds),
    };
    let c = &stats.counts;
    Preparation {
        all,
        simplify: spent(|s| s.simplify),
        build: spent(|s| s.build),
        radiosity: spent(|s| s.radiosity),
        surfaces: if prepared.settings.complete_geometry() { c.surfaces } else { c.normal + c.simple },
        patches: c.patches,
        clusters: if prepared.settings.complete_geometry() { 0 } else { c.clusters },
        unshot: stats.ledger.map_or(0.0, |l| l.unshot_share()),
        error: stats.error.radiosity,
        rays: stats.rays.radiosity,
    }
}

/// Where images go, and what they are compared with.
struct Keep<'a> {
    store: &'a Store,
    subject: &'a Subject,
    reference: Option<&'a Picture>,
}

impl Keep<'_> {
    /// `spent`: on preparation, and on rendering.
    fn point(&self, key: &str, film: &Film, spent: [Spent; 2], hires_share: f64, rays: RayCounts) -> Result<Point> {
        let [preparation, rendering] = spent;
        let pixels = f64::from(film.width) * f64::from(film.height);
        let trials = film.pixels().map(|p| f64::from(p.hires.trials().max(p.lores.trials()))).sum::<f64>() / pixels;
        let mut point = Point {
            trials,
            preparation,
            rendering,
            hires_share,
            rays: rays.hires() + rays.lores(),
            noise: film.relative_errors().total,
            dev: [mean_dev(film, |p| &p.hires), mean_dev(film, |p| &p.lores)],
            whole: None,
            direct: None,
            indirect: None,
        };
        if let (Some(reference), Some(picture)) = (self.reference, Picture::of(film)) {
            let (width, coarse) = (film.width as usize, self.subject.coarse());
            let errors = |image: &Halves, truth: &Halves| compare(image, truth, width, coarse);
            point.whole = Some(errors(&picture.whole, &reference.whole));
            point.direct = Some(errors(&picture.direct(), &reference.direct()));
            let gathers = film.pixels().any(|p| p.lores.trials() > 0);
            point.indirect = gathers.then(|| errors(&picture.indirect, &reference.indirect));
            write_image(&self.store.image(key, trials), &picture, film.width)?;
        }
        Ok(point)
    }
}

fn write_image(path: &Path, picture: &Picture, width: u32) -> Result<()> {
    let options = WriteOptions { half: true, ..WriteOptions::default() };
    image::write(path, &picture.develop(width), &Metadata::new(), &options)
}

/// Mean of `L_dev / L` over the pixels and bands that are not black.
fn mean_dev(film: &Film, pass: impl Fn(&crate::render::film::Pixel) -> &PixelSum) -> f64 {
    let (mut sum, mut count) = (0.0, 0u64);
    for pixel in film.pixels() {
        let (mean, dev) = (pass(pixel).mean(), pass(pixel).dev());
        for (mean, dev) in mean.into_iter().zip(dev).filter(|(mean, _)| *mean > 0.0) {
            sum += dev / mean;
            count += 1;
        }
    }
    sum / count.max(1) as f64
}
