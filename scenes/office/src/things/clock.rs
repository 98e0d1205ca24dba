//! A wall clock over the bookcases' left, with sixty marks.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::vec3;

use crate::office::Office;
use crate::paint::{BLACK, PORCELAIN, TACKS};
use crate::primitives::{cuboid, lathe};
use crate::scene::Pose;

/// Adds the clock on the left wall near the window.
pub fn add(office: &mut Office) {
    if !office.shows(0.1) {
        return;
    }
    let clock = Some(office.scene.group(None, "clock", Pose::at(0.0, 2.35, 2.05).yaw(FRAC_PI_2)));
    let n = office.around(40);
    let upright = Pose::at(0.0, 0.0, 0.0).pitch(FRAC_PI_2).map();
    let case = lathe(&[(0.15, 0.0), (0.15, 0.035), (0.137, 0.035), (0.132, 0.012)], n).at(upright);
    let dial = lathe(&[(0.134, 0.012), (0.0, 0.012)], n).at(upright);
    let cap = lathe(&[(0.006, 0.0125), (0.006, 0.020), (0.0, 0.020)], office.around(16)).at(upright);
    office.thing(clock, "clock case", Pose::at(0.0, 0.0, 0.0), [(BLACK, case), (PORCELAIN, dial), (BLACK, cap)]);
    let bar = |w: f32, low: f32, high: f32, z: f32| {
        cuboid(vec3(-w, low, z), vec3(w, high, z + 0.0008), 63 & !crate::primitives::Z_LOW)
    };
    let (hour, minute) = (
        office.mesh("hour mark", [(BLACK, bar(0.0025, 0.105, 0.125, 0.0122))]),
        office.mesh("minute mark", [(BLACK, bar(0.0007, 0.116, 0.125, 0.0122))]),
    );
    for i in 0..60 {
        let mesh = if i % 5 == 0 { hour } else { minute };
        office.scene.place(clock, "mark", mesh, Pose::at(0.0, 0.0, 0.0).roll(-TAU * i as f32 / 60.0));
    }
    for (name, paint, w, length, z, turn) in [
        ("hour hand", BLACK, 0.004, 0.07, 0.0140, 10.25 / 12.0),
        ("minute hand", BLACK, 0.0028, 0.11, 0.0158, 0.25),
        ("second hand", TACKS[0], 0.0008, 0.12, 0.0176, 0.62),
    ] {
        office.thing(clock, name, Pose::at(0.0, 0.0, 0.0).roll(-TAU * turn), [(paint, bar(w, -0.02, length, z))]);
    }
}
