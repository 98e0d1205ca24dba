//! Two bookcases against the back wall.

use glam::vec3;

use super::books;
use crate::office::{GAP, Office};
use crate::paint::BEECH;
use crate::primitives::{ALL_FACES, BOTTOM, X_HIGH, X_LOW, Z_LOW, block, cuboid};
use crate::scene::Pose;

/// Inner width and depth of a bookcase, metres.
const INNER: (f32, f32) = (0.96, 0.285);
/// Thickness of boards.
const BOARD: f32 = 0.02;
/// Height of each compartment's floor above the ground, and of the top.
const FLOORS: [f32; 7] = [0.08, 0.46, 0.82, 1.16, 1.48, 1.80, 2.10];

/// Adds the bookcases with what stands in them.
pub fn add(office: &mut Office) {
    for (case, x) in [3.70, 4.71].into_iter().enumerate() {
        let group = Some(office.scene.group(None, "bookcase", Pose::at(x, 0.0, 0.16)));
        carcass(office, group);
        for (level, pair) in FLOORS.windows(2).enumerate() {
            let pose = Pose::at(0.0, pair[0] + BOARD + GAP, 0.0);
            let shelf = Some(office.scene.group(group, "shelf", pose));
            let height = pair[1] - pair[0] - BOARD - GAP;
            books::fill(office, shelf, &format!("books {case} {level}"), INNER.0, height, INNER.1);
        }
    }
}

fn carcass(office: &mut Office, parent: Option<usize>) {
    let (w, d) = INNER;
    let height = FLOORS[6] + BOARD;
    let side = |x: f32| block(BOARD, height, d + 0.01, ALL_FACES & !BOTTOM).moved(x, 0.0, 0.0);
    let x = 0.5 * (w + BOARD);
    let back = cuboid(
        vec3(-0.5 * w, 0.08, -0.5 * d - 0.004),
        vec3(0.5 * w, height, -0.5 * d),
        ALL_FACES & !X_LOW & !X_HIGH & !Z_LOW,
    );
    let plinth = cuboid(
        vec3(-0.5 * w, 0.0, 0.5 * d - 0.04),
        vec3(0.5 * w, 0.08, 0.5 * d - 0.025),
        ALL_FACES & !X_LOW & !X_HIGH & !BOTTOM,
    );
    office.thing(
        parent,
        "bookcase sides",
        Pose::at(0.0, 0.0, 0.0),
        [(BEECH, side(-x)), (BEECH, side(x)), (BEECH, back), (BEECH, plinth)],
    );
    let board =
        cuboid(vec3(-0.5 * w, 0.0, -0.5 * d), vec3(0.5 * w, BOARD, 0.5 * d), ALL_FACES & !X_LOW & !X_HIGH & !Z_LOW);
    let board = office.mesh("shelf board", [(BEECH, board)]);
    for floor in FLOORS {
        office.scene.place(parent, "shelf board", board, Pose::at(0.0, floor, 0.0));
    }
}
