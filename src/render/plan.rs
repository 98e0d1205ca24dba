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
const LEAST_FIRST: u32 = 4;

/// Pixels darker than this share of the image's mean are held to its absolute error instead of their own relative one.
const DARK: f64 = 0.1;

/// Weight of the second largest variance around a pixel against their mean: where two pixels around are noisy, an edge runs through.
const EDGE: f64 = 0.5;

/// Weight of the mean variance of the tiles around: they have seen what is too rare for the nearest pixels.
const RARE: f64 = 0.5;

/// About so many tiles tell how bright and how noisy the image is as a whole.
const SAMPLED: u32 = 1024;

/// What a trial of LORES costs where it gathers, against one of HIRES.
const LORES_COST: f64 = 2.0;

/// Largest gain of stratification that is believed: that of Owen-scrambled points in two dimensions with an edge through them.
const MOST_GAIN: f64 = 0.5;

/// What a trial may be worth, as a power of two, and how often this interval is halved: the number of trials is then exact to a
/// thousandth.
const LOG_WORTH: (f64, f64) = (-32.0, 64.0);
const BISECTIONS: u32 = 16;

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
    let own = region.tiles([params.width, params.height]);
    let within = |margin: u32, p: [u32; 2]| {
        (0..2).all(|axis| (own[axis].start.saturating_sub(margin)..own[axis].end + margin).contains(&p[axis]))
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

    fn plus(self, o: &Self, sign: f64) -> Self {
        Statistics {
            hires: self.hires + sign * o.hires,
            lores: self.lores + sign * o.lores,
            mean: self.mean + sign * o.mean,
        }
    }

    /// What several pixels say of another one among them.
    fn of_neighbours(near: &[Statistics]) -> Self {
        let count = near.len().max(1) as f64;
        let spread = |of: fn(&Statistics) -> f64| {
            let (mut sum, mut largest, mut second) = (0.0, 0.0_f64, 0.0_f64);
            for value in near.iter().map(of) {
                sum += value;
                second = second.max(value.min(largest));
                largest = largest.max(value);
            }
            (sum / count).max(EDGE * second)
        };
        Statistics {
            hires: spread(|s| s.hires),
            lores: spread(|s| s.lores),
            mean: near.iter().map(|s| s.mean).sum::<f64>() / count,
        }
    }
}

/// Standard deviations of a single trial, relative to the radiance that a pixel is judged by.
#[derive(Clone, Copy, Debug, Default)]
struct Deviation {
    hires: f64,
    lores: f64,
}

impl Deviation {
    fn new(s: &Statistics, image_mean: f64) -> Self {
        let radiance = judged(s.mean, image_mean);
        let relative = |variance: f64| if radiance > 0.0 { variance.sqrt() / radiance } else { 0.0 };
        Deviation { hires: relative(s.hires), lores: relative(s.lores) }
    }

    fn at_least(&self, o: &Self) -> Self {
        Deviation { hires: self.hires.max(o.hires), lores: self.lores.max(o.lores) }
    }
}

/// Sums of relative variances over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Pool {
    hires: f64,
    lores: f64,
    count: f64,
}

impl Pool {
    fn plus(self, o: Pool) -> Pool {
        Pool { hires: self.hires + o.hires, lores: self.lores + o.lores, count: self.count + o.count }
    }

    fn deviation(&self) -> Deviation {
        let of = |sum: f64| (RARE * sum / self.count.max(1.0)).sqrt();
        Deviation { hires: of(self.hires), lores: of(self.lores) }
    }
}

/// The radiance that errors of a pixel are relative to.
fn judged(mean: f64, image_mean: f64) -> f64 {
    mean.hypot(DARK * image_mean)
}

/// How fast the error of stratified trials falls: a pixel whose single trial has the variance `v` has the variance
/// `v / n (2 / n)^gain` after `n` trials. Independent trials have the gain 0; where edges and shadows make the variance, Owen-scrambled
/// Sobol points have 1/2. (Each half of the trials has a point set of its own: of two trials nothing is gained yet.)
#[derive(Clone, Copy, Debug, PartialEq)]
struct Convergence {
    gain: f64,
}

impl Convergence {
    /// From the sums over many pixels of the variance that the difference of halves shows after `trials` trials, and of what it would
    /// be if they were independent.
    fn new(measured: f64, independent: f64, trials: u32) -> Self {
        let factor = measured / independent;
        let gain = factor.ln() / (2.0 / f64::from(trials)).ln();
        Convergence { gain: if gain.is_finite() { gain.clamp(0.0, MOST_GAIN) } else { 0.0 } }
    }

    fn square_error(self, deviation: f64, trials: f64) -> f64 {
        deviation * deviation / trials * (2.0 / trials).powf(self.gain)
    }

    /// Trials that bring the error down to `error`.
    fn needed(self, deviation: f64, error: f64) -> f64 {
        ((deviation / error).powi(2) * self.gain.exp2()).powf(1.0 / (1.0 + self.gain))
    }

    /// Trials of a pixel where one more would bring the mean square error of an image down by `1 / worth` for each unit of what it costs:
    /// the same everywhere, and so the best there is for that cost (Neyman's allocation, for independent trials).
    fn share(self, deviation: f64, cost: f64, worth: f64) -> f64 {
        (deviation * deviation * worth / cost).powf(self.share_power())
    }

    fn share_power(self) -> f64 {
        1.0 / (2.0 + self.gain)
    }
}

/// One pass of one pixel, while the worth of a trial is looked for: all powers are taken once.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Relative square error after the fewest trials.
    most: f64,
    /// And after its share at the worth of one.
    square_error: f64,
}

impl Candidate {
    fn new(converge: Convergence, deviation: f64, cost: f64, least: f64) -> Self {
        if deviation == 0.0 {
            return Candidate { most: 0.0, square_error: 0.0 };
        }
        let square_error = |trials| converge.square_error(deviation, trials);
        Candidate { most: square_error(least), square_error: square_error(converge.share(deviation, cost, 1.0)) }
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
        for tile in known.sampled() {
            sum += tile.pixels.iter().map(|pixel| Statistics::of(pixel).mean).sum::<f64>();
            count += tile.pixels.len();
        }
        known.image_mean = sum / count.max(1) as f64;
        known
    }

    /// The tiles that stand for the whole image.
    fn sampled(&self) -> impl Iterator<Item = &'a Tile> {
        self.tiles.iter().flatten().copied().filter(|tile| self.grid.is_sampled(place(tile)))
    }

    fn tile(&self, at: [u32; 2]) -> Option<&'a Tile> {
        if at[0] < self.grid.across && at[1] < self.grid.down { self.tiles[self.grid.index(at)] } else { None }
    }

    /// The tile that holds a pixel, and the pixel's place in it.
    fn pixel(&self, [x, y]: [u32; 2]) -> Option<(&'a Tile, usize)> {
        let tile = self.tile([x / TILE, y / TILE])?;
        let inside = x % TILE < tile.size[0] && y % TILE < tile.size[1];
        inside.then_some((tile, ((y % TILE) * tile.size[0] + x % TILE) as usize))
    }

    /// Deviations of each pixel of a tile, by what it and some of the tiles around it say but for the pixel itself.
    fn deviations(&self, tile: &Tile, ask: impl Fn(&Tile) -> bool) -> Vec<Deviation> {
        let around = |at: u32| at.saturating_sub(1)..at + 2;
        let square = |[x, y]: [u32; 2]| around(y).flat_map(move |j| around(x).map(move |i| [i, j]));
        let asked = |at: [u32; 2]| self.tile(at).filter(|tile| ask(tile));
        let own: Vec<Statistics> = tile.pixels.iter().map(Statistics::of).collect();
        let here = place(tile);
        let others = square(here).filter(|&at| at != here).filter_map(asked).map(|tile| {
            let sum = tile.pixels.iter().map(Statistics::of).fold(Statistics::default(), |sum, s| sum.plus(&s, 1.0));
            self.pooled(&sum, tile.pixels.len())
        });
        let others = others.fold(Pool::default(), Pool::plus);
        let total = own.iter().fold(Statistics::default(), |sum, s| sum.plus(s, 1.0));
        let one = |(i, own_pixel): (usize, &Statistics)| {
            let pixel = tile.pixel(i as u32);
            let mut near = [Statistics::default(); 8];
            let mut count = 0;
            for at in square(pixel).filter(|&at| at != pixel) {
                if let Some((tile, place)) = self.pixel(at)
                    && ask(tile)
                {
                    near[count] = Statistics::of(&tile.pixels[place]);
                    count += 1;
                }
            }
            let near = Deviation::new(&Statistics::of_neighbours(&near[..count]), self.image_mean);
            let rare = others.plus(self.pooled(&total.plus(own_pixel, -1.0), own.len() - 1));
            near.at_least(&rare.deviation())
        };
        own.iter().enumerate().map(one).collect()
    }

    /// Variances of `count` pixels relative to their common mean, times their number.
    fn pooled(&self, sum: &Statistics, count: usize) -> Pool {
        let count = count as f64;
        let square = judged(sum.mean / count, self.image_mean).powi(2);
        if count > 0.0 && square > 0.0 {
            Pool { hires: sum.hires.max(0.0) / square, lores: sum.lores.max(0.0) / square, count }
        } else {
            Pool::default()
        }
    }

    /// How fast both passes converge, by the sampled tiles.
    fn convergence(&self, params: &RenderParams) -> [Convergence; 2] {
        let mut sums = [[0.0; 2]; 2];
        for pixel in self.sampled().flat_map(|tile| &tile.pixels) {
            let square = judged(Statistics::of(pixel).mean, self.image_mean).powi(2);
            for (sums, pass) in sums.iter_mut().zip([&pixel.hires, &pixel.lores]) {
                let Some((even, odd)) = pass.halves().filter(|_| square > 0.0) else { continue };
                for band in 0..3 {
                    sums[0] += (0.5 * (even[band] - odd[band])).powi(2) / square;
                    sums[1] += pass.variance()[band] / f64::from(pass.trials()) / square;
                }
            }
        }
        sums.map(|[measured, independent]| Convergence::new(measured, independent, first_trials(params)))
    }

    /// What a trial is worth ([`Convergence::share`]) for the root of the image's mean square error to come to `params.error`. Judged by
    /// the sampled tiles alone, each by itself, so that parts of an image come to the same.
    fn worth(&self, converge: [Convergence; 2], params: &RenderParams) -> f64 {
        let least = f64::from(first_trials(params));
        let of_tile = |tile: &Tile| self.deviations(tile, |other| other.origin == tile.origin);
        let candidates = |d: Deviation| {
            let [hires, lores] = converge;
            [Candidate::new(hires, d.hires, 1.0, least), Candidate::new(lores, d.lores, LORES_COST, least)]
        };
        let all: Vec<[Candidate; 2]> = self.sampled().flat_map(of_tile).map(candidates).collect();
        let allowed = f64::from(params.error).powi(2) * all.len() as f64;
        let most: f64 = all.iter().flatten().map(|c| c.most).sum();
        if most <= allowed {
            return 0.0;
        }
        let suffices = |worth: f64| {
            let change = converge.map(|c| worth.powf(-c.share_power() * (1.0 + c.gain)));
            let error =
                |pair: &[Candidate; 2]| (0..2).map(|i| pair[i].most.min(pair[i].square_error * change[i])).sum();
            all.iter().map(|pair| -> f64 { error(pair) }).sum::<f64>() <= allowed
        };
        let (mut low, mut high) = LOG_WORTH;
        for _ in 0..BISECTIONS {
            let middle: f64 = 0.5 * (low + high);
            if suffices(middle.exp2()) { high = middle } else { low = middle }
        }
        high.exp2()
    }
}

/// Chooses trials of both passes: as many as bring the image to `params.error` for the least work, and where a pixel needs more for
/// `dev_H / L_H <= params.hires_error` and then `(dev_H + dev_L) / (L_H + L_L) <= params.lores_error`, those; rounded up to powers of
/// two or three halves of one, between the limits. `film` and `others` hold the first trials; the outcome is for the pixels of
/// `film`, tile by tile.
pub fn allocate(film: &[Tile], others: &[Tile], params: &RenderParams) -> Vec<Vec<Allocation>> {
    let known = Known::new(film.iter().chain(others), params);
    let converge @ [hires, lores] = known.convergence(params);
    let worth = known.worth(converge, params);
    let of_pixel = |d: &Deviation| {
        let by_pixel = hires.needed(d.hires, f64::from(params.hires_error));
        let hires_trials = trials(hires.share(d.hires, 1.0, worth).max(by_pixel), params);
        // Where HIRES alone is above the target, LORES is held to half of it.
        let target = f64::from(params.lores_error);
        let rest = target - hires.square_error(d.hires, f64::from(hires_trials)).sqrt();
        let by_pixel = lores.needed(d.lores, rest.max(0.5 * target));
        let lores_trials = trials(lores.share(d.lores, LORES_COST, worth).max(by_pixel), params);
        Allocation { hires: hires_trials, lores: lores_trials }
    };
    film.iter().map(|tile| known.deviations(tile, |_| true).iter().map(of_pixel).collect()).collect()
}

/// The number of trials of a pixel that needs `needed`.
fn trials(needed: f64, params: &RenderParams) -> u32 {
    // Not a number: nothing is known. As many as there may be.
    let needed =
        if needed.is_nan() { params.max_trials } else { needed.min(f64::from(params.max_trials)).ceil() as u32 };
    let needed = needed.clamp(first_trials(params), params.max_trials);
    let power = needed.next_power_of_two();
    // Sobol points are well distributed in numbers with few factors but two.
    let between = power / 4 * 3;
    if between >= needed { between } else { power }.min(params.max_trials)
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
            error: f32::INFINITY,
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

    /// Half of the image deviates eight times as much as the rest: trials follow, and bring what was asked for.
    #[test]
    fn trials_follow_the_deviation_to_the_error_that_is_asked_for() {
        let (loud, quiet, error, width) = (0.8_f32, 0.1, 0.05, 64);
        let mut film = Film::new(width, 8);
        for tile in &mut film.tiles {
            for i in 0..tile.pixels.len() {
                let amplitude = if tile.pixel(i as u32)[0] < width / 2 { loud } else { quiet };
                for t in 0..16 {
                    // Each half has both signs: nothing is gained by stratification.
                    let sign = if t % 4 < 2 { 1.0 } else { -1.0 };
                    let value = Vec3::splat(1.0 + sign * amplitude);
                    tile.pixels[i].hires.add(value, t % 2 == 0);
                    tile.pixels[i].lores.add(Vec3::ZERO, t % 2 == 0);
                }
            }
        }
        let none = f32::INFINITY;
        let params = RenderParams { width, error, hires_error: none, lores_error: none, ..params() };
        let plan = allocate(&film.tiles, &[], &params);
        // The first and the last tile are not next to the border between the two.
        let [many, few] = [&plan[0], &plan[7]].map(|tile| tile[8 * 4 + 2].hires);
        let square = |amplitude: f32, trials: u32| f64::from(amplitude * amplitude) * 16.0 / 15.0 / f64::from(trials);
        let root = (0.5 * (square(loud, many) + square(quiet, few))).sqrt();
        // Numbers of trials are rounded up by at most a half.
        assert!(root <= f64::from(error) && root > f64::from(error) / 1.5_f64.sqrt() * 0.99, "{root}");
        let ratio = f64::from(many) / f64::from(few);
        assert!((8.0 / 1.5..=8.0 * 1.5).contains(&ratio), "{many} {few}");
        assert!(plan.iter().flatten().all(|a| a.lores == LEAST_FIRST));
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
