//! A venetian blind, drawn down over the upper part of the window.

use glam::{Vec3, vec3};

use super::room::WINDOW;
use crate::office::Office;
use crate::paint::{BLIND, WHITE};
use crate::primitives::{ALL_FACES, bar, block, sheet};
use crate::scene::Pose;

/// Adds the blind, inside the window's reveal.
pub fn add(office: &mut Office) {
    let [(x0, y0), (x1, y1)] = WINDOW;
    let width = x1 - x0 - 0.02;
    let blind = office.scene.group(None, "blind", Pose::at(0.5 * (x0 + x1), 0.0, -0.06));
    let parent = Some(blind);
    let head = block(width, 0.03, 0.04, ALL_FACES);
    office.thing(parent, "blind head", Pose::at(0.0, y1 - 0.031, 0.0), [(WHITE, head)]);
    let slats = office.count(34).min(90);
    let length = 0.70 * (y1 - y0);
    let pitch = length / slats as f32;
    let across = office.steps(4);
    let half = 0.0125_f32.min(0.48 * pitch);
    let slat = sheet(across, 1, |uv| {
        let s = 2.0 * uv.x - 1.0;
        vec3((uv.y - 0.5) * width, 0.12 * half * (1.0 - s * s), half * s)
    });
    let slat = office.mesh("slat", [(BLIND, slat)]);
    let mut rng = office.rng("blinds");
    for i in 0..slats {
        let y = y1 - 0.05 - pitch * (i as f32 + 0.5);
        let pose = Pose::at(rng.around(0.001), y, 0.0).pitch(0.55 + rng.around(0.03)).roll(rng.around(0.0015));
        office.scene.place(parent, "slat", slat, pose);
    }
    let bottom = y1 - 0.06 - length;
    office.thing(
        parent,
        "blind rail",
        Pose::at(0.0, bottom - 0.016, 0.0),
        [(WHITE, block(width, 0.014, 0.022, ALL_FACES))],
    );
    if office.shows(0.2) {
        let n = office.around(6);
        let cord = |x: f32, z: f32, low: f32| bar(vec3(x, low, z), vec3(x, y1 - 0.032, z), 0.0008, n);
        let cords = [(-0.35, 0.016), (-0.35, -0.016), (0.35, 0.016), (0.35, -0.016)];
        let mut parts: Vec<_> = cords.iter().map(|&(x, z)| (WHITE, cord(x * width, z, bottom - 0.001))).collect();
        parts.push((WHITE, cord(0.45 * width, 0.03, y0 + 0.25)));
        parts.push((
            WHITE,
            crate::primitives::ball(0.008, office.around(16)).at(Pose::at(0.45 * width, y0 + 0.242, 0.03).map()),
        ));
        office.thing(parent, "blind cords", Pose { translation: Vec3::ZERO, ..Pose::at(0.0, 0.0, 0.0) }, parts);
    }
}
