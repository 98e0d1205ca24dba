//! What of the environment is seen from where.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::environment::BLOCKS;
use crate::backend::{Coherence, Ray, RayScene, Visible};
use crate::sampling::{hash_all, unit};
use crate::scene::{Aabb, Scene};
use crate::shading::SurfacePoint;

/// Cells along the longest axis.
const CELLS: u32 = 32;
/// Points of a cell that look out.
const POINTS: usize = 8;
/// Cell without any point.
const NONE: u32 = u32::MAX;

/// For the cells of a grid over the scene, how much each block is worth sampling because of what its surfaces see of it.
#[derive(Debug)]
pub(super) struct Openings {
    bounds: Aabb,
    inverse_cell: f32,
    size: UVec3,
    /// By cell: its entry in `factors`.
    index: Vec<u32>,
    /// Above 0 and at most 1 for each block. The last entry is for cells without surfaces.
    factors: Vec<[f32; BLOCKS]>,
}

/// Rays into a block: how many left the scene, and how many there were.
type Counts = [[u16; 2]; BLOCKS];

impl Default for Openings {
    /// Everything is seen from everywhere.
    fn default() -> Self {
        Openings {
            bounds: Aabb::EMPTY,
            inverse_cell: 0.0,
            size: UVec3::ZERO,
            index: Vec::new(),
            factors: vec![[1.0; BLOCKS]],
        }
    }
}

/// A point that looks out: a triangle, barycentric weights and a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Lookout {
    cell: u32,
    /// Decides which points of a cell are kept.
    rank: u32,
    triangle: u32,
    number: u32,
}

impl Openings {
    /// Traces rays from points on the surfaces of each cell: one into each block above the surface. `directions` holds a few
    /// directions within each block, none for blocks that send no light.
    pub(super) fn find(scene: &Scene, rays: &dyn RayScene, seed: u32, directions: &[Vec<Vec3>]) -> Self {
        let bounds = scene.mesh.bounds;
        if bounds.is_empty() {
            return Self::default();
        }
        let cell = (bounds.size().max_element() / CELLS as f32).max(f32::MIN_POSITIVE);
        let size = ((bounds.size() / cell).as_uvec3() + 1).clamp(UVec3::ONE, UVec3::splat(CELLS + 1));
        let mut grid = Openings {
            bounds,
            inverse_cell: 1.0 / cell,
            size,
            index: vec![NONE; (size.x * size.y * size.z) as usize],
            factors: Vec::new(),
        };
        let lookouts = grid.lookouts(scene, seed);
        let cells: Vec<&[Lookout]> = lookouts.chunk_by(|a, b| a.cell == b.cell).collect();
        let counts: Vec<Counts> =
            cells.par_iter().map(|points| look_out(scene, rays, seed, points, directions)).collect();
        for (entry, points) in cells.iter().enumerate() {
            grid.index[points[0].cell as usize] = entry as u32;
        }
        grid.factors =
            cells.par_iter().map(|points| factors(grid.around(points[0].cell).map(|e| &counts[e]))).collect();
        grid.factors.push(factors(counts.iter()));
        grid
    }

    /// Entries of a cell and its neighbours.
    fn around(&self, cell: u32) -> impl Iterator<Item = usize> {
        let [x, y, z] = [cell % self.size.x, cell / self.size.x % self.size.y, cell / self.size.x / self.size.y];
        let near = |at: u32, size: u32| at.saturating_sub(1)..(at + 2).min(size);
        let cells = near(z, self.size.z).flat_map(move |z| {
            near(y, self.size.y).flat_map(move |y| near(x, self.size.x).map(move |x| UVec3::new(x, y, z)))
        });
        cells.map(|c| self.index[self.number(c) as usize]).filter(|&e| e != NONE).map(|e| e as usize)
    }

    /// Factors of the blocks for `position`.
    pub(super) fn at(&self, position: Vec3) -> &[f32; BLOCKS] {
        let entry = self.cell(position).map_or(NONE, |cell| self.index[cell as usize]);
        &self.factors[(entry as usize).min(self.factors.len() - 1)]
    }

    fn number(&self, c: UVec3) -> u32 {
        (c.z * self.size.y + c.y) * self.size.x + c.x
    }

    fn cell(&self, position: Vec3) -> Option<u32> {
        if self.index.is_empty() || !position.is_finite() {
            return None;
        }
        let c = ((position - self.bounds.min) * self.inverse_cell).max(Vec3::ZERO).as_uvec3().min(self.size - 1);
        Some(self.number(c))
    }

    /// At most [`POINTS`] for each cell, sorted by cell: points on all triangles, large ones with many.
    fn lookouts(&self, scene: &Scene, seed: u32) -> Vec<Lookout> {
        let mesh = &scene.mesh;
        let area = self.inverse_cell.powi(-2);
        let mut all: Vec<Lookout> = (0..mesh.triangles.len() as u32)
            .into_par_iter()
            .flat_map_iter(|triangle| {
                let [a, b, c] = mesh.corners(triangle);
                let share = 0.5 * (b - a).cross(c - a).length() / area;
                let count = (2.0 * POINTS as f32 * share).ceil().clamp(1.0, 65536.0) as u32;
                (0..count).filter_map(move |number| {
                    let [u, v] = barycentric(seed, triangle, number);
                    let cell = self.cell(a + u * (b - a) + v * (c - a))?;
                    Some(Lookout { cell, rank: hash_all(&[seed, triangle, number, 2]), triangle, number })
                })
            })
            .collect();
        all.par_sort_unstable();
        let mut seen = (NONE, 0);
        all.retain(|point| {
            seen = if point.cell == seen.0 { (seen.0, seen.1 + 1) } else { (point.cell, 1) };
            seen.1 <= POINTS
        });
        all
    }
}

/// Uniform over the triangle.
fn barycentric(seed: u32, triangle: u32, number: u32) -> [f32; 2] {
    let [x, y] = [0, 1].map(|k| unit(hash_all(&[seed, triangle, number, k])));
    let root = x.sqrt();
    [root * (1.0 - y), root * y]
}

/// Noise is least for probabilities in proportion to the root of the share that is seen. The share is estimated as if one more ray
/// had been half seen: rays may have missed an opening.
fn factors<'a>(counts: impl Iterator<Item = &'a Counts>) -> [f32; BLOCKS] {
    let mut sums = [[0u32; 2]; BLOCKS];
    for counts in counts {
        for (sum, count) in sums.iter_mut().zip(counts) {
            sum[0] += u32::from(count[0]);
            sum[1] += u32::from(count[1]);
        }
    }
    sums.map(|[open, all]| ((open as f32 + 0.5) / (all as f32 + 1.0)).sqrt())
}

/// What the points of a cell see.
fn look_out(scene: &Scene, rays: &dyn RayScene, seed: u32, points: &[Lookout], directions: &[Vec<Vec3>]) -> Counts {
    let mut queries = Vec::with_capacity(points.len() * BLOCKS);
    let mut blocks = Vec::with_capacity(points.len() * BLOCKS);
    for point in points {
        let [u, v] = barycentric(seed, point.triangle, point.number);
        let hit = crate::backend::Hit { t: 0.0, u, v, triangle: point.triangle };
        let surface = SurfacePoint::new(scene, &hit);
        let front = point.rank & 1 == 0;
        let normal = if front { surface.geometric_normal } else { -surface.geometric_normal };
        for (block, choice) in directions.iter().enumerate().filter(|(_, choice)| !choice.is_empty()) {
            let direction = choice[hash_all(&[point.rank, block as u32]) as usize % choice.len()];
            if direction.dot(normal) <= 0.0 {
                continue;
            }
            queries.push(Ray::new(surface.ray_origin(direction), direction));
            blocks.push(block);
        }
    }
    let mut blocked = vec![false; queries.len()];
    rays.occluded(&queries, Visible::WithoutPanes, Coherence::Incoherent, &mut blocked);
    let mut counts = [[0; 2]; BLOCKS];
    for (&block, &blocked) in blocks.iter().zip(&blocked) {
        counts[block][0] += u16::from(!blocked);
        counts[block][1] += 1;
    }
    counts
}
