//! Both render passes: HIRES (what the eye sees sharply) and LORES (indirect light), in one wavefront.

pub mod bias;
pub mod cache;
pub mod caustics;
pub mod checkpoint;
pub mod film;
pub mod integrator;
pub mod layers;
pub mod look_up;
pub mod nearness;
pub mod path;
pub mod plan;
pub mod rare;
mod rounds;
pub mod session;
pub mod show;
pub mod tally;
pub mod view;
pub mod watch;
pub mod workspace;
pub mod world;

use std::sync::Arc;
use std::time::{Duration, Instant};

pub use cache::IrradianceCache;
pub use caustics::Caustics;
pub use film::{Film, Region};
pub use nearness::Nearness;
use plan::Plan;
use rounds::{Renderer, doubling, fill_cache};
pub use session::Session;
use session::SharedTiles;
use tally::Tally;
pub use tally::{PassTimes, RayCounts};
pub use watch::{Moment, Watcher};
pub use workspace::Workspace;
pub use world::{FarField, World};

use crate::progress::Progress;
use crate::sampling::hash_all;
use crate::scene::Camera;

/// Trials of one pixel that are traced as one batch; a tile of these fills the second-level cache.
pub const BATCH_TRIALS: u32 = 16;

/// How much larger the error of single pixels may be than that of the image: what is left of noise is grain, not specks.
pub const WORST_PIXEL: f32 = 4.0;

/// Fewest trials of a pixel where nothing else is asked for.
pub const LEAST_TRIALS: u32 = 4;

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
    /// Relative standard error of the image that trials are planned for: the root of the mean over pixels of its square. Infinite for
    /// none.
    pub error: f32,
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
    /// Number in a sequence of frames; `None` for a single image. Frames have independent noise, and the rest in common.
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
    /// Wall-clock time of both passes, shared out by the time that threads spent in them.
    pub times: PassTimes,
    /// The same for the time of all cores together.
    pub cpu_times: PassTimes,
    /// Whether it was stopped before all planned trials were done.
    pub stopped: bool,
    /// What indirect light was interpolated from, where the world did not bring it.
    pub cache: Option<Arc<IrradianceCache>>,
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
    let stopped = || progress.stopped();
    let mut cache = IrradianceCache::default();
    if wants_cache(world, params) && !cache.fill(world, camera, params, &stopped, &mut |_| {}) {
        return;
    }
    let world = &World { cache: wants_cache(world, params).then_some(&cache).or(world.cache), ..*world };
    let renderer = Renderer { world, camera, params, stopped: &stopped, late: &|| false };
    let mut film = params.film();
    let plan = Plan::even(params.max_trials, film.tiles.iter());
    let bar =
        progress.stage("rendering", u64::from(params.max_trials) * u64::from(params.width) * u64::from(params.height));
    for range in doubling(params.min_trials, params.max_trials) {
        let tiles = SharedTiles::new(std::mem::take(&mut film.tiles));
        let complete = renderer.round(&tiles, &plan.allocations, range.end, &|n| bar.inc(n));
        let Tally { rays, times } = tiles.tally();
        film.tiles = tiles.into_tiles();
        if !complete || !watch(&Round { film: &film.clone().shared(), trials: range.end, rays, times }) {
            break;
        }
    }
    bar.finish_and_clear();
}

/// Renders an image.
///
/// The first trials of the pixels around each pixel decide how many trials each pass gets there; its own have no part in that, which would
/// bias the image towards dark (see `docs/method.md`).
pub fn render(world: &World<'_>, camera: &Camera, params: &RenderParams, progress: &Progress) -> Rendering {
    resume(world, camera, params, Session::new(params), progress, None)
}

/// Goes on with a rendering while `watcher` looks at it. The finished image has the bits of [`render()`]'s, whatever the session
/// went through: it must be one of the same world, camera and parameters (but for the time limit).
pub fn resume(
    world: &World<'_>,
    camera: &Camera,
    params: &RenderParams,
    mut session: Session,
    progress: &Progress,
    mut watcher: Option<&mut dyn Watcher>,
) -> Rendering {
    let deadline = params.time_limit.map(|limit| Instant::now() + limit);
    let late = || deadline.is_some_and(|d| Instant::now() >= d);
    let stopped = || progress.stopped();
    let interpolates = wants_cache(world, params);
    let mut complete = !stopped();
    if interpolates {
        complete = complete && fill_cache(&mut session, world, camera, params, progress, &stopped, &mut watcher);
    }
    let cache = interpolates.then(|| Arc::clone(&session.cache));
    let world = &World { cache: cache.as_deref().or(world.cache), ..*world };
    let renderer = Renderer { world, camera, params, stopped: &stopped, late: &late };
    complete = complete && renderer.plan(&mut session, progress, &mut watcher);
    complete = complete && renderer.expose(&session, progress, &mut watcher);
    if let Some(watcher) = watcher {
        watcher.look(&session, if complete { Moment::Finished } else { Moment::Stopped });
    }
    session.into_rendering(cache, !complete)
}

/// Whether places are needed that indirect light is interpolated between: where that is wanted, the world brings none, and there is
/// a far field beyond a near one.
fn wants_cache(world: &World<'_>, params: &RenderParams) -> bool {
    params.interpolate && world.cache.is_none() && world.has_two_fields()
}
