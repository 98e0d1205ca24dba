//! A rug with bands, fringes and, at high detail, a pile of single tufts.

use std::f32::consts::TAU;

use glam::vec3;

use crate::office::{GAP, Office};
use crate::paint::{RUG, RUG_BAND};
use crate::primitives::{curve, tube};
use crate::scene::Pose;
use crate::shape::Shape;

/// Length along x and width along z, metres.
const SIZE: (f32, f32) = (2.6, 2.3);
/// Thickness.
const HEIGHT: f32 = 0.010;

/// Height at which what stands on the rug and its bands begins.
pub const ON_RUG: f32 = HEIGHT + 0.001 + GAP;

/// Adds the rug under the table.
pub fn add(office: &mut Office) {
    if !office.shows(0.02) {
        return;
    }
    let rug = Some(office.scene.group(None, "rug", Pose::at(3.70, 0.0, 1.95).yaw(0.03)));
    let field = office.slab(SIZE.0, HEIGHT, SIZE.1, 0.004);
    office.thing(rug, "rug", Pose::at(0.0, 0.0, 0.0), [(RUG, field.moved(0.0, GAP, 0.0))]);
    // A woven band: too thin to have sides.
    let band = |inset: f32, width: f32| {
        let corner = |i: usize, inset: f32| {
            let (sx, sz) = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)][i % 4];
            vec3(sx * (0.5 * SIZE.0 - inset), HEIGHT + 0.001, sz * (0.5 * SIZE.1 - inset))
        };
        let mut shape = Shape::default();
        for i in 0..4 {
            shape.polygon(&[
                corner(i, inset),
                corner(i + 1, inset),
                corner(i + 1, inset + width),
                corner(i, inset + width),
            ]);
        }
        shape
    };
    let bands = [band(0.07, 0.05), band(0.17, 0.015)].map(|shape| (RUG_BAND, shape));
    office.thing(rug, "rug bands", Pose::at(0.0, 0.0, 0.0), bands);
    fringes(office, rug);
    tufts(office, rug);
}

fn fringes(office: &mut Office, parent: Option<usize>) {
    let mut rng = office.rng("fringes");
    let per_side = office.count(60).min(400);
    let n = office.around(5);
    let threads: Vec<usize> = (0..4)
        .map(|_| {
            let bend = rng.around(0.012);
            let path = [
                vec3(0.0, 0.0045, 0.0),
                vec3(0.012, 0.003, 0.3 * bend),
                vec3(0.028, 0.0021, bend),
                vec3(0.05, 0.0021, 0.6 * bend),
            ];
            let thread = tube(&curve(&path, office.steps(1)), |_| 0.0016, n);
            office.mesh("fringe", [(RUG_BAND, thread)])
        })
        .collect();
    for end in 0..2 {
        for i in 0..per_side {
            let z = SIZE.1 * ((i as f32 + 0.5) / per_side as f32 - 0.5);
            let pose = if end == 0 {
                Pose::at(SIZE.0 / 2.0 + GAP, 0.0, z)
            } else {
                Pose::at(-SIZE.0 / 2.0 - GAP, 0.0, z).yaw(TAU / 2.0)
            };
            office.scene.place(parent, "fringe", threads[rng.below(4)], pose);
        }
    }
}

/// Single tufts on top of the field, in square tiles that are instances of a few meshes.
fn tufts(office: &mut Office, parent: Option<usize>) {
    if !office.shows(2.0) {
        return;
    }
    let mut rng = office.rng("tufts");
    let tile = 0.05;
    let (columns, rows) = (42, 36);
    // The usual environment has none; from twice the clutter on their number grows with it.
    let per_tile = office.count(3).min(1600);
    let side = (per_tile as f32).sqrt().ceil() as usize;
    let n = office.around(3);
    let steps = office.steps(1);
    let pitch = tile / side as f32;
    let meshes: Vec<usize> = (0..4)
        .map(|_| {
            let mut all = Shape::default();
            for i in 0..per_tile {
                let foot = vec3(pitch * ((i % side) as f32 + 0.5), 0.0, pitch * ((i / side) as f32 + 0.5));
                let lean = vec3(rng.around(0.3 * pitch), 0.0, rng.around(0.3 * pitch));
                let path = [foot, foot + vec3(0.0, 0.003, 0.0) + 0.3 * lean, foot + vec3(0.0, 0.006, 0.0) + lean];
                let radius = 0.16 * pitch;
                all.join(tube(&curve(&path, steps), |t| radius * (1.0 - 0.5 * t), n));
            }
            office.mesh("tufts", [(RUG, all)])
        })
        .collect();
    for i in 0..columns * rows {
        let x = tile * ((i % columns) as f32 - 0.5 * columns as f32);
        let z = tile * ((i / columns) as f32 - 0.5 * rows as f32);
        office.scene.place(parent, "tufts", meshes[rng.below(4)], Pose::at(x, HEIGHT + GAP, z));
    }
}
