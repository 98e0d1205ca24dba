//! A rendering and how far it is: what is needed to go on with it, and what others see of it meanwhile.

use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::Vec3;

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
    /// The pilot's tiles, while there is no plan.
    pub(super) pilot: SharedTiles,
    pub(super) plan: Option<Plan>,
    /// The film's tiles.
    pub(super) tiles: SharedTiles,
    /// What the pilot saw, pixel by pixel: shown where the film has no trials yet. Empty where there was none.
    pub(super) preview: Vec<Vec3>,
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
            pilot: SharedTiles::default(),
            plan: None,
            tiles: SharedTiles::new(params.film().tiles),
            preview: Vec::new(),
            earlier: Spent::default(),
            filling: Spent::default(),
            watch: Stopwatch::start(),
        }
    }

    /// Whether there is anything that would be lost.
    pub fn is_begun(&self) -> bool {
        self.cache.is_begun() || self.plan.is_some() || self.pilot.iter().any(|tile| tile.next > 0)
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
        let [width, height] = self.region.size();
        let tiles = self.tiles.iter().map(|tile| tile.clone()).collect();
        Film { width, height, origin: self.region.low, tiles }
    }

    /// Colours of all pixels, row by row, as far as they are known: by the film, elsewhere by the pilot, elsewhere black.
    pub fn picture(&self) -> Vec<Vec3> {
        self.picture_of(self.tiles.iter())
    }

    /// The same with the tiles of a film that was taken from here.
    pub fn picture_with(&self, film: &Film) -> Vec<Vec3> {
        self.picture_of(film.tiles.iter())
    }

    fn picture_of(&self, tiles: impl Iterator<Item = impl Deref<Target = Tile>>) -> Vec<Vec3> {
        let [width, height] = self.region.size();
        let mut picture = self.preview.clone();
        picture.resize(width as usize * height as usize, Vec3::ZERO);
        draw(self.pilot.iter(), self.region, &mut picture);
        draw(tiles, self.region, &mut picture);
        picture
    }

    /// The film and what it cost.
    pub(super) fn into_rendering(self, cache: Option<Arc<IrradianceCache>>, stopped: bool) -> Rendering {
        let spent = self.spent();
        let mut tally = self.tiles.tally();
        tally += self.plan.as_ref().map_or_else(|| self.pilot.tally(), |plan| plan.pilot);
        let [width, height] = self.region.size();
        let film = Film { width, height, origin: self.region.low, tiles: self.tiles.into_tiles() };
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

    /// Keeps what the pilot saw, to be shown where the film has nothing yet.
    pub(super) fn keep_preview(&mut self) {
        self.preview = self.picture();
    }
}

/// Draws the trials of tiles into a picture of a region.
fn draw(tiles: impl Iterator<Item = impl Deref<Target = Tile>>, region: Region, picture: &mut [Vec3]) {
    let width = region.size()[0] as usize;
    for tile in tiles.filter(|tile| tile.next > 0) {
        for (i, pixel) in tile.pixels.iter().enumerate() {
            let at = tile.pixel(i as u32);
            if (0..2).all(|axis| (region.low[axis]..region.high[axis]).contains(&at[axis])) {
                let [x, y] = [0, 1].map(|axis| (at[axis] - region.low[axis]) as usize);
                picture[y * width + x] = pixel.radiance();
            }
        }
    }
}
