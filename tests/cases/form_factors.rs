//! Form factors: the share of the flux of one surface that one shot of the radiosity solver brings to another, and from points
//! by the irradiance that the renderer's direct light finds there.

use glam::{DVec3, Vec2};
use gsii::backend::{Coherence, Hit, Visible};
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::sampling::{hash_all, sobol};
use gsii::shading::SurfacePoint;

use rayon::prelude::*;

use crate::Recipe;
use crate::kit::*;
use crate::report::{Case, Estimate, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("FF-001", |_, o| shot(o, level(U, U, 0.0, true), level(U, U, 1.0, false))),
    ("FF-002", |_, o| shot(o, level([0., 2.], U, 0.0, true), level([0., 2.], U, 0.5, false))),
    ("FF-003", |_, o| shot(o, level(U, U, 0.0, true), level(U, U, 1.0 / 1024.0, false))),
    ("FF-004", |_, o| shot(o, level(U, U, 0.0, true), level(U, U, 1.0 / 1_048_576.0, false))),
    ("FF-005", |_, o| shot(o, level([0., 1024.], U, 0.0, true), level([0., 1024.], U, 1.0, false))),
    ("FF-006", ff_006_far),
    ("FF-007", |_, o| shot(o, level(U, U, 0.0, true), upright_wall(U, U))),
    ("FF-008", |_, o| shot(o, level([0., 1.0 / 1024.0], U, 0.0, true), upright_wall(U, U))),
    ("FF-009", |_, o| shot(o, level(U, [0., 1024.], 0.0, true), upright_wall([0., 1024.], U))),
    ("FF-010", |_, o| shot(o, level(U, U, 0.0, true), level([2., 3.], [1., 2.5], 0.7, false))),
    ("FF-011", |_, o| shot(o, level([0.1, 0.2], [0.1, 0.2], 0.0, true), level([0.1, 0.2], [0.1, 0.2], 0.05, false))),
    ("FF-012", |_, o| shot(o, level([0.5, 1.5], U, 0.0, true), upright_wall([0.25, 2.0], [0.1, 0.9]))),
    ("FF-013", |_, o| shot(o, level(U, U, 0.0, true), upright_wall([1., 2.], U))),
    ("FF-014", |_, o| shot(o, level(U, U, 0.0, true), hinged(120.0))),
    ("FF-015", |_, o| shot(o, level(U, U, 0.0, true), hinged(60.0))),
    ("FF-016", |_, o| shot(o, level(U, U, 0.0, true), hinged(10.0))),
    ("FF-017", |_, o| shot(o, level(U, U, 0.0, true), hinged(179.9))),
    ("FF-018", |_, o| shot(o, disc_up(1.0, 0.0), disc_down(1.0, 1.0))),
    ("FF-019", |_, o| shot(o, disc_up(0.5, 0.0), disc_down(2.0, 1.0))),
    ("FF-020", |_, o| shot(o, disc_up(1.0, 0.0), disc_down(1.0, 1.0 / 1024.0))),
    ("FF-044", |_, o| shot(o, disc_up(1.0, 0.0), disc_down(2.0, 50.0))),
    ("FF-021", |_, o| element(o, DVec3::ZERO, DVec3::Z, &[v(0., 0., 1.), v(0., 2., 1.), v(1., 2., 1.), v(1., 0., 1.)])),
    ("FF-022", |_, o| {
        element(o, v(0.5, 0.5, 0.), DVec3::Z, &[v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)])
    }),
    ("FF-023", |_, o| {
        element(o, DVec3::ZERO, v(0.6, 0., 0.8), &[v(-2., -1., 1.), v(1., -1., 1.), v(1., 1., 1.), v(-2., 1., 1.)])
    }),
    ("FF-024", |_, o| element_to(o, DVec3::ZERO, DVec3::Z, disc_down(1.0, 1.0), 1e-6)),
    ("FF-025", |_, o| element_to(o, DVec3::ZERO, DVec3::Y, disc_down(1.0, 1.0), 1e-6)),
    ("FF-026", |_, o| element_to_ball(o, 3.0, 30.0)),
    ("FF-027", |_, o| element_to_ball(o, 2.0, 80.0)),
    ("FF-028", |_, o| shot(o, ball(DVec3::ZERO, 0.5, 5), level([-1., 1.], [-1., 1.], 1.0, false))),
    ("FF-029", |_, o| shot(o, ball(v(0., 0., 1.), 0.5, 5), disc_up(1.0, 0.0))),
    ("FF-030", |_, o| shot(o, ball(DVec3::ZERO, 1.0, 5), ball(v(2., 0., 0.), 0.5, 5))),
    ("FF-031", |_, o| {
        let at = |z: f64| [v(0., 0., z), v(1., 0., z), v(0., 1., z)];
        shot(o, polygon(&at(0.0)), flipped(polygon(&at(1.0))));
    }),
    ("FF-032", |_, o| {
        let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 0., 1.)];
        shot(o, polygon(&[v(0., 0., 0.), v(1., 0., 0.), v(0., 1., 0.)]), polygon(&wall));
    }),
    ("FF-033", |_, o| blocked(o, 0.25)),
    ("FF-034", |_, o| blocked(o, 0.5)),
    ("FF-035", ff_035_l_room),
    ("FF-036", |c, o| box_matrix(c, o, v(1., 1., 1.))),
    ("FF-037", |c, o| box_matrix(c, o, v(4., 3., 2.5))),
    ("FF-042", |c, o| box_matrix(c, o, v(8., 0.5, 0.25))),
    ("FF-038", ff_038_zeros),
    ("FF-039", |_, o| shot(o, level(U, LONG, 0.0, true), level(U, LONG, 1.0, false))),
    ("FF-040", |_, o| shot(o, level(U, LONG, 0.0, true), inclined(60.0, LONG))),
    ("FF-043", |_, o| shot(o, level(U, LONG, 0.0, true), upright_wall(LONG, [0., 2.]))),
    ("FF-041", ff_041_error_against_rays),
    ("FF-045", |_, o| shot(o, level([0., 2.], [0., 1.5], 0.0, true), upright_wall([0., 1.5], [0., 0.5]))),
    ("FF-046", |_, o| shot(o, level(U, U, 0.0, true), hinged(150.0))),
    ("HARD-001", |_, o| scaled(o, 1.0 / 8192.0)),
    ("HARD-002", |_, o| scaled(o, 8192.0)),
    ("HARD-011", |_, o| scaled(o, 1.0 / 1_048_576.0)),
    ("HARD-003", hard_003_far_from_the_origin),
    ("HARD-004", |_, o| shot(o, level(U, [0., 1.0 / 1_048_576.0], 0.0, true), level(U, U, 1.0, false))),
    ("HARD-005", |_, o| {
        let lamp = facing(&[v(0., 0., 0.), v(0., 1., 0.), v(1., 1., 0.), v(1., 0., 0.)], v(0.5, 0.5, -1.0));
        element_to(o, v(0.5, 0.0, -1.0 / 8192.0), DVec3::Y, lamp, 5e-5);
    }),
];

const U: [f64; 2] = [0.0, 1.0];
const LONG: [f64; 2] = [0.0, 1024.0];

/// Rectangle in the plane x = 0, facing +x.
fn upright_wall(y: [f64; 2], z: [f64; 2]) -> Triangles {
    polygon(&[v(0., y[0], z[0]), v(0., y[1], z[0]), v(0., y[1], z[1]), v(0., y[0], z[1])])
}

/// Rectangle of width 1 hinged along x = 0 to the one in the plane z = 0, facing it.
fn inclined(degrees: f64, y: [f64; 2]) -> Triangles {
    let (z, x) = degrees.to_radians().sin_cos();
    polygon(&[v(0., y[0], 0.), v(0., y[1], 0.), v(x, y[1], z), v(x, y[0], z)])
}

fn hinged(degrees: f64) -> Triangles {
    inclined(degrees, U)
}

/// Regular polygons of 256 corners and equal area stand for discs: form factors differ by less than 1e-4.
fn disc_up(radius: f64, z: f64) -> Triangles {
    disc(v(0., 0., z), DVec3::Z, radius, 256)
}

fn disc_down(radius: f64, z: f64) -> Triangles {
    disc(v(0., 0., z), -DVec3::Z, radius, 256)
}

/// Reflectance of the surfaces that receive: any will do, and with so little nothing is left to shoot on.
const RHO: f64 = 0.01;

/// A first surface of exitance 1, a second one, and black ones.
fn pair(first: Triangles, second: Triangles, others: Triangles) -> Room {
    let mut model = Model::new();
    model.add("first", first, glow(0.0, 1.0)).add("second", second, grey(RHO));
    if !others.is_empty() {
        model.add("others", others, grey(0.0));
    }
    Room::new(model.finish())
}

/// The flux that leaves light sources, without what is reflected.
fn first_shot(direct: DirectLight, seed: u32) -> RadiosityParams {
    // Gathering spends rays by the error asked for, shooting at least 2^15.
    let error = if direct == DirectLight::Gather { 2e-3 } else { 1.0 };
    RadiosityParams { unshot: 0.5, ambient: false, direct, ..one_patch(error, seed) }
}

/// Share of the flux of the first surface that arrives at the front of the second, over seeds: 2^15 rays each, or by shadow
/// rays.
fn form_factor(room: &Room, direct: DirectLight) -> Estimate {
    let (first, second) = (room.triangles("first"), room.triangles("second"));
    let scale = room.area(&second) / (RHO * room.area(&first));
    over_seeds(|seed| {
        let solution = room.solve(&first_shot(direct, seed)).unwrap();
        vec![room.mean(&solution, "second") * scale]
    })[0]
}

fn shot(out: &mut Outcome<'_>, first: Triangles, second: Triangles) {
    let room = pair(first, second, Vec::new());
    let expected = out.expected();
    out.ray_cast("F by shooting", expected, form_factor(&room, DirectLight::Shoot));
}

fn ff_006_far(case: &Case, out: &mut Outcome<'_>) {
    let room = pair(level(U, U, 0.0, true), level(U, U, 128.0, false), Vec::new());
    out.ray_cast("F by gathering", case.value(), form_factor(&room, DirectLight::Gather));
}

fn blocked(out: &mut Outcome<'_>, z: f64) {
    let middle = [0.25, 0.75];
    let room = pair(level(U, U, 0.0, true), level(U, U, 1.0, false), level(middle, middle, z, true));
    let expected = out.expected();
    for direct in [DirectLight::Shoot, DirectLight::Gather] {
        out.ray_cast(&format!("F by {direct:?}"), expected, form_factor(&room, direct));
    }
}

fn ff_035_l_room(case: &Case, out: &mut Outcome<'_>) {
    let plan = [[0., 0.], [4., 0.], [4., 2.], [1.5, 2.], [1.5, 5.], [0., 5.]];
    let wall = |i: usize| {
        let ([ax, ay], [bx, by]) = (plan[i], plan[(i + 1) % 6]);
        polygon(&[v(bx, by, 0.), v(ax, ay, 0.), v(ax, ay, 3.), v(bx, by, 3.)])
    };
    let mut others: Triangles = [1, 2, 3, 5].into_iter().flat_map(wall).collect();
    for z in [0.0, 3.0] {
        others.extend(level([0., 4.], [0., 2.], z, z == 0.0));
        others.extend(level([0., 1.5], [2., 5.], z, z == 0.0));
    }
    let room = pair(wall(0), wall(4), others);
    out.ray_cast("F", case.value(), form_factor(&room, DirectLight::Shoot));
}

fn box_matrix(case: &Case, out: &mut Outcome<'_>, size: DVec3) {
    let expected = case.values("/F");
    let matrix = |direct: DirectLight| -> Vec<Vec<Estimate>> {
        let row = |i: usize| {
            let mut exitance = [0.0; 6];
            exitance[i] = 1.0;
            let mut rho = [RHO; 6];
            rho[i] = 0.0;
            let room = Room::new(closed_box(size, rho, exitance).finish());
            let areas = FACES.map(|f| room.area(&room.triangles(f)));
            over_seeds(|seed| {
                let solution = room.solve(&first_shot(direct, seed)).unwrap();
                let share = |j: usize| room.mean(&solution, FACES[j]) * areas[j] / (RHO * areas[i]);
                (0..6).map(|j| if j == i { 0.0 } else { share(j) }).collect()
            })
        };
        (0..6).map(row).collect()
    };
    let shot = matrix(DirectLight::Shoot);
    for i in 0..6 {
        for j in 0..6 {
            out.ray_cast(&format!("F_{}_{}", FACES[i], FACES[j]), expected[6 * i + j], shot[i][j]);
        }
        let sum: f64 = shot[i].iter().map(|e| e.mean).sum();
        out.near(&format!("row sum {}", FACES[i]), 1.0, sum, case.tolerance("/row_sum_abs"));
    }
    out.note("Reciprocity by gathering, all else by shooting.");
    let gathered = matrix(DirectLight::Gather);
    let areas = [size.y * size.z, size.y * size.z, size.x * size.z, size.x * size.z, size.x * size.y, size.x * size.y];
    for i in 0..6 {
        for j in 0..i {
            let [there, back] = [areas[i] * gathered[i][j].mean, areas[j] * gathered[j][i].mean];
            let what = format!("A_i F_ij over A_j F_ji, {} {}", FACES[i], FACES[j]);
            out.near(&what, 1.0, there / back, case.tolerance("/reciprocity_rel"));
        }
    }
}

fn ff_038_zeros(_: &Case, out: &mut Outcome<'_>) {
    let wide = [-2.0, 2.0];
    let rooms = [
        ("coplanar", pair(level(U, U, 0.0, true), level([2., 3.], U, 0.0, true), Vec::new())),
        ("turned away", pair(level(U, U, 0.0, true), level(U, U, 1.0, true), Vec::new())),
        ("hidden", pair(level(U, U, 0.0, true), level(U, U, 1.0, false), level(wide, wide, 0.5, true))),
    ];
    for (what, room) in rooms {
        for direct in [DirectLight::Shoot, DirectLight::Gather] {
            out.exact(&format!("{what}, {direct:?}"), 0.0, form_factor(&room, direct).mean);
        }
    }
}

/// Rays that leave the light source as the solver's own, numbered within low-discrepancy point sets.
fn ff_041_error_against_rays(case: &Case, out: &mut Outcome<'_>) {
    const RUNS: u32 = 32;
    let f = 0.19982489569838738;
    let room = pair(level(U, U, 0.0, true), level(U, U, 1.0, false), Vec::new());
    let target = room.triangles("second");
    let errors = case.values("");
    out.note("32 seeds of Sobol points; the case asks for at most 1.3 standard errors of independent rays.");
    for (rays, error) in [1_000_u32, 10_000, 100_000, 1_000_000].into_iter().zip(errors) {
        let estimate = |seed: u32| {
            let stream = hash_all(&[seed, rays]);
            let mut hit_count = 0_u32;
            for first in (0..rays).step_by(1000) {
                let queries: Vec<_> = (first..first + 1000)
                    .map(|k| {
                        let (s, choice) = (sobol(k, 0, stream), sobol(k, 1, stream)[0]);
                        let u = [choice, s[0], s[1], s[2], s[3]];
                        let emitted = room.lights.sample_emission(&room.scene, u).unwrap();
                        let Vec2 { x: u, y: v } = emitted.uv;
                        let on = Hit { t: 0.0, u, v, triangle: emitted.triangle };
                        let origin = SurfacePoint::new(&room.scene, &on).ray_origin(emitted.ray.direction);
                        gsii::backend::Ray { origin, ..emitted.ray }
                    })
                    .collect();
                let mut hits = vec![Hit::MISS; queries.len()];
                room.rays.closest(&queries, Visible::All, Coherence::Incoherent, &mut hits);
                hit_count += hits.iter().filter(|h| target.contains(&h.triangle)).count() as u32;
            }
            f64::from(hit_count) / f64::from(rays)
        };
        let squares: Vec<f64> = (0..RUNS).into_par_iter().map(|seed| (estimate(seed) - f).powi(2)).collect();
        let square: f64 = squares.iter().sum();
        let rms = (square / f64::from(RUNS)).sqrt();
        // From 0 to the largest that is allowed.
        let most = case.tolerance("/rms_factor") * error;
        out.near(&format!("rms error of {rays} rays (allowed: 0..{most:.1e})"), 0.0, rms, most);
    }
}

fn scaled(out: &mut Outcome<'_>, scale: f64) {
    let side = [0.0, scale];
    shot(out, level(side, side, 0.0, true), level(side, side, scale, false));
}

fn hard_003_far_from_the_origin(case: &Case, out: &mut Outcome<'_>) {
    let far = 1_048_576.0;
    let mut moved = Model::new();
    let to = v(far, far, 0.0);
    moved.place("first", level(U, U, 0.0, true), glow(0.0, 1.0), to);
    moved.place("second", level(U, U, 1.0, false), grey(RHO), to);
    let as_node = form_factor(&Room::new(moved.finish()), DirectLight::Shoot);
    out.mean("as a transform", case.value(), as_node, case.tolerance("/as_node_translation_abs"));
    let side = [far, far + 1.0];
    let baked = pair(level(side, side, 0.0, true), level(side, side, 1.0, false), Vec::new());
    let baked = form_factor(&baked, DirectLight::Shoot);
    out.mean("in the vertices", case.value(), baked, case.tolerance("/baked_into_vertices_abs"));
}

fn element(out: &mut Outcome<'_>, point: DVec3, normal: DVec3, polygon: &[DVec3]) {
    element_to(out, point, normal, facing(polygon, point), 1e-2);
}

/// Irradiance at a small receiver (of the given size) from a surface of exitance 1.
fn element_to(out: &mut Outcome<'_>, point: DVec3, normal: DVec3, lamp: Triangles, size: f64) {
    let mut model = Model::new();
    model.add("lamp", lamp, glow(0.0, 1.0));
    receiver(&mut model, point, normal, size);
    let scene = model.finish();
    let camera = look_at(&scene, point, normal, 0.5 * size, 0.01 * size);
    let seen = radiance(&scene, &mcpt(), &[camera], 1 << 13, Part::Direct)[0];
    let expected = out.expected();
    out.ray_cast("F by direct light", expected, irradiance(seen));
}

fn element_to_ball(out: &mut Outcome<'_>, distance: f64, degrees: f64) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    element_to(out, DVec3::ZERO, DVec3::Z, ball(distance * v(sin, 0., cos), 1.0, 5), 1e-2);
}
