//! Ceiling luminaires: framed panels in the tiles of the ceiling.

use crate::office::{Office, ROOM};
use crate::paint::{CEILING_LIGHT, FIXTURE};
use crate::primitives::{frame, rectangle};
use crate::scene::Pose;

/// Adds the ceiling lights: pairs of square panels over desk, window side and table.
pub fn add(office: &mut Office) {
    let half_turn = std::f32::consts::PI;
    let quarter = std::f32::consts::FRAC_PI_2;
    let panel = rectangle(0.52, 0.52).at(Pose::at(0.0, -0.01, 0.0).pitch(half_turn).map());
    // The frame stands with its open back on the ceiling and its front down.
    let rim = frame(0.57, 0.57, 0.026, 0.022).at(Pose::at(0.0, 0.0, 0.0).pitch(quarter).map());
    let mesh = office.mesh("ceiling light", [(CEILING_LIGHT, panel), (FIXTURE, rim)]);
    let lights = office.scene.group(None, "ceiling lights", Pose::at(0.0, 0.0, 0.0));
    for z in [0.9, 3.3] {
        for x in [0.9, 1.5, 4.5, 5.1] {
            office.scene.place(Some(lights), "ceiling light", mesh, Pose::at(x, ROOM.y, z));
        }
    }
}
