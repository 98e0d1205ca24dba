//! Mirrors, glass and the microfacet model.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Mat3, Vec2, Vec3};
use gsii::backend::Hit;
use gsii::radiosity::{DirectLight, RadiosityParams};
use gsii::sampling::{cosine_hemisphere, sobol};
use gsii::scene::{Aabb, Camera, Material, MeshData, Projection, Scene};
use gsii::shading::{Bsdf, Lobes, SurfacePoint, fresnel, ggx};

use crate::Recipe;
use crate::kit::*;
use crate::radiosity::furnace;
use crate::report::{Case, Outcome};

pub const RECIPES: &[(&str, Recipe)] = &[
    ("SPEC-001", |c, o| fresnel_curves(c, o, 1.5, &[0., 15., 30., 45., 60., 70., 75., 80., 85., 89.])),
    ("SPEC-002", spec_002_special_angles),
    ("SPEC-003", |c, o| slab(c, o, 1.5, 0.01, &[0., 30., 45., 60., 75., 85.])),
    ("SPEC-004", spec_004_light_in_a_mirror),
    ("SPEC-005", spec_005_flux_of_a_mirror),
    ("SPEC-006", spec_006_mirror_ball),
    ("SPEC-007", spec_007_invisible_in_a_furnace),
    ("SPEC-008", spec_008_metal),
    ("SPEC-009", spec_009_dielectric),
    ("SPEC-010", spec_010_weak_furnace),
    ("SPEC-011", |c, o| {
        out_albedo(o, "albedo", c.value(), single_scattering(1.0, 1.0, |_| 1.0), c.tolerance("/abs"));
    }),
    ("SPEC-012", |c, o| fresnel_curves(c, o, 1.333, &[0., 20., 40., 55., 65., 77., 88.])),
];

fn out_albedo(out: &mut Outcome<'_>, what: &str, expected: f64, measured: f64, allowed: f64) {
    out.near(what, expected, measured, allowed);
}

fn fresnel_curves(case: &Case, out: &mut Outcome<'_>, n: f32, degrees: &[f64]) {
    out.note("Glass reflects by the exact equations, coats and metals by Schlick's.");
    let share = case.tolerance("/formula_rel");
    let (exact, schlick) = (case.values("/exact"), case.values("/schlick"));
    for (i, degrees) in degrees.iter().enumerate() {
        let cosine = degrees.to_radians().cos() as f32;
        out.relative(&format!("exact at {degrees} degrees"), exact[i], fresnel::unpolarised(cosine, n).into(), share);
        let f0 = fresnel::at_normal(n);
        let approximate = f0 + (1.0 - f0) * fresnel::schlick_weight(cosine);
        out.relative(&format!("Schlick at {degrees} degrees"), schlick[i], approximate.into(), share);
    }
}

fn spec_002_special_angles(case: &Case, out: &mut Outcome<'_>) {
    let abs = case.tolerance("/abs");
    let n = 1.5_f32;
    let reflectances = |degrees: f64, eta: f32| fresnel::polarised(degrees.to_radians().cos() as f32, eta);
    let p_polarised = |degrees: f64| {
        let [a, b] = reflectances(degrees, n);
        f64::from(a.min(b))
    };
    // The least of the curve by ternary search, and the angle from which on nothing is transmitted by bisection.
    let (mut low, mut high) = (30.0, 80.0);
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if p_polarised(a) < p_polarised(b) { high = b } else { low = a }
    }
    out.near(
        "p-polarised reflectance at the angle",
        case.values("/Rp_at_brewster")[0],
        p_polarised(0.5 * (low + high)),
        abs,
    );
    let brewster = case.values("/brewster_deg")[0];
    out.near("reflectance at the exact angle", 0.0, p_polarised(brewster), abs);
    let (mut low, mut high) = (20_f64, 80_f64);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        let cosine = middle.to_radians().cos() as f32;
        if fresnel::refracted_cosine(cosine, 1.0 / n).is_some() { low = middle } else { high = middle }
    }
    out.note("f32 cosines resolve the critical angle to 5e-6 degrees; the minimum of the p-polarised curve is flat.");
    out.near("critical angle, degrees", case.values("/critical_deg")[0], low, abs);
    let beyond = f64::from(fresnel::unpolarised(50_f64.to_radians().cos() as f32, 1.0 / n));
    out.near("reflectance beyond it", case.values("/R_beyond_critical")[0], beyond, abs);
}

fn glass(ior: f64) -> Material {
    Material {
        base_color: Vec3::ONE,
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        refracts: true,
        ior: ior as f32,
        ..Material::default()
    }
}

/// A slab before a light source, seen at angles: transmittance, and how far it moves an edge of the light source.
pub fn slab(case: &Case, out: &mut Outcome<'_>, n: f64, thickness: f64, degrees: &[f64]) {
    const BEHIND: f64 = 0.01;
    const PIXELS: u32 = 80;
    out.note(
        "Without polarisation, all internal reflections: T_unpolarised_rt. The shift is that of a block 30 thicknesses wide; \
         much wider slabs are panes, which transmit straight on, without the shift.",
    );
    let block = 15.0 * thickness;
    let rel = case.tolerance("/rel");
    let (transmittance, shift) = (case.values("/T_unpolarised_rt"), case.values("/shift"));
    let single = case.values("/T_single_pass");
    for (i, degrees) in degrees.iter().enumerate() {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let back = v(-sin, 0.0, cos);
        let scene = |half: f64, edge: f64| {
            let mut model = Model::new();
            model.add("slab", solid(v(-half, -half, 0.), v(half, half, thickness)), glass(n));
            model.add("lamp", level([-2., edge], [-2., 2.], -BEHIND, true), glow(0.0, PI));
            model.finish()
        };
        let camera = |scene: &gsii::scene::Scene, at: f64, half: f64| {
            let right = v(cos, 0.0, sin);
            let position = v(0., 0., thickness) + 0.01 * back + at * right - scene.centre;
            let (right, back) = (right.as_vec3(), back.as_vec3());
            let projection = Projection::Orthographic { x_mag: half as f32, y_mag: 1e-7 };
            let axes = Mat3::from_cols(right, back.cross(right), back);
            Camera { name: String::new(), position: position.as_vec3(), axes, projection, aspect: None }
        };
        for (what, width) in [("block", block), ("pane", 2.0)] {
            let whole = scene(width, 2.0);
            let seen = radiance(&whole, &mcpt(), &[camera(&whole, 0.0, 1e-6)], 1 << 14, Part::All)[0];
            out.mean(&format!("T of a {what} at {degrees} degrees"), transmittance[i], seen, rel * transmittance[i]);
        }
        let half = scene(block, sin / cos * (thickness + BEHIND));
        let window = (0.02 * shift[i]).max(rel * thickness);
        let prepared = prepare(&half, mcpt()).unwrap();
        let film = image(&prepared, &camera(&half, shift[i], window), [PIXELS, 1], 256, 1);
        // The beam without internal reflections comes out last; what the rim sends back is far weaker.
        let lit = film.pixels().filter(|p| Part::All.of(p)[0] > 0.5 * single[i]).count();
        let edge = shift[i] - window + 2.0 * window * lit as f64 / f64::from(PIXELS);
        let allowed = if shift[i] > 0.0 { rel * shift[i] } else { rel * thickness };
        out.near(&format!("shift at {degrees} degrees, m"), shift[i], edge, allowed);
    }
}

fn spec_004_light_in_a_mirror(case: &Case, out: &mut Outcome<'_>) {
    let mut model = Model::new();
    model.add("lamp", level([0.5, 1.], [1., 1.5], 2.0, false), glow(0.0, 10.0 * PI));
    model.add("mirror", polygon(&[v(2., 0., 0.), v(2., 0., 3.), v(2., 3., 3.), v(2., 3., 0.)]), mirror(0.9));
    let point = v(0., 1., 0.);
    receiver(&mut model, point, DVec3::Z, 1e-2);
    let scene = model.finish();
    let camera = look_at(&scene, point, DVec3::Z, 5e-3, 1e-5);
    let seen = radiance_of(&scene, &mcpt(), &[camera], [8, 8], 1 << 14, Part::Indirect)[0];
    out.pixel("E of the mirrored light", case.value(), irradiance(seen));
}

const BLACK: f64 = 1e-3;

/// Light that is only shot or gathered once: what is reflected (a thousandth) is not shot on.
fn once(direct: DirectLight, patch_size: f64, error: f64, seed: u32) -> RadiosityParams {
    let patch_size = patch_size as f32;
    RadiosityParams { direct, unshot: 0.5, ambient: false, patch_size, ..one_patch(error, seed) }
}

fn spec_005_flux_of_a_mirror(case: &Case, out: &mut Outcome<'_>) {
    out.note("Flux on the walls with the mirror, less that with a black panel.");
    let room = |panel: Material| {
        let mut model = Model::new();
        model.add(
            "wall",
            box_faces(v(-2., -2., 0.), v(2., 2., 2.)).iter().flat_map(|q| polygon(q)).collect(),
            grey(BLACK),
        );
        let h = [-0.5, 0.5];
        let corners = [v(1., h[0], 0.5), v(1., h[0], 1.5), v(1., h[1], 1.5), v(1., h[1], 0.5)];
        model.add("panel", polygon(&corners), panel);
        model.point_light(100.0, v(0., 0., 1.));
        Room::new(model.finish())
    };
    let (with, without) = (room(mirror(0.9)), room(grey(0.0)));
    let flux = |room: &Room, seed: u32| {
        let solution = room.solve(&once(DirectLight::Shoot, 0.25, 0.05, seed)).unwrap();
        let walls = room.triangles("wall");
        room.area(&walls) * room.mean_of(&solution, &walls).x / BLACK
    };
    let caustic = over_seeds(|seed| vec![flux(&with, seed) - flux(&without, seed)])[0];
    out.mean("flux", case.value(), caustic, case.tolerance("/rel") * case.value());
}

/// Smooth normals: a tessellated ball with flat ones throws a facetted caustic.
fn smooth_ball(model: &mut Model, centre: DVec3, radius: f64, material: Material) {
    let triangles = sphere(DVec3::ZERO, radius, 6);
    let positions: Vec<Vec3> = triangles.iter().flatten().map(|p| (centre + *p).as_vec3()).collect();
    let normals = triangles.iter().flatten().map(|p| p.normalize().as_vec3()).collect();
    let indices = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let data = MeshData { positions, triangles: indices, normals, ..MeshData::default() };
    let material = model.0.add_material(material);
    model.0.add_mesh("ball", data, material, glam::DAffine3::IDENTITY).unwrap();
}

/// The upper half of a mirror ball of radius 1/2, and a coarse lower one, about a point one above the origin. Towards the equator bands
/// get narrower with the square of their number: light that arrives at an angle g to a smooth surface leaves at g, and would be
/// lost below the surface where triangles lean by as much; here they lean by less than g down to g = 0.02 degrees. The polygons
/// of the bands contain their circles, by 4e-7 of their radius: light that arrives at g then leaves at the root of g^2 + 8e-7.
/// Only the lowest `polished` of the bands are mirrors, the others black.
fn banded_ball(polished: u32) -> Model {
    const AROUND: u32 = 2048;
    let lower = (0..8).map(|k| 0.5 * PI * (f64::from(k) / 8.0 - 1.0));
    let upper = |k: u32| 0.5 * PI * (f64::from(k) / f64::from(BANDS)).powi(2);
    let reach = 1.0 / (PI / f64::from(AROUND)).cos();
    let mut model = Model::new();
    let mut add = |elevations: Vec<f64>, material: Material| {
        let mut data = MeshData::default();
        for (row, elevation) in (0..).zip(elevations) {
            for i in 0..AROUND {
                let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(AROUND)).sin_cos();
                let normal = v(elevation.cos() * cos, elevation.cos() * sin, elevation.sin());
                data.positions.push((DVec3::Z + 0.5 * normal * v(reach, reach, 1.0)).as_vec3());
                data.normals.push(normal.as_vec3());
                if row > 0 {
                    let [a, b] = [i, (i + 1) % AROUND].map(|i| (row - 1) * AROUND + i);
                    data.triangles.extend([[a, b, b + AROUND], [a, b + AROUND, a + AROUND]]);
                }
            }
        }
        let material = model.0.add_material(material);
        model.0.add_mesh("ball", data, material, glam::DAffine3::IDENTITY).unwrap();
    };
    add(lower.chain((0..=polished).map(upper)).collect(), mirror(1.0));
    if polished < BANDS {
        add((polished..=BANDS).map(upper).collect(), grey(0.0));
    }
    model
}

/// Bands of the upper half of a [`banded_ball`].
const BANDS: u32 = 96;

/// A flat ring of 256 segments with the area of the ideal one, facing up.
fn ring(inner: f64, outer: f64) -> Triangles {
    let step = 2.0 * PI / 256.0;
    let scale = (step / step.sin()).sqrt();
    segments([scale * inner, scale * outer], 256, 0.0)
}

/// The same whose corners lie on the circles, of any number of segments and at any height.
fn segments([inner, outer]: [f64; 2], count: u32, z: f64) -> Triangles {
    let at = |r: f64, i: u32| {
        let (sin, cos) = (2.0 * PI * f64::from(i % count) / f64::from(count)).sin_cos();
        v(r * cos, r * sin, z)
    };
    (0..count).flat_map(|i| polygon(&[at(inner, i), at(outer, i), at(outer, i + 1), at(inner, i + 1)])).collect()
}

fn spec_006_mirror_ball(case: &Case, out: &mut Outcome<'_>) {
    const WIDTH: f64 = 0.04;
    /// Of the beam: all of the ball, and hardly more.
    const BEAM: f64 = 0.5015;
    out.note("Irradiance is the mean over rings of 4 % on both sides. A black screen around the ball keeps all other light away.");
    let radii = [0.55, 0.6, 0.75, 1.0, 1.5, 2.0, 5.0];
    // Incident flux on each of the named parts, shooting `rays` rays in all; the screen at a height where the light for the parts passes
    // below it. What `of_fluxes` makes of it, over seeds.
    let caustic = |parts: &[(String, Triangles)],
                   polished: u32,
                   rays: u64,
                   screen: f64,
                   patch_size: f64,
                   of_fluxes: &dyn Fn(&[f64]) -> Vec<f64>| {
        let mut model = banded_ball(polished);
        parts.iter().for_each(|(name, triangles)| {
            model.add(name, triangles.clone(), grey(BLACK));
        });
        model.add("screen", segments([0.5 * (1.0 - 1e-7), 0.5 * 1.005], 4096, screen), grey(0.0));
        model.sun(1.0, -DVec3::Z);
        let mut room = Room::new(model.finish());
        // Parallel light sets out from a disc around the bounds of the scene, and most of it would end on a screen as wide as the floor:
        // with the bounds of the beam, nearly all of it meets the ball.
        let mut scene = Scene::clone(&room.scene);
        let centre = (DVec3::Z - scene.centre).as_vec3();
        let half = Vec3::splat((BEAM / 3_f64.sqrt()) as f32);
        scene.mesh.bounds = Aabb { min: centre - half, max: centre + half };
        room.scene = Arc::new(scene);
        over_seeds(|seed| {
            // No error is reached: all rays are shot.
            let all = RadiosityParams { max_rays: rays, ..once(DirectLight::Shoot, patch_size, 1e-6, seed) };
            let solution = room.solve(&all).unwrap();
            let flux = |(name, _): &(String, Triangles)| {
                let triangles = room.triangles(name);
                room.area(&triangles) * room.mean_of(&solution, &triangles).x / BLACK
            };
            of_fluxes(&parts.iter().map(flux).collect::<Vec<f64>>())
        })
    };
    let (e, inside) = (case.values("/E_reflected"), case.values("/flux_inside"));
    // Only light that grazes the ball arrives close to it: there, bands up to 5.6 degrees are mirrors (what the next one reflects arrives at
    // 0.7), and most rays end on the others. Each ring is one patch, so that its flux is exact.
    let floors = [(0, 2, BANDS / 4, 1 << 19, 1.04), (2, 7, BANDS, 1 << 17, 1.36)];
    for (first, last, polished, rays, height) in floors {
        let rings = radii[..last].iter().flat_map(|r| [(r * (1.0 - WIDTH)).max(0.5), *r, r * (1.0 + WIDTH)]);
        let mut edges: Vec<f64> = [0.0, 0.5].into_iter().chain(rings).collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        let parts: Vec<_> = edges.windows(2).map(|w| (format!("up to {}", w[1]), ring(w[0], w[1]))).collect();
        let measured = caustic(&parts, polished, rays, height, 1e3, &|flux| {
            let within =
                |r: f64| edges.windows(2).zip(flux).skip(1).filter(|(w, _)| w[1] <= r).map(|(_, f)| f).sum::<f64>();
            let at = |r: f64| {
                let (a, b) = ((r * (1.0 - WIDTH)).max(0.5), r * (1.0 + WIDTH));
                (within(b) - within(a)) / (PI * (b * b - a * a))
            };
            radii[first..last].iter().flat_map(|&r| [at(r), within(r)]).chain([flux[0]]).collect()
        });
        for (i, measured) in (first..last).zip(measured.chunks(2)) {
            let r = radii[i];
            out.mean(&format!("E at radius {r}"), e[i], measured[0], case.tolerance("/rel") * e[i]);
            out.mean(&format!("flux inside {r}"), inside[i], measured[1], case.tolerance("/flux_rel") * inside[i]);
        }
        let shadow = measured.last().unwrap();
        out.mean(&format!("flux in the shadow (floor up to {})", radii[last - 1]), 0.0, *shadow, 1e-7);
    }
    // Light that leaves downward: rays turned level leave 45 degrees up the ball, 0.3536 above its centre.
    let bowl: Triangles = sphere(DVec3::Z, 4.0, 6)
        .into_iter()
        .filter(|t| (t[0] + t[1] + t[2]).z / 3.0 < 1.0 + 0.5 * 0.5_f64.sqrt())
        .map(|[a, b, c]| [a, c, b])
        .collect();
    let total = caustic(&[("bowl".to_owned(), bowl)], BANDS, 1 << 15, 1.36, 0.1, &|flux| flux.to_vec())[0];
    let expected = case.values("/flux_total")[0];
    out.mean("all flux downward", expected, total, case.tolerance("/flux_rel") * expected);
}

fn spec_007_invisible_in_a_furnace(_: &Case, out: &mut Outcome<'_>) {
    let rough = Material { base_color: Vec3::ONE, metallic: 1.0, roughness: 0.5, ..Material::default() };
    for (what, material) in [("mirror ball", mirror(1.0)), ("glass ball", glass(1.5)), ("rough metal ball", rough)] {
        let mut model = furnace(0.5);
        smooth_ball(&mut model, DVec3::splat(0.5), 0.25, material);
        let scene = model.finish();
        let cameras = [
            look_at(&scene, v(0.5, 0.5, 0.0), DVec3::Z, 0.2, 0.05),
            look_at(&scene, v(0.1, 0.2, 1.0), -DVec3::Z, 0.3, 0.05),
            look_at(&scene, v(0.45, 0.4, 0.75), v(0.2, 0.1, 1.0), 0.1, 0.1),
        ];
        let seen = radiance(&scene, &mcpt(), &cameras, 1 << 15, Part::All);
        for (place, l) in ["floor under it", "ceiling", "the ball"].into_iter().zip(seen) {
            out.pixel(&format!("{what}: {place}"), 1.0, l.times(0.5 * PI));
        }
    }
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE).iter().enumerate() {
        model.add(FACES[i], polygon(face), if i == 1 { mirror(1.0) } else { glow(0.5, 1.0) });
    }
    let scene = model.finish();
    let cameras = [
        look_at(&scene, v(0.5, 0.5, 0.0), DVec3::Z, 0.2, 0.01),
        look_at(&scene, v(1.0, 0.5, 0.5), v(-1.0, 0.2, 0.3), 0.3, 0.1),
    ];
    let seen = radiance(&scene, &mcpt(), &cameras, 1 << 13, Part::All);
    for (place, l) in ["floor", "the mirror"].into_iter().zip(seen) {
        out.pixel(&format!("mirror wall: {place}"), 1.0, l.times(0.5 * PI));
    }
}

fn towards(cosine: f64) -> Vec3 {
    v((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine).as_vec3()
}

const POINTS: u32 = 1 << 16;

/// Albedo of the specular lobe, light scattered once, towards `cosine`, with Fresnel's term as a function of the cosine to the
/// facet: visible normals, weighted by what is not shadowed.
fn single_scattering(roughness: f64, cosine: f64, fresnel: impl Fn(f64) -> f64) -> f64 {
    let alpha = (roughness * roughness) as f32;
    let outgoing = towards(cosine);
    let mut sum = 0.0;
    for i in 0..POINTS {
        let u = sobol(i, 0, 7);
        let h = ggx::sample_visible(outgoing, alpha, [u[0], u[1]]);
        let incoming = 2.0 * outgoing.dot(h) * h - outgoing;
        if incoming.z > 0.0 {
            let seen = ggx::masking_shadowing(outgoing, incoming, alpha) / ggx::masking(outgoing, alpha);
            sum += fresnel(outgoing.dot(h).into()) * f64::from(seen);
        }
    }
    sum / f64::from(POINTS)
}

const COSINES: [f64; 5] = [1.0, 0.8, 0.5, 0.2, 0.1];

fn spec_008_metal(case: &Case, out: &mut Outcome<'_>) {
    out.note("Light scattered once; the program returns the rest, too, so that its own albedo is 1.");
    let expected = case.values("/albedo");
    for (i, roughness) in [0.2, 0.35, 0.5, 0.7, 0.85, 1.0].into_iter().enumerate() {
        for (j, cosine) in COSINES.into_iter().enumerate() {
            let albedo = single_scattering(roughness, cosine, |_| 1.0);
            let what = format!("albedo, roughness {roughness}, cosine {cosine}");
            out_albedo(out, &what, expected[5 * i + j], albedo, case.tolerance("/abs"));
        }
    }
}

fn spec_009_dielectric(case: &Case, out: &mut Outcome<'_>) {
    out.note("The published formula with the program's own distribution exceeds 1; the program's own albedo must not.");
    let expected = case.values("/albedo");
    let fresnel = |cosine: f64| 0.04 + 0.96 * (1.0 - cosine).max(0.0).powi(5);
    for (i, roughness) in [0.2, 0.5, 0.8, 1.0].into_iter().enumerate() {
        for (j, cosine) in COSINES.into_iter().enumerate() {
            let outgoing = towards(cosine);
            let diffuse: f64 = (0..POINTS)
                .map(|k| {
                    let u = sobol(k, 0, 8);
                    let incoming = cosine_hemisphere(Vec2::new(u[0], u[1]));
                    1.0 - fresnel(outgoing.dot((incoming + outgoing).normalize()).into())
                })
                .sum();
            let albedo = diffuse / f64::from(POINTS) + single_scattering(roughness, cosine, fresnel);
            let what = format!("published, roughness {roughness}, cosine {cosine}");
            out_albedo(out, &what, expected[5 * i + j], albedo, case.tolerance("/abs"));
            let own = own_albedo(roughness, cosine);
            out.holds(
                &format!("own albedo {own} at most 1, roughness {roughness}, cosine {cosine}"),
                own <= 1.0 + 1e-6,
            );
        }
    }
}

/// Albedo of the program's white dielectric.
fn own_albedo(roughness: f64, cosine: f64) -> f64 {
    let mut model = Model::new();
    let material =
        Material { base_color: Vec3::ONE, metallic: 0.0, roughness: roughness as f32, ..Material::default() };
    model.add("surface", level([0., 1.], [0., 1.], 0.0, true), material);
    let scene = model.finish();
    let point = SurfacePoint::new(&scene, &Hit { t: 1.0, u: 0.25, v: 0.25, triangle: 0 });
    let bsdf = Bsdf::new(&scene, &point, towards(cosine), Lobes { threshold: 0.3, ..Lobes::MIRRORS });
    (bsdf.albedo_low() + bsdf.albedo_high()).max_element().into()
}

fn spec_010_weak_furnace(case: &Case, out: &mut Outcome<'_>) {
    const STEPS: u32 = 600;
    const AZIMUTHS: u32 = 128;
    for alpha in [0.05_f64, 0.25, 1.0] {
        for cosine in [1.0, 0.5, 0.1] {
            let outgoing = towards(cosine);
            let mut sum = 0.0;
            // Midpoint rule over facets in azimuth and in tangent over alpha, mapped to 0..1.
            for i in 0..STEPS {
                let x = (f64::from(i) + 0.5) / f64::from(STEPS);
                let tangent = alpha * x / (1.0 - x);
                let z = 1.0 / (1.0 + tangent * tangent).sqrt();
                let solid_angle = z * tangent * z * z * alpha / ((1.0 - x) * (1.0 - x));
                for j in 0..AZIMUTHS {
                    let (sin, cos) = (2.0 * PI * (f64::from(j) + 0.5) / f64::from(AZIMUTHS)).sin_cos();
                    let h = v(z * tangent * cos, z * tangent * sin, z).as_vec3();
                    let visible = ggx::masking(outgoing, alpha as f32) * outgoing.dot(h).max(0.0);
                    sum += f64::from(ggx::distribution(h, alpha as f32) * visible) / cosine * solid_angle;
                }
            }
            let share = sum * 2.0 * PI / f64::from(STEPS * AZIMUTHS);
            out.near(&format!("alpha {alpha}, cosine {cosine}"), case.value(), share, case.tolerance("/abs"));
        }
    }
}
