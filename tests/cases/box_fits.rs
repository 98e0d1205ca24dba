//! What the paper's fit makes of clusters whose hit fractions are known.

use std::f64::consts::PI;

use glam::{DVec3, Mat3};
use gsii::simplify::fit::{PaperFit, fit_paper1993};

use crate::Recipe;
use crate::kit::*;
use crate::report::{Case, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("GSII-005", gsii_005_solid_box),
    ("GSII-006", |c, o| fitted(c, o, &plates(0.02), 1, 100)),
    ("GSII-007", |c, o| fitted(c, o, &plates(0.0), 1, 100)),
    ("GSII-008", gsii_008_diagonal_sheet),
    ("GSII-009", gsii_009_sphere),
    ("GSII-010", gsii_010_twelve_spheres),
    ("GSII-016", |c, o| fitted(c, o, &two_boxes(), 2, 100)),
    ("GSII-017", gsii_017_checkerboard),
    ("GSII-022", gsii_022_lattice),
];

/// The fit of all of a model's triangles, in upright axes.
pub fn fit(model: &Model, resolution: u32, rays_along: u32) -> PaperFit {
    let scene = model.finish();
    let all: Vec<u32> = (0..scene.mesh.triangles.len() as u32).collect();
    fit_paper1993(&scene, &embree(), &all, Mat3::IDENTITY, resolution, rays_along, 3).unwrap()
}

/// Compares hit fractions, new lengths and patch reflectances with what the case has of them.
fn compare_fit(case: &Case, out: &mut Outcome<'_>, fit: &PaperFit, resolution: u32, [frac, length, rho]: [f64; 3]) {
    let has = |pointer: &str| case.expected.pointer(pointer).is_some();
    for face in 0..6 {
        let axis = ["yz", "xz", "xy"][face / 2];
        let pointer = if has("/frac") { format!("/frac/{}", FACES[face]) } else { format!("/frac_{axis}") };
        out.near(&format!("fraction of {}", FACES[face]), case.values(&pointer)[0], fit.frac[face], frac);
        let n = resolution as usize;
        let Some(rows) = case.expected.pointer(&format!("/rho_patch/{}", FACES[face])) else { continue };
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let what = format!("reflectance of {} patch {i} {j}", FACES[face]);
            match (rows[i][j].as_f64(), fit.reflectance[face][j * n + i]) {
                (Some(expected), Some(measured)) => {
                    // Reflectances are f32.
                    out.near(&what, f64::from(expected as f32), measured.x.into(), rho);
                }
                (None, measured) => out.holds(&format!("{what}: nothing hit"), measured.is_none()),
                (Some(_), None) => out.holds(&format!("{what}: something hit"), false),
            }
        }
    }
    for (axis, expected) in case.values("/new_lengths").into_iter().enumerate() {
        out.near(&format!("new length {axis}"), expected, fit.lengths[axis], length * expected.max(1e-9));
    }
}

fn fitted(case: &Case, out: &mut Outcome<'_>, model: &Model, resolution: u32, rays_along: u32) {
    let fit = fit(model, resolution, rays_along);
    // The two cases without a tolerance of their own for lengths have sqrt(f1 f2), twice half of one for fractions.
    let frac = case.tolerance("/frac_abs");
    let length = if case.id == "GSII-006" { case.tolerance("/length_rel") } else { frac / 0.75 };
    let rho = if case.id == "GSII-016" { case.tolerance("/rho_abs") } else { 1e-6 };
    compare_fit(case, out, &fit, resolution, [frac, length, rho]);
    if case.id == "GSII-007" {
        let size = glam::Vec3::new(1.0, 2.0, 1.5);
        out.holds("reported as vanished", fit.vanished(size));
        out.holds("the box keeps a thickness", fit.edges(size).min_element() > 0.0);
    }
}

fn gsii_005_solid_box(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    for face in &box_faces(DVec3::ZERO, v(1., 2., 3.)) {
        model.add("face", flipped(diced(*face, 10)), grey(0.4));
    }
    compare_fit(case, out, &fit(&model, 2, 8), 2, [0.0; 3]);
}

fn plates(thickness: f64) -> Model {
    let mut model = Model::new();
    for k in 0..5 {
        let x = f64::from(k) * (1.0 - thickness) / 4.0;
        let plate = if thickness > 0.0 {
            solid(v(x, 0., 0.), v(x + thickness, 2., 1.5))
        } else {
            polygon(&[v(x, 0., 0.), v(x, 2., 0.), v(x, 2., 1.5), v(x, 0., 1.5)])
        };
        model.add("plate", plate, grey(0.5));
    }
    model
}

fn gsii_008_diagonal_sheet(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("sheet", polygon(&[v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 1.), v(0., 1., 1.)]), grey(0.5));
    let frac = case.tolerance("/frac_abs");
    compare_fit(case, out, &fit(&model, 1, 100), 1, [frac, frac, 0.0]);
}

fn gsii_009_sphere(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("sphere", sphere(DVec3::ZERO, 0.5, 6), grey(0.5));
    let fit = fit(&model, 1, 320);
    let length = case.tolerance("/length_rel");
    compare_fit(case, out, &fit, 1, [case.tolerance("/frac_abs"), length, 0.0]);
    let l = fit.lengths;
    let surface = 2.0 * (l.x * l.y + l.y * l.z + l.z * l.x);
    out.relative("interception ratio", case.values("/interception_ratio")[0], surface / PI, 2.0 * length);
}

fn gsii_010_twelve_spheres(case: &Case, out: &mut Outcome<'_>) {
    #[rustfmt::skip]
    let centres = [
        [0.1782, 0.4948, 0.2472], [0.3564, 0.9897, 0.4944], [0.5347, 0.4845, 0.7416], [0.7129, 0.9794, 0.9888],
        [0.8911, 0.4742, 0.236], [0.0693, 0.9691, 0.4831], [0.2475, 0.4639, 0.7303], [0.4257, 0.9588, 0.9775],
        [0.604, 0.4536, 0.2247], [0.7822, 0.9485, 0.4719], [0.9604, 0.4433, 0.7191], [0.1386, 0.9381, 0.9663],
    ];
    let mut model = Model::new();
    for [x, y, z] in centres {
        model.add("sphere", sphere(v(x, y, z), 0.12, 5), grey(0.5));
    }
    compare_fit(case, out, &fit(&model, 1, 320), 1, [case.tolerance("/frac_abs"), case.tolerance("/length_rel"), 0.0]);
}

fn two_boxes() -> Model {
    let mut model = Model::new();
    model.add("dark", solid(DVec3::ZERO, v(1., 0.5, 1.)), grey(0.3));
    model.add("light", solid(v(0., 0.5, 0.), v(0.5, 1., 1.)), grey(0.9));
    model
}

fn gsii_017_checkerboard(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
        let (x, y) = (0.25 * f64::from(i), 0.25 * f64::from(j));
        let rho = if (i + j) % 2 == 0 { 0.8 } else { 0.2 };
        model.add("column", solid(v(x, y, 0.), v(x + 0.25, y + 0.25, 1.)), grey(rho));
    }
    compare_fit(case, out, &fit(&model, 4, 8), 4, [0.0; 3]);
}

fn gsii_022_lattice(case: &Case, out: &mut Outcome<'_>) {
    out.note("In the tight box of edge 3.8, scaled to the cell block.");
    let mut model = Model::new();
    for k in 0..64 {
        let at = v(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16));
        model.add("sphere", sphere(at, 0.4, 5), grey(0.5));
    }
    let mut fit = fit(&model, 1, 320);
    let scale = (3.8_f64 / 4.0).powi(2);
    fit.frac.iter_mut().for_each(|f| *f *= scale);
    // Lengths are fraction times edge.
    fit.lengths *= 3.8 / 4.0;
    compare_fit(case, out, &fit, 1, [case.tolerance("/frac_abs"), case.tolerance("/length_rel"), 0.0]);
}
