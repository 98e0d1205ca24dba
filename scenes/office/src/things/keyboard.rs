//! A full keyboard, every key an object of its own.

use std::collections::BTreeMap;

use crate::office::{GAP, Office};
use crate::paint::{KEY, KEY_GREY, PUTTY};
use crate::primitives::{bevelled, loft, rounded_rectangle};
use crate::scene::Pose;
use crate::shape::Shape;

/// Distance between key centres, metres.
const PITCH: f32 = 0.019;

/// Rows from the front: widths in key pitches, negative for a gap; letters light, others grey.
const ROWS: [&[f32]; 6] = [
    &[1.5, -1.0, 1.5, 7.0, 1.5, -1.0, 1.5, -0.25, 1.0, 1.0, 1.0, -0.25, 2.0, 1.0],
    &[2.25, 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 2.75, -1.25, 1.0, -1.25, 1., 1., 1., 1.],
    &[1.75, 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 2.25, -3.5, 1., 1., 1., 1.],
    &[1.5, 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1.5, -0.25, 1., 1., 1., -0.25, 1., 1., 1., 1.],
    &[1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 1., 2., -0.25, 1., 1., 1., -0.25, 1., 1., 1., 1.],
    &[1., -1., 1., 1., 1., 1., -0.5, 1., 1., 1., 1., -0.5, 1., 1., 1., 1., -0.25, 1., 1., 1.],
];

/// A key cap `units` wide: tapering sides and a bevelled top.
fn cap(units: f32, steps: usize) -> Shape {
    let (x, z) = (0.5 * (units * PITCH - 0.001), 0.5 * (PITCH - 0.001));
    let ring = |inset: f32, round: f32, y: f32| rounded_rectangle(x - inset, z - inset, round, steps, y);
    loft(&[ring(0.0, 0.0, 0.0), ring(0.0016, 0.0, 0.0066), ring(0.0028, 0.0, 0.0078)], false, true)
}

/// Adds the keyboard, its front towards +z.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let keyboard = office.scene.group(parent, "keyboard", pose.turned(glam::Quat::from_rotation_x(0.05)));
    let lift = 0.0045;
    let body = bevelled(22.5 * PITCH + 0.03, 0.018, 7.0 * PITCH + 0.016, 0.003, true).moved(0.0, lift, 0.0);
    office.thing(Some(keyboard), "keyboard body", Pose::at(0.0, 0.0, 0.0), [(PUTTY, body)]);
    let steps = office.steps(1);
    let mut caps: BTreeMap<(u32, bool), usize> = BTreeMap::new();
    for (row, widths) in ROWS.iter().enumerate() {
        let mut x = -11.25 * PITCH;
        // The function keys stand apart.
        let z = (2.75 - row as f32 - if row == 5 { 0.5 } else { 0.0 }) * PITCH;
        for &units in widths.iter() {
            if units > 0.0 {
                let plain = units == 1.0 && row > 0 && row < 5 && x < 3.0 * PITCH || units == 7.0;
                let mesh = *caps.entry(((4.0 * units) as u32, plain)).or_insert_with(|| {
                    office.scene.mesh("key", [(if plain { KEY } else { KEY_GREY }, cap(units, steps))])
                });
                let shown = office.shows(0.03) || plain && units > 1.0;
                if shown {
                    office.scene.place(
                        Some(keyboard),
                        "key",
                        mesh,
                        Pose::at(x + 0.5 * units * PITCH, lift + 0.018 + GAP, z),
                    );
                }
            }
            x += units.abs() * PITCH;
        }
    }
}
