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

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::sampling::{hash_all, uniform_sphere, unit};

    /// Half a unit in the last place.
    const U: f32 = f32::EPSILON / 2.0;

    fn random(key: [u32; 3]) -> f32 {
        unit(hash_all(&key))
    }

    fn vector(seed: u32, what: u32) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|axis| 2.0 * random([seed, what, axis]) - 1.0))
    }

    fn record(seed: u32) -> Record {
        Record {
            position: vector(seed, 0),
            normal: tilted(seed, 1),
            distance: 1.0,
            reach: 0.2 + 3.0 * random([seed, 2, 0]),
            least_reach: 0.1,
            refuses: random([seed, 2, 1]) < 0.2,
            radiance: vector(seed, 3).abs(),
            brightest: 1.0,
            rays: 1,
            variance: None,
            by_rotation: [4, 5, 6].map(|what| vector(seed, what)),
            by_translation: [7, 8, 9].map(|what| vector(seed, what)),
        }
    }

    /// A direction within some 17 degrees of the third axis, so that most pairs are close enough to be interpolated.
    fn tilted(seed: u32, what: u32) -> Vec3 {
        let around = uniform_sphere(Vec2::new(random([seed, what, 0]), random([seed, what, 1])));
        (Vec3::Z + 0.3 * random([seed, what, 2]) * around).normalize()
    }

    /// Bound of the difference of two ways to round a record's weight; infinite where rounding decides whether it counts at all.
    fn weight_off(record: &Record, position: Vec3, normal: Vec3) -> f32 {
        let offset = position - record.position;
        let both = normal + record.normal;
        let front = offset.dot(both) + 2.0 * IN_FRONT * record.reach;
        // Five roundings in each product of the sum, on both sides
        if front.abs() <= 10.0 * U * (offset.abs().dot(both.abs()) + record.reach) {
            return f32::INFINITY;
        }
        let moved = offset.length_squared() / (record.reach * record.reach);
        let turned = (1.0 - normal.dot(record.normal)) / (1.0 - LEAST_COSINE);
        // Products of unit vectors: three roundings each, on both sides, and the one of the difference
        let off = (12.0 * U * moved).max((7.0 * U) / (1.0 - LEAST_COSINE));
        // |sqrt a - sqrt b| = |a - b| / (sqrt a + sqrt b), at most sqrt |a - b|
        off / moved.max(turned).max(off).sqrt() + 4.0 * U
    }

    /// Bound of the difference of two ways to round what a record says.
    fn value_off(record: &Record, position: Vec3, normal: Vec3) -> Vec3 {
        let (axis, offset) = (record.normal.cross(normal).abs(), (position - record.position).abs());
        // The cross product's own roundings come from factors of at most one.
        let change = |band: usize| {
            axis.dot(record.by_rotation[band].abs())
                + offset.dot(record.by_translation[band].abs())
                + record.by_rotation[band].abs().element_sum()
        };
        16.0 * U * (Vec3::new(change(0), change(1), change(2)) + record.radiance)
    }

    /// What is worked out eight abreast is what each record says by itself, to rounding.
    #[test]
    fn lists_say_what_their_records_say() {
        let (mut counted, mut unclear, mut silent) = (0, 0, 0);
        for seed in 0..20_000 {
            let records: Vec<Record> = (0..1 + seed % 19).map(|k| record(hash_all(&[seed, k]))).collect();
            let mut list = List::default();
            records.iter().for_each(|record| list.push(record));
            let (position, normal) = (vector(seed, 10), tilted(seed, 11));

            let lanes: Vec<f32> = list.blocks.iter().flat_map(|block| block.weights(position, normal)).collect();
            assert!(lanes[records.len()..].iter().all(|weight| *weight == 0.0));
            let weights: Vec<f32> = records.iter().map(|record| record.weight(position, normal)).collect();
            let off: Vec<f32> = records.iter().map(|record| weight_off(record, position, normal)).collect();
            if off.contains(&f32::INFINITY) {
                unclear += 1;
                continue;
            }
            for ((lane, weight), off) in lanes.iter().zip(&weights).zip(&off) {
                assert!((lane - weight).abs() <= *off, "{seed}: {lane} {weight} {off}");
            }
            if lanes.iter().chain(&weights).all(|weight| *weight == 0.0) {
                assert!(list.look_up(position, normal).is_none());
                silent += 1;
                continue;
            }

            let sum_of = |which: bool| -> f32 {
                records.iter().zip(&weights).filter(|(r, _)| r.refuses == which).map(|(_, weight)| weight).sum()
            };
            let (speak, refuse) = (sum_of(false), sum_of(true));
            let all_off: f32 = off.iter().sum::<f32>() + 40.0 * U * (speak + refuse);
            if (speak - refuse).abs() <= all_off {
                unclear += 1;
                continue;
            }
            let found = list.look_up(position, normal);
            assert_eq!(found.is_some(), speak > refuse, "{seed}");
            let Some(found) = found else {
                silent += 1;
                continue;
            };
            let speaking = || records.iter().zip(&weights).zip(&off).filter(|((record, _), _)| !record.refuses);
            let sum: Vec3 = speaking().map(|((record, weight), _)| *weight * record.at(position, normal)).sum();
            let expected = sum / speak;
            let off: Vec3 = speaking()
                .map(|((record, weight), off)| {
                    let value = record.at(position, normal);
                    off * (value - expected).abs()
                        + (weight + off) * (value_off(record, position, normal) + 40.0 * U * value)
                })
                .sum();
            // The divisor is off as well.
            let off = off / (speak - all_off);
            assert!((found - expected).abs().cmple(off).all(), "{seed}: {found} {expected} {off}");
            counted += 1;
        }
        assert!(counted > 5000 && silent > 500 && unclear < 200, "{counted} {silent} {unclear}");
    }
}
