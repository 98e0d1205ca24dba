//! A waste bin and crumpled paper in and beside it.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use crate::office::{GAP, Office};
use crate::paint::{CRUMPLED, DARK_STEEL};
use crate::primitives::{crumpled, lathe};
use crate::scene::Pose;

/// Adds the bin next to the desk.
pub fn add_bin(office: &mut Office) {
    let at = Pose::at(0.55, 0.0, 3.28);
    let bin = Some(office.scene.group(None, "waste bin", at));
    let n = office.around(32);
    let wall = [
        (0.0, 0.0),
        (0.105, 0.0),
        (0.135, 0.26),
        (0.137, 0.265),
        (0.134, 0.267),
        (0.131, 0.26),
        (0.102, 0.004),
        (0.0, 0.004),
    ];
    office.thing(bin, "bin", Pose::at(0.0, GAP, 0.0), [(DARK_STEEL, lathe(&wall, n))]);
    let mut rng = office.rng("crumpled paper");
    let cuts = match office.steps(4) {
        0..=2 => 0,
        3..=7 => 1,
        8..=11 => 2,
        12..=19 => 3,
        _ => 4,
    };
    let radius = 0.036;
    let balls: Vec<usize> = (0..2)
        .map(|_| {
            let shape = crumpled(radius, cuts, 0.22, || rng.unit());
            office.mesh("crumpled paper", [(CRUMPLED, shape)])
        })
        .collect();
    // Layers of one in the middle and five around it; two on the floor.
    let spots = [
        (0.0, 0.045, 0.0),
        (0.075, 0.045, 0.0),
        (0.075, 0.045, 0.2),
        (0.075, 0.045, 0.4),
        (0.075, 0.045, 0.6),
        (0.075, 0.045, 0.8),
        (0.0, 0.12, 0.0),
        (0.078, 0.12, 0.1),
        (0.078, 0.12, 0.3),
        (0.078, 0.12, 0.5),
        (0.078, 0.12, 0.7),
        (0.078, 0.12, 0.9),
    ];
    let mut place = |office: &mut Office, x: f32, y: f32, z: f32| {
        let turn = Quat::from_rotation_y(rng.range(0.0, TAU)) * Quat::from_rotation_x(rng.range(0.0, TAU));
        office.scene.place(
            bin,
            "crumpled paper",
            balls[rng.below(2)],
            Pose { rotation: turn, scale: Vec3::ONE, ..Pose::at(x, y, z) },
        );
    };
    for &(r, y, turn) in spots.iter().take(office.count(7).min(12)) {
        let (sin, cos) = (TAU * turn as f32).sin_cos();
        place(office, r * cos, y, r * sin);
    }
    place(office, 0.24, radius, 0.10);
    if office.shows(0.1) {
        place(office, 0.33, radius, -0.06);
    }
}
