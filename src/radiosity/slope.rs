//! How light changes over a side of a patch, to first order.
//!
//! A radiosity is a mean over a side. Who looks at the slats of a blind from inside the room sees their inner edges, which get less light than
//! the outer ones; who looks under a table sees the floor's darker part. Where light arrived is known: its centroid against that of the area
//! gives the best linear fit, `B(l) = B (1 + g (l - m))` with `g = C^-1 (c - m)`, where `l` are coordinates in the patch's cell, `m` and `C` their
//! mean and covariance over the open part of the side, and `c` the centroid of the light. The fit's relative variance over the side is
//! `(c - m) C^-1 (c - m)`.
//!
//! A side has a slope where that is more than what chance makes of the rays that brought the light. Slopes of chance would have no bias, but make
//! what single gather rays bring noisier.

use glam::{DMat2, DVec2, DVec3, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::patches::Patches;
use crate::sampling;
use crate::simplify::SimplifiedGeometry;

/// Least relative standard deviation of the fit over a side: less is nothing to the errors of single patches.
const LEAST: f64 = 0.1;
/// The fit's relative variance is at least this multiple of what chance makes of even light, for each of its two dimensions: that makes a slope of one
/// side in a hundred (chi-square).
const CERTAIN: f64 = 9.2;
/// Points that stand for the open part of a side.
const POINTS: u32 = 64;
/// Added to the covariance of cell coordinates, whose variance over a full cell is 1/12: slivers have no second direction.
const LEAST_VARIANCE: f64 = 1e-3;
/// Centre of a cell.
const MIDDLE: DVec2 = DVec2::splat(0.5);

/// Flux, all bands together, and its first moments in cell coordinates about the middle of the cell, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moments {
    /// Moments of first order, and the flux itself.
    sum: DVec3,
    /// Squares of the flux of single rays, W^2.
    squares: f64,
}

impl Moments {
    /// Adds light that arrived at cell coordinates `local`, 0..=1.
    pub fn add(&mut self, flux: f64, local: Vec2) {
        self.sum += flux * (local.as_dvec2() - MIDDLE).extend(1.0);
        self.squares += flux * flux;
    }

    /// Adds `weight` times what `all` has more than `part`.
    pub fn add_rest(&mut self, weight: f64, all: Moments, part: Moments) {
        self.sum += weight * (all.sum - part.sum);
        self.squares += weight * weight * (all.squares - part.squares);
    }

    /// Centroid about the middle of the cell, and one over the number of equal rays that would make it as uncertain; `None` without light.
    fn centroid(self) -> Option<(DVec2, f64)> {
        let flux = self.sum.z;
        (flux > 0.0).then(|| (self.sum.truncate() / flux, self.squares / (flux * flux)))
    }
}

/// How light changes over a side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Slope {
    /// Mean cell coordinates of the side's open part.
    mean: Vec2,
    /// Relative change with cell coordinates.
    change: Vec2,
}

impl Slope {
    /// Light at cell coordinates `local` over the mean of the side; at least 0.
    pub fn at(&self, local: Vec2) -> f32 {
        (1.0 + self.change.dot(local - self.mean)).max(0.0)
    }

    /// The fit to both halves' `moments`, where it is certain and worth it.
    fn fit(geometry: &SimplifiedGeometry, patches: &Patches, side: u32, moments: [Moments; 2]) -> Option<Slope> {
        let [Some((a, per_a)), Some((b, per_b))] = moments.map(Moments::centroid) else { return None };
        // Of a cell that is full and open. Most sides end here.
        if 12.0 * a.dot(b) < LEAST * LEAST {
            return None;
        }
        let points: Vec<DVec2> = (0..POINTS)
            .map(|i| {
                let [u, v, ..] = sampling::sobol(i, 0, side);
                let point = patches.open_point(geometry, side, [u, v]);
                patches.map.locate(point.triangle, point.u, point.v).1.as_dvec2() - MIDDLE
            })
            .collect();
        let per_point = 1.0 / f64::from(POINTS);
        let mean = points.iter().sum::<DVec2>() * per_point;
        let square = |d: DVec2| DMat2::from_cols(d * d.x, d * d.y);
        let covariance = points
            .iter()
            .fold(DMat2::from_diagonal(DVec2::splat(LEAST_VARIANCE)), |sum, &p| sum + square(p - mean) * per_point);
        let inverse = covariance.inverse();
        let centroid = 0.5 * (a + b) - mean;
        let variance = centroid.dot(inverse * centroid);
        if variance < (CERTAIN * 0.25 * (per_a + per_b)).max(LEAST * LEAST) {
            return None;
        }
        let change = inverse * centroid;
        // No negative light: as steep as that allows, so that the mean stays what it is.
        let lowest = points.iter().map(|&p| change.dot(p - mean)).fold(0.0, f64::min);
        let change = change * (-1.0 / lowest).clamp(0.0, 1.0);
        Some(Slope { mean: (mean + MIDDLE).as_vec2(), change: change.as_vec2() })
    }
}

/// The slopes of those sides that have one, in ascending order, from the moments of both halves. Equivalent boxes are looked up as they are.
pub(super) fn find(geometry: &SimplifiedGeometry, patches: &Patches, moments: &[Vec<Moments>; 2]) -> Vec<(u32, Slope)> {
    let [a, b] = moments;
    let fit = |(side, (&a, &b)): (usize, (&Moments, &Moments))| {
        if patches.box_cell[side / 2].is_some() {
            return None;
        }
        Some((side as u32, Slope::fit(geometry, patches, side as u32, [a, b])?))
    };
    a.par_iter().zip(b).enumerate().filter_map(fit).collect()
}
