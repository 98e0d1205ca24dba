//! A desk calculator.

use glam::vec3;

use crate::office::{GAP, Office};
use crate::paint::{DARK_STEEL, KEY, KEY_GREY, STEM, TACKS};
use crate::primitives::{ALL_FACES, bevelled, cuboid};
use crate::scene::Pose;

/// Adds a calculator lying down, its display away from +z.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let group = Some(office.scene.group(parent, "calculator", pose));
    let body = bevelled(0.13, 0.022, 0.18, 0.003, true);
    let display = cuboid(vec3(-0.052, 0.022, -0.078), vec3(0.052, 0.0225, -0.05), ALL_FACES);
    office.thing(group, "calculator body", Pose::at(0.0, 0.0, 0.0), [(DARK_STEEL, body), (STEM, display)]);
    let key = |paint| [(paint, bevelled(0.016, 0.005, 0.012, 0.0012, false))];
    let keys = [
        office.mesh("calculator key", key(KEY)),
        office.mesh("calculator key", key(KEY_GREY)),
        office.mesh("calculator key", key(TACKS[0])),
    ];
    for row in 0..6 {
        for column in 0..5 {
            let mesh = keys[if row == 0 && column == 0 { 2 } else { usize::from(row < 2 || column == 4) }];
            let at = Pose::at(-0.046 + 0.023 * column as f32, 0.022 + GAP, -0.030 + 0.0205 * row as f32);
            office.scene.place(group, "calculator key", mesh, at);
        }
    }
}
