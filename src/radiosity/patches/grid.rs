//! Cutting a chart into the cells of a plane grid.

use glam::{DVec2, DVec3};

use super::Piece;
use super::charts::Frame;
use crate::simplify::SimplifiedGeometry;

/// The grid of one chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    frame: Frame,
    /// Corner of cell (0, 0), along the frame's x and y.
    origin: DVec2,
    /// Cells per unit of length along x and y.
    scale: DVec2,
    /// Extent along the frame's x, y and normal.
    extent: DVec3,
    /// Fewest cells.
    least: u32,
    /// Number of cells along x and y.
    pub cells: [u32; 2],
}

/// Largest number of cells along one axis: what [`super::CellMap`] can hold.
const MAX_CELLS: f64 = 65_535.0;

impl Grid {
    /// The grid whose cells divide the extent of `triangles` evenly into lengths of at most `size`, and into `least` cells at least.
    pub fn fit(geometry: &SimplifiedGeometry, triangles: &[u32], frame: Frame, size: f64, least: u32) -> Grid {
        let mut grid = Grid { least, ..Grid::bounds(geometry, triangles, frame) };
        grid.divide(size);
        grid
    }

    /// The grid that divides the extent of `triangles` into `n` times `n` cells.
    pub fn even(geometry: &SimplifiedGeometry, triangles: &[u32], frame: Frame, n: u32) -> Grid {
        let mut grid = Grid::bounds(geometry, triangles, frame);
        grid.set_cells([n, n]);
        grid
    }

    fn bounds(geometry: &SimplifiedGeometry, triangles: &[u32], frame: Frame) -> Grid {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &t in triangles {
            for p in super::corners(geometry, geometry.triangles[t as usize]) {
                let q = DVec3::new(p.dot(frame.x), p.dot(frame.y), p.dot(frame.normal));
                min = min.min(q);
                max = max.max(q);
            }
        }
        Grid { frame, origin: min.truncate(), scale: DVec2::ZERO, extent: max - min, least: 1, cells: [1, 1] }
    }

    /// Divides anew into cells of at most `size`, or smaller ones where these would be fewer than the fewest.
    pub fn divide(&mut self, size: f64) {
        // The small reduction keeps rounding from turning five cells into six.
        let count = |extent: f64| (extent / size * (1.0 - 1e-4)).ceil().clamp(1.0, MAX_CELLS) as u32;
        self.set_cells([count(self.extent.x), count(self.extent.y)]);
        if self.len() < u64::from(self.least) {
            self.set_cells(self.fewest());
        }
    }

    /// The fewest cells, or a few more, as square as their number allows.
    fn fewest(&self) -> [u32; 2] {
        let least = f64::from(self.least);
        let (x, y) = (self.extent.x, self.extent.y);
        let along_short = (least * x.min(y) / x.max(y).max(f64::MIN_POSITIVE)).sqrt().round().clamp(1.0, least);
        let along_long = (least / along_short).ceil();
        if x < y { [along_short as u32, along_long as u32] } else { [along_long as u32, along_short as u32] }
    }

    /// Whether larger cells would not be fewer.
    pub fn is_at_least(&self) -> bool {
        self.len() == 1 || self.cells == self.fewest()
    }

    fn set_cells(&mut self, cells: [u32; 2]) {
        let per_length = |n: u32, extent: f64| if extent > 0.0 { f64::from(n) / extent } else { 0.0 };
        self.cells = cells;
        self.scale = DVec2::new(per_length(cells[0], self.extent.x), per_length(cells[1], self.extent.y));
    }

    /// Grid coordinates (one cell = 1) of a point.
    pub fn coordinates(&self, p: DVec3) -> DVec2 {
        (DVec2::new(p.dot(self.frame.x), p.dot(self.frame.y)) - self.origin) * self.scale
    }

    /// Number of cells.
    pub fn len(&self) -> u64 {
        u64::from(self.cells[0]) * u64::from(self.cells[1])
    }

    /// Diameter of what lies in one cell, at most: that of the cell and the chart's depth.
    pub fn cell_diameter(&self) -> f64 {
        let [nx, ny] = self.cells.map(f64::from);
        DVec3::new(self.extent.x / nx, self.extent.y / ny, self.extent.z).length()
    }

    /// Cuts triangle `triangle` of the geometry along the grid's lines and appends `(cell, area, piece)` for each part, fanned
    /// into triangles.
    pub fn cut(&self, geometry: &SimplifiedGeometry, triangle: u32, pieces: &mut Vec<(u32, f64, Piece)>) {
        let index = geometry.triangles[triangle as usize];
        let area = super::vector_area(geometry, index).length();
        let at = super::corners(geometry, index).map(|p| self.coordinates(p));
        let whole = [
            Vertex { at: at[0], uv: DVec2::ZERO },
            Vertex { at: at[1], uv: DVec2::X },
            Vertex { at: at[2], uv: DVec2::Y },
        ];
        let span = |values: [f64; 3], n: u32| {
            let cell = |x: f64| (x.floor().max(0.0) as u32).min(n - 1);
            let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
            (cell(lo), cell(hi))
        };
        let (y0, y1) = span(at.map(|p| p.y), self.cells[1]);
        let (mut row, mut cell, mut spare) = (Vec::new(), Vec::new(), Vec::new());
        for y in y0..=y1 {
            row.clear();
            row.extend_from_slice(&whole);
            clip_to(&mut row, &mut spare, DVec2::Y, y, y0, y1);
            if row.len() < 3 {
                continue;
            }
            let xs = row.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.at.x), h.max(v.at.x)));
            let (x0, x1) = span([xs.0, xs.1, xs.1], self.cells[0]);
            for x in x0..=x1 {
                cell.clear();
                cell.extend_from_slice(&row);
                clip_to(&mut cell, &mut spare, DVec2::X, x, x0, x1);
                let number = y * self.cells[0] + x;
                for k in 1..cell.len().saturating_sub(1) {
                    let uv = [cell[0].uv, cell[k].uv, cell[k + 1].uv];
                    // Barycentrics span the triangle (0,0) (1,0) (0,1), whose area is one half.
                    let share = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs();
                    if share > 1e-12 {
                        pieces.push((
                            number,
                            share * area,
                            Piece { triangle, share: 0.0, uv: uv.map(|p| p.as_vec2()) },
                        ));
                    }
                }
            }
        }
    }
}

/// A corner of a polygon in grid coordinates, with its barycentrics in the triangle.
#[derive(Clone, Copy)]
struct Vertex {
    at: DVec2,
    uv: DVec2,
}

/// Clips to `index <= axis . at <= index + 1`, leaving out sides on which there is no further cell.
fn clip_to(polygon: &mut Vec<Vertex>, spare: &mut Vec<Vertex>, axis: DVec2, index: u32, first: u32, last: u32) {
    if index > first {
        clip(polygon, spare, axis, f64::from(index));
    }
    if index < last {
        clip(polygon, spare, -axis, -f64::from(index + 1));
    }
}

/// Keeps the part with `normal . at >= offset` (Sutherland and Hodgman 1974).
fn clip(polygon: &mut Vec<Vertex>, spare: &mut Vec<Vertex>, normal: DVec2, offset: f64) {
    spare.clear();
    for (i, &b) in polygon.iter().enumerate() {
        let a = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (da, db) = (normal.dot(a.at) - offset, normal.dot(b.at) - offset);
        if (da < 0.0) != (db < 0.0) {
            let s = da / (da - db);
            spare.push(Vertex { at: a.at.lerp(b.at, s), uv: a.uv.lerp(b.uv, s) });
        }
        if db >= 0.0 {
            spare.push(b);
        }
    }
    std::mem::swap(polygon, spare);
}
