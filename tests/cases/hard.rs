//! Numerically hard and degenerate scenes.

use std::f64::consts::PI;

use glam::DVec3;
use gsii::backend::{Coherence, Hit, Ray, Visible};
use gsii::pipeline::{Method, Settings};
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::sampling::{hash_all, sobol, uniform_sphere, unit};
use gsii::scene::Scene;
use gsii::simplify::{BoxFit, Class, simplify};
use rayon::prelude::*;

use crate::Recipe;
use crate::direct_light::direct;
use crate::kit::*;
use crate::radiosity::{irradiance_at, office};
use crate::report::{Case, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("HARD-006", hard_006_coplanar_emitter),
    ("HARD-007", hard_007_no_light),
    ("HARD-008", hard_008_only_complex),
    ("HARD-009", hard_009_open_scene),
    ("HARD-010", hard_010_closed_rooms),
    ("HARD-012", hard_012_diced_walls),
];

fn hard_006_coplanar_emitter(case: &Case, out: &mut Outcome<'_>) {
    let mut model = closed_box(v(4., 4., 3.), [0.0; 6], [0.0; 6]);
    model.add("lamp", level([1.5, 2.5], [1.5, 2.5], 3.0, false), glow(0.0, PI));
    // A receiver in the floor would itself be coplanar with it: a millimetre above.
    let point = v(2., 2., 1e-3);
    let expected = case.values("")[0];
    let e = direct(&model, &[(point, DVec3::Z)], 1 << 13)[0];
    out.mean("E at the floor's centre", expected, e, case.tolerance("/rel") * expected);
}

fn hard_007_no_light(_: &Case, out: &mut Outcome<'_>) {
    let room = Room::new(office(0.0).finish());
    for direct in [DirectLight::Gather, DirectLight::Shoot] {
        let solution = room.solve(&RadiosityParams { direct, ..RadiosityParams::new(0.25) }).unwrap();
        out.exact(&format!("shots, {direct:?}"), 0.0, solution.shots as f64);
        out.exact(&format!("B of the floor, {direct:?}"), 0.0, room.mean(&solution, "z0"));
    }
    for method in [Method::Gsii, Method::Pmm, Method::Mcpt] {
        let settings = Settings { method, patch_size: Some(0.25), ..Settings::default() };
        let prepared = prepare(&room.scene, settings).unwrap();
        let film = image(&prepared, &room.scene.cameras[0], [16, 16], 4, 1);
        let most = film.pixels().flat_map(|p| Part::All.of(p)).fold(0.0, f64::max);
        out.exact(&format!("brightest pixel, {method:?}"), 0.0, most);
    }
}

fn hard_008_only_complex(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    for k in 0..100 {
        let at = v(10.0 * f64::from(k % 10), 10.0 * f64::from(k / 10), 0.0);
        model.place("quad", level([-0.05, 0.05], [-0.05, 0.05], 0.0, true), grey(0.5), at);
    }
    model.point_light(1000.0, v(45., 45., 20.));
    let scene = model.finish();
    let r_thresh = Some(0.3);
    let prepared = prepare(&scene, Settings { r_thresh, patch_size: Some(0.1), ..Settings::default() }).unwrap();
    out.exact("triangles of the simplified scene", 0.0, prepared.far.as_ref().unwrap().geometry.triangles.len() as f64);
    let camera = look_at(&scene, v(45., 45., 0.), DVec3::Z, 30.0, 50.0);
    let sum = |prepared: &gsii::pipeline::Prepared| -> f64 {
        image(prepared, &camera, [256, 256], 16, 1).pixels().map(|p| Part::All.of(p)[0]).sum()
    };
    let (hybrid, traced) = (sum(&prepared), sum(&prepare(&scene, mcpt()).unwrap()));
    out.holds("there is light", traced > 0.0 && hybrid.is_finite());
    // The quads lie in one plane: no light goes from one to another, and both methods use the same random numbers.
    out.exact("GSII over path tracing", case.values("/gsii_equals_mcpt")[0], hybrid / traced);
}

fn hard_009_open_scene(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("square", level([0., 1.], [0., 1.], 0.0, true), grey(0.5));
    model.sun(1.0, -DVec3::Z);
    let room = Room::new(model.finish());
    let rel = case.tolerance("/rel");
    let measured = over_seeds(|seed| {
        let params = RadiosityParams { patch_size: 0.5, direct: DirectLight::Gather, ..one_patch(1e-3, seed) };
        let solution = room.solve(&params).unwrap();
        let b = room.mean(&solution, "square");
        vec![b, solution.ledger.escaped[0] / b]
    });
    let expected = case.values("/B")[0];
    out.mean("B", expected, measured[0], rel * expected);
    let escaped = case.values("/escaped_fraction")[0];
    out.mean("escaped share of what is reflected", escaped, measured[1], rel * escaped);
    let camera = [look_at(&room.scene, v(0.5, 0.5, 0.0), DVec3::Z, 1.0, 0.4)];
    let gsii = Settings { r_thresh: Some(0.1), patch_size: Some(0.5), ..Settings::default() };
    for (what, settings) in [("path tracing", mcpt()), ("GSII", gsii)] {
        let l = radiance(&room.scene, &settings, &camera, 64, Part::All)[0];
        out.mean(&format!("L by {what}"), expected / PI, l, rel * expected / PI);
    }
}

/// A box whose floor is a height field.
fn height_field_box() -> Triangles {
    const N: u32 = 64;
    let p = |i: u32, j: u32| {
        let edge = i == 0 || j == 0 || i == N || j == N;
        let z = if edge { 0.0 } else { 0.2 * f64::from(unit(hash_all(&[i, j]))) };
        v(f64::from(i) / f64::from(N), f64::from(j) / f64::from(N), z)
    };
    let cells = (0..N * N).map(|k| (k % N, k / N));
    let mut room: Triangles =
        cells.flat_map(|(i, j)| polygon(&[p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1)])).collect();
    // Walls share the field's edge vertices: a fan from a top corner, and the rest of the wall.
    for (a, b) in [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0))] {
        let at = |k: u32| {
            let mix = |from: u32, to: u32| from * (N - k) + to * k;
            p(mix(a.0, b.0), mix(a.1, b.1))
        };
        let top = |q: DVec3| v(q.x, q.y, 1.0);
        room.extend((0..N).map(|k| [at(k + 1), at(k), top(at(0))]));
        room.push([top(at(0)), top(at(N)), at(N)]);
    }
    room.extend(level([0., 1.], [0., 1.], 1.0, false));
    room
}

/// A box with one floor edge split into seven where the wall's is not.
fn t_junction_box() -> Triangles {
    let faces = box_faces(DVec3::ZERO, DVec3::ONE);
    let mut room: Triangles = faces[..4].iter().chain(&faces[5..]).flat_map(|q| polygon(q)).collect();
    let edge: Vec<DVec3> = (0..=7).map(|i| v(f64::from(i) / 7.0, 0.0, 0.0)).collect();
    let floor: Vec<DVec3> = edge.into_iter().chain([v(1., 1., 0.), v(0., 1., 0.)]).collect();
    room.extend(polygon(&floor).into_iter().filter(|[a, b, c]| (b - a).cross(c - a).length() > 0.0));
    room
}

/// Of many rays from inside a room, how many meet nothing: uniform ones, and ones at vertices and along edges.
fn misses(scene: &std::sync::Arc<Scene>, inside: DVec3, rays: u32) -> (u64, u64, u64) {
    const CHUNK: u32 = 1 << 14;
    let prepared = prepare(scene, mcpt()).unwrap();
    let origin = (inside - scene.centre).as_vec3();
    let count = |rays: &[Ray]| {
        let mut hits = vec![Hit::MISS; rays.len()];
        prepared.detailed.closest(rays, Visible::All, Coherence::Incoherent, &mut hits);
        hits.iter().filter(|h| !h.is_hit()).count() as u64
    };
    let uniform = (0..rays.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let ray = |i: u32| {
                let u = sobol(chunk * CHUNK + i, 0, 9);
                // From points around the middle, not always the same one.
                let from = origin + 0.05 * (glam::Vec3::new(u[2], u[3], u[2] * u[3]) - 0.5);
                Ray::new(from, uniform_sphere(glam::Vec2::new(u[0], u[1])))
            };
            count(&(0..CHUNK).map(ray).collect::<Vec<_>>())
        })
        .sum();
    let towards = |p: glam::Vec3| Ray::new(origin, (p - origin).normalize());
    let vertices: Vec<Ray> = scene.mesh.positions.iter().map(|p| towards(*p)).collect();
    let along_edge = |t: u32| {
        let corners = scene.mesh.corners(t);
        (0..3).flat_map(move |k| (0..=100).map(move |i| corners[k].lerp(corners[(k + 1) % 3], i as f32 / 100.0)))
    };
    let triangles = scene.mesh.triangles.len() as u32;
    let edges: u64 = (0..triangles).map(|t| count(&along_edge(t).map(towards).collect::<Vec<_>>())).sum();
    (uniform, count(&vertices), edges)
}

fn hard_010_closed_rooms(case: &Case, out: &mut Outcome<'_>) {
    const RAYS: u32 = 10_000_000;
    let cube: Triangles = box_faces(DVec3::ZERO, DVec3::ONE).iter().flat_map(|q| polygon(q)).collect();
    let rooms = [
        ("cube", cube, DVec3::splat(0.5)),
        ("sphere", flipped(sphere(DVec3::splat(0.5), 0.5, 6)), DVec3::splat(0.5)),
        ("height field", height_field_box(), v(0.5, 0.5, 0.6)),
        ("T-junctions", t_junction_box(), DVec3::splat(0.5)),
    ];
    for (what, triangles, inside) in rooms {
        let mut model = Model::new();
        model.add("room", triangles, grey(0.5));
        let (uniform, vertices, edges) = misses(&model.finish(), inside, RAYS);
        let expected = case.values("/misses")[0];
        if what == "T-junctions" {
            out.near(&format!("misses of {RAYS} rays, {what}"), expected, uniform as f64, 1e-6 * f64::from(RAYS));
        } else {
            out.exact(&format!("misses of {RAYS} rays, {what}"), expected, uniform as f64);
        }
        out.note(format!("{what}: {vertices} misses at vertices, {edges} along edges (101 rays each)."));
    }
}

fn hard_012_diced_walls(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE).iter().enumerate() {
        model.add(FACES[i], diced(*face, 100), glow(0.5, if i == 5 { 1.0 } else { 0.0 }));
    }
    let scene = model.finish();
    let params = simplify_params(0.1, 1.0 / (2.0 * PI), BoxFit::Flux);
    let result = simplify(&scene, &embree(), &params, &gsii::progress::Progress::silent()).unwrap();
    let normal = result.surfaces.iter().filter(|s| s.class == Class::Normal).count();
    out.exact("normal surfaces", case.values("/normal_surfaces")[0], normal as f64);
    let complex = result.surfaces.len() - normal;
    out.exact("complex surfaces", case.values("/complex_surfaces")[0], complex as f64);
    let settings = Settings { r_thresh: Some(0.1), patch_size: Some(0.1), radiosity_error: 0.1, ..Settings::default() };
    let h = irradiance_at(&model, 1.0, |_| 0.5, &[("z0", 0.505, 0.505)], &settings, 1 << 10, Part::All)[0];
    let expected = case.values("/H_floor_centre")[0];
    out.mean("H at the floor's centre by GSII", expected, h, case.tolerance("/rel") * expected);
}
