//! How many trials each tile gets in each pass: decided by a pilot, whose trials are not part of the image.

use super::RenderParams;
use super::film::{Film, Region, TILE, Tile};
use crate::sampling::hash;

/// Trials of each pixel in the pilot, when the image has at least four times as many to spend.
const PILOT_TRIALS: u32 = 16;

/// Pixels darker than this share of the image's mean are held to its absolute error instead of their own relative one.
const DARK: f64 = 0.1;

/// Trials of one tile's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// Number of pilot trials: enough to estimate a tile's variance, little against the image.
pub fn pilot_trials(params: &RenderParams) -> u32 {
    PILOT_TRIALS.min((params.max_trials / 4).max(2))
}

/// Variance of a single trial and mean radiance of a tile, pooled over its pixels and bands.
#[derive(Clone, Copy, Default)]
struct Statistics {
    hires: f64,
    lores: f64,
    mean: f64,
}

/// About so many tiles tell how bright the image is as a whole.
const SAMPLED: u32 = 1024;

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

    /// A tile and those around it.
    fn around(self, [x, y]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
        let near = |at: u32, count: u32| at.saturating_sub(1)..(at + 2).min(count);
        near(y, self.down).flat_map(move |y| near(x, self.across).map(move |x| [x, y]))
    }
}

fn place(tile: &Tile) -> [u32; 2] {
    tile.origin.map(|low| low / TILE)
}

/// The tiles that a pilot must render so that [`allocate`] gives the tiles of `region` what they would get in the whole image:
/// these, their neighbours, and a sample of all.
pub fn pilot_tiles(region: Region, params: &RenderParams) -> Vec<Tile> {
    let grid = Grid::new(params);
    let low = region.low.map(|low| (low / TILE).saturating_sub(1));
    let high = region.high.map(|high| high.div_ceil(TILE) + 1);
    let inside = |p: [u32; 2]| (0..2).all(|axis| (low[axis]..high[axis]).contains(&p[axis]));
    let all = (0..grid.down).flat_map(|y| (0..grid.across).map(move |x| [x, y]));
    let wanted = all.filter(|&p| inside(p) || grid.is_sampled(p));
    wanted.map(|p| Tile::new(p, [params.width, params.height])).collect()
}

/// Chooses trials for the requested relative errors: HIRES until `dev_H / L_H`, then LORES until
/// `(dev_H + dev_L) / (L_H + L_L)` is met, both rounded up to powers of two between the limits.
///
/// Variances are pooled over a tile and, where larger, half of its neighbours': a pilot that missed a feature at the edge of one
/// tile has seen it in the next.
pub fn allocate(pilot: &[Tile], film: &Film, params: &RenderParams) -> Vec<Allocation> {
    let grid = Grid::new(params);
    let mut of_tile: Vec<Option<Statistics>> = vec![None; (grid.across * grid.down) as usize];
    let (mut sum, mut sampled) = (0.0, 0);
    for tile in pilot {
        let statistics = statistics(tile);
        if grid.is_sampled(place(tile)) {
            sum += statistics.mean;
            sampled += 1;
        }
        of_tile[grid.index(place(tile))] = Some(statistics);
    }
    let image_mean = sum / f64::from(sampled.max(1));
    let trials = |needed: f64| {
        let needed = if needed.is_finite() { needed.ceil() as u32 } else { params.max_trials };
        needed.clamp(params.min_trials, params.max_trials).next_power_of_two().min(params.max_trials)
    };
    let one = |tile: &Tile| {
        let own = of_tile[grid.index(place(tile))].unwrap_or_default();
        let (mut hires, mut lores) = (own.hires, own.lores);
        for t in grid.around(place(tile)).filter_map(|p| of_tile[grid.index(p)]) {
            hires = hires.max(0.5 * t.hires);
            lores = lores.max(0.5 * t.lores);
        }
        let radiance = own.mean.hypot(DARK * image_mean);
        if radiance == 0.0 {
            return Allocation::even(params.min_trials);
        }
        let hires_trials = trials(hires / (f64::from(params.hires_error) * radiance).powi(2));
        let dev_hires = (hires / f64::from(hires_trials)).sqrt();
        // Where HIRES alone is above the target, LORES is held to half of it.
        let target = f64::from(params.lores_error) * radiance;
        let rest = (target - dev_hires).max(0.5 * target);
        Allocation { hires: hires_trials, lores: trials(lores / (rest * rest)) }
    };
    film.tiles.iter().map(one).collect()
}

fn statistics(tile: &Tile) -> Statistics {
    let n = 3.0 * tile.pixels.len() as f64;
    let mean3 = |v: [f64; 3]| v.iter().sum::<f64>() / n;
    tile.pixels.iter().fold(Statistics::default(), |s, p| Statistics {
        hires: s.hires + mean3(p.hires.variance()),
        lores: s.lores + mean3(p.lores.variance()),
        mean: s.mean + mean3(p.hires.mean()) + mean3(p.lores.mean()),
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

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

    /// A pilot whose middle tile has the given spread in both passes.
    fn pilot(spread: f32) -> Film {
        let mut film = Film::new(24, 8);
        for (i, tile) in film.tiles.iter_mut().enumerate() {
            for pixel in &mut tile.pixels {
                for t in 0..16 {
                    let sign = if t % 2 == 0 { 1.0 } else { -1.0 };
                    let value = Vec3::splat(1.0 + if i == 1 { sign * spread } else { 0.0 });
                    pixel.hires.add(value, t % 2 == 0);
                    pixel.lores.add(value, t % 2 == 0);
                }
            }
        }
        film
    }

    #[test]
    fn quiet_tiles_get_the_minimum_and_noisy_ones_what_the_error_asks_for() {
        let film = Film::new(24, 8);
        let quiet = allocate(&pilot(0.0).tiles, &film, &params());
        assert!(quiet.iter().all(|a| *a == Allocation { hires: 4, lores: 4 }));
        let noisy = allocate(&pilot(1.0).tiles, &film, &params());
        // Variance 16/15 a trial, radiance about 2: HIRES needs 1.07 / 0.2^2 = 27 trials.
        assert_eq!(noisy[1].hires, 32);
        assert!(noisy[1].lores > noisy[1].hires);
        assert!(noisy[0].hires > 4, "a noisy neighbour is a warning");
    }

    #[test]
    fn black_images_stop_at_the_minimum() {
        let film = Film::new(24, 8);
        assert!(allocate(&film.tiles, &film, &params()).iter().all(|a| a.most() == 4));
    }

    /// Whatever part is asked for, a tile gets what it gets in the whole image.
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
        let whole = Film::new(size[0], size[1]);
        let plan = allocate(&fill(pilot_tiles(Region::whole(size), &params)), &whole, &params);
        assert!(plan.iter().any(|a| a.hires != plan[0].hires), "tiles differ");
        for (low, high) in [([0, 0], [350, 200]), ([333, 77], [334, 78]), ([696, 392], [700, 400])] {
            let region = Region { low, high };
            let part = Film::of(region, size);
            let pilot = pilot_tiles(region, &params);
            assert!(pilot.len() < whole.tiles.len(), "less is to be rendered");
            let of_part = allocate(&fill(pilot), &part, &params);
            for (tile, allocation) in part.tiles.iter().zip(of_part) {
                let index = whole.tiles.iter().position(|t| t.origin == tile.origin).unwrap();
                assert_eq!(allocation, plan[index]);
            }
        }
    }
}
