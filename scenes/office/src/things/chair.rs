//! The swivel chair at the desk, and the plain chairs at the table.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::vec3;

use super::rug::ON_RUG;
use crate::office::{GAP, Office};
use crate::paint::{BLACK, DARK_STEEL, FABRIC, FABRIC_RED, RUBBER, STEEL};
use crate::primitives::{bar, curve, cushion, cylinder, lathe, loft, rounded_path, rounded_rectangle, tube};
use crate::scene::Pose;

/// Adds all chairs.
pub fn add(office: &mut Office) {
    swivel(office, Pose::at(1.32, 0.0, 2.12).yaw(-2.05));
    if !office.shows(0.02) {
        return;
    }
    let parts = plain(office);
    let chair = office.mesh("table chair", parts);
    for (x, z, yaw) in [(3.35, 1.22, 0.12), (4.05, 1.20, -0.18), (3.78, 2.66, 2.95)] {
        office.scene.place(None, "table chair", chair, Pose::at(x, ON_RUG, z).yaw(yaw));
    }
}

/// A chair on a five-star base with castors; one sits looking along +z.
fn swivel(office: &mut Office, pose: Pose) {
    let chair = Some(office.scene.group(None, "swivel chair", pose));
    let (n, k) = (office.around(20), office.steps(4));
    // Each arm tapers outward from the hub.
    let ring = |w: f32, h: f32, x: f32, y: f32| {
        rounded_rectangle(h / 2.0, w / 2.0, 0.003, 1, 0.0)
            .into_iter()
            .map(move |p| vec3(x, y - p.x, p.z))
            .collect::<Vec<_>>()
    };
    let arm = loft(&[ring(0.050, 0.040, 0.03, 0.105), ring(0.034, 0.022, 0.29, 0.078)], true, true);
    let arm = office.mesh("base arm", [(BLACK, arm)]);
    let wheel = |z: f32| {
        lathe(&[(0.0, 0.0), (0.022, 0.0), (0.025, 0.003), (0.025, 0.014), (0.022, 0.017), (0.0, 0.017)], n)
            .at(Pose::at(0.0, 0.0253, z).pitch(FRAC_PI_2).map())
    };
    let fork = office.bevelled(0.03, 0.032, 0.012, 0.002, true).moved(0.004, 0.026, 0.0);
    let pin = cylinder(0.0055, 0.0105, office.around(14)).moved(0.004, 0.0582, 0.0);
    let castor =
        office.mesh("castor", [(RUBBER, wheel(0.0065)), (RUBBER, wheel(-0.0235)), (BLACK, fork), (STEEL, pin)]);
    let mut rng = office.rng("castors");
    for i in 0..5 {
        let angle = TAU * i as f32 / 5.0;
        office.scene.place(chair, "base arm", arm, Pose::at(0.0, 0.0, 0.0).yaw(angle));
        if office.shows(0.02) {
            let at = vec3(0.28 * angle.cos(), 0.0, -0.28 * angle.sin());
            office.scene.place(chair, "castor", castor, Pose::at(at.x, GAP, at.z).yaw(rng.range(0.0, TAU)));
        }
    }
    let hub = lathe(
        &[
            (0.0, 0.078),
            (0.042, 0.078),
            (0.042, 0.128),
            (0.030, 0.135),
            (0.030, 0.27),
            (0.016, 0.272),
            (0.016, 0.40),
            (0.0, 0.40),
        ],
        n,
    );
    let plate = office.bevelled(0.22, 0.03, 0.26, 0.004, true).moved(0.0, 0.4003, 0.0);
    let lever = bar(vec3(-0.1103, 0.415, 0.03), vec3(-0.25, 0.425, 0.04), 0.005, office.around(14));
    let grip = bar(vec3(-0.2503, 0.425, 0.04), vec3(-0.28, 0.427, 0.042), 0.009, office.around(14));
    office.thing(
        chair,
        "column",
        Pose::at(0.0, 0.0, 0.0),
        [(BLACK, hub), (DARK_STEEL, plate), (STEEL, lever), (BLACK, grip)],
    );
    let seat = cushion(0.49, 0.075, 0.47, 0.035, k);
    let pan = office.slab(0.44, 0.012, 0.42, 0.004);
    office.thing(chair, "seat", Pose::at(0.0, 0.4306, 0.01), [(BLACK, pan), (FABRIC, seat.moved(0.0, 0.0123, 0.0))]);
    // The back is a cushion turned upright and bent around the sitter.
    let mut back = cushion(0.45, 0.06, 0.52, 0.028, k);
    for p in &mut back.positions {
        p.y += 0.6 * p.x * p.x;
    }
    let tilt = Pose::at(0.0, 0.86, -0.285).pitch(FRAC_PI_2 - 0.14).yaw(0.0);
    office.thing(chair, "back", tilt, [(FABRIC, back)]);
    let spine = [
        vec3(0.0, 0.4145, -0.131),
        vec3(0.0, 0.415, -0.26),
        vec3(0.0, 0.46, -0.315),
        vec3(0.0, 0.60, -0.312),
        vec3(0.0, 0.80, -0.295),
    ];
    office.thing(
        chair,
        "spine",
        Pose::at(0.0, 0.0, 0.0),
        [(BLACK, tube(&curve(&spine, office.steps(5)), |_| 0.016, office.around(14)))],
    );
    for side in [-1.0, 1.0].into_iter().filter(|_| office.shows(0.006)).collect::<Vec<_>>() {
        let post = [
            vec3(side * 0.115, 0.418, 0.0),
            vec3(side * 0.25, 0.418, 0.0),
            vec3(side * 0.285, 0.45, 0.0),
            vec3(side * 0.285, 0.64, 0.0),
        ];
        let post = tube(&curve(&post, office.steps(5)), |_| 0.012, office.around(14));
        let pad = cushion(0.055, 0.028, 0.26, 0.012, k).moved(side * 0.285, 0.6405, 0.02);
        office.thing(chair, "armrest", Pose::at(0.0, 0.0, 0.0), [(BLACK, post), (BLACK, pad)]);
    }
}

/// A cantilever chair: cushions on one bent tube; one sits looking along +z.
fn plain(office: &Office) -> Vec<(crate::paint::Paint, crate::shape::Shape)> {
    let (n, k) = (office.around(14), office.steps(4).max(4));
    // From the top of the back over seat, front and floor to the middle behind; the other half is its mirror image.
    let half = [
        vec3(0.205, 0.80, -0.262),
        vec3(0.205, 0.425, -0.205),
        vec3(0.205, 0.425, 0.225),
        vec3(0.205, 0.0135, 0.205),
        vec3(0.205, 0.0135, -0.235),
    ];
    let mirrored = half.iter().rev().map(|p| vec3(-p.x, p.y, p.z));
    let points: Vec<_> = half.into_iter().chain(mirrored).collect();
    let frame = tube(&rounded_path(&points, 0.06, office.steps(5).max(5)), |_| 0.0125, n);
    let seat = cushion(0.44, 0.05, 0.42, 0.022, k).moved(0.0, 0.4385, 0.005);
    let back = cushion(0.44, 0.035, 0.28, 0.015, k).at(Pose::at(0.0, 0.69, -0.218).pitch(FRAC_PI_2 - 0.15).map());
    vec![(STEEL, frame), (FABRIC_RED, seat), (FABRIC_RED, back)]
}
