//! Light that few trials bring is shared among the pixels of a block of tiles.
//!
//! Indirect light changes little from pixel to pixel, but some of it arrives on paths that hardly any trial finds: a sunlit sill in a dull
//! reflection, the reflection of a lamp in a vase. A pixel that happens to have such a trial is a bright speck, and those around it are a
//! little too dark. The brightest trials of each pixel are therefore kept apart, and what makes them stand out of the noise is
//! given to the pixels of the block around, in proportion to the indirect light that they have without it and most to those that are
//! as bright as the one it came from, no further than it takes to hide it. Nothing is lost: the block's sum stays what it was, as does its expected
//! value, but this part of it is blurred. (Zirr, Hanika, Dachsbacher 2018 tell such trials apart in the same way but weaken them.)

use std::f64::consts::TAU;

use glam::{IVec2, UVec2, Vec3};
use serde::{Deserialize, Serialize};

use super::film::{Pixel, PixelSum, Tile};

/// Brightest trials that each pixel keeps.
const KEPT: usize = 4;

/// Share of a pixel's radiance that one trial may add to it: what the noise of a finished image hides.
const SEEN: f64 = 0.05;

/// A trial so many times as bright as indirect light around is rare: a trial of any usual kind is not.
const RARE: f64 = 4.0;

/// Standard deviation in pixels of the distances to which light is given: at least this, ...
const REACH: f64 = 3.0;

/// ... and so much that no pixel gets more than this part of what one trial may add.
const PART: f64 = 0.25;

/// The brightest trials of one pixel in LORES, the brightest first.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Brightest([Bright; KEPT]);

/// One of them.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Bright {
    value: Vec3,
    even: bool,
}

impl Brightest {
    /// Keeps a trial if it is among the brightest.
    pub fn offer(&mut self, value: Vec3, even: bool) {
        let brightness = value.element_sum();
        let Some(place) = self.0.iter().position(|kept| brightness > kept.value.element_sum()) else { return };
        self.0[place..].rotate_right(1);
        self.0[place] = Bright { value, even };
    }
}

/// What the pixels of some tiles are judged by, means over bands.
struct Judge {
    /// Indirect light around a pixel.
    usual: Vec<f64>,
    /// Radiance that a trial must not stand out of.
    radiance: Vec<f64>,
    /// Where the pixels are.
    at: Vec<IVec2>,
}

impl Judge {
    fn new(tile: &Tile) -> Self {
        let of = |sum: &PixelSum| sum.mean().iter().sum::<f64>() / 3.0;
        let lores: Vec<f64> = tile.pixels.iter().map(|pixel| of(&pixel.lores)).collect();
        let [width, height] = tile.size.map(|n| n as usize);
        let usual: Vec<f64> = (0..lores.len())
            .map(|i| {
                let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
                let mut near = [0.0; 9];
                let mut count = 0;
                for y in around(i / width, height) {
                    for x in around(i % width, width) {
                        near[count] = lores[y * width + x];
                        count += 1;
                    }
                }
                // The median: pixels with such trials do not raise it.
                let near = &mut near[..count];
                near.sort_by(f64::total_cmp);
                near[(count - 1) / 2]
            })
            .collect();
        let radiance = tile.pixels.iter().zip(&usual).map(|(pixel, usual)| of(&pixel.hires) + usual).collect();
        let at = (0..tile.pixels.len() as u32).map(|i| UVec2::from_array(tile.pixel(i)).as_ivec2()).collect();
        Judge { usual, radiance, at }
    }

    /// Of several tiles, one after the other.
    fn of_all(tiles: &[&mut Tile]) -> Self {
        let mut all = Judge { usual: Vec::new(), radiance: Vec::new(), at: Vec::new() };
        for mut judge in tiles.iter().map(|tile| Judge::new(tile)) {
            all.usual.append(&mut judge.usual);
            all.radiance.append(&mut judge.radiance);
            all.at.append(&mut judge.at);
        }
        all
    }

    /// Largest value of a trial of a pixel, mean over bands, that stays with it.
    fn limit(&self, i: usize, trials: u32) -> f64 {
        (SEEN * f64::from(trials) * self.radiance[i]).max(RARE * self.usual[i])
    }

    /// Shares of the pixels in what pixel `i` gives away, `given` in the mean over bands.
    fn shares(&self, i: usize, given: f64) -> Vec<f64> {
        let here = self.usual[i];
        // The largest share of a normal distribution is 1 / (2 pi variance).
        let variance = (given / (TAU * PART * SEEN * self.radiance[i])).max(REACH * REACH);
        let alike = |there: f64| {
            let (low, high) = (here.min(there), here.max(there));
            if high > 0.0 { low / high } else { 1.0 }
        };
        let close = |at: IVec2| (-0.5 * f64::from((at - self.at[i]).length_squared()) / variance).exp();
        let weight = |(&there, &at): (&f64, &IVec2)| there * alike(there).powi(2) * close(at);
        let weights: Vec<f64> = self.usual.iter().zip(&self.at).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        // Where nothing else is seen, it stays.
        let own = |j: usize| if i == j { 1.0 } else { 0.0 };
        weights.iter().enumerate().map(|(j, weight)| if sum > 0.0 { weight / sum } else { own(j) }).collect()
    }
}

/// Shares what the brightest trials of the pixels of some tiles bring above the usual among all of them.
pub fn share(tiles: &mut [&mut Tile]) {
    let judge = Judge::of_all(tiles);
    let mut shared = vec![Radiance::default(); judge.usual.len()];
    for (i, pixel) in tiles.iter_mut().flat_map(|tile| &mut tile.pixels).enumerate() {
        let Pixel { lores, brightest, .. } = pixel;
        let trials = f64::from(lores.trials());
        let limit = judge.limit(i, lores.trials());
        let mut given = Radiance::default();
        for bright in &brightest.0 {
            let value = f64::from(bright.value.element_sum()) / 3.0;
            if value <= limit {
                break;
            }
            let rest = bright.value * (limit / value) as f32;
            lores.replace(bright.value, rest, bright.even);
            given.add(bright.value - rest, trials, bright.even);
        }
        *brightest = Brightest::default();
        if given.is_black() {
            continue;
        }
        for (to, share) in shared.iter_mut().zip(judge.shares(i, given.all.iter().sum::<f64>() / 3.0)) {
            to.add_share(&given, share);
        }
    }
    for (pixel, light) in tiles.iter_mut().flat_map(|tile| &mut tile.pixels).zip(&shared) {
        pixel.lores.raise(light.all, light.even);
    }
}

/// Mean radiance that trials brought to a pixel: all of them, and twice the part of those with even numbers.
#[derive(Clone, Copy, Default)]
struct Radiance {
    all: [f64; 3],
    even: [f64; 3],
}

impl Radiance {
    fn add(&mut self, value: Vec3, trials: f64, even: bool) {
        for (band, value) in value.to_array().map(f64::from).into_iter().enumerate() {
            self.all[band] += value / trials;
            self.even[band] += if even { 2.0 * value / trials } else { 0.0 };
        }
    }

    fn add_share(&mut self, of: &Radiance, share: f64) {
        for band in 0..3 {
            self.all[band] += share * of.all[band];
            self.even[band] += share * of.even[band];
        }
    }

    fn is_black(&self) -> bool {
        self.all == [0.0; 3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, unit};

    const TRIALS: u32 = 32;

    /// A tile whose pixels have trials around `level`, spread over a factor of three, and one of `bright` in pixel 27 (even) and 36 (odd).
    fn tile(level: impl Fn(u32) -> f32, bright: Vec3) -> Tile {
        let mut tile = Tile::new([0, 0], [8, 8]);
        for (i, pixel) in (0..).zip(&mut tile.pixels) {
            for t in 0..TRIALS {
                let mut value = Vec3::splat(level(i) * (0.5 + unit(hash_all(&[i, t]))));
                if (i, t) == (27, 4) || (i, t) == (36, 7) {
                    value = bright;
                }
                pixel.lores.add(value, t % 2 == 0);
                pixel.brightest.offer(value, t % 2 == 0);
            }
        }
        tile
    }

    fn sum(tile: &Tile, of: impl Fn(&PixelSum) -> [f64; 3]) -> f64 {
        tile.pixels.iter().flat_map(|pixel| of(&pixel.lores)).sum()
    }

    fn even(sum: &PixelSum) -> [f64; 3] {
        sum.halves().unwrap().0
    }

    #[test]
    fn a_speck_goes_and_no_light_is_lost() {
        let bright = Vec3::new(200.0, 100.0, 50.0);
        let before = tile(|_| 1.0, bright);
        let mut after = before.clone();
        share(&mut [&mut after]);
        for of in [PixelSum::mean, even] {
            let (before, after) = (sum(&before, of), sum(&after, of));
            assert!((after / before - 1.0).abs() < 1e-6, "{before} {after}");
        }
        // What one trial may bring, and what two of them gave to all.
        let most = 1.0 + RARE.max(SEEN * f64::from(TRIALS)) * 2.0 / f64::from(TRIALS);
        let given = 2.0 * 200.0 / f64::from(TRIALS) / 64.0;
        let lores = &after.pixels[27].lores;
        assert!(lores.mean()[0] < 1.2 * most + given, "{:?}", lores.mean());
        assert!(lores.variance()[0] < 0.1 * before.pixels[27].lores.variance()[0]);
        let (a, b) = lores.halves().unwrap();
        assert!((0.5 * (a[0] + b[0]) - lores.mean()[0]).abs() < 1e-6);
    }

    #[test]
    fn usual_trials_stay_bit_for_bit() {
        let before = tile(|i| 1.0 + 0.02 * i as f32, Vec3::ONE);
        let mut after = before.clone();
        share(&mut [&mut after]);
        for (before, after) in before.pixels.iter().zip(&after.pixels) {
            assert_eq!((before.lores.mean(), before.lores.variance()), (after.lores.mean(), after.lores.variance()));
        }
    }

    /// What is a little too bright is hidden among the nearest pixels, what is very bright needs all.
    #[test]
    fn it_goes_no_further_than_it_must() {
        let far_over_near = |bright: f32| {
            let before = tile(|_| 1.0, Vec3::splat(bright));
            let mut after = before.clone();
            share(&mut [&mut after]);
            let more = |i: usize| after.pixels[i].lores.mean()[0] - before.pixels[i].lores.mean()[0];
            more(0) / more(35)
        };
        let (little, much) = (far_over_near(8.0), far_over_near(8000.0));
        assert!(little < 0.5 && much > 0.9, "{little} {much}");
    }

    /// A dark table in front of a bright wall: what a trial at the wall found stays on the wall, and black stays black.
    #[test]
    fn it_goes_to_pixels_that_are_alike() {
        let level = |i: u32| match i % 8 {
            0..=4 => 1.0,
            5..=6 => 0.05,
            _ => 0.0,
        };
        let mut shared = tile(level, Vec3::splat(100.0));
        let before = shared.clone();
        share(&mut [&mut shared]);
        let more = |i: usize| shared.pixels[i].lores.mean()[0] - before.pixels[i].lores.mean()[0];
        assert!(more(0) > 0.05 && more(5) < 1e-3 * more(0) && more(7) == 0.0, "{} {} {}", more(0), more(5), more(7));
    }

    #[test]
    fn light_that_only_one_pixel_sees_stays() {
        let before = tile(|_| 0.0, Vec3::ONE);
        let mut after = before.clone();
        share(&mut [&mut after]);
        for i in [0, 27, 36] {
            let [before, after] = [&before, &after].map(|tile| tile.pixels[i].lores.mean()[0]);
            assert!((after - before).abs() <= 1e-12 * before);
        }
    }
}
