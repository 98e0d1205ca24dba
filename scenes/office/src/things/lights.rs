//! Ceiling luminaires: panels in rounded frames.

use crate::office::{Office, ROOM};
use crate::paint::{CEILING_LIGHT, FIXTURE};
use crate::primitives::rectangle;
use crate::scene::Pose;

/// Width and depth of the part that shines, metres.
const PANEL: (f32, f32) = (1.10, 0.49);

/// Adds the ceiling lights: over desk, cabinet, shelves and table.
pub fn add(office: &mut Office) {
    let half_turn = std::f32::consts::PI;
    let quarter = std::f32::consts::FRAC_PI_2;
    let panel = rectangle(PANEL.0, PANEL.1).at(Pose::at(0.0, -0.01, 0.0).pitch(half_turn).map());
    // The frame stands with its open back on the ceiling and its front down.
    let rim =
        office.moulding(PANEL.0 + 0.05, PANEL.1 + 0.05, 0.026, 0.03).at(Pose::at(0.0, 0.0, 0.0).pitch(quarter).map());
    let mut parts = vec![(CEILING_LIGHT, panel)];
    if office.shows(0.01) {
        parts.push((FIXTURE, rim));
    }
    let mesh = office.mesh("ceiling light", parts);
    let lights = office.scene.group(None, "ceiling lights", Pose::at(0.0, 0.0, 0.0));
    for z in [0.9, 3.3] {
        for x in [1.2, 4.8] {
            office.scene.place(Some(lights), "ceiling light", mesh, Pose::at(x, ROOM.y, z));
        }
    }
}
