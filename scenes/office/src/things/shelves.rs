//! A bookcase against the back wall.

use super::books;
use crate::office::{GAP, Office};
use crate::paint::BEECH;
use crate::scene::Pose;

/// Inner width and depth of the bookcase, metres.
const INNER: (f32, f32) = (0.86, 0.285);
/// Thickness of boards.
const BOARD: f32 = 0.02;
/// How far edges are rounded.
const ROUND: f32 = 0.003;
/// Height of each compartment's floor above the ground, and of the top.
const FLOORS: [f32; 6] = [0.08, 0.46, 0.82, 1.16, 1.48, 1.80];

/// Adds the bookcase with what stands in it.
pub fn add(office: &mut Office) {
    let group = Some(office.scene.group(None, "bookcase", Pose::at(3.72, 0.0, 0.16)));
    carcass(office, group);
    for (level, pair) in FLOORS.windows(2).enumerate() {
        // A bare office has books on its first shelves only.
        if !office.shows(0.003 * level as f32) {
            continue;
        }
        let pose = Pose::at(0.0, pair[0] + BOARD + GAP, 0.0);
        let shelf = Some(office.scene.group(group, "shelf", pose));
        let height = pair[1] - pair[0] - BOARD - GAP;
        books::fill(office, shelf, &format!("books {level}"), INNER.0, height, INNER.1);
    }
}

fn carcass(office: &mut Office, parent: Option<usize>) {
    let (w, d) = INNER;
    let height = FLOORS[5] + BOARD;
    let side = |x: f32| office.slab(BOARD, height, d + 0.01, ROUND).moved(x, 0.0, 0.0);
    let x = 0.5 * (w + BOARD);
    let back = office.slab(w - 2.0 * GAP, height - 0.08, 0.006, 0.001).moved(0.0, 0.08, -0.5 * d - 0.0035);
    let plinth = office.slab(w - 2.0 * GAP, 0.08 - GAP, 0.015, ROUND).moved(0.0, 0.0, 0.5 * d - 0.03);
    let parts = [side(-x), side(x), back, plinth].map(|shape| (BEECH, shape));
    office.thing(parent, "bookcase sides", Pose::at(0.0, 0.0, 0.0), parts);
    let board = office.mesh("shelf board", [(BEECH, office.slab(w - 2.0 * GAP, BOARD, d, ROUND))]);
    for floor in FLOORS {
        office.scene.place(parent, "shelf board", board, Pose::at(0.0, floor, 0.0));
    }
}
