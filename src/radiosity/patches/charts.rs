//! Charts: connected triangles of one surface whose normals stay close to their mean, so that a plane grid can cut them, with what
//! beside them is too small to be a patch.

use std::collections::VecDeque;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::join::join_small;

use crate::simplify::SimplifiedGeometry;

const NONE: u32 = u32::MAX;

/// Which chart each triangle belongs to, and the plane each chart is seen in.
pub(super) struct Charts {
    /// Chart of each triangle.
    pub of_triangle: Vec<u32>,
    /// Mean normal and in-plane axes of each chart.
    pub frames: Vec<Frame>,
}

/// Right-handed orthonormal axes of a chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Direction of grid columns.
    pub x: DVec3,
    /// Direction of grid rows.
    pub y: DVec3,
    /// Mean normal.
    pub normal: DVec3,
}

/// An edge of a triangle with welded end points in ascending order. Sorting brings triangles of one surface that share an
/// edge together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    surface: u32,
    pub ends: [u32; 2],
    pub triangle: u32,
}

impl Edge {
    pub fn joins(&self, other: &Edge) -> bool {
        self.surface == other.surface && self.ends == other.ends
    }
}

/// Grows charts over `geometry`: breadth first from the first triangle that has none, over shared edges, while the normal
/// stays within the angle of cosine `min_cos` of the chart's area-weighted mean so far. Charts that are small against patches of edge
/// length `size` are joined to a neighbour.
pub(super) fn grow(geometry: &SimplifiedGeometry, min_cos: f64, size: f64) -> Charts {
    let welded = weld(geometry);
    let edges = sorted_edges(geometry, &welded);
    let neighbours = neighbours(&edges, geometry.triangles.len());
    let vector_areas: Vec<DVec3> = geometry.triangles.par_iter().map(|&t| super::vector_area(geometry, t)).collect();
    let mut of_triangle = vec![NONE; geometry.triangles.len()];
    let mut normals = Vec::new();
    let mut queue = VecDeque::new();
    for seed in 0..of_triangle.len() {
        if of_triangle[seed] != NONE {
            continue;
        }
        let chart = normals.len() as u32;
        let mut sum = vector_areas[seed];
        of_triangle[seed] = chart;
        queue.push_back(seed as u32);
        while let Some(triangle) = queue.pop_front() {
            for &next in &neighbours[triangle as usize] {
                if next == NONE || of_triangle[next as usize] != NONE {
                    continue;
                }
                let area = vector_areas[next as usize];
                if area.dot(sum) >= min_cos * area.length() * sum.length() {
                    sum += area;
                    of_triangle[next as usize] = chart;
                    queue.push_back(next);
                }
            }
        }
        normals.push(sum.try_normalize().unwrap_or(DVec3::Z));
    }
    let frames = frames(geometry, &edges, &of_triangle, &normals);
    let largest = join_small(geometry, &edges, &mut of_triangle, frames.len(), size);
    Charts { of_triangle, frames: largest.into_iter().map(|chart| frames[chart as usize]).collect() }
}

/// Gives vertices at the same position the same number.
fn weld(geometry: &SimplifiedGeometry) -> Vec<u32> {
    // Adding zero turns -0 into +0, which compare equal but differ in bits.
    let mut keys: Vec<([u32; 3], u32)> = geometry
        .positions
        .par_iter()
        .enumerate()
        .map(|(i, p)| ((*p + 0.0).to_array().map(f32::to_bits), i as u32))
        .collect();
    keys.par_sort_unstable();
    let mut welded = vec![0; keys.len()];
    for run in keys.chunk_by(|a, b| a.0 == b.0) {
        for &(_, vertex) in run {
            welded[vertex as usize] = run[0].1;
        }
    }
    welded
}

fn sorted_edges(geometry: &SimplifiedGeometry, welded: &[u32]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = geometry
        .triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(triangle, corners)| {
            let corner = corners.map(|i| welded[i as usize]);
            let surface = geometry.surface_of_triangle[triangle];
            (0..3).map(move |k| {
                let (a, b) = (corner[k], corner[(k + 1) % 3]);
                Edge { surface, ends: [a.min(b), a.max(b)], triangle: triangle as u32 }
            })
        })
        .collect();
    edges.par_sort_unstable();
    edges
}

/// Up to two neighbours over each of a triangle's edges; where more than two meet, they are chained.
fn neighbours(edges: &[Edge], triangles: usize) -> Vec<[u32; 6]> {
    let mut neighbours = vec![[NONE; 6]; triangles];
    let mut link = |from: u32, to: u32| {
        if let Some(slot) = neighbours[from as usize].iter_mut().find(|n| **n == NONE) {
            *slot = to;
        }
    };
    for pair in edges.windows(2) {
        if pair[0].joins(&pair[1]) && pair[0].triangle != pair[1].triangle {
            link(pair[0].triangle, pair[1].triangle);
            link(pair[1].triangle, pair[0].triangle);
        }
    }
    neighbours
}

/// Aligns the axes of each chart with its outline: the mean direction modulo a right angle of all boundary edges, weighted by
/// length. Exact for rectangles, and the same however finely the outline is divided.
fn frames(geometry: &SimplifiedGeometry, edges: &[Edge], of_triangle: &[u32], normals: &[DVec3]) -> Vec<Frame> {
    let planes: Vec<(DVec3, DVec3)> = normals.iter().map(|n| n.any_orthonormal_pair()).collect();
    let mut fourfold = vec![DVec2::ZERO; normals.len()];
    for run in edges.chunk_by(Edge::joins) {
        let [a, b] = run[0].ends.map(|i| geometry.positions[i as usize].as_dvec3());
        for edge in run {
            let chart = of_triangle[edge.triangle as usize];
            let shared = run.iter().any(|e| e.triangle != edge.triangle && of_triangle[e.triangle as usize] == chart);
            if !shared {
                let (x, y) = planes[chart as usize];
                let d = DVec2::new((b - a).dot(x), (b - a).dot(y));
                fourfold[chart as usize] += d.length() * DVec2::from_angle(4.0 * d.y.atan2(d.x));
            }
        }
    }
    let frame = |((&normal, &(x, y)), sum): ((&DVec3, &(DVec3, DVec3)), &DVec2)| {
        let (sin, cos) = (0.25 * sum.y.atan2(sum.x)).sin_cos();
        Frame { x: cos * x + sin * y, y: cos * y - sin * x, normal }
    };
    normals.iter().zip(&planes).zip(&fourfold).map(frame).collect()
}
