//! Looking up many points that lie close together: the records around a small cell are collected once, eight abreast.

use glam::{IVec3, Vec3, Vec4};
use rustc_hash::FxHashMap;

use super::index::{Index, cell};
use super::record::{IN_FRONT, LEAST_COSINE, MOST_CHANGE, Record};

/// Records whose weights are worked out together.
const LANES: usize = 8;

/// A cell is about so many pixels wide.
const PIXELS: f32 = 4.0;

type Lanes = [f32; LANES];

/// What is to be added for a record that reaches a point.
#[derive(Clone, Copy, Default)]
struct Change {
    radiance: Vec4,
    rotation: [Vec4; 3],
    translation: [Vec4; 3],
}

/// Up to eight records.
#[derive(Clone, Copy, Default)]
struct Block {
    position: [Lanes; 3],
    normal: [Lanes; 3],
    reach: Lanes,
    refuses: [bool; LANES],
    changes: [Change; LANES],
}

impl Block {
    /// Weights of the records at a point, as [`Record::weight`].
    fn weights(&self, position: Vec3, normal: Vec3) -> Lanes {
        let ([px, py, pz], [nx, ny, nz], reach) = (&self.position, &self.normal, &self.reach);
        let mut weights = [0.0; LANES];
        // Compilers turn this into vector instructions as long as nothing in it branches
        for lane in 0..LANES {
            let (x, y, z) = (position.x - px[lane], position.y - py[lane], position.z - pz[lane]);
            let (d2, r2) = (x * x + y * y + z * z, reach[lane] * reach[lane]);
            let cos = normal.x * nx[lane] + normal.y * ny[lane] + normal.z * nz[lane];
            let front = x * (normal.x + nx[lane]) + y * (normal.y + ny[lane]) + z * (normal.z + nz[lane]);
            let (moved, turned) = (d2 / r2, (1.0 - cos) / (1.0 - LEAST_COSINE));
            let reaches = (d2 < r2) & (cos > LEAST_COSINE) & (front >= -2.0 * IN_FRONT * reach[lane]);
            let far = if moved > turned { moved } else { turned };
            // A cosine may be rounded to more than one.
            let weight = 1.0 - if far > 0.0 { far } else { 0.0 }.sqrt();
            weights[lane] = if reaches { weight } else { 0.0 };
        }
        weights
    }
}

/// The records that reach into one cell, in the order of the index.
#[derive(Clone, Default)]
pub(super) struct List {
    blocks: Vec<Block>,
    records: usize,
}

impl List {
    fn push(&mut self, record: &Record) {
        let lane = self.records % LANES;
        if lane == 0 {
            self.blocks.push(Block::default());
        }
        let Some(block) = self.blocks.last_mut() else { return };
        for axis in 0..3 {
            block.position[axis][lane] = record.position[axis];
            block.normal[axis][lane] = record.normal[axis];
        }
        block.reach[lane] = record.reach;
        block.refuses[lane] = record.refuses;
        let [rotation, translation] = [&record.by_rotation, &record.by_translation].map(|bands| {
            let axis = |axis: usize| Vec4::new(bands[0][axis], bands[1][axis], bands[2][axis], 0.0);
            [axis(0), axis(1), axis(2)]
        });
        block.changes[lane] = Change { radiance: record.radiance.extend(0.0), rotation, translation };
        self.records += 1;
    }

    /// Irradiance over pi at a point of the cell with shading normal `normal`; `None` where no record reaches, or most refuse.
    pub(super) fn look_up(&self, position: Vec3, normal: Vec3) -> Option<Vec3> {
        let (mut sum, mut weights, mut refused) = (Vec4::ZERO, 0.0, 0.0);
        for block in &self.blocks {
            for (lane, weight) in block.weights(position, normal).into_iter().enumerate() {
                if weight <= 0.0 {
                    continue;
                }
                if block.refuses[lane] {
                    refused += weight;
                    continue;
                }
                let at = |vector: &[Lanes; 3]| Vec3::new(vector[0][lane], vector[1][lane], vector[2][lane]);
                let (axis, offset) = (at(&block.normal).cross(normal), position - at(&block.position));
                let Change { radiance, rotation, translation } = &block.changes[lane];
                let change = axis.x * rotation[0]
                    + axis.y * rotation[1]
                    + axis.z * rotation[2]
                    + offset.x * translation[0]
                    + offset.y * translation[1]
                    + offset.z * translation[2];
                // Next to edges gradients are large and hold only for a short way.
                let limit = MOST_CHANGE * *radiance;
                sum += weight * (*radiance + change.clamp(-limit, limit));
                weights += weight;
            }
        }
        (weights > refused).then(|| (sum / weights).truncate())
    }
}

/// Lists of the cells that were asked for since the last batch of paths. What a point is told does not depend on them.
#[derive(Default)]
pub struct Nearby {
    cells: FxHashMap<(i32, IVec3), usize>,
    /// Of which `cells.len()` are in use.
    lists: Vec<List>,
    last: Option<((i32, IVec3), usize)>,
    found: Vec<(i32, u32)>,
}

impl Nearby {
    /// Forgets all cells: for another batch, or another cache.
    pub fn clear(&mut self) {
        self.cells.clear();
        self.last = None;
    }

    /// What the records say of a point that is seen with pixels of the width `pixel`.
    pub(super) fn around(&mut self, index: &Index, records: &[Record], pixel: f32, position: Vec3) -> Option<&List> {
        let [finest, coarsest] = index.levels()?;
        let level = ((PIXELS * pixel).log2() as i32).clamp(finest, coarsest);
        let key = (level, cell(position, level));
        let number = match self.last {
            Some((last, number)) if last == key => number,
            _ => self.list(index, records, key),
        };
        self.last = Some((key, number));
        Some(&self.lists[number])
    }

    /// Number of the list of a cell.
    fn list(&mut self, index: &Index, records: &[Record], key: (i32, IVec3)) -> usize {
        let fresh = self.cells.len();
        let number = *self.cells.entry(key).or_insert(fresh);
        if number == fresh {
            if self.lists.len() == fresh {
                self.lists.push(List::default());
            }
            let list = &mut self.lists[fresh];
            list.blocks.clear();
            list.records = 0;
            let (level, at) = key;
            let width = (level as f32).exp2();
            let low = at.as_vec3() * width;
            index.within(key, &mut self.found);
            for record in self.found.iter().map(|&(_, number)| &records[number as usize]) {
                let closest = record.position.clamp(low, low + width);
                if closest.distance_squared(record.position) < record.reach * record.reach {
                    list.push(record);
                }
            }
        }
        number
    }
}
