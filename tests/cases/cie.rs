//! CIE 171:2006, tests of light simulation programs.

use std::f64::consts::PI;

use glam::DVec3;
use gsii::pipeline::{Method, Settings};
use gsii::radiosity::{DirectLight, RadiosityParams};

use crate::Recipe;
use crate::direct_light::direct;
use crate::kit::*;
use crate::radiosity::irradiance_at;
use crate::report::{Case, Estimate, Outcome};
use crate::specular::slab;

pub const RECIPES: &[(&str, Recipe)] = &[
    ("CIE-001", cie_001_lambertian_source),
    ("CIE-002", |c, o| isotropic(c, o, 1000.0, 3.0, &TABLE_POINTS)),
    ("CIE-003", cie_003_area_source),
    ("CIE-004", cie_004_flux_in_a_black_room),
    ("CIE-005", |c, o| slab(c, o, 1.52, 0.006, &[0., 10., 20., 30., 40., 50., 60., 70., 80., 85.])),
    ("CIE-006", cie_006_diffuse_floor),
    ("CIE-007", cie_007_obstruction),
    ("CIE-008", cie_008_interreflection),
    ("CIE-009", |c, o| isotropic(c, o, 350.0, 2.4, &[[0., 0.], [1.2, 0.7], [3., 0.], [5., 4.]])),
];

const TABLE_POINTS: [[f64; 2]; 10] =
    [[0., 0.], [0.5, 0.], [1., 0.], [1.5, 0.], [0.5, 0.5], [1., 0.5], [1.5, 0.5], [1., 1.], [1.5, 1.], [1.5, 1.5]];

fn cie_001_lambertian_source(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    let h = 5e-4;
    model.place("lamp", level([-h, h], [-h, h], 0.0, false), glow(0.0, PI * 1e9), v(0., 0., 3.));
    let points = TABLE_POINTS.map(|[x, y]| (v(x, y, 0.), DVec3::Z));
    for (i, (e, expected)) in direct(&model, &points, 256).into_iter().zip(case.values("")).enumerate() {
        out.pixel(&format!("E at point {}", i + 1), expected, e);
    }
}

fn isotropic(case: &Case, out: &mut Outcome<'_>, intensity: f64, height: f64, points: &[[f64; 2]]) {
    let mut model = Model::new();
    model.point_light(intensity, v(0., 0., height));
    let points: Vec<_> = points.iter().map(|[x, y]| (v(*x, *y, 0.), DVec3::Z)).collect();
    for (i, (e, expected)) in direct(&model, &points, 16).into_iter().zip(case.values("")).enumerate() {
        let what = format!("E at point {}", i + 1);
        out.pixel(&what, expected, e);
        // There is no noise: the pixel covers 2e-5 of a metre.
        out.relative(&what, expected, e.mean, case.tolerance("/deterministic_rel"));
    }
}

/// Receivers on the wall y = 0 and on the floor (or the ceiling at 3), at x = 2.
fn wall(z: f64) -> (DVec3, DVec3) {
    (v(2., 0., z), DVec3::Y)
}

fn floor(y: f64) -> (DVec3, DVec3) {
    (v(2., y, 0.), DVec3::Z)
}

fn along(range: [f64; 8]) -> impl Iterator<Item = f64> {
    range.into_iter()
}

const EIGHT: [f64; 8] = [0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75];

fn cie_003_area_source(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lamp", level([1.5, 2.5], [1.5, 2.5], 3.0, false), glow(0.0, PI * 1000.0));
    let points: Vec<_> =
        [2.75, 2.25, 1.75, 1.25, 0.75, 0.25].map(wall).into_iter().chain(along(EIGHT).map(floor)).collect();
    for (i, (e, expected)) in direct(&model, &points, 1 << 11).into_iter().zip(case.values("")).enumerate() {
        out.pixel(&format!("E at point {}", i + 1), expected, e);
    }
}

fn cie_004_flux_in_a_black_room(case: &Case, out: &mut Outcome<'_>) {
    const RHO: f64 = 0.001;
    let mut model = closed_box(v(4., 4., 3.), [RHO; 6], [0.0; 6]);
    model.point_light(10_000.0 / (4.0 * PI), v(2., 2., 1.5));
    let room = Room::new(model.finish());
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        let fluxes = over_seeds(|seed| {
            let params =
                RadiosityParams { direct, unshot: 0.5, ambient: false, patch_size: 0.25, ..one_patch(0.05, seed) };
            let solution = room.solve(&params).unwrap();
            let flux = |f: &&str| room.area(&room.triangles(f)) * room.mean(&solution, f) / RHO;
            let faces: Vec<f64> = FACES.iter().map(flux).collect();
            faces.iter().copied().chain([faces.iter().sum()]).collect()
        });
        for (i, expected) in case.values("").into_iter().enumerate() {
            let what = format!("flux on {}, {direct:?}", FACES[i]);
            out.mean(&what, expected, fluxes[i], case.tolerance("/face_rel") * expected);
        }
        out.mean(&format!("total flux, {direct:?}"), 10_000.0, fluxes[6], case.tolerance("/total_rel") * 10_000.0);
    }
}

/// Indirect irradiance at receivers so small that they throw no shadow to speak of, each alone with `model`.
pub fn indirect(model: &Model, points: &[(DVec3, DVec3)], settings: &Settings, trials: u32) -> Vec<Estimate> {
    let at = |&(point, normal): &(DVec3, DVec3)| {
        let mut model = model.clone();
        receiver(&mut model, point, normal, 1e-3);
        let scene = model.finish();
        let camera = look_at(&scene, point, normal, 5e-4, 1e-5);
        irradiance(radiance(&scene, settings, &[camera], trials, Part::Indirect)[0])
    };
    points.iter().map(at).collect()
}

fn pmm(patch_size: f32) -> Settings {
    Settings { method: Method::Pmm, patch_size: Some(patch_size), radiosity_error: 0.01, ..Settings::default() }
}

fn cie_006_diffuse_floor(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("floor", level([0., 4.], [0., 4.], 0.0, true), grey(0.3));
    model.sun(1.0, -DVec3::Z);
    let ceiling = |y: f64| (v(2., y, 3.), -DVec3::Z);
    let points: Vec<_> =
        [0.75, 1.25, 1.75, 2.25, 2.75].map(wall).into_iter().chain(along(EIGHT).map(ceiling)).collect();
    for (method, settings) in [("path tracing", mcpt()), ("PMM", pmm(0.5))] {
        let measured = indirect(&model, &points, &settings, 1 << 14);
        for (i, (e, expected)) in measured.into_iter().zip(case.values("")).enumerate() {
            let e = e.times(100.0 / 0.3);
            out.mean(
                &format!("100 E / (E_hz rho) at point {}, {method}", i + 1),
                expected,
                e,
                case.tolerance("/rel") * expected,
            );
        }
    }
}

/// The wall at y = 4, lit aslant over the obstruction, so that it is evenly lit.
pub fn obstructed_wall(obstruction: impl FnOnce(&mut Model)) -> Model {
    let mut model = Model::new();
    model.add("S2", polygon(&[v(4., 4., 0.), v(0., 4., 0.), v(0., 4., 3.), v(4., 4., 3.)]), grey(0.6));
    obstruction(&mut model);
    model.sun(2_f64.sqrt(), v(0., 1., -1.));
    model
}

/// Measures the case at its points with a method.
pub fn behind_obstruction(case: &Case, out: &mut Outcome<'_>, model: &Model, what: &str, settings: &Settings) {
    let points: Vec<_> = [2.75, 2.25, 1.75, 1.25, 0.75, 0.25]
        .map(wall)
        .into_iter()
        .chain([0.25, 0.75, 1.25, 1.75, 2.25].map(floor))
        .collect();
    let measured = indirect(model, &points, settings, 1 << 15);
    for (i, (e, expected)) in measured.into_iter().zip(case.values("")).enumerate() {
        let e = e.times(100.0 / 0.6);
        let what = format!("100 E / (E_v rho) at point {}, {what}", i + 1);
        let allowed = if expected == 0.0 { case.tolerance("/zero_abs") } else { case.tolerance("/rel") * expected };
        out.mean(&what, expected, e, allowed);
    }
}

fn cie_007_obstruction(case: &Case, out: &mut Outcome<'_>) {
    let model = obstructed_wall(|m| {
        m.add("box", solid(v(0., 2.5, 0.), v(4., 2.7, 1.)), grey(0.0));
    });
    for (method, settings) in [("path tracing", mcpt()), ("PMM", pmm(0.5))] {
        behind_obstruction(case, out, &model, method, &settings);
    }
}

fn cie_008_interreflection(case: &Case, out: &mut Outcome<'_>) {
    let mut model = closed_box(DVec3::splat(4.0), [0.5; 6], [0.0; 6]);
    model.point_light(10_000.0 / (4.0 * PI), DVec3::splat(2.0));
    let points = [("z0", 2., 2.), ("z0", 2., 0.25), ("z0", 0.25, 0.25), ("z0", 1., 1.)];
    let h = irradiance_at(&model, 4.0, |_| 0.5, &points, &mcpt(), 1 << 13, Part::Indirect);
    for ((point, h), expected) in points.iter().zip(h).zip(case.values("/H_indirect")) {
        out.pixel(&format!("indirect H at {point:?} by path tracing"), expected, h);
    }
}
