//! The closed shell of the room with its window, and what is fixed to it.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec3, vec3};

use crate::office::{GAP, Office, ROOM};
use crate::paint::{BRASS, CARPET, DOOR, SKIRTING, SKY, WALL, WHITE};
use crate::primitives::{ALL_FACES, BOTTOM, TOP, X_HIGH, X_LOW, Z_HIGH, Z_LOW, cuboid, cylinder, lathe};
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
    let outer = office.moulding(w - 0.002, h - 0.002, 0.055, 0.05);
    let post = office.slab(0.06, h - 0.113, 0.04, 0.006).moved(0.0, 0.0565 - h / 2.0, 0.022);
    office.thing(parent, "window frame", Pose::at(cx, cy, -0.18), [(WHITE, outer), (WHITE, post)]);
    let sill = office.slab(w + 0.10, 0.03, 0.12, 0.008).moved(0.0, 0.0, 0.06 + GAP);
    office.thing(parent, "window sill", Pose::at(cx, y0 - 0.031, 0.0), [(WHITE, sill)]);
    if office.shows(0.05) {
        let n = office.around(16);
        let plate = cuboid(vec3(-0.012, -0.03, 0.0), vec3(0.012, 0.03, 0.006), ALL_FACES & !Z_LOW);
        let lever = cylinder(0.006, 0.11, n).moved(0.0, -0.1, 0.02);
        office.thing(parent, "window handle", Pose::at(cx, cy, -0.18 + 0.042 + GAP), [(BRASS, plate), (BRASS, lever)]);
    }
}

/// Boards along the walls whose upper edge is rounded.
fn skirting(office: &mut Office, parent: Option<usize>) {
    let (h, d) = (0.08, 0.014);
    let steps = office.steps(4).max(4);
    // Along +x at the wall z = 0, its front towards +z.
    let board = |from: f32, to: f32| {
        let mut rows = vec![(0.0, d)];
        rows.extend((0..=steps).map(|step| {
            let (sin, cos) = (FRAC_PI_2 * step as f32 / steps as f32).sin_cos();
            (h - d * (1.0 - sin), d * cos)
        }));
        let mut shape = Shape::default();
        shape.net(rows.len(), 2, false, |row, end| vec3(if end == 0 { from } else { to }, rows[row].0, rows[row].1));
        shape
    };
    let (x, z) = (ROOM.x, ROOM.z);
    let along = |pose: Pose, from: f32, to: f32| board(from, to).at(pose.map());
    let boards = [
        along(Pose::at(0.0, 0.0, 0.0), 0.0, x),
        along(Pose::at(x, 0.0, z).yaw(PI), 0.0, x),
        along(Pose::at(0.0, 0.0, z).yaw(FRAC_PI_2), d, z - d),
        // The right wall's board stops at the door.
        along(Pose::at(x, 0.0, 0.0).yaw(-FRAC_PI_2), d, DOOR_AT.0 - 0.066),
        along(Pose::at(x, 0.0, 0.0).yaw(-FRAC_PI_2), DOOR_AT.1 + 0.066, z - d),
    ];
    office.thing(parent, "skirting", Pose::at(0.0, 0.0, 0.0), [(SKIRTING, Shape::of(boards))]);
}

/// Where the door is in the right wall (z from, to).
const DOOR_AT: (f32, f32) = (1.6, 2.5);

fn door(office: &mut Office, parent: Option<usize>) {
    let (from, to) = DOOR_AT;
    let (x, height, bar) = (ROOM.x - GAP, 2.04, 0.065);
    let (width, middle) = (to - from, 0.5 * (from + to));
    let casing = office
        .casing(width + 2.0 * bar, height + bar, bar, 0.03)
        .at(Pose::at(ROOM.x, GAP, middle).yaw(-FRAC_PI_2).map());
    let leaf = office.slab(0.014, height - 0.01, width - 0.006, 0.004).moved(x - 0.007, 0.006, middle);
    let n = office.around(16);
    let knob = lathe(&[(0.0, 0.0), (0.012, 0.0), (0.012, 0.035), (0.026, 0.045), (0.026, 0.06), (0.0, 0.066)], n)
        .at(Pose::at(x - 0.0145, 1.02, to - 0.07).roll(FRAC_PI_2).map());
    let parts = [(WHITE, casing), (DOOR, leaf), (BRASS, knob)];
    office.thing(parent, "door", Pose::at(0.0, 0.0, 0.0), parts);
}
