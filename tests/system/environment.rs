//! Light from outside, in whole images and every method.
//!
//! Statistical tests use fixed seeds; the stated false-alarm rate is the chance with which another seed would fail although nothing
//! is wrong.

use std::sync::Arc;

use crate::common::{self, Body, EYE, Estimate, cluttered_room, fixed, gltf, prepare, render, threshold, values};
use glam::Vec3;
use gsii::pipeline::{Method, Settings};
use gsii::render::{RenderParams, bias, show::show_radiosity};
use gsii::scene::sky::Sky;
use gsii::scene::{Environment, Scene};

const ALPHA: f64 = 1e-4;

/// Bodies in an environment.
fn within(bodies: &[Body], environment: Environment) -> Arc<Scene> {
    let mut scene = common::scene(&gltf(bodies, EYE));
    Arc::make_mut(&mut scene).environment = Some(Arc::new(environment));
    scene
}

/// The blocks of [`cluttered_room`] without the room.
fn clutter(reflectance: f32) -> Vec<Body> {
    cluttered_room(0.0, 0.0, reflectance).split_off(1)
}

/// A floor with a wall, and clutter on it.
fn yard() -> Vec<Body> {
    let mut bodies = clutter(0.6);
    bodies.push(Body::block([0.0, -0.2, 0.0], [4.0, 0.0, 5.0], false, 0.5, 0.0));
    bodies.push(Body::block([0.0, 0.0, -0.3], [4.0, 3.0, 0.0], false, 0.7, 0.0));
    bodies
}

/// Smooth, with a bright spot.
fn spotted() -> Environment {
    let (w, h) = (64, 32);
    let texel = |i: usize| {
        let (x, y) = ((i % w) as f32 / w as f32, (i / w) as f32 / h as f32);
        let spot = if (x - 0.7).hypot(0.5 * y - 0.15) < 0.06 { 30.0 } else { 0.0 };
        Vec3::new(0.5 + 0.4 * (std::f32::consts::TAU * x).sin(), 0.6, 0.2 + y) + Vec3::splat(spot)
    };
    Environment::new("spotted".to_owned(), [w, h], (0..w * h).map(texel).collect())
}

/// Where the same light comes from everywhere, bodies that reflect all of it cannot be seen, in any arrangement.
#[test]
fn white_bodies_vanish_in_uniform_surroundings() {
    let exact = 2.0;
    let scene = within(&clutter(1.0), Environment::uniform(Vec3::splat(exact as f32)));
    let methods = [(Method::Mcpt, None), (Method::Pmm, None), (Method::Gsii, Some(0.5))];
    for (method, r_thresh) in methods {
        let settings =
            Settings { method, r_thresh, radiosity_error: 0.03, patch_size: Some(0.5), ..Settings::default() };
        let (prepared, stats) = prepare(&scene, settings);
        assert!(method != Method::Gsii || stats.counts.clusters > 0, "something is simplified");
        let rendering = render(&prepared, &fixed(36, 24, 64, 5));
        let got = Estimate::whole(&rendering.film);
        let error = got.error.hypot(stats.error.radiosity * rendering.film.mean(|p| p.lores.mean()));
        let z = (got.mean - exact) / error;
        println!("{method:?} {r_thresh:?}: {got:?}, radiosity error {}, z {z}", stats.error.radiosity);
        assert!(z.abs() < threshold(ALPHA, methods.len()), "{method:?} {r_thresh:?}: {} is not {exact}", got.mean);
        assert!(error < 0.02 * exact, "the test says something: error {error}");
    }
}

/// A radiosity solution shown directly is the furnace's radiance, too.
#[test]
fn radiosity_of_white_bodies_is_that_of_the_surroundings() {
    let scene = within(&clutter(1.0), Environment::uniform(Vec3::ONE));
    // Between white surfaces light hardly ever ends: few patches, so that many bounces take little.
    let settings =
        Settings { method: Method::Radiosity, radiosity_error: 0.1, patch_size: Some(1.0), ..Settings::default() };
    let (prepared, stats) = prepare(&scene, settings);
    let world = prepared.world();
    let film = show_radiosity(&world, &world.far.unwrap(), &prepared.scene.cameras[0], &fixed(36, 24, 4, 0)).film;
    let mean = Estimate::whole(&film).mean;
    println!("{mean}, radiosity error {}", stats.error.radiosity);
    // The error is that of the mean patch; the image shows many, whose errors partly cancel.
    assert!((mean - 1.0).abs() < 5.0 * stats.error.radiosity, "{mean}");
}

/// A perfect mirror shows the surroundings as they are: the wall is seen head on, so it shows what lies behind the eye.
#[test]
fn mirrors_show_the_surroundings() {
    let mirror = |scene: &mut Arc<Scene>| {
        let material = &mut Arc::make_mut(scene).materials[0];
        (material.metallic, material.roughness, material.base_color) = (1.0, 0.0, Vec3::ONE);
        material.specular = 1.0;
    };
    let wall = [Body::block([-50.0, -50.0, -1.0], [50.0, 50.0, 0.0], false, 1.0, 0.0)];
    for method in [Method::Mcpt, Method::Pmm] {
        let mut seen = within(&wall, spotted());
        mirror(&mut seen);
        let settings = Settings { method, ..Settings::default() };
        let (prepared, _) = prepare(&seen, settings);
        let got = values(&render(&prepared, &fixed(30, 20, 4, 1)).film);
        // The same rays, flipped at the wall, by the environment's own answer.
        let environment = spotted();
        let view = gsii::render::view::ViewRays::new(&prepared.scene.cameras[0], [30, 20], 1);
        for (i, got) in got.chunks(3).enumerate() {
            let mut sum = Vec3::ZERO;
            for trial in 0..4 {
                let ray = view.path([i as u32 % 30, i as u32 / 30], trial, 0).ray;
                sum += environment.radiance(ray.direction * Vec3::new(1.0, 1.0, -1.0));
            }
            for (band, got) in got.iter().enumerate() {
                let exact = f64::from(sum[band] / 4.0);
                // Rounding of the mirrored direction moves it in the map by some 1e-6 of a texel's 30 W/(sr m^2).
                assert!((got - exact).abs() < 1e-4 * (1.0 + exact), "{method:?}, pixel {i}: {got} {exact}");
            }
        }
    }
}

/// A glossy lobe that is sampled with lights and with its own rays gives what lights alone give.
#[test]
fn glossy_reflections_are_counted_once() {
    let mut scene = within(&yard(), spotted());
    for material in &mut Arc::make_mut(&mut scene).materials {
        (material.metallic, material.roughness, material.base_color) = (1.0, 0.25, Vec3::new(0.9, 0.8, 0.7));
        material.specular = 1.0;
    }
    let of = |glossy_threshold: f32, seed: u32| {
        let settings = Settings { method: Method::Mcpt, glossy_threshold, ..Settings::default() };
        Estimate::whole(&render(&prepare(&scene, settings).0, &fixed(36, 24, 256, seed)).film)
    };
    let (both, lights_only) = (of(0.3, 1), of(0.0, 2));
    println!("{both:?} {lights_only:?}");
    assert!(both.z(lights_only).abs() < threshold(ALPHA, 1), "z = {}", both.z(lights_only));
    assert!(both.error < 0.02 * both.mean, "the test says something");
}

/// The methods differ by their bias, which the bias meter knows.
#[test]
fn methods_agree_up_to_the_measured_bias() {
    let sky = Sky { elevation: 0.9, azimuth: 2.5, ..Sky::default() }.environment().unwrap();
    for (name, environment) in [("sky", sky), ("map", spotted())] {
        let scene = within(&yard(), environment);
        let of = |method: Method, seed: u32| {
            let (prepared, stats) = prepare(&scene, Settings { method, ..Settings::default() });
            let estimate = Estimate::whole(&render(&prepared, &fixed(48, 32, 128, seed)).film);
            (prepared, estimate, stats)
        };
        let (_, mcpt, _) = of(Method::Mcpt, 31);
        for method in [Method::Gsii, Method::Pmm] {
            let (prepared, estimate, _) = of(method, 32);
            let measured = bias::measure(&prepared.world(), &scene.cameras[0], &fixed(48, 32, 1, 33), 1 << 16);
            let mean = |v: [f64; 3]| v.iter().sum::<f64>() / 3.0;
            let error = estimate.error.hypot(mcpt.error).hypot(mean(measured.standard_error));
            let z = (estimate.mean - mcpt.mean - mean(measured.mean)) / error;
            println!("{name} {method:?} {estimate:?}, mcpt {mcpt:?}, bias {}, z {z}", mean(measured.mean));
            assert!(z.abs() < threshold(ALPHA, 4), "{name}, {method:?}: z = {z}");
            assert!(error < 0.05 * mcpt.mean, "the test says something: {error}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let sky = Sky::default().environment().unwrap().rotated(0.4);
    let scene = within(&yard(), sky);
    for method in [Method::Gsii, Method::Mcpt] {
        let adaptive = RenderParams { max_trials: 32, ..fixed(30, 20, 4, 0) };
        let images = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (prepared, _) = prepare(&scene, Settings { method, ..Settings::default() });
                let bits = |v: f64| v.to_bits();
                values(&render(&prepared, &adaptive).film).into_iter().map(bits).collect::<Vec<_>>()
            })
        });
        assert!(images[0] == images[1] && images[0] == images[2], "{method:?}");
    }
}
