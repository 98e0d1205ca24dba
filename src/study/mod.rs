//! Speed against error of every method of the paper, its tables, and a page that shows them.
//!
//! [`run`] makes a converged reference of each scene ([`mod@reference`]), carries out a ladder of runs ([`plan`], [`work`]), compares
//! every image with the reference in a way that tells bias from noise ([`error`]), and writes what came out ([`report`]). What is
//! finished is kept ([`record`]): a study that was stopped goes on where it was.

pub mod crossing;
pub mod error;
pub mod page;
pub mod pictures;
pub mod plan;
pub mod plot;
pub mod record;
pub mod reference;
pub mod report;
pub mod subject;
pub mod table;
pub mod tables;
pub mod work;

use std::path::PathBuf;
use std::time::Instant;

use crate::error::Result;
use crate::pipeline::{self, Method, Settings};
use crate::progress::Progress;
use plan::{Extent, Role, Run};
use record::{Record, Store};
use reference::Reference;
use subject::Subject;

/// What to study.
#[derive(Clone, Debug)]
pub struct Options {
    /// Scenes that are compared with a reference.
    pub scenes: Vec<PathBuf>,
    /// Scenes on which only MCPT, PMM and GSII are compared, as they are by default.
    pub curves: Vec<PathBuf>,
    /// Camera by name or number; the first where there is none.
    pub camera: Option<String>,
    /// Scenes of growing detail, for the scaling with the number of triangles.
    pub scaling: Vec<PathBuf>,
    /// Folder for the report.
    pub output: PathBuf,
    /// Width of all images in pixels.
    pub width: u32,
    /// Trials of each pixel of the references.
    pub reference_trials: u32,
    /// Most trials of each pixel of the three main methods.
    pub main_trials: u32,
    /// Most trials of each pixel of the other settings.
    pub other_trials: u32,
    /// What the ladder starts from.
    pub base: Settings,
    /// Forgets finished runs. References stay.
    pub fresh: bool,
}

/// One scene with all that was found out about it.
pub struct Chapter {
    /// The scene.
    pub subject: Subject,
    /// Its reference.
    pub reference: Reference,
    /// Finished runs, in the ladder's order.
    pub records: Vec<Record>,
}

/// Everything that a report is made from.
pub struct Study {
    /// Scenes with a reference.
    pub chapters: Vec<Chapter>,
    /// Runs of the scaling.
    pub scaling: Vec<Record>,
    /// Images of finished runs.
    pub store: Store,
}

/// How far the study is.
struct Pace<'a> {
    total: u64,
    done: u64,
    /// Work that was done in this session, which the estimate is made from.
    worked: u64,
    start: Instant,
    bar: indicatif::ProgressBar,
    say: &'a dyn Fn(&str),
}

impl Pace<'_> {
    fn advance(&mut self, cost: u64) {
        self.done += cost;
        self.worked += cost;
        self.bar.set_position(self.done);
    }

    fn skip(&mut self, cost: u64) {
        self.done += cost;
        self.bar.set_position(self.done);
        self.bar.reset_eta();
    }

    fn report(&self, line: &str) {
        let left = self.total.saturating_sub(self.done) as f64;
        let seconds = self.start.elapsed().as_secs_f64() * left / self.worked.max(1) as f64;
        let rest = match seconds {
            s if self.worked == 0 || s < 1.0 => String::new(),
            s if s < 90.0 => format!("; about {s:.0} s to go"),
            s => format!("; about {:.0} min to go", s / 60.0),
        };
        let percent = 100.0 * self.done as f64 / self.total.max(1) as f64;
        self.bar.suspend(|| (self.say)(&format!("{percent:>3.0} %  {line}{rest}")));
    }
}

/// Makes the study, or the rest of it, and writes the report. Returns whether it was finished; when `progress` is stopped before,
/// there is no report, and what is finished is kept.
///
/// # Errors
/// As reading and preparing scenes, and writing files.
pub fn run(options: &Options, progress: &Progress, say: &dyn Fn(&str)) -> Result<bool> {
    let folder = |name: &str| options.output.join("work").join(name);
    if options.fresh && folder("runs").is_dir() {
        std::fs::remove_dir_all(folder("runs"))
            .map_err(|e| crate::Error::Output { path: folder("runs"), reason: e.to_string() })?;
    }
    let store = Store::open(&folder("runs"))?;
    record::make_folder(&folder("references"))?;

    let mut plans = Vec::new();
    let extent = Extent { main_trials: options.main_trials, other_trials: options.other_trials };
    for path in &options.scenes {
        let subject = Subject::load(path, options.camera.as_deref(), options.width)?;
        let gsii = Settings { method: Method::Gsii, ..options.base.clone() };
        let auto = pipeline::automatic(&subject.scene, std::slice::from_ref(&subject.camera), gsii)?.r_thresh();
        let runs = plan::ladder(&subject, &options.base, auto, extent);
        plans.push((subject, runs));
    }
    for path in &options.curves {
        let subject = Subject::load(path, options.camera.as_deref(), options.width)?;
        plans.push((subject, plan::main_methods(&options.base, extent)));
    }
    let mut scaling_subjects = Vec::new();
    for path in &options.scaling {
        scaling_subjects.push(Subject::load(path, options.camera.as_deref(), options.width)?);
    }

    let pass = |subject: &Subject| {
        u64::from(subject.size[0]) * u64::from(subject.size[1]) * u64::from(reference::pass_trials())
    };
    let passes = options.reference_trials.div_ceil(reference::pass_trials());
    let cost_of = |(subject, runs): &(Subject, Vec<Run>)| {
        u64::from(passes) * pass(subject) + runs.iter().map(|r| r.cost(subject)).sum::<u64>()
    };
    let scaling_runs = plan::scaling(&options.base);
    let scaling_cost: u64 = scaling_subjects.iter().flat_map(|s| scaling_runs.iter().map(|r| r.cost(s))).sum();
    let total = plans.iter().map(cost_of).sum::<u64>() + scaling_cost;
    let bar = progress.stage("study", total);
    let mut pace = Pace { total, done: 0, worked: 0, start: Instant::now(), bar, say };

    let mut study = Study { chapters: Vec::new(), scaling: Vec::new(), store };
    for (subject, runs) in plans {
        let missing = reference::missing(&folder("references"), &subject, options.reference_trials);
        pace.skip(u64::from(passes.saturating_sub(missing)) * pass(&subject));
        let backend = options.base.backend;
        let trials = options.reference_trials;
        let reference =
            reference::make(&folder("references"), &subject, trials, backend, &progress.quietly(), &mut || {
                pace.advance(pass(&subject));
                if (pace.done / pass(&subject)).is_multiple_of(8) {
                    pace.report(&format!("{}: reference", subject.name));
                }
            })?;
        if progress.stopped() {
            return Ok(false);
        }
        let Some(records) = carry_out(&runs, &subject, Some(&reference), &study.store, progress, &mut pace)? else {
            return Ok(false);
        };
        study.chapters.push(Chapter { subject, reference, records });
    }
    for subject in scaling_subjects {
        match carry_out(&scaling_runs, &subject, None, &study.store, progress, &mut pace)? {
            Some(records) => study.scaling.extend(records),
            None => return Ok(false),
        }
    }
    study.scaling.sort_by_key(|record| record.triangles);
    pace.bar.finish_and_clear();
    report::write(&study, &options.output)?;
    Ok(true)
}

/// Carries out what is not finished yet. `None` when it was stopped.
fn carry_out(
    runs: &[Run],
    subject: &Subject,
    reference: Option<&Reference>,
    store: &Store,
    progress: &Progress,
    pace: &mut Pace<'_>,
) -> Result<Option<Vec<Record>>> {
    let mut records = Vec::new();
    let mut kit = None;
    for run in runs {
        let cost = run.cost(subject);
        if let Some(record) = store.get(&run.key(subject, reference.map_or(0, |r| r.trials))) {
            pace.skip(cost);
            records.push(record);
            continue;
        }
        let Some(record) = work::perform(run, subject, reference, store, &mut kit, &progress.quietly())? else {
            return Ok(None);
        };
        store.put(&record)?;
        pace.advance(cost);
        pace.report(&summary(&record));
        records.push(record);
    }
    Ok(Some(records))
}

fn summary(record: &Record) -> String {
    let Some(point) = record.last() else { return format!("{}, {}", record.scene, record.label) };
    let error = match point.whole {
        Some(e) if record.role != Role::Scaling => format!("relMSE {:.1e}", e.rel_mse),
        _ => format!("noise {:.1} %", 100.0 * point.noise),
    };
    let total = point.total().cpu;
    format!("{}, {}: {error} after {:.0} trials, {total:.1} core seconds", record.scene, record.label, point.trials)
}
