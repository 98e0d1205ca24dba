//! A low cabinet in the back left corner that carries plant and radio, and a filing cabinet beside the bookcase.

use glam::vec3;

use super::{plant, radio};
use crate::office::{GAP, Office};
use crate::paint::{BEECH, CABINET, PAPER, STEEL, solid};
use crate::primitives::{ALL_FACES, Z_LOW, cuboid, curve, lathe, tube};
use crate::scene::Pose;

/// Adds both.
pub fn add(office: &mut Office) {
    low(office);
    if office.shows(0.006) {
        filing(office);
    }
}

fn low(office: &mut Office) {
    let group = Some(office.scene.group(None, "cabinet", Pose::at(0.62, 0.0, 0.245)));
    let (w, h, d) = (1.10, 0.72, 0.42);
    let body = office.slab(w, h - 0.022 - GAP, d, 0.004).moved(0.0, GAP, 0.0);
    let top = office.slab(w + 0.02, 0.022 - GAP, d + 0.02, 0.006).moved(0.0, h - 0.022 + GAP, 0.0);
    office.thing(group, "cabinet body", Pose::at(0.0, 0.0, 0.0), [(BEECH, body), (BEECH, top)]);
    let door = office.mesh("cabinet door", [(BEECH, office.slab(0.535, 0.60, 0.016, 0.004))]);
    let knobs = office.shows(0.005);
    let knob = lathe(&[(0.006, 0.0), (0.005, 0.012), (0.013, 0.018), (0.013, 0.022), (0.0, 0.026)], office.around(16));
    let knob = office
        .mesh("cabinet knob", [(STEEL, knob.at(Pose::at(0.0, 0.0, 0.0).pitch(std::f32::consts::FRAC_PI_2).map()))]);
    for side in [-1.0, 1.0] {
        office.scene.place(group, "cabinet door", door, Pose::at(side * 0.271, 0.09, d / 2.0 + 0.0085));
        if knobs {
            office.scene.place(group, "cabinet knob", knob, Pose::at(side * 0.04, 0.50, d / 2.0 + 0.0168));
        }
    }
    let top = Some(office.scene.group(group, "on the cabinet", Pose::at(0.0, h + GAP, 0.0)));
    plant::add(office, top, Pose::at(-0.27, 0.0, 0.01).scaled(glam::Vec3::splat(0.82)));
    if office.shows(0.01) {
        radio::add(office, top, Pose::at(0.25, 0.0, 0.06).yaw(0.22));
    }
}

fn filing(office: &mut Office) {
    let group = Some(office.scene.group(None, "filing cabinet", Pose::at(4.50, 0.0, 0.335)));
    let (w, h, d) = (0.46, 1.32, 0.62);
    office.thing(
        group,
        "filing cabinet body",
        Pose::at(0.0, 0.0, 0.0),
        [(CABINET, office.slab(w, h - GAP, d, 0.006).moved(0.0, GAP, 0.0))],
    );
    let front = office.mesh("file drawer", [(CABINET, office.slab(0.43, 0.305, 0.018, 0.005))]);
    let bow = [
        vec3(-0.05, 0.0, 0.0),
        vec3(-0.048, 0.0, 0.024),
        vec3(0.0, 0.0, 0.028),
        vec3(0.048, 0.0, 0.024),
        vec3(0.05, 0.0, 0.0),
    ];
    let handle = tube(&curve(&bow, office.steps(5)), |_| 0.005, office.around(14));
    let handle = office.mesh("file drawer handle", [(STEEL, handle)]);
    let holder = crate::primitives::frame(0.085, 0.04, 0.004, 0.003);
    let label = cuboid(vec3(-0.041, -0.018, 0.0), vec3(0.041, 0.018, 0.001), ALL_FACES & !Z_LOW);
    let holder = office.mesh("label", [(STEEL, holder), (LABEL, label)]);
    for i in 0..4 {
        let y = 0.02 + 0.32 * i as f32;
        office.scene.place(group, "file drawer", front, Pose::at(0.0, y, d / 2.0 + 0.0095));
        if office.shows(0.05) {
            office.scene.place(group, "file drawer handle", handle, Pose::at(0.0, y + 0.12, d / 2.0 + 0.0187));
            office.scene.place(group, "label", holder, Pose::at(0.0, y + 0.21, d / 2.0 + 0.0187));
        }
    }
}

/// A paper label.
const LABEL: crate::paint::Paint = solid("label", PAPER.color[0], PAPER.color[1], PAPER.color[2]);
