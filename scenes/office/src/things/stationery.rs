//! Pencils, pens, tacks, clips, paper, mug, stapler, tape and sharpener.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Quat, Vec3, vec3};

use crate::office::{GAP, Office};
use crate::paint::*;
use crate::primitives::{
    ALL_FACES, BOTTOM, bevelled, block, cuboid, curve, cylinder, lathe, loft, sheet, tube,
};
use crate::rng::Rng;
use crate::scene::Pose;
use crate::shape::Shape;

/// Radius of a pencil across its flats and its length, metres.
const PENCIL: (f32, f32) = (0.0036, 0.175);

/// A hexagonal pencil along +y, tip up, axis at the origin.
fn pencil(office: &mut Office, paint: Paint) -> usize {
    let n = office.around(16);
    let (r, length) = (PENCIL.0 / (PI / 6.0).cos(), PENCIL.1);
    let hexagon = |y: f32| -> Vec<Vec3> {
        (0..6).map(|i| (TAU * (i as f32 + 0.5) / 6.0).sin_cos()).map(|(s, c)| vec3(r * s, y, r * c)).collect()
    };
    let body = loft(&[hexagon(0.018), hexagon(length - 0.018)], true, true);
    let cone = lathe(&[(0.0034, length - 0.0178), (0.0011, length - 0.005)], n);
    let lead = lathe(&[(0.0011, length - 0.005), (0.0, length)], n);
    let ferrule = lathe(
        &[(0.0036, 0.005), (0.0039, 0.007), (0.0036, 0.009), (0.0039, 0.011), (0.0036, 0.013), (0.0037, 0.018)],
        n,
    );
    let rubber = lathe(&[(0.0, 0.0), (0.0030, 0.0004), (0.0035, 0.0015), (0.0035, 0.005)], n);
    office.mesh("pencil", [(paint, body), (BARE_WOOD, cone), (GRAPHITE, lead), (BRASS, ferrule), (ERASER, rubber)])
}

/// A ball pen along +y, tip down.
fn pen(office: &mut Office, paint: Paint) -> usize {
    let n = office.around(16);
    let tip = lathe(&[(0.0, 0.0), (0.0006, 0.0), (0.0022, 0.009), (0.0036, 0.018)], n);
    let barrel = lathe(
        &[
            (0.0037, 0.018),
            (0.0042, 0.05),
            (0.0042, 0.13),
            (0.0036, 0.132),
            (0.002, 0.132),
            (0.002, 0.141),
            (0.0, 0.141),
        ],
        n,
    );
    let clip = cuboid(vec3(-0.0015, 0.092, 0.0047), vec3(0.0015, 0.130, 0.0056), ALL_FACES);
    office.mesh("pen", [(STEEL, tip), (paint, barrel), (STEEL, clip)])
}

/// A thumb tack standing on its head (point up): a domed head and a pin.
fn tack(office: &mut Office, paint: Paint) -> usize {
    let n = office.around(16);
    let head =
        lathe(&[(0.0, 0.0), (0.0030, 0.0003), (0.0048, 0.0011), (0.0050, 0.0017), (0.0046, 0.0019), (0.0, 0.0019)], n);
    let pin = lathe(&[(0.0006, 0.0019), (0.0005, 0.0080), (0.0, 0.0102)], n.min(office.around(8)));
    office.mesh("thumb tack", [(paint, head), (STEEL, pin)])
}

/// One mesh of a tack a colour.
pub fn tacks(office: &mut Office) -> Vec<usize> {
    TACKS.iter().map(|&paint| tack(office, paint)).collect()
}

/// How a tack lies when thrown: half on the head, half on the side resting on head rim and point.
fn thrown_tack(rng: &mut Rng, x: f32, z: f32) -> Pose {
    let turn = rng.range(0.0, TAU);
    if rng.unit() < 0.4 {
        Pose::at(x, GAP, z).yaw(turn)
    } else {
        // Rim radius 5.0 mm at 1.7 mm height, point at 10.2 mm: the axis dips by asin(5.0 / 8.5).
        let dip = (0.0050_f32 / 0.0085).atan();
        Pose::at(x, 0.0050 * dip.cos() + 0.0017 * dip.sin() + GAP, z).yaw(turn).pitch(FRAC_PI_2 + dip)
    }
}

/// A paper clip lying in the xz plane.
fn clip(office: &mut Office, paint: Paint) -> usize {
    let (steps, n) = (office.steps(4), office.around(6));
    let mut path = Vec::new();
    let mut arc = |x: f32, z: f32, r: f32, from: f32| {
        for i in 0..=steps {
            let (sin, cos) = (from + PI * i as f32 / steps as f32).sin_cos();
            path.push(vec3(x + r * cos, 0.0005, z + r * sin));
        }
    };
    arc(0.0, 0.010, 0.0040, 0.0);
    arc(0.0004, -0.011, 0.0036, PI);
    arc(0.0006, 0.007, 0.0030, 0.0);
    path.insert(0, vec3(0.004, 0.0005, -0.008));
    path.push(vec3(-0.0024, 0.0005, -0.006));
    office.mesh("paper clip", [(paint, tube(&path, |_| 0.00045, n))])
}

/// A sheet of paper of the given size, gently curled so that its edges rise by `curl`.
fn paper(office: &mut Office, paint: Paint, size: (f32, f32), curl: f32) -> usize {
    let steps = office.steps(3);
    let shape = sheet(steps, steps, |uv| {
        let (s, t) = (uv.x - 0.5, 0.5 - uv.y);
        vec3(s * size.0, curl * 4.0 * (s * s + 0.6 * s * t).max(0.0), t * size.1)
    });
    office.mesh("sheet of paper", [(paint, shape)])
}

/// A4.
const A4: (f32, f32) = (0.21, 0.297);

/// A loose stack of `sheets` sheets of paper.
pub fn paper_stack(office: &mut Office, parent: Option<usize>, name: &str, pose: Pose, sheets: usize) {
    let group = Some(office.scene.group(parent, name, pose));
    let mut rng = office.rng(name);
    let flat = paper(office, PAPER, A4, 0.0);
    let curled = paper(office, PAPER, A4, 0.006);
    for i in 0..sheets {
        let mesh = if i + 1 == sheets { curled } else { flat };
        let lie = Pose::at(rng.around(0.004), 0.0002 * i as f32, rng.around(0.004)).yaw(rng.around(0.05));
        office.scene.place(group, "sheet of paper", mesh, lie);
    }
}

/// A mug with coffee; the handle points along +x.
pub fn mug(office: &mut Office, parent: Option<usize>, pose: Pose, paint: Paint) {
    let n = office.around(24);
    let wall = lathe(
        &[(0.0, 0.0), (0.034, 0.0), (0.040, 0.006), (0.040, 0.094), (0.0385, 0.0955), (0.037, 0.094), (0.037, 0.075)],
        n,
    );
    let coffee = lathe(&[(0.037, 0.075), (0.0, 0.075)], n);
    let handle = [
        vec3(0.0395, 0.078, 0.0),
        vec3(0.060, 0.076, 0.0),
        vec3(0.066, 0.05, 0.0),
        vec3(0.058, 0.026, 0.0),
        vec3(0.0395, 0.022, 0.0),
    ];
    let handle = tube(&curve(&handle, office.steps(4)), |_| 0.0045, office.around(14));
    office.thing(parent, "mug", pose, [(paint, wall), (COFFEE, coffee), (paint, handle)]);
}

/// A stapler along x.
pub fn stapler(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let base = bevelled(0.15, 0.008, 0.032, 0.002, false);
    let arm = bevelled(0.14, 0.016, 0.028, 0.004, true).at(Pose::at(-0.004, 0.016, 0.0).roll(0.10).map());
    let magazine = bevelled(0.135, 0.008, 0.022, 0.001, true).at(Pose::at(-0.002, 0.0085, 0.0).roll(0.04).map());
    let hinge = cylinder(0.009, 0.03, office.around(16)).at(Pose::at(-0.066, 0.0185, -0.015).pitch(FRAC_PI_2).map());
    office.thing(parent, "stapler", pose, [(BLACK, base), (TACKS[0], arm), (STEEL, magazine), (DARK_STEEL, hinge)]);
}

/// A tape dispenser along x.
pub fn tape(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let n = office.around(24);
    let base = bevelled(0.12, 0.018, 0.045, 0.003, false);
    let cheek = |z: f32| block(0.03, 0.034, 0.004, ALL_FACES & !BOTTOM).moved(-0.02, 0.0181, z);
    let lip = block(0.008, 0.022, 0.024, ALL_FACES & !BOTTOM).moved(0.05, 0.0181, 0.0);
    let ring = [(0.016, -0.009), (0.033, -0.009), (0.033, 0.009), (0.016, 0.009), (0.016, -0.009)];
    let roll = lathe(&ring, n).at(Pose::at(-0.02, 0.0518, 0.0).pitch(FRAC_PI_2).map());
    let axle = lathe(&[(0.0, -0.0125), (0.008, -0.0125), (0.008, 0.0125), (0.0, 0.0125)], office.around(16))
        .at(Pose::at(-0.02, 0.042, 0.0).pitch(FRAC_PI_2).map());
    office.thing(
        parent,
        "tape dispenser",
        pose,
        [
            (DARK_STEEL, base),
            (DARK_STEEL, cheek(-0.016)),
            (DARK_STEEL, cheek(0.016)),
            (DARK_STEEL, lip),
            (BARE_WOOD, roll),
            (BLACK, axle),
        ],
    );
}

/// An open box of `w` x `d` with thin walls.
fn tray(w: f32, h: f32, d: f32, t: f32) -> Shape {
    let ring = |x: f32, z: f32, y: f32| crate::primitives::rounded_rectangle(x / 2.0, z / 2.0, 0.0, 1, y);
    let outside = loft(
        &[ring(w, d, 0.0), ring(w, d, h), ring(w - 2.0 * t, d - 2.0 * t, h), ring(w - 2.0 * t, d - 2.0 * t, t)],
        false,
        true,
    );
    Shape::of([outside])
}

/// Everything small on the desk. Pencils and tacks lie left of the computer.
pub fn add_desk(office: &mut Office, parent: Option<usize>) {
    let mut rng = office.rng("desk");
    let pencils: Vec<usize> = PENCILS.iter().map(|&paint| pencil(office, paint)).collect();
    let pens: Vec<usize> = [BLACK, TACKS[1], TACKS[0]].iter().map(|&paint| pen(office, paint)).collect();

    // Lying pencils fan out side by side; none crosses another.
    let n = office.count(7).min(14);
    for i in 0..n {
        let x = -0.29 - 0.022 * i as f32 + rng.around(0.002);
        let z = 0.30 + rng.around(0.012);
        // Yaw is common with a little play that the spacing allows.
        let yaw = 0.22 + rng.around(0.035);
        let roll = TAU * rng.below(6) as f32 / 6.0;
        let pose = Pose::at(x, PENCIL.0 + 0.0001, z).yaw(yaw).pitch(-FRAC_PI_2).turned(Quat::from_rotation_y(roll));
        office.scene.place(parent, "pencil", pencils[rng.below(4)], pose);
    }
    // The cup holds pencils and pens that lean outward.
    let segments = office.around(24);
    let cup = [(0.0, 0.0), (0.038, 0.0), (0.038, 0.10), (0.0355, 0.10), (0.0355, 0.003), (0.0, 0.003)];
    let cup_at = (-0.37, -0.03);
    office.thing(parent, "pencil cup", Pose::at(cup_at.0, 0.0, cup_at.1), [(GLAZE, lathe(&cup, segments))]);
    let held = office.count(9).min(14);
    for i in 0..held {
        let angle = TAU * (i as f32 + 0.3 * rng.unit()) / held as f32;
        let outward = vec3(angle.cos(), 0.0, angle.sin());
        // The foot stands inside the bottom, the shaft leans on the rim.
        let foot = vec3(cup_at.0, 0.0035, cup_at.1) + outward * 0.012;
        let rim = vec3(cup_at.0, 0.10, cup_at.1) + outward * 0.0298;
        let lean = Quat::from_rotation_arc(Vec3::Y, (rim - foot).normalize());
        let mesh = if i % 3 == 2 { pens[rng.below(3)] } else { pencils[rng.below(4)] };
        let spin = Quat::from_rotation_y(rng.range(0.0, TAU));
        let foot = foot + vec3(0.0, 0.0015, 0.0);
        office.scene.place(parent, "in the cup", mesh, Pose::at(foot.x, foot.y, foot.z).turned(lean).turned(spin));
    }
    // Tacks: a box full and some spilt beside it, each in its own cell so that none meet.
    let meshes = tacks(office);
    let box_at = (-0.60, 0.02);
    let mut rng = office.rng("tacks on the desk");
    office.thing(parent, "tack box", Pose::at(box_at.0, 0.0, box_at.1), [(PUTTY, tray(0.075, 0.016, 0.055, 0.0015))]);
    for i in 0..office.count(15).min(15) {
        let (column, row) = (i % 5, i / 5);
        let (x, z) = (box_at.0 + 0.0135 * (column as f32 - 2.0), box_at.1 + 0.0155 * (row as f32 - 1.0));
        let pose = Pose::at(x + rng.around(0.001), 0.0015 + GAP, z + rng.around(0.001)).yaw(rng.range(0.0, TAU));
        office.scene.place(parent, "thumb tack", meshes[rng.below(5)], pose);
    }
    scatter(office, parent, "spilt tacks", (-0.54, 0.10), (0.024, 8), 26, &mut |rng, x, z| {
        (meshes[rng.below(5)], thrown_tack(rng, x, z))
    });
    // Clips.
    let clips = [clip(office, STEEL), clip(office, TACKS[1]), clip(office, TACKS[3])];
    scatter(office, parent, "paper clips", (-0.66, -0.12), (0.036, 5), 18, &mut |rng, x, z| {
        (clips[rng.below(3)], Pose::at(x, GAP, z).yaw(rng.range(0.0, TAU)))
    });
    if office.shows(0.05) {
        mug(office, parent, Pose::at(0.42, 0.0, -0.10).yaw(-0.7), GLAZE);
        paper_stack(office, parent, "desk papers", Pose::at(-0.745, 0.0, 0.22).yaw(0.08), office.count(24).min(300));
        stapler(office, parent, Pose::at(-0.14, 0.0, 0.33).yaw(0.5));
    }
    if office.shows(0.1) {
        sharpener(office, parent, Pose::at(-0.22, 0.0, 0.09).yaw(0.6));
        let note = bevelled(0.076, 0.009, 0.076, 0.0001, false);
        office.thing(parent, "sticky notes", Pose::at(-0.21, 0.0, 0.20).yaw(0.2), [(PAPER_YELLOW_BLOCK, note)]);
        let eraser = bevelled(0.045, 0.012, 0.02, 0.003, true);
        office.thing(parent, "eraser", Pose::at(-0.47, 0.0, 0.015).yaw(0.9), [(ERASER, eraser)]);
        let ruler = cuboid(vec3(-0.15, 0.0, -0.015), vec3(0.15, 0.0022, 0.015), ALL_FACES);
        office.thing(parent, "ruler", Pose::at(-0.60, 0.0, -0.33).yaw(0.05), [(BARE_WOOD, ruler)]);
    }
}

/// A block of notes.
const PAPER_YELLOW_BLOCK: Paint = solid("sticky notes", 0.80, 0.70, 0.22);

fn sharpener(office: &mut Office, parent: Option<usize>, pose: Pose) {
    let body = bevelled(0.025, 0.011, 0.015, 0.0015, true);
    let blade = block(0.020, 0.0006, 0.008, ALL_FACES).moved(0.001, 0.0112, 0.0);
    office.thing(parent, "sharpener", pose, [(BRASS, body), (STEEL, blade)]);
}

/// Things strewn over square cells of a patch centred on `at`; finer cells than one thing are never made.
fn scatter(
    office: &mut Office,
    parent: Option<usize>,
    purpose: &str,
    at: (f32, f32),
    (cell, columns): (f32, usize),
    usual: usize,
    make: &mut dyn FnMut(&mut Rng, f32, f32) -> (usize, Pose),
) {
    let mut rng = office.rng(purpose);
    let cells = columns * columns;
    let mut order: Vec<usize> = (0..cells).collect();
    for i in (1..cells).rev() {
        order.swap(i, rng.below(i + 1));
    }
    for &c in order.iter().take(office.count(usual).min(cells)) {
        let place = |k: usize| cell * (k as f32 - 0.5 * (columns - 1) as f32);
        let (x, z) =
            (at.0 + place(c % columns) + rng.around(0.15 * cell), at.1 + place(c / columns) + rng.around(0.15 * cell));
        let (mesh, pose) = make(&mut rng, x, z);
        office.scene.place(parent, purpose, mesh, pose);
    }
}
