//! Where the trials of an image begin.

use glam::{Vec2, Vec3};

use super::path::Path;
use crate::sampling::{hash_all, sobol};
use crate::scene::{Camera, Lens};

/// Makes the first ray of every trial of an image.
#[derive(Clone, Copy, Debug)]
pub struct ViewRays {
    lens: Lens,
    size: [u32; 2],
    seed: u32,
}

impl ViewRays {
    /// For an image of `size` pixels, width first.
    pub fn new(camera: &Camera, size: [u32; 2], seed: u32) -> Self {
        ViewRays { lens: camera.lens(size[0] as f32 / size[1] as f32), size, seed }
    }

    /// Width of a pixel at `position`, scene units.
    pub fn footprint(&self, position: Vec3) -> f32 {
        self.lens.footprint(position, self.size[1])
    }

    /// Trial `number` of a pixel (column, row); `trial` is the path's place in its batch.
    ///
    /// Even and odd trials come from two independent scramblings, so that their difference measures the error.
    pub fn path(&self, [x, y]: [u32; 2], number: u32, trial: u32) -> Path {
        let stream = hash_all(&[y * self.size[0] + x, number & 1, self.seed]);
        let index = number >> 1;
        let u = sobol(index, 0, stream);
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let film = (Vec2::new(x as f32, y as f32) + Vec2::new(u[0], u[1])) / size;
        Path::view(self.lens.ray(film), trial, index, stream)
    }
}
