//! Finding the records that reach a point.

use glam::{IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::record::Record;

/// Records by the cells of grids that they reach: one grid for each power of two of reaches.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// Sizes of cells as powers of two, ascending.
    levels: Vec<i32>,
    /// By level and cell: the range in `records`.
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
        index
    }

    /// Numbers of the records that may reach `position`, always in the same order.
    pub(super) fn around(&self, position: Vec3) -> impl Iterator<Item = usize> + '_ {
        let ranges = self.levels.iter().filter_map(move |&level| self.cells.get(&(level, cell(position, level))));
        ranges.flat_map(|&[first, end]| self.records[first as usize..end as usize].iter().map(|&r| r as usize))
    }
}

/// The cell that holds a point.
fn cell(position: Vec3, level: i32) -> IVec3 {
    (position * (-level as f32).exp2()).floor().as_ivec3()
}
