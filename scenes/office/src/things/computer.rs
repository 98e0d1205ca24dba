//! A desktop computer with a tube screen on it, and a mouse.

use glam::vec3;

use crate::office::{GAP, Office};
use crate::paint::{BLACK, FABRIC, PUTTY, PUTTY_DARK, RUBBER, SCREEN, SCREEN_BAR, SCREEN_TEXT};
use crate::primitives::{
    ALL_FACES, BOTTOM, Z_LOW, block, cuboid, curve, cushion, lathe, loft, rounded_rectangle, tube,
};
use crate::scene::Pose;

/// Adds case, screen and mouse; the front looks towards +z.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let computer = Some(office.scene.group(parent, "computer", pose));
    let foot = 0.008;
    let case_height = 0.105;
    let case = office.slab(0.42, case_height, 0.40, 0.006).moved(0.0, foot, 0.0);
    let mut parts = vec![(PUTTY, case)];
    let fittings = office.shows(0.005);
    for (x, z) in [(-0.18, -0.17), (0.18, -0.17), (-0.18, 0.17), (0.18, 0.17)].into_iter().filter(|_| fittings) {
        parts.push((RUBBER, block(0.03, foot - GAP, 0.03, ALL_FACES & !BOTTOM).moved(x, 0.0, z)));
    }
    // Two drive bays, proud of the front.
    for (x, y, w, h) in [(0.11, 0.062, 0.15, 0.03), (0.11, 0.022, 0.11, 0.022)].into_iter().filter(|_| fittings) {
        parts
            .push((PUTTY_DARK, cuboid(vec3(x - w / 2.0, y, 0.2), vec3(x + w / 2.0, y + h, 0.203), ALL_FACES & !Z_LOW)));
        parts.push((
            BLACK,
            cuboid(vec3(x - w * 0.4, y + h * 0.5, 0.203), vec3(x + w * 0.4, y + h * 0.62, 0.2034), ALL_FACES & !Z_LOW),
        ));
    }
    office.thing(computer, "computer case", Pose::at(0.0, 0.0, 0.0), parts);
    let n = office.around(24);
    let stand = lathe(&[(0.0, 0.0), (0.13, 0.0), (0.13, 0.010), (0.09, 0.028), (0.0, 0.030)], n);
    office.thing(computer, "screen stand", Pose::at(0.0, foot + case_height + GAP, -0.02), [(PUTTY, stand)]);
    screen(office, computer, Pose::at(0.0, foot + case_height + 0.0335, -0.02).pitch(-0.03));
    if office.shows(0.006) {
        mouse(office, parent);
    }
}

/// The tube monitor: bezel, recessed screen with a text window, tapering back with cooling slits.
fn screen(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let screen = Some(office.scene.group(parent, "screen", pose));
    let (w, h) = (0.37, 0.34);
    let (front, glass) = (0.15, 0.135);
    let k = office.steps(4);
    let quarter = std::f32::consts::FRAC_PI_2;
    // Lofted along z: the loops lie in the xz plane and the whole is turned up.
    let ring = |x: f32, y: f32, r: f32, z: f32| rounded_rectangle(x / 2.0, y / 2.0, r, k, z);
    let loops = [
        ring(0.20, 0.18, 0.02, -0.22),
        ring(0.22, 0.20, 0.02, -0.20),
        ring(0.30, 0.28, 0.02, -0.02),
        ring(0.335, 0.305, 0.015, 0.0),
        ring(0.335, 0.305, 0.015, 0.095),
    ];
    let upright = Pose::at(0.0, h / 2.0, 0.0).pitch(quarter).map();
    let body = loft(&loops, true, false).at(upright);
    // The bezel's opening and its slanting inner rim down to the glass.
    let opening = (0.28, 0.22);
    let rise = 0.018;
    let bezel = loft(
        &[ring(w, h, 0.012, 0.095), ring(w, h, 0.012, front - 0.004), ring(w - 0.008, h - 0.008, 0.012, front)],
        true,
        false,
    )
    .at(upright);
    let rim_loop = |x: f32, y: f32, z: f32| {
        rounded_rectangle(x / 2.0, y / 2.0, 0.012, k, z)
            .into_iter()
            .map(|p| p + vec3(0.0, 0.0, -rise))
            .collect::<Vec<_>>()
    };
    let face = loft(
        &[
            ring(w - 0.008, h - 0.008, 0.012, front),
            rim_loop(opening.0 + 0.02, opening.1 + 0.02, front),
            rim_loop(opening.0, opening.1, glass),
        ],
        false,
        false,
    )
    .at(upright);
    let mut pane = crate::shape::Shape::default();
    pane.polygon(&rim_loop(opening.0, opening.1, glass));
    office.thing(
        screen,
        "screen case",
        Pose::at(0.0, 0.0, 0.0),
        [(PUTTY, body), (PUTTY, bezel), (PUTTY, face), (SCREEN, pane.at(upright))],
    );

    // What the screen shows: a title bar and lines of text, a hair in front of the glass.
    let middle = h / 2.0 + rise;
    let patch = |x0: f32, x1: f32, y: f32, height: f32| {
        cuboid(vec3(x0, y, glass), vec3(x1, y + height, glass + 0.0002), crate::primitives::Z_HIGH)
    };
    let (left, top) = (-0.5 * opening.0 + 0.02, middle + 0.5 * opening.1 - 0.02);
    office.thing(screen, "title bar", Pose::at(0.0, 0.0, 0.0), [(SCREEN_BAR, patch(left, -left, top - 0.010, 0.010))]);
    let mut rng = office.rng("screen text");
    let mut text = crate::shape::Shape::default();
    for line in 0..office.count(15).min(15) {
        let y = top - 0.024 - 0.0115 * line as f32;
        let mut x = left + 0.012 * rng.below(3) as f32;
        for _ in 0..2 + rng.below(5) {
            let end = x + rng.range(0.008, 0.05);
            if end > -left {
                break;
            }
            text.join(patch(x, end, y, 0.0045));
            x = end + 0.004;
        }
    }
    office.thing(screen, "text", Pose::at(0.0, 0.0, 0.0), [(SCREEN_TEXT, text)]);
    let slit = office.mesh(
        "screen slit",
        [(PUTTY_DARK, cuboid(vec3(-0.1, 0.0, 0.0), vec3(0.1, 0.0012, 0.003), ALL_FACES & !BOTTOM))],
    );
    if office.shows(0.1) {
        for i in 0..8 {
            office.scene.place(screen, "screen slit", slit, Pose::at(0.0, h / 2.0 + 0.1525, 0.012 + 0.009 * i as f32));
        }
    }
    let n = office.around(16);
    let turn = Pose::at(0.0, 0.0, 0.0).pitch(quarter).map();
    let button = office.mesh("screen button", [(PUTTY_DARK, crate::primitives::peg(0.006, 0.005, n).at(turn))]);
    for i in 0..office.count(400).min(4) {
        office.scene.place(screen, "screen button", button, Pose::at(0.08 + 0.022 * i as f32, 0.022, front));
    }
}

fn mouse(office: &mut Office, parent: Option<usize>) {
    let k = office.steps(4);
    let pad = office.bevelled(0.23, 0.004, 0.19, 0.001, false);
    let body = cushion(0.062, 0.034, 0.105, 0.015, k);
    let button = cuboid(vec3(-0.0145, 0.0, -0.02), vec3(0.0145, 0.0012, 0.02), ALL_FACES & !BOTTOM);
    let x = 0.46;
    office.thing(parent, "mouse pad", Pose::at(x, 0.0, 0.25).yaw(0.05), [(FABRIC, pad)]);
    let at = Pose::at(x + 0.01, 0.0043, 0.24).yaw(0.22);
    let left = button.clone().moved(-0.0155, 0.0341, -0.015);
    let right = button.moved(0.0155, 0.0341, -0.015);
    office.thing(parent, "mouse", at, [(PUTTY, body), (PUTTY_DARK, left), (PUTTY_DARK, right)]);
    if office.shows(0.1) {
        let path = [
            vec3(0.455, 0.02, 0.187),
            vec3(0.44, 0.006, 0.13),
            vec3(0.47, 0.003, 0.0),
            vec3(0.40, 0.003, -0.18),
            vec3(0.30, 0.003, -0.30),
        ];
        let cable = tube(&curve(&path, office.steps(6)), |_| 0.0022, office.around(8));
        office.thing(parent, "mouse cable", Pose::at(0.0, 0.0, 0.0), [(BLACK, cable)]);
    }
}
