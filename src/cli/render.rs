//! `gsii render`: the main job.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};

use super::options::{MethodOptions, SceneOptions, Talk, load, set_threads};
use crate::error::{Error, Result};
use crate::image::{self, Metadata, ViewTransform, WriteOptions};
use crate::pipeline::{Method, Prepared, Stats, choose_camera};
use crate::render::layers::{Layer, develop};
use crate::render::{self, PassTimes, RayCounts, RenderParams, Rendering, World, bias};
use crate::scene::Camera;

/// Pairs of paths that measure the bias when not said otherwise.
const BIAS_SAMPLES: u32 = 1 << 15;

/// Tone curves by their names on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// AgX: bright light bleaches instead of clipping.
    Filmic,
    /// Plain sRGB, clipped.
    Srgb,
}

/// Options of `gsii render`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    /// Image to write, in any format OpenImageIO writes, by extension; may be repeated
    #[arg(short, long, value_name = "IMAGE", required = true)]
    output: Vec<PathBuf>,
    /// Width in pixels [default: 1280, or from the height and the camera]
    #[arg(long, value_name = "N")]
    width: Option<u32>,
    /// Height in pixels [default: from the width and the camera]
    #[arg(long, value_name = "N")]
    height: Option<u32>,
    /// Relative error of a pixel to aim for, in both passes
    #[arg(long, value_name = "X", help_heading = "Quality")]
    error: Option<f32>,
    /// Relative error of a pixel at which HIRES stops [default: 0.05]
    #[arg(long, value_name = "X", help_heading = "Quality")]
    hires_error: Option<f32>,
    /// Relative error of a pixel, both passes together, at which LORES stops [default: 0.05]
    #[arg(long, value_name = "X", help_heading = "Quality")]
    lores_error: Option<f32>,
    /// Fewest trials of a pixel in each pass
    #[arg(long, value_name = "N", default_value_t = 16, help_heading = "Quality")]
    min_trials: u32,
    /// Most trials of a pixel in each pass
    #[arg(long, value_name = "N", default_value_t = 512, help_heading = "Quality")]
    max_trials: u32,
    /// Fixed sampling: short for --min-trials N --max-trials N
    #[arg(long, value_name = "N", help_heading = "Quality", conflicts_with_all = ["min_trials", "max_trials", "error", "hires_error", "lores_error"])]
    spp: Option<u32>,
    /// Gather indirect light for each pixel by itself, with no interpolation between places: slower, and without its error
    #[arg(long, help_heading = "Quality")]
    per_pixel: bool,
    /// Begin no new trials after this many seconds of rendering
    #[arg(long, value_name = "SECONDS", help_heading = "Quality")]
    time_limit: Option<f64>,
    /// Pairs of paths that measure the bias; 0 for none
    #[arg(long, value_name = "N", default_value_t = BIAS_SAMPLES, help_heading = "Quality")]
    measure_bias: u32,
    #[command(flatten)]
    method: MethodOptions,
    /// Layers to write beside R,G,B where the format has named channels: hires, lores, hires_dev, lores_dev, albedo, normal,
    /// depth, trials, class, cluster, lookup_distance, near_share [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Output")]
    layers: Option<Vec<Layer>>,
    /// Stops by which formats for screens are brightened [default: automatic]
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, help_heading = "Output")]
    exposure: Option<f32>,
    /// Tone curve of formats for screens
    #[arg(long, value_enum, default_value_t = View::Filmic, help_heading = "Output")]
    view: View,
    /// Write times, counts, errors and parameters as JSON
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    talk: Talk,
}

/// Runs the command.
///
/// # Errors
/// Bad options, bad input, a failing library, an image that cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    let start = Instant::now();
    for path in &options.output {
        image::check_writable(path)?;
    }
    set_threads(options.method.threads)?;
    let progress = options.talk.progress();
    stop_on_ctrl_c(&progress);

    let mut stats = Stats::new();
    let scene = load(&options.scene, &mut stats)?;
    let camera = choose_camera(&scene, options.scene.camera.as_deref())?.clone();
    let params = options.render_params(&camera)?;
    let prepared = Prepared::new(scene, &camera, options.method.settings(), &progress, &mut stats)?;
    for warning in &stats.warnings {
        log::warn!("{warning}");
    }
    let rendering = options.render(&prepared, &camera, &params, &progress);
    stats.record_rendering(&rendering);
    if rendering.film.pixels().all(|p| p.hires.trials() == 0) {
        options.talk.say("gsii: stopped before the first trial; nothing was written");
        return Ok(ExitCode::FAILURE);
    }
    options.measure_bias(&prepared, &camera, &params, &rendering, &mut stats);
    options.record_parameters(&params, rendering.stopped, &mut stats);

    let written = Instant::now();
    let developed = develop(&rendering.film, options.layers());
    let metadata = metadata(&stats, &camera);
    let write_options = WriteOptions {
        exposure_stops: options.exposure.unwrap_or_else(|| image::auto_exposure(&developed)),
        view: match options.view {
            View::Filmic => ViewTransform::Filmic,
            View::Srgb => ViewTransform::Srgb,
        },
        dither: true,
        ..WriteOptions::default()
    };
    for path in &options.output {
        image::write(path, &developed, &metadata, &write_options)?;
    }
    stats.seconds.write = written.elapsed().as_secs_f64();
    stats.seconds.total = start.elapsed().as_secs_f64();
    stats.peak_rss_bytes = peak_rss_bytes();
    if let Some(path) = &options.stats {
        write_stats(path, &stats)?;
    }
    options.summarise(&stats, rendering.stopped);
    Ok(ExitCode::SUCCESS)
}

impl Options {
    fn layers(&self) -> &[Layer] {
        self.layers.as_deref().unwrap_or(&Layer::ALL)
    }

    fn render_params(&self, camera: &Camera) -> Result<RenderParams> {
        let aspect = camera.aspect.unwrap_or(16.0 / 9.0);
        let (width, height) = match (self.width, self.height) {
            (Some(w), Some(h)) => (w, h),
            (Some(w), None) => (w, (w as f32 / aspect).round().max(1.0) as u32),
            (None, Some(h)) => ((h as f32 * aspect).round().max(1.0) as u32, h),
            (None, None) => (1280, (1280.0 / aspect).round().max(1.0) as u32),
        };
        let error = self.error.unwrap_or(0.05);
        let (hires_error, lores_error) = (self.hires_error.unwrap_or(error), self.lores_error.unwrap_or(error));
        let (min_trials, max_trials) = self.spp.map_or((self.min_trials, self.max_trials), |n| (n, n));
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if width == 0 || height == 0 || width > 1 << 16 || height > 1 << 16 {
            return refuse("--width and --height must be between 1 and 65536");
        }
        if min_trials == 0 || min_trials > max_trials {
            return refuse("--min-trials must be at least 1 and at most --max-trials");
        }
        if !(hires_error > 0.0 && lores_error > 0.0) {
            return refuse("errors must be above 0 (0.05 is 5 %)");
        }
        if self.time_limit.is_some_and(|t| !(t > 0.0 && t < 1e9)) {
            return refuse("--time-limit must be a number of seconds above 0");
        }
        Ok(RenderParams {
            width,
            height,
            min_trials,
            max_trials,
            hires_error,
            lores_error,
            time_limit: self.time_limit.map(Duration::from_secs_f64),
            features: self.layers().iter().any(|l| l.is_feature()),
            interpolate: !self.per_pixel,
            seed: self.method.seed,
        })
    }

    fn render(
        &self,
        prepared: &Prepared,
        camera: &Camera,
        params: &RenderParams,
        progress: &crate::progress::Progress,
    ) -> Rendering {
        let world = prepared.world();
        if let (Method::Radiosity, Some(far)) = (prepared.settings.method, world.far) {
            let start = Instant::now();
            let film = render::show::show_radiosity(&world, &far, camera, params);
            let times = PassTimes { hires: start.elapsed(), lores: Duration::ZERO };
            let view = film.pixels().map(|p| u64::from(p.hires.trials())).sum();
            return Rendering {
                film,
                rays: RayCounts { view, ..RayCounts::default() },
                times,
                stopped: false,
                cache: None,
            };
        }
        render::render(&world, camera, params, progress)
    }

    fn measure_bias(
        &self,
        prepared: &Prepared,
        camera: &Camera,
        params: &RenderParams,
        rendering: &Rendering,
        stats: &mut Stats,
    ) {
        let gathers = matches!(prepared.settings.method, Method::Gsii | Method::Pmm);
        if !gathers || prepared.far.is_none() || self.measure_bias == 0 || rendering.stopped {
            return;
        }
        let start = Instant::now();
        let aspect = params.width as f32 / params.height as f32;
        let world = World { cache: rendering.cache.as_ref(), ..prepared.world() };
        let bias = bias::measure(&world, camera, aspect, self.measure_bias, params.seed);
        stats.record_bias(&bias, &rendering.film);
        stats.seconds.bias = start.elapsed().as_secs_f64();
    }

    fn record_parameters(&self, params: &RenderParams, stopped: bool, stats: &mut Stats) {
        let map = &mut stats.parameters;
        for (key, value) in [
            ("scene", serde_json::json!(self.scene.scene.display().to_string())),
            ("camera", serde_json::json!(self.scene.camera)),
            ("width", params.width.into()),
            ("height", params.height.into()),
            ("min_trials", params.min_trials.into()),
            ("max_trials", params.max_trials.into()),
            ("hires_error", serde_json::json!(params.hires_error)),
            ("lores_error", serde_json::json!(params.lores_error)),
            ("time_limit", serde_json::json!(self.time_limit)),
            ("stopped_early", stopped.into()),
        ] {
            map.insert(key.to_owned(), value);
        }
    }

    fn summarise(&self, stats: &Stats, stopped: bool) {
        let outputs: Vec<String> = self.output.iter().map(|p| p.display().to_string()).collect();
        let s = &stats.seconds;
        let e = &stats.error;
        self.talk.say(format!(
            "{}{}: {:.1} s (load {:.1}, simplify {:.1}, build {:.1}, radiosity {:.1}, HIRES {:.1}, LORES {:.1})",
            outputs.join(", "),
            if stopped { " (stopped early, with the trials there were)" } else { "" },
            s.total,
            s.load,
            s.simplify,
            s.build,
            s.radiosity,
            s.hires,
            s.lores
        ));
        let mut errors =
            format!("noise {:.2} % (HIRES {:.2}, LORES {:.2})", 100.0 * e.total, 100.0 * e.hires, 100.0 * e.lores);
        if let (Some(bias), Some(ci)) = (e.bias, e.bias_ci) {
            errors += &format!(", bias of the mean {:+.2} +- {:.2} %", 100.0 * bias, 100.0 * ci);
        }
        if stats.counts.dropped_trials > 0 {
            errors += &format!(", {} trials dropped because they were not finite", stats.counts.dropped_trials);
        }
        self.talk.say(errors);
    }
}

fn stop_on_ctrl_c(progress: &crate::progress::Progress) {
    let progress = progress.clone();
    // Fails only when a handler exists already (several runs in one process): the first one stays.
    let _ = ctrlc::set_handler(move || {
        if progress.stopped() {
            std::process::exit(1);
        }
        progress.stop();
    });
}

/// The run's parameters and errors for the file header.
fn metadata(stats: &Stats, camera: &Camera) -> Metadata {
    let mut metadata = Metadata::new();
    metadata.set("Software", format!("gsii {}", stats.version));
    metadata.set("gsii:camera", camera.name.as_str());
    for (key, value) in &stats.parameters {
        let name = format!("gsii:{key}");
        match (value.as_i64(), value.as_f64(), value.as_str()) {
            (Some(i), _, _) if i32::try_from(i).is_ok() => metadata.set(name, i),
            (_, Some(x), _) => metadata.set(name, x),
            (_, _, Some(text)) => metadata.set(name, text),
            _ => metadata.set(name, value.to_string()),
        }
    }
    let e = &stats.error;
    for (key, value) in [
        ("hires", Some(e.hires)),
        ("lores", Some(e.lores)),
        ("total", Some(e.total)),
        ("radiosity", Some(e.radiosity)),
        ("fit", Some(e.fit)),
        ("bias", e.bias),
        ("bias_ci", e.bias_ci),
    ] {
        if let Some(value) = value {
            metadata.set(format!("gsii:error.{key}"), value);
        }
    }
    metadata
}

fn write_stats(path: &Path, stats: &Stats) -> Result<()> {
    let failed = |error: &dyn std::fmt::Display| Error::Output { path: path.to_owned(), reason: error.to_string() };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = tempfile::NamedTempFile::new_in(folder).map_err(|e| failed(&e))?;
    serde_json::to_writer_pretty(&file, stats).map_err(|e| failed(&e))?;
    file.persist(path).map_err(|e| failed(&e.error))?;
    Ok(())
}

/// Largest resident set of this process so far, bytes; 0 where the system does not tell.
fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}
