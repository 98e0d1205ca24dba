//! What of its cell a patch fills, and what lies beside it.

use glam::{DMat2, DVec2, Vec2};

use super::{Patches, Piece};
use crate::sampling;

/// Points that stand for the open part of a side that is partly covered.
const POINTS: u32 = 64;

/// Middle of a cell.
pub(in crate::radiosity) const MIDDLE: DVec2 = DVec2::splat(0.5);

/// The cell of a patch: `index` of `across.x` times `across.y` cells, the first of which is number `first` of all.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub first: u32,
    pub across: [u32; 2],
    pub index: u32,
}

/// First and second moments of an area in the coordinates of its cell about [`MIDDLE`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::radiosity) struct Shape {
    /// Mean.
    pub mean: DVec2,
    /// Covariance.
    pub covariance: DMat2,
}

/// `d` times its transpose.
fn square(d: DVec2) -> DMat2 {
    DMat2::from_cols(d * d.x, d * d.y)
}

impl Patches {
    /// The shape of the open part of a side.
    pub fn open_shape(&self, side: u32) -> Shape {
        let (mut weight, mut sum, mut squares) = (0.0, DVec2::ZERO, DMat2::ZERO);
        let mut add = |share: f64, mean: DVec2, second: DMat2| {
            weight += share;
            sum += share * mean;
            squares += second * share;
        };
        if self.exposure.is_all_open(side) {
            let mut before = 0.0;
            for piece in self.pieces(side / 2) {
                let corners = self.corners_in_cell(piece);
                let mean = corners.iter().sum::<DVec2>() / 3.0;
                // Second moments of a triangle: its corners and three times its centroid with a twelfth of its area each.
                let second = corners.iter().fold(square(mean) * 9.0, |sum, &c| sum + square(c)) * (1.0 / 12.0);
                add(f64::from(piece.share) - before, mean, second);
                before = f64::from(piece.share);
            }
        } else {
            for i in 0..POINTS {
                let [u, v, ..] = sampling::sobol(i, 0, side);
                let (triangle, uv) = self.sample(side / 2, self.exposure.onto_open(side, [u, v]));
                let at = self.map.locate(triangle, uv.x, uv.y).1.as_dvec2() - MIDDLE;
                add(1.0, at, square(at));
            }
        }
        let mean = sum / weight;
        Shape { mean, covariance: squares * (1.0 / weight) - square(mean) }
    }

    /// Corners of the convex parts of a patch in the coordinates of its cell about [`MIDDLE`].
    pub fn corners_in_cells(&self, patch: u32) -> impl Iterator<Item = DVec2> {
        self.pieces(patch).iter().flat_map(|piece| self.corners_in_cell(piece))
    }

    fn corners_in_cell(&self, piece: &Piece) -> [DVec2; 3] {
        let middle = piece.uv.iter().sum::<Vec2>() / 3.0;
        let (at, local) =
            (self.map.grid_coordinates(piece.triangle, middle), self.map.locate(piece.triangle, middle.x, middle.y).1);
        piece.uv.map(|uv| (self.map.grid_coordinates(piece.triangle, uv) - at + local).as_dvec2() - MIDDLE)
    }

    /// Patches in the eight cells around that of a patch, in the same chart; what fills several of these, as often.
    pub fn beside(&self, patch: u32) -> impl Iterator<Item = u32> {
        let Cell { first, across: [nx, ny], index } = self.cells[patch as usize];
        let (x, y) = (index % nx, index / nx);
        let span = |at: u32, n: u32| at.saturating_sub(1)..(at + 2).min(n);
        let around = span(y, ny).flat_map(move |y| span(x, nx).map(move |x| first + y * nx + x));
        around.map(|cell| self.map.cells[cell as usize]).filter(move |&other| other != patch)
    }
}
