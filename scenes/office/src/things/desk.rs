//! The desk along the left wall, with everything on it.

use glam::vec3;

use super::{computer, keyboard, stationery, telephone};
use crate::office::{GAP, Office};
use crate::paint::{BLACK, DARK_STEEL, LAMP_LIGHT, OAK, PAPER, STEEL, WALNUT};
use crate::primitives::{ALL_FACES, BOTTOM, bevelled, block, cuboid, curve, cylinder, lathe, tube};
use crate::scene::Pose;

/// Height of the desk's top, metres.
const HEIGHT: f32 = 0.74;

/// Adds the desk. Its own frame: x along the wall, +z towards the user.
pub fn add(office: &mut Office) {
    let pose = Pose::at(0.44, 0.0, 2.05).yaw(std::f32::consts::FRAC_PI_2);
    let desk = office.scene.group(None, "desk", pose);
    furniture(office, Some(desk));
    let top = Some(office.scene.group(Some(desk), "on the desk", Pose::at(0.0, HEIGHT + GAP, 0.0)));
    computer::add(office, top, Pose::at(0.10, 0.0, -0.13).yaw(-0.06));
    keyboard::add(office, top, Pose::at(0.08, 0.0, 0.25).yaw(-0.03));
    stationery::add_desk(office, top);
    if office.shows(0.05) {
        telephone::add(office, top, Pose::at(0.70, 0.0, -0.05).yaw(-0.35));
    }
    if office.shows(0.05) {
        lamp(office, top, Pose::at(-0.74, 0.0, -0.26).yaw(0.35));
    }
}

fn furniture(office: &mut Office, parent: Option<usize>) {
    let top = bevelled(1.80, 0.028, 0.80, 0.003, true).moved(0.0, HEIGHT - 0.028, 0.0);
    office.thing(parent, "desk top", Pose::at(0.0, 0.0, 0.0), [(OAK, top)]);
    let under = HEIGHT - 0.028 - GAP;
    let frame = [
        // A plain side, a back board between the sides, and a chest of drawers as the other side.
        (OAK, block(0.025, under, 0.72, ALL_FACES & !BOTTOM).moved(-0.86, 0.0, 0.0)),
        (OAK, cuboid(vec3(-0.847, 0.25, -0.33), vec3(0.448, under, -0.312), ALL_FACES)),
        (OAK, block(0.42, under - 0.05, 0.70, ALL_FACES).moved(0.66, 0.05, 0.0)),
        (DARK_STEEL, block(0.38, 0.0497, 0.62, ALL_FACES & !BOTTOM).moved(0.66, 0.0, 0.0)),
    ];
    office.thing(parent, "desk frame", Pose::at(0.0, 0.0, 0.0), frame);
    let front = office.mesh("drawer front", [(WALNUT, bevelled(0.40, 0.185, 0.018, 0.003, true))]);
    let n = office.around(16);
    let steps = office.steps(3);
    let bow = [
        vec3(-0.06, 0.0, 0.0),
        vec3(-0.058, 0.0, 0.022),
        vec3(0.0, 0.0, 0.028),
        vec3(0.058, 0.0, 0.022),
        vec3(0.06, 0.0, 0.0),
    ];
    let handle = office.mesh("drawer handle", [(STEEL, tube(&curve(&bow, steps), |_| 0.004, n))]);
    for i in 0..3 {
        let y = 0.075 + 0.205 * i as f32;
        office.scene.place(parent, "drawer front", front, Pose::at(0.66, y, 0.3595));
        if office.shows(0.05) {
            office.scene.place(parent, "drawer handle", handle, Pose::at(0.66, y + 0.11, 0.369));
        }
    }
}

/// A lamp with a jointed arm; its bulb is a disc in the shade.
fn lamp(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let n = office.around(20);
    let lamp = office.scene.group(parent, "desk lamp", pose);
    let base = lathe(
        &[(0.0, 0.0), (0.085, 0.0), (0.085, 0.012), (0.075, 0.018), (0.012, 0.022), (0.012, 0.045), (0.0, 0.045)],
        n,
    );
    let (foot, elbow, head) = (vec3(0.0, 0.045, 0.0), vec3(-0.06, 0.40, -0.02), vec3(0.13, 0.60, 0.20));
    let arm = |a, b| tube(&[a, b], |_| 0.006, office.around(14));
    let joint = cylinder(0.014, 0.024, n)
        .at(Pose::at(elbow.x, elbow.y, elbow.z - 0.012).pitch(std::f32::consts::FRAC_PI_2).map());
    office.thing(
        Some(lamp),
        "lamp stand",
        Pose::at(0.0, 0.0, 0.0),
        [(BLACK, base), (STEEL, arm(foot, elbow)), (STEEL, arm(elbow, head)), (BLACK, joint)],
    );
    // A thin bell, open below, with an inner and an outer wall.
    let bell = [(0.080, 0.0), (0.082, 0.0), (0.072, 0.05), (0.045, 0.09), (0.022, 0.10), (0.020, 0.13), (0.0, 0.135)];
    let inner = [(0.0, 0.088), (0.042, 0.086), (0.069, 0.049), (0.080, 0.0)];
    let bulb = lathe(&[(0.0, 0.035), (0.03, 0.035)], n);
    let socket = lathe(&[(0.03, 0.0352), (0.018, 0.06), (0.018, 0.085)], n);
    let tilt = Pose::at(head.x, head.y - 0.128, head.z).pitch(0.0);
    office.thing(
        Some(lamp),
        "lamp head",
        tilt,
        [(DARK_STEEL, lathe(&bell, n)), (PAPER_WHITE, lathe(&inner, n)), (LAMP_LIGHT, bulb), (PAPER_WHITE, socket)],
    );
}

/// The inside of a lamp shade is white.
const PAPER_WHITE: crate::paint::Paint =
    crate::paint::solid("shade white", PAPER.color[0], PAPER.color[1], PAPER.color[2]);
