//! Where the detailed and the simplified scene differ.
//!
//! In most of a room no complex surface and no equivalent box lies within reach of a gather ray's near part. There one ray in
//! the simplified scene answers for both. A coarse grid knows these places.

use glam::{IVec3, UVec3, Vec3};

use crate::scene::Aabb;

/// Cells along the longest axis.
const CELLS: u32 = 96;

/// A grid over the scene that marks cells within reach of anything that only one of the two scenes holds.
#[derive(Clone, Debug)]
pub struct Nearness {
    origin: Vec3,
    inverse_cell: f32,
    size: UVec3,
    /// One bit a cell, one word a row along x; rows by y, then z.
    rows: Vec<u128>,
}

// A row fits into a word.
const _: () = assert!(CELLS < u128::BITS);

impl Nearness {
    /// Marks every cell that holds a point closer than `reach` to one of `different`.
    pub fn new(bounds: Aabb, different: impl IntoIterator<Item = Aabb>, reach: f32) -> Self {
        let cell = (bounds.size().max_element() / CELLS as f32).max(f32::MIN_POSITIVE);
        let size = ((bounds.size() / cell).as_uvec3() + 1).clamp(UVec3::ONE, UVec3::splat(CELLS + 1));
        let mut grid =
            Nearness { origin: bounds.min, inverse_cell: 1.0 / cell, size, rows: vec![0; (size.y * size.z) as usize] };
        for b in different {
            grid.mark(b);
        }
        // One cell more than the reach covers points anywhere in the cells of both ends.
        let cells = (reach * grid.inverse_cell).ceil() as i64 + 1;
        grid.dilate(cells.clamp(1, i64::from(CELLS) + 1) as usize);
        grid
    }

    /// Whether something within reach of `p` may differ between the scenes. True outside of the grid.
    pub fn differs(&self, p: Vec3) -> bool {
        let c = ((p - self.origin) * self.inverse_cell).floor();
        if c.cmplt(Vec3::ZERO).any() || c.cmpge(self.size.as_vec3()).any() {
            return true;
        }
        let c = c.as_uvec3();
        self.rows[self.row(c.y, c.z)] >> c.x & 1 == 1
    }

    /// Share of cells that are marked, 0..=1.
    pub fn share(&self) -> f64 {
        let marked: u32 = self.rows.iter().map(|row| row.count_ones()).sum();
        f64::from(marked) / f64::from(self.size.element_product())
    }

    fn row(&self, y: u32, z: u32) -> usize {
        (z * self.size.y + y) as usize
    }

    fn mark(&mut self, b: Aabb) {
        let limit = self.size.as_ivec3() - 1;
        let low = ((b.min - self.origin) * self.inverse_cell).floor().as_ivec3().clamp(IVec3::ZERO, limit).as_uvec3();
        let high = ((b.max - self.origin) * self.inverse_cell).floor().as_ivec3().clamp(IVec3::ZERO, limit).as_uvec3();
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let row = self.row(y, z);
                self.rows[row] |= first_bits(high.x + 1) & !first_bits(low.x);
            }
        }
    }

    /// Grows the marks by `cells` both ways along each axis: a dilation by a box.
    fn dilate(&mut self, cells: usize) {
        let within = first_bits(self.size.x);
        for row in self.rows.iter_mut().filter(|row| **row != 0) {
            for _ in 0..cells {
                *row |= (*row << 1 | *row >> 1) & within;
            }
        }
        let [_, ny, nz] = self.size.to_array().map(|n| n as usize);
        let along_y = |i: usize| (i % ny, ny, 1);
        self.spread(cells, along_y);
        let along_z = |i: usize| (i / ny, nz, ny);
        self.spread(cells, along_z);
    }

    /// Joins each row with those up to `cells` before and behind it. `line` gives a row's place in its line, the line's length and the
    /// distance from one row of it to the next.
    fn spread(&mut self, cells: usize, line: impl Fn(usize) -> (usize, usize, usize)) {
        let before = self.rows.clone();
        for (i, row) in self.rows.iter_mut().enumerate() {
            let (at, length, stride) = line(i);
            let (first, last) = (at.saturating_sub(cells), (at + cells).min(length - 1));
            let start = i - at * stride;
            *row = (first..=last).fold(0, |sum, k| sum | before[start + k * stride]);
        }
    }
}

/// A word with the `n` lowest bits set, `n` up to 128.
fn first_bits(n: u32) -> u128 {
    1u128.checked_shl(n).map_or(u128::MAX, |bit| bit - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, unit};

    #[test]
    fn marks_everything_in_reach_and_little_else() {
        let bounds = Aabb { min: Vec3::splat(-1.0), max: Vec3::new(3.0, 1.0, 1.0) };
        let thing = Aabb { min: Vec3::new(0.1, 0.2, -0.3), max: Vec3::new(0.3, 0.3, 0.0) };
        let reach = 0.25;
        let grid = Nearness::new(bounds, [thing], reach);
        let mut far_marked = 0;
        for i in 0..20_000 {
            let u = Vec3::from_array([0, 1, 2].map(|d| unit(hash_all(&[i, d]))));
            let p = bounds.min + u * bounds.size();
            let distance = (p - p.clamp(thing.min, thing.max)).length();
            if distance <= reach {
                assert!(grid.differs(p), "{p} at {distance}");
            } else if distance > 3.0_f32.sqrt() * (reach + 3.0 * 4.0 / CELLS as f32) && grid.differs(p) {
                far_marked += 1;
            }
        }
        assert_eq!(far_marked, 0);
        assert!(grid.differs(Vec3::splat(-2.0)), "outside of the grid nothing is known");
    }

    #[test]
    fn flat_and_empty_scenes_work() {
        let flat = Aabb { min: Vec3::ZERO, max: Vec3::new(1.0, 0.0, 1.0) };
        assert!(!Nearness::new(flat, [], 0.1).differs(Vec3::new(0.5, 0.0, 0.5)));
        let point = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        assert_eq!(Nearness::new(point, [point], 1.0).share(), 1.0);
    }
}
