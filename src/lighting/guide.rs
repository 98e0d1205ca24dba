//! Sampling light where it was found before: what of all light sources is seen from a small region, and from which part of them.
//!
//! [`Lights::sample`](super::Lights::sample) maps three random numbers to a point on a light source in proportion to what it would bring if
//! nothing were in its way. Much of it is: panels outside a window, the sun behind a wall, lamps in another room. A [`LightGuide`]
//! remembers for each cell of the unit cube of these numbers what samples from there brought, and sends later samples through a
//! piecewise linear map that makes the density of a cell proportional to the root of the mean square of that, as is best for the
//! variance. The map keeps the order of each number, so that stratified points stay stratified. Their weights are divided by
//! the density: means do not change.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Cells along each of the three random numbers.
const SIDE: usize = 8;

const CELLS: usize = SIDE * SIDE * SIDE;

/// Stands for the cell of numbers that no guide was asked for.
const NO_CELL: u32 = u32::MAX;

/// Share of samples that are spread evenly whatever was found: what is rare may not have been found yet.
const EVEN: f32 = 0.2;

/// What is known of a cell counts as if so many samples had found there what all cells bring on average.
const DOUBT: f32 = 4.0;

/// A map is used where it brings the mean square of samples down to this share: one that brings less adds more noise of its own, where
/// samples differed by chance, than it takes away.
const USEFUL: f32 = 0.85;

/// Random numbers that went through a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guided {
    /// The numbers to use, 0..1.
    pub u: [f32; 3],
    /// What the sample is to be multiplied with: one over the density.
    pub factor: f32,
    /// The cell they are in, for [`LightGuide::found`]; [`NO_CELL`] without a guide.
    cell: u32,
}

impl Guided {
    /// Numbers as they are.
    pub fn plain(u: [f32; 3]) -> Self {
        Guided { u, factor: 1.0, cell: NO_CELL }
    }
}

/// What was found, and the map that follows from what was found up to some time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LightGuide {
    /// By cell: sums of squares of what samples brought, by band, and numbers of samples. Empty until the first.
    sums: Vec<[f32; 3]>,
    counts: Vec<f32>,
    /// Cumulative probabilities: of slabs, of rows in each slab, of cells in each row. Empty while there is no map.
    cumulative: Vec<f32>,
}

/// Cell of a point of the unit cube along one axis.
fn place(u: f32) -> usize {
    ((u * SIDE as f32) as usize).min(SIDE - 1)
}

/// Finds the step of a cumulative distribution that holds `u`, where in it, and its probability.
fn find(cumulative: &[f32], u: f32) -> (usize, f32, f32) {
    let step = cumulative[..SIDE - 1].iter().filter(|&&end| u >= end).count();
    let low = if step == 0 { 0.0 } else { cumulative[step - 1] };
    let probability = cumulative[step] - low;
    (step, ((u - low) / probability).clamp(0.0, 1.0), probability)
}

impl LightGuide {
    /// Maps three random numbers for a sample that will be drawn.
    pub fn draw(&mut self, u: [f32; 3]) -> Guided {
        let mapped = self.map(u);
        if self.counts.is_empty() {
            (self.sums, self.counts) = (vec![[0.0; 3]; CELLS], vec![0.0; CELLS]);
        }
        let [a, b, c] = mapped.u.map(place);
        let cell = (a * SIDE + b) * SIDE + c;
        self.counts[cell] += 1.0;
        Guided { cell: cell as u32, ..mapped }
    }

    fn map(&self, u: [f32; 3]) -> Guided {
        if self.cumulative.is_empty() {
            return Guided::plain(u);
        }
        let (slabs, rest) = self.cumulative.split_at(SIDE);
        let (rows, cells) = rest.split_at(SIDE * SIDE);
        let (a, ua, pa) = find(slabs, u[0]);
        let (b, ub, pb) = find(&rows[a * SIDE..], u[1]);
        let (c, uc, pc) = find(&cells[(a * SIDE + b) * SIDE..], u[2]);
        let within = |step: usize, rest: f32| ((step as f32 + rest) / SIDE as f32).min(1.0 - 0.5 * f32::EPSILON);
        let u = [within(a, ua), within(b, ub), within(c, uc)];
        Guided { u, factor: 1.0 / (pa * pb * pc * CELLS as f32), cell: NO_CELL }
    }

    /// A sample brought something: `value`, without the factor of [`Guided`].
    pub fn found(&mut self, guided: &Guided, value: Vec3) {
        if let Some(sums) = self.sums.get_mut(guided.cell as usize) {
            for (sum, value) in sums.iter_mut().zip(value.to_array()) {
                *sum += value * value;
            }
        }
    }

    /// Whether it has as many cells as it must, for one that was read from a file.
    pub fn is_sound(&self) -> bool {
        let fits = |values: &[f32], size: usize| values.is_empty() || values.len() == size;
        let steps = SIDE + SIDE * SIDE + CELLS;
        self.sums.len() == self.counts.len() && fits(&self.counts, CELLS) && fits(&self.cumulative, steps)
    }

    /// From now on the map follows what was found until now.
    pub fn learn(&mut self) {
        // Each band counts by its own light: the lights of all of them are needed.
        let mut total = [0.0; 3];
        for sums in &self.sums {
            (0..3).for_each(|band| total[band] += sums[band]);
        }
        let share = |sum: f32, total: f32| if total > 0.0 { sum / total } else { 0.0 };
        let shares = |sums: &[f32; 3]| (0..3).map(|band| share(sums[band], total[band])).sum::<f32>();
        let squares: Vec<f32> = self.sums.iter().map(shares).collect();
        let all: f32 = squares.iter().sum();
        self.cumulative.clear();
        if !(all > 0.0 && all.is_finite()) {
            return;
        }
        let mean = all / self.counts.iter().sum::<f32>();
        let (squares, counts) = (blurred(&squares), blurred(&self.counts));
        let expected = |(square, count): (&f32, &f32)| (square + DOUBT * mean) / (count + DOUBT);
        let squares: Vec<f32> = squares.iter().zip(&counts).map(expected).collect();
        let mut density: Vec<f32> = squares.iter().map(|square| square.sqrt()).collect();
        let all: f32 = density.iter().sum();
        // Mean square of a sample over the map's density, and without it; sums over cells.
        if all * all / CELLS as f32 > USEFUL * squares.iter().sum::<f32>() {
            return;
        }
        for value in &mut density {
            *value = (1.0 - EVEN) * *value / all + EVEN / CELLS as f32;
        }
        let sum_of =
            |values: &[f32], size: usize| -> Vec<f32> { values.chunks(size).map(|c| c.iter().sum()).collect() };
        let rows = sum_of(&density, SIDE);
        let slabs = sum_of(&rows, SIDE);
        for level in [&slabs, &rows, &density] {
            for steps in level.chunks(SIDE) {
                let sum: f32 = steps.iter().sum();
                let mut end = 0.0;
                self.cumulative.extend(steps.iter().map(|step| {
                    end += step / sum;
                    end
                }));
            }
        }
    }
}

/// Each cell with half of its neighbours' values along each axis.
fn blurred(values: &[f32]) -> Vec<f32> {
    let mut values = values.to_vec();
    for stride in [1, SIDE, SIDE * SIDE] {
        let before = values.clone();
        for (i, value) in values.iter_mut().enumerate() {
            let at = i / stride % SIDE;
            if at > 0 {
                *value += 0.5 * before[i - stride];
            }
            if at + 1 < SIDE {
                *value += 0.5 * before[i + stride];
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, sobol};

    /// A light that is seen through a window: a part of the cube.
    fn window([a, b, c]: [f32; 3]) -> f32 {
        let seen = (0.3..0.5).contains(&a) && b > 0.6 && (0.2..0.7).contains(&c);
        if seen { 1.0 + b + c } else { 0.0 }
    }

    fn points(count: u32, stream: u32) -> impl Iterator<Item = [f32; 3]> {
        (0..count).map(move |i| {
            let [a, b, c, _] = sobol(i, 0, stream);
            [a, b, c]
        })
    }

    fn trained(light: impl Fn([f32; 3]) -> f32, samples: u32) -> LightGuide {
        let mut guide = LightGuide::default();
        for u in points(samples, 7) {
            let guided = guide.draw(u);
            guide.found(&guided, Vec3::splat(light(guided.u)));
        }
        guide.learn();
        guide
    }

    /// Mean and variance of one sample.
    fn moments(guide: &LightGuide, light: impl Fn([f32; 3]) -> f32) -> [f64; 2] {
        let count = 1 << 18;
        let (mut sum, mut square) = (0.0, 0.0);
        for u in points(count, 99) {
            let guided = guide.map(u);
            let value = f64::from(light(guided.u) * guided.factor);
            sum += value;
            square += value * value;
        }
        let mean = sum / f64::from(count);
        [mean, square / f64::from(count) - mean * mean]
    }

    #[test]
    fn means_stay_and_variance_falls() {
        let [plain, guided] = [LightGuide::default(), trained(window, 1024)].map(|guide| moments(&guide, window));
        // 0.2 * integral of 1 + b + c over 0.6..1 and 0.2..0.7.
        let exact = 0.2 * 0.4 * 0.5 * (1.0 + 0.8 + 0.45);
        for [mean, variance] in [plain, guided] {
            // Five standard errors of as many independent points.
            assert!((mean - exact).abs() < 5.0 * (variance / f64::from(1 << 18)).sqrt(), "{mean} {exact}");
        }
        assert!(guided[1] < 0.4 * plain[1], "{} {}", guided[1], plain[1]);
    }

    /// Parts that were never found are sampled all the same, and count as much as they must.
    #[test]
    fn what_was_not_found_is_not_lost() {
        let elsewhere = |u: [f32; 3]| window([1.0 - u[0], u[1], u[2]]);
        let [mean, variance] = moments(&trained(window, 4096), elsewhere);
        let [exact, plain] = moments(&LightGuide::default(), elsewhere);
        assert!((mean - exact).abs() < 0.01 * exact);
        assert!(variance < plain / f64::from(EVEN) * 1.1, "{variance} {plain}");
    }

    /// A weak green light beside a strong red one is needed as much, for its band.
    #[test]
    fn every_band_counts_by_its_own_light() {
        let mut guide = LightGuide::default();
        for u in points(1024, 7) {
            let guided = guide.draw(u);
            let [a, b, _] = guided.u;
            let lit = (0.25..0.5).contains(&b);
            let light = if a < 0.5 { Vec3::X * 1e3 } else { Vec3::Y * 1e-3 };
            guide.found(&guided, if lit { light } else { Vec3::ZERO });
        }
        guide.learn();
        let left = points(4096, 5).filter(|&u| guide.map(u).u[0] < 0.5).count();
        assert!(left.abs_diff(2048) < 40, "{left}");
        // Of 1024 without a map.
        let lit = points(4096, 5).filter(|&u| (0.25..0.5).contains(&guide.map(u).u[1])).count();
        assert!(lit > 1500, "{lit}");
    }

    /// What differs by chance alone is no reason for a map.
    #[test]
    fn chance_is_not_learnt() {
        let coin = |u: [f32; 3]| (hash_all(&u.map(f32::to_bits)) & 1) as f32;
        for u in points(64, 3) {
            assert_eq!(trained(coin, 1024).map(u), Guided::plain(u));
        }
    }

    #[test]
    fn the_order_of_numbers_stays() {
        let guide = trained(window, 1024);
        let mut last = -1.0;
        for i in 0..4096 {
            let [a, ..] = guide.map([i as f32 / 4096.0, 0.5, 0.5]).u;
            assert!((0.0..1.0).contains(&a) && a >= last);
            last = a;
        }
        let [a, b, c] = guide.map([1.0 - 0.5 * f32::EPSILON; 3]).u;
        assert!(a < 1.0 && b < 1.0 && c < 1.0);
    }

    #[test]
    fn without_light_nothing_changes() {
        let guide = trained(|_| 0.0, 64);
        for u in points(64, 3) {
            assert_eq!(guide.map(u), Guided::plain(u));
        }
    }
}
