//! Finding the records that reach a place.

use std::collections::hash_map::Entry;

use glam::{IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::record::Record;

/// Records by the cells of grids that they reach: one grid for each power of two of reaches. Cells of a grid are halved by the next
/// finer one.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// Sizes of cells as powers of two, ascending.
    levels: Vec<i32>,
    /// By level and cell: the range in `records`, empty where there are only finer cells within.
    cells: FxHashMap<(i32, IVec3), [u32; 2]>,
    /// Numbers of records.
    records: Vec<u32>,
}

impl Index {
    pub(super) fn new(records: &[Record]) -> Self {
        let mut entries: Vec<((i32, [i32; 3]), u32)> = Vec::new();
        for (number, record) in records.iter().enumerate() {
            let level = record.reach.log2().ceil() as i32;
            let reach = Vec3::splat(record.reach);
            let (low, high) = (cell(record.position - reach, level), cell(record.position + reach, level));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        entries.push(((level, [x, y, z]), number as u32));
                    }
                }
            }
        }
        entries.sort_unstable();
        let mut index = Index::default();
        for group in entries.chunk_by(|a, b| a.0 == b.0) {
            let (level, at) = group[0].0;
            if index.levels.last() != Some(&level) {
                index.levels.push(level);
            }
            let first = index.records.len() as u32;
            index.records.extend(group.iter().map(|e| e.1));
            index.cells.insert((level, IVec3::from_array(at)), [first, index.records.len() as u32]);
        }
        let coarsest = index.levels.last().copied().unwrap_or(0);
        for group in entries.chunk_by(|a, b| a.0 == b.0) {
            let (mut level, at) = group[0].0;
            let mut at = IVec3::from_array(at);
            while level < coarsest {
                (level, at) = (level + 1, at >> 1);
                match index.cells.entry((level, at)) {
                    // Those around it are there, too, but for the cells of records, which are come to later.
                    Entry::Occupied(held) if held.get()[0] == held.get()[1] => break,
                    Entry::Occupied(_) => {}
                    Entry::Vacant(place) => {
                        place.insert([0, 0]);
                    }
                }
            }
        }
        index
    }

    /// Levels of the smallest and the largest cells; `None` without records.
    pub(super) fn levels(&self) -> Option<[i32; 2]> {
        Some([*self.levels.first()?, *self.levels.last()?])
    }

    fn records(&self, key: (i32, IVec3)) -> &[u32] {
        self.cells.get(&key).map_or(&[], |&[first, end]| &self.records[first as usize..end as usize])
    }

    /// Numbers of the records that may reach into a cell of one of the levels, in the order of [`Index::around`], with the levels of
    /// their own cells.
    pub(super) fn within(&self, (level, at): (i32, IVec3), found: &mut Vec<(i32, u32)>) {
        found.clear();
        let mut cells = vec![(level, at)];
        while let Some((level, at)) = cells.pop() {
            found.extend(self.records((level, at)).iter().map(|&number| (level, number)));
            if level > self.levels[0] {
                let child = |k: i32| (level - 1, at * 2 + IVec3::new(k & 1, k >> 1 & 1, k >> 2));
                cells.extend((0..8).map(child).filter(|key| self.cells.contains_key(key)));
            }
        }
        for &coarser in self.levels.iter().filter(|&&coarser| coarser > level) {
            let records = self.records((coarser, at >> (coarser - level)));
            found.extend(records.iter().map(|&number| (coarser, number)));
        }
        found.sort_unstable();
        found.dedup();
    }

    /// Numbers of the records that may reach `position`, always in the same order.
    pub(super) fn around(&self, position: Vec3) -> impl Iterator<Item = usize> + '_ {
        let ranges = self.levels.iter().map(move |&level| self.records((level, cell(position, level))));
        ranges.flat_map(|numbers| numbers.iter().map(|&number| number as usize))
    }
}

/// The cell of size `2^level` that holds a point.
pub(super) fn cell(position: Vec3, level: i32) -> IVec3 {
    (position * (-level as f32).exp2()).floor().as_ivec3()
}
