//! The environment as a light source: directions sampled in proportion to what arrives from them.
//!
//! The map is cut into blocks. Which block is sampled depends on the surface: on how much the block sends, whether it is above
//! the surface, and how much of it is seen from there ([`Openings`]): through a window only a small part of the sky is. Within a
//! block the density is piecewise constant over the map's cells (pbrt 4ed 12.5). The sun's disk is one more block.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::band_shares;
use super::openings::Openings;
use crate::backend::RayScene;
use crate::sampling::{basis, hash_all, sobol};
use crate::scene::{Environment, Scene, SunDisk};

/// Most blocks around the horizon and from pole to pole.
const MOST: [usize; 2] = [16, 8];
/// Blocks at most, and the sun.
pub(super) const BLOCKS: usize = MOST[0] * MOST[1] + 1;

/// Directions within each block that are tried to find out from where it is seen: so few that they need not be drawn for each point.
const LOOKS: u32 = 64;

/// An [`Environment`], ready to be sampled.
#[derive(Debug)]
pub(super) struct EnvironmentLight {
    environment: Arc<Environment>,
    /// Number of blocks across and down.
    grid: [usize; 2],
    blocks: Box<Blocks>,
    /// For each column of blocks, running sums over the rows within each block; the last one of a block is 1.
    rows: Vec<f32>,
    /// Row by row, running sums over the columns within each block.
    columns: Vec<f32>,
    openings: Openings,
    /// Integral of radiance over all directions, W/m^2 per band.
    pub total: DVec3,
}

/// What decides between blocks, the sun last. Blocks that are not there send nothing.
#[derive(Debug)]
struct Blocks {
    /// Middle.
    axis: [[f32; BLOCKS]; 3],
    /// Sine of the angle between the middle and the farthest corner, or [`BEYOND`] a right angle.
    sin: [f32; BLOCKS],
    /// Integral of radiance, by shares of the total in each band.
    power: [f32; BLOCKS],
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub direction: Vec3,
    pub radiance: Vec3,
    /// Density per solid angle.
    pub pdf: f64,
}

/// More than 1: no surface has all of a block that reaches beyond a right angle below it.
const BEYOND: f32 = 1.5;
const SUN: usize = BLOCKS - 1;

impl EnvironmentLight {
    /// `None` when it is black.
    pub(super) fn new(environment: &Arc<Environment>) -> Option<Self> {
        let [w, h] = environment.size();
        let grid = [w.min(MOST[0]), h.min(MOST[1])];
        // Of each row the integral within each column of blocks. Collected before it is added up: the order of a parallel sum would
        // depend on the threads.
        let row = |row: usize| {
            let solid_angle = row_cosines(row, h).solid_angle(w);
            (0..grid[0]).map(move |b| {
                span(b, grid[0], w).map(|c| environment.cell_mean(c, row).as_dvec3()).sum::<DVec3>() * solid_angle
            })
        };
        let parts: Vec<DVec3> = (0..h).into_par_iter().flat_map_iter(row).collect();
        let of_sun = environment.sun().map_or(DVec3::ZERO, |sun| sun.radiance.as_dvec3() * sun.solid_angle());
        let total = parts.iter().sum::<DVec3>() + of_sun;
        if total == DVec3::ZERO {
            return None;
        }
        let share = |value: DVec3| band_shares(value.to_array(), total.to_array());
        let mut light = EnvironmentLight {
            environment: Arc::clone(environment),
            grid,
            blocks: Box::new(Blocks { axis: [[0.0; BLOCKS]; 3], sin: [BEYOND; BLOCKS], power: [0.0; BLOCKS] }),
            rows: Vec::with_capacity(grid[0] * h),
            columns: Vec::new(),
            openings: Openings::default(),
            total,
        };
        for across in 0..grid[0] {
            for down in 0..grid[1] {
                let of_rows = || span(down, grid[1], h).map(|row| share(parts[row * grid[0] + across]));
                light.rows.extend(running_shares(of_rows()));
                light.place(down * grid[0] + across, [across, down], of_rows().sum::<f64>() as f32);
            }
        }
        let cells = |row: usize| {
            (0..grid[0]).flat_map(move |b| {
                running_shares(span(b, grid[0], w).map(|c| share(environment.cell_mean(c, row).as_dvec3())))
            })
        };
        light.columns = (0..h).into_par_iter().flat_map_iter(cells).collect();
        if let Some(sun) = environment.sun() {
            light.blocks.set(SUN, sun.direction, sun.sin_radius, share(of_sun) as f32);
        }
        Some(light)
    }

    /// Finds out what of it is seen from where.
    pub(super) fn look_out(&mut self, scene: &Scene, rays: &dyn RayScene, seed: u32) {
        let in_block = |block: usize| {
            let number = if self.blocks.power[block] > 0.0 { LOOKS } else { 0 };
            let look = |k: u32| {
                let [x, y, ..] = sobol(k, 0, hash_all(&[seed, block as u32]));
                self.direction_in(block, [x, y])
            };
            (0..number).map(look).collect()
        };
        let directions: Vec<Vec<Vec3>> = (0..BLOCKS).map(in_block).collect();
        self.openings = Openings::find(scene, rays, seed, &directions);
    }

    /// Sets middle and extent of a block of the map.
    fn place(&mut self, block: usize, [across, down]: [usize; 2], power: f32) {
        let [w, h] = self.environment.size();
        let (columns, rows) = (span(across, self.grid[0], w), span(down, self.grid[1], h));
        let at = |x: f64, y: f64| {
            let u = (columns.start as f64 + x * columns.len() as f64) / w as f64;
            let v = (rows.start as f64 + y * rows.len() as f64) / h as f64;
            self.environment.direction(u as f32, (PI * v).cos() as f32)
        };
        let middle = at(0.5, 0.5);
        // Of a block less than a hemisphere wide the corners or the middles of the edges are farthest.
        let steps = [0.0, 0.25, 0.5, 0.75, 1.0];
        let corners = steps.iter().flat_map(|&x| steps.map(|y| at(x, y)));
        let least = corners.map(|c| c.dot(middle)).fold(1.0, f32::min);
        // A margin for rounding and for what lies between the points.
        let cos = least - 0.02;
        let sin = if cos <= 0.0 || columns.len() * 3 > w { BEYOND } else { (1.0 - cos * cos).sqrt() };
        self.blocks.set(block, middle, sin, power);
    }

    /// Radiance from a unit direction.
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        self.environment.radiance(direction)
    }

    /// A direction for a surface with `normal` (zero: for any) at `position`. `choice` chooses the block.
    pub(super) fn sample(&self, position: Vec3, normal: Vec3, choice: f64, u: [f32; 2]) -> Option<Direction> {
        self.sample_weighted(&self.weights(position, normal), choice, u)
    }

    /// A direction, whatever the surface.
    pub(super) fn sample_any(&self, choice: f64, u: [f32; 2]) -> Option<Direction> {
        self.sample_weighted(&self.blocks.power, choice, u)
    }

    fn sample_weighted(&self, weights: &[f32; BLOCKS], choice: f64, u: [f32; 2]) -> Option<Direction> {
        let sum = sum(weights);
        let mut rest = choice * sum;
        let mut chosen = None;
        for (block, weight) in weights.iter().map(|&w| f64::from(w)).enumerate() {
            if weight > 0.0 {
                chosen = Some(block);
                if rest < weight {
                    break;
                }
                rest -= weight;
            }
        }
        let block = chosen?;
        let direction = self.direction_in(block, u);
        let mut radiance = self.environment.radiance(direction);
        let mut pdf = self.density(weights, direction) / sum;
        if let (SUN, Some(sun)) = (block, self.environment.sun().filter(|sun| !sun.holds(direction))) {
            // On the disk's edge, outside by rounding.
            radiance += sun.radiance;
            pdf += f64::from(weights[SUN]) / (sum * sun.solid_angle());
        }
        Some(Direction { direction, radiance, pdf })
    }

    /// Density per solid angle with which [`EnvironmentLight::sample`] chooses `direction`.
    pub(super) fn pdf(&self, position: Vec3, normal: Vec3, direction: Vec3) -> f64 {
        let weights = self.weights(position, normal);
        let density = self.density(&weights, direction);
        if density > 0.0 { density / sum(&weights) } else { 0.0 }
    }

    fn weights(&self, position: Vec3, normal: Vec3) -> [f32; BLOCKS] {
        let open = self.openings.at(position);
        let Blocks { axis: [x, y, z], sin, power } = &*self.blocks;
        std::array::from_fn(|b| {
            // Above 0 where any direction of the block is above the surface.
            let cos =
                if normal == Vec3::ZERO { 1.0 } else { x[b] * normal.x + y[b] * normal.y + z[b] * normal.z + sin[b] };
            power[b] * cos.max(0.0) * open[b]
        })
    }

    /// Density of a direction when blocks are chosen by `weights`, which may have any sum.
    fn density(&self, weights: &[f32; BLOCKS], direction: Vec3) -> f64 {
        let [w, h] = self.environment.size();
        let [u, v] = self.environment.coordinates(direction);
        let column = ((u * w as f32) as usize).min(w - 1);
        let row = ((v * h as f32) as usize).min(h - 1);
        let [across, down] = [part(column, self.grid[0], w), part(row, self.grid[1], h)];
        let (rows, columns) = (span(down, self.grid[1], h), span(across, self.grid[0], w));
        let share = |sums: &[f32], i: usize| f64::from(sums[i]) - if i == 0 { 0.0 } else { f64::from(sums[i - 1]) };
        let of_row = share(&self.rows[across * h..][rows.clone()], row - rows.start);
        let of_column = share(&self.columns[row * w..][columns.clone()], column - columns.start);
        let block = f64::from(weights[down * self.grid[0] + across]);
        let of_sun = match self.environment.sun() {
            Some(sun) if sun.holds(direction) => f64::from(weights[SUN]) / sun.solid_angle(),
            _ => 0.0,
        };
        of_sun + block * of_row * of_column / row_cosines(row, h).solid_angle(w)
    }

    /// A direction within a block that sends light.
    fn direction_in(&self, block: usize, [x, y]: [f32; 2]) -> Vec3 {
        if let (SUN, Some(sun)) = (block, self.environment.sun()) {
            return sample_sun(sun, [x, y]);
        }
        let [w, h] = self.environment.size();
        let [across, down] = [block % self.grid[0], block / self.grid[0]];
        let (rows, columns) = (span(down, self.grid[1], h), span(across, self.grid[0], w));
        let (row, within_row) = invert(&self.rows[across * h..][rows.clone()], y);
        let row = rows.start + row;
        let (column, within_column) = invert(&self.columns[row * w..][columns.clone()], x);
        let column = (columns.start + column) as f64 + within_column;
        let cosines = row_cosines(row, h);
        let cos = cosines.above + within_row * (cosines.below - cosines.above);
        self.environment.direction((column / w as f64) as f32, cos as f32)
    }
}

impl Blocks {
    fn set(&mut self, block: usize, middle: Vec3, sin: f32, power: f32) {
        for (axis, value) in self.axis.iter_mut().zip(middle.to_array()) {
            axis[block] = value;
        }
        self.sin[block] = sin;
        self.power[block] = power;
    }
}

fn sum(weights: &[f32; BLOCKS]) -> f64 {
    weights.iter().map(|&w| f64::from(w)).sum()
}

/// The cells of part `i` of `parts` that `cells` are cut into.
fn span(i: usize, parts: usize, cells: usize) -> Range<usize> {
    (i * cells).div_ceil(parts)..((i + 1) * cells).div_ceil(parts)
}

/// The part that a cell belongs to.
fn part(cell: usize, parts: usize, cells: usize) -> usize {
    cell * parts / cells
}

fn sample_sun(sun: &SunDisk, [x, y]: [f32; 2]) -> Vec3 {
    // Uniform over the cap, from one minus the cosine so that a small one keeps its digits.
    let below = f64::from(x) * sun.one_minus_cos();
    let sin = (below * (2.0 - below)).sqrt();
    let (sin_phi, cos_phi) = (TAU * f64::from(y)).sin_cos();
    let local = DVec3::new(sin * cos_phi, sin * sin_phi, 1.0 - below).as_vec3();
    (basis(sun.direction) * local).normalize()
}

/// Cosines of the angles from the zenith between which a row lies.
struct Cosines {
    above: f64,
    below: f64,
}

impl Cosines {
    /// Solid angle of each of `columns` cells.
    fn solid_angle(&self, columns: usize) -> f64 {
        TAU / columns as f64 * (self.above - self.below)
    }
}

fn row_cosines(row: usize, rows: usize) -> Cosines {
    let cos = |row: usize| (PI * row as f64 / rows as f64).cos();
    Cosines { above: cos(row), below: cos(row + 1) }
}

/// Running sums of `values` over their total; zeros where all are zero.
fn running_shares(values: impl Iterator<Item = f64>) -> Vec<f32> {
    let mut sum = 0.0;
    let sums: Vec<f64> = values
        .map(|v| {
            sum += v;
            sum
        })
        .collect();
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    sums.into_iter().map(|s| (s * scale) as f32).collect()
}

/// The entry that holds `u`, 0..1, and where in it `u` lies, 0..1.
fn invert(sums: &[f32], u: f32) -> (usize, f64) {
    let found = sums.partition_point(|&s| s <= u);
    // By rounding, `u` may be above the last sum: then it is in the last entry that has a width.
    let last = || sums.partition_point(|&s| s < sums[sums.len() - 1]);
    let i = if found < sums.len() { found } else { last() };
    let before = if i == 0 { 0.0 } else { f64::from(sums[i - 1]) };
    let width = f64::from(sums[i]) - before;
    (i, if width > 0.0 { ((f64::from(u) - before) / width).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_belongs_to_one_part() {
        for (parts, cells) in [(1, 1), (3, 7), (16, 2048), (7, 7), (5, 9)] {
            for cell in 0..cells {
                let holds = |i: &usize| span(*i, parts, cells).contains(&cell);
                assert_eq!((0..parts).filter(holds).collect::<Vec<_>>(), [part(cell, parts, cells)]);
            }
        }
    }

    #[test]
    fn blocks_reach_as_far_as_their_directions() {
        let texels = (0..40 * 20).map(|i| Vec3::splat(1.0 + (i % 7) as f32)).collect();
        for size in [[40, 20], [100, 8], [8, 100], [1, 800], [800, 1]] {
            let map = Environment::new("map".to_owned(), size, Vec::clone(&texels)).rotated(0.3);
            let light = EnvironmentLight::new(&Arc::new(map)).unwrap();
            for block in 0..light.grid[0] * light.grid[1] {
                let axis = Vec3::from_array(light.blocks.axis.map(|a| a[block]));
                for i in 0..200 {
                    let u = [0, 1].map(|k| crate::sampling::unit(crate::sampling::hash_all(&[block as u32, i, k])));
                    let d = light.direction_in(block, u);
                    let sin = if d.dot(axis) < 0.0 { BEYOND } else { d.cross(axis).length() };
                    assert!(sin <= light.blocks.sin[block], "{size:?}, block {block}: {sin}");
                }
            }
        }
    }
}
