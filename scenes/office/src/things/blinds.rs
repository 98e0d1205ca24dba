//! A roller blind, drawn down over the upper part of the window.

use glam::vec3;

use super::room::WINDOW;
use crate::office::Office;
use crate::paint::{BLIND, WHITE};
use crate::primitives::{ball, bar, sheet};
use crate::scene::Pose;

/// Share of the window that it covers.
const DRAWN: f32 = 0.34;

/// Adds the blind, inside the window's reveal.
pub fn add(office: &mut Office) {
    let [(x0, y0), (x1, y1)] = WINDOW;
    let width = x1 - x0 - 0.03;
    let blind = office.scene.group(None, "blind", Pose::at(0.5 * (x0 + x1), y1, -0.06));
    let n = office.around(16);
    let (radius, length) = (0.022, DRAWN * (y1 - y0));
    let roll = bar(vec3(-0.5 * width, -0.026, 0.0), vec3(0.5 * width, -0.026, 0.0), radius, n);
    // The cloth hangs from the front of the roll and swings out a little.
    let steps = office.steps(4);
    let cloth = sheet(1, steps, |uv| {
        let t = 1.0 - uv.y;
        vec3((uv.x - 0.5) * (width - 0.02), -0.026 - length * t, radius + 0.001 + 0.012 * t * t)
    });
    let rail = office.slab(width - 0.02, 0.022, 0.016, 0.006).moved(0.0, -0.0265 - length - 0.022, radius + 0.013);
    let mut parts = vec![(WHITE, roll), (BLIND, cloth), (WHITE, rail)];
    if office.shows(0.2) {
        let (x, z, low) = (0.47 * width, radius + 0.03, -0.86);
        parts.push((WHITE, bar(vec3(x, low, z), vec3(x, -0.02, z), 0.0015, office.around(14))));
        parts.push((WHITE, ball(0.010, office.around(16)).at(Pose::at(x, low - 0.01, z).map())));
    }
    office.thing(Some(blind), "roller blind", Pose::at(0.0, 0.0, 0.0), parts);
}
