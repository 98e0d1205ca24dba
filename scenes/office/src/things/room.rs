//! The closed shell of the room with its window, and what is fixed to it.

use glam::{Vec3, vec3};

use crate::office::{GAP, Office, ROOM};
use crate::paint::{BRASS, CARPET, DOOR, GRID, SKIRTING, SKY, WALL, WHITE};
use crate::primitives::{ALL_FACES, BOTTOM, TOP, X_HIGH, X_LOW, Z_HIGH, Z_LOW, block, cuboid, cylinder, frame};
use crate::scene::Pose;
use crate::shape::Shape;

/// Window opening in the back wall (z = 0): low and high corner.
pub const WINDOW: [(f32, f32); 2] = [(1.35, 0.95), (2.95, 2.25)];
/// How far the opening reaches back.
const REVEAL: f32 = 0.22;

/// Adds the room.
pub fn add(office: &mut Office) {
    let room = office.scene.group(None, "room", Pose::at(0.0, 0.0, 0.0));
    let parent = Some(room);
    office.thing(parent, "shell", Pose::at(0.0, 0.0, 0.0), shell());
    window(office, parent);
    if office.shows(0.02) {
        skirting(office, parent);
        door(office, parent);
    }
    if office.shows(0.1) {
        ceiling_grid(office, parent);
    }
}

/// Walls, ceiling, floor, window reveal and sky: every edge is shared by exactly two triangles, so no light can leak.
fn shell() -> [(crate::paint::Paint, Shape); 3] {
    let mut walls = cuboid(Vec3::ZERO, ROOM, X_LOW | X_HIGH | TOP | Z_HIGH).inside_out();
    let [(x0, y0), (x1, y1)] = WINDOW;
    let hole = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)];
    let wall = [(0.0, 0.0), (ROOM.x, 0.0), (ROOM.x, ROOM.y), (0.0, ROOM.y)];
    let p = |(x, y): (f32, f32), z: f32| vec3(x, y, z);
    for i in 0..4 {
        let j = (i + 1) % 4;
        // Four trapezoids around the hole: no vertex lies on a neighbour's edge.
        walls.polygon(&[p(wall[i], 0.0), p(wall[j], 0.0), p(hole[j], 0.0), p(hole[i], 0.0)]);
        walls.polygon(&[p(hole[i], 0.0), p(hole[j], 0.0), p(hole[j], -REVEAL), p(hole[i], -REVEAL)]);
    }
    let mut sky = Shape::default();
    sky.polygon(&hole.map(|c| p(c, -REVEAL)));
    let floor = cuboid(Vec3::ZERO, ROOM, BOTTOM).inside_out();
    [(WALL, walls), (CARPET, floor), (SKY, sky)]
}

fn window(office: &mut Office, parent: Option<usize>) {
    let [(x0, y0), (x1, y1)] = WINDOW;
    let (w, h) = (x1 - x0, y1 - y0);
    let (cx, cy) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    // Behind the frame its open back would be seen from outside only.
    let outer = frame(w - 0.002, h - 0.002, 0.055, 0.05);
    let post = cuboid(vec3(-0.03, -h / 2.0 + 0.056, 0.0), vec3(0.03, h / 2.0 - 0.056, 0.045), ALL_FACES & !Z_LOW);
    office.thing(parent, "window frame", Pose::at(cx, cy, -0.18), [(WHITE, outer), (WHITE, post)]);
    let sill = cuboid(vec3(-w / 2.0 - 0.05, 0.0, 0.0), vec3(w / 2.0 + 0.05, 0.03, 0.12), ALL_FACES & !Z_LOW);
    office.thing(parent, "window sill", Pose::at(cx, y0 - 0.031, 0.0), [(WHITE, sill)]);
    if office.shows(0.05) {
        let n = office.around(16);
        let plate = cuboid(vec3(-0.012, -0.03, 0.0), vec3(0.012, 0.03, 0.006), ALL_FACES & !Z_LOW);
        let lever = cylinder(0.006, 0.11, n).moved(0.0, -0.1, 0.02);
        office.thing(parent, "window handle", Pose::at(cx, cy, -0.18 + 0.045 + GAP), [(BRASS, plate), (BRASS, lever)]);
    }
}

fn skirting(office: &mut Office, parent: Option<usize>) {
    let (h, d) = (0.08, 0.014);
    let mut boards = Shape::default();
    let board = |length: f32| block(length, h, d, TOP | Z_HIGH);
    boards.join(board(ROOM.x).moved(ROOM.x / 2.0, 0.0, d / 2.0));
    boards.join(cuboid(vec3(0.0, 0.0, ROOM.z - d), vec3(ROOM.x, h, ROOM.z), TOP | Z_LOW));
    boards.join(cuboid(vec3(0.0, 0.0, d), vec3(d, h, ROOM.z - d), TOP | X_HIGH));
    // The right wall's board stops at the door.
    for (from, to) in [(d, DOOR_AT.0 - 0.07), (DOOR_AT.1 + 0.07, ROOM.z - d)] {
        boards.join(cuboid(vec3(ROOM.x - d, 0.0, from), vec3(ROOM.x, h, to), TOP | X_LOW | Z_LOW | Z_HIGH));
    }
    office.thing(parent, "skirting", Pose::at(0.0, 0.0, 0.0), [(SKIRTING, boards)]);
}

/// Where the door is in the right wall (z from, to).
const DOOR_AT: (f32, f32) = (1.6, 2.5);

fn door(office: &mut Office, parent: Option<usize>) {
    let (from, to) = DOOR_AT;
    let at = |low: Vec3, high: Vec3, faces| cuboid(low, high, faces);
    let (x, height, bar) = (ROOM.x, 2.04, 0.065);
    let inward = ALL_FACES & !X_HIGH & !BOTTOM;
    let jambs = Shape::of([
        at(vec3(x - 0.03, 0.0, from - bar), vec3(x, height, from), inward & !TOP),
        at(vec3(x - 0.03, 0.0, to), vec3(x, height, to + bar), inward & !TOP),
        at(vec3(x - 0.03, height, from - bar), vec3(x, height + bar, to + bar), ALL_FACES & !X_HIGH),
    ]);
    let leaf = at(vec3(x - 0.012, 0.006, from + 0.003), vec3(x, height - 0.003, to - 0.003), inward | BOTTOM);
    let mut panels = Shape::default();
    for (low, high) in [(0.2, 0.85), (1.05, 1.9)] {
        panels.join(at(vec3(x - 0.018, low, from + 0.13), vec3(x - 0.012, high, to - 0.13), inward | BOTTOM));
    }
    let n = office.around(16);
    let knob = crate::primitives::lathe(
        &[(0.0, 0.0), (0.012, 0.0), (0.012, 0.035), (0.026, 0.045), (0.026, 0.06), (0.0, 0.066)],
        n,
    )
    .at(Pose::at(x - 0.0125, 1.02, to - 0.07).roll(std::f32::consts::FRAC_PI_2).map());
    office.thing(
        parent,
        "door",
        Pose::at(0.0, 0.0, 0.0),
        [(WHITE, jambs), (DOOR, leaf), (DOOR, panels), (BRASS, knob)],
    );
}

/// T-bars of a suspended ceiling in a grid of 0.6 m; between the long ones lie short pieces, so nothing overlaps.
fn ceiling_grid(office: &mut Office, parent: Option<usize>) {
    let (half, drop) = (0.012, 0.008);
    let long = office.mesh(
        "ceiling bar",
        [(GRID, cuboid(vec3(-half, -drop, 0.0), vec3(half, 0.0, ROOM.z), BOTTOM | X_LOW | X_HIGH))],
    );
    let (short_from, short_to) = (half, 0.6 - half);
    let short = cuboid(vec3(short_from, -drop, -half), vec3(short_to, 0.0, half), BOTTOM | Z_LOW | Z_HIGH);
    let short = office.mesh("ceiling cross bar", [(GRID, short)]);
    let wall_piece =
        |from: f32, to: f32| cuboid(vec3(from, -drop, -half), vec3(to, 0.0, half), BOTTOM | Z_LOW | Z_HIGH);
    let first = office.mesh("ceiling cross bar, first", [(GRID, wall_piece(0.0, short_to))]);
    let last = office.mesh("ceiling cross bar, last", [(GRID, wall_piece(short_from, 0.6))]);
    for i in 1..10 {
        office.scene.place(parent, "ceiling bar", long, Pose::at(0.6 * i as f32, ROOM.y, 0.0));
    }
    for j in 1..7 {
        for i in 0..10 {
            let mesh = [first, short, last][usize::from(i > 0) + usize::from(i == 9)];
            office.scene.place(parent, "ceiling cross bar", mesh, Pose::at(0.6 * i as f32, ROOM.y, 0.6 * j as f32));
        }
    }
}
