//! Options that several commands share.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;

use crate::clock::Stopwatch;
use crate::error::{Error, Result};
use crate::pipeline::{BackendKind, GeometryKind, Method, Settings, Stats};
use crate::progress::Progress;
use crate::scene::{self, LoadOptions, Scene};
use crate::simplify::BoxFit;

/// A length or `auto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthOrAuto(pub Option<f32>);

impl FromStr for LengthOrAuto {
    type Err = String;

    fn from_str(s: &str) -> std::result::Result<Self, String> {
        if s == "auto" {
            return Ok(LengthOrAuto(None));
        }
        s.parse().map(|l| LengthOrAuto(Some(l))).map_err(|_| "expected a length (0.25, inf) or 'auto'".to_owned())
    }
}

/// Which scene, and how it is seen.
#[derive(Args, Debug)]
pub struct SceneOptions {
    /// glTF 2.0 file (.glb or .gltf)
    pub scene: PathBuf,
    /// Camera, by name or number; 'gsii render' also takes 'all' [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
}

/// How light is computed.
#[derive(Args, Debug)]
pub struct MethodOptions {
    /// Method: gsii; or pmm, mcpt, radiosity for comparison
    #[arg(long, value_enum, default_value_t, help_heading = "Method")]
    pub method: Method,
    /// Geometry of '--method radiosity': normal + simple or normal + complex surfaces
    #[arg(long, value_enum, default_value_t, help_heading = "Method")]
    pub geometry: GeometryKind,
    /// Distance up to which indirect light is traced in the detailed scene (scene units; 0 is PMM, inf is path tracing)
    #[arg(long, value_name = "LENGTH|auto", default_value = "auto", help_heading = "Method")]
    pub r_thresh: LengthOrAuto,
    /// No bias but noise: to each trial what the far field gets wrong on its path is added, as the bias meter measures it. That is
    /// path tracing, as with '--r-thresh inf'
    #[arg(long, conflicts_with = "r_thresh", help_heading = "Method")]
    pub unbiased: bool,
    /// Share of the hemisphere that one dropped surface may fill, 0..1 [default: 0.02; the paper: 0.159]
    #[arg(long, value_name = "X", help_heading = "Method")]
    pub beta: Option<f32>,
    /// Stop radiosity when this share of the emitted flux is unshot
    #[arg(long, value_name = "X", default_value_t = Settings::default().unshot, help_heading = "Method")]
    pub unshot: f64,
    /// Edge length of radiosity patches (scene units)
    #[arg(long, value_name = "LENGTH|auto", default_value = "auto", help_heading = "Method")]
    pub patch_size: LengthOrAuto,
    /// Fewest patches that a surface is cut into, about, however small it is; the paper's surfaces have 7 on average
    #[arg(long, value_name = "N", default_value_t = Settings::default().least_patches, help_heading = "Method")]
    pub least_patches: u32,
    /// How boxes are fitted to clusters
    #[arg(long = "box", value_enum, default_value_t, help_heading = "Method")]
    pub box_fit: BoxFit,
    /// Roughness that indirect light sees opaque surfaces at least as rough as (0: as they are; mcpt always uses 0)
    #[arg(long, value_name = "X", default_value_t = Settings::default().filter_glossy, help_heading = "Method")]
    pub filter_glossy: f32,
    /// Scattering events after which paths end [default: unlimited]
    #[arg(long, value_name = "N", help_heading = "Method")]
    pub max_depth: Option<u32>,
    /// Seed: the same seed gives the same image, bit for bit
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Run")]
    pub seed: u32,
    /// Threads [default: all]
    #[arg(long, value_name = "N", help_heading = "Run")]
    pub threads: Option<usize>,
    /// Folder that keeps the simplified scene and the radiosity solution for later runs
    #[arg(long, value_name = "DIR", help_heading = "Run")]
    pub cache: Option<PathBuf>,
    /// Ray-tracing library
    #[arg(long, value_enum, default_value_t, help_heading = "Run")]
    pub backend: BackendKind,
}

/// How much is said.
#[derive(Args, Debug)]
pub struct Talk {
    /// Say nothing but errors
    #[arg(long, short, help_heading = "Run", conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more: what was chosen, what the importer noticed
    #[arg(long, short, help_heading = "Run")]
    pub verbose: bool,
}

impl Talk {
    /// Progress bars unless quiet, and logging as loud as wished.
    pub fn progress(&self) -> Progress {
        let level = match (self.quiet, self.verbose) {
            (true, _) => log::LevelFilter::Error,
            (_, true) => log::LevelFilter::Debug,
            _ => log::LevelFilter::Warn,
        };
        // A second initialisation in one process (tests) keeps the first one's settings.
        let _ = env_logger::Builder::new().filter_level(level).format_target(false).format_timestamp(None).try_init();
        if self.quiet { Progress::silent() } else { Progress::on_terminal() }
    }

    /// Prints a line on standard error unless quiet.
    pub fn say(&self, line: impl AsRef<str>) {
        if !self.quiet {
            eprintln!("{}", line.as_ref());
        }
    }
}

impl MethodOptions {
    /// As library settings.
    pub fn settings(&self) -> Settings {
        let default = Settings::default();
        Settings {
            method: self.method,
            geometry: self.geometry,
            // A path's far field and its residual add up to the path: there is no need to look up either.
            r_thresh: if self.unbiased { Some(f32::INFINITY) } else { self.r_thresh.0 },
            beta: self.beta.unwrap_or(default.beta),
            box_fit: self.box_fit,
            patch_size: self.patch_size.0,
            least_patches: self.least_patches,
            unshot: self.unshot,
            filter_glossy: self.filter_glossy,
            max_depth: self.max_depth.unwrap_or(default.max_depth),
            backend: self.backend,
            cache: self.cache.clone(),
            threads: self.threads.unwrap_or(0),
            seed: self.seed,
            ..default
        }
    }
}

/// Sets the size of rayon's pool, where `threads` says one.
///
/// # Errors
/// Zero threads.
pub fn set_threads(threads: Option<usize>) -> Result<()> {
    if threads == Some(0) {
        return Err(Error::Usage("--threads must be at least 1".to_owned()));
    }
    if let Some(n) = threads {
        // Fails only when the pool already exists, which keeps its size.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(n).build_global();
    }
    Ok(())
}

/// Reads a scene, noting time and warnings.
///
/// # Errors
/// As [`scene::gltf::load`].
pub fn load(options: &SceneOptions, stats: &mut Stats) -> Result<Arc<Scene>> {
    load_with(options, &LoadOptions::default(), stats)
}

/// The same, with a choice of what to read.
///
/// # Errors
/// As [`scene::gltf::load`].
pub fn load_with(options: &SceneOptions, what: &LoadOptions, stats: &mut Stats) -> Result<Arc<Scene>> {
    let start = Stopwatch::start();
    let scene = scene::gltf::load(&options.scene, what)?;
    stats.record_time(start, |s| &mut s.load);
    for warning in &scene.notes.warnings {
        log::warn!("{}: {warning}", scene.name);
    }
    Ok(Arc::new(scene))
}
