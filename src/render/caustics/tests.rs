//! Energy of caustics against exact values.

use std::f64::consts::{FRAC_1_PI, PI, SQRT_2};
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::Caustics;
use crate::backend::Hit;
use crate::pipeline::{Method, Prepared, Settings, Stats};
use crate::progress::Progress;
use crate::scene::{LightKind, Material, MeshData, PunctualLight, Scene, SceneBuilder};
use crate::shading::{Bsdf, Lobes, SurfacePoint};

const SEEDS: u32 = 8;
/// Quantile of Student's t with 7 degrees of freedom: one false alarm in 10^4 two-sided tests.
const QUANTILE: f64 = 7.06;

type Triangles = Vec<[DVec3; 3]>;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn quad(corners: [DVec3; 4]) -> Triangles {
    let [a, b, c, d] = corners;
    vec![[a, b, c], [a, c, d]]
}

/// A square of side `2 half` around `centre` that faces `normal`.
fn square(centre: DVec3, normal: DVec3, half: f64) -> Triangles {
    let x = half * normal.any_orthonormal_vector();
    let y = normal.cross(x);
    quad([centre - x - y, centre + x - y, centre + x + y, centre - x + y])
}

/// Six walls that face inward.
fn walls(half: f64) -> Triangles {
    [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|axis| [axis, -axis])
        .flat_map(|outward| square(half * outward, -outward, half))
        .collect()
}

/// An octahedron divided often, with vertices on the sphere and smooth normals.
fn ball(builder: &mut SceneBuilder, centre: DVec3, radius: f64, material: Material) {
    let p = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
    let mut faces: Triangles =
        (0..4).flat_map(|i| [[p[i], p[(i + 1) % 4], DVec3::Z], [p[(i + 1) % 4], p[i], -DVec3::Z]]).collect();
    for _ in 0..6 {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    let corners = || faces.iter().flatten();
    let data = MeshData {
        positions: corners().map(|p| (centre + radius * *p).as_vec3()).collect(),
        normals: corners().map(|p| p.as_vec3()).collect(),
        triangles: (0..faces.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    };
    let material = builder.add_material(material);
    builder.add_mesh("ball", data, material, DAffine3::IDENTITY).unwrap();
}

fn add(builder: &mut SceneBuilder, triangles: &[[DVec3; 3]], material: Material) {
    let data = MeshData {
        positions: triangles.iter().flatten().map(|p| p.as_vec3()).collect(),
        triangles: (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    };
    let material = builder.add_material(material);
    builder.add_mesh("part", data, material, DAffine3::IDENTITY).unwrap();
}

fn light(builder: &mut SceneBuilder, intensity: f32, kind: LightKind) {
    builder
        .add_light(PunctualLight { name: String::new(), intensity: Vec3::splat(intensity), kind }, DAffine3::IDENTITY);
}

fn builder() -> SceneBuilder {
    let mut builder = SceneBuilder::new("test");
    builder.recentre_on(Some(DVec3::ZERO));
    builder
}

fn grey() -> Material {
    Material::lambertian(Vec3::splat(0.2))
}

fn mirror(reflectance: f32) -> Material {
    Material { base_color: Vec3::splat(reflectance), metallic: 1.0, roughness: 0.0, ..Material::default() }
}

fn glass() -> Material {
    Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, refracts: true, ..Material::default() }
}

fn prepared(scene: &Arc<Scene>) -> Prepared {
    let settings = Settings { method: Method::Pmm, patch_size: Some(0.5), radiosity_error: 1.0, ..Settings::default() };
    Prepared::new(Arc::clone(scene), &scene.cameras[0], settings, &Progress::silent(), &mut Stats::new()).unwrap()
}

/// Photon maps of as many seeds.
fn maps(scene: &Arc<Scene>, reach: f32) -> Vec<Caustics> {
    let prepared = prepared(scene);
    let map = |seed| Caustics::new(scene, &prepared.lights, prepared.detailed.as_ref(), reach, seed);
    (0..SEEDS).map(|seed| map(seed).expect("light is bent")).collect()
}

/// Mean of independent values must be `exact`, but for a share of `tolerance`.
fn check(what: &str, values: &[f64], exact: f64, tolerance: f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let error = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
    println!("{what}: {mean} +- {error}, exact {exact}");
    assert!((mean - exact).abs() < QUANTILE * error + tolerance * exact, "{what}: {mean} +- {error}, exact {exact}");
    assert!(error < 0.02 * exact, "{what}: the test is sharp");
}

/// Flux of all photons.
fn fluxes(maps: &[Caustics]) -> Vec<f64> {
    let flux = |c: &Caustics| -> f64 {
        let all = c.of_areas.photons.iter().chain(&c.of_points.photons);
        all.map(|p| f64::from(p.flux.x)).sum()
    };
    maps.iter().map(flux).collect()
}

/// Rounding of flux in f32 along chains of some events.
const ROUNDING: f64 = 1e-5;

/// A point light before a square mirror: the mirror's solid angle, seen from its axis.
#[test]
fn flux_of_a_point_light_by_way_of_a_mirror() {
    let mut builder = builder();
    add(&mut builder, &walls(3.0), grey());
    add(&mut builder, &square(DVec3::X, -DVec3::X, 0.5), mirror(0.9));
    light(&mut builder, 10.0, LightKind::Point { position: Vec3::ZERO });
    let scene = Arc::new(builder.finish().unwrap());
    let solid_angle = 4.0 * (0.25 / 1.5_f64.sqrt()).atan();
    check("mirror", &fluxes(&maps(&scene, 0.1)), 10.0 * 0.9 * solid_angle, ROUNDING);
}

/// All light that meets a ball of clear glass, or of perfect mirror, leaves it bent: its solid angle. The tessellated ball is smaller than
/// the ideal one by half the square of its edges' angle at most, which is the square root of 6 over 64 where the octahedron's faces bulge.
#[test]
fn flux_of_a_spot_light_by_way_of_balls() {
    for (what, material) in [("glass ball", glass()), ("mirror ball", mirror(1.0))] {
        let mut builder = builder();
        add(&mut builder, &walls(3.0), grey());
        ball(&mut builder, DVec3::ZERO, 0.5, material);
        let spot =
            LightKind::Spot { position: Vec3::new(0.0, 0.0, 2.0), direction: -Vec3::Z, cos_inner: 0.9, cos_outer: 0.8 };
        light(&mut builder, 1.0, spot);
        let scene = Arc::new(builder.finish().unwrap());
        let solid_angle = 2.0 * PI * (1.0 - (1.0 - 0.25 * 0.25_f64).sqrt());
        let flat = 0.5 * 6.0 / (64.0 * 64.0);
        check(what, &fluxes(&maps(&scene, 0.1)), solid_angle, flat + ROUNDING);
    }
}

/// The sun on a tilted mirror in the open: its area as the sun sees it.
#[test]
fn flux_of_the_sun_by_way_of_a_mirror() {
    let mut builder = builder();
    add(&mut builder, &square(DVec3::ZERO, DVec3::Z, 8.0), grey());
    add(&mut builder, &square(2.0 * DVec3::Z, v(1.0, 0.0, -1.0) / SQRT_2, 0.5), mirror(1.0));
    light(&mut builder, 3.0, LightKind::Directional { direction: -Vec3::X });
    let scene = Arc::new(builder.finish().unwrap());
    check("sun", &fluxes(&maps(&scene, 0.1)), 3.0 / SQRT_2, ROUNDING);
}

/// A tiny lamp that faces a mirror: the form factor of a square that is seen from its axis.
#[test]
fn flux_of_a_lamp_by_way_of_a_mirror() {
    let mut builder = builder();
    add(&mut builder, &walls(3.0), grey());
    add(&mut builder, &square(DVec3::X, -DVec3::X, 0.5), mirror(1.0));
    let half = 0.005;
    add(&mut builder, &square(DVec3::ZERO, DVec3::X, half), Material::emitter(Vec3::splat(1e4), Vec3::ZERO));
    let scene = Arc::new(builder.finish().unwrap());
    let a: f64 = 0.5;
    let root = (1.0 + a * a).sqrt();
    let form_factor = 4.0 * (a / root) * (a / root).atan() * FRAC_1_PI;
    // The lamp's size against the distance, squared
    check("lamp", &fluxes(&maps(&scene, 0.1)), 1e4 * PI * 4.0 * half * half * form_factor, half * half + ROUNDING);
}

/// Irradiance of a floor by way of a mirror: that of the mirrored light. Over the reach of an estimate the irradiance changes by its second
/// derivative times a twelfth of the reach squared on average.
#[test]
fn irradiance_by_way_of_a_mirror() {
    let mut builder = builder();
    add(&mut builder, &square(-DVec3::Z, DVec3::Z, 4.0), grey());
    add(&mut builder, &square(v(1.0, 0.0, 0.5), -DVec3::X, 1.5), mirror(0.8));
    light(&mut builder, 10.0, LightKind::Point { position: Vec3::ZERO });
    let scene = Arc::new(builder.finish().unwrap());
    let reach = 0.05;
    let maps = maps(&scene, reach);
    let prepared = prepared(&scene);
    // Over points farther apart than estimates reach: one estimate alone has an eighth of noise.
    let places = (0..25_u8).map(|i| [0.2 * f32::from(i % 5) - 0.3, 0.2 * f32::from(i / 5) - 0.3]);
    let (mut ratios, mut tolerance) = (vec![0.0; maps.len()], 0.0_f64);
    for [x, y] in places {
        let ray = crate::backend::Ray::new(Vec3::new(x, y, -0.5), -Vec3::Z);
        let mut hit = [Hit::MISS];
        let (all, coherence) = (crate::backend::Visible::All, crate::backend::Coherence::Incoherent);
        prepared.detailed.closest(&[ray], all, coherence, &mut hit);
        let point = SurfacePoint::new(&scene, &hit[0]);
        let bsdf = Bsdf::new(&scene, &point, Vec3::Z, Lobes::MIRRORS);
        let away = v(f64::from(x), f64::from(y), -1.0) - v(2.0, 0.0, 0.0);
        let exact = 10.0 * 0.8 / away.length().powi(3);
        for (ratio, map) in ratios.iter_mut().zip(&maps) {
            *ratio += f64::from(map.at(&point, Vec3::Z, &bsdf, None, false).x) * PI / 0.2 / exact / 25.0;
        }
        // d^2 (r^-3) is at most 12 r^-2 of it
        tolerance = tolerance.max(12.0 / away.length_squared() * f64::from(reach * reach) / 12.0 + ROUNDING);
    }
    check("irradiance over the exact one", &ratios, 1.0, tolerance);
}
