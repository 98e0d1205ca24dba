//! `gsii validate`: Embree against obvhs.

use std::process::ExitCode;

use clap::Args;

use super::options::{LengthOrAuto, SceneOptions, Talk, load, set_threads};
use super::page::Page;
use crate::backend::compare::Comparison;
use crate::error::{Error, Result};
use crate::pipeline::validate::{Report, validate};
use crate::pipeline::{Settings, Stats, choose_camera};

/// Unexplained differences that are printed of each kind of ray.
const SHOWN: usize = 5;

/// Options of `gsii validate`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    /// Rays of each of the five kinds
    #[arg(long, value_name = "N", default_value_t = 1 << 19)]
    rays: u32,
    /// Distance at which gather rays change from the detailed to the simplified scene (scene units)
    #[arg(long, value_name = "LENGTH|auto", default_value = "auto")]
    r_thresh: LengthOrAuto,
    /// Seed of the rays
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Threads [default: all]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    #[command(flatten)]
    talk: Talk,
}

/// Runs the command: exit code 1 when a difference is not explained.
///
/// # Errors
/// Bad options, bad input, a failing library.
pub fn run(options: &Options) -> Result<ExitCode> {
    if options.rays == 0 || options.rays > 1 << 28 {
        return Err(Error::Usage(format!("--rays must be between 1 and {}", 1 << 28)));
    }
    set_threads(options.threads)?;
    let progress = options.talk.progress();
    let scene = load(&options.scene, &mut Stats::new())?;
    let camera = choose_camera(&scene, options.scene.camera.as_deref())?.clone();
    let settings = Settings {
        r_thresh: options.r_thresh.0,
        seed: options.seed,
        threads: options.threads.unwrap_or(0),
        ..Settings::default()
    };
    let report = validate(&scene, &camera, settings, options.rays, &progress)?;
    describe(&scene.name, &report).print()?;
    let good = report.total().unexplained == 0;
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn describe(scene: &str, report: &Report) -> Page {
    let mut page = Page::default();
    let [a, b] = &report.backends;
    let [detailed, simplified] = report.triangles;
    page.line(format_args!("{scene}: {a} against {b}"));
    page.line(format_args!(
        "{detailed} triangles in the detailed scene, {simplified} in the simplified, r_thresh {:.4}",
        report.r_thresh
    ));
    page.line("");
    row(&mut page, "", ["rays", "identical", "misses", "tied", "borderline", "unexplained"].map(str::to_owned));
    let total = report.total();
    let kinds = report.kinds.iter().map(|(kind, comparison)| (kind.name(), comparison));
    for (name, c) in kinds.chain([("total", &total)]) {
        row(
            &mut page,
            name,
            [c.rays, c.identical, c.misses, c.tied, c.borderline, c.unexplained].map(|n| n.to_string()),
        );
    }
    page.line("");
    page.line(format_args!(
        "tied: another triangle at the same distance within the rounding bound; borderline: rounding decides whether"
    ));
    page.line(format_args!(
        "the ray hits at all (outlines, ends of the ray, grazing incidence, alpha); both bounds are worked out per ray."
    ));
    for (kind, comparison) in &report.kinds {
        add_examples(&mut page, kind.name(), comparison);
    }
    page
}

fn row(page: &mut Page, name: &str, cells: [String; 6]) {
    let [rays, identical, misses, tied, borderline, unexplained] = cells;
    page.line(format_args!(
        "{name:<14}{rays:>10}{identical:>11}{misses:>10}{tied:>9}{borderline:>12}{unexplained:>13}"
    ));
}

fn add_examples(page: &mut Page, name: &str, comparison: &Comparison) {
    for difference in comparison.examples.iter().take(SHOWN) {
        page.line(format_args!("unexplained ({name}): {:?}", difference.ray));
        page.line(format_args!("  first:  {:?}, occluded {}", difference.a, difference.occluded[0]));
        page.line(format_args!("  second: {:?}, occluded {}", difference.b, difference.occluded[1]));
    }
}
