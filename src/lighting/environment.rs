//! The environment as a light source: directions sampled in proportion to what arrives from them.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::band_shares;
use crate::sampling::basis;
use crate::scene::{Environment, SunDisk};

/// An [`Environment`], ready to be sampled: a piecewise constant density over the cells of its map (pbrt 4ed 12.5) and a
/// uniform one over the sun's disk.
#[derive(Debug)]
pub(super) struct EnvironmentLight {
    environment: Arc<Environment>,
    /// Running sums over the rows, and over the columns of each row, the last one 1; empty for a black map.
    rows: Vec<f32>,
    columns: Vec<f32>,
    /// Integral of radiance over all directions, W/m^2 per band.
    pub total: DVec3,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub direction: Vec3,
    pub radiance: Vec3,
    /// Density per solid angle.
    pub pdf: f64,
}

impl EnvironmentLight {
    /// `None` when it is black.
    pub(super) fn new(environment: &Arc<Environment>) -> Option<Self> {
        let [w, h] = environment.size();
        let solid_angle = |row| row_cosines(row, h).solid_angle(w);
        let row_sum =
            |row: usize| (0..w).map(|c| environment.cell_mean(c, row).as_dvec3()).sum::<DVec3>() * solid_angle(row);
        // Collected before they are added up: the order of a parallel sum would depend on the threads.
        let sums: Vec<DVec3> = (0..h).into_par_iter().map(row_sum).collect();
        let of_map: DVec3 = sums.iter().sum();
        let of_sun = environment.sun().map_or(DVec3::ZERO, |sun| sun.radiance.as_dvec3() * sun.solid_angle());
        let total = of_map + of_sun;
        if total == DVec3::ZERO {
            return None;
        }
        let (mut rows, mut columns) = (Vec::new(), Vec::new());
        if of_map != DVec3::ZERO {
            let share = |value: DVec3| band_shares(value.to_array(), of_map.to_array());
            rows = running_shares(sums.iter().map(|&sum| share(sum)));
            let row = |row| running_shares((0..w).map(move |c| share(environment.cell_mean(c, row).as_dvec3())));
            columns = (0..h).into_par_iter().flat_map_iter(row).collect();
        }
        Some(EnvironmentLight { environment: Arc::clone(environment), rows, columns, total })
    }

    /// Radiance from a unit direction.
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        self.environment.radiance(direction)
    }

    /// A direction for a surface with `normal` (zero: for any). `choice` decides between map and sun.
    pub(super) fn sample(&self, normal: Vec3, choice: f64, u: [f32; 2]) -> Direction {
        let sun_share = self.sun_share(normal);
        let sun = self.environment.sun().filter(|_| choice < sun_share);
        let direction = match sun {
            Some(sun) => sample_sun(sun, u),
            None => self.sample_map(u),
        };
        let mut radiance = self.environment.radiance(direction);
        let mut pdf = self.pdf(normal, direction);
        if let Some(sun) = sun.filter(|sun| !sun.holds(direction)) {
            // On the disk's edge, outside by rounding.
            radiance += sun.radiance;
            pdf += sun_share / sun.solid_angle();
        }
        Direction { direction, radiance, pdf }
    }

    /// A direction, whatever the surface, from two numbers.
    pub(super) fn sample_any(&self, [x, y]: [f32; 2]) -> Direction {
        let (x, sun_share) = (f64::from(x), self.sun_share(Vec3::ZERO));
        let (choice, x) = if x < sun_share { (0.0, x / sun_share) } else { (1.0, (x - sun_share) / (1.0 - sun_share)) };
        self.sample(Vec3::ZERO, choice, [x as f32, y])
    }

    /// Density per solid angle with which [`EnvironmentLight::sample`] chooses `direction`.
    pub(super) fn pdf(&self, normal: Vec3, direction: Vec3) -> f64 {
        let sun_share = self.sun_share(normal);
        let of_sun = match self.environment.sun() {
            Some(sun) if sun.holds(direction) => sun_share / sun.solid_angle(),
            _ => 0.0,
        };
        of_sun + (1.0 - sun_share) * self.map_pdf(direction)
    }

    /// Probability of sampling the sun: half, where it is above the horizon. Whether something stands in its way matters more than how
    /// strong it is.
    fn sun_share(&self, normal: Vec3) -> f64 {
        match self.environment.sun() {
            None => 0.0,
            Some(_) if self.rows.is_empty() => 1.0,
            Some(sun) if normal != Vec3::ZERO && normal.dot(sun.direction) <= -sun.sin_radius => 0.0,
            Some(_) => 0.5,
        }
    }

    fn sample_map(&self, [x, y]: [f32; 2]) -> Vec3 {
        let [w, h] = self.environment.size();
        let (row, within_row) = invert(&self.rows, y);
        let (column, within_column) = invert(&self.columns[row * w..][..w], x);
        let cosines = row_cosines(row, h);
        let cos = cosines.above + within_row * (cosines.below - cosines.above);
        self.environment.direction(((column as f64 + within_column) / w as f64) as f32, cos as f32)
    }

    fn map_pdf(&self, direction: Vec3) -> f64 {
        if self.rows.is_empty() {
            return 0.0;
        }
        let [w, h] = self.environment.size();
        let [u, v] = self.environment.coordinates(direction);
        let column = ((u * w as f32) as usize).min(w - 1);
        let row = ((v * h as f32) as usize).min(h - 1);
        let share = |sums: &[f32], i: usize| f64::from(sums[i]) - if i == 0 { 0.0 } else { f64::from(sums[i - 1]) };
        let probability = share(&self.rows, row) * share(&self.columns[row * w..][..w], column);
        probability / row_cosines(row, h).solid_angle(w)
    }
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
    let last = sums.partition_point(|&s| s < 1.0).min(sums.len() - 1);
    let i = sums.partition_point(|&s| s <= u).min(last);
    let before = if i == 0 { 0.0 } else { f64::from(sums[i - 1]) };
    let width = f64::from(sums[i]) - before;
    (i, if width > 0.0 { ((f64::from(u) - before) / width).clamp(0.0, 1.0) } else { 0.5 })
}
