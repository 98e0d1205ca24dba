//! `gsii render`: the main job.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use super::frames::{self, FrameOptions};
use super::long::{Checkpoint, LongOptions};
use super::options::{MethodOptions, SceneOptions, Talk, load, set_threads};
use super::output::OutputOptions;
use super::outside::OutsideOptions;
use super::places;
use crate::clock::Stopwatch;
use crate::error::{Error, Result};
use crate::image::Metadata;
use crate::pipeline::identity::identity;
use crate::pipeline::{Method, Prepared, Settings, Stats, choose_camera_among};
use crate::progress::Progress;
use crate::render::checkpoint::LateIdentity;
use crate::render::film::Pixel;
use crate::render::layers::{Layer, develop};
use crate::render::{LEAST_TRIALS, Region, RenderParams, Rendering, Session, WORST_PIXEL, World, bias};
use crate::scene::{Camera, Scene};
use crate::unfinished;

/// Relative error of an image that is aimed at where nothing else is asked for.
const ERROR: f32 = 0.03;

/// An error is missed when it is so many times what was asked for: it is itself known to some per cent.
const MISSED: f64 = 1.1;

/// Relative error of a pixel in the paper.
const PIXEL_ERROR: f32 = 0.05;

/// Pairs of paths that measure the bias when not said otherwise.
const BIAS_SAMPLES: u32 = 1 << 15;

/// Pixels that an image may have each way.
const LARGEST: i64 = 1 << 16;

/// In place of a camera's name: all of them.
const ALL_CAMERAS: &str = "all";

/// One of several parts: `2/4`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PartOf {
    /// From 1.
    number: u32,
    parts: u32,
}

impl FromStr for PartOf {
    type Err = String;

    fn from_str(s: &str) -> std::result::Result<Self, String> {
        let part =
            s.split_once('/').and_then(|(i, n)| Some(PartOf { number: i.parse().ok()?, parts: n.parse().ok()? }));
        part.filter(|p| (1..=p.parts).contains(&p.number) && p.parts <= 1 << 16)
            .ok_or_else(|| "expected I/N with I from 1 to N, as in 2/4 for the second of four parts".to_owned())
    }
}

/// Options of `gsii render`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    pub(super) scene: SceneOptions,
    #[command(flatten)]
    output: OutputOptions,
    /// Width in pixels [default: 1280, or from the height and the camera]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=LARGEST))]
    width: Option<u32>,
    /// Height in pixels [default: from the width and the camera]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=LARGEST))]
    height: Option<u32>,
    /// Render only pixels X0 to X1 - 1 across and Y0 to Y1 - 1 down, counted from the top left, as they are in the whole image
    #[arg(long, value_names = ["X0", "Y0", "X1", "Y1"], num_args = 4, conflicts_with = "tile")]
    crop: Option<Vec<u32>>,
    /// Render only part I (from 1) of N that the image is cut into; 'gsii merge' joins them
    #[arg(long, value_name = "I/N")]
    tile: Option<PartOf>,
    /// Relative error of the image to aim for (root of the mean square over its pixels) [default: 0.03]
    #[arg(long, value_name = "X", help_heading = "Quality")]
    error: Option<f32>,
    /// Relative error of a pixel at which HIRES may stop, as in the paper [default: four times --error]
    #[arg(long, value_name = "X", help_heading = "Quality")]
    hires_error: Option<f32>,
    /// Relative error of a pixel, both passes together, at which LORES may stop, as in the paper [default: four times --error]
    #[arg(long, value_name = "X", help_heading = "Quality")]
    lores_error: Option<f32>,
    /// Fewest trials of a pixel in each pass
    #[arg(long, value_name = "N", default_value_t = LEAST_TRIALS, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Quality")]
    min_trials: u32,
    /// Most trials of a pixel in each pass
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Quality")]
    max_trials: u32,
    /// Fixed sampling: short for --min-trials N --max-trials N (also --samples N)
    #[arg(long, visible_alias = "samples", value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Quality", conflicts_with_all = ["min_trials", "max_trials", "error", "hires_error", "lores_error"])]
    spp: Option<u32>,
    /// Gather indirect light for each pixel by itself, with no interpolation between places: slower, and without its error
    #[arg(long, help_heading = "Quality")]
    per_pixel: bool,
    /// Begin no new trials after this many seconds of rendering; every pixel has its first ones all the same
    #[arg(long, value_name = "SECONDS", help_heading = "Quality")]
    time_limit: Option<f64>,
    /// Pairs of paths that measure the bias; 0 for none
    #[arg(long, value_name = "N", default_value_t = BIAS_SAMPLES, help_heading = "Quality")]
    measure_bias: u32,
    #[command(flatten)]
    pub(super) frames: FrameOptions,
    #[command(flatten)]
    pub(super) outside: OutsideOptions,
    #[command(flatten)]
    pub(super) method: MethodOptions,
    /// Layers to write beside R,G,B where the format has named channels: hires, lores, hires_dev, lores_dev, albedo, normal,
    /// depth, trials, class, cluster, lookup_distance, near_share [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Output")]
    layers: Option<Vec<Layer>>,
    /// Write times, counts, errors and parameters as JSON
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    pub(super) long: LongOptions,
    #[command(flatten)]
    pub(super) talk: Talk,
}

/// Runs the command.
///
/// # Errors
/// Bad options, bad input, a failing library, an image that cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    let start = Stopwatch::start();
    places::check(&options.output.output, [options.stats.as_deref(), options.long.checkpoint()])?;
    options.long.check()?;
    set_threads(options.method.threads)?;
    let progress = options.talk.progress();
    stop_on_ctrl_c(&progress);
    options.warn_of_parts();

    if let Some(range) = options.frames.range() {
        return frames::run(options, range, &progress);
    }
    let mut stats = Stats::new();
    let mut scene = load(&options.scene, &mut stats)?;
    options.outside.surround(&mut scene)?;
    let views = options.views(&scene.name, &scene.cameras)?;
    let params = views.iter().map(|view| options.render_params(&view.camera)).collect::<Result<Vec<_>>>()?;
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera.clone()).collect();
    // Before the preparation, which may take long: a checkpoint of something else is noticed at once.
    let keep = |(view, params)| options.keep(&scene, &cameras, view, params);
    let kept = views.iter().zip(&params).map(keep).collect::<Result<Vec<_>>>()?;
    let prepared = Prepared::for_cameras(scene, &cameras, options.settings(), &progress, &mut stats)?;
    for warning in &stats.warnings {
        log::warn!("{warning}");
    }
    let mut start = Some(start);
    for ((view, params), kept) in views.iter().zip(&params).zip(kept) {
        // Counts of the preparation belong to every view, its time to the first.
        let start = start.take().unwrap_or_else(Stopwatch::start);
        let mut of_view = stats.clone();
        stats = stats.at_no_cost();
        if !options.render_view(&prepared, view, params, kept.as_ref(), start, &progress, &mut of_view)? {
            return Ok(ExitCode::FAILURE);
        }
        if progress.stopped() {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A camera and where its image goes.
pub(super) struct View {
    pub camera: Camera,
    pub outputs: Vec<PathBuf>,
    pub stats: Option<PathBuf>,
    pub checkpoint: Option<PathBuf>,
    /// Number in a sequence; `None` for a single image.
    pub frame: Option<u32>,
}

/// The path with a camera's name before its extension.
fn of_camera(path: &Path, name: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-{name}{extension}"))
}

impl Options {
    /// Whether indirect light is interpolated between places.
    pub(super) fn interpolates(&self) -> bool {
        !self.per_pixel
    }

    fn layers(&self) -> &[Layer] {
        self.layers.as_deref().unwrap_or(&Layer::ALL)
    }

    /// Parts of which none can be joined.
    fn warn_of_parts(&self) {
        let is_exr = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        if self.tile.is_some() && !self.output.output.iter().any(is_exr) {
            log::warn!("'gsii merge' joins EXR files only: with --tile, write one (-o PART.exr)");
        }
    }

    /// The cameras that are asked for, of those that a scene has. With several, their names are in those of the files.
    pub(super) fn views(&self, scene: &str, cameras: &[Camera]) -> Result<Vec<View>> {
        if self.scene.camera.as_deref() != Some(ALL_CAMERAS) {
            let camera = choose_camera_among(scene, cameras, self.scene.camera.as_deref())?.clone();
            let checkpoint = self.long.checkpoint().map(Path::to_owned);
            return Ok(vec![View {
                camera,
                outputs: self.output.output.clone(),
                stats: self.stats.clone(),
                checkpoint,
                frame: None,
            }]);
        }
        let harmless = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let mut names: Vec<String> = Vec::new();
        let mut views = Vec::new();
        for (number, camera) in cameras.iter().enumerate() {
            let mut name: String = camera.name.chars().map(harmless).collect();
            if name.is_empty() || names.contains(&name) {
                name = format!("{name}{number}");
            }
            let outputs: Vec<PathBuf> = self.output.output.iter().map(|path| of_camera(path, &name)).collect();
            let stats = self.stats.as_ref().map(|path| of_camera(path, &name));
            let checkpoint = self.long.checkpoint().map(|path| of_camera(path, &name));
            places::check(&outputs, [stats.as_deref(), checkpoint.as_deref()])?;
            views.push(View { camera: camera.clone(), outputs, stats, checkpoint, frame: None });
            names.push(name);
        }
        Ok(views)
    }

    /// Where the rendering of a view is kept while it is not finished; `cameras` are those that the scene is prepared for.
    pub(super) fn keep(
        &self,
        scene: &Arc<Scene>,
        cameras: &[Camera],
        view: &View,
        params: &RenderParams,
    ) -> Result<Option<Checkpoint>> {
        let (scene, settings, params) = (Arc::clone(scene), self.settings(), params.clone());
        let (cameras, camera) = (cameras.to_vec(), view.camera.clone());
        let identity = LateIdentity::new(move || identity(&scene, &cameras, &camera, &settings, &params));
        self.long.keep(&view.outputs[0], view.checkpoint.as_deref(), identity)
    }

    /// Renders and writes one view. False when it was stopped too early for that: before the first trial, or in the midst of a
    /// sequence, where what is written counts as finished.
    #[expect(clippy::too_many_arguments, reason = "all that a run has")]
    pub(super) fn render_view(
        &self,
        prepared: &Prepared,
        view: &View,
        params: &RenderParams,
        kept: Option<&Checkpoint>,
        start: Stopwatch,
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<bool> {
        let camera = &view.camera;
        let session = self.long.session(kept, params)?;
        let rendering = {
            let mut stats = stats.clone();
            let write = |session: &Session| self.write_partial(session, view, params, &mut stats);
            let mut watchers = self.long.watchers(&view.outputs[0], kept, write);
            prepared.resume(camera, params, session, progress, Some(&mut watchers))
        };
        stats.record_rendering(&rendering);
        if let Some(cache) = rendering.cache.as_deref().or(prepared.world().cache) {
            stats.record_interpolation(cache, &rendering.film);
        }
        let advice = kept.map_or_else(String::new, Checkpoint::advice);
        let when = match view.frame {
            Some(frame) if progress.stopped() => Some(format!("in frame {frame}")),
            _ if rendering.film.pixels().all(|p| p.hires.trials() == 0) => Some("before the first trial".to_owned()),
            _ => None,
        };
        if let Some(when) = when {
            self.talk.say(format!("gsii: stopped {when}; no image was written{advice}"));
            return Ok(false);
        }
        self.measure_bias(prepared, camera, params, &rendering, stats);
        self.record_parameters(camera, params, rendering.stopped, stats)?;
        let written = Stopwatch::start();
        let developed = develop(&rendering.film, self.layers());
        self.output.write(&view.outputs, &developed, &metadata(stats))?;
        stats.record_time(written, |s| &mut s.write);
        stats.record_time(start, |s| &mut s.total);
        stats.peak_rss_bytes = peak_rss_bytes();
        if let Some(path) = &view.stats {
            write_stats(path, stats)?;
        }
        if let Some(kept) = kept.filter(|_| !rendering.stopped) {
            kept.remove()?;
        }
        self.summarise(&view.outputs, params, stats, rendering.stopped.then_some(advice.as_str()));
        self.say_what_is_missing(&rendering, params, stats);
        Ok(true)
    }

    /// Writes the images of a rendering that is not finished.
    fn write_partial(&self, session: &Session, view: &View, params: &RenderParams, stats: &mut Stats) -> Result<()> {
        let film = session.film();
        stats.record_film(&film);
        self.record_parameters(&view.camera, params, true, stats)?;
        let developed = develop(&film, self.layers());
        self.output.write(&view.outputs, &developed, &metadata(stats))
    }

    /// Whether the paper's rule alone decides: where one of its errors is named.
    fn is_by_pixel(&self) -> bool {
        self.error.is_none() && (self.hires_error.is_some() || self.lores_error.is_some())
    }

    /// Error of the image that trials are planned for; infinite for none.
    fn asked_error(&self) -> f32 {
        if self.is_by_pixel() || self.spp.is_some() { f32::INFINITY } else { self.error.unwrap_or(ERROR) }
    }

    /// What the scene is prepared with.
    pub(super) fn settings(&self) -> Settings {
        Settings { radiosity_error: Settings::radiosity_error_for(self.asked_error()), ..self.method.settings() }
    }

    pub(super) fn render_params(&self, camera: &Camera) -> Result<RenderParams> {
        let aspect = camera.aspect.unwrap_or(16.0 / 9.0);
        let (width, height) = match (self.width, self.height) {
            (Some(w), Some(h)) => (w, h),
            (Some(w), None) => (w, (w as f32 / aspect).round().max(1.0) as u32),
            (None, Some(h)) => ((h as f32 * aspect).round().max(1.0) as u32, h),
            (None, None) => (1280, (1280.0 / aspect).round().max(1.0) as u32),
        };
        let error = self.asked_error();
        let worst = if self.is_by_pixel() { PIXEL_ERROR } else { WORST_PIXEL * error };
        let (hires_error, lores_error) = (self.hires_error.unwrap_or(worst), self.lores_error.unwrap_or(worst));
        let (min_trials, max_trials) = self.spp.map_or((self.min_trials, self.max_trials), |n| (n, n));
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if i64::from(width.max(height)) > LARGEST {
            return refuse(&format!(
                "an image of {width} x {height} pixels, as the camera's shape makes it, is too large: {LARGEST} at most each way"
            ));
        }
        if min_trials > max_trials {
            return refuse(&format!("--min-trials {min_trials} is more than --max-trials {max_trials}"));
        }
        if !(error > 0.0 && hires_error > 0.0 && lores_error > 0.0) {
            return refuse("--error, --hires-error and --lores-error must be above 0 (0.05 is 5 %)");
        }
        if self.time_limit.is_some_and(|t| !(t > 0.0 && t < 1e9)) {
            return refuse("--time-limit must be a number of seconds above 0");
        }
        Ok(RenderParams {
            width,
            height,
            region: self.region([width, height])?,
            min_trials,
            max_trials,
            error,
            hires_error,
            lores_error,
            time_limit: self.time_limit.map(Duration::from_secs_f64),
            features: self.layers().iter().any(|l| l.is_feature()),
            interpolate: !self.per_pixel,
            seed: self.method.seed,
            frame: None,
        })
    }

    /// The part of an image of `size` to render, where not all of it.
    fn region(&self, size: [u32; 2]) -> Result<Option<Region>> {
        if let Some(&[x0, y0, x1, y1]) = self.crop.as_deref() {
            if x0 >= x1 || y0 >= y1 || x1 > size[0] || y1 > size[1] {
                return Err(Error::Usage(format!(
                    "--crop {x0} {y0} {x1} {y1} is no part of an image of {} x {} pixels: X0 < X1 <= {0} and Y0 < Y1 <= {1} are needed",
                    size[0], size[1]
                )));
            }
            return Ok(Some(Region { low: [x0, y0], high: [x1, y1] }));
        }
        let Some(PartOf { number, parts }) = self.tile else { return Ok(None) };
        Region::part(number - 1, parts, size).map(Some).ok_or_else(|| {
            Error::Usage(format!(
                "--tile {number}/{parts}: an image of {} x {} pixels has not so many parts",
                size[0], size[1]
            ))
        })
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
        let start = Stopwatch::start();
        let world = prepared.world();
        let world = World { cache: rendering.cache.as_deref().or(world.cache), ..world };
        let bias = bias::measure(&world, camera, params, self.measure_bias);
        stats.record_bias(&bias, &rendering.film);
        stats.record_time(start, |s| &mut s.bias);
    }

    fn record_parameters(
        &self,
        camera: &Camera,
        params: &RenderParams,
        stopped: bool,
        stats: &mut Stats,
    ) -> Result<()> {
        let map = &mut stats.parameters;
        for (key, value) in [
            ("scene", serde_json::json!(self.scene.scene.display().to_string())),
            ("camera", camera.name.as_str().into()),
            ("width", params.width.into()),
            ("height", params.height.into()),
            ("min_trials", params.min_trials.into()),
            ("max_trials", params.max_trials.into()),
            ("error", serde_json::json!(params.error)),
            ("hires_error", serde_json::json!(params.hires_error)),
            ("lores_error", serde_json::json!(params.lores_error)),
            ("time_limit", serde_json::json!(self.time_limit)),
            ("stopped_early", stopped.into()),
        ] {
            map.insert(key.to_owned(), value);
        }
        if let Some(Region { low: [x0, y0], high: [x1, y1] }) = params.region {
            map.insert("region".to_owned(), format!("{x0} {y0} {x1} {y1}").into());
        }
        self.frames.record(params.frame, map);
        self.outside.record(map)
    }

    /// `stopped` says what can be done about it.
    fn summarise(&self, outputs: &[PathBuf], params: &RenderParams, stats: &Stats, stopped: Option<&str>) {
        let s = &stats.seconds;
        let e = &stats.error;
        self.talk.say(format!(
            "{}{}: {:.1} s (load {:.1}, simplify {:.1}, build {:.1}, radiosity {:.1}, HIRES {:.1}, LORES {:.1}, bias meter {:.1})",
            places::names(outputs),
            stopped.map_or_else(String::new, |advice| format!(" (stopped early, with the trials there were{advice})")),
            s.total,
            s.load,
            s.simplify,
            s.build,
            s.radiosity,
            s.hires,
            s.lores,
            s.bias
        ));
        let mut errors = if params.max_trials == 1 {
            "noise not known from one trial a pixel".to_owned()
        } else {
            format!("noise {:.2} % (HIRES {:.2}, LORES {:.2})", 100.0 * e.total, 100.0 * e.hires, 100.0 * e.lores)
        };
        if let Some(interpolation) = e.interpolation {
            errors += &format!(", interpolation {:.2} %, together {:.2} %", 100.0 * interpolation, 100.0 * e.image);
        }
        if let (Some(bias), Some(ci)) = (e.bias, e.bias_ci) {
            errors += &format!(", bias of the mean {:+.2} +- {:.2} %", 100.0 * bias, 100.0 * ci);
        }
        if stats.counts.dropped_trials > 0 {
            errors += &format!(", {} trials dropped because they were not finite", stats.counts.dropped_trials);
        }
        self.talk.say(errors);
    }

    /// Where the error that was asked for was not reached because pixels may not have more trials.
    fn say_what_is_missing(&self, rendering: &Rendering, params: &RenderParams, stats: &Stats) {
        let missed = stats.error.total > MISSED * f64::from(params.error);
        if rendering.stopped || !missed {
            return;
        }
        let most = |p: &Pixel| p.hires.trials().max(p.lores.trials()) >= params.max_trials;
        let (ended, all) = (rendering.film.pixels().filter(|p| most(p)).count(), rendering.film.pixels().count());
        let percent = 100.0 * ended as f64 / all as f64;
        if percent >= 1.0 {
            self.talk.say(format!(
                "{:.0} % of the pixels had all {} trials before the image came to the {} % asked for: --max-trials N for more",
                percent, params.max_trials, 100.0 * params.error
            ));
        }
    }
}

/// The first Ctrl-C ends the work at the next good moment, the second one at once.
pub(super) fn stop_on_ctrl_c(progress: &Progress) {
    let progress = progress.clone();
    // Fails only when a handler exists already (several runs in one process): the first one stays.
    let _ = ctrlc::set_handler(move || {
        if progress.stopped() {
            unfinished::remove_all();
            std::process::exit(1);
        }
        progress.stop();
    });
}

/// The run's parameters and errors for the file header.
fn metadata(stats: &Stats) -> Metadata {
    let mut metadata = Metadata::new();
    metadata.set("Software", format!("gsii {}", stats.version));
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
        ("interpolation", e.interpolation),
        ("image", Some(e.image)),
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
    unfinished::write(path, |file| Ok(serde_json::to_writer_pretty(file, stats)?))
}

/// Largest resident set of this process so far, bytes; 0 where the system does not tell.
fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}
