//! A ribbed radiator under the window.

use glam::vec3;

use super::room::WINDOW;
use crate::office::{GAP, Office};
use crate::paint::{STEEL, WHITE};
use crate::primitives::{bar, peg};
use crate::scene::Pose;

/// Adds the radiator.
pub fn add(office: &mut Office) {
    if !office.shows(0.15) {
        return;
    }
    let [(x0, _), (x1, _)] = WINDOW;
    let ribs = 15;
    let pitch = 0.055;
    let group = office.scene.group(None, "radiator", Pose::at(0.5 * (x0 + x1), 0.24, 0.085));
    let rib = office.mesh("radiator rib", [(WHITE, office.bevelled(0.042, 0.40, 0.10, 0.008, true))]);
    for i in 0..ribs {
        let x = (i as f32 - 0.5 * (ribs - 1) as f32) * pitch;
        office.scene.place(Some(group), "radiator rib", rib, Pose::at(x, 0.0, 0.0));
    }
    let n = office.around(16);
    let end = 0.5 * ribs as f32 * pitch;
    // The pipes fill the gaps between the ribs.
    let mut pipes = Vec::new();
    for i in 0..ribs - 1 {
        let x = (i as f32 - 0.5 * (ribs - 1) as f32) * pitch + 0.021;
        for y in [0.06, 0.34] {
            pipes.push((WHITE, bar(vec3(x + GAP, y, 0.0), vec3(x + pitch - 0.042 - GAP, y, 0.0), 0.015, n)));
        }
    }
    let valve = peg(0.018, 0.05, n).at(Pose::at(end + 0.03, 0.06, 0.0).map());
    let feed = bar(vec3(end + 0.03, -0.239, 0.0), vec3(end + 0.03, 0.0597, 0.0), 0.009, n);
    let joint = bar(vec3(end - 0.006, 0.04, 0.0), vec3(end + 0.0205, 0.04, 0.0), 0.008, n);
    pipes.extend([(STEEL, valve), (STEEL, feed), (STEEL, joint)]);
    office.thing(Some(group), "radiator pipes", Pose::at(0.0, 0.0, 0.0), pipes);
}
