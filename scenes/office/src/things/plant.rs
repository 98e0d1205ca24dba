//! A potted plant with arching stems and many leaves.

use std::f32::consts::TAU;

use glam::{Quat, Vec3, vec3};

use crate::office::Office;
use crate::paint::{EARTH, LEAF, LEAF_DRY, LEAF_LIGHT, STEM, TERRACOTTA};
use crate::primitives::{curve, lathe, leaf, tube};
use crate::scene::Pose;

/// Adds the plant.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let plant = Some(office.scene.group(parent, "plant", pose));
    let n = office.around(28);
    let pot =
        [(0.0, 0.012), (0.062, 0.012), (0.088, 0.15), (0.096, 0.15), (0.098, 0.185), (0.090, 0.187), (0.086, 0.16)];
    let saucer = [(0.0, 0.0), (0.085, 0.0), (0.105, 0.018), (0.101, 0.018), (0.083, 0.0115), (0.0, 0.0115)];
    let earth = [(0.0865, 0.16), (0.05, 0.168), (0.0, 0.170)];
    office.thing(
        plant,
        "pot",
        Pose::at(0.0, 0.0, 0.0),
        [(TERRACOTTA, lathe(&pot, n)), (TERRACOTTA, lathe(&saucer, n)), (EARTH, lathe(&earth, n))],
    );

    let (across, along) = (office.steps(2), office.steps(6));
    let mut blades = Vec::new();
    for (paint, length, droop) in [
        (LEAF, 0.15, 0.9),
        (LEAF, 0.12, 1.3),
        (LEAF, 0.17, 0.6),
        (LEAF_LIGHT, 0.10, 0.8),
        (LEAF_LIGHT, 0.13, 1.1),
        (LEAF_DRY, 0.11, 1.8),
    ] {
        blades.push(
            office.mesh("leaf", [(paint, leaf(length, 0.36 * length, 0.25, droop, across.max(2) / 2 * 2, along))]),
        );
    }
    let mut rng = office.rng("plant");
    let stems = office.count(16).min(90);
    let total = office.count(170).min(3000).max(stems);
    let mut stem_parts = Vec::new();
    for i in 0..stems {
        let angle = TAU * (i as f32 * 0.618_034 + 0.03 * rng.unit());
        let outward = vec3(angle.cos(), 0.0, angle.sin());
        // Inner stems rise, outer ones arch.
        let spread = (i as f32 + 0.5) / stems as f32;
        let height = 0.52 - 0.20 * spread + rng.around(0.05);
        let reach = 0.03 + 0.17 * spread + rng.around(0.015);
        let foot = vec3(0.0, 0.155, 0.0) + outward * (0.012 + 0.045 * spread);
        let points = [
            foot,
            foot + vec3(0.0, 0.5 * height, 0.0) + outward * 0.25 * reach,
            foot + vec3(0.0, 0.9 * height, 0.0) + outward * 0.65 * reach,
            foot + vec3(0.0, height * (1.0 - 0.15 * spread), 0.0) + outward * reach,
        ];
        let path = curve(&points, office.steps(3));
        stem_parts.push(tube(&path, |t| 0.0035 * (1.0 - 0.7 * t) + 0.0004, office.around(7)));
        let here = (total * (i + 1)) / stems - (total * i) / stems;
        for k in 0..here {
            let t = 0.30 + 0.70 * (k as f32 + 0.5 * rng.unit()) / here.max(1) as f32;
            let s = t.min(0.999) * (path.len() - 1) as f32;
            let (a, b) = (path[s as usize], path[s as usize + 1]);
            let at = a.lerp(b, s.fract());
            let heading = if here == 1 { angle } else { angle + 2.4 * k as f32 + rng.around(0.5) };
            let rise = rng.range(0.1, 0.75) * t;
            let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 - heading)
                * Quat::from_rotation_x(-rise)
                * Quat::from_rotation_z(rng.around(0.5));
            let mesh = blades[if rng.unit() < 0.04 { 5 } else { rng.below(5) }];
            let size = (0.75 + 0.4 * rng.unit()) * (1.15 - 0.3 * t);
            office.scene.place(plant, "leaf", mesh, Pose::at(at.x, at.y, at.z).turned(turn).scaled(Vec3::splat(size)));
        }
    }
    office.thing(plant, "stems", Pose::at(0.0, 0.0, 0.0), stem_parts.into_iter().map(|stem| (STEM, stem)));
}
