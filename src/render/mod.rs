//! Both render passes: HIRES (what the eye sees sharply) and LORES (indirect light), in one wavefront.

pub mod bias;
pub mod cache;
pub mod film;
pub mod integrator;
pub mod layers;
pub mod nearness;
pub mod path;
pub mod plan;
pub mod show;
pub mod tally;
pub mod view;
pub mod workspace;

use std::time::{Duration, Instant};

use rayon::prelude::*;

pub use cache::IrradianceCache;
use film::Tile;
pub use film::{Film, Region};
use integrator::Batch;
pub use integrator::{FarField, World};
pub use nearness::Nearness;
use path::Passes;
use plan::Allocation;
pub use tally::{PassTimes, RayCounts};
pub use workspace::Workspace;

use crate::clock::Stopwatch;
use crate::progress::Progress;
use crate::sampling::hash_all;
use crate::scene::Camera;

/// Trials of one pixel that are traced as one batch; a tile of these fills the second-level cache.
pub const BATCH_TRIALS: u32 = 16;

/// Keeps the pilot's random numbers apart from the image's.
const PILOT: u32 = 0x7069_6c6f;

/// Keeps the trials of frames apart.
const FRAME: u32 = 0x6672_616d;

/// Parameters of [`render`].
#[derive(Clone, Debug, PartialEq)]
pub struct RenderParams {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The part of the image to render; `None` for all of it. Pixels have the same bits as in the whole image.
    pub region: Option<Region>,
    /// Fewest trials of a pixel in each pass.
    pub min_trials: u32,
    /// Most trials of a pixel in each pass; equal to `min_trials` for fixed sampling.
    pub max_trials: u32,
    /// Relative standard error of a pixel at which HIRES stops.
    pub hires_error: f32,
    /// Relative standard error of a pixel, both passes together, at which LORES stops.
    pub lores_error: f32,
    /// Seconds after which no new trials are begun.
    pub time_limit: Option<Duration>,
    /// Whether to record albedo, normal and depth.
    pub features: bool,
    /// Whether indirect light is interpolated between places (see [`cache`]), for GSII.
    pub interpolate: bool,
    /// Seed: the same seed gives the same image, bit for bit, for any number of threads.
    pub seed: u32,
    /// Number in a sequence of frames; `None` for a single image. Frames have independent noise, and everything else in common.
    pub frame: Option<u32>,
}

impl RenderParams {
    /// The part of the image that is rendered.
    pub fn region(&self) -> Region {
        self.region.unwrap_or(Region::whole([self.width, self.height]))
    }

    /// Seed of the trials.
    fn trial_seed(&self) -> u32 {
        self.frame.map_or(self.seed, |frame| hash_all(&[self.seed, FRAME, frame]))
    }

    /// An empty film of that part.
    pub fn film(&self) -> Film {
        Film::of(self.region(), [self.width, self.height])
    }
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The image.
    pub film: Film,
    /// Rays traced.
    pub rays: RayCounts,
    /// Wall-clock time of both passes, shared out by the time that threads spent in them; the pilot is in both.
    pub times: PassTimes,
    /// The same for the time of all cores together.
    pub cpu_times: PassTimes,
    /// Whether it was stopped before all planned trials were done.
    pub stopped: bool,
    /// What indirect light was interpolated from, where the world did not bring it.
    pub cache: Option<IrradianceCache>,
}

/// What [`render_rounds`] shows after each round.
#[derive(Clone, Copy, Debug)]
pub struct Round<'a> {
    /// The image so far.
    pub film: &'a Film,
    /// Trials of each pixel and pass in it.
    pub trials: u32,
    /// Rays traced so far.
    pub rays: RayCounts,
    /// Time that threads spent in the passes so far.
    pub times: PassTimes,
}

/// Renders with the same number of trials for every pixel in rounds that double it, from `min_trials` to `max_trials`, and shows
/// `watch` the image after each; it says whether to go on. The image after `n` trials is the one that [`render()`] makes with fixed
/// sampling of `n`, so one run gives the whole curve of error against time.
pub fn render_rounds(
    world: &World<'_>,
    camera: &Camera,
    params: &RenderParams,
    progress: &Progress,
    watch: &mut dyn FnMut(&Round<'_>) -> bool,
) {
    let over = || progress.stopped();
    let cache = irradiance_cache(world, camera, params, progress, &over);
    let world = &World { cache: cache.as_ref().or(world.cache), ..*world };
    let mut renderer = Renderer::new(world, camera, params);
    let mut film = params.film();
    let plan = vec![Allocation::even(params.max_trials); film.tiles.len()];
    let bar =
        progress.stage("rendering", u64::from(params.max_trials) * u64::from(params.width) * u64::from(params.height));
    renderer.rounds(&mut film, &plan, &over, &|n| bar.inc(n), watch);
    bar.finish_and_clear();
}

/// Renders an image.
///
/// A pilot estimates the variance around each tile and decides how many trials each pass gets there; its trials are thrown
/// away. Deciding on trials that are kept would bias the image towards dark (see `docs/method.md`).
pub fn render(world: &World<'_>, camera: &Camera, params: &RenderParams, progress: &Progress) -> Rendering {
    let start = Stopwatch::start();
    let deadline = params.time_limit.map(|limit| Instant::now() + limit);
    let over = || progress.stopped() || deadline.is_some_and(|d| Instant::now() >= d);
    let cache = irradiance_cache(world, camera, params, progress, &over);
    let filled = start.spent();
    let world = &World { cache: cache.as_ref().or(world.cache), ..*world };
    let mut renderer = Renderer::new(world, camera, params);

    let mut film = params.film();
    let plan = if params.min_trials == params.max_trials {
        vec![Allocation::even(params.min_trials); film.tiles.len()]
    } else {
        let mut pilot = plan::pilot_tiles(params.region(), params);
        let trials = plan::pilot_trials(params);
        let all = vec![Allocation::even(trials); pilot.len()];
        renderer.round(&mut pilot, &all, 0..trials, hash_all(&[params.seed, PILOT]), &over, &|_| {});
        plan::allocate(&pilot, &film, params)
    };

    let planned: u64 = plan.iter().zip(&film.tiles).map(|(a, t)| u64::from(a.most()) * t.pixels.len() as u64).sum();
    let bar = progress.stage("rendering", planned);
    let stopped = renderer.rounds(&mut film, &plan, &over, &|n| bar.inc(n), &mut |_| true);
    bar.finish_and_clear();
    let spent = start.spent();
    let times = renderer.times.after_cache(spent.wall_duration(), filled.wall_duration());
    let cpu_times = renderer.times.after_cache(spent.cpu_duration(), filled.cpu_duration());
    Rendering { film, rays: renderer.rays, times, cpu_times, stopped, cache }
}

/// Places that indirect light is interpolated between, where that is wanted, the world brings none, and there is a far field beyond a
/// near one.
fn irradiance_cache(
    world: &World<'_>,
    camera: &Camera,
    params: &RenderParams,
    progress: &Progress,
    over: &(dyn Fn() -> bool + Sync),
) -> Option<IrradianceCache> {
    let wanted = params.interpolate && world.cache.is_none() && world.has_two_fields();
    let stage = progress.stage("irradiance cache", 0);
    let size = [params.width, params.height];
    let cache = wanted.then(|| IrradianceCache::new(world, camera, size, params.seed, over));
    stage.finish_and_clear();
    cache
}

struct Renderer<'a> {
    world: &'a World<'a>,
    camera: &'a Camera,
    params: &'a RenderParams,
    rays: RayCounts,
    times: PassTimes,
}

impl<'a> Renderer<'a> {
    fn new(world: &'a World<'a>, camera: &'a Camera, params: &'a RenderParams) -> Self {
        Renderer { world, camera, params, rays: RayCounts::default(), times: PassTimes::default() }
    }

    /// Carries out a plan in rounds. They double, so that there is a whole image early and prefixes of the point sets stay well
    /// distributed. Returns whether it was cut short.
    fn rounds(
        &mut self,
        film: &mut Film,
        plan: &[Allocation],
        over: &(dyn Fn() -> bool + Sync),
        advance: &(dyn Fn(u64) + Sync),
        watch: &mut dyn FnMut(&Round<'_>) -> bool,
    ) -> bool {
        let most = plan.iter().map(Allocation::most).max().unwrap_or(0);
        let mut done = 0;
        while done < most {
            let next = (2 * done).max(self.params.min_trials.max(1)).min(most);
            if self.round(&mut film.tiles, plan, done..next, self.params.trial_seed(), over, advance) {
                return true;
            }
            done = next;
            if !watch(&Round { film, trials: done, rays: self.rays, times: self.times }) {
                break;
            }
        }
        false
    }

    /// Adds the trials with numbers in `range` to every tile whose allocation has them. Returns whether it was cut short.
    fn round(
        &mut self,
        tiles: &mut [Tile],
        plan: &[Allocation],
        range: std::ops::Range<u32>,
        seed: u32,
        over: &(dyn Fn() -> bool + Sync),
        advance: &(dyn Fn(u64) + Sync),
    ) -> bool {
        let size = [self.params.width, self.params.height];
        let (world, camera, features) = (self.world, self.camera, self.params.features);
        let work = tiles.par_iter_mut().zip(plan).map_init(Workspace::default, |ws, (tile, allocation)| {
            (ws.counts, ws.times) = Default::default();
            let mut cut = false;
            for (trials, passes) in allocation.segments(range.clone()) {
                let mut first = trials.start;
                while first < trials.end {
                    if over() {
                        cut = true;
                        break;
                    }
                    let count = BATCH_TRIALS.min(trials.end - first);
                    let batch = Batch { first, trials: count, passes, seed };
                    world.render_tile(ws, camera, size, batch, features && passes.hires, tile);
                    advance(u64::from(count) * tile.pixels.len() as u64);
                    first += count;
                }
            }
            (ws.counts, ws.times, cut)
        });
        let (rays, times, cut) = work.reduce(
            || (RayCounts::default(), PassTimes::default(), false),
            |mut a, b| {
                a.0 += b.0;
                a.1 += b.1;
                (a.0, a.1, a.2 | b.2)
            },
        );
        self.rays += rays;
        self.times += times;
        cut
    }
}

impl Allocation {
    /// The parts of a range of trial numbers that this allocation has, and the passes they feed.
    fn segments(&self, range: std::ops::Range<u32>) -> impl Iterator<Item = (std::ops::Range<u32>, Passes)> + use<> {
        let both = self.hires.min(self.lores);
        let single = if self.hires > self.lores { Passes::HIRES } else { Passes::LORES };
        [(range.start..range.end.min(both), Passes::BOTH), (range.start.max(both)..range.end.min(self.most()), single)]
            .into_iter()
            .filter(|(r, _)| !r.is_empty())
    }
}
