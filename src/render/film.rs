//! Where trials are added up: mean and standard error per pixel, band and pass.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::rare::{self, Brightest};
use super::tally::Tally;
use crate::lighting::guide::LightGuide;
use crate::sampling::{hash_all, unit};
use crate::simplify::{Class, Simplified};

/// Pixels along each edge of a film tile.
pub const TILE: u32 = 8;

/// Pixels along each edge of a block: tiles that share rare light.
const BLOCK: u32 = 4 * TILE;

/// Running sums of one pass at one pixel, f64.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct PixelSum {
    sum: [f64; 3],
    square: [f64; 3],
    even: [f64; 3],
    trials: u32,
    even_trials: u32,
}

impl PixelSum {
    /// Adds a trial. Trials with even and odd numbers come from independent scramblings.
    pub fn add(&mut self, value: Vec3, even: bool) {
        for (band, v) in value.to_array().map(f64::from).into_iter().enumerate() {
            self.sum[band] += v;
            self.square[band] += v * v;
            if even {
                self.even[band] += v;
            }
        }
        self.trials += 1;
        self.even_trials += u32::from(even);
    }

    /// Puts another value in the place of a trial's.
    pub fn replace(&mut self, old: Vec3, new: Vec3, even: bool) {
        let [old, new] = [old, new].map(|v| v.to_array().map(f64::from));
        for band in 0..3 {
            let more = new[band] - old[band];
            self.sum[band] += more;
            self.square[band] += more * (new[band] + old[band]);
            if even {
                self.even[band] += more;
            }
        }
    }

    /// Makes every trial brighter: by `all` on average, those with even numbers by `even`.
    pub fn raise(&mut self, all: [f64; 3], even: [f64; 3]) {
        let (n, even_n) = (f64::from(self.trials), f64::from(self.even_trials));
        for band in 0..3 {
            self.square[band] += all[band] * (2.0 * self.sum[band] + n * all[band]);
            self.sum[band] += n * all[band];
            self.even[band] += even_n * even[band];
        }
    }

    /// Number of trials.
    pub fn trials(&self) -> u32 {
        self.trials
    }

    /// Mean radiance per band; zero without trials.
    pub fn mean(&self) -> [f64; 3] {
        let n = f64::from(self.trials.max(1));
        self.sum.map(|s| s / n)
    }

    /// Variance of a single trial per band; zero with fewer than two trials.
    pub fn variance(&self) -> [f64; 3] {
        let n = f64::from(self.trials);
        if self.trials < 2 {
            return [0.0; 3];
        }
        std::array::from_fn(|b| ((self.square[b] - self.sum[b] * self.sum[b] / n) / (n - 1.0)).max(0.0))
    }

    /// The paper's `L_dev`: standard error of the mean as if trials were independent. They are better than that (stratified),
    /// so this is an upper estimate.
    pub fn dev(&self) -> [f64; 3] {
        let n = f64::from(self.trials.max(1));
        self.variance().map(|v| (v / n).sqrt())
    }

    /// Means of the even and of the odd trials, two independent estimates; `None` when one of them has no trial.
    pub fn halves(&self) -> Option<([f64; 3], [f64; 3])> {
        let odd_trials = self.trials - self.even_trials;
        if self.even_trials == 0 || odd_trials == 0 {
            return None;
        }
        let even = self.even.map(|s| s / f64::from(self.even_trials));
        let odd = std::array::from_fn(|b| (self.sum[b] - self.even[b]) / f64::from(odd_trials));
        Some((even, odd))
    }
}

/// What the first visible surface looks like: of one trial, or summed over trials.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Feature {
    /// Reflectance, all lobes.
    pub albedo: Vec3,
    /// Shading normal, world space.
    pub normal: Vec3,
    /// Distance along the view ray.
    pub depth: f32,
    /// Trials that hit something.
    pub hits: u32,
    /// 1 where the surface is complex and in a cluster.
    pub clustered: f32,
    /// 1 where the surface is complex and was dropped.
    pub dropped: f32,
    /// False colour of the cluster, black where there is none.
    pub cluster: Vec3,
    /// Radiosities looked up by gather rays.
    pub lookups: u32,
    /// Summed lengths of the rays that looked them up.
    pub lookup_distance: f32,
    /// Gather rays that met the detailed scene within reach.
    pub near: u32,
}

impl Feature {
    /// Records what simplification made of the surface that a triangle belongs to.
    pub fn classify(&mut self, simplified: &Simplified, triangle: u32) {
        let surface = simplified.surface_of_triangle[triangle as usize];
        match simplified.surfaces[surface as usize].class {
            Class::Normal => {}
            Class::Complex { cluster: None } => self.dropped = 1.0,
            Class::Complex { cluster: Some(cluster) } => {
                self.clustered = 1.0;
                // Neighbouring numbers get unlike colours, none of them dark.
                self.cluster = Vec3::from_array([0, 1, 2].map(|band| 0.2 + 0.8 * unit(hash_all(&[cluster, band]))));
            }
        }
    }
}

impl std::ops::AddAssign for Feature {
    fn add_assign(&mut self, o: Self) {
        self.albedo += o.albedo;
        self.normal += o.normal;
        self.depth += o.depth;
        self.hits += o.hits;
        self.clustered += o.clustered;
        self.dropped += o.dropped;
        self.cluster += o.cluster;
        self.lookups += o.lookups;
        self.lookup_distance += o.lookup_distance;
        self.near += o.near;
    }
}

/// One pixel.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Pixel {
    /// Emission, highly directional chains and direct light.
    pub hires: PixelSum,
    /// Indirect light.
    pub lores: PixelSum,
    /// The trials of LORES that may have to be shared with other pixels, where indirect light is interpolated.
    pub brightest: Brightest,
    /// The first visible surface.
    pub feature: Feature,
}

impl Pixel {
    /// Radiance of both passes.
    pub fn radiance(&self) -> Vec3 {
        let sum = add(self.hires.mean(), self.lores.mean());
        Vec3::from_array(sum.map(|band| band as f32))
    }
}

/// A rectangle of pixels of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Left and top pixel.
    pub low: [u32; 2],
    /// The pixel after the right and bottom ones.
    pub high: [u32; 2],
}

impl Region {
    /// All of an image.
    pub fn whole(size: [u32; 2]) -> Self {
        Region { low: [0, 0], high: size }
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        [0, 1].map(|axis| self.high[axis] - self.low[axis])
    }

    /// Columns and rows of the tiles that its pixels depend on, in an image of `size` pixels: those of all blocks that it touches.
    pub fn tiles(&self, size: [u32; 2]) -> [std::ops::Range<u32>; 2] {
        [0, 1].map(|axis| {
            let high = self.high[axis].next_multiple_of(BLOCK).min(size[axis]);
            self.low[axis] / BLOCK * BLOCK / TILE..high.div_ceil(TILE)
        })
    }

    /// Part `number` (from 0) of `parts` that an image is cut into, along the borders of blocks, or of film tiles where there are less blocks than
    /// parts; `None` when it has less tiles across or down than parts are needed there.
    pub fn part(number: u32, parts: u32, size: [u32; 2]) -> Option<Self> {
        // As many across as makes the parts most nearly square.
        let wide = |across: &u32| {
            let [w, h] = [size[0] / across, size[1] * across / parts].map(|n| f64::from(n.max(1)));
            (w / h).ln().abs()
        };
        let divisors = (1..=parts).filter(|d| parts.is_multiple_of(*d));
        let across = divisors.min_by(|a, b| wide(a).total_cmp(&wide(b)))?;
        let grid = [across, parts / across];
        let place = [number % across, number / across];
        let unit = if (0..2).all(|axis| size[axis].div_ceil(BLOCK) >= grid[axis]) { BLOCK } else { TILE };
        let units = size.map(|n| n.div_ceil(unit));
        let border =
            |axis: usize, i: u32| (u64::from(units[axis]) * u64::from(i) / u64::from(grid[axis])) as u32 * unit;
        let low = [0, 1].map(|axis| border(axis, place[axis]));
        let high = [0, 1].map(|axis| border(axis, place[axis] + 1).min(size[axis]));
        (low[0] < high[0] && low[1] < high[1]).then_some(Region { low, high })
    }
}

/// A square of pixels that one thread works on at a time.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Left and top pixel.
    pub origin: [u32; 2],
    /// Width and height, at most [`TILE`].
    pub size: [u32; 2],
    /// Pixels row by row.
    pub pixels: Vec<Pixel>,
    /// Where its points find light.
    pub guide: LightGuide,
    /// Trials that were not finite and were dropped.
    pub dropped: u64,
    /// The trial to go on with: those with smaller numbers are in the sums, as far as they are planned.
    pub next: u32,
    /// What it has cost.
    pub tally: Tally,
}

impl Tile {
    /// The empty tile in column and row `place` of an image of `size` pixels.
    pub fn new(place: [u32; 2], size: [u32; 2]) -> Self {
        let origin = place.map(|p| p * TILE);
        let size = [0, 1].map(|axis| TILE.min(size[axis] - origin[axis]));
        let pixels = vec![Pixel::default(); (size[0] * size[1]) as usize];
        Tile { origin, size, pixels, guide: LightGuide::default(), dropped: 0, next: 0, tally: Tally::default() }
    }

    /// Column and row of its pixel number `i`.
    pub fn pixel(&self, i: u32) -> [u32; 2] {
        [self.origin[0] + i % self.size[0], self.origin[1] + i / self.size[0]]
    }
}

/// An image in the making, or a part of one.
#[derive(Clone, Debug)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Left and top pixel within the whole image.
    pub origin: [u32; 2],
    /// Tiles, row by row: all those of the whole image in blocks that hold a pixel of this film. They are rendered whole, so that a
    /// pixel does not depend on which part of the image it is rendered for.
    pub tiles: Vec<Tile>,
}

impl Film {
    /// An empty film of a whole image.
    pub fn new(width: u32, height: u32) -> Self {
        Film::of(Region::whole([width, height]), [width, height])
    }

    /// An empty film of a part of an image of `size`.
    pub fn of(region: Region, size: [u32; 2]) -> Self {
        let [columns, rows] = region.tiles(size);
        let tiles = rows.flat_map(|y| columns.clone().map(move |x| Tile::new([x, y], size))).collect();
        let [width, height] = region.size();
        Film { width, height, origin: region.low, tiles }
    }

    /// The film as it is shown: what few trials bring is shared (see [`rare`]).
    pub fn shared(mut self) -> Self {
        let mut blocks = BTreeMap::<[u32; 2], Vec<&mut Tile>>::new();
        for tile in &mut self.tiles {
            blocks.entry(tile.origin.map(|low| low / BLOCK)).or_default().push(tile);
        }
        blocks.into_par_iter().for_each(|(_, mut tiles)| rare::share(&mut tiles));
        self
    }

    /// All pixels row by row.
    pub fn pixels(&self) -> impl Iterator<Item = &Pixel> {
        let [first_column, first_row] = self.tiles.first().map_or([0; 2], |tile| tile.origin.map(|low| low / TILE));
        let across = self.tiles.iter().take_while(|tile| tile.origin[1] / TILE == first_row).count() as u32;
        (self.origin[1]..self.origin[1] + self.height).flat_map(move |y| {
            (self.origin[0]..self.origin[0] + self.width).map(move |x| {
                let tile = &self.tiles[((y / TILE - first_row) * across + x / TILE - first_column) as usize];
                &tile.pixels[((y % TILE) * tile.size[0] + x % TILE) as usize]
            })
        })
    }

    /// Relative standard error of each pass over the whole image, and of their sum: root of the mean squared error over
    /// the mean of `L^2 + (L_mean / 10)^2`, both measured from the two independent halves of all trials.
    pub fn relative_errors(&self) -> ImageErrors {
        let mean = self.mean_radiance();
        ImageErrors {
            hires: self.relative_error(mean, |p| p.hires.halves()),
            lores: self.relative_error(mean, |p| p.lores.halves()),
            total: self.relative_error(mean, |p| {
                let (h, l) = (p.hires.halves()?, p.lores.halves()?);
                Some((add(h.0, l.0), add(h.1, l.1)))
            }),
        }
    }

    /// Share of LORES in the image, as a relative error of LORES alone becomes one of the image: root of the mean of
    /// `LORES^2 / (L^2 + (L_mean / 10)^2)`.
    pub fn share_of_lores(&self) -> f64 {
        let mean = self.mean_radiance();
        let square = self.mean(|p| {
            let (lores, total) = (p.lores.mean(), add(p.hires.mean(), p.lores.mean()));
            std::array::from_fn(|band| {
                let scale = scale(total[band], mean);
                if scale > 0.0 { lores[band].powi(2) / scale } else { 0.0 }
            })
        });
        square.sqrt()
    }

    /// Mean radiance over all pixels and bands.
    fn mean_radiance(&self) -> f64 {
        self.mean(|p| add(p.hires.mean(), p.lores.mean()))
    }

    /// Mean over all pixels and bands of a value per pixel.
    pub fn mean(&self, value: impl Fn(&Pixel) -> [f64; 3]) -> f64 {
        let sum: f64 = self.pixels().map(|p| value(p).iter().sum::<f64>()).sum();
        sum / (3.0 * f64::from(self.width) * f64::from(self.height))
    }

    /// Root of relMSE with the whole image's radiance in the denominator, as far as `halves` tells.
    fn relative_error(&self, mean: f64, halves: impl Fn(&Pixel) -> Option<([f64; 3], [f64; 3])>) -> f64 {
        let (mut sum, mut count) = (0.0, 0u64);
        for pixel in self.pixels() {
            let Some((a, b)) = halves(pixel) else { continue };
            let total = add(pixel.hires.mean(), pixel.lores.mean());
            for band in 0..3 {
                // Var[(a+b)/2] = E[(a-b)^2] / 4 for independent halves of equal size.
                let squared = 0.25 * (a[band] - b[band]).powi(2);
                let scale = scale(total[band], mean);
                if scale > 0.0 {
                    sum += squared / scale;
                }
                count += 1;
            }
        }
        (sum / (count.max(1) as f64)).sqrt()
    }
}

/// Denominator of a relative squared error: the radiance squared, and for dark pixels a part of the image's mean.
fn scale(radiance: f64, mean: f64) -> f64 {
    radiance.powi(2) + 0.01 * mean * mean
}

/// Relative standard errors of an image, 0..; see [`Film::relative_errors`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageErrors {
    /// Of HIRES.
    pub hires: f64,
    /// Of LORES.
    pub lores: f64,
    /// Of the image.
    pub total: f64,
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_standard_error_of_known_numbers() {
        let mut sum = PixelSum::default();
        for (i, v) in [1.0, 2.0, 3.0, 4.0].into_iter().enumerate() {
            sum.add(Vec3::new(v, 0.0, -v), i % 2 == 0);
        }
        assert_eq!(sum.mean(), [2.5, 0.0, -2.5]);
        let variance = 5.0 / 3.0;
        assert!((sum.dev()[0] - f64::sqrt(variance / 4.0)).abs() < 1e-15);
        assert_eq!(sum.halves().unwrap(), ([2.0, 0.0, -2.0], [3.0, 0.0, -3.0]));
    }

    /// Numbers of the pixels of a film of 19 x 11 pixels, or of a part of it.
    fn order(mut film: Film) -> Vec<u32> {
        for tile in &mut film.tiles {
            for i in 0..tile.pixels.len() as u32 {
                let [x, y] = tile.pixel(i);
                tile.pixels[i as usize].feature.hits = y * 19 + x;
            }
        }
        film.pixels().map(|p| p.feature.hits).collect()
    }

    #[test]
    fn pixels_come_row_by_row_for_odd_sizes() {
        assert_eq!(order(Film::new(19, 11)), (0..19 * 11).collect::<Vec<_>>());
        for (low, high) in [([9, 8], [17, 11]), ([3, 2], [4, 3]), ([7, 0], [19, 9])] {
            let wanted = (low[1]..high[1]).flat_map(|y| (low[0]..high[0]).map(move |x| y * 19 + x));
            assert_eq!(order(Film::of(Region { low, high }, [19, 11])), wanted.collect::<Vec<_>>());
        }
    }

    #[test]
    fn parts_cover_an_image_once() {
        for (size, parts) in [([19, 11], 3), ([640, 360], 7), ([640, 360], 12), ([100, 1000], 5), ([64, 64], 64)] {
            let mut seen = vec![0; (size[0] * size[1]) as usize];
            for number in 0..parts {
                let part = Region::part(number, parts, size).unwrap();
                for y in part.low[1]..part.high[1] {
                    for x in part.low[0]..part.high[0] {
                        seen[(y * size[0] + x) as usize] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|n| *n == 1), "{size:?} in {parts}");
        }
        assert_eq!(Region::part(0, 4, [200, 100]).unwrap().size(), [96, 64]);
        assert_eq!(Region::part(0, 4, [40, 40]).unwrap().size(), [32, 32]);
        assert_eq!(Region::part(0, 16, [40, 40]).unwrap().size(), [8, 8]);
        assert!((0..8).any(|i| Region::part(i, 8, [8, 8]).is_none()), "there is but one tile");
    }
}
