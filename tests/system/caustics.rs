//! Caustics from small light sources: photons and gather rays bring the same light, each path once.
//!
//! Statistical tests use fixed seeds: they give the same answer every time. The stated false-alarm rate is the chance with which another
//! seed would fail although nothing is wrong.

use std::sync::Arc;

use crate::common::{Body, fixed, interpolated, lit_room, prepare, render, scene, values};
use glam::{DAffine3, DVec3, Mat3, Vec3};
use gsii::pipeline::{Method, Settings};
use gsii::progress::Progress;
use gsii::render::{self, Film, World, bias};
use gsii::scene::{Camera, LightKind, Material, MeshData, Projection, PunctualLight, Scene, SceneBuilder};
use statrs::distribution::{ContinuousCDF, StudentsT};

const ALPHA: f64 = 1e-3;

fn add(builder: &mut SceneBuilder, body: &Body, material: Material) {
    let data = MeshData {
        positions: body.positions.iter().map(|p| Vec3::from_array(*p)).collect(),
        triangles: body.triangles.clone(),
        ..MeshData::default()
    };
    let material = builder.add_material(material);
    builder.add_mesh("body", data, material, DAffine3::IDENTITY).unwrap();
}

/// A ball around `centre` with smooth normals.
fn ball(builder: &mut SceneBuilder, centre: Vec3, radius: f32, material: Material) {
    let p = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
    let mut faces: Vec<[DVec3; 3]> =
        (0..4).flat_map(|i| [[p[i], p[(i + 1) % 4], DVec3::Z], [p[(i + 1) % 4], p[i], -DVec3::Z]]).collect();
    for _ in 0..5 {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    let corners = || faces.iter().flatten().map(|p| p.as_vec3());
    let data = MeshData {
        positions: corners().map(|p| centre + radius * p).collect(),
        normals: corners().collect(),
        triangles: (0..faces.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    };
    let material = builder.add_material(material);
    builder.add_mesh("ball", data, material, DAffine3::IDENTITY).unwrap();
}

fn glass() -> Material {
    Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, refracts: true, ..Material::default() }
}

/// Half a mirror, half diffuse under a perfect coat.
fn half_mirror() -> Material {
    Material { base_color: Vec3::splat(0.8), metallic: 0.5, roughness: 0.0, ..Material::default() }
}

enum Lamp {
    /// A cube of this half edge.
    Cube(f32),
    Point,
}

/// What bends light in a [`room`].
#[derive(Clone, Copy)]
enum Bender {
    Ball,
    Panel,
}

/// A grey room of 4 x 3 x 5 with a ball of glass, or half a mirror, and a lamp. The camera looks straight down at the caustic on the floor.
fn room(bender: Bender, lamp: Lamp) -> Arc<Scene> {
    let mut builder = SceneBuilder::new("room");
    add(&mut builder, &Body::block([0.0; 3], [4.0, 3.0, 5.0], true, 0.0, 0.0), Material::lambertian(Vec3::splat(0.5)));
    let at = match bender {
        Bender::Ball => {
            ball(&mut builder, Vec3::new(2.0, 0.6, 2.0), 0.5, glass());
            Vec3::new(3.2, 1.2, 2.0)
        }
        Bender::Panel => {
            add(&mut builder, &Body::block([2.2, 0.1, 1.2], [2.3, 1.3, 2.8], false, 0.0, 0.0), half_mirror());
            Vec3::new(1.5, 1.0, 2.0)
        }
    };
    match lamp {
        Lamp::Cube(half) => {
            let cube = Body::block((at - half).to_array(), (at + half).to_array(), false, 0.0, 0.0);
            add(&mut builder, &cube, Material::emitter(Vec3::splat(10.0), Vec3::ZERO));
        }
        Lamp::Point => {
            let kind = LightKind::Point { position: at };
            builder.add_light(PunctualLight { name: String::new(), intensity: Vec3::ONE, kind }, DAffine3::IDENTITY);
        }
    }
    let camera = Camera {
        name: "eye".to_owned(),
        position: Vec3::new(0.8, 2.0, 2.0),
        axes: Mat3::from_cols(Vec3::X, -Vec3::Z, Vec3::Y),
        projection: Projection::Perspective { y_fov: 0.49 },
        aspect: None,
    };
    builder.add_camera(camera, DAffine3::IDENTITY);
    Arc::new(builder.finish().unwrap())
}

fn mean(film: &Film) -> f64 {
    let values = values(film);
    values.iter().sum::<f64>() / values.len() as f64
}

/// What differs between seeds: mean, and the largest distance from the truth but for one case in 1 / [`ALPHA`].
fn interval(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let error = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
    (mean, error * StudentsT::new(0.0, 1.0, n - 1.0).unwrap().inverse_cdf(1.0 - 0.5 * ALPHA))
}

/// The same scene with photons, and without, where gather rays must meet the lamp. Blurred estimates lose light at the edges of surfaces: that
/// may be a twentieth of the caustic, and three times that where gather rays see the mirror blurred. A path that is counted twice, or never,
/// makes all of a caustic's difference.
#[test]
fn photons_and_gather_rays_bring_the_same_light() {
    const SEEDS: u32 = 8;
    // The caustic is only what differences are held against, and two seeds know it to a fifth of a per cent.
    const DARK: u32 = 2;
    let cases = [
        ("glass", Bender::Ball, Method::Pmm, 0.0, 0.05),
        ("glass", Bender::Ball, Method::Gsii, 0.3, 0.05),
        ("half a mirror", Bender::Panel, Method::Gsii, 0.0, 0.05),
        ("half a mirror", Bender::Panel, Method::Gsii, 0.3, 0.15),
    ];
    for (name, bender, method, filter_glossy, tolerance) in cases {
        let scene = room(bender, Lamp::Cube(0.06));
        let (mut differences, mut caustics) = (Vec::new(), Vec::new());
        for seed in 0..SEEDS {
            let r_thresh = (method == Method::Gsii).then_some(0.8);
            let radiosity =
                Settings { radiosity_error: 1.0, unshot: 0.1, patch_size: Some(0.3), ..Settings::default() };
            let (prepared, stats) = prepare(&scene, Settings { method, r_thresh, filter_glossy, seed, ..radiosity });
            assert!(stats.counts.photons > 10_000);
            let of = |world: &World<'_>, seed| {
                render::render(world, &scene.cameras[0], &fixed(32, 24, 64, seed), &Progress::silent()).film
            };
            let world = prepared.world();
            let with = of(&world, 100 + seed);
            let without = of(&World { caustics: None, ..world }, 100 + seed);
            differences.push(mean(&with) - mean(&without));
            if seed < DARK {
                // No photons, and gather rays leave the light to them all the same: what is left out is the caustic.
                let none = world.caustics.unwrap().emptied();
                let dark = of(&World { caustics: Some(&none), ..world }, 100 + seed);
                caustics.push(mean(&with) - mean(&dark));
            }
        }
        let ((difference, error), (caustic, _)) = (interval(&differences), interval(&caustics));
        println!(
            "{name}, {method:?}, filter {filter_glossy}: {difference:.5} +- {error:.5} of a caustic of {caustic:.5}"
        );
        assert!(error < 0.5 * caustic, "{name}, {method:?}, filter {filter_glossy}: the test is sharp");
        assert!(difference.abs() < error + tolerance * caustic, "{name}, {method:?}, filter {filter_glossy}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    for (bender, lamp) in [(Bender::Ball, Lamp::Cube(0.06)), (Bender::Panel, Lamp::Point)] {
        let scene = room(bender, lamp);
        let image = || {
            let (prepared, _) = prepare(&scene, Settings::default());
            assert!(prepared.caustics.as_ref().is_some_and(|c| !c.is_empty()));
            let film = render(&prepared, &interpolated(24, 18, 4, 0)).film;
            values(&film).iter().map(|x| x.to_bits()).collect::<Vec<u64>>()
        };
        let images = [1, 2, 5].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(image));
        assert!(images[0] == images[1] && images[0] == images[2]);
    }
}

#[test]
fn scenes_that_need_no_photons_have_none() {
    let diffuse = scene(&lit_room());
    let (prepared, stats) = prepare(&diffuse, Settings::default());
    assert!(prepared.caustics.is_none() && stats.counts.photons == 0, "nothing bends light");
    let large = room(Bender::Ball, Lamp::Cube(0.5));
    assert!(prepare(&large, Settings::default()).0.caustics.is_none(), "gather rays meet a large lamp");
    let small = room(Bender::Ball, Lamp::Point);
    let mcpt = Settings { method: Method::Mcpt, ..Settings::default() };
    assert!(prepare(&small, mcpt).0.caustics.is_none(), "path tracing has no photons");
    assert!(prepare(&small, Settings::default()).0.caustics.is_some());
}

/// The bias meter compares with gather rays that meet the lamp: if it did not count photons, all of a caustic would be missing.
#[test]
fn the_bias_meter_counts_photons() {
    let scene = room(Bender::Ball, Lamp::Cube(0.06));
    let (prepared, _) = prepare(&scene, Settings { r_thresh: Some(0.8), ..Settings::default() });
    let world = prepared.world();
    let none = world.caustics.unwrap().emptied();
    let measure = |world: &World<'_>, seed| {
        let bias = bias::measure(world, &scene.cameras[0], &fixed(48, 36, 1, seed), 1 << 18);
        (bias.mean[0], bias.standard_error[0])
    };
    let ((with, error), (without, _)) = (measure(&world, 1), measure(&World { caustics: Some(&none), ..world }, 1));
    let caustic = with - without;
    println!("bias {with:.5} +- {error:.5}, without photons {without:.5}");
    assert!(error < 0.15 * caustic, "the test is sharp");
    // Four standard errors: one false alarm in 16,000; the rest as for whole images, and half of it for boxes and radiosity.
    assert!(with.abs() < 4.0 * error + 0.1 * caustic);
    // What path tracing has not at all is no bias.
    let point = room(Bender::Ball, Lamp::Point);
    let (prepared, _) = prepare(&point, Settings { r_thresh: Some(0.8), ..Settings::default() });
    let seen = prepared.world().caustics.unwrap().of_areas_only();
    assert!(seen.is_empty() && !prepared.caustics.as_ref().unwrap().is_empty());
}
