//! `gsii simplify`: the simplified scene, to be looked at and measured.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::options::{LengthOrAuto, SceneOptions, Talk, load};
use super::page::Page;
use super::places;
use crate::error::{Error, Result};
use crate::pipeline::{BackendKind, Method, Prepared, Settings, Stats, choose_camera, simplify_only};
use crate::radiosity::{self, Solution};
use crate::scene::Scene;
use crate::simplify::{BoxFit, Class, LONGEST_CLUSTER, Simplified, SimplifiedGeometry, export, report};
use crate::unfinished;

/// Options of `gsii simplify`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    /// Binary glTF file to write the simplified scene to
    #[arg(short, long, value_name = "FILE.glb")]
    output: Option<PathBuf>,
    /// Table of all clusters, as CSV or JSON by extension
    #[arg(long, value_name = "FILE.csv|.json")]
    report: Option<PathBuf>,
    /// Solve radiosity and write radiosities as colours, instead of reflectances
    #[arg(long, requires = "output")]
    radiosity: bool,
    /// Distance beyond which the simplified scene is used (scene units)
    #[arg(long, value_name = "LENGTH|auto", default_value = "auto", help_heading = "Method")]
    r_thresh: LengthOrAuto,
    /// Share of the hemisphere that one dropped surface may fill, 0..1 [default: 0.02; the paper: 0.159]
    #[arg(long, value_name = "X", help_heading = "Method")]
    beta: Option<f32>,
    /// How boxes are fitted to clusters
    #[arg(long = "box", value_enum, default_value_t, help_heading = "Method")]
    box_fit: BoxFit,
    /// Largest diagonal of a cluster in units of r_thresh; 1 allows none that could hide anything
    #[arg(long, value_name = "X", default_value_t = LONGEST_CLUSTER, help_heading = "Method")]
    longest_cluster: f32,
    /// Edge length of radiosity patches (scene units)
    #[arg(long, value_name = "LENGTH|auto", default_value = "auto", help_heading = "Method")]
    patch_size: LengthOrAuto,
    /// Fewest patches that a surface is cut into, about, however small it is; the paper's surfaces have 7 on average
    #[arg(long, value_name = "N", default_value_t = Settings::default().least_patches, help_heading = "Method")]
    least_patches: u32,
    /// Seed: the same seed gives the same result, bit for bit
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Run")]
    seed: u32,
    /// Folder that keeps the result for later runs
    #[arg(long, value_name = "DIR", help_heading = "Run")]
    cache: Option<PathBuf>,
    /// Ray-tracing library
    #[arg(long, value_enum, default_value_t, help_heading = "Run")]
    backend: BackendKind,
    #[command(flatten)]
    talk: Talk,
}

impl Options {
    fn settings(&self) -> Settings {
        let default = Settings::default();
        Settings {
            method: Method::Gsii,
            r_thresh: self.r_thresh.0,
            beta: self.beta.unwrap_or(default.beta),
            box_fit: self.box_fit,
            longest_cluster: self.longest_cluster,
            patch_size: self.patch_size.0,
            least_patches: self.least_patches,
            backend: self.backend,
            cache: self.cache.clone(),
            seed: self.seed,
            ..default
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Bad options, bad input, a failing library, a file that cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    let table = options.report.as_deref().map(table_format).transpose()?;
    if let Some(path) = options.output.as_deref().filter(|path| path.extension() != Some("glb".as_ref())) {
        return Err(Error::Usage(format!(
            "--output {}: the name must end in .glb, which is what is written",
            path.display()
        )));
    }
    places::check(&[], [options.output.as_deref(), options.report.as_deref()])?;
    let progress = options.talk.progress();
    let mut stats = Stats::new();
    let scene = load(&options.scene, &mut stats)?;
    let camera = choose_camera(&scene, options.scene.camera.as_deref())?.clone();
    let (simplified, settings, solution) = if options.radiosity {
        let prepared = Prepared::new(scene.clone(), &camera, options.settings(), &progress, &mut stats)?;
        let far = prepared.far.and_then(|far| Some((far.simplified?, far.solution)));
        let Some((simplified, solution)) = far else {
            return Err(Error::Usage("--radiosity needs an r_thresh above 0 and below infinity".to_owned()));
        };
        (simplified, prepared.settings, Some(solution))
    } else {
        let (simplified, settings) = simplify_only(&scene, &camera, options.settings(), &progress, &mut stats)?;
        (simplified, settings, None)
    };
    for warning in &simplified.warnings {
        log::warn!("{warning}");
    }
    if let Some(path) = &options.output {
        unfinished::write(path, |out| export::write(&scene, &simplified, solution.as_ref(), out))?;
    }
    if let (Some(path), Some(format)) = (&options.report, table) {
        let rows = report::rows(&simplified);
        unfinished::write(path, |out| match format {
            Table::Csv => report::write_csv(&rows, out),
            Table::Json => report::write_json(&rows, out),
        })?;
    }
    table_of(&scene, &simplified, &settings, solution.as_ref(), &stats)?.print()?;
    Ok(ExitCode::SUCCESS)
}

#[derive(Clone, Copy)]
enum Table {
    Csv,
    Json,
}

fn table_format(path: &Path) -> Result<Table> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("csv") => Ok(Table::Csv),
        Some("json") => Ok(Table::Json),
        _ => Err(Error::Usage(format!("--report {}: the name must end in .csv or .json", path.display()))),
    }
}

/// The paper's comparison of both environments, and how well the boxes fit.
fn table_of(
    scene: &Scene,
    simplified: &Simplified,
    settings: &Settings,
    solution: Option<&Solution>,
    stats: &Stats,
) -> Result<Page> {
    let mut page = Page::default();
    let complete = SimplifiedGeometry::complete(scene, &simplified.surface_of_triangle);
    let params = settings.radiosity_params();
    let patches_complete = radiosity::count_patches(&complete, &[], &params)?;
    let patches = match solution {
        Some(solution) => solution.patches,
        None => radiosity::count_patches(&simplified.geometry, &simplified.clusters, &params)?,
    };
    let count = |f: &dyn Fn(Class) -> bool| simplified.surfaces.iter().filter(|s| f(s.class)).count();
    let normal = count(&|c| c == Class::Normal);
    let dropped = count(&Class::is_isolated);
    let all = simplified.surfaces.len();
    let clusters = &simplified.clusters;
    page.line(format_args!(
        "{}: r_thresh {:.4}, beta {:.4}, A_thresh {:.5}, patches of {:.4}",
        scene.name,
        settings.r_thresh(),
        settings.beta,
        simplified.a_thresh,
        settings.patch_size.unwrap_or(f32::INFINITY)
    ));
    page.line(format_args!("                    surfaces   patches  triangles"));
    page.line(format_args!("normal + complex  {all:>10} {patches_complete:>9} {:>10}", complete.triangles.len()));
    let geometry = &simplified.geometry;
    page.line(format_args!(
        "normal + simple   {:>10} {patches:>9} {:>10}",
        geometry.surfaces,
        geometry.triangles.len()
    ));
    let share = |a: usize, b: usize| 100.0 * a as f64 / b.max(1) as f64;
    page.line(format_args!(
        "                  {:>9.2}% {:>8.2}% {:>9.2}%",
        share(geometry.surfaces as usize, all),
        share(patches, patches_complete),
        share(geometry.triangles.len(), complete.triangles.len())
    ));
    page.line(format_args!(
        "{normal} normal, {} in {} clusters, {dropped} dropped; simplified in {:.2} s ({:.2} of all cores), {} rays",
        all - normal - dropped,
        clusters.len(),
        stats.seconds.simplify,
        stats.cpu_seconds.simplify,
        simplified.rays
    ));
    if !clusters.is_empty() {
        let n = clusters.len() as f32;
        let mean =
            |f: &dyn Fn(&crate::simplify::FitResidual) -> f32| clusters.iter().map(|c| f(&c.residual)).sum::<f32>() / n;
        page.line(format_args!(
            "boxes on fresh rays: mean |intercepted - 1| {:.4}, by direction {:.4}, mean |reflected colour| {:.4}, hidden {:.4}",
            mean(&|r| r.intercepted.abs()),
            mean(&|r| r.directional),
            mean(&|r| r.reflected.abs().element_sum() / 3.0),
            mean(&|r| r.hidden)
        ));
    }
    Ok(page)
}
