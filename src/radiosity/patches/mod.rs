//! Patches: the units of the radiosity solution.
//!
//! Patches follow a target size and not the tessellation: triangles are gathered into [`charts`] (nearly plane, connected,
//! of one surface) and each chart is cut by a [`grid`]. A patch is what lies in one cell, on both sides.

mod charts;
mod exposure;
mod grid;
mod join;
pub(super) mod neighbours;
mod sampling;
mod shape;

use std::collections::VecDeque;

use glam::{DVec3, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::radiosity::{Focus, RadiosityParams, RadiosityScene};
use crate::scene::Plane;
use crate::shading::SurfacePoint;
use crate::simplify::{Cluster, SimplifiedGeometry, TriangleSource};
use charts::{Charts, Frame};
use exposure::Exposure;
use grid::Grid;
pub(super) use sampling::inset;
use shape::Cell;
pub(super) use shape::MIDDLE;

const NONE: u32 = u32::MAX;

/// Largest angle between a triangle and its chart's mean normal: cos 30 degrees. Cells of so bent a chart are stretched by no
/// more than 15 %.
const CHART_COS: f64 = 0.866;
/// The same where charts alone would exceed the bound on patches: cos 60 degrees.
const COARSE_CHART_COS: f64 = 0.5;

/// A cell with less than this share of the chart's fullest cell, and a chart with less than this share of a patch, is joined to a neighbour: it
/// would catch too few rays.
const SMALLEST_SHARE: f64 = 0.05;

/// All patches of a geometry. Patch `p` has the sides `2 p` (front) and `2 p + 1` (back).
#[derive(Clone, Debug)]
pub(super) struct Patches {
    /// From hits to patches.
    pub map: PatchMap,
    first_piece: Vec<u32>,
    pieces: Vec<Piece>,
    /// Area of one side of each patch.
    pub area: Vec<f64>,
    /// What counts how much, 0..=1; see [`Focus`].
    pub relevance: Vec<f64>,
    exposure: Exposure,
    /// Diameter of each patch.
    pub diameter: Vec<f32>,
    /// Plane of each triangle.
    pub planes: Vec<Plane>,
    cells: Vec<Cell>,
    /// Where on its equivalent box a patch lies.
    pub box_cell: Vec<Option<BoxCell>>,
    /// Edge length that was used: the one asked for, or larger.
    pub size: f64,
}

/// From points on triangles to patches.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PatchMap {
    /// One a triangle.
    maps: Vec<CellMap>,
    /// Patch of each cell of all grids.
    cells: Vec<u32>,
}

/// A patch of an equivalent box: index `j * n + i` of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BoxCell {
    /// Index of the cluster.
    pub cluster: u32,
    /// Face, 0..6.
    pub face: u8,
    /// Index of the patch on the face.
    pub index: u32,
}

/// From barycentrics of a triangle to a cell: two affine functions.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct CellMap {
    origin: Vec2,
    du: Vec2,
    dv: Vec2,
    first: u32,
    cells: [u16; 2],
}

/// A part of a triangle, itself a triangle in barycentrics.
#[derive(Clone, Copy, Debug)]
struct Piece {
    triangle: u32,
    /// Share of the patch's area in this piece and all before it.
    share: f32,
    uv: [Vec2; 3],
}

/// A chart's part of [`Patches`], with its own numbering.
struct Part {
    cells: Vec<u32>,
    patches: Vec<Vec<(f64, Piece)>>,
    patch_cells: Vec<u32>,
}

fn corners(geometry: &SimplifiedGeometry, triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|i| geometry.positions[i as usize].as_dvec3())
}

/// Normal of a triangle with its area as length.
fn vector_area(geometry: &SimplifiedGeometry, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners(geometry, triangle);
    0.5 * (b - a).cross(c - a)
}

impl Patches {
    /// Cuts `geometry` into patches of the size and at least the number for each surface that `params` says, larger where that would give
    /// more than about `max_patches`.
    ///
    /// # Errors
    /// When there are more grid cells than 32 bits can number.
    pub fn new(geometry: &SimplifiedGeometry, clusters: &[Cluster], params: &RadiosityParams) -> Result<Patches> {
        let mut charts = charts::grow(geometry, CHART_COS, f64::from(params.patch_size));
        if charts.frames.len() > params.max_patches {
            charts = charts::grow(geometry, COARSE_CHART_COS, f64::from(params.patch_size));
        }
        let (grids, members, size) = grids(geometry, clusters, &charts, params);
        let cells: u64 = grids.iter().map(Grid::len).sum();
        if cells >= u64::from(NONE) {
            return Err(Error::Usage(format!("{cells} radiosity cells are too many: choose a larger patch size")));
        }
        let parts: Vec<Part> =
            grids.par_iter().zip(&members).map(|(grid, triangles)| part(geometry, grid, triangles)).collect();

        let plane = |t: &[u32; 3]| Plane::of(t.map(|i| geometry.positions[i as usize]));
        let planes = geometry.triangles.par_iter().map(plane).collect();
        let mut patches = Patches {
            map: PatchMap {
                maps: vec![CellMap::default(); geometry.triangles.len()],
                cells: Vec::with_capacity(cells as usize),
            },
            first_piece: vec![0],
            pieces: Vec::new(),
            area: Vec::new(),
            relevance: Vec::new(),
            exposure: Exposure::everything(0),
            diameter: Vec::new(),
            planes,
            cells: Vec::new(),
            box_cell: Vec::new(),
            size,
        };
        for ((grid, triangles), part) in grids.iter().zip(&members).zip(parts) {
            patches.append(geometry, grid, triangles, part);
        }
        patches.exposure = Exposure::everything(2 * patches.len());
        patches.relevance = vec![1.0; patches.len()];
        Ok(patches)
    }

    /// Finds out which parts of the patches are covered and leaves these out of all that follows.
    pub fn leave_out_covered(&mut self, input: &RadiosityScene<'_>, seed: u32) {
        self.exposure = Exposure::find(input, self, seed);
    }

    /// Weighs patches by their closeness to `focus`.
    pub fn weigh(&mut self, geometry: &SimplifiedGeometry, focus: &Focus) {
        let centre = |patch: u32| self.point(geometry, patch, [0.5, 0.5]).position;
        self.relevance = (0..self.len() as u32).into_par_iter().map(|p| focus.weight(centre(p))).collect();
    }

    /// Area of the part of a side that lies open.
    pub fn open_area(&self, side: u32) -> f64 {
        self.area[side as usize / 2] * self.exposure.share(side)
    }

    /// The point on the open part of a side that belongs to `s`, uniform in 0..1.
    pub fn open_point(&self, geometry: &SimplifiedGeometry, side: u32, s: [f32; 2]) -> SurfacePoint {
        self.point(geometry, side / 2, self.exposure.onto_open(side, s))
    }

    fn append(&mut self, geometry: &SimplifiedGeometry, grid: &Grid, triangles: &[u32], part: Part) {
        let (first_cell, first_patch) = (self.map.cells.len() as u32, self.area.len() as u32);
        for &t in triangles {
            self.map.maps[t as usize] = CellMap::new(geometry, grid, t, first_cell);
        }
        self.map.cells.extend(part.cells.iter().map(|&p| first_patch + p));
        for (pieces, cell) in part.patches.into_iter().zip(part.patch_cells) {
            let area: f64 = pieces.iter().map(|p| p.0).sum();
            let mut sum = 0.0;
            let last = pieces.len() - 1;
            for (i, (a, piece)) in pieces.into_iter().enumerate() {
                sum += a;
                let share = if i == last { 1.0 } else { (sum / area) as f32 };
                self.pieces.push(Piece { share, ..piece });
            }
            self.first_piece.push(self.pieces.len() as u32);
            self.area.push(area);
            self.diameter.push(grid.cell_diameter() as f32);
            self.cells.push(Cell { first: first_cell, across: grid.cells, index: cell });
            self.box_cell.push(match geometry.sources[triangles[0] as usize] {
                TriangleSource::BoxFace { cluster, face, .. } => Some(BoxCell { cluster, face, index: cell }),
                TriangleSource::Scene { .. } => None,
            });
        }
    }

    /// Whether a side looks into an equivalent box. Boxes stop light from outside only: no ray ever meets such a side, and light that it
    /// gathered through the other faces would be there a second time.
    pub fn is_inside_of_box(&self, side: u32) -> bool {
        side % 2 == 1 && self.box_cell[side as usize / 2].is_some()
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// A triangle of the patch.
    pub fn triangle(&self, patch: u32) -> u32 {
        self.pieces[self.first_piece[patch as usize] as usize].triangle
    }
}

impl PatchMap {
    /// Whether every point on each of so many triangles leads to one of `patches`.
    pub fn is_whole(&self, triangles: usize, patches: usize) -> bool {
        let inside = |map: &CellMap| {
            let [nx, ny] = map.cells.map(u64::from);
            nx > 0 && ny > 0 && u64::from(map.first) + nx * ny <= self.cells.len() as u64
        };
        self.maps.len() == triangles
            && self.maps.iter().all(inside)
            && self.cells.iter().all(|&patch| (patch as usize) < patches)
    }

    /// The patch at barycentrics `u`, `v` of a triangle.
    pub fn at(&self, triangle: u32, u: f32, v: f32) -> u32 {
        self.locate(triangle, u, v).0
    }

    fn grid_coordinates(&self, triangle: u32, uv: Vec2) -> Vec2 {
        self.maps[triangle as usize].grid_coordinates(uv)
    }

    /// The same, with the coordinates in the grid's cell, 0..=1.
    #[inline]
    pub fn locate(&self, triangle: u32, u: f32, v: f32) -> (u32, Vec2) {
        let map = &self.maps[triangle as usize];
        let at = map.grid_coordinates(Vec2::new(u, v));
        // A cast from float saturates: below zero becomes 0.
        let x = (at.x as u32).min(u32::from(map.cells[0]) - 1);
        let y = (at.y as u32).min(u32::from(map.cells[1]) - 1);
        let patch = self.cells[(map.first + y * u32::from(map.cells[0]) + x) as usize];
        (patch, (at - Vec2::new(x as f32, y as f32)).clamp(Vec2::ZERO, Vec2::ONE))
    }
}

impl Default for CellMap {
    fn default() -> Self {
        CellMap { origin: Vec2::ZERO, du: Vec2::ZERO, dv: Vec2::ZERO, first: 0, cells: [1, 1] }
    }
}

impl CellMap {
    /// Coordinates in the grid, one cell = 1.
    fn grid_coordinates(&self, uv: Vec2) -> Vec2 {
        self.origin + uv.x * self.du + uv.y * self.dv
    }

    fn new(geometry: &SimplifiedGeometry, grid: &Grid, triangle: u32, first: u32) -> CellMap {
        let [a, b, c] = corners(geometry, geometry.triangles[triangle as usize]).map(|p| grid.coordinates(p));
        let [nx, ny] = grid.cells;
        CellMap {
            origin: a.as_vec2(),
            du: (b - a).as_vec2(),
            dv: (c - a).as_vec2(),
            first,
            cells: [nx as u16, ny as u16],
        }
    }
}

/// A grid and the triangles of each chart, and the cell size that keeps the number of cells in bounds.
fn grids(
    geometry: &SimplifiedGeometry,
    clusters: &[Cluster],
    charts: &Charts,
    params: &RadiosityParams,
) -> (Vec<Grid>, Vec<Vec<u32>>, f64) {
    let (mut size, max_patches) = (f64::from(params.patch_size), params.max_patches);
    let mut members = vec![Vec::new(); charts.frames.len()];
    for (t, &chart) in charts.of_triangle.iter().enumerate() {
        members[chart as usize].push(t as u32);
    }
    let box_face = |triangles: &[u32]| match geometry.sources[triangles[0] as usize] {
        TriangleSource::BoxFace { cluster, face, .. } => Some((cluster, face)),
        TriangleSource::Scene { .. } => None,
    };
    let least = least_cells(geometry, &members, params.least_patches);
    let mut grids: Vec<Grid> = members
        .par_iter()
        .zip(&charts.frames)
        .zip(&least)
        .map(|((triangles, &frame), &least)| match box_face(triangles) {
            Some((cluster, face)) => {
                let frame = box_frame(&clusters[cluster as usize], face, frame.normal);
                Grid::even(geometry, triangles, frame, clusters[cluster as usize].equivalent_box.resolution)
            }
            None => Grid::fit(geometry, triangles, frame, size, least),
        })
        .collect();
    loop {
        let total: u64 = grids.iter().map(Grid::len).sum();
        // What the fewest cells of all charts leave room for; these do not become fewer with larger cells.
        let fixed = least.iter().copied().map(u64::from).sum::<u64>();
        let room = (max_patches as u64).saturating_sub(fixed).max(max_patches as u64 / 4);
        if total <= fixed + room {
            return (grids, members, size);
        }
        size *= ((total - fixed) as f64 / room as f64).sqrt().max(1.05);
        for (grid, triangles) in grids.iter_mut().zip(&members) {
            if box_face(triangles).is_none() {
                grid.divide(size);
            }
        }
        if grids.iter().zip(&members).all(|(g, m)| g.is_at_least() || box_face(m).is_some()) {
            return (grids, members, size);
        }
    }
}

/// Fewest cells of each chart: its share, by area, of the fewest patches of its surface.
fn least_cells(geometry: &SimplifiedGeometry, members: &[Vec<u32>], least_patches: u32) -> Vec<u32> {
    let surface = |triangles: &[u32]| geometry.surface_of_triangle[triangles[0] as usize] as usize;
    let area = |triangles: &Vec<u32>| -> f64 {
        triangles.iter().map(|&t| vector_area(geometry, geometry.triangles[t as usize]).length()).sum()
    };
    let areas: Vec<f64> = members.par_iter().map(area).collect();
    let mut of_surface = vec![0.0; geometry.surfaces as usize];
    for (triangles, area) in members.iter().zip(&areas) {
        of_surface[surface(triangles)] += area;
    }
    let share = |(triangles, area): (&Vec<u32>, &f64)| area / of_surface[surface(triangles)].max(f64::MIN_POSITIVE);
    // A cast from float saturates, and turns no number into 0.
    let cells = |chart| ((f64::from(least_patches) * share(chart)).round() as u32).max(1);
    members.iter().zip(&areas).map(cells).collect()
}

/// In-plane axes of a box face: the other two axes of the box in ascending order, as
/// [`EquivalentBox`](crate::simplify::EquivalentBox) numbers its patches.
fn box_frame(cluster: &Cluster, face: u8, normal: DVec3) -> Frame {
    let axes = cluster.equivalent_box.axes;
    let (i, j) = [(1, 2), (0, 2), (0, 1)][usize::from(face / 2)];
    Frame { x: axes.col(i).as_dvec3(), y: axes.col(j).as_dvec3(), normal }
}

/// Cuts the triangles of one chart and collects the parts by cell.
fn part(geometry: &SimplifiedGeometry, grid: &Grid, triangles: &[u32]) -> Part {
    let mut cut = Vec::new();
    for &t in triangles {
        grid.cut(geometry, t, &mut cut);
    }
    if cut.is_empty() {
        // Nothing but slivers: one piece without area keeps the patch sampleable.
        let uv = [Vec2::ZERO, Vec2::X, Vec2::Y];
        cut.push((0, f64::MIN_POSITIVE, Piece { triangle: triangles[0], share: 1.0, uv }));
    }
    let mut areas = vec![0.0; grid.len() as usize];
    for &(cell, area, _) in &cut {
        areas[cell as usize] += area;
    }
    let is_box = matches!(geometry.sources[triangles[0] as usize], TriangleSource::BoxFace { .. });
    let least = if is_box { 0.0 } else { SMALLEST_SHARE * areas.iter().copied().fold(0.0, f64::max) };
    let mut part = Part { cells: vec![NONE; areas.len()], patches: Vec::new(), patch_cells: Vec::new() };
    for (cell, &area) in areas.iter().enumerate() {
        if area > least {
            part.cells[cell] = part.patch_cells.len() as u32;
            part.patch_cells.push(cell as u32);
        }
    }
    fill_gaps(&mut part.cells, grid.cells);
    part.patches.resize_with(part.patch_cells.len(), Vec::new);
    for (cell, area, piece) in cut {
        part.patches[part.cells[cell as usize] as usize].push((area, piece));
    }
    part
}

/// Gives cells without a patch that of the nearest cell that has one. Empty cells need one because hits are rounded differently
/// from the cut.
fn fill_gaps(cells: &mut [u32], [nx, ny]: [u32; 2]) {
    let mut queue: VecDeque<u32> = (0..cells.len() as u32).filter(|&c| cells[c as usize] != NONE).collect();
    if queue.len() == cells.len() {
        return;
    }
    while let Some(cell) = queue.pop_front() {
        let (x, y) = (cell % nx, cell / nx);
        let around = [
            (x > 0).then(|| cell - 1),
            (x + 1 < nx).then(|| cell + 1),
            (y > 0).then(|| cell - nx),
            (y + 1 < ny).then(|| cell + nx),
        ];
        for next in around.into_iter().flatten() {
            if cells[next as usize] == NONE {
                cells[next as usize] = cells[cell as usize];
                queue.push_back(next);
            }
        }
    }
}
