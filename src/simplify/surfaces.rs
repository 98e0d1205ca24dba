//! Surfaces: connected triangles of one object that turn no more than the crease angle between neighbours.
//!
//! The paper counts the surfaces of a modeller; glTF knows only triangles, and a wall of a thousand of them is still one
//! wall. Vertices are welded by exact position first, because files repeat them wherever normals or texture coordinates
//! differ.
//!
//! Two triangles are neighbours across an edge when both hold its two positions. The turn between them is measured after
//! their windings have been made to agree across that edge, so that a sheet of mixed winding is not torn into triangles.
//! Where more than two triangles meet in an edge (a wall standing on a floor, a sheet modelled with two coincident sides),
//! only pairs whose windings agree already are neighbours: the floor goes on beneath the wall, the two sides of the sheet
//! stay apart.

use glam::Vec3;
use rayon::prelude::*;

use super::{Class, Surface};
use crate::scene::{Aabb, Mesh};

/// More triangles than this around one edge are a fan (a palm, a brush), not a continued surface: they stay apart, which
/// also keeps the search for pairs linear.
const MAX_EDGE_TRIANGLES: usize = 16;

/// The surfaces of a mesh.
pub struct SurfaceMap {
    /// Surfaces in the order of their first triangles, all [`Class::Normal`] so far.
    pub surfaces: Vec<Surface>,
    /// Index into `surfaces`, one a triangle.
    pub of_triangle: Vec<u32>,
    /// For each vertex the lowest vertex index at the same position.
    pub welded: Vec<u32>,
}

/// Finds the surfaces of `mesh`; `crease_angle` in radians. Deterministic, O(n log n).
pub fn find_surfaces(mesh: &Mesh, crease_angle: f32) -> SurfaceMap {
    let welded = weld(&mesh.positions);
    let normals: Vec<Vec3> = (0..mesh.triangles.len() as u32).into_par_iter().map(|t| mesh.normal(t)).collect();
    let cos_crease = crease_angle.cos();
    let mut sets = DisjointSets::new(mesh.triangles.len());
    for (a, b) in neighbours(mesh, &welded, &normals, cos_crease) {
        sets.join(a, b);
    }
    let of_triangle = sets.numbered();
    let surfaces = measure(mesh, &of_triangle);
    SurfaceMap { surfaces, of_triangle, welded }
}

/// For each vertex the lowest vertex index with exactly its position.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    // + 0.0 turns -0 into 0, which is the same place
    let key = |(i, p): (usize, &Vec3)| ((*p + 0.0).to_array().map(f32::to_bits), i as u32);
    let mut order: Vec<([u32; 3], u32)> = positions.par_iter().enumerate().map(key).collect();
    order.par_sort_unstable();
    let mut welded = vec![0; positions.len()];
    let mut first = 0;
    for i in 0..order.len() {
        if order[i].0 != order[first].0 {
            first = i;
        }
        welded[order[i].1 as usize] = order[first].1;
    }
    welded
}

/// One triangle's side as it lies at the lower of its two vertices.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    high: u32,
    object: u32,
    triangle: u32,
    /// Runs from the lower to the higher vertex.
    upward: bool,
}

/// Pairs of neighbouring triangles that turn no more than the crease angle.
fn neighbours(mesh: &Mesh, welded: &[u32], normals: &[Vec3], cos_crease: f32) -> Vec<(u32, u32)> {
    let (starts, mut half_edges) = half_edges_by_vertex(mesh, welded);
    // Chunks of vertices own disjoint stretches of `half_edges`, so they can be sorted and matched side by side.
    const CHUNK: usize = 1 << 14;
    let vertices = welded.len();
    let mut stretches = Vec::new();
    let mut rest = half_edges.as_mut_slice();
    for first in (0..vertices).step_by(CHUNK) {
        let last = (first + CHUNK).min(vertices);
        let (stretch, tail) = rest.split_at_mut((starts[last] - starts[first]) as usize);
        stretches.push((first..last, stretch));
        rest = tail;
    }
    let pairs: Vec<Vec<(u32, u32)>> = stretches
        .into_par_iter()
        .map(|(range, stretch)| {
            let base = starts[range.start];
            let mut pairs = Vec::new();
            for vertex in range {
                let around = &mut stretch[(starts[vertex] - base) as usize..(starts[vertex + 1] - base) as usize];
                around.sort_unstable();
                for edge in around.chunk_by(|a, b| (a.high, a.object) == (b.high, b.object)) {
                    match_edge(edge, normals, cos_crease, &mut pairs);
                }
            }
            pairs
        })
        .collect();
    pairs.concat()
}

/// Half edges grouped by their lower vertex (counting sort), and where each group starts.
fn half_edges_by_vertex(mesh: &Mesh, welded: &[u32]) -> (Vec<u32>, Vec<HalfEdge>) {
    let sides = |t: usize| {
        let [a, b, c] = mesh.triangles[t].map(|i| welded[i as usize]);
        [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to)
    };
    let mut starts = vec![0u32; welded.len() + 1];
    for t in 0..mesh.triangles.len() {
        for (from, to) in sides(t) {
            starts[from.min(to) as usize + 1] += 1;
        }
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut half_edges = vec![HalfEdge::default(); starts[welded.len()] as usize];
    for t in 0..mesh.triangles.len() {
        let object = mesh.object_of_triangle[t];
        for (from, to) in sides(t) {
            let place = &mut next[from.min(to) as usize];
            half_edges[*place as usize] =
                HalfEdge { high: from.max(to), object, triangle: t as u32, upward: from < to };
            *place += 1;
        }
    }
    (starts, half_edges)
}

fn match_edge(edge: &[HalfEdge], normals: &[Vec3], cos_crease: f32, pairs: &mut Vec<(u32, u32)>) {
    if edge.len() > MAX_EDGE_TRIANGLES {
        return;
    }
    for (i, a) in edge.iter().enumerate() {
        for b in &edge[i + 1..] {
            let agree = a.upward != b.upward;
            if !agree && edge.len() > 2 {
                continue;
            }
            let cos_turn = normals[a.triangle as usize].dot(normals[b.triangle as usize]);
            if (if agree { cos_turn } else { -cos_turn }) >= cos_crease {
                pairs.push((a.triangle, b.triangle));
            }
        }
    }
}

/// Areas and bounds.
fn measure(mesh: &Mesh, of_triangle: &[u32]) -> Vec<Surface> {
    let areas: Vec<f64> = (0..mesh.triangles.len() as u32).into_par_iter().map(|t| mesh.area(t)).collect();
    let mut surfaces: Vec<Surface> = Vec::new();
    for (t, &s) in of_triangle.iter().enumerate() {
        if s as usize == surfaces.len() {
            let object = mesh.object_of_triangle[t];
            surfaces.push(Surface { area: 0.0, triangles: 0, object, bounds: Aabb::EMPTY, class: Class::Normal });
        }
        let surface = &mut surfaces[s as usize];
        surface.area += areas[t];
        surface.triangles += 1;
        surface.bounds = mesh.corners(t as u32).into_iter().fold(surface.bounds, Aabb::with);
    }
    surfaces
}

/// Union-find whose representatives are the lowest members, so that numbering does not depend on the order of unions.
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// `n` sets of one.
    pub fn new(n: usize) -> Self {
        DisjointSets { parent: (0..n as u32).collect() }
    }

    /// The lowest member of the set that holds `i`.
    pub fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let grandparent = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = grandparent;
            i = grandparent;
        }
        i
    }

    /// Makes one set of those that hold `a` and `b`.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// For each member the number of its set; sets are numbered in the order of their lowest members.
    pub fn numbered(mut self) -> Vec<u32> {
        let mut numbers = vec![0; self.parent.len()];
        let mut next = 0;
        for i in 0..self.parent.len() as u32 {
            let root = self.find(i);
            if root == i {
                numbers[i as usize] = next;
                next += 1;
            } else {
                numbers[i as usize] = numbers[root as usize];
            }
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::simplify::testing::*;

    const CREASE: f32 = 0.5;

    fn count(triangles: &[[Vec3; 3]]) -> usize {
        find_surfaces(&SceneBuilder::default().grey(0.5, triangles).build().mesh, CREASE).surfaces.len()
    }

    #[test]
    fn a_box_has_six_sides_and_a_sphere_one() {
        assert_eq!(count(&solid([0.0; 3], [1.0; 3])), 6);
        assert_eq!(count(&sphere(Vec3::ZERO, 1.0, 16)), 1);
    }

    #[test]
    fn mixed_winding_does_not_tear_a_sheet() {
        let mut sheet = diced_quad(Vec3::ZERO, Vec3::X, Vec3::Y, 10);
        sheet.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
        assert_eq!(count(&sheet), 1);
    }

    #[test]
    fn coincident_sides_stay_apart_and_whole() {
        let mut sheet = diced_quad(Vec3::ZERO, Vec3::X, Vec3::Y, 10);
        let back: Vec<_> = sheet.iter().map(|&[a, b, c]| [a, c, b]).collect();
        sheet.extend(back);
        assert_eq!(count(&sheet), 2);
    }

    #[test]
    fn a_wall_on_a_floor_does_not_cut_it() {
        let mut floor = diced_quad(Vec3::ZERO, Vec3::X, Vec3::Z, 2);
        floor.extend(quad(Vec3::new(0.5, 0.0, 0.0), Vec3::Z * 0.5, Vec3::Y));
        assert_eq!(count(&floor), 2);
    }

    #[test]
    fn objects_do_not_share_surfaces() {
        let (left, right) = (quad(Vec3::ZERO, Vec3::X, Vec3::Y), quad(Vec3::X, Vec3::X, Vec3::Y));
        let scene = SceneBuilder::default().grey(0.5, &left).grey(0.5, &right).build();
        let map = find_surfaces(&scene.mesh, CREASE);
        assert_eq!(map.of_triangle, [0, 0, 1, 1]);
        assert_eq!(map.surfaces[1].object, 1);
        assert!((map.surfaces[1].area - 1.0).abs() < 1e-12);
    }

    #[test]
    fn negative_zero_is_zero() {
        let flipped = [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::new(-0.0, 0.0, -0.0), Vec3::Y, Vec3::NEG_X]];
        assert_eq!(count(&flipped), 1);
    }

    #[test]
    fn crease_angle_decides() {
        let bent = |angle: f32| {
            let mut sheet = quad(Vec3::ZERO, Vec3::Z, Vec3::X);
            sheet.extend(quad(Vec3::ZERO, Vec3::new(-angle.cos(), angle.sin(), 0.0), Vec3::Z));
            count(&sheet)
        };
        assert_eq!((bent(CREASE - 0.01), bent(CREASE + 0.01)), (1, 2));
    }
}
