//! Grouping small surfaces: connected ones first, then neighbours, bottom-up.
//!
//! Groups remember what they were merged from: one whose box turns out to stand badly for it is split again.
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

/// The same for clusters longer than what may always be one: only what is dense hides its own far parts.
const LEAST_FILL_LONG: f64 = 0.1;

/// How large clusters may become.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Largest diagonal of a cluster that needs no proof; see [`classify::size_limit`](super::classify::size_limit).
    pub compact: f32,
    /// Largest diagonal of any cluster, at least `compact`.
    pub longest: f32,
}

/// A candidate cluster, and what it was made of.
#[derive(Clone, Debug)]
pub struct Group {
    /// Bounds.
    pub bounds: Aabb,
    /// Summed area of the surfaces, one side.
    pub area: f64,
    /// Number of triangles.
    pub triangles: u32,
    /// Number of surfaces.
    pub count: u32,
    /// The lowest of its surfaces.
    pub first: u32,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    /// One surface or several connected ones.
    Surfaces(Vec<u32>),
    Pair(Box<[Group; 2]>),
    /// Merged into another group; swept up at the end of the round.
    Gone,
}

impl Group {
    fn of(members: Vec<u32>, surfaces: &[Surface]) -> Self {
        let of = |&s: &u32| &surfaces[s as usize];
        Group {
            bounds: members.iter().fold(Aabb::EMPTY, |b, s| b.union(of(s).bounds)),
            area: members.iter().map(|s| of(s).area).sum(),
            triangles: members.iter().map(|s| of(s).triangles).sum(),
            count: members.len() as u32,
            first: members.iter().copied().min().unwrap_or(u32::MAX),
            content: Content::Surfaces(members),
        }
    }

    fn pair(a: Group, b: Group) -> Self {
        Group {
            bounds: a.bounds.union(b.bounds),
            area: a.area + b.area,
            triangles: a.triangles + b.triangles,
            count: a.count + b.count,
            first: a.first.min(b.first),
            content: Content::Pair(Box::new([a, b])),
        }
    }

    fn take(&mut self) -> Group {
        let gone = Group { content: Content::Gone, ..*self };
        std::mem::replace(self, gone)
    }

    /// Bound on the largest area that the group can turn towards any point: its own, or half the surface of its box (no
    /// convex body shows more).
    pub fn visible_area(&self) -> f64 {
        self.area.min(0.5 * f64::from(self.bounds.surface_area()))
    }

    /// Its surfaces, ascending.
    pub fn surfaces(&self) -> Vec<u32> {
        let mut all = Vec::new();
        self.collect(&mut all);
        all.sort_unstable();
        all
    }

    // No deeper than there were rounds of merging.
    fn collect(&self, all: &mut Vec<u32>) {
        match &self.content {
            Content::Surfaces(own) => all.extend(own),
            Content::Pair(parts) => parts.iter().for_each(|p| p.collect(all)),
            Content::Gone => {}
        }
    }

    /// The two groups that it was merged from; empty where it was not.
    pub fn parts(&self) -> &[Group] {
        match &self.content {
            Content::Pair(parts) => parts.as_slice(),
            _ => &[],
        }
    }

    /// Whether it was merged from others.
    pub fn has_parts(&self) -> bool {
        !self.parts().is_empty()
    }

    /// What it was merged from; itself where it was not.
    pub fn split(self) -> Vec<Group> {
        match self.content {
            Content::Pair(parts) => Vec::from(parts as Box<[Group]>),
            _ => vec![self],
        }
    }
}

/// Groups the surfaces `small` as far as `extent` allows.
pub fn find_clusters(mesh: &Mesh, map: &SurfaceMap, small: &[u32], extent: Extent) -> Vec<Group> {
    let mut groups = connected(mesh, map, small, extent.longest);
    for shift in SHIFTS {
        morton_sort(&mut groups, shift);
        for _ in 0..MOST_ROUNDS {
            if !merge_pairs(&mut groups, extent) {
                break;
            }
        }
    }
    groups.sort_by_key(|g| g.first);
    groups
}

/// Surfaces that share vertices (the sides of one pencil) make one group, where it is not too large, else those of one object
/// do (each of the blocks of a wall), else each is one.
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
            groups.extend(by_object(&group.surfaces(), &map.surfaces, limit));
        }
    }
    groups
}

/// One group for each object among `members` (ascending) where it is not too large, else one for each surface.
fn by_object(members: &[u32], surfaces: &[Surface], limit: f32) -> Vec<Group> {
    let object = |s: &u32| surfaces[*s as usize].object;
    let groups = members.chunk_by(|a, b| object(a) == object(b)).flat_map(|own| {
        let whole = Group::of(own.to_vec(), surfaces);
        if whole.bounds.diagonal() <= limit {
            vec![whole]
        } else {
            own.iter().map(|&s| Group::of(vec![s], surfaces)).collect()
        }
    });
    groups.collect()
}

fn morton_sort(groups: &mut [Group], shift: f32) {
    let all = groups.iter().fold(Aabb::EMPTY, |b, g| b.union(g.bounds));
    // One cubic grid with room for the shift: 2^10 cells in three dimensions fill 30 bits.
    let scale = 1023.0 / (2.0 * all.size().max_element()).max(f32::MIN_POSITIVE);
    let origin = all.min - Vec3::splat(shift * all.size().max_element());
    groups.sort_by_cached_key(|g| {
        let cell = ((g.bounds.centre() - origin) * scale).as_uvec3();
        (spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2, g.first)
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
fn merge_pairs(groups: &mut Vec<Group>, extent: Extent) -> bool {
    let partner: Vec<Option<usize>> = (0..groups.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let (first, last) = (i.saturating_sub(WINDOW), (i + WINDOW + 1).min(groups.len()));
            (first..last)
                .filter(|&j| j != i)
                .filter_map(|j| merge_cost(&groups[i], &groups[j], extent).map(|cost| (cost, j)))
                // Equal costs go to the pair with the lower indices, seen alike from both sides, so that ties can merge.
                .min_by(|a, b| a.0.total_cmp(&b.0).then((i.min(a.1), i.max(a.1)).cmp(&(i.min(b.1), i.max(b.1)))))
                .map(|(_, j)| j)
        })
        .collect();
    let mutual = |i: usize| partner[i].filter(|&j| partner[j] == Some(i));
    let before = groups.len();
    for i in 0..before {
        if let Some(j) = mutual(i).filter(|&j| j > i) {
            groups[i] = Group::pair(groups[i].take(), groups[j].take());
        }
    }
    groups.retain(|g| !matches!(g.content, Content::Gone));
    groups.len() < before
}

/// Surface of the box around both, or `None` where they must not merge.
fn merge_cost(a: &Group, b: &Group, extent: Extent) -> Option<f32> {
    let gap = (a.bounds.min - b.bounds.max).max(b.bounds.min - a.bounds.max).max(Vec3::ZERO).length();
    if gap > neighbour_gap(extent.compact) {
        return None;
    }
    let both = a.bounds.union(b.bounds);
    let (surface, diagonal) = (both.surface_area(), both.diagonal());
    let fill = 2.0 * (a.area + b.area) / f64::from(surface).max(f64::MIN_POSITIVE);
    let least = if diagonal <= extent.compact { LEAST_FILL } else { LEAST_FILL_LONG };
    (diagonal <= extent.longest && fill >= least).then_some(surface)
}
