//! Surfaces as gsii counts them: connected patches of triangles that turn little from one to the next.

use std::collections::HashMap;

use glam::Vec3;

/// Neighbouring triangles that turn more than this belong to different surfaces.
pub const CREASE_DEGREES: f32 = 30.0;

/// Merges vertices at equal positions. Returns the kept positions and, for each vertex, its new index.
pub fn weld(positions: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let mut kept = Vec::new();
    let index = positions
        .iter()
        .map(|p| {
            // Adding zero turns -0 into +0, so that both have the same bits.
            let p = *p + Vec3::ZERO;
            *first.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                kept.push(p);
                kept.len() as u32 - 1
            })
        })
        .collect();
    (kept, index)
}

/// Twice the area times the normal. In f64, so that slivers keep their direction.
pub fn cross(positions: &[Vec3], triangle: [u32; 3]) -> glam::DVec3 {
    let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3());
    (b - a).cross(c - a)
}

/// A triangle's side: its vertices in ascending order, the triangle, and whether it runs from the lower to the higher.
pub type Edge = ((u32, u32), u32, bool);

/// The sides of all triangles, sorted, so that triangles of one edge are neighbours.
pub fn sorted_edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            edges.push(((p.min(q), p.max(q)), t as u32, p < q));
        }
    }
    edges.sort_unstable();
    edges
}

/// The surface of each triangle (numbered from 0 in order of first appearance) and how many there are.
///
/// Two triangles are neighbours where they share an edge and wind alike: a board goes on beneath the side that stands on it.
/// `positions` must be welded.
pub fn surfaces(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<u32>, u32) {
    let normals: Vec<_> = triangles.iter().map(|&t| cross(positions, t).normalize_or_zero()).collect();
    let crease = f64::from(CREASE_DEGREES).to_radians().cos();
    let mut parent: Vec<u32> = (0..triangles.len() as u32).collect();
    for edge in sorted_edges(triangles).chunk_by(|a, b| a.0 == b.0) {
        for (i, &(_, s, upward)) in edge.iter().enumerate() {
            for &(_, t, other) in &edge[i + 1..] {
                if upward != other && normals[s as usize].dot(normals[t as usize]) >= crease {
                    let (s, t) = (root(&mut parent, s), root(&mut parent, t));
                    parent[s.max(t) as usize] = s.min(t);
                }
            }
        }
    }
    let mut count = 0;
    let mut number = vec![u32::MAX; triangles.len()];
    let of_triangle = (0..triangles.len() as u32)
        .map(|t| {
            let r = root(&mut parent, t) as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect();
    (of_triangle, count)
}

fn root(parent: &mut [u32], mut t: u32) -> u32 {
    while parent[t as usize] != t {
        parent[t as usize] = parent[parent[t as usize] as usize];
        t = parent[t as usize];
    }
    t
}

#[cfg(test)]
mod tests {
    use crate::primitives::{ALL_FACES, cuboid, cylinder};

    use super::*;

    fn count(shape: &crate::shape::Shape) -> u32 {
        let (positions, index) = weld(&shape.positions);
        let triangles: Vec<_> = shape.triangles.iter().map(|t| t.map(|i| index[i as usize])).collect();
        surfaces(&positions, &triangles).1
    }

    #[test]
    fn box_has_six_and_cylinder_three() {
        assert_eq!(count(&cuboid(Vec3::ZERO, Vec3::ONE, ALL_FACES)), 6);
        assert_eq!(count(&cylinder(1.0, 2.0, 16)), 3);
        // Ten sides turn 36 degrees each: every side is a surface of its own.
        assert_eq!(count(&cylinder(1.0, 2.0, 10)), 12);
    }

    #[test]
    fn surface_goes_on_where_another_begins() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::Z];
        assert_eq!(surfaces(&p, &[[0, 1, 2], [0, 3, 1]]).1, 1);
        // The third stands on the edge between the others.
        assert_eq!(surfaces(&p, &[[0, 1, 2], [0, 3, 1], [0, 4, 1]]).1, 2);
        // Two sheets back to back stay apart.
        assert_eq!(surfaces(&p, &[[0, 1, 2], [0, 2, 1]]).1, 2);
    }
}
