//! A push-button telephone.

use glam::vec3;

use crate::office::{GAP, Office};
use crate::paint::{BLACK, DARK_STEEL, PAPER};
use crate::primitives::{curve, cylinder, loft, rounded_rectangle, tube};
use crate::scene::Pose;

/// Adds a telephone; its keys face +z and up.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let phone = Some(office.scene.group(parent, "telephone", pose));
    let n = office.around(16);
    let k = office.steps(4);
    // A wedge: the back is higher than the front.
    let tilt = |loops: Vec<glam::Vec3>, rise: f32| -> Vec<glam::Vec3> {
        loops.into_iter().map(|p| p + vec3(0.0, rise * (0.11 - p.z), 0.0)).collect()
    };
    let ring = |inset: f32, y: f32| rounded_rectangle(0.09 - inset, 0.11 - inset, 0.015, k, y);
    let body = loft(&[ring(0.0, 0.0), tilt(ring(0.0, 0.022), 0.16), tilt(ring(0.004, 0.026), 0.16)], false, true);
    office.thing(phone, "telephone body", Pose::at(0.0, 0.0, 0.0), [(DARK_STEEL, body)]);
    let slope = 0.16_f32.atan();
    let face = office.scene.group(phone, "telephone face", Pose::at(0.0, 0.026 + 0.16 * 0.11 + GAP, 0.0).pitch(slope));
    let key = office.mesh("telephone key", [(PAPER_KEY, office.bevelled(0.013, 0.004, 0.010, 0.001, false))]);
    for row in 0..4 {
        for column in 0..3 {
            let at = Pose::at(0.015 + 0.02 * column as f32, 0.0, 0.0 + 0.019 * row as f32);
            office.scene.place(Some(face), "telephone key", key, at);
        }
    }
    let memory = office.mesh("telephone memory key", [(BLACK, office.bevelled(0.022, 0.003, 0.006, 0.0008, false))]);
    for i in 0..6 {
        office.scene.place(Some(face), "telephone memory key", memory, Pose::at(0.035, 0.0, -0.09 + 0.011 * i as f32));
    }
    // The handset lies along the left side: two caps and a bow between them.
    let ear = |z: f32| cylinder(0.026, 0.022, n).moved(-0.052, 0.003, z);
    let bow = [
        vec3(-0.052, 0.022, -0.085),
        vec3(-0.052, 0.04, -0.05),
        vec3(-0.052, 0.046, 0.0),
        vec3(-0.052, 0.04, 0.05),
        vec3(-0.052, 0.022, 0.085),
    ];
    let grip = tube(&curve(&bow, office.steps(4)), |_| 0.013, n);
    office.thing(
        Some(face),
        "handset",
        Pose::at(0.0, 0.0, 0.0),
        [(BLACK, ear(-0.085)), (BLACK, ear(0.085)), (BLACK, grip)],
    );
    // The coiled cord from the handset to the front of the base.
    if office.shows(0.1) {
        let turns = 14;
        let per = office.steps(14);
        let coil: Vec<_> = (0..=turns * per)
            .map(|i| {
                let t = i as f32 / (turns * per) as f32;
                let (sin, cos) = (std::f32::consts::TAU * turns as f32 * t).sin_cos();
                vec3(
                    -0.105 - 0.03 * (std::f32::consts::PI * t).sin() + 0.006 * cos,
                    0.0075 + 0.006 * sin,
                    0.08 - 0.16 * t,
                )
            })
            .collect();
        office.thing(phone, "cord", Pose::at(0.0, 0.0, 0.0), [(BLACK, tube(&coil, |_| 0.0011, office.around(5)))]);
    }
}

/// White keys.
const PAPER_KEY: crate::paint::Paint =
    crate::paint::solid("telephone key", PAPER.color[0], PAPER.color[1], PAPER.color[2]);
