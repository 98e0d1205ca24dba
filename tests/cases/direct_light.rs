//! Direct light: irradiance at small receivers, as the HIRES pass finds it.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use gsii::scene::{LightKind, Material};

use crate::Recipe;
use crate::kit::*;
use crate::report::{Case, Estimate, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("DIR-001", |c, o| {
        let points = [
            (v(0., 0., 0.), DVec3::Z),
            (v(1., 0., 0.), DVec3::Z),
            (v(0., 0., 0.), DVec3::X),
            (v(0.25, 0., 0.), v(0.6, 0., 0.8)),
            (v(3., 3., 0.), DVec3::Z),
        ];
        under(c, o, square_lamp(0.5, 1.0), 1.0, &points);
    }),
    ("DIR-002", |c, o| {
        let lamp = facing(&[v(0., 0., 2.), v(0., 1., 2.5), v(1.5, 0., 3.)], DVec3::ZERO);
        under(c, o, lamp, 5.0, &[(v(0.2, 0.2, 0.), DVec3::Z), (v(1., 1., 0.), v(0.3, 0., 0.954))]);
    }),
    ("DIR-003", |c, o| ball_lamp(c, o, 1.0, 3.0, 0.0, 1.0)),
    ("DIR-004", |c, o| ball_lamp(c, o, 1.0, 2.0, 80.0, 1.0)),
    ("DIR-005", |c, o| ball_lamp(c, o, 1e-4, 10.0, 60.0, 1e6)),
    ("DIR-006", |c, o| under(c, o, disc(DVec3::Z, -DVec3::Z, 0.5, 256), 1.0, &[(v(0.3, 0.2, 0.), DVec3::Z)])),
    ("DIR-007", dir_007_soft_shadow),
    ("DIR-008", dir_008_shadow_edges),
    ("DIR-009", dir_009_hard_shadow),
    ("DIR-010", dir_010_half_covered),
    ("DIR-011", |c, o| grid_of_lights(c, o, 64, 3.0)),
    ("DIR-014", |c, o| grid_of_lights(c, o, 101, 1.5)),
    ("DIR-012", dir_012_grazing),
    ("DIR-013", dir_013_range),
];

fn square_lamp(half: f64, z: f64) -> Triangles {
    level([-half, half], [-half, half], z, false)
}

/// A black emitter of radiance `l`.
fn lamp_material(l: f64) -> Material {
    glow(0.0, PI * l)
}

/// Direct irradiance at small receivers, each alone with `model`.
pub fn direct(model: &Model, points: &[(DVec3, DVec3)], trials: u32) -> Vec<Estimate> {
    let at = |&(point, normal): &(DVec3, DVec3)| {
        let mut model = model.clone();
        receiver(&mut model, point, normal, 1e-2);
        let scene = model.finish();
        let camera = look_at(&scene, point, normal, 5e-3, 1e-5);
        irradiance(radiance(&scene, &mcpt(), &[camera], trials, Part::Direct)[0])
    };
    points.iter().map(at).collect()
}

fn under(case: &Case, out: &mut Outcome<'_>, lamp: Triangles, l: f64, points: &[(DVec3, DVec3)]) {
    let mut model = Model::new();
    model.add("lamp", lamp, lamp_material(l));
    for (i, (e, expected)) in direct(&model, points, 1 << 12).into_iter().zip(case.values("")).enumerate() {
        out.pixel(&format!("E at point {}", i + 1), expected, e);
    }
}

fn ball_lamp(case: &Case, out: &mut Outcome<'_>, radius: f64, distance: f64, degrees: f64, l: f64) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut model = Model::new();
    let centre = distance * v(sin, 0.0, cos);
    // Placed by its transform: vertices keep their digits however small the ball is.
    model.place("lamp", ball(DVec3::ZERO, radius, 5), lamp_material(l), centre);
    let e = direct(&model, &[(DVec3::ZERO, DVec3::Z)], 1 << 13)[0];
    out.pixel("E", case.value(), e);
}

fn dir_007_soft_shadow(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lamp", square_lamp(0.5, 2.0), lamp_material(1.0));
    model.add("blocker", level([-0.3, 0.3], [-0.3, 0.3], 1.0, true), grey(0.0));
    let points =
        [(0., 0.), (0.3, 0.), (0.6, 0.), (0.8, 0.1), (1.2, 0.), (2., 2.)].map(|(x, y)| (v(x, y, 0.), DVec3::Z));
    for (i, (e, expected)) in direct(&model, &points, 1 << 14).into_iter().zip(case.values("")).enumerate() {
        if expected == 0.0 {
            out.near("E in full shadow", 0.0, e.mean, case.tolerance("/zero_abs"));
        } else {
            out.pixel(&format!("E at point {}", i + 1), expected, e);
        }
    }
}

/// Half-widths of full and of any shadow along x on the floor, and the width of a pixel, from images with and without what
/// throws it.
fn shadow(lit: &Model, blocker: Triangles, trials: u32) -> [f64; 3] {
    const PIXELS: u32 = 400;
    let half = 2.0;
    let pixels = |model: &Model| -> Vec<f64> {
        let mut model = model.clone();
        model.add("floor", level([-3., 3.], [-3., 3.], 0.0, true), grey(0.5));
        let scene = model.finish();
        let mut camera = look_at(&scene, DVec3::ZERO, DVec3::Z, 0.5, half);
        if let gsii::scene::Projection::Orthographic { y_mag, .. } = &mut camera.projection {
            *y_mag = 1e-3;
        }
        let prepared = prepare(&scene, mcpt()).unwrap();
        image(&prepared, &camera, [PIXELS, 1], trials, 1).pixels().map(|p| Part::Direct.of(p)[0]).collect()
    };
    let open = pixels(lit);
    let mut blocked = lit.clone();
    blocked.add("blocker", blocker, grey(0.0));
    let share: Vec<f64> = pixels(&blocked).iter().zip(&open).map(|(b, o)| b / o).collect();
    let width = 2.0 * half / f64::from(PIXELS);
    let dark = share.iter().filter(|s| **s == 0.0).count() as f64;
    let shaded = share.iter().filter(|s| **s < 0.999).count() as f64;
    [0.5 * dark * width, 0.5 * shaded * width, width]
}

fn edges(case: &Case, out: &mut Outcome<'_>, [umbra, penumbra, pixel]: [f64; 3]) {
    out.note("Allowed: one pixel.");
    out.near("half-width of the umbra", case.values("/umbra_half")[0], umbra, pixel);
    out.near("half-width of the penumbra", case.values("/penumbra_half")[0], penumbra, pixel);
}

fn dir_008_shadow_edges(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lamp", square_lamp(0.25, 2.0), lamp_material(1.0));
    edges(case, out, shadow(&model, level([-0.5, 0.5], [-0.5, 0.5], 1.0, true), 4096));
}

fn dir_009_hard_shadow(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.point_light(1.0, v(0., 0., 3.));
    edges(case, out, shadow(&model, level([-0.25, 0.25], [-0.25, 0.25], 2.0, true), 256));
}

fn dir_010_half_covered(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lamp", square_lamp(0.5, 1.0), lamp_material(1.0));
    let point = [(DVec3::ZERO, DVec3::Z)];
    let open = direct(&model, &point, 1 << 13)[0];
    model.add("half-plane", level([-100., 0.], [-100., 100.], 0.5, true), grey(0.0));
    let covered = direct(&model, &point, 1 << 13)[0];
    out.mean("share of E", case.value(), covered.times(1.0 / open.mean), case.tolerance("/rel") * case.value());
}

fn grid_of_lights(case: &Case, out: &mut Outcome<'_>, k: u32, height: f64) {
    let mut model = Model::new();
    let step = 4.0 / f64::from(k);
    for i in 0..k * k {
        let (x, y) = (f64::from(i % k), f64::from(i / k));
        let at = v(-2.0 + step * (x + 0.5), -2.0 + step * (y + 0.5), height);
        model.point_light(100.0 / f64::from(k * k), at);
    }
    let e = direct(&model, &[(DVec3::ZERO, DVec3::Z)], 1 << 13)[0];
    out.pixel("E", case.value(), e);
}

fn dir_012_grazing(case: &Case, out: &mut Outcome<'_>) {
    for (degrees, expected) in [89_f64, 89.99].into_iter().zip(case.values("")) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut model = Model::new();
        model.add("floor", level([-50., 50.], [-50., 50.], 0.0, true), grey(0.5));
        model.sun(1.0, v(-sin, 0.0, -cos));
        let scene = model.finish();
        let camera = look_at(&scene, DVec3::ZERO, DVec3::Z, 1.0, 49.0);
        let prepared = prepare(&scene, mcpt()).unwrap();
        let film = image(&prepared, &camera, [64, 64], 16, 1);
        let pixels: Vec<f64> = film.pixels().map(|p| PI / 0.5 * Part::All.of(p)[0]).collect();
        let (least, most) = pixels.iter().fold((f64::MAX, 0.0_f64), |(a, b), &e| (a.min(e), b.max(e)));
        out.relative(&format!("darkest of 4096 pixels at {degrees} degrees"), expected, least, case.tolerance("/rel"));
        out.relative(&format!("brightest of 4096 pixels at {degrees} degrees"), expected, most, case.tolerance("/rel"));
    }
}

fn dir_013_range(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("floor", level([-1., 1.], [-1., 1.], 0.0, true), grey(0.5));
    for intensity in [Vec3::new(1e6, 0.0, 0.0), Vec3::new(0.0, 1e-6, 0.0)] {
        model.light(intensity, LightKind::Directional { direction: -Vec3::Z });
    }
    let scene = model.finish();
    let prepared = prepare(&scene, mcpt()).unwrap();
    let film = image(&prepared, &look_at(&scene, DVec3::ZERO, DVec3::Z, 1.0, 0.5), [1, 1], 1 << 14, 1);
    let [red, green, blue] = Part::All.of(film.pixels().next().unwrap()).map(|l| l * PI / 0.5);
    out.relative("red E", case.values("/E_red")[0], red, case.tolerance("/rel"));
    out.relative("green E", case.values("/E_green")[0], green, case.tolerance("/rel"));
    out.exact("blue E", case.values("/E_blue")[0], blue);
}
