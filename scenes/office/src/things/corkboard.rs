//! A cork board over the desk with notes, and thumb tacks that hold them or wait.

use std::f32::consts::FRAC_PI_2;

use glam::vec3;

use super::stationery;
use crate::office::Office;
use crate::paint::{BEECH, CORK, PAPER, PAPER_BLUE, PAPER_PINK, PAPER_YELLOW};
use crate::primitives::{cuboid, sheet};
use crate::scene::Pose;

/// Outer size, metres.
const SIZE: (f32, f32) = (0.85, 0.58);

/// Adds the board on the left wall; its own +z points into the room.
pub fn add(office: &mut Office) {
    let pose = Pose::at(0.0, 1.72, 2.05).yaw(FRAC_PI_2);
    let board = Some(office.scene.group(None, "cork board", pose));
    let (w, h) = SIZE;
    let rim = office.moulding(w, h, 0.022, 0.018);
    let cork = cuboid(
        vec3(-w / 2.0 + 0.022, -h / 2.0 + 0.022, 0.0),
        vec3(w / 2.0 - 0.022, h / 2.0 - 0.022, 0.010),
        crate::primitives::Z_HIGH,
    );
    office.thing(board, "board", Pose::at(0.0, 0.0, 0.0), [(BEECH, rim), (CORK, cork)]);
    let surface = 0.010;
    let tacks = stationery::tacks(office);
    let mut rng = office.rng("cork board");
    // A tack's own axis points from head to pin: turned so that the pin goes into the board.
    let stuck = |x: f32, y: f32, tilt: f32| Pose::at(x, y, surface + 0.0058).pitch(-FRAC_PI_2 + tilt);
    let steps = office.steps(3);
    let (columns, rows) = (5, 3);
    let notes = office.count(15).min(columns * rows);
    for i in 0..notes {
        let cell = (i * 7) % (columns * rows);
        let (cw, ch) = ((w - 0.07) / columns as f32, (h - 0.07) / rows as f32);
        let x = -w / 2.0 + 0.035 + cw * ((cell % columns) as f32 + 0.5);
        let y = -h / 2.0 + 0.035 + ch * ((cell / columns) as f32 + 0.5);
        let (nw, nh) = (cw * rng.range(0.5, 0.78), ch * rng.range(0.5, 0.8));
        let paint = [PAPER, PAPER_YELLOW, PAPER, PAPER_BLUE, PAPER_PINK, PAPER][rng.below(6)];
        // Held at the top, the note's lower edge stands off a little.
        let lift = rng.range(0.004, 0.02);
        let note = sheet(steps, steps, |uv| {
            let t = 1.0 - uv.y;
            vec3((uv.x - 0.5) * nw, (uv.y - 1.0) * nh, 0.0006 + lift * t * t)
        });
        let top = y + 0.5 * nh;
        let at = Pose::at(x + rng.around(0.006), top, surface).roll(rng.around(0.05));
        office.thing(board, "note", at, [(paint, note)]);
        office.scene.place(board, "thumb tack", tacks[rng.below(5)], stuck(x, top - 0.012, rng.around(0.15)));
    }
    // Spare tacks in the lower strip between notes and frame, on a grid that gets finer with their number.
    let spare = office.count(24).min(400);
    let per_row = spare.div_ceil(if spare > 90 { 4 } else { 1 });
    for i in 0..spare {
        let (column, row) = (i % per_row, i / per_row);
        let x = (w - 0.10) * ((column as f32 + 0.5) / per_row as f32 - 0.5);
        let y = -h / 2.0 + 0.030 + 0.011 * row as f32;
        office.scene.place(board, "thumb tack", tacks[rng.below(5)], stuck(x, y, rng.around(0.1)));
    }
}
