//! The desk along the left wall, with everything on it.

use glam::vec3;

use super::{computer, keyboard, stationery, telephone};
use crate::office::{GAP, Office};
use crate::paint::{BLACK, DARK_STEEL, LAMP_LIGHT, OAK, PAPER, STEEL, WALNUT};
use crate::primitives::{curve, lathe, rounded_path, tube};
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
    if office.shows(0.012) {
        stationery::add_desk(office, top);
    }
    if office.shows(0.05) {
        telephone::add(office, top, Pose::at(0.70, 0.0, -0.05).yaw(-0.35));
    }
    if office.shows(0.05) {
        lamp(office, top, Pose::at(-0.79, 0.0, -0.30).yaw(0.35));
    }
}

fn furniture(office: &mut Office, parent: Option<usize>) {
    let top = office.slab(1.80, 0.028, 0.80, 0.008).moved(0.0, HEIGHT - 0.028, 0.0);
    office.thing(parent, "desk top", Pose::at(0.0, 0.0, 0.0), [(OAK, top)]);
    let under = HEIGHT - 0.028 - GAP;
    let frame = [
        // A plain side, a back board between the sides, and a chest of drawers as the other side.
        (OAK, office.slab(0.028, under - GAP, 0.72, 0.006).moved(-0.86, GAP, 0.0)),
        (OAK, office.slab(1.294, under - 0.25, 0.018, 0.004).moved(-0.198, 0.25, -0.321)),
        (OAK, office.slab(0.42, under - GAP, 0.70, 0.006).moved(0.66, GAP, 0.0)),
    ];
    office.thing(parent, "desk frame", Pose::at(0.0, 0.0, 0.0), frame);
    let front = office.mesh("drawer front", [(WALNUT, office.slab(0.40, 0.205, 0.018, 0.005))]);
    let n = office.around(16);
    let steps = office.steps(5);
    let bow = [
        vec3(-0.06, 0.0, 0.0),
        vec3(-0.058, 0.0, 0.022),
        vec3(0.0, 0.0, 0.028),
        vec3(0.058, 0.0, 0.022),
        vec3(0.06, 0.0, 0.0),
    ];
    let handle = office.mesh("drawer handle", [(STEEL, tube(&curve(&bow, steps), |_| 0.004, n))]);
    for i in 0..3 {
        let y = 0.035 + 0.222 * i as f32;
        office.scene.place(parent, "drawer front", front, Pose::at(0.66, y, 0.3595));
        if office.shows(0.05) {
            office.scene.place(parent, "drawer handle", handle, Pose::at(0.66, y + 0.12, 0.369));
        }
    }
}

/// A lamp with a bent arm; its bulb is a disc in the shade.
fn lamp(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let n = office.around(20);
    let lamp = office.scene.group(parent, "desk lamp", pose);
    let base = lathe(
        &[(0.0, 0.0), (0.085, 0.0), (0.085, 0.012), (0.075, 0.018), (0.012, 0.022), (0.012, 0.045), (0.0, 0.045)],
        n,
    );
    let (foot, elbow, head) = (vec3(0.0, 0.045, 0.0), vec3(-0.06, 0.40, -0.02), vec3(0.13, 0.60, 0.20));
    let arm = tube(&rounded_path(&[foot, elbow, head], 0.03, office.steps(4).max(4)), |_| 0.006, office.around(14));
    office.thing(Some(lamp), "lamp stand", Pose::at(0.0, 0.0, 0.0), [(BLACK, base), (STEEL, arm)]);
    // A thin bell, open below, with an inner and an outer wall.
    let bell = [(0.080, 0.0), (0.082, 0.0), (0.072, 0.05), (0.045, 0.09), (0.022, 0.10), (0.020, 0.13), (0.0, 0.135)];
    let inner = [(0.0, 0.088), (0.042, 0.086), (0.069, 0.049), (0.080, 0.0)];
    let bulb = lathe(&[(0.0, 0.035), (0.03, 0.035)], n);
    let socket = lathe(&[(0.03, 0.0352), (0.018, 0.06), (0.018, 0.085)], n);
    let tilt = Pose::at(head.x, head.y - 0.128, head.z);
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
