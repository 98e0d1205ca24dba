//! How many trials each pixel gets in each pass: decided by the first trials of the pixels around it.
//!
//! A pixel's own trials have no part in it. Deciding by trials that are kept would bias the pixel towards dark: it would stop where they
//! happened to be dark or alike. Those of other pixels are independent of it, and none are thrown away.

use serde::{Deserialize, Serialize};

use super::RenderParams;
use super::film::{Pixel, Region, TILE, Tile};
use super::tally::Tally;
use crate::sampling::hash;

/// Fewest trials that tell something about a variance.
const LEAST_FIRST: u32 = 8;

/// Pixels darker than this share of the image's mean are held to its absolute error instead of their own relative one.
const DARK: f64 = 0.1;

/// Weight of the second largest variance around a pixel against their mean: where two pixels around are noisy, an edge runs through.
const EDGE: f64 = 0.5;

/// Weight of the mean variance of the tile: it has seen what is too rare for the nearest pixels.
const RARE: f64 = 0.5;

/// About so many tiles tell how bright the image is as a whole.
const SAMPLED: u32 = 1024;

/// Trials of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Allocation {
    /// In HIRES.
    pub hires: u32,
    /// In LORES.
    pub lores: u32,
}

impl Allocation {
    /// As many in both passes.
    pub fn even(trials: u32) -> Self {
        Allocation { hires: trials, lores: trials }
    }

    /// The larger of both.
    pub fn most(&self) -> u32 {
        self.hires.max(self.lores)
    }
}

/// What a rendering is to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// Trials of each of the film's pixels, tile by tile.
    pub allocations: Vec<Vec<Allocation>>,
    /// What other tiles cost that only helped to decide it.
    pub others: Tally,
}

impl Plan {
    /// The same for every pixel.
    pub fn even<'a>(trials: u32, tiles: impl Iterator<Item = &'a Tile>) -> Self {
        let allocations = tiles.map(|tile| vec![Allocation::even(trials); tile.pixels.len()]).collect();
        Plan { allocations, others: Tally::default() }
    }
}

/// Number of trials by which it is decided.
pub fn first_trials(params: &RenderParams) -> u32 {
    params.min_trials.max(LEAST_FIRST).min(params.max_trials)
}

/// All tiles of an image, of which a part is to be rendered.
#[derive(Clone, Copy)]
struct Grid {
    across: u32,
    down: u32,
}

impl Grid {
    fn new(params: &RenderParams) -> Self {
        Grid { across: params.width.div_ceil(TILE), down: params.height.div_ceil(TILE) }
    }

    /// Whether a tile belongs to those that tell the brightness of the image. Depends only on the image's size.
    fn is_sampled(self, [x, y]: [u32; 2]) -> bool {
        let every = (self.across * self.down / SAMPLED).max(1);
        hash(y * self.across + x).is_multiple_of(every)
    }

    fn index(self, [x, y]: [u32; 2]) -> usize {
        y as usize * self.across as usize + x as usize
    }
}

fn place(tile: &Tile) -> [u32; 2] {
    tile.origin.map(|low| low / TILE)
}

/// The tiles beside those of `region` whose first trials [`allocate`] needs to give pixels of `region` what they would get in the whole
/// image: its neighbours, and a sample of all.
pub fn other_tiles(region: Region, params: &RenderParams) -> Vec<Tile> {
    let grid = Grid::new(params);
    let low = region.low.map(|low| low / TILE);
    let high = region.high.map(|high| high.div_ceil(TILE));
    let within = |margin: u32, p: [u32; 2]| {
        (0..2).all(|axis| (low[axis].saturating_sub(margin)..high[axis] + margin).contains(&p[axis]))
    };
    let all = (0..grid.down).flat_map(|y| (0..grid.across).map(move |x| [x, y]));
    let wanted = all.filter(|&p| !within(0, p) && (within(1, p) || grid.is_sampled(p)));
    wanted.map(|p| Tile::new(p, [params.width, params.height])).collect()
}

/// Variance of a single trial in both passes, and mean radiance; means over bands.
#[derive(Clone, Copy, Default)]
struct Statistics {
    hires: f64,
    lores: f64,
    mean: f64,
}

impl Statistics {
    fn of(pixel: &Pixel) -> Self {
        let mean3 = |v: [f64; 3]| v.iter().sum::<f64>() / 3.0;
        Statistics {
            hires: mean3(pixel.hires.variance()),
            lores: mean3(pixel.lores.variance()),
            mean: mean3(pixel.hires.mean()) + mean3(pixel.lores.mean()),
        }
    }
}

/// The first trials of all tiles that are known.
struct Known<'a> {
    grid: Grid,
    /// By the tile's place in the image.
    tiles: Vec<Option<&'a Tile>>,
    image_mean: f64,
}

impl<'a> Known<'a> {
    fn new(tiles: impl Iterator<Item = &'a Tile>, params: &RenderParams) -> Self {
        let grid = Grid::new(params);
        let mut known = Known { grid, tiles: vec![None; (grid.across * grid.down) as usize], image_mean: 0.0 };
        for tile in tiles {
            known.tiles[grid.index(place(tile))] = Some(tile);
        }
        let (mut sum, mut count) = (0.0, 0_usize);
        for tile in known.tiles.iter().flatten().filter(|tile| grid.is_sampled(place(tile))) {
            sum += tile.pixels.iter().map(|pixel| Statistics::of(pixel).mean).sum::<f64>();
            count += tile.pixels.len();
        }
        known.image_mean = sum / count.max(1) as f64;
        known
    }

    fn pixel(&self, [x, y]: [u32; 2]) -> Option<&Pixel> {
        let (column, row) = (x / TILE, y / TILE);
        if column >= self.grid.across || row >= self.grid.down {
            return None;
        }
        let tile = self.tiles[self.grid.index([column, row])]?;
        let inside = x % TILE < tile.size[0] && y % TILE < tile.size[1];
        inside.then(|| &tile.pixels[((y % TILE) * tile.size[0] + x % TILE) as usize])
    }

    /// What the pixels around one say.
    fn around(&self, [x, y]: [u32; 2]) -> Statistics {
        let mut near = [Statistics::default(); 8];
        let mut count = 0;
        for j in y.saturating_sub(1)..y + 2 {
            for i in x.saturating_sub(1)..x + 2 {
                if [i, j] != [x, y]
                    && let Some(pixel) = self.pixel([i, j])
                {
                    near[count] = Statistics::of(pixel);
                    count += 1;
                }
            }
        }
        let near = &near[..count];
        let spread = |of: fn(&Statistics) -> f64| {
            let (mut sum, mut largest, mut second) = (0.0, 0.0_f64, 0.0_f64);
            for value in near.iter().map(of) {
                sum += value;
                second = second.max(value.min(largest));
                largest = largest.max(value);
            }
            (sum / count.max(1) as f64).max(EDGE * second)
        };
        Statistics {
            hires: spread(|s| s.hires),
            lores: spread(|s| s.lores),
            mean: near.iter().map(|s| s.mean).sum::<f64>() / count.max(1) as f64,
        }
    }
}

/// Chooses trials for the requested relative errors: HIRES until `dev_H / L_H`, then LORES until
/// `(dev_H + dev_L) / (L_H + L_L)` is met, both rounded up to powers of two between the limits. `film` and `others` hold the first
/// trials; the outcome is for the pixels of `film`, tile by tile.
pub fn allocate(film: &[Tile], others: &[Tile], params: &RenderParams) -> Vec<Vec<Allocation>> {
    let known = Known::new(film.iter().chain(others), params);
    film.iter().map(|tile| of_tile(tile, &known, params)).collect()
}

fn of_tile(tile: &Tile, known: &Known<'_>, params: &RenderParams) -> Vec<Allocation> {
    let own: Vec<Statistics> = tile.pixels.iter().map(Statistics::of).collect();
    let total = own.iter().fold(Statistics::default(), |s, p| Statistics {
        hires: s.hires + p.hires,
        lores: s.lores + p.lores,
        mean: s.mean + p.mean,
    });
    let others = (own.len().max(2) - 1) as f64;
    let trials = |needed: f64| {
        let needed = if needed.is_finite() { needed.ceil() as u32 } else { params.max_trials };
        let most = needed.clamp(first_trials(params), params.max_trials).next_power_of_two();
        most.min(params.max_trials)
    };
    let one = |(i, own): (usize, &Statistics)| {
        let around = known.around(tile.pixel(i as u32));
        let hires = around.hires.max(RARE * (total.hires - own.hires) / others);
        let lores = around.lores.max(RARE * (total.lores - own.lores) / others);
        let radiance = around.mean.hypot(DARK * known.image_mean);
        if radiance == 0.0 {
            return Allocation::even(first_trials(params));
        }
        let hires_trials = trials(hires / (f64::from(params.hires_error) * radiance).powi(2));
        let dev_hires = (hires / f64::from(hires_trials)).sqrt();
        // Where HIRES alone is above the target, LORES is held to half of it.
        let target = f64::from(params.lores_error) * radiance;
        let rest = (target - dev_hires).max(0.5 * target);
        Allocation { hires: hires_trials, lores: trials(lores / (rest * rest)) }
    };
    own.iter().enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::render::Film;

    fn params() -> RenderParams {
        RenderParams {
            width: 24,
            height: 8,
            min_trials: 4,
            max_trials: 1024,
            hires_error: 0.1,
            lores_error: 0.1,
            region: None,
            time_limit: None,
            features: false,
            interpolate: false,
            seed: 0,
            frame: None,
        }
    }

    /// Three tiles with 16 trials of ones, at noisy pixels off by `spread` either way.
    fn film(spread: f32, noisy: impl Fn([u32; 2]) -> bool) -> Film {
        let mut film = Film::new(24, 8);
        for tile in &mut film.tiles {
            for i in 0..tile.pixels.len() {
                let amplitude = if noisy(tile.pixel(i as u32)) { spread } else { 0.0 };
                for t in 0..16 {
                    let sign = if t % 2 == 0 { 1.0 } else { -1.0 };
                    let value = Vec3::splat(1.0 + sign * amplitude);
                    tile.pixels[i].hires.add(value, t % 2 == 0);
                    tile.pixels[i].lores.add(value, t % 2 == 0);
                }
            }
        }
        film
    }

    /// The allocation of a pixel of the second tile, which begins at column 8.
    fn at(plan: &[Vec<Allocation>], [x, y]: [usize; 2]) -> Allocation {
        plan[1][8 * y + x - 8]
    }

    #[test]
    fn quiet_pixels_get_the_minimum_and_noisy_ones_what_the_error_asks_for() {
        let quiet = allocate(&film(0.0, |_| true).tiles, &[], &params());
        assert!(quiet.iter().flatten().all(|a| *a == Allocation::even(LEAST_FIRST)));
        let noisy = allocate(&film(1.0, |_| true).tiles, &[], &params());
        // Variance 16/15 a trial, radiance about 2: HIRES needs 1.07 / 0.2^2 = 27 trials.
        assert_eq!(at(&noisy, [12, 4]).hires, 32);
        assert!(at(&noisy, [12, 4]).lores > 32);
    }

    #[test]
    fn edges_get_more_on_both_sides_and_further_away_there_is_less() {
        let edge = allocate(&film(2.0, |[x, _]| x == 11).tiles, &[], &params());
        let [beside, on, other_side, away] = [10, 11, 12, 14].map(|x| at(&edge, [x, 4]).hires);
        assert!(on >= 64 && beside == on && other_side == on && away < on, "{on} {away}");
    }

    /// Deciding by itself would bias it.
    #[test]
    fn a_pixel_has_no_part_in_its_own_allocation() {
        let alone = |spread| allocate(&film(spread, |p| p == [12, 4]).tiles, &[], &params());
        let (quiet, noisy) = (alone(0.0), alone(3.0));
        assert_eq!(at(&quiet, [12, 4]), at(&noisy, [12, 4]));
        assert_ne!(at(&quiet, [13, 4]), at(&noisy, [13, 4]));
    }

    #[test]
    fn black_images_stop_at_the_minimum() {
        let film = Film::new(24, 8);
        assert!(allocate(&film.tiles, &[], &params()).iter().flatten().all(|a| a.most() == LEAST_FIRST));
    }

    /// Whatever part is asked for, a pixel gets what it gets in the whole image.
    #[test]
    fn a_part_gets_what_the_whole_gives_it() {
        let size = [700, 400];
        let params = RenderParams { width: size[0], height: size[1], ..params() };
        let fill = |mut tiles: Vec<Tile>| {
            for tile in &mut tiles {
                let seed = hash(tile.origin[0] + 1000 * tile.origin[1]);
                for (i, pixel) in tile.pixels.iter_mut().enumerate() {
                    for t in 0..4 {
                        let value = (hash(seed ^ (i as u32 * 4 + t)) % 1000) as f32 * (1 + seed % 5) as f32;
                        pixel.hires.add(Vec3::splat(value), t % 2 == 0);
                        pixel.lores.add(Vec3::splat(value.sqrt()), t % 2 == 0);
                    }
                }
            }
            tiles
        };
        let whole = fill(Film::new(size[0], size[1]).tiles);
        assert!(other_tiles(Region::whole(size), &params).is_empty());
        let plan = allocate(&whole, &[], &params);
        assert!(plan.iter().flatten().any(|a| a.hires != plan[0][0].hires), "pixels differ");
        for (low, high) in [([0, 0], [350, 200]), ([333, 77], [334, 78]), ([696, 392], [700, 400])] {
            let region = Region { low, high };
            let part = fill(Film::of(region, size).tiles);
            let others = fill(other_tiles(region, &params));
            assert!(part.len() + others.len() < whole.len(), "less is to be rendered");
            for (tile, of_part) in part.iter().zip(allocate(&part, &others, &params)) {
                let index = whole.iter().position(|t| t.origin == tile.origin).unwrap();
                assert_eq!(of_part, plan[index]);
            }
        }
    }
}
