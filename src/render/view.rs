//! Where the trials of an image begin.

use glam::{Vec2, Vec3};

use super::path::Path;
use crate::sampling::{SobolStream, hash_all};
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

    /// Width of a pixel at the start of its rays and its growth over distance, scene units.
    pub fn cone(&self) -> [f32; 2] {
        self.lens.cone(self.size[1])
    }

    /// Trial `number` of a pixel (column, row); `trial` is the path's place in its batch.
    pub fn path(&self, pixel: [u32; 2], number: u32, trial: u32) -> Path {
        self.path_in(&SobolStream::new(self.stream(pixel, number & 1)), pixel, number >> 1, trial)
    }

    /// Appends `count` trials of a pixel from number `first` on, which take the places from `place` on in their batch.
    pub fn append(&self, pixel: [u32; 2], first: u32, count: u32, place: u32, paths: &mut Vec<Path>) {
        for half in [0, 1] {
            let stream = SobolStream::new(self.stream(pixel, half));
            let skipped = (first ^ half) & 1;
            paths.extend((0..(count + 1 - skipped) / 2).map(|k| {
                let t = skipped + 2 * k;
                self.path_in(&stream, pixel, (first + t) >> 1, place + t)
            }));
        }
    }

    /// Even and odd trials come from two independent scramblings, so that their difference measures the error.
    fn stream(&self, [x, y]: [u32; 2], half: u32) -> u32 {
        hash_all(&[y * self.size[0] + x, half, self.seed])
    }

    #[inline(always)]
    fn path_in(&self, stream: &SobolStream, [x, y]: [u32; 2], index: u32, trial: u32) -> Path {
        let (numbers, u) = stream.point(index);
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let film = (Vec2::new(x as f32, y as f32) + Vec2::new(u[0], u[1])) / size;
        Path::view(self.lens.ray(film), trial, numbers)
    }
}
