//! Which sides of patches have anything close before them.
//!
//! Most of a room's walls and floor lie open: nothing is within a tenth of a patch of them. A grid of the patches' bounds tells that
//! without rays.

use glam::{IVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::Patches;
use crate::scene::Aabb;
use crate::simplify::SimplifiedGeometry;

/// Cells of the grid are so many times as wide as patches are on average.
const CELL: f32 = 2.0;
/// Patches that overlap more cells than this are put to every other one.
const MOST_CELLS: i64 = 4096;
/// Points this many roundings of their coordinates above a plane count as being in it.
const ROUNDINGS: f32 = 16.0;
/// Cosine between normals in one flat patch.
const FLAT_COS: f32 = 0.999;

/// A patch as its neighbours see it.
struct Extent {
    bounds: Aabb,
    /// Unit normal and a point of its plane; `None` where it is bent.
    plane: Option<(Vec3, Vec3)>,
    /// What counts as being in the plane.
    tolerance: f32,
}

/// For each side, whether some part of another patch, or of a bent patch itself, may lie in front of it within `reach` of the patch's
/// diameter. Never false where a ray along the normal would find something, but for what coincides with the patch.
pub(in crate::radiosity) fn may_be_covered(
    geometry: &SimplifiedGeometry,
    patches: &Patches,
    reach: f32,
) -> Vec<[bool; 2]> {
    let numbers = 0..patches.len() as u32;
    let extents: Vec<Extent> = numbers.clone().into_par_iter().map(|p| extent(geometry, patches, p)).collect();
    let grid = Grid::new(&extents);
    let find = |p: u32| {
        let own = &extents[p as usize];
        let Some((normal, point)) = own.plane else { return [true; 2] };
        let reach = reach * patches.diameter[p as usize];
        let around = own.bounds.expanded(reach);
        let mut close = [false; 2];
        grid.visit(&around, |q| {
            if q == p || !extents[q as usize].bounds.overlaps(&around) {
                return close == [true; 2];
            }
            let heights = |points: &mut dyn Iterator<Item = f32>| {
                let (low, high) = points.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
                [high > own.tolerance && low < reach, -low > own.tolerance && -high < reach]
            };
            let bounds = &extents[q as usize].bounds;
            let (middle, half) = ((bounds.centre() - point).dot(normal), (0.5 * bounds.size()).dot(normal.abs()));
            let mut new = heights(&mut [middle - half, middle + half].into_iter());
            if (0..2).any(|k| new[k] && !close[k]) {
                // The bounds of what lies at an angle to the axes are far larger than it is.
                new = heights(&mut corners(geometry, patches, q).map(|corner| (corner - point).dot(normal)));
            }
            (0..2).for_each(|k| close[k] |= new[k]);
            close == [true; 2]
        });
        close
    };
    numbers.into_par_iter().map(find).collect()
}

/// Corners of the pieces of a patch.
fn corners<'a>(
    geometry: &'a SimplifiedGeometry,
    patches: &'a Patches,
    patch: u32,
) -> impl Iterator<Item = Vec3> + use<'a> {
    patches.pieces(patch).iter().flat_map(|piece| {
        let [a, b, c] = geometry.triangles[piece.triangle as usize].map(|i| geometry.positions[i as usize]);
        piece.uv.map(|uv| a + uv.x * (b - a) + uv.y * (c - a))
    })
}

fn extent(geometry: &SimplifiedGeometry, patches: &Patches, patch: u32) -> Extent {
    let bounds = Aabb::of(corners(geometry, patches, patch));
    let tolerance = ROUNDINGS * f32::EPSILON * bounds.min.abs().max(bounds.max.abs()).max_element();
    let normal = patches.planes[patches.triangle(patch) as usize].normal;
    let point = corners(geometry, patches, patch).next().unwrap_or(bounds.min);
    let is_along = |triangle: u32| patches.planes[triangle as usize].normal.dot(normal) > FLAT_COS;
    let flat = corners(geometry, patches, patch).all(|corner| (corner - point).dot(normal).abs() <= tolerance)
        && patches.pieces(patch).iter().all(|piece| is_along(piece.triangle));
    Extent { bounds, plane: flat.then_some((normal, point)), tolerance }
}

/// Numbers of bounds by the cells that they overlap.
struct Grid {
    inverse_cell: f32,
    /// First and last index into `entries` of each cell that is not empty.
    cells: FxHashMap<IVec3, (u32, u32)>,
    entries: Vec<u32>,
    large: Vec<u32>,
}

impl Grid {
    fn new(extents: &[Extent]) -> Grid {
        let all = extents.iter().fold(Aabb::EMPTY, |all, e| all.union(e.bounds)).size().max_element();
        let mean = extents.iter().map(|e| e.bounds.diagonal()).sum::<f32>() / extents.len().max(1) as f32;
        // Cells have numbers of 20 bits at most.
        let inverse_cell = 1.0 / (CELL * mean).max(all / (1 << 20) as f32).max(f32::MIN_POSITIVE);
        let mut grid = Grid { inverse_cell, cells: FxHashMap::default(), entries: Vec::new(), large: Vec::new() };
        let mut keys: Vec<([i32; 3], u32)> = Vec::with_capacity(2 * extents.len());
        for (number, extent) in (0..).zip(extents) {
            let [low, high] = grid.range(&extent.bounds);
            if (high - low + 1).as_i64vec3().element_product() > MOST_CELLS {
                grid.large.push(number);
            } else {
                keys.extend(within([low, high]).map(|cell| (cell.to_array(), number)));
            }
        }
        keys.par_sort_unstable();
        for run in keys.chunk_by(|a, b| a.0 == b.0) {
            let first = grid.entries.len() as u32;
            grid.entries.extend(run.iter().map(|&(_, number)| number));
            grid.cells.insert(run[0].0.into(), (first, grid.entries.len() as u32));
        }
        grid
    }

    fn range(&self, bounds: &Aabb) -> [IVec3; 2] {
        [bounds.min, bounds.max].map(|p| (p * self.inverse_cell).floor().as_ivec3())
    }

    /// Puts all numbers in the cells that overlap `bounds` to `is_enough`, some more than once, until it says so.
    fn visit(&self, bounds: &Aabb, mut is_enough: impl FnMut(u32) -> bool) {
        let range = self.range(bounds);
        if self.large.iter().any(|&number| is_enough(number)) {
            return;
        }
        if (range[1] - range[0] + 1).as_i64vec3().element_product() > MOST_CELLS {
            let _ = self.entries.iter().any(|&number| is_enough(number));
            return;
        }
        for cell in within(range) {
            if let Some(&(first, end)) = self.cells.get(&cell)
                && self.entries[first as usize..end as usize].iter().any(|&number| is_enough(number))
            {
                return;
            }
        }
    }
}

/// All cells from the first to the last, both included.
fn within([low, high]: [IVec3; 2]) -> impl Iterator<Item = IVec3> {
    let row = move |z, y| (low.x..=high.x).map(move |x| IVec3::new(x, y, z));
    (low.z..=high.z).flat_map(move |z| (low.y..=high.y).flat_map(move |y| row(z, y)))
}
