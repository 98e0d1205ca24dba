//! Joining charts that are too small to be patches: the rounded edge of a board, the sides of a pencil.
//!
//! What would catch next to no rays has no radiosity worth its place: such a chart becomes part of the one beside it, whatever
//! the angle between them.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::DVec3;

use super::SMALLEST_SHARE;
use super::charts::Edge;
use crate::simplify::SimplifiedGeometry;

/// A chart, or several joined.
#[derive(Clone)]
struct Joint {
    area: f64,
    min: DVec3,
    max: DVec3,
    /// The largest of its charts, and the area of that.
    largest: (u32, f64),
    /// Length of the border to each neighbour.
    borders: BTreeMap<u32, f64>,
}

impl Joint {
    /// Whether a piece of it as long as a patch has less than the smallest share of a patch's area.
    fn is_small(&self, size: f64) -> bool {
        self.area < SMALLEST_SHARE * size * (self.max - self.min).length().max(size)
    }
}

/// Joins small charts, the smallest first, to the neighbour of their surface with which they share most border. `of_triangle` is
/// renumbered without gaps; gives for each chart that is left the largest of those it was made of, by its old number.
pub(super) fn join_small(
    geometry: &SimplifiedGeometry,
    edges: &[Edge],
    of_triangle: &mut [u32],
    charts: usize,
    size: f64,
) -> Vec<u32> {
    let mut joints = measure(geometry, edges, of_triangle, charts);
    let mut target: Vec<u32> = (0..charts as u32).collect();
    let entry = |joints: &[Joint], c: u32| Reverse((joints[c as usize].area.to_bits(), c));
    let mut small: BinaryHeap<_> =
        (0..charts as u32).filter(|&c| joints[c as usize].is_small(size)).map(|c| entry(&joints, c)).collect();
    while let Some(Reverse((area, c))) = small.pop() {
        // Bits of positive numbers are ordered as the numbers are; charts that grew since have another entry.
        let joint = &joints[c as usize];
        if target[c as usize] != c || joint.area.to_bits() != area || !joint.is_small(size) {
            continue;
        }
        let longest = joint.borders.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)));
        let Some((&into, _)) = longest else { continue };
        target[c as usize] = into;
        join(&mut joints, c, into);
        small.push(entry(&joints, into));
    }
    renumber(of_triangle, &target, &joints)
}

fn measure(geometry: &SimplifiedGeometry, edges: &[Edge], of_triangle: &[u32], charts: usize) -> Vec<Joint> {
    let empty = Joint {
        area: 0.0,
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
        largest: (0, 0.0),
        borders: BTreeMap::new(),
    };
    let mut joints = vec![empty; charts];
    for (&triangle, &chart) in geometry.triangles.iter().zip(of_triangle) {
        let joint = &mut joints[chart as usize];
        joint.area += super::vector_area(geometry, triangle).length();
        for p in super::corners(geometry, triangle) {
            (joint.min, joint.max) = (joint.min.min(p), joint.max.max(p));
        }
    }
    for (chart, joint) in (0..).zip(&mut joints) {
        joint.largest = (chart, joint.area);
    }
    for pair in edges.windows(2).filter(|pair| pair[0].joins(&pair[1])) {
        let [a, b] = [0, 1].map(|i| of_triangle[pair[i].triangle as usize]);
        if a != b {
            let [p, q] = pair[0].ends.map(|i| geometry.positions[i as usize].as_dvec3());
            *joints[a as usize].borders.entry(b).or_default() += p.distance(q);
            *joints[b as usize].borders.entry(a).or_default() += p.distance(q);
        }
    }
    joints
}

/// Makes joint `c` a part of its neighbour `into`.
fn join(joints: &mut [Joint], c: u32, into: u32) {
    let gone = joints[c as usize].clone();
    for (&neighbour, &length) in gone.borders.iter().filter(|(n, _)| **n != into) {
        let borders = &mut joints[neighbour as usize].borders;
        borders.remove(&c);
        *borders.entry(into).or_default() += length;
        *joints[into as usize].borders.entry(neighbour).or_default() += length;
    }
    let joint = &mut joints[into as usize];
    joint.borders.remove(&c);
    joint.area += gone.area;
    (joint.min, joint.max) = (joint.min.min(gone.min), joint.max.max(gone.max));
    if gone.largest.1 > joint.largest.1 {
        joint.largest = gone.largest;
    }
}

fn renumber(of_triangle: &mut [u32], target: &[u32], joints: &[Joint]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let root = |mut c: u32| {
        while target[c as usize] != c {
            c = target[c as usize];
        }
        c
    };
    let mut number = vec![NONE; target.len()];
    let mut kept = Vec::new();
    for chart in of_triangle {
        let root = root(*chart) as usize;
        if number[root] == NONE {
            number[root] = kept.len() as u32;
            kept.push(joints[root].largest.0);
        }
        *chart = number[root];
    }
    kept
}
