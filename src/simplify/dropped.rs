//! Small surfaces that the simplified scene does without.
//!
//! The paper bounds the solid angle of each dropped surface by `2 pi beta` (Eq. 4-6). Ten thousand surfaces just under the
//! threshold are a wall, though, so the bound is put on their sum instead: whatever is dropped from one region, three
//! voxels of size `r_thresh` wide, has less area than `A_thresh` together. What exceeds that stays.
//!
//! The bound is on area, not on length: a long strip (the edge of a board, a rail) is dropped like anything else, with its
//! area charged to the regions it passes through. It must be narrow, though. What is long and wide may be a wall (GSII-025).

use std::collections::HashMap;

use glam::{IVec3, Vec3};

use crate::scene::{Aabb, Mesh};

/// Largest mean width of a long surface that may be dropped, in units of `r_thresh`: an angle of 0.1 at the least distance.
const STRIP_WIDTH: f64 = 0.1;

/// Pieces that a triangle of a strip is cut into, along each edge at most.
const MOST_CUTS: u32 = 32;

/// Something that could be dropped.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Bound on the area that it can turn towards a point.
    pub area: f64,
    /// Its parts, each a point and the share of `area` around it, none much larger than `r_thresh`.
    pub parts: Vec<(Vec3, f64)>,
}

impl Candidate {
    /// Something no larger than about `r_thresh`.
    pub fn compact(centre: Vec3, area: f64) -> Self {
        Candidate { area, parts: vec![(centre, area)] }
    }

    /// Something that fills `bounds` evenly.
    pub fn spread(bounds: Aabb, area: f64, r_thresh: f32) -> Self {
        let cells = (bounds.size() / r_thresh).ceil().clamp(Vec3::ONE, Vec3::splat(MOST_CUTS as f32));
        let [x, y, z] = cells.as_uvec3().to_array();
        let share = area / f64::from(x * y * z);
        let part = |i: u32| {
            let cell = Vec3::new((i % x) as f32, (i / x % y) as f32, (i / x / y) as f32) + 0.5;
            (bounds.min + cell / cells * bounds.size(), share)
        };
        Candidate { area, parts: (0..x * y * z).map(part).collect() }
    }

    /// Something long.
    pub fn strip(mesh: &Mesh, triangles: &[u32], r_thresh: f32) -> Self {
        let mut parts = Vec::new();
        for &t in triangles {
            let [a, b, c] = mesh.corners(t);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let n = ((2.0 * longest / r_thresh).ceil() as u32).clamp(1, MOST_CUTS);
            let share = mesh.area(t) / f64::from(n * n);
            // Centroids of the n^2 similar triangles between n parallels to each side.
            for i in 0..n {
                for j in 0..n - i {
                    let at = |x: f32, y: f32| a + ((i as f32 + x) * (b - a) + (j as f32 + y) * (c - a)) / n as f32;
                    parts.push((at(1.0 / 3.0, 1.0 / 3.0), share));
                    if i + j + 1 < n {
                        parts.push((at(2.0 / 3.0, 2.0 / 3.0), share));
                    }
                }
            }
        }
        Candidate { area: parts.iter().map(|p| p.1).sum(), parts }
    }
}

/// Whether a surface of this area and length is narrow enough to be dropped although it is long.
pub fn is_strip(area: f64, length: f32, r_thresh: f32) -> bool {
    area <= STRIP_WIDTH * f64::from(length) * f64::from(r_thresh)
}

/// Keeps account of what was dropped where.
pub struct Dropper {
    /// Most area dropped from a region.
    pub a_thresh: f64,
    /// Edge of a voxel.
    pub r_thresh: f32,
    /// Dropped area in the 27 voxels around each voxel. Only looked up, never iterated.
    around: HashMap<IVec3, f64>,
}

impl Dropper {
    /// Nothing dropped yet.
    pub fn new(a_thresh: f64, r_thresh: f32) -> Self {
        Dropper { a_thresh, r_thresh, around: HashMap::new() }
    }

    /// For each candidate, whether it is dropped. The smallest go first: they cost a box as much as large ones do and matter
    /// least.
    pub fn choose(&mut self, candidates: &[Candidate]) -> Vec<bool> {
        let mut dropped = vec![false; candidates.len()];
        let mut order: Vec<usize> = (0..candidates.len()).filter(|&i| candidates[i].area < self.a_thresh).collect();
        order.sort_by(|&a, &b| candidates[a].area.total_cmp(&candidates[b].area).then(a.cmp(&b)));
        for i in order {
            dropped[i] = self.drop(&candidates[i]);
        }
        dropped
    }

    /// Charges a candidate to its regions, unless one of them has no room for it.
    fn drop(&mut self, candidate: &Candidate) -> bool {
        for (charged, &(point, area)) in candidate.parts.iter().enumerate() {
            let voxel = (point / self.r_thresh).floor().as_ivec3();
            let mut full = false;
            for c in neighbourhood(voxel) {
                let sum = self.around.entry(c).or_default();
                *sum += area;
                full |= *sum > self.a_thresh;
            }
            if full {
                self.take_back(&candidate.parts[..=charged]);
                return false;
            }
        }
        true
    }

    fn take_back(&mut self, parts: &[(Vec3, f64)]) {
        for &(point, area) in parts {
            let voxel = (point / self.r_thresh).floor().as_ivec3();
            for c in neighbourhood(voxel) {
                *self.around.entry(c).or_default() -= area;
            }
        }
    }
}

fn neighbourhood(voxel: IVec3) -> impl Iterator<Item = IVec3> {
    (0..27).map(move |i| voxel + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1))
}
