//! The stages of a rendering: irradiance cache, first trials and a plan, and the film in rounds that double its trials.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::film::Tile;
use super::integrator::LEARN_FROM;
use super::path::Passes;
use super::plan::{self, Allocation, Plan};
use super::session::{Session, SharedTiles};
use super::tally::Tally;
use super::watch::{Moment, Watcher, watched};
use super::workspace::Workspace;
use super::world::{Batch, World};
use super::{BATCH_TRIALS, IrradianceCache, RenderParams};
use crate::clock::Stopwatch;
use crate::progress::Progress;
use crate::scene::Camera;

/// Paths of a tile that are traced as one batch where few of its pixels want more trials.
const FEW_PATHS: u32 = 256;

/// Numbers of trials in rounds that double from `first` to `most`, so that there is a whole image early and prefixes of the point
/// sets stay well distributed.
pub(super) fn doubling(first: u32, most: u32) -> impl Iterator<Item = Range<u32>> {
    let next = move |done: u32| (done < most).then(|| done..done.saturating_mul(2).max(first.max(1)).min(most));
    std::iter::successors(next(0), move |range| next(range.end))
}

/// Fills the irradiance cache of a session. False when it was cut short: the records that are there are kept.
pub(super) fn fill_cache(
    session: &mut Session,
    world: &World<'_>,
    camera: &Camera,
    params: &RenderParams,
    progress: &Progress,
    stopped: &(dyn Fn() -> bool + Sync),
    watcher: &mut Option<&mut dyn Watcher>,
) -> bool {
    let stage = progress.stage("irradiance cache", 0);
    let before = session.filling;
    let start = Stopwatch::start();
    let mut cache = IrradianceCache::clone(&session.cache);
    let keep = |session: &mut Session, cache: &IrradianceCache| {
        session.cache = Arc::new(cache.clone());
        session.filling = before;
        session.filling += start.spent();
    };
    let complete = cache.fill(world, camera, params, stopped, &mut |cache| {
        if let Some(watcher) = watcher.as_deref_mut().filter(|w| w.wait().is_zero()) {
            keep(session, cache);
            watcher.look(session, Moment::Meanwhile);
        }
    });
    keep(session, &cache);
    stage.finish_and_clear();
    complete
}

/// Traces the trials of tiles.
pub(super) struct Renderer<'a> {
    pub world: &'a World<'a>,
    pub camera: &'a Camera,
    pub params: &'a RenderParams,
    /// Says when the work is to end.
    pub stopped: &'a (dyn Fn() -> bool + Sync),
    /// Says when the time for it is over: every tile has its first trials all the same, so that there is an image.
    pub late: &'a (dyn Fn() -> bool + Sync),
}

impl Renderer<'_> {
    /// Decides how many trials each pixel of the film gets, where the session has not: by the first trials, if they may differ. False
    /// when it was cut short.
    pub fn plan(&self, session: &mut Session, progress: &Progress, watcher: &mut Option<&mut dyn Watcher>) -> bool {
        let params = self.params;
        if session.plan.is_some() {
            return true;
        }
        if params.min_trials == params.max_trials {
            session.plan = Some(Plan::even(params.min_trials, params.film().tiles.iter()));
            return true;
        }
        if session.others.is_empty() {
            session.others = SharedTiles::new(plan::other_tiles(params.region(), params));
        }
        let first = plan::first_trials(params);
        let weigh = |tiles: &SharedTiles, trials: fn(&Tile, u32) -> u32| -> u64 {
            tiles.iter().map(|tile| u64::from(trials(&tile, first)) * tile.pixels.len() as u64).sum()
        };
        let weigh_all = |trials| weigh(&session.tiles, trials) + weigh(&session.others, trials);
        let bar = progress.stage("first trials", weigh_all(|_, first| first));
        bar.inc(weigh_all(|tile, first| tile.next.min(first)));
        bar.reset_eta();
        let round = |tiles: &SharedTiles| {
            let all = Plan::even(first, tiles.to_vec().iter());
            self.round(tiles, &all.allocations, first, &|n| bar.inc(n))
        };
        let complete = watched(session, watcher, || round(&session.tiles) && round(&session.others));
        bar.finish_and_clear();
        if complete {
            let others = std::mem::take(&mut session.others);
            let tally = others.tally();
            let allocations = plan::allocate(&session.tiles.to_vec(), &others.into_tiles(), params);
            session.plan = Some(Plan { allocations, others: tally });
        }
        complete
    }

    /// Carries out the plan of a session. False when it was cut short.
    pub fn expose(&self, session: &Session, progress: &Progress, watcher: &mut Option<&mut dyn Watcher>) -> bool {
        let Some(plan) = &session.plan else { return false };
        let trials = |all: &[Allocation], limit: u32| all.iter().map(|a| u64::from(a.most().min(limit))).sum::<u64>();
        let tiles = || plan.allocations.iter().zip(session.tiles.iter());
        let bar = progress.stage("rendering", tiles().map(|(all, _)| trials(all, u32::MAX)).sum());
        bar.inc(tiles().map(|(all, tile)| trials(all, tile.next)).sum());
        bar.reset_eta();
        let most = plan.allocations.iter().flatten().map(Allocation::most).max().unwrap_or(0);
        let round = |range: Range<u32>| self.round(&session.tiles, &plan.allocations, range.end, &|n| bar.inc(n));
        let complete = watched(session, watcher, || doubling(BATCH_TRIALS, most).all(round));
        bar.finish_and_clear();
        complete
    }

    /// Adds the planned trials with numbers below `end` to every tile, but for those that it has already. False when it was cut
    /// short.
    pub fn round(
        &self,
        tiles: &SharedTiles,
        plan: &[Vec<Allocation>],
        end: u32,
        advance: &(dyn Fn(u64) + Sync),
    ) -> bool {
        let size = [self.params.width, self.params.height];
        let work = |ws: &mut Workspace, (number, plan): (usize, &Vec<Allocation>)| {
            // Others look at the tile meanwhile: what is worked on is a copy.
            let mut tile = tiles.get(number).clone();
            while let Some(slice) = Slice::next(plan, tile.next, end) {
                if (self.stopped)() || tile.next > 0 && (self.late)() {
                    return false;
                }
                if tile.next > 0 && lesson_after(tile.next - 1) == tile.next {
                    tile.guide.learn();
                }
                (ws.counts, ws.times) = Default::default();
                for (passes, pixels) in &slice.pixels {
                    let (first, trials, seed) = (tile.next, slice.trials, self.params.trial_seed());
                    let features = self.params.features && passes.hires;
                    let batch = Batch { pixels, first, trials, passes: *passes, features, seed };
                    self.world.render_tile(ws, self.camera, size, batch, &mut tile);
                    advance(u64::from(slice.trials) * pixels.len() as u64);
                }
                tile.next += slice.trials;
                tile.tally += Tally { rays: ws.counts, times: ws.times };
                tiles.get(number).clone_from(&tile);
            }
            true
        };
        let numbered = (0..tiles.len()).into_par_iter().zip(plan);
        // Every tile gets its turn, also when it is over: then they end at once.
        numbered.map_init(Workspace::default, work).reduce(|| true, |a, b| a && b)
    }
}

/// The number of trials at which a tile that has `trials` next learns where light is: they double, whatever is planned.
fn lesson_after(trials: u32) -> u32 {
    (trials + 1).max(LEARN_FROM).next_power_of_two()
}

/// The next trials of a tile: as many for all of its pixels that want any.
struct Slice {
    trials: u32,
    /// The pixels that feed both passes, HIRES alone and LORES alone.
    pixels: [(Passes, Vec<u32>); 3],
}

impl Slice {
    /// From trial `first` on, at most up to `end`; `None` when no pixel wants more.
    fn next(plan: &[Allocation], first: u32, end: u32) -> Option<Slice> {
        let with = |passes: Passes| {
            let wants = move |a: &Allocation| {
                Passes { hires: a.hires > first, lores: a.lores > first } == passes && first < end
            };
            let pixels: Vec<u32> = (0..).zip(plan).filter(|(_, a)| wants(a)).map(|(i, _)| i).collect();
            (passes, pixels)
        };
        let pixels = [Passes::BOTH, Passes::HIRES, Passes::LORES].map(with);
        let count: u32 = pixels.iter().map(|(_, list)| list.len() as u32).sum();
        let end = end.min(lesson_after(first));
        // No pixel is to be overtaken by the limits of its passes.
        let limits = plan.iter().flat_map(|a| [a.hires, a.lores]).filter(|&limit| limit > first);
        let limit = limits.min().unwrap_or(first).min(end);
        (count > 0).then(|| {
            let trials = BATCH_TRIALS.max((FEW_PATHS / count).next_multiple_of(BATCH_TRIALS));
            Slice { trials: trials.min(limit - first), pixels }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_double_and_cover_every_trial_once() {
        for (first, most) in [(1, 1), (16, 16), (16, 512), (2, 100), (16, 5), (24, 4_000_000_000)] {
            let rounds: Vec<Range<u32>> = doubling(first, most).collect();
            assert_eq!((rounds[0].start, rounds[0].end), (0, first.min(most)));
            assert_eq!(rounds.last().map(|r| r.end), Some(most));
            for pair in rounds.windows(2) {
                assert_eq!(pair[1].start, pair[0].end);
                assert!(pair[1].end == 2 * pair[0].end || pair[1].end == most);
            }
        }
        assert_eq!(doubling(16, 0).count(), 0);
    }

    #[test]
    fn slices_bring_every_pixel_what_is_planned_for_it() {
        let of = |hires, lores| Allocation { hires, lores };
        let plan = [of(16, 16), of(64, 16), of(16, 100), of(8, 8), of(512, 3)];
        let mut done = [of(0, 0); 5];
        let mut first = 0;
        for end in [4, 16, 32, 512] {
            while let Some(slice) = Slice::next(&plan, first, end) {
                for (passes, pixels) in slice.pixels {
                    for i in pixels {
                        let done = &mut done[i as usize];
                        done.hires += if passes.hires { slice.trials } else { 0 };
                        done.lores += if passes.lores { slice.trials } else { 0 };
                    }
                }
                first += slice.trials;
                assert!(first <= end);
            }
        }
        assert_eq!(done, plan);
    }
}
