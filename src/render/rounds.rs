//! The stages of a rendering: irradiance cache, pilot, and the film in rounds that double its trials.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::film::Tile;
use super::integrator::{Batch, World};
use super::path::Passes;
use super::plan::{self, Allocation, Plan};
use super::session::{Session, SharedTiles};
use super::tally::Tally;
use super::watch::{Moment, Watcher, watched};
use super::workspace::Workspace;
use super::{BATCH_TRIALS, IrradianceCache, RenderParams};
use crate::clock::Stopwatch;
use crate::progress::Progress;
use crate::sampling::hash_all;
use crate::scene::Camera;

/// Keeps the pilot's random numbers apart from the image's.
const PILOT: u32 = 0x7069_6c6f;

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
    over: &(dyn Fn() -> bool + Sync),
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
    let complete = cache.fill(world, camera, [params.width, params.height], params.seed, over, &mut |cache| {
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
    /// Says when no new trials are to be begun.
    pub over: &'a (dyn Fn() -> bool + Sync),
}

impl Renderer<'_> {
    /// Decides how many trials each tile of the film gets, where the session has not: by a pilot if they may differ. False when the
    /// pilot was cut short.
    pub fn plan(&self, session: &mut Session, progress: &Progress, watcher: &mut Option<&mut dyn Watcher>) -> bool {
        let params = self.params;
        if session.plan.is_some() {
            return true;
        }
        if params.min_trials == params.max_trials {
            session.plan = Some(Plan::even(params.min_trials, session.tiles.len()));
            return true;
        }
        if session.pilot.is_empty() {
            session.pilot = SharedTiles::new(plan::pilot_tiles(params.region(), params));
        }
        let trials = plan::pilot_trials(params);
        let all = vec![Allocation::even(trials); session.pilot.len()];
        let stage = progress.stage("pilot", 0);
        let seed = hash_all(&[params.seed, PILOT]);
        let complete = watched(session, watcher, || self.round(&session.pilot, &all, 0..trials, seed, &|_| {}));
        stage.finish_and_clear();
        if complete {
            if watcher.is_some() {
                session.keep_preview();
            }
            let tally = session.pilot.tally();
            let pilot = std::mem::take(&mut session.pilot).into_tiles();
            let film = params.film().tiles;
            session.plan = Some(Plan { allocations: plan::allocate(&pilot, &film, params), pilot: tally });
        }
        complete
    }

    /// Carries out the plan of a session. False when it was cut short.
    pub fn expose(&self, session: &Session, progress: &Progress, watcher: &mut Option<&mut dyn Watcher>) -> bool {
        let Some(plan) = &session.plan else { return false };
        let weight = |tile: &Tile, trials: u32| u64::from(trials) * tile.pixels.len() as u64;
        let tiles = || plan.allocations.iter().zip(session.tiles.iter());
        let bar = progress.stage("rendering", tiles().map(|(a, tile)| weight(&tile, a.most())).sum());
        bar.inc(tiles().map(|(a, tile)| weight(&tile, tile.next.min(a.most()))).sum());
        bar.reset_eta();
        let most = plan.allocations.iter().map(Allocation::most).max().unwrap_or(0);
        let round = |range| self.round(&session.tiles, &plan.allocations, range, self.params.seed, &|n| bar.inc(n));
        let complete = watched(session, watcher, || doubling(BATCH_TRIALS, most).all(round));
        bar.finish_and_clear();
        complete
    }

    /// Adds the trials with numbers in `range` to every tile whose allocation has them, but for those that it has already. False when
    /// it was cut short.
    pub fn round(
        &self,
        tiles: &SharedTiles,
        plan: &[Allocation],
        range: Range<u32>,
        seed: u32,
        advance: &(dyn Fn(u64) + Sync),
    ) -> bool {
        let size = [self.params.width, self.params.height];
        let work = |ws: &mut Workspace, (number, allocation): (usize, &Allocation)| {
            // Others look at the tile meanwhile: what is worked on is a copy.
            let mut tile = tiles.get(number).clone();
            for (trials, passes) in allocation.segments(tile.next.max(range.start)..range.end) {
                let mut first = trials.start;
                while first < trials.end {
                    if (self.over)() {
                        return false;
                    }
                    let count = BATCH_TRIALS.min(trials.end - first);
                    let batch = Batch { first, trials: count, passes, seed };
                    (ws.counts, ws.times) = Default::default();
                    let features = self.params.features && passes.hires;
                    self.world.render_tile(ws, self.camera, size, batch, features, &mut tile);
                    first += count;
                    tile.next = first;
                    tile.tally += Tally { rays: ws.counts, times: ws.times };
                    tiles.get(number).clone_from(&tile);
                    advance(u64::from(count) * tile.pixels.len() as u64);
                }
            }
            true
        };
        let numbered = (0..tiles.len()).into_par_iter().zip(plan);
        // Every tile gets its turn, also when it is over: then they end at once.
        numbered.map_init(Workspace::default, work).reduce(|| true, |a, b| a && b)
    }
}

impl Allocation {
    /// The parts of a range of trial numbers that this allocation has, and the passes they feed.
    fn segments(&self, range: Range<u32>) -> impl Iterator<Item = (Range<u32>, Passes)> + use<> {
        let both = self.hires.min(self.lores);
        let single = if self.hires > self.lores { Passes::HIRES } else { Passes::LORES };
        [(range.start..range.end.min(both), Passes::BOTH), (range.start.max(both)..range.end.min(self.most()), single)]
            .into_iter()
            .filter(|(r, _)| !r.is_empty())
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
}
