//! Light that must arrive, and light that must not.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use gsii::pipeline::{Method, Settings};
use gsii::progress::Progress;
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::render::film::PixelSum;
use gsii::render::{RenderParams, bias, render};
use gsii::scene::Material;

use super::scenes::*;
use super::{SIGMA, fixed, range};
use crate::kit::*;
use crate::report::Estimate;

#[test]
fn hidden_light_stays_hidden() {
    // A9: a lamp in a box in a box, a millimetre above the floor of a dark room; and a room that the hidden boxes must not slow down.
    let hidden = Room::new(nested_boxes([0.0; 6], 1.0).finish());
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        let params = RadiosityParams { direct, ..one_patch(0.02, 1) };
        let solution = hidden.solve(&params).unwrap();
        for face in FACES {
            assert_eq!(hidden.mean(&solution, face), 0.0, "{face} {direct:?}");
        }
        let lit = Room::new(nested_boxes([0., 0., 0., 0., 0., 1.], 0.0).finish());
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
    let scene = furnace_with_blocks().finish();
    let settings =
        Settings { r_thresh: Some(0.3), patch_size: Some(0.25), radiosity_error: 0.02, ..Settings::default() };
    let cameras: Vec<_> = [v(1.0, 0.2, 0.1), v(-0.3, 0.1, 1.0), v(0.2, -1.0, 0.3)]
        .map(|towards| look_at(&scene, v(0.495, 0.495, 0.495), towards, 1e-3, 4e-3))
        .to_vec();
    for (i, seen) in radiance_of(&scene, &settings, &cameras, [8, 8], 64, Part::All).into_iter().enumerate() {
        let seen = seen.times(PI);
        println!("view {i}: {seen:?}");
        assert!((seen.mean - 2.0).abs() < SIGMA * seen.error + 1e-3, "view {i}: {seen:?}");
    }
}

#[test]
fn small_lamps_in_clutter_keep_their_light() {
    // D11: a lamp of a ten-thousandth below a pile of black blocks that is one equivalent box, in a black room. Lamp and distance are binary
    // fractions.
    let mut model = closed_box(DVec3::ONE, [0.0; 6], [0.0; 6]);
    let blocks = (0..1000).flat_map(|k| {
        let at = 0.4 + 0.02 * v(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100));
        solid(at, at + 0.01)
    });
    model.add("clutter", blocks.collect(), grey(0.0));
    let (half, height, floor) = (2_f64.powi(-14), 0.375, 2_f64.powi(-7));
    let exitance = 1e6;
    model.add("lamp", level([0.5 - half, 0.5 + half], [0.5 - half, 0.5 + half], height, false), glow(0.0, exitance));
    let point = v(0.5, 0.5, floor);
    receiver(&mut model, point, DVec3::Z, 1e-2);
    let scene = model.finish();
    let settings = Settings { r_thresh: Some(0.2), patch_size: Some(0.25), ..Settings::default() };
    let simplified = prepare(&scene, settings.clone()).unwrap().far.unwrap().simplified.unwrap();
    assert!(simplified.clusters.iter().any(|cluster| cluster.surfaces.len() >= 500), "a pile in one box");
    let size = 1e-4;
    let camera = [look_at(&scene, point, DVec3::Z, 0.1, size)];
    let seen = irradiance(radiance_of(&scene, &settings, &camera, [4, 4], 64, Part::All)[0]);
    let expected = exitance / PI * (2.0 * half).powi(2) / (height - floor).powi(2);
    // A lamp and a view of some width: a second of their squares' share of the distance; and sums in f32.
    let allowed = (2.0 * (half * half + size * size) / (height - floor).powi(2) + 1e-5) * expected;
    assert!((seen.mean - expected).abs() <= SIGMA * seen.error + allowed, "{seen:?}, not {expected}");
}

#[test]
fn clutter_through_a_wall_carries_no_light_through_it() {
    // D7.
    let scene = rods_through_a_wall().finish();
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
        (Estimate::of(&films), prepared)
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
        assert!(film.pixels().all(|p| Part::All.of(p).iter().all(|x| x.is_finite())), "{method:?}");
        println!("{method:?}: {dropped} trials dropped");
    }
}

#[test]
fn lamps_of_two_sides_do_not_shine_on_themselves() {
    // C7: a plane shade without thickness that shines to both sides and reflects, alone in the dark: rays that start on one side must not
    // meet it again. Its corners are binary fractions: rounded, it would not be plane, and would light itself a little.
    let mut model = Model::new();
    let shade = Material { double_sided: true, ..glow(0.9, 1.0) };
    model.add("shade", diced([v(0., 0., 0.), v(1., 0., 0.125), v(1., 1., 0.25), v(0., 1., 0.125)], 8), shade);
    let room = Room::new(model.finish());
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        // An end to the search for the relative error of what should be nothing.
        let params = RadiosityParams { direct, patch_size: 0.2, max_rays: 1 << 20, ..one_patch(0.1, 1) };
        let solution = room.solve(&params).unwrap();
        assert_eq!(room.mean(&solution, "shade"), 0.0, "{direct:?}: {:?}", solution.ledger);
        let both_sides = 2.0 * room.area(&room.triangles("shade"));
        let emitted = if direct == DirectLight::Shoot { both_sides } else { 0.0 };
        assert!((solution.ledger.emitted[0] - emitted).abs() < 1e-5 * both_sides, "{:?}", solution.ledger);
    }
    for towards in [DVec3::Z, -DVec3::Z] {
        let camera = [look_at(&room.scene, v(0.5, 0.5, 0.125), towards, 1.0, 0.2)];
        let [emitted, reflected, _] = all_parts(&room.scene, &mcpt(), &camera, [8, 8], 64)[0];
        assert!((emitted.mean - 1.0 / PI).abs() < 1e-6, "{emitted:?}");
        assert_eq!(reflected.mean, 0.0);
    }
}
