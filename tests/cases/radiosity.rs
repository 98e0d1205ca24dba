//! Radiosity: furnaces, boxes of one patch a face, converged boxes, energy.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use gsii::Error;
use gsii::pipeline::{Method, Settings};
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::scene::{LightKind, Material};

use crate::Recipe;
use crate::kit::*;
use crate::report::{Case, Estimate, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("RAD-001", rad_001_furnace),
    ("RAD-002", rad_002_high_reflectance),
    ("RAD-003", rad_003_office),
    ("RAD-004", rad_004_three_bands),
    ("RAD-005", rad_005_refused),
    ("RAD-006", |c, o| box_of_six(c, o, [0.5; 6], [0., 0., 0., 0., 0., 1.])),
    ("RAD-007", |c, o| box_of_six(c, o, RHO_007, EXITANCE_007)),
    ("RAD-008", rad_008_triangles),
    ("RAD-009", rad_009_open_box),
    ("RAD-010", rad_010_concentric_spheres),
    ("RAD-011", rad_011_infinite_plates),
    ("RAD-012", |c, o| shortfall(c, o, 0.5, 0.01)),
    ("RAD-013", rad_013_energy),
    ("RAD-014", rad_014_integrating_sphere),
    ("RAD-015", rad_015_area_mean),
    ("RAD-016", |c, o| {
        let points = [("z0", 0.5, 0.5), ("z0", 0.1, 0.1), ("x0", 0.5, 0.5), ("x0", 0.5, 0.9)];
        converged(c, o, 1.0, [0.5; 6], 1.0, &points);
    }),
    ("RAD-017", |c, o| {
        let points = [("z0", 2.75, 2.75), ("x0", 2.75, 2.75), ("x1", 2.75, 2.75), ("y1", 2.75, 1.0)];
        converged(c, o, 5.5, [0.6, 0.2, 0.75, 0.75, 0.75, 0.75], 10.0, &points);
    }),
    ("RAD-018", rad_018_sealed_rooms),
    ("RAD-019", rad_019_two_plates),
    ("RAD-020", |c, o| shortfall(c, o, 0.95, 0.003)),
    ("RAD-021", rad_021_depth_cap),
];

const RHO_007: [f64; 6] = [0.7, 0.1, 0.5, 0.3, 0.2, 0.8];
const EXITANCE_007: [f64; 6] = [0., 2., 0., 0., 0., 1.];
const RHO_FURNACE: [f64; 7] = [0., 0.1, 0.3, 0.5, 0.7, 0.8, 0.9];

/// Radiosity, emission included, of the objects of the given names, over seeds.
fn radiosities(
    room: &Room,
    names: &[&str],
    exitance: &[f64],
    params: impl Fn(u32) -> RadiosityParams,
) -> Vec<Estimate> {
    over_seeds(|seed| {
        let solution = room.solve(&params(seed)).unwrap();
        names.iter().zip(exitance).map(|(name, e)| room.mean(&solution, name) + e).collect()
    })
}

/// A camera in the middle of a box of edge `size` that looks aslant at the floor.
fn inside(scene: &gsii::scene::Scene, size: f64) -> gsii::scene::Camera {
    look_at(scene, v(0.3, 0.4, 0.0) * size, v(0.2, 0.1, 1.0), 0.3 * size, 0.05 * size)
}

pub fn furnace(rho: f64) -> Model {
    closed_box(DVec3::ONE, [rho; 6], [1.0; 6])
}

fn rad_001_furnace(case: &Case, out: &mut Outcome<'_>) {
    let rel = case.tolerance("/pipeline/rel");
    for (rho, expected) in RHO_FURNACE.into_iter().zip(case.values("")) {
        let room = Room::new(furnace(rho).finish());
        // The error is relative to reflected light, a share rho of all: a quarter of what is allowed for the mean of 16 seeds.
        let params = |seed| one_patch(1e-3 / rho.max(0.1), seed);
        for (face, b) in FACES.iter().zip(radiosities(&room, &FACES, &[1.0; 6], params)) {
            out.mean(&format!("B of {face}, rho {rho}"), expected, b, rel * expected);
        }
        let seen = radiance(&room.scene, &mcpt(), &[inside(&room.scene, 1.0)], 1 << 13, Part::All)[0];
        out.pixel(&format!("pi L by path tracing, rho {rho}"), expected, seen.times(PI));
    }
    // The same in other closed rooms: their shape does not matter.
    let mut sphere_room = Model::new();
    sphere_room.add("wall", flipped(sphere(DVec3::ZERO, 1.0, 4)), glow(0.5, 1.0));
    let mut l_room = Model::new();
    let plan = [[0., 0.], [4., 0.], [4., 2.], [1.5, 2.], [1.5, 5.], [0., 5.]];
    for i in 0..6 {
        let ([ax, ay], [bx, by]) = (plan[i], plan[(i + 1) % 6]);
        l_room.add("wall", polygon(&[v(bx, by, 0.), v(ax, ay, 0.), v(ax, ay, 3.), v(bx, by, 3.)]), glow(0.5, 1.0));
    }
    for (z, up) in [(0.0, true), (3.0, false)] {
        l_room.add("wall", level([0., 4.], [0., 2.], z, up), glow(0.5, 1.0));
        l_room.add("wall", level([0., 1.5], [2., 5.], z, up), glow(0.5, 1.0));
    }
    for (what, model) in [("sphere", sphere_room), ("L-room", l_room)] {
        let room = Room::new(model.finish());
        let b = radiosities(&room, &["wall"], &[1.0], |seed| one_patch(4e-3, seed))[0];
        out.mean(&format!("mean B of the {what}"), 2.0, b, 2.0 * rel);
    }
}

fn rad_002_high_reflectance(case: &Case, out: &mut Outcome<'_>) {
    // The mean of 16 seeds is then within a thousandth, half of what is allowed.
    const ERROR: f64 = 4e-3;
    for (rho, expected) in [0.95, 0.99, 0.999].into_iter().zip(case.values("")) {
        let room = Room::new(furnace(rho).finish());
        let params = |seed| RadiosityParams { unshot: 1e-3, ..one_patch(ERROR, seed) };
        for (face, b) in FACES.iter().zip(radiosities(&room, &FACES, &[1.0; 6], params)) {
            out.mean(&format!("B of {face}, rho {rho}"), expected, b, case.tolerance("/pipeline/rel") * expected);
        }
        let settings = Settings {
            method: Method::Pmm,
            patch_size: Some(10.0),
            direct: DirectLight::Shoot,
            radiosity_error: ERROR as f32,
            unshot: 1e-3,
            ..Settings::default()
        };
        let seen = radiance(&room.scene, &settings, &[inside(&room.scene, 1.0)], 1 << 12, Part::All)[0];
        out.pixel(&format!("pi L by PMM, rho {rho}"), expected, seen.times(PI));
    }
}

/// A room with furniture and clutter, all of it of reflectance 1/2 and exitance `e`. Nothing touches: faces in contact would have no
/// radiosity that could be compared.
pub fn office(e: f64) -> Model {
    let look = || glow(0.5, e);
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, v(5., 4., 2.75)).iter().enumerate() {
        model.add(FACES[i], polygon(face), look());
    }
    model.add("table", solid(v(1.5, 1.5, 0.72), v(3.1, 2.3, 0.76)), look());
    for (x, y) in [(1.5, 1.5), (3.05, 1.5), (1.5, 2.25), (3.05, 2.25)] {
        model.add("leg", solid(v(x, y, 1e-3), v(x + 0.05, y + 0.05, 0.719)), look());
    }
    model.add("cupboard", solid(v(0.01, 0.01, 1e-3), v(0.61, 0.51, 1.8)), look());
    for i in 0..500 {
        let at = v(1.55 + 0.06 * f64::from(i % 25), 1.53 + 0.037 * f64::from(i / 25), 0.761);
        model.add("cube", solid(at, at + 0.01), look());
    }
    model
}

fn rad_003_office(case: &Case, out: &mut Outcome<'_>) {
    let scene = office(1.0).finish();
    let room = Room::new(scene.clone());
    let rel = case.tolerance("/pipeline/rel");
    out.note("B of the walls, which see all the rest; furniture in the pixels.");
    let params = |seed| one_patch(6e-3, seed);
    for (face, b) in FACES.iter().zip(radiosities(&room, &FACES, &[1.0; 6], params)) {
        out.mean(&format!("B of {face}"), 2.0, b, 2.0 * rel);
    }
    let cameras = [
        look_at(&scene, v(2.3, 1.9, 0.8), v(0.3, 0.5, 1.0), 1.0, 0.2),
        look_at(&scene, v(0.6, 0.4, 1.0), v(1.0, 0.5, 0.5), 0.5, 0.3),
        look_at(&scene, v(2.5, 4.0, 1.5), -DVec3::Y, 1.0, 0.3),
    ];
    let gsii = Settings { r_thresh: Some(0.3), patch_size: Some(0.5), ..Settings::default() };
    for (what, settings) in [("path tracing", mcpt()), ("GSII", gsii)] {
        let seen = radiance(&scene, &settings, &cameras, 1 << 13, Part::All);
        for (name, l) in ["table", "cupboard", "wall"].into_iter().zip(seen) {
            out.pixel(&format!("L of the {name} by {what}"), 2.0 / PI, l);
        }
    }
}

fn rad_004_three_bands(case: &Case, out: &mut Outcome<'_>) {
    let look = Material::emitter(Vec3::splat(1.0 / std::f32::consts::PI), Vec3::new(0.2, 0.5, 0.8));
    let mut model = Model::new();
    box_faces(DVec3::ZERO, DVec3::ONE).iter().for_each(|f| {
        model.add("wall", polygon(f), look.clone());
    });
    let room = Room::new(model.finish());
    let walls = room.triangles("wall");
    let b = over_seeds(|seed| {
        let solution = room.solve(&one_patch(1e-2, seed)).unwrap();
        (room.mean_of(&solution, &walls) + 1.0).to_array().to_vec()
    });
    for (band, expected) in case.values("").into_iter().enumerate() {
        out.mean(&format!("B of band {band}"), expected, b[band], case.tolerance("/pipeline/rel") * expected);
    }
}

fn rad_005_refused(_: &Case, out: &mut Outcome<'_>) {
    let room = Room::new(furnace(1.0).finish());
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        let refused = room.solve(&RadiosityParams { direct, ..one_patch(1e-2, 1) });
        out.holds(
            &format!("rho 1 with emission, {direct:?}: no steady state"),
            matches!(refused, Err(Error::Unsolvable(_))),
        );
    }
    for rho in [1.01, -0.1, f64::NAN] {
        let mut model = furnace(0.5);
        model.add("bad wall", level([0.2, 0.4], [0.2, 0.4], 0.5, true), grey(rho));
        let refused = model.0.finish();
        let named = matches!(&refused, Err(e) if e.to_string().contains("bad wall"));
        out.holds(&format!("rho {rho} is refused by name"), named);
    }
    let well_posed = Room::new(closed_box(DVec3::ONE, [1., 1., 1., 1., 1., 0.], [0., 0., 0., 0., 1., 0.]).finish());
    out.holds("some surfaces of rho 1 are accepted", well_posed.solve(&one_patch(1e-2, 1)).is_ok());
}

fn box_of_six(case: &Case, out: &mut Outcome<'_>, rho: [f64; 6], exitance: [f64; 6]) {
    let room = Room::new(closed_box(DVec3::ONE, rho, exitance).finish());
    let rel = case.tolerance("/pipeline/rel");
    let measured = radiosities(&room, &FACES, &exitance, |seed| one_patch(4e-3, seed));
    let (b, h) = (case.values("/B"), case.values("/H"));
    for i in 0..6 {
        out.mean(&format!("B of {}", FACES[i]), b[i], measured[i], rel * b[i]);
        let irradiance = (measured[i].mean - exitance[i]) / rho[i];
        out.relative(&format!("H of {}", FACES[i]), h[i], irradiance, rel);
    }
    let ledger = room.solve(&one_patch(4e-3, 1)).unwrap().ledger;
    out.relative("emitted flux", case.values("/flux_emitted")[0], ledger.emitted[0], rel);
    out.relative("absorbed flux", case.values("/flux_absorbed")[0], ledger.absorbed[0], rel);
}

fn rad_008_triangles(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    let mut names = Vec::new();
    let mut exitance = Vec::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE).iter().enumerate() {
        for (half, triangle) in polygon(face).into_iter().enumerate() {
            names.push(format!("{}{}", FACES[i], ["a", "b"][half]));
            exitance.push(EXITANCE_007[i]);
            model.add(names.last().unwrap(), vec![triangle], glow(RHO_007[i], EXITANCE_007[i]));
        }
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let room = Room::new(model.finish());
    let measured = radiosities(&room, &names, &exitance, |seed| one_patch(4e-3, seed));
    for ((name, b), expected) in names.iter().zip(measured).zip(case.values("/B")) {
        out.mean(&format!("B of {name}"), expected, b, case.tolerance("/pipeline/rel") * expected);
    }
}

fn rad_009_open_box(case: &Case, out: &mut Outcome<'_>) {
    let exitance = [0., 0., 0., 0., 1., 0.];
    let black = closed_box(DVec3::ONE, [0.5, 0.5, 0.5, 0.5, 0.5, 0.0], exitance);
    let mut open = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE)[..5].iter().enumerate() {
        open.add(FACES[i], polygon(face), glow(0.5, exitance[i]));
    }
    let rel = case.tolerance("/pipeline/rel");
    for (what, model) in [("black top", &black), ("open top", &open)] {
        let room = Room::new(model.finish());
        let measured = radiosities(&room, &FACES[..5], &exitance, |seed| one_patch(4e-3, seed));
        for (i, expected) in case.values("/B").into_iter().take(5).enumerate() {
            out.mean(&format!("B of {}, {what}", FACES[i]), expected, measured[i], rel * expected);
        }
    }
    let room = Room::new(open.finish());
    let escaped = over_seeds(|seed| vec![room.solve(&one_patch(4e-3, seed)).unwrap().ledger.escaped[0]])[0];
    let expected = case.values("/H")[5];
    out.mean("escaped flux", expected, escaped, rel * expected);
}

fn rad_010_concentric_spheres(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("inner", ball(DVec3::ZERO, 0.5, 5), glow(0.2, 1.0));
    model.add("outer", flipped(ball(DVec3::ZERO, 1.0, 5)), grey(0.8));
    two_surfaces(case, out, &Room::new(model.finish()), ["inner", "outer"], [0.2, 0.8], 1e-2);
}

/// Radiosity and irradiance of two surfaces of one patch each, of which the first emits 1.
fn two_surfaces(case: &Case, out: &mut Outcome<'_>, room: &Room, names: [&str; 2], reflectances: [f64; 2], error: f64) {
    let emission = [1.0, 0.0];
    let measured = radiosities(room, &names, &emission, |seed| one_patch(error, seed));
    let rel = case.tolerance("/pipeline/rel");
    for (i, name) in names.into_iter().enumerate() {
        let (b, h) = (case.values("/B")[i], case.values("/H")[i]);
        out.mean(&format!("B of {name}"), b, measured[i], rel * b);
        out.relative(&format!("H of {name}"), h, (measured[i].mean - emission[i]) / reflectances[i], rel);
    }
}

fn rad_011_infinite_plates(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    // The centre is a plate of its own, so that its patches are the centre's.
    for (z, up, material) in [(0.0, true, glow(0.5, 1.0)), (1.0, false, grey(0.8))] {
        let far = [-512.0, 512.0];
        let name = if up { "lower" } else { "upper" };
        for (x, y) in
            [([-512., -32.], far), ([32., 512.], far), ([-32., 32.], [-512., -32.]), ([-32., 32.], [32., 512.])]
        {
            model.add("rim", level(x, y, z, up), material.clone());
        }
        model.add(name, level([-32., 32.], [-32., 32.], z, up), material);
    }
    let room = Room::new(model.finish());
    let params = |seed| RadiosityParams { patch_size: 64.0, unshot: 1e-3, ..one_patch(1e-2, seed) };
    let measured = radiosities(&room, &["lower", "upper"], &[1.0, 0.0], params);
    for (i, name) in ["lower", "upper"].into_iter().enumerate() {
        let expected = case.values("/B")[i];
        out.mean(&format!("B of {name}"), expected, measured[i], case.tolerance("/pipeline/rel") * expected);
    }
}

/// `(1 - rho) sum A B + rho U = emitted` when shooting stops, for several stops; and the shortfall at the case's own, which is
/// `rho` times the unshot share.
fn shortfall(case: &Case, out: &mut Outcome<'_>, rho: f64, stop: f64) {
    let exitance = [0., 0., 0., 0.3, 0., 1.];
    let room = Room::new(closed_box(v(3., 2., 1.), [rho; 6], exitance).finish());
    let emitted = 6.0 + 0.3 * 3.0;
    let tolerance = case.tolerance("/identity_rel");
    out.note("The solver stops at or below the share asked for: the shortfall is scaled to that share.");
    for unshot in [0.3, 0.1, 0.03, stop] {
        let params = RadiosityParams { unshot, ambient: false, ..one_patch(0.05, 3) };
        let solution = room.solve(&params).unwrap();
        let reflected: f64 = FACES.iter().map(|f| room.area(&room.triangles(f)) * room.mean(&solution, f)).sum();
        let u = solution.ledger.unshot[0];
        let rho = f64::from(rho as f32);
        let identity = ((1.0 - rho) * (emitted + reflected) + rho * u - emitted) / emitted;
        out.near(&format!("balance at unshot {unshot}"), 0.0, identity, tolerance);
        if unshot == stop {
            let complete = emitted / (1.0 - rho);
            let loss = (1.0 - (emitted + reflected) / complete) * stop / solution.ledger.unshot_share();
            out.near("shortfall", case.value(), loss, tolerance);
        }
    }
}

fn rad_013_energy(case: &Case, out: &mut Outcome<'_>) {
    let tolerance = case.tolerance("/abs");
    let closed = closed_box(v(3., 2., 1.), RHO_007, EXITANCE_007);
    let mut open = Model::new();
    open.add("floor", level([0., 3.], [0., 2.], 0.0, true), grey(0.7));
    open.add("ball", ball(v(1.5, 1.0, 0.6), 0.4, 3), grey(0.5));
    open.add("lamp", level([1., 2.], [0.5, 1.5], 2.0, false), glow(0.1, 5.0));
    open.point_light(2.0, v(0.5, 0.5, 1.5));
    let mut coloured = closed.clone();
    coloured.add("mirror", solid(v(1., 1., 0.2), v(1.5, 1.5, 0.7)), mirror(0.8));
    for (what, model) in [("closed", closed), ("open", open), ("with a mirror", coloured)] {
        let room = Room::new(model.finish());
        for unshot in [0.5, 0.1, 0.01, 1e-3] {
            for direct in [DirectLight::Shoot, DirectLight::Gather] {
                let params = RadiosityParams { unshot, direct, patch_size: 0.4, ..one_patch(0.05, 3) };
                let imbalance = room.solve(&params).unwrap().ledger.imbalance();
                out.near(&format!("imbalance, {what}, unshot {unshot}, {direct:?}"), 0.0, imbalance, tolerance);
            }
        }
    }
}

fn rad_014_integrating_sphere(case: &Case, out: &mut Outcome<'_>) {
    let (inner, outer) = (10_f64.to_radians().cos(), 20_f64.to_radians().cos());
    // Flux of a unit spot: full up to the inner angle, then the squared ramp of the extension.
    let extent = 2.0 * PI * ((1.0 - inner) + (inner - outer) / 3.0);
    for (rho, expected) in [0.1, 0.5, 0.9, 0.98].into_iter().zip(case.values("")) {
        let mut model = Model::new();
        model.add("wall", flipped(ball(DVec3::ZERO, 2.0, 4)), grey(rho));
        model.light(
            Vec3::splat((100.0 / extent) as f32),
            LightKind::Spot {
                position: Vec3::ZERO,
                direction: Vec3::Z,
                cos_inner: inner as f32,
                cos_outer: outer as f32,
            },
        );
        let room = Room::new(model.finish());
        let cap = |sign: f32| -> Vec<u32> {
            let wall = room.triangles("wall").into_iter();
            wall.filter(|&t| room.scene.mesh.corners(t).iter().map(|p| sign * p.z).sum::<f32>() > 3.0).collect()
        };
        let caps = [("in the beam", cap(1.0), 100.0), ("behind", cap(-1.0), 0.0)];
        let measured = over_seeds(|seed| {
            let params = RadiosityParams { patch_size: 0.5, direct: DirectLight::Shoot, ..one_patch(0.05, seed) };
            let solution = room.solve(&params).unwrap();
            let of = |(_, cap, direct): &(&str, Vec<u32>, f64)| {
                room.mean_of(&solution, cap).x / rho - direct / room.area(cap)
            };
            caps.iter().map(of).collect()
        });
        for ((what, ..), h) in caps.iter().zip(measured) {
            out.mean(&format!("indirect E {what}, rho {rho}"), expected, h, case.tolerance("/pipeline/rel") * expected);
        }
    }
}

fn rad_015_area_mean(case: &Case, out: &mut Outcome<'_>) {
    let rel = case.tolerance("/pipeline/rel");
    for (rho, expected) in [0.05, 0.3, 0.5, 0.8, 0.9, 0.95].into_iter().zip(case.values("/E_indirect")) {
        let mut model = closed_box(DVec3::splat(4.0), [rho; 6], [0.0; 6]);
        model.point_light(10_000.0 / (4.0 * PI), DVec3::splat(2.0));
        let room = Room::new(model.finish());
        let measured = over_seeds(|seed| {
            let params = RadiosityParams { patch_size: 0.5, ..one_patch(0.05, seed) };
            let solution = room.solve(&params).unwrap();
            let direct = solution.ledger.emitted[0] / 96.0;
            let b = FACES.iter().map(|f| room.mean(&solution, f)).sum::<f64>() / 6.0;
            vec![direct, b / rho - direct]
        });
        let direct = case.values("/E_direct")[0];
        out.mean(&format!("direct E, rho {rho}"), direct, measured[0], rel * direct);
        out.mean(&format!("indirect E, rho {rho}"), expected, measured[1], rel * expected);
    }
}

/// A point on a face of a box of edge `size`: `u` and `v` along the two other axes in ascending order. And the normal there.
pub fn on_face(face: &str, size: f64, s: f64, t: f64) -> (DVec3, DVec3) {
    let high = if face.ends_with('1') { size } else { 0.0 };
    let (point, normal) = match &face[..1] {
        "x" => (v(high, s, t), DVec3::X),
        "y" => (v(s, high, t), DVec3::Y),
        _ => (v(s, t, high), DVec3::Z),
    };
    (point, if high > 0.0 { -normal } else { normal })
}

/// Total irradiance at points of a box by a method.
pub fn irradiance_at(
    model: &Model,
    size: f64,
    rho: impl Fn(&str) -> f64,
    points: &[(&str, f64, f64)],
    settings: &Settings,
    trials: u32,
    part: Part,
) -> Vec<Estimate> {
    let scene = model.finish();
    let cameras: Vec<_> = points
        .iter()
        .map(|&(face, s, t)| {
            let (point, normal) = on_face(face, size, s, t);
            look_at(&scene, point, normal, 1e-2 * size, 1e-4 * size)
        })
        .collect();
    let seen = radiance(&scene, settings, &cameras, trials, part);
    points.iter().zip(seen).map(|(p, l)| l.times(PI / rho(p.0))).collect()
}

fn converged(case: &Case, out: &mut Outcome<'_>, size: f64, rho: [f64; 6], e: f64, points: &[(&str, f64, f64)]) {
    let exitance = [0., 0., 0., 0., 0., e];
    let model = closed_box(DVec3::splat(size), rho, exitance);
    let room = Room::new(model.finish());
    let params = |seed| RadiosityParams {
        patch_size: (size / 16.0) as f32,
        unshot: 1e-3,
        direct: DirectLight::Gather,
        ..one_patch(0.05, seed)
    };
    let measured = radiosities(&room, &FACES, &exitance, params);
    for (i, expected) in case.values("/B_mean").into_iter().enumerate() {
        let what = format!("mean B of {}", FACES[i]);
        out.mean(&what, expected, measured[i], case.tolerance("/mean_B_rel") * expected);
    }
    let rho_of = |face: &str| rho[FACES.iter().position(|f| *f == face).unwrap()];
    let h = irradiance_at(&model, size, rho_of, points, &mcpt(), 1 << 14, Part::All);
    for ((point, h), expected) in points.iter().zip(h).zip(case.values("/H_points")) {
        out.pixel(&format!("H at {point:?} by path tracing"), expected, h);
    }
}

fn rad_018_sealed_rooms(_: &Case, out: &mut Outcome<'_>) {
    let walls = [("wall of 1e-4", 1e-4), ("wall without thickness", 0.0)];
    for ((what, thickness), lamp) in walls.into_iter().flat_map(|w| [(w, "ceiling"), (w, "point light")]) {
        let what = &format!("{what}, {lamp}");
        let mut model = Model::new();
        let x = 5.0 + thickness;
        for (name, x0, x1) in [("lit", 0.0, 5.0), ("dark", x, 10.0)] {
            for (i, face) in box_faces(v(x0, 0., 0.), v(x1, 5., 3.)).iter().enumerate() {
                if thickness > 0.0 || (name, i) != ("dark", 0) {
                    let e = if (name, i, lamp) == ("lit", 5, "ceiling") { 1.0 } else { 0.0 };
                    model.add(name, polygon(face), glow(0.9, e));
                }
            }
        }
        if lamp == "point light" {
            model.point_light(10.0, v(2.0, 2.0, 2.0));
        }
        let room = Room::new(model.finish());
        let dark = room.triangles("dark");
        let mut rays = 0;
        for direct in [DirectLight::Shoot, DirectLight::Gather] {
            let params = RadiosityParams { patch_size: 0.5, direct, unshot: 1e-2, ..one_patch(0.01, 1) };
            let solution = room.solve(&params).unwrap();
            rays += solution.rays;
            out.exact(&format!("B, {what}, {direct:?}"), 0.0, room.mean_of(&solution, &dark).x);
            out.exact(&format!("escaped, {what}, {direct:?}"), 0.0, solution.ledger.escaped[0]);
        }
        let gsii = Settings { r_thresh: Some(0.5), patch_size: Some(0.5), ..Settings::default() };
        for (method, settings) in [("path tracing", mcpt()), ("GSII", gsii)] {
            let prepared = prepare(&room.scene, settings).unwrap();
            let camera = look_at(&room.scene, v(x, 2.5, 1.5), v(1.0, 0.1, 0.1), 4.0, 0.9);
            let film = image(&prepared, &camera, [48, 48], 128, 1);
            let most = film.pixels().map(|p| Part::All.of(p)[0]).fold(0.0, f64::max);
            out.exact(&format!("brightest of 2304 pixels, {what}, {method}"), 0.0, most);
        }
        out.note(format!("{what}: {:.0e} rays of radiosity.", rays as f64));
    }
}

fn rad_019_two_plates(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lower", level([0., 2.], [0., 1.], 0.0, true), glow(0.5, 1.0));
    model.add("upper", level([0., 2.], [0., 1.], 0.5, false), grey(0.9));
    two_surfaces(case, out, &Room::new(model.finish()), ["lower", "upper"], [0.5, 0.9], 4e-3);
}

fn rad_021_depth_cap(case: &Case, out: &mut Outcome<'_>) {
    let losses = case.values("");
    let rel = case.tolerance("/rel");
    out.note("Radiance over that without a cap; the last is the default, without a cap.");
    for (i, rho) in [0.5, 0.8, 0.95, 0.99].into_iter().enumerate() {
        let scene = furnace(rho).finish();
        let camera = [inside(&scene, 1.0)];
        let caps = [4, 8, 32, 128].into_iter().enumerate().map(|(j, depth)| (depth, losses[4 * i + j]));
        for (max_depth, loss) in caps.chain([(u32::MAX, 0.0)]) {
            let settings = Settings { max_depth, ..mcpt() };
            let l = radiance(&scene, &settings, &camera, 1 << 11, Part::All)[0].times(PI * (1.0 - rho));
            let what = if max_depth == u32::MAX { "no cap".to_owned() } else { format!("{max_depth} reflections") };
            out.mean(&format!("rho {rho}, {what}"), 1.0 - loss, l, rel * (1.0 - loss));
        }
    }
}
