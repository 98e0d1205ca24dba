//! A framed print on the left wall.

use std::f32::consts::FRAC_PI_2;

use glam::vec3;

use crate::office::Office;
use crate::paint::{BLACK, MOUNT, PICTURE_FIELD, PICTURE_HILL, PICTURE_SKY};
use crate::primitives::{Z_HIGH, cuboid};
use crate::scene::Pose;
use crate::shape::Shape;

/// Adds the picture.
pub fn add(office: &mut Office) {
    if !office.shows(0.05) {
        return;
    }
    let (z, y, w, h) = (0.62, 1.80, 0.32, 0.40);
    let group = Some(office.scene.group(None, "picture", Pose::at(0.0, y, z).yaw(FRAC_PI_2)));
    let bar = 0.022;
    let inner = (w / 2.0 - bar, h / 2.0 - bar);
    let mount = cuboid(vec3(-inner.0, -inner.1, 0.0), vec3(inner.0, inner.1, 0.008), Z_HIGH);
    let (x, low, high) = (inner.0 - 0.045, -inner.1 + 0.045, inner.1 - 0.045);
    // Three bands that share their borders: field, hills with a jagged skyline, sky.
    let count = 9;
    let point = |k: usize, base: f32, wave: f32| {
        let s = k as f32 / count as f32;
        vec3(-x + 2.0 * x * s, base + wave * (5.3 * s + 2.0).sin() * (1.0 + 0.5 * (13.0 * s).cos()), 0.0085)
    };
    let border = |k: usize, band: usize| match band {
        0 => point(k, low, 0.0),
        1 => point(k, 0.65 * low + 0.35 * high, 0.012),
        2 => point(k, 0.38 * low + 0.62 * high, 0.025),
        _ => point(k, high, 0.0),
    };
    let band = |band: usize| {
        let mut shape = Shape::default();
        shape.net(2, count + 1, false, |row, k| border(k, band + row));
        shape
    };
    let print = [(PICTURE_FIELD, band(0)), (PICTURE_HILL, band(1)), (PICTURE_SKY, band(2))];
    let parts = [(BLACK, office.moulding(w, h, bar, 0.02)), (MOUNT, mount)];
    office.thing(group, "framed print", Pose::at(0.0, 0.0, 0.0), parts.into_iter().chain(print));
}
