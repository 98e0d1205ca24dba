//! How light changes over a side of a patch, to first order.
//!
//! A radiosity is a mean over a side. Who looks at the slats of a blind from inside the room sees their inner edges, which get less light than
//! the outer ones; who looks under a table sees the floor's darker part. Where light arrived is known: its centroid `c` against that of the area,
//! `m`, gives the best linear fit `B(l) = B (1 + g (l - m))` with `g = C^-1 (c - m)`, where `l` are coordinates in the patch's cell and `C` their
//! covariance over the open part of the side. The fit's relative variance over the side is `g C g`.
//!
//! A centroid of `n` equal rays has the covariance `C / n`, so that few rays make a slope by chance. Two things keep that small. A side
//! shares the slopes of the sides around it, weighted by how well these are known and how much they may differ from its own: `g` solves
//! `(sum w C) g = sum w (c - m)`. And a slope that could be chance is shrunk by the factor `1 - CHANCE / z` (the nonnegative garrote: Breiman
//! 1995), where `z = g (sum w C) g` of even light follows the chi-square distribution with two degrees of freedom.

use glam::{DMat2, DVec2, DVec3, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::patches::{MIDDLE, Patches};

/// Least relative standard deviation of the fit over a side: less is nothing to the errors of single patches.
const LEAST: f64 = 0.1;
/// What a slope loses for what chance may have made of it. Even light would make 2 in the mean, one for each dimension; half of that errs less where there
/// is a slope, and hardly adds noise where there is none.
const CHANCE: f64 = 1.0;
/// Relative variance over a side by which slopes of neighbours usually differ.
const DIFFERENCE: f64 = 0.01;
/// Added to the covariance of cell coordinates, whose variance over a full cell is 1/12: slivers have no second direction.
const LEAST_VARIANCE: f64 = 1e-3;

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

    /// Adds `weight` times other light.
    pub fn add_times(&mut self, weight: f64, other: Moments) {
        self.sum += weight * other.sum;
        self.squares += weight * weight * other.squares;
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
}

/// What is known of a side by itself.
#[derive(Clone, Copy)]
struct Known {
    /// Mean of its open part about the middle of the cell.
    mean: DVec2,
    /// Centroid of light less that mean.
    shift: DVec2,
    covariance: DMat2,
    /// Relative variance over the side of a slope that chance makes, in each dimension.
    chance: f64,
}

/// The slopes of those sides that have one, in ascending order. Equivalent boxes are looked up as they are. What is looked up of an `uneven` side
/// is of another kind than of its neighbours.
pub(super) fn find(patches: &Patches, moments: &[Moments], uneven: impl Fn(u32) -> bool + Sync) -> Vec<(u32, Slope)> {
    let known = |side: u32| {
        if patches.box_cell[side as usize / 2].is_some() {
            return None;
        }
        let (centroid, chance) = moments[side as usize].centroid()?;
        let shape = patches.open_shape(side);
        let covariance = shape.covariance + DMat2::from_diagonal(DVec2::splat(LEAST_VARIANCE));
        Some(Known { mean: shape.mean, shift: centroid - shape.mean, covariance, chance })
    };
    let sides = 0..moments.len() as u32;
    let known: Vec<Option<Known>> = sides.clone().into_par_iter().map(known).collect();
    let slope = |side: u32| {
        let own = known[side as usize]?;
        let (mut precision, mut shift) = (own.covariance * (1.0 / own.chance), own.shift / own.chance);
        for other in patches.beside(side / 2).map(|patch| 2 * patch + side % 2) {
            if let Some(known) = known[other as usize].filter(|_| uneven(other) == uneven(side)) {
                let weight = 1.0 / (known.chance + DIFFERENCE);
                precision += known.covariance * weight;
                shift += known.shift * weight;
            }
        }
        let change = precision.inverse() * shift;
        let kept = 1.0 - CHANCE / change.dot(shift);
        let change = change * kept.max(0.0);
        // False for what is not finite.
        let counts = change.dot(own.covariance * change) >= LEAST * LEAST;
        if !counts {
            return None;
        }
        // No negative light: as steep as that allows, so that the mean stays what it is.
        let lowest = patches.corners_in_cells(side / 2).map(|p| change.dot(p - own.mean)).fold(0.0, f64::min);
        let change = change * (-1.0 / lowest).clamp(0.0, 1.0);
        Some((side, Slope { mean: (own.mean + MIDDLE).as_vec2(), change: change.as_vec2() }))
    };
    sides.into_par_iter().filter_map(slope).collect()
}
