//! What all things are built with: the scene so far, the level of detail and the seed.

use glam::{Vec3, vec3};

use crate::paint::Paint;
use crate::primitives;
use crate::rng::Rng;
use crate::scene::{Camera, Pose, Scene};
use crate::shape::Shape;
use crate::things;

/// Inner size of the room, metres.
pub const ROOM: Vec3 = vec3(6.0, 2.8, 4.2);

/// What rests on something floats this high above it, so that no two faces coincide.
pub const GAP: f32 = 0.0003;

/// How finely things are made and how many small ones there are; 1 and 1 is the paper's environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Scales the segments of everything round.
    pub tessellation: f32,
    /// Scales the number of small things.
    pub clutter: f32,
}

impl Detail {
    /// Both on one scale for a series of environments from bare to overfull.
    pub fn level(level: f32) -> Self {
        Detail { tessellation: level.powf(0.4), clutter: level }
    }
}

/// An office in the making.
pub struct Office {
    /// What there is so far.
    pub scene: Scene,
    detail: Detail,
    seed: u32,
}

impl Office {
    /// The whole office.
    pub fn build(detail: Detail, seed: u32) -> Scene {
        let mut office = Office { scene: Scene::default(), detail, seed };
        things::furnish(&mut office);
        office.scene.cameras = cameras();
        office.scene.fly(0, 1);
        office.scene
    }

    /// Random numbers for one purpose.
    pub fn rng(&self, purpose: &str) -> Rng {
        Rng::new(self.seed, purpose)
    }

    /// Segments around something that has `n` at the usual detail.
    pub fn around(&self, n: usize) -> usize {
        match self.steps(n).max(3) {
            // Twelve sides turn by exactly the crease angle, and rounding would decide what is a surface.
            12 => 13,
            segments => segments,
        }
    }

    /// Pieces along something that has `n` at the usual detail.
    pub fn steps(&self, n: usize) -> usize {
        ((n as f32 * self.detail.tessellation).round() as usize).max(1)
    }

    /// How many of something of which there are usually `n`.
    pub fn count(&self, n: usize) -> usize {
        ((n as f64 * f64::from(self.detail.clutter)).round() as usize).max(1)
    }

    /// Whether a thing that matters from this share of the usual clutter on is there at all.
    pub fn shows(&self, clutter: f32) -> bool {
        self.detail.clutter >= clutter
    }

    /// A box with chamfered edges ([`primitives::bevelled`]), plain where little detail is wanted.
    pub fn bevelled(&self, width: f32, height: f32, depth: f32, bevel: f32, bottom: bool) -> Shape {
        if self.shows(0.02) {
            primitives::bevelled(width, height, depth, bevel, bottom)
        } else {
            let faces = if bottom { primitives::ALL_FACES } else { primitives::ALL_FACES & !primitives::BOTTOM };
            primitives::block(width, height, depth, faces)
        }
    }

    /// A board, panel or block with rounded edges ([`primitives::cushion`]), which make it one surface; plain where little
    /// detail is wanted.
    pub fn slab(&self, width: f32, height: f32, depth: f32, radius: f32) -> Shape {
        if self.shows(0.3) {
            primitives::cushion(width, height, depth, radius, self.steps(4).max(4))
        } else {
            primitives::block(width, height, depth, primitives::ALL_FACES)
        }
    }

    /// A frame with rounded edges ([`primitives::moulding`]), which make it one surface; with sharp ones where little detail
    /// is wanted.
    pub fn moulding(&self, width: f32, height: f32, bar: f32, thickness: f32) -> Shape {
        if self.shows(0.3) {
            primitives::moulding(width, height, bar, thickness, 0.3 * thickness.min(bar), self.steps(4).max(4))
        } else {
            primitives::frame(width, height, bar, thickness)
        }
    }

    /// A door's casing ([`primitives::casing`]) with rounded edges.
    pub fn casing(&self, width: f32, height: f32, bar: f32, thickness: f32) -> Shape {
        primitives::casing(width, height, bar, thickness, 0.3 * thickness.min(bar), self.steps(4).max(4))
    }

    /// Makes a mesh.
    pub fn mesh(&mut self, name: &str, parts: impl IntoIterator<Item = (Paint, Shape)>) -> usize {
        self.scene.mesh(name, parts)
    }

    /// Makes a mesh and places it once.
    pub fn thing(
        &mut self,
        parent: Option<usize>,
        name: &str,
        pose: Pose,
        parts: impl IntoIterator<Item = (Paint, Shape)>,
    ) -> usize {
        let mesh = self.scene.mesh(name, parts);
        self.scene.place(parent, name, mesh, pose)
    }
}

fn cameras() -> Vec<Camera> {
    let camera = |name, eye, target, y_fov| Camera { name, eye, target, y_fov, aspect: 1.5 };
    vec![
        camera("overview", vec3(5.74, 1.64, 4.02), vec3(2.35, 0.98, 1.05), 49.0),
        camera("desk", vec3(1.66, 1.36, 2.42), vec3(0.40, 0.90, 1.93), 38.0),
        camera("pencils", vec3(0.98, 1.04, 2.74), vec3(0.56, 0.765, 2.46), 30.0),
        camera("plant", vec3(1.62, 1.36, 1.75), vec3(0.60, 1.05, 0.25), 32.0),
    ]
}
