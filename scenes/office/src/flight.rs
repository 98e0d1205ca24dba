//! A camera that flies through the office.

use glam::{Mat3, Quat, Vec3};

use crate::scene::Camera;

/// Frames of the flight, which takes a second.
pub const FRAMES: usize = 24;

/// Where a camera is at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Seconds.
    pub time: f32,
    /// Metres.
    pub eye: Vec3,
    /// Unit quaternion; a camera looks along its own -z.
    pub rotation: Quat,
}

/// The camera at the start of its flight from one view to another, and a key for each frame.
#[derive(Clone, Debug)]
pub struct Flight {
    /// The camera, with the place and direction of the first key.
    pub camera: Camera,
    /// All keys.
    pub keys: Vec<Key>,
}

impl Flight {
    /// A straight flight from `start` to `end` that sets out and arrives gently.
    pub fn between(start: &Camera, end: &Camera) -> Flight {
        let key = |frame: usize| {
            let t = frame as f32 / (FRAMES - 1) as f32;
            let way = t * t * (3.0 - 2.0 * t);
            let eye = start.eye.lerp(end.eye, way);
            let target = start.target.lerp(end.target, way);
            Key { time: frame as f32 / FRAMES as f32, eye, rotation: looking(eye, target) }
        };
        let mut keys: Vec<Key> = (0..FRAMES).map(key).collect();
        for i in 1..keys.len() {
            // Of the two quaternions of a rotation the one next to its predecessor.
            if keys[i].rotation.dot(keys[i - 1].rotation) < 0.0 {
                keys[i].rotation = -keys[i].rotation;
            }
        }
        Flight { camera: Camera { name: "flight", ..start.clone() }, keys }
    }
}

/// The rotation of a camera at `eye` that looks at `target`, upright.
pub fn looking(eye: Vec3, target: Vec3) -> Quat {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)).normalize()
}
