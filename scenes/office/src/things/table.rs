//! The table in the middle of the room, with work on it.

use glam::vec3;

use super::rug::ON_RUG;
use super::{books, calculator, stationery};
use crate::office::{GAP, Office};
use crate::paint::{BEECH, PORCELAIN, SKIRTING};
use crate::primitives::{ALL_FACES, BOTTOM, TOP, X_HIGH, X_LOW, block, cuboid};
use crate::scene::Pose;
use crate::shape::Shape;

/// Height of the table's top, metres.
const HEIGHT: f32 = 0.73;

/// Adds the table.
pub fn add(office: &mut Office) {
    if !office.shows(0.02) {
        return;
    }
    let table = Some(office.scene.group(None, "table", Pose::at(3.72, 0.0, 1.92).yaw(0.03)));
    let top = office.slab(1.40, 0.03, 0.78, 0.010).moved(0.0, HEIGHT - 0.03, 0.0);
    let mut parts = vec![(BEECH, top)];
    let leg = HEIGHT - 0.03 - ON_RUG - 2.0 * GAP;
    for (x, z) in [(-0.63, -0.32), (0.63, -0.32), (-0.63, 0.32), (0.63, 0.32)] {
        parts.push((BEECH, office.slab(0.06, leg, 0.06, 0.012).moved(x, ON_RUG + GAP, z)));
    }
    office.thing(table, "table top and legs", Pose::at(0.0, 0.0, 0.0), parts);
    let on = Some(office.scene.group(table, "on the table", Pose::at(0.0, HEIGHT + GAP, 0.0)));
    books::pile(office, on, "pile on the table", Pose::at(-0.45, 0.0, -0.14).yaw(0.25), office.count(5).min(8));
    if office.shows(0.05) {
        stationery::paper_stack(
            office,
            on,
            "papers left",
            Pose::at(-0.36, 0.0, 0.19).yaw(0.12),
            office.count(20).min(400),
        );
        stationery::paper_stack(
            office,
            on,
            "papers right",
            Pose::at(0.46, 0.0, -0.08).yaw(-0.12),
            office.count(36).min(400),
        );
        stationery::mug(office, on, Pose::at(0.20, 0.0, 0.0).yaw(2.2), PORCELAIN);
        stationery::tape(office, on, Pose::at(0.10, 0.0, -0.24).yaw(0.7));
        calculator::add(office, on, Pose::at(0.43, 0.0, 0.22).yaw(0.25));
        floppies(office, on, Pose::at(-0.15, 0.0, -0.22).yaw(-0.3));
    }
}

/// An open box of floppy disks standing in a row.
fn floppies(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let group = Some(office.scene.group(parent, "floppy box", pose));
    let (w, h, d, t) = (0.10, 0.06, 0.16, 0.002);
    let walls = [
        block(w, t, d, TOP),
        block(w + 2.0 * t, h, t, ALL_FACES & !BOTTOM).moved(0.0, 0.0, 0.5 * (d + t)),
        block(w + 2.0 * t, h, t, ALL_FACES & !BOTTOM).moved(0.0, 0.0, -0.5 * (d + t)),
        block(t, h, d, TOP | X_LOW | X_HIGH).moved(0.5 * (w + t), 0.0, 0.0),
        block(t, h, d, TOP | X_LOW | X_HIGH).moved(-0.5 * (w + t), 0.0, 0.0),
    ];
    office.thing(group, "floppy case", Pose::at(0.0, 0.0, 0.0), [(SKIRTING, Shape::of(walls))]);
    let colours = [crate::paint::BLACK, crate::paint::COVERS[7], crate::paint::COVERS[6], crate::paint::PUTTY];
    let disks: Vec<usize> = colours
        .iter()
        .map(|&paint| {
            let shell = block(0.090, 0.094, 0.0033, ALL_FACES);
            let label = cuboid(
                vec3(-0.034, 0.035, 0.00165),
                vec3(0.034, 0.088, 0.00185),
                ALL_FACES & !crate::primitives::Z_LOW,
            );
            office.mesh("floppy disk", [(paint, shell), (SKIRTING, label)])
        })
        .collect();
    let mut rng = office.rng("floppies");
    let disks_in = office.count(20).min(24);
    let lean = 0.16_f32;
    for i in 0..disks_in {
        // All lean back alike, 6 mm apart; a shallow spread of the angle cannot make neighbours touch.
        let z = 0.06 - 0.0055 * i as f32;
        let pose = Pose::at(rng.around(0.003), t + 0.0006, z).pitch(-lean + rng.around(0.008));
        office.scene.place(group, "floppy disk", disks[rng.below(4)], pose);
    }
}
