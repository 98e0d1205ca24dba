//! Numerically hard scenes that have no number of their own among the reference cases: what must not change, leak, vanish or break.

#[allow(dead_code, reason = "the reference cases use all of it")]
#[path = "cases/kit.rs"]
mod kit;
#[allow(dead_code, reason = "the reference cases use all of it")]
#[path = "cases/report.rs"]
mod report;

use std::f64::consts::PI;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use gsii::backend::edge::settle_edges;
use gsii::backend::obvhs::ObvhsBackend;
use gsii::backend::{Coherence, Hit, Part, PartKind, Ray, RayBackend, TriangleSet, Visible};
use gsii::pipeline::{Method, Settings};
use gsii::progress::Progress;
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::render::film::PixelSum;
use gsii::render::{RenderParams, bias, render};
use gsii::sampling::{hash_all, uniform_sphere, unit};
use gsii::scene::{Material, MeshData};
use gsii::shading::SurfacePoint;
use kit::{Part as Seen, *};

/// Four standard errors: a false alarm in 16 000 comparisons.
const SIGMA: f64 = 4.0;

/// A cube whose walls shine and reflect half: radiosity 2 everywhere, without a tolerance for the shape of its triangles.
fn furnace() -> Model {
    closed_box(DVec3::ONE, [0.5; 6], [1.0; 6])
}

fn corner(points: &[[f64; 3]]) -> Vec<DVec3> {
    points.iter().map(|p| DVec3::from_array(*p)).collect()
}

/// Fixed sampling.
fn fixed([width, height]: [u32; 2], trials: u32) -> RenderParams {
    RenderParams {
        width,
        height,
        min_trials: trials,
        max_trials: trials,
        interpolate: false,
        region: None,
        hires_error: 1.0,
        lores_error: 1.0,
        time_limit: None,
        features: false,
        seed: 1,
        frame: None,
    }
}

/// Darkest and brightest value of an image and its mean, first band.
fn range(film: &gsii::render::film::Film) -> [f64; 3] {
    let values: Vec<f64> = film.pixels().map(|p| Seen::All.of(p)[0]).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        mean,
    ]
}

#[test]
fn what_is_no_surface_changes_nothing() {
    let clean = furnace();
    // A1: two equal corners, three corners in a line. A5: a wall there a second time, of another reflectance.
    let mut spoilt = clean.clone();
    let degenerate = (0..100).flat_map(|i| {
        let at = |k: f64| v(0.5 + 1e-3 * f64::from(i), 0.25 * k, 0.0);
        [[at(0.0), at(1.0), at(0.0)], [at(0.0), at(1.0), at(2.0)]]
    });
    spoilt.add("degenerate", degenerate.collect(), grey(0.9));
    spoilt.add("again", polygon(&box_faces(DVec3::ZERO, DVec3::ONE)[2]), grey(0.9));
    let [clean, spoilt] = [clean, spoilt].map(|m| Room::new(m.finish()));
    let notes = &spoilt.scene.notes;
    assert_eq!((notes.degenerate_triangles, notes.duplicate_triangles), (200, 2));
    let [a, b] = [&clean, &spoilt].map(|room| {
        let solution = room.solve(&one_patch(0.05, 1)).unwrap();
        (FACES.map(|f| room.mean(&solution, f).to_bits()), solution.ledger.emitted.map(f64::to_bits))
    });
    assert_eq!(a, b);
}

#[test]
fn mirrored_and_stretched_objects_keep_their_light() {
    // A8: every wall mirrored by its node; winding and facing follow.
    let mut model = Model::new();
    let plain = furnace();
    let material = model.0.add_material(glow(0.5, 1.0));
    for face in &box_faces(DVec3::ZERO, DVec3::ONE) {
        let positions = face.iter().map(|p| (*p * v(-1.0, 1.0, 1.0)).as_vec3()).collect();
        // The same order of corners: the mirror turns the winding, the importer turns it back.
        let data = MeshData { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..MeshData::default() };
        let mirror = DAffine3::from_scale(v(-1.0, 1.0, 1.0));
        // Mirrored data by a mirroring node: the room itself, inside out in the file.
        model.0.add_mesh("wall", flip(data), material, mirror).unwrap();
    }
    let [plain, mirrored] = [plain, model].map(|m| m.finish());
    for t in 0..plain.mesh.triangles.len() as u32 {
        assert_eq!(plain.mesh.normal(t), mirrored.mesh.normal(t), "triangle {t}");
    }
    // An emitting cube of edge 1 stretched to 1 x 2 x 3: the same radiance from a larger surface.
    let mut model = Model::new();
    let material = model.0.add_material(glow(0.0, 2.0));
    let cube = solid(DVec3::ZERO, DVec3::ONE);
    let data = MeshData {
        positions: cube.iter().flatten().map(|p| p.as_vec3()).collect(),
        triangles: (0..cube.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    };
    model.0.add_mesh("lamp", data, material, DAffine3::from_scale(v(1.0, 2.0, 3.0))).unwrap();
    let room = Room::new(model.finish());
    let flux = room.solve(&one_patch(0.1, 1)).unwrap().ledger.emitted[0];
    let expected = 2.0 * 22.0;
    assert!((flux - expected).abs() < 1e-5 * expected, "{flux}");
}

/// The same triangles, seen from behind.
fn flip(mut data: MeshData) -> MeshData {
    data.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    data
}

#[test]
fn walls_of_slivers_are_walls() {
    // A2: one wall a fan of 1000 triangles from a corner, another of strips down to a millionth of its width.
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE).iter().enumerate() {
        let [a, b, c, d] = *face;
        let wall = match i {
            4 => {
                let rim = (0..=500).map(|k| b.lerp(c, f64::from(k) / 500.0));
                let rim = rim.chain((1..=500).map(|k| c.lerp(d, f64::from(k) / 500.0)));
                polygon(&[a].into_iter().chain(rim).collect::<Vec<_>>())
            }
            5 => {
                let ends: Vec<f64> = [0.0].into_iter().chain((0..=20).map(|k| 0.5_f64.powi(20 - k))).collect();
                let strip = |w: &[f64]| polygon(&[a.lerp(b, w[0]), a.lerp(b, w[1]), d.lerp(c, w[1]), d.lerp(c, w[0])]);
                ends.windows(2).flat_map(strip).collect()
            }
            _ => polygon(face),
        };
        model.add(FACES[i], wall, glow(0.5, 1.0));
    }
    let scene = model.finish();
    let room = Room::new(scene.clone());
    let solution = room.solve(&one_patch(0.01, 1)).unwrap();
    // The corner of a strip may lie half a roundoff beside the edge of the next wall.
    assert!(solution.ledger.escaped[0] < 1e-6 * solution.ledger.emitted[0], "{:?}", solution.ledger);
    for face in FACES {
        assert!((room.mean(&solution, face) - 1.0).abs() < 0.01, "{face}");
    }
    let camera = [look_at(&scene, v(0.5, 0.5, 0.0), v(0.2, 0.1, 1.0), 0.5, 0.3)];
    let seen = radiance_of(&scene, &mcpt(), &camera, [8, 8], 64, Seen::All)[0].times(PI);
    assert!((seen.mean - 2.0).abs() < SIGMA * seen.error + 1e-3, "{seen:?}");
}

#[test]
fn hidden_light_stays_hidden() {
    // A9: a lamp in a box in a box, a millimetre above the floor of a dark room; and a room that the hidden boxes must not slow down.
    let boxes = |room: [f64; 6], lamp: f64| {
        let mut model = closed_box(DVec3::ONE, [0.5; 6], room);
        model.add("outer", solid(v(0.3, 0.3, 1e-3), v(0.7, 0.7, 0.4)), grey(0.5));
        model.add("inner", solid(v(0.4, 0.4, 0.1), v(0.6, 0.6, 0.3)), glow(0.5, lamp));
        Room::new(model.finish())
    };
    let hidden = boxes([0.0; 6], 1.0);
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        let params = RadiosityParams { direct, ..one_patch(0.02, 1) };
        let solution = hidden.solve(&params).unwrap();
        for face in FACES {
            assert_eq!(hidden.mean(&solution, face), 0.0, "{face} {direct:?}");
        }
        let lit = boxes([0., 0., 0., 0., 0., 1.], 0.0);
        let mut empty = closed_box(DVec3::ONE, [0.5; 6], [0., 0., 0., 0., 0., 1.]);
        empty.add("outer", solid(v(0.3, 0.3, 1e-3), v(0.7, 0.7, 0.4)), grey(0.5));
        let empty = Room::new(empty.finish());
        let [a, b] = [&lit, &empty].map(|room| room.solve(&params).unwrap());
        for face in FACES {
            let (a, b) = (lit.mean(&a, face), empty.mean(&b, face));
            // Both have the relative error asked for.
            assert!((a - b).abs() < SIGMA * 0.02 * 2_f64.sqrt() * b, "{face} {direct:?}: {a} {b}");
        }
        assert!(a.rays < 2 * b.rays, "{} rays for {}", a.rays, b.rays);
    }
}

/// A room with a lamp and some furniture, moved: by the node, or in the coordinates themselves.
fn furnished(by_node: DVec3, baked: DVec3) -> Model {
    let mut model = Model::new();
    let mut add = |name: &str, triangles: Triangles, material: Material| {
        let triangles = triangles.into_iter().map(|t| t.map(|p| p + baked)).collect();
        model.place(name, triangles, material, by_node);
    };
    for (i, face) in box_faces(DVec3::ZERO, v(6., 4., 3.)).iter().enumerate() {
        add(FACES[i], polygon(face), grey(0.7));
    }
    add("lamp", solid(v(2., 1.5, 2.5), v(4., 2.5, 2.75)), glow(0.0, 10.0));
    add("table", solid(v(2., 1., 0.5), v(3.5, 2., 0.75)), grey(0.5));
    for i in 0..16 {
        let at = v(2.0 + 0.25 * f64::from(i % 4), 1.0 + 0.25 * f64::from(i / 4), 0.75);
        add("block", solid(at, at + 0.125), grey(0.3));
    }
    model
}

#[test]
fn scenes_far_from_the_origin() {
    let far = v(2_f64.powi(20), 0.0, 2_f64.powi(20));
    let film = |scene: &std::sync::Arc<gsii::scene::Scene>, method: Method| {
        let settings = Settings { method, r_thresh: Some(0.5), patch_size: Some(0.5), ..Settings::default() };
        let prepared = prepare(scene, settings).unwrap();
        let camera = look_at(scene, scene.centre, v(0.2, -1.0, 0.4), 1.5, 1.0);
        image(&prepared, &camera, [24, 16], 16, 1)
    };
    let values = |film: &gsii::render::film::Film| film.pixels().map(|p| Seen::All.of(p)).collect::<Vec<_>>();
    // B2: moved by the node it is the same scene, bit for bit.
    let [near, moved] = [DVec3::ZERO, far].map(|by| furnished(by, DVec3::ZERO).finish());
    for method in [Method::Gsii, Method::Mcpt] {
        let [a, b] = [&near, &moved].map(|scene| values(&film(scene, method)));
        assert!(a.iter().any(|v| v[0] > 0.0));
        assert_eq!(a, b, "{method:?}");
        // Baked in, f32 leaves steps of 1/8: everything here is a multiple of that, so that nothing is lost, either.
        let baked = furnished(DVec3::ZERO, far).finish();
        assert_eq!(values(&film(&baked, method)), a, "{method:?}, baked");
    }
    // Where it is no multiple of the steps, walls move by up to half of one; light stays finite and inside.
    let crooked = furnished(DVec3::ZERO, far + 0.3).finish();
    for method in [Method::Gsii, Method::Mcpt] {
        let [low, high, mean] = range(&film(&crooked, method));
        assert!(low >= 0.0 && high.is_finite() && mean > 0.0, "{method:?}: {low} {high} {mean}");
    }
}

#[test]
fn small_things_in_huge_halls() {
    // B3: a pencil of a millimetre on a desk, by a lamp, in the open and in a black hall of a kilometre. Binary fractions, so that
    // both are the same in f32.
    const MILLIMETRE: f64 = 1.0 / 1024.0;
    let desk = |hall: bool| {
        let mut model = Model::new();
        model.add("desk", level([-0.5, 0.5], [-0.5, 0.5], 0.0, true), grey(0.5));
        model.add("pencil", solid(v(-0.125, 0.0, 0.0), v(0.125, MILLIMETRE, MILLIMETRE)), grey(0.8));
        model.add("lamp", level([-0.125, 0.125], [0.25, 0.5], 0.5, false), glow(0.0, 10.0));
        if hall {
            let black: Triangles =
                box_faces(DVec3::splat(-512.0), DVec3::splat(512.0)).iter().flat_map(|f| polygon(f)).collect();
            model.add("hall", black, grey(0.0));
        }
        model.finish()
    };
    let cameras = |scene: &gsii::scene::Scene| {
        // The pencil's top, its shadow beside it, and the desk where it lies in the light.
        [v(0.0, 0.5 * MILLIMETRE, MILLIMETRE), v(0.0, -0.25 * MILLIMETRE, 0.0), v(0.25, 0.25, 0.0)]
            .map(|p| look_at(scene, p, DVec3::Z, 0.125, 0.125 * MILLIMETRE))
            .to_vec()
    };
    let gsii = Settings { r_thresh: Some(0.1), patch_size: Some(0.1), ..Settings::default() };
    for (what, settings) in [("path tracing", mcpt()), ("GSII", gsii)] {
        let [open, hall] = [false, true].map(|hall| {
            let scene = desk(hall);
            radiance_of(&scene, &settings, &cameras(&scene), [4, 4], 256, Seen::All)
        });
        for (place, (a, b)) in ["pencil", "shadow", "desk"].iter().zip(open.into_iter().zip(hall)) {
            let error = a.error.hypot(b.error);
            println!("{what}, {place}: {a:?} {b:?}");
            assert!(a.mean > 0.0, "{what}, {place}");
            assert!((a.mean - b.mean).abs() < SIGMA * error + 1e-4 * a.mean, "{what}, {place}: {a:?} {b:?}");
        }
    }
}

#[test]
fn floors_seen_at_a_grazing_angle_have_no_specks() {
    // B5: a ten-thousandth of a radian above a floor of 100 m, lit by a sun as low.
    let mut model = Model::new();
    model.add("floor", level([0., 100.], [-50., 50.], 0.0, true), grey(0.5));
    let slope = 1e-4_f64;
    model.sun(1.0, v(1.0, 0.0, -slope));
    let scene = model.finish();
    let camera = look_at(&scene, v(50., 0., 0.), v(-1.0, 0.3, slope), 40.0, 1e-3);
    let prepared = prepare(&scene, mcpt()).unwrap();
    let film = image(&prepared, &camera, [256, 4], 64, 1);
    let [low, high, _] = range(&film);
    let expected = 0.5 / PI * slope / slope.hypot(1.0);
    // The sun's direction is f32: its slope is right to a few units in the last place of one.
    assert!(
        (low - expected).abs() < 0.01 * expected && high - low < 1e-3 * expected,
        "{low} .. {high}, not {expected}"
    );
}

/// A triangle whose coordinates spread over 16 decades.
fn wild_triangle(seed: u32) -> [Vec3; 3] {
    let random = |what: u32, vertex: usize, axis: usize| unit(hash_all(&[what, seed, vertex as u32, axis as u32]));
    std::array::from_fn(|vertex| {
        Vec3::from_array(std::array::from_fn(|axis| {
            let size = 10.0_f32.powf(-8.0 + 16.0 * random(1, vertex, axis));
            if random(2, vertex, axis) < 0.5 { -size } else { size }
        }))
    })
}

/// After pbrt's test of the same name (pbrt 4ed 6.8): no ray hits the triangle that it leaves, in either library.
#[test]
fn reintersect() {
    let backends: [&dyn RayBackend; 2] = [&embree(), &ObvhsBackend];
    let parts = [Part { triangles: 0..1, kind: PartKind::Opaque }];
    let (mut rays_traced, mut own) = (0, [0; 2]);
    for seed in 0..1000 {
        let corners = wild_triangle(seed);
        let set = TriangleSet { positions: &corners, triangles: &[[0, 1, 2]], parts: &parts, filter: None };
        let random = |what: u32, k: u32| unit(hash_all(&[what, seed, k]));
        let rays: Vec<Ray> = (0..1000)
            .map(|k| {
                let (r, s) = (random(3, k).sqrt(), random(4, k));
                let point = SurfacePoint::flat(corners, 0, 1.0 - r, s * r);
                let mut direction = uniform_sphere(Vec2::new(random(5, k), random(6, k)));
                if k % 4 == 0 {
                    // Almost in the plane: there the sign of what decides is in doubt.
                    let n = point.geometric_normal;
                    direction = (direction - n * n.dot(direction) + 1e-6 * (random(7, k) - 0.5) * n).normalize();
                }
                Ray::new(point.ray_origin(direction), direction)
            })
            .collect();
        for (backend, own) in backends.iter().zip(&mut own) {
            let scene = backend.build(&set).unwrap();
            let mut hits = vec![Hit::MISS; rays.len()];
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                scene.closest(&rays, Visible::All, coherence, &mut hits);
                *own += hits.iter().filter(|h| h.is_hit()).count();
            }
        }
        rays_traced += rays.len();
    }
    assert_eq!((rays_traced, own), (1_000_000, [0, 0]));
}

#[test]
fn large_and_small_numbers_add_up() {
    // B6: in f32 all of the small ones would be lost.
    let mut sum = PixelSum::default();
    sum.add(Vec3::splat(1e8), true);
    (0..10_000).for_each(|i| sum.add(Vec3::ONE, i % 2 == 0));
    assert!((sum.mean()[0] - (1e8 + 1e4) / 10_001.0).abs() < 1e-6);
}

#[test]
fn cameras_inside_of_clutter() {
    // D5: in the middle of white blocks in a furnace, radiance is 2 / pi wherever one looks.
    let mut model = furnace();
    let blocks = (0..1000).flat_map(|k| {
        let at = 0.4 + 0.02 * v(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100));
        solid(at, at + 0.01)
    });
    model.add("clutter", blocks.collect(), grey(1.0));
    let scene = model.finish();
    let settings =
        Settings { r_thresh: Some(0.3), patch_size: Some(0.25), radiosity_error: 0.02, ..Settings::default() };
    let cameras: Vec<_> = [v(1.0, 0.2, 0.1), v(-0.3, 0.1, 1.0), v(0.2, -1.0, 0.3)]
        .map(|towards| look_at(&scene, v(0.495, 0.495, 0.495), towards, 1e-3, 4e-3))
        .to_vec();
    for (i, seen) in radiance_of(&scene, &mcpt(), &cameras, [8, 8], 512, Seen::All).into_iter().enumerate() {
        println!("mcpt view {i}: {:?}", seen.times(PI));
    }
    for (i, seen) in radiance_of(&scene, &settings, &cameras, [8, 8], 64, Seen::All).into_iter().enumerate() {
        let seen = seen.times(PI);
        println!("view {i}: {seen:?}");
        assert!((seen.mean - 2.0).abs() < SIGMA * seen.error + 1e-3, "view {i}: {seen:?}");
    }
}

#[test]
fn clutter_through_a_wall_carries_no_light_through_it() {
    // D7: rods that stick through the wall between a lit and a dark room. Their box lies in both rooms.
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, v(4., 2., 2.)).iter().enumerate() {
        model.add(FACES[i], polygon(face), grey(0.7));
    }
    model.add("wall", polygon(&corner(&[[2., 0., 0.], [2., 2., 0.], [2., 2., 2.], [2., 0., 2.]])), grey(0.7));
    model.add("lamp", level([0.5, 1.5], [0.5, 1.5], 1.99, false), glow(0.0, 10.0));
    for k in 0..64 {
        let at = v(1.8, 0.8 + 0.05 * f64::from(k % 8), 0.8 + 0.05 * f64::from(k / 8));
        model.add("rod", solid(at, at + v(0.4, 0.02, 0.02)), grey(0.7));
    }
    let scene = model.finish();
    let settings = Settings { r_thresh: Some(0.5), patch_size: Some(0.25), ..Settings::default() };
    let prepared = prepare(&scene, settings).unwrap();
    let camera = look_at(&scene, v(3., 1., 0.), DVec3::Z, 1.0, 0.9);
    let [_, high, _] = range(&image(&prepared, &camera, [16, 16], 64, 1));
    assert_eq!(high, 0.0);
}

#[test]
fn bright_cards_are_kept_or_reported() {
    // D12: a white card too small to count, in a beam of its own: its light is most of what reaches the wall beside it.
    let mut model = closed_box(v(4., 4., 3.), [0.3; 6], [0.0; 6]);
    model.add("card", level([2.0, 2.1], [2.0, 2.1], 1.0, true), grey(0.9));
    let cos = |degrees: f64| degrees.to_radians().cos() as f32;
    let kind = gsii::scene::LightKind::Spot {
        position: Vec3::new(2.05, 2.05, 2.5),
        direction: Vec3::NEG_Z,
        cos_inner: cos(1.0),
        cos_outer: cos(2.0),
    };
    model.light(Vec3::splat(1000.0), kind);
    let scene = model.finish();
    let settings = Settings { r_thresh: Some(1.0), ..Settings::default() };
    let camera = look_at(&scene, v(2., 2., 3.), -DVec3::Z, 1.0, 1.0);
    let mean = |settings: Settings| {
        let prepared = prepare(&scene, settings).unwrap();
        let films = (0..8).map(|seed| range(&image(&prepared, &camera, [16, 16], 32, seed))[2]).collect::<Vec<_>>();
        (report::Estimate::of(&films), prepared)
    };
    let (hybrid, prepared) = mean(settings);
    let (traced, _) = mean(mcpt());
    let meter = bias::measure(&prepared.world(), &camera, &RenderParams { seed: 7, ..fixed([16, 16], 1) }, 1 << 16);
    let off = hybrid.mean - traced.mean;
    let explained = meter.mean[0];
    let error = hybrid.error.hypot(traced.error).hypot(meter.standard_error[0]);
    println!("GSII {hybrid:?}, path tracing {traced:?}, bias meter {explained} +- {}", meter.standard_error[0]);
    assert!((off - explained).abs() < SIGMA * error, "off by {off}, reported {explained} +- {error}");
}

#[test]
fn numbers_beyond_f32_are_dropped_and_counted() {
    // A lamp of the largest radiance: what it lights is infinite in some trials, and those are left out.
    let mut model = closed_box(DVec3::ONE, [0.5; 6], [0.0; 6]);
    model.add("lamp", level([0.4, 0.6], [0.4, 0.6], 0.9, false), Material::emitter(Vec3::splat(3e38), Vec3::ZERO));
    let scene = model.finish();
    for method in [Method::Gsii, Method::Pmm, Method::Mcpt] {
        let settings = Settings { method, patch_size: Some(0.5), r_thresh: Some(0.3), ..Settings::default() };
        let prepared = prepare(&scene, settings).unwrap();
        let camera = look_at(&scene, v(0.5, 0.5, 0.0), DVec3::Z, 0.8, 0.5);
        let film = render(&prepared.world(), &camera, &fixed([16, 16], 16), &Progress::silent()).film;
        let dropped: u64 = film.tiles.iter().map(|t| t.dropped).sum();
        assert!(film.pixels().all(|p| Seen::All.of(p).iter().all(|x| x.is_finite())), "{method:?}");
        println!("{method:?}: {dropped} trials dropped");
    }
}

/// From inside closed meshes, rays straight at their vertices: robust tests of single triangles may all decide against a ray through a
/// corner. How many do is printed; when edges and misses are settled as in rendering, hardly any may be lost.
#[test]
fn rays_at_vertices() {
    let backends: [(&str, &dyn RayBackend); 2] = [("Embree", &embree()), ("obvhs", &ObvhsBackend)];
    let (mut lost, mut left) = ([0; 2], [0; 2]);
    let mut rays_traced = 0;
    for (seed, levels) in [(1, 2), (2, 4), (3, 6)] {
        let mesh: Triangles = sphere(DVec3::ZERO, 1.0, levels);
        // A dented ball: no symmetries, corners of every angle.
        let dented = |p: DVec3| {
            let key = p.to_array().map(|x| (x as f32).to_bits());
            p.as_vec3() * (0.7 + 0.3 * unit(hash_all(&[seed, key[0], key[1], key[2]])))
        };
        let positions: Vec<Vec3> = mesh.iter().flatten().map(|p| dented(*p)).collect();
        let triangles: Vec<[u32; 3]> = (0..mesh.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let parts = [Part { triangles: 0..mesh.len() as u32, kind: PartKind::Opaque }];
        let set = TriangleSet { positions: &positions, triangles: &triangles, parts: &parts, filter: None };
        let origins = (1_000_000 / positions.len() as u32).clamp(10, 1000);
        for (((_, backend), lost), left) in backends.iter().zip(&mut lost).zip(&mut left) {
            let scene = backend.build(&set).unwrap();
            for k in 0..origins {
                let origin = Vec3::from_array([0, 1, 2].map(|axis| 0.4 * unit(hash_all(&[seed, k, axis])) - 0.2));
                let rays: Vec<Ray> = positions.iter().map(|p| Ray::new(origin, (p - origin).normalize())).collect();
                let mut hits = vec![Hit::MISS; rays.len()];
                scene.closest(&rays, Visible::All, Coherence::Incoherent, &mut hits);
                rays_traced += rays.len();
                *lost += hits.iter().filter(|hit| !hit.is_hit()).count();
                // Batch by batch, as few of which would miss in rendering.
                let mut inside: Vec<Ray> = rays.iter().map(|ray| Ray::new(origin, ray.direction)).collect();
                inside.extend((0..64 * rays.len() as u32 / 50).map(|i| {
                    Ray::new(
                        origin,
                        uniform_sphere(Vec2::new(unit(hash_all(&[seed, i, 5])), unit(hash_all(&[seed, i, 6])))),
                    )
                }));
                let mut hits = vec![Hit::MISS; inside.len()];
                scene.closest(&inside, Visible::All, Coherence::Incoherent, &mut hits);
                settle_edges(scene.as_ref(), &mut inside, &mut hits);
                *left += hits.iter().filter(|hit| !hit.is_hit()).count();
            }
        }
    }
    for (((name, _), lost), left) in backends.iter().zip(lost).zip(left) {
        println!("{name}: {lost} of {} rays lost, {left} after settling", rays_traced / 2);
        // At worst the turned ray is as unlucky as the first: a binomial number, and five deviations.
        let again = lost as f64 * lost as f64 / (rays_traced / 2) as f64;
        assert!(
            left as f64 <= again + 5.0 * again.sqrt(),
            "{name}: {left} rays lost after settling, {again} by chance"
        );
    }
}

/// Traces at least `rays` rays in a dark room beside a lit one: view rays, paths of many reflections, and their shadow rays towards
/// light on the other side of the wall. The wall is thin or has no thickness, the lamp touches it, or is a point.
fn nothing_leaks(rays: u64) {
    let variants = [(1e-4, true), (1e-4, false), (0.0, true), (0.0, false)];
    for (thickness, ceiling) in variants {
        let mut model = Model::new();
        let x = 5.0 + thickness;
        for (name, x0, x1) in [("lit", 0.0, 5.0), ("dark", x, 10.0)] {
            for (i, face) in box_faces(v(x0, 0., 0.), v(x1, 5., 3.)).iter().enumerate() {
                if thickness > 0.0 || (name, i) != ("dark", 0) {
                    let e = if (name, i) == ("lit", 5) && ceiling { 1.0 } else { 0.0 };
                    model.add(name, polygon(face), glow(0.9, e));
                }
            }
        }
        if !ceiling {
            model.point_light(10.0, v(2.0, 2.0, 2.0));
        }
        let scene = model.finish();
        let prepared = prepare(&scene, mcpt()).unwrap();
        let camera = look_at(&scene, v(x, 2.5, 1.5), v(1.0, 0.1, 0.1), 4.0, 0.9);
        let (mut traced, mut seed) = (0, 0);
        while traced < rays.div_ceil(variants.len() as u64) {
            let params = RenderParams { seed, ..fixed([64, 64], 32) };
            let rendering = render(&prepared.world(), &camera, &params, &Progress::silent());
            let counts = rendering.rays;
            traced += counts.hires() + counts.lores();
            assert_eq!(range(&rendering.film)[1], 0.0, "thickness {thickness}, ceiling {ceiling}, seed {seed}");
            seed += 1;
        }
        println!("wall of {thickness}, {}: {traced} rays", if ceiling { "ceiling lamp" } else { "point light" });
    }
}

#[test]
fn a_million_rays_stay_in_their_room() {
    nothing_leaks(1_000_000);
}

#[test]
#[ignore = "takes minutes; its outcome is in docs/accuracy.md"]
fn a_hundred_million_rays_stay_in_their_room() {
    nothing_leaks(100_000_000);
}
