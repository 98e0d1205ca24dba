//! A rendering and how far it is: what is needed to go on with it, and what others see of it meanwhile.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::film::{Film, Region, Tile};
use super::plan::Plan;
use super::tally::Tally;
use super::{IrradianceCache, RenderParams, Rendering};
use crate::clock::{Spent, Stopwatch};

/// Tiles that threads work on while others look at them. They change by whole batches of trials.
#[derive(Debug, Default)]
pub struct SharedTiles(Vec<Mutex<Tile>>);

impl SharedTiles {
    /// Shares tiles.
    pub fn new(tiles: Vec<Tile>) -> Self {
        SharedTiles(tiles.into_iter().map(Mutex::new).collect())
    }

    /// The tiles, not shared any more.
    pub fn into_tiles(self) -> Vec<Tile> {
        self.0.into_iter().map(|tile| tile.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
    }

    /// Number of tiles.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A tile as it is now. It is held only while it is read or replaced, not while trials are traced.
    pub fn get(&self, number: usize) -> MutexGuard<'_, Tile> {
        // Whoever panicked with a tile in hands had only read it, or replaced it by another as good.
        self.0[number].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All tiles, one after the other, each as it is then.
    pub fn iter(&self) -> impl Iterator<Item = MutexGuard<'_, Tile>> {
        (0..self.len()).map(|number| self.get(number))
    }

    /// Copies of all tiles.
    pub fn to_vec(&self) -> Vec<Tile> {
        self.iter().map(|tile| tile.clone()).collect()
    }

    /// What all of them have cost.
    pub fn tally(&self) -> Tally {
        self.iter().map(|tile| tile.tally).sum()
    }
}

/// A rendering and how far it is. Going on from here gives the bits of a rendering that was never interrupted.
#[derive(Debug)]
pub struct Session {
    pub(super) region: Region,
    /// What indirect light is interpolated from, where that is wanted, as far as it is filled.
    pub(super) cache: Arc<IrradianceCache>,
    /// Tiles beside the film's that help to plan, while there is no plan.
    pub(super) others: SharedTiles,
    pub(super) plan: Option<Plan>,
    /// The film's tiles.
    pub(super) tiles: SharedTiles,
    /// Time spent before this process took over.
    pub(super) earlier: Spent,
    /// The part of all time that went into the cache.
    pub(super) filling: Spent,
    pub(super) watch: Stopwatch,
}

impl Session {
    /// Nothing done yet.
    pub fn new(params: &RenderParams) -> Self {
        Session {
            region: params.region(),
            cache: Arc::default(),
            others: SharedTiles::default(),
            plan: None,
            tiles: SharedTiles::new(params.film().tiles),
            earlier: Spent::default(),
            filling: Spent::default(),
            watch: Stopwatch::start(),
        }
    }

    /// Whether there is anything that would be lost.
    pub fn is_begun(&self) -> bool {
        self.cache.is_begun() || self.tiles.iter().any(|tile| tile.next > 0)
    }

    /// The part of the image that is rendered.
    pub fn region(&self) -> Region {
        self.region
    }

    /// Time spent on it, by other processes too.
    pub fn spent(&self) -> Spent {
        let mut spent = self.earlier;
        spent += self.watch.spent();
        spent
    }

    /// The image as it is now.
    pub fn film(&self) -> Film {
        shown(self.region, self.tiles.to_vec())
    }

    /// The film and what it cost.
    pub(super) fn into_rendering(self, cache: Option<Arc<IrradianceCache>>, stopped: bool) -> Rendering {
        let spent = self.spent();
        let mut tally = self.tiles.tally();
        tally += self.plan.as_ref().map_or_else(|| self.others.tally(), |plan| plan.others);
        let film = shown(self.region, self.tiles.into_tiles());
        let filling = self.filling;
        Rendering {
            film,
            rays: tally.rays,
            times: tally.times.after_cache(spent.wall_duration(), filling.wall_duration()),
            cpu_times: tally.times.after_cache(spent.cpu_duration(), filling.cpu_duration()),
            stopped,
            cache,
        }
    }
}

/// The image of some tiles.
fn shown(region: Region, tiles: Vec<Tile>) -> Film {
    let [width, height] = region.size();
    Film { width, height, origin: region.low, tiles }.shared()
}
