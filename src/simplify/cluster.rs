//! Grouping small surfaces: connected ones first, then neighbours, bottom-up.
//!
//! Agglomeration is PLOC (Meister and Bittner 2018): groups lie in Morton order, each looks for its cheapest partner within a
//! window, and pairs that chose each other merge. O(n log n), deterministic, and unlike an octree it cuts nothing at cell
//! walls.

use glam::Vec3;
use rayon::prelude::*;

use super::Surface;
use super::classify::neighbour_gap;
use super::surfaces::{DisjointSets, SurfaceMap};
use crate::scene::{Aabb, Mesh};

/// How far along the Morton order a group looks for a partner, each way.
const WINDOW: usize = 12;

/// Morton order separates some neighbours at the planes of its grid; sorting again on a shifted grid brings them together.
const SHIFTS: [f32; 3] = [0.0, 0.31, 0.67];

/// Rounds of merging after each sort. Each round about halves what can still merge, so this is never reached but by
/// arrangements made for it.
const MOST_ROUNDS: usize = 100;

/// The least share of its bounding box's surface that a cluster may fill with its own. What is sparser than that a
/// box would gather far from where most of it is.
const LEAST_FILL: f64 = 0.01;

/// A candidate cluster.
#[derive(Clone, Debug)]
pub struct Group {
    /// Surfaces, ascending.
    pub surfaces: Vec<u32>,
    /// Bounds.
    pub bounds: Aabb,
    /// Summed area of the surfaces, one side.
    pub area: f64,
}

impl Group {
    fn of(members: Vec<u32>, surfaces: &[Surface]) -> Self {
        let bounds = members.iter().fold(Aabb::EMPTY, |b, &s| b.union(surfaces[s as usize].bounds));
        let area = members.iter().map(|&s| surfaces[s as usize].area).sum();
        Group { surfaces: members, bounds, area }
    }

    /// Bound on the largest area that the group can turn towards any point: its own, or half the surface of its box (no
    /// convex body shows more).
    pub fn visible_area(&self) -> f64 {
        self.area.min(0.5 * f64::from(self.bounds.surface_area()))
    }
}

/// Groups the surfaces `small`; no group has a diagonal above `limit`.
pub fn find_clusters(mesh: &Mesh, map: &SurfaceMap, small: &[u32], limit: f32) -> Vec<Group> {
    let mut groups = connected(mesh, map, small, limit);
    for shift in SHIFTS {
        morton_sort(&mut groups, shift);
        for _ in 0..MOST_ROUNDS {
            if !merge_pairs(&mut groups, limit) {
                break;
            }
        }
    }
    for group in &mut groups {
        group.surfaces.sort_unstable();
    }
    groups.sort_by_key(|g| g.surfaces[0]);
    groups
}

/// Surfaces that share vertices (the sides of one pencil) make one group, where it is not too large.
fn connected(mesh: &Mesh, map: &SurfaceMap, small: &[u32], limit: f32) -> Vec<Group> {
    const NONE: u32 = u32::MAX;
    let mut position = vec![NONE; map.surfaces.len()];
    for (i, &s) in (0u32..).zip(small) {
        position[s as usize] = i;
    }
    let mut sets = DisjointSets::new(small.len());
    let mut user = vec![NONE; map.welded.len()];
    for (t, &s) in map.of_triangle.iter().enumerate() {
        let i = position[s as usize];
        if i == NONE {
            continue;
        }
        for vertex in mesh.triangles[t] {
            let first = &mut user[map.welded[vertex as usize] as usize];
            if *first == NONE {
                *first = i;
            } else {
                sets.join(i, *first);
            }
        }
    }
    let mut components: Vec<Vec<u32>> = Vec::new();
    for (i, c) in sets.numbered().into_iter().enumerate() {
        if c as usize == components.len() {
            components.push(Vec::new());
        }
        components[c as usize].push(small[i]);
    }
    let mut groups = Vec::with_capacity(components.len());
    for members in components {
        let group = Group::of(members, &map.surfaces);
        if group.bounds.diagonal() <= limit {
            groups.push(group);
        } else {
            groups.extend(group.surfaces.iter().map(|&s| Group::of(vec![s], &map.surfaces)));
        }
    }
    groups
}

fn morton_sort(groups: &mut [Group], shift: f32) {
    let all = groups.iter().fold(Aabb::EMPTY, |b, g| b.union(g.bounds));
    // One cubic grid with room for the shift: 2^10 cells in three dimensions fill 30 bits.
    let scale = 1023.0 / (2.0 * all.size().max_element()).max(f32::MIN_POSITIVE);
    let origin = all.min - Vec3::splat(shift * all.size().max_element());
    groups.sort_by_cached_key(|g| {
        let cell = ((g.bounds.centre() - origin) * scale).as_uvec3();
        (spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2, g.surfaces[0])
    });
}

/// Puts two zero bits between the ten lowest bits of `x`.
fn spread(x: u32) -> u32 {
    let mut x = x & 0x3ff;
    x = (x | x << 16) & 0x0300_00ff;
    x = (x | x << 8) & 0x0300_f00f;
    x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Merges all pairs that are each other's cheapest partner; whether there were any.
fn merge_pairs(groups: &mut Vec<Group>, limit: f32) -> bool {
    let partner: Vec<Option<usize>> = (0..groups.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let (first, last) = (i.saturating_sub(WINDOW), (i + WINDOW + 1).min(groups.len()));
            (first..last)
                .filter(|&j| j != i)
                .filter_map(|j| merge_cost(&groups[i], &groups[j], limit).map(|cost| (cost, j)))
                // Equal costs go to the pair with the lower indices, seen alike from both sides, so that ties can merge.
                .min_by(|a, b| a.0.total_cmp(&b.0).then((i.min(a.1), i.max(a.1)).cmp(&(i.min(b.1), i.max(b.1)))))
                .map(|(_, j)| j)
        })
        .collect();
    let mutual = |i: usize| partner[i].filter(|&j| partner[j] == Some(i));
    let before = groups.len();
    for i in 0..before {
        if let Some(j) = mutual(i).filter(|&j| j > i) {
            let other = std::mem::take(&mut groups[j].surfaces);
            let (bounds, area) = (groups[j].bounds, groups[j].area);
            let group = &mut groups[i];
            group.surfaces.extend(other);
            group.bounds = group.bounds.union(bounds);
            group.area += area;
        }
    }
    groups.retain(|g| !g.surfaces.is_empty());
    groups.len() < before
}

/// Surface of the box around both, or `None` where they must not merge.
fn merge_cost(a: &Group, b: &Group, limit: f32) -> Option<f32> {
    let gap = (a.bounds.min - b.bounds.max).max(b.bounds.min - a.bounds.max).max(Vec3::ZERO).length();
    if gap > neighbour_gap(limit) {
        return None;
    }
    let both = a.bounds.union(b.bounds);
    let surface = both.surface_area();
    let fill = 2.0 * (a.area + b.area) / f64::from(surface).max(f64::MIN_POSITIVE);
    (both.diagonal() <= limit && fill >= LEAST_FILL).then_some(surface)
}
