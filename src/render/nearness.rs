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
    marked: Vec<bool>,
}

impl Nearness {
    /// Marks every cell that holds a point closer than `reach` to one of `different`.
    pub fn new(bounds: Aabb, different: impl IntoIterator<Item = Aabb>, reach: f32) -> Self {
        let cell = (bounds.size().max_element() / CELLS as f32).max(f32::MIN_POSITIVE);
        let size = ((bounds.size() / cell).as_uvec3() + 1).clamp(UVec3::ONE, UVec3::splat(CELLS + 1));
        let mut grid = Nearness {
            origin: bounds.min,
            inverse_cell: 1.0 / cell,
            size,
            marked: vec![false; (size.x * size.y * size.z) as usize],
        };
        for b in different {
            grid.mark(b);
        }
        // One cell more than the reach covers points anywhere in the cells of both ends.
        let cells = (reach * grid.inverse_cell).ceil() as i64 + 1;
        let cells = cells.clamp(1, i64::from(CELLS) + 1) as usize;
        for axis in 0..3 {
            grid.dilate(axis, cells);
        }
        grid
    }

    /// Whether something within reach of `p` may differ between the scenes. True outside of the grid.
    pub fn differs(&self, p: Vec3) -> bool {
        let c = ((p - self.origin) * self.inverse_cell).floor();
        if c.cmplt(Vec3::ZERO).any() || c.cmpge(self.size.as_vec3()).any() {
            return true;
        }
        self.marked[self.index(c.as_uvec3())]
    }

    /// Share of cells that are marked, 0..=1.
    pub fn share(&self) -> f64 {
        self.marked.iter().filter(|m| **m).count() as f64 / self.marked.len() as f64
    }

    fn index(&self, c: UVec3) -> usize {
        ((c.z * self.size.y + c.y) * self.size.x + c.x) as usize
    }

    fn mark(&mut self, b: Aabb) {
        let limit = self.size.as_ivec3() - 1;
        let low = ((b.min - self.origin) * self.inverse_cell).floor().as_ivec3().clamp(IVec3::ZERO, limit).as_uvec3();
        let high = ((b.max - self.origin) * self.inverse_cell).floor().as_ivec3().clamp(IVec3::ZERO, limit).as_uvec3();
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let row = self.index(UVec3::new(0, y, z));
                self.marked[row + low.x as usize..=row + high.x as usize].fill(true);
            }
        }
    }

    /// Grows the marks by `cells` both ways along one axis; three of these make a dilation by a box.
    fn dilate(&mut self, axis: usize, cells: usize) {
        let size = self.size.to_array().map(|s| s as usize);
        let stride = [1, size[0], size[0] * size[1]];
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut line = vec![false; size[axis]];
        for i in 0..size[a] {
            for j in 0..size[b] {
                let start = i * stride[a] + j * stride[b];
                line.fill(false);
                for k in 0..size[axis] {
                    if self.marked[start + k * stride[axis]] {
                        line[k.saturating_sub(cells)..(k + cells + 1).min(size[axis])].fill(true);
                    }
                }
                for (k, m) in line.iter().enumerate() {
                    self.marked[start + k * stride[axis]] = *m;
                }
            }
        }
    }
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
