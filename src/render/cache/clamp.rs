//! Neighbour clamping: a record that sees something close limits how far its neighbours may reach.

use glam::{IVec3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::record::Record;

/// Grids of cells that halve from one to the next.
const LEVELS: i32 = 6;

/// The distance of each record, bounded by its gradient, by `limit`, and by the distance of each neighbour and the way there
/// (Krivanek et al. 2006). Of the records in a cell the one that sees closest stands for all, on grids from `limit` down.
pub(super) fn clamped_distances(records: &[Record], limit: f32) -> Vec<f32> {
    let own = |r: &Record| r.distance.min(r.scale_of_change()).min(limit);
    let cell = |position: Vec3, level: i32| (position * (level as f32).exp2() / limit).floor().as_ivec3();
    let mut closest: FxHashMap<(i32, IVec3), u32> = FxHashMap::default();
    for (number, record) in records.iter().enumerate() {
        for level in 0..LEVELS {
            let held = closest.entry((level, cell(record.position, level))).or_insert(number as u32);
            if record.distance < records[*held as usize].distance {
                *held = number as u32;
            }
        }
    }
    let bounded = |record: &Record| {
        let mut distance = own(record);
        for level in 0..LEVELS {
            let centre = cell(record.position, level);
            for k in 0..27 {
                let offset = IVec3::new(k % 3, k / 3 % 3, k / 9) - 1;
                if let Some(&other) = closest.get(&(level, centre + offset)) {
                    let other = &records[other as usize];
                    distance = distance.min(other.distance + other.position.distance(record.position));
                }
            }
        }
        distance
    };
    records.par_iter().map(bounded).collect()
}
