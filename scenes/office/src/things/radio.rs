//! A portable radio: wooden case, slatted grille, dial, knobs and an aerial.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::vec3;

use crate::office::Office;
use crate::paint::{BLACK, BRASS, DARK_STEEL, MOUNT, STEEL, TACKS, WALNUT};
use crate::primitives::{ALL_FACES, BOTTOM, Z_HIGH, Z_LOW, bevelled, block, cuboid, curve, frame, lathe, loft, tube};
use crate::scene::Pose;

/// Adds the radio, its front towards +z.
pub fn add(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let radio = Some(office.scene.group(parent, "radio", pose));
    let (w, h, d, foot) = (0.36, 0.20, 0.11, 0.006);
    let n = office.around(20);
    let front = d / 2.0;
    let middle = foot + h / 2.0;
    let mut body = vec![(WALNUT, bevelled(w, h, d, 0.006, true).moved(0.0, foot, 0.0))];
    for x in [-0.14, 0.14] {
        body.push((BLACK, block(0.03, foot - 0.0003, 0.08, ALL_FACES & !BOTTOM).moved(x, 0.0, 0.0)));
    }
    // A black panel on the front carries dial, grille and knobs.
    body.push((
        BLACK,
        cuboid(
            vec3(-w / 2.0 + 0.015, foot + 0.015, front),
            vec3(w / 2.0 - 0.015, foot + h - 0.015, front + 0.003),
            ALL_FACES & !Z_LOW,
        ),
    ));
    let handle = [
        vec3(-0.13, 0.0, 0.0),
        vec3(-0.125, 0.035, 0.0),
        vec3(-0.09, 0.045, 0.0),
        vec3(0.09, 0.045, 0.0),
        vec3(0.125, 0.035, 0.0),
        vec3(0.13, 0.0, 0.0),
    ];
    body.push((
        DARK_STEEL,
        tube(&curve(&handle, office.steps(4)), |_| 0.006, office.around(14)).moved(0.0, foot + h + 0.0003, 0.0),
    ));
    office.thing(radio, "radio case", Pose::at(0.0, 0.0, 0.0), body);

    let face = Some(office.scene.group(radio, "radio front", Pose::at(0.0, middle, front + 0.003)));
    // The grille: upright slats in a frame.
    let (gx, gw, gh) = (-0.075, 0.15, 0.145);
    office.thing(face, "grille frame", Pose::at(gx, 0.0, 0.0), [(BRASS, frame(gw, gh, 0.006, 0.006))]);
    let slats = office.count(34).min(60);
    let pitch = (gw - 0.014) / slats as f32;
    let slat = cuboid(
        vec3(-0.28 * pitch, -gh / 2.0 + 0.0065, 0.0),
        vec3(0.28 * pitch, gh / 2.0 - 0.0065, 0.004),
        ALL_FACES & !Z_LOW,
    );
    let slat = office.mesh("grille slat", [(DARK_STEEL, slat)]);
    for i in 0..slats {
        office.scene.place(
            face,
            "grille slat",
            slat,
            Pose::at(gx - gw / 2.0 + 0.007 + pitch * (i as f32 + 0.5), 0.0, 0.0),
        );
    }
    // The dial: a light scale with marks and a red needle.
    let (dx, dy, dw, dh) = (0.085, 0.045, 0.14, 0.05);
    let mut dial = vec![
        (MOUNT, cuboid(vec3(-dw / 2.0, -dh / 2.0, 0.0), vec3(dw / 2.0, dh / 2.0, 0.001), ALL_FACES & !Z_LOW)),
        (TACKS[0], cuboid(vec3(0.018, -dh / 2.0 + 0.004, 0.0016), vec3(0.0192, dh / 2.0 - 0.004, 0.0022), ALL_FACES)),
        (BRASS, frame(dw + 0.012, dh + 0.012, 0.0058, 0.004)),
    ];
    if office.shows(0.2) {
        let marks = 31;
        for i in 0..marks {
            let x = (i as f32 - 0.5 * (marks - 1) as f32) * 0.0042;
            let long = if i % 5 == 0 { 0.010 } else { 0.005 };
            dial.push((BLACK, cuboid(vec3(x - 0.0003, 0.0, 0.0), vec3(x + 0.0003, long, 0.0012), Z_HIGH)));
        }
    }
    office.thing(face, "dial", Pose::at(dx, dy, 0.0), dial);
    // Knurled knobs.
    let teeth = office.around(22);
    let star = |radius: f32, y: f32| {
        (0..2 * teeth)
            .map(|i| {
                let r = if i % 2 == 0 { radius } else { 0.93 * radius };
                let (sin, cos) = (TAU * i as f32 / (2 * teeth) as f32).sin_cos();
                vec3(r * sin, y, r * cos)
            })
            .collect::<Vec<_>>()
    };
    let knob = |r: f32| {
        let turn = Pose::at(0.0, 0.0, 0.0).pitch(FRAC_PI_2).map();
        let skirt = lathe(&[(1.15 * r, 0.0), (1.15 * r, 0.002), (0.0, 0.002)], n).at(turn);
        let grip = loft(&[star(r, 0.0022), star(r, 0.016)], false, true).at(turn);
        [(BRASS, skirt), (MOUNT, grip)]
    };
    let (large, small) = (office.mesh("tuning knob", knob(0.021)), office.mesh("knob", knob(0.012)));
    office.scene.place(face, "tuning knob", large, Pose::at(0.125, -0.033, 0.0));
    for i in 0..3 {
        office.scene.place(face, "knob", small, Pose::at(0.022 + 0.032 * i as f32, -0.033, 0.0).roll(0.7 * i as f32));
    }
    // A telescopic aerial.
    let (mut from, direction) = (vec3(0.15, foot + h + 0.0003, -0.035), vec3(0.28, 0.95, -0.10).normalize());
    let mut aerial = vec![(STEEL, crate::primitives::peg(0.006, 0.01, n).moved(from.x, from.y, from.z))];
    from.y += 0.0085;
    for i in 0..4 {
        let to = from + 0.11 * direction;
        aerial.push((STEEL, tube(&[from, to], |_| 0.0024 - 0.0004 * i as f32, office.around(14))));
        from = to;
    }
    aerial.push((STEEL, crate::primitives::ball(0.003, office.around(14)).moved(from.x, from.y, from.z)));
    office.thing(radio, "aerial", Pose::at(0.0, 0.0, 0.0), aerial);
}
