//! Photons within reach of a place, where there are few: most places have none at all.

use glam::{IVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Most photons that are looked at one by one.
const FEW: usize = 128;

/// Photons by the cells of a grid that they reach into.
#[derive(Clone, Debug, Default)]
pub(super) struct ReachGrid {
    /// One over the width of a cell.
    scale: f32,
    /// By cell: the range in `numbers`.
    cells: FxHashMap<IVec3, [u32; 2]>,
    /// Numbers of photons, ascending in each cell.
    numbers: Vec<u32>,
}

/// The photons that may be within reach of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Near<'a> {
    /// These.
    Few(&'a [u32]),
    /// Too many to look at each.
    Many,
}

impl ReachGrid {
    /// Of photons at `positions` that reach over `reach`.
    pub fn new(positions: impl Iterator<Item = Vec3>, reach: f32) -> ReachGrid {
        // A photon reaches into two cells along each axis, or three where rounding says so.
        let scale = 0.5 / reach;
        let cell = |p: Vec3| (p * scale).floor().as_ivec3();
        let mut entries: Vec<([i32; 3], u32)> = Vec::new();
        for (number, position) in (0..).zip(positions) {
            let (low, high) = (cell(position - reach), cell(position + reach));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    entries.extend((low.x..=high.x).map(|x| ([x, y, z], number)));
                }
            }
        }
        entries.par_sort_unstable();
        let mut grid = ReachGrid { scale, numbers: entries.iter().map(|e| e.1).collect(), ..ReachGrid::default() };
        let mut first = 0;
        for group in entries.chunk_by(|a, b| a.0 == b.0) {
            let end = first + group.len() as u32;
            grid.cells.insert(IVec3::from_array(group[0].0), [first, end]);
            first = end;
        }
        grid
    }

    /// The photons that may be within reach of a place, and others.
    #[inline]
    pub fn near(&self, position: Vec3) -> Near<'_> {
        match self.cells.get(&(position * self.scale).floor().as_ivec3()) {
            None => Near::Few(&[]),
            Some(&[first, end]) if (end - first) as usize > FEW => Near::Many,
            Some(&[first, end]) => Near::Few(&self.numbers[first as usize..end as usize]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, unit};

    /// Dense and empty parts of a cube: whatever a place can reach is in its list, in ascending order.
    #[test]
    fn nothing_within_reach_is_missing() {
        let random = |i: u32, what: u32| {
            let axis = |axis: u32| unit(hash_all(&[i, what, axis])).powi(3);
            Vec3::new(axis(0), axis(1), axis(2)) * 4.0 - 2.0
        };
        let photons: Vec<Vec3> = (0..3000).map(|i| random(i, 0)).collect();
        let (mut none, mut few, mut many) = (0, 0, 0);
        for reach in [0.05, 0.31] {
            let grid = ReachGrid::new(photons.iter().copied(), reach);
            for i in 0..2000 {
                let place = random(i, 1);
                let Near::Few(found) = grid.near(place) else {
                    many += 1;
                    continue;
                };
                assert!(found.is_sorted() && found.len() <= FEW);
                *(if found.is_empty() { &mut none } else { &mut few }) += 1;
                for (number, photon) in (0..).zip(&photons) {
                    let within = photon.distance_squared(place) < reach * reach;
                    assert!(!within || found.contains(&number), "{place} {photon}");
                }
            }
        }
        assert!(none > 300 && few > 300 && many > 300, "{none} {few} {many}");
        assert_eq!(ReachGrid::default().near(Vec3::ZERO), Near::Few(&[]));
    }
}
