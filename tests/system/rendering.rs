//! Properties of whole images, through the library.
//!
//! Statistical tests use fixed seeds: they give the same answer every time. The stated false-alarm rate is the chance with which
//! another seed would fail although nothing is wrong.

#[allow(dead_code, reason = "its main is not needed")]
#[path = "../../examples/library.rs"]
mod library;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::common::{
    self, Estimate, cluttered_room, fixed, gltf, interpolated, lit_room, prepare, render, scene, threshold, values,
};
use gsii::pipeline::{BackendKind, Method, Settings};
use gsii::render::{RenderParams, World, bias};

const ALPHA: f64 = 1e-4;

fn with(method: Method) -> Settings {
    Settings { method, ..Settings::default() }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn image(settings: Settings, params: &RenderParams) -> Vec<f64> {
    let (prepared, _) = prepare(&scene(&lit_room()), settings);
    values(&render(&prepared, params).film)
}

#[test]
fn the_example_of_the_documentation_renders() {
    let folder = tempfile::tempdir().unwrap();
    let [file, picture] = ["room.gltf", "room.exr"].map(|name| folder.path().join(name));
    std::fs::write(&file, lit_room()).unwrap();
    library::render(&file, &picture, 24, 16).unwrap();
    let image = gsii::image::read(&picture).unwrap();
    assert_eq!((image.width(), image.height()), (24, 16));
    assert!(image.channel("depth.Z").unwrap().iter().all(|&depth| depth > 0.0), "the room is closed");
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    for method in [Method::Gsii, Method::Pmm, Method::Mcpt, Method::Radiosity] {
        let adaptive = RenderParams { max_trials: 64, ..interpolated(45, 30, 4, 0) };
        let images = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| bits(&image(with(method), &adaptive)))
        });
        assert!(images[0].iter().any(|&b| f64::from_bits(b) > 0.0), "{method:?} is not black");
        assert!(images[0] == images[1] && images[0] == images[2], "{method:?}");
    }
}

#[test]
fn seeds_make_different_images() {
    for method in [Method::Gsii, Method::Pmm, Method::Mcpt, Method::Radiosity] {
        let of = |seed| bits(&image(Settings { seed, ..with(method) }, &fixed(24, 16, 4, seed)));
        assert_ne!(of(0), of(1), "{method:?}");
    }
}

#[test]
fn both_libraries_render_the_same_image() {
    let params = fixed(48, 32, 16, 3);
    let films = [BackendKind::Embree, BackendKind::Obvhs].map(|backend| {
        let settings = Settings { backend, r_thresh: Some(0.5), ..Settings::default() };
        let (prepared, _) = prepare(&scene(&lit_room()), settings);
        render(&prepared, &params).film
    });
    let [a, b] = films.each_ref().map(values);
    // The same random numbers lead to the same paths, but where rounding sends one elsewhere.
    let alike = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() <= 1e-3 * a.abs()).count();
    println!("{alike} of {} values agree within 0.1 %", a.len());
    assert!(alike * 2 > a.len());
    let [a, b] = films.each_ref().map(Estimate::whole);
    assert!(a.z(b).abs() < threshold(ALPHA, 1), "{a:?} {b:?}");
}

#[test]
fn without_a_near_field_gsii_is_pmm() {
    let params = fixed(30, 20, 8, 1);
    let gsii = image(Settings { r_thresh: Some(0.0), ..with(Method::Gsii) }, &params);
    assert_eq!(bits(&gsii), bits(&image(with(Method::Pmm), &params)));
}

#[test]
fn with_an_endless_near_field_gsii_is_path_tracing() {
    let params = fixed(30, 20, 8, 1);
    let gsii = image(Settings { r_thresh: Some(f32::INFINITY), ..with(Method::Gsii) }, &params);
    let mcpt = image(with(Method::Mcpt), &params);
    assert_eq!(bits(&gsii), bits(&mcpt));
    assert_ne!(bits(&gsii), bits(&image(with(Method::Pmm), &params)), "PMM is another method");
}

/// Scenes on which the limits of the method are checked: (name, file); those that are not at hand are left out.
fn real_scenes() -> Vec<(&'static str, PathBuf)> {
    let office = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/office-high.glb");
    let shared = common::shared().map(|folder| folder.join("scenes"));
    let others = ["cornell", "clutter"].map(|name| Some((name, shared.as_ref()?.join(format!("{name}.glb")))));
    others.into_iter().flatten().chain([("office", office)]).collect()
}

#[test]
fn the_limits_are_pmm_and_path_tracing_bit_for_bit_in_real_scenes() {
    let params = fixed(24, 16, 4, 1);
    // Equal bits need no precise solution.
    let with = |method| Settings { radiosity_error: 0.3, ..with(method) };
    for (name, path) in real_scenes() {
        let scene = Arc::new(gsii::scene::load(&path, &Default::default()).unwrap());
        let image = |settings: Settings| bits(&values(&render(&prepare(&scene, settings).0, &params).film));
        for (r_thresh, method) in [(0.0, Method::Pmm), (f32::INFINITY, Method::Mcpt)] {
            let gsii = image(Settings { r_thresh: Some(r_thresh), ..with(Method::Gsii) });
            assert!(gsii == image(with(method)), "{name}: r_thresh {r_thresh} is not {method:?}");
        }
    }
}

/// `r_thresh` larger than the scene: the far field is there and every ray asks it, but all light is found nearby. Pixel by pixel this
/// must be path tracing, as far as other random numbers can tell: no pixel and band may be off by more than the largest of as many normal
/// deviates is with probability [`ALPHA`].
#[test]
fn a_near_field_larger_than_the_scene_is_path_tracing_pixel_by_pixel() {
    let (width, height, trials) = (36, 24, 256);
    for (name, path) in real_scenes() {
        let scene = Arc::new(gsii::scene::load(&path, &Default::default()).unwrap());
        // Near parts are half as long at least; from twice the diagonal on no far field would be made.
        let r_thresh = Some(1.99 * scene.mesh.bounds.diagonal());
        let (gsii, _) = prepare(&scene, Settings { r_thresh, ..with(Method::Gsii) });
        assert!(gsii.far.is_some(), "the far field is there");
        let (mcpt, _) = prepare(&scene, with(Method::Mcpt));
        let a = render(&gsii, &fixed(width, height, trials, 31)).film;
        let b = render(&mcpt, &fixed(width, height, trials, 32)).film;
        let limit = threshold(ALPHA, 3 * 3 * (width * height) as usize);
        let mut worst = 0.0f64;
        for (i, (a, b)) in a.pixels().zip(b.pixels()).enumerate() {
            for band in 0..3 {
                let mean = |p: &gsii::render::film::Pixel| p.hires.mean()[band] + p.lores.mean()[band];
                // Trials as if independent, passes as if fully correlated: an upper estimate of the error.
                let dev = |p: &gsii::render::film::Pixel| p.hires.dev()[band] + p.lores.dev()[band];
                let difference = (mean(a) - mean(b)).abs();
                let z = if difference <= 1e-6 * mean(b) { 0.0 } else { difference / dev(a).hypot(dev(b)) };
                worst = worst.max(z);
                assert!(z < limit, "{name}: pixel {i}, band {band}: {} and {}, z {z:.2}", mean(a), mean(b));
            }
        }
        let (a, b) = (Estimate::whole(&a), Estimate::whole(&b));
        println!("{name}: largest z of a pixel {worst:.2} of {limit:.2}; means {a:?} {b:?}, z {:.2}", a.z(b));
        assert!(a.z(b).abs() < threshold(ALPHA, 3), "{name}: {a:?} {b:?}");
    }
}

/// Inside a closed room whose walls emit `radiance` and reflect `rho`, radiance is the same everywhere, `radiance / (1 - rho)`;
/// white bodies that do not emit reflect just that and cannot be seen. So box fits, radiosity and both passes are exact here.
#[test]
fn white_clutter_vanishes_in_a_furnace() {
    let (rho, radiance) = (0.5f32, 1.0f32);
    let furnace = scene(&gltf(&cluttered_room(rho, radiance, 1.0), common::EYE));
    let exact = f64::from(radiance / (1.0 - rho));
    for r_thresh in [0.0, 0.3, 0.6, 1.5, f32::INFINITY] {
        let settings = Settings { r_thresh: Some(r_thresh), radiosity_error: 0.01, ..Settings::default() };
        let (prepared, stats) = prepare(&furnace, settings);
        if (0.3..2.0).contains(&r_thresh) {
            assert!(stats.counts.complex > 0, "something is simplified at r_thresh {r_thresh}");
        }
        // Interpolation between places that all see the same changes nothing, either.
        let image = interpolated(36, 24, 16, 6);
        let same = Estimate::whole(&render(&prepared, &image).film);
        let rendering = render(&prepared, &fixed(36, 24, 64, 5));
        let got = Estimate::whole(&rendering.film);
        println!("r_thresh {r_thresh}: interpolated {same:?}, by pixel {got:?}");
        // The noise of records is in no pixel's variance: hundreds of rays each, some hundred records.
        let difference = (same.mean - got.mean).abs();
        assert!(difference < 0.002 * exact + threshold(ALPHA, 5) * same.error.hypot(got.error), "{same:?} {got:?}");
        // The solution's own stated standard error belongs to all pixels together.
        let lores = rendering.film.mean(|p| p.lores.mean());
        let error = got.error.hypot(stats.error.radiosity * lores);
        println!(
            "r_thresh {r_thresh}: {got:?}, radiosity error {}, {} clusters",
            stats.error.radiosity, stats.counts.clusters
        );
        let z = (got.mean - exact) / error;
        assert!(z.abs() < threshold(ALPHA, 5), "r_thresh {r_thresh}: {} is not {exact}, z = {z}", got.mean);
    }
}

/// The bias meter, with the cache and without it, tells how far interpolation changes the mean of the image: not at all, to its
/// standard error, or by less than half a percent.
#[test]
fn interpolation_keeps_the_mean() {
    let room = scene(&lit_room());
    let (prepared, _) = prepare(&room, with(Method::Gsii));
    let images = [fixed(96, 72, 128, 3), interpolated(96, 72, 32, 4)].map(|params| render(&prepared, &params));
    let cache = images[1].cache.as_ref().expect("GSII interpolates");
    assert!(!cache.is_empty());
    let lores = images.each_ref().map(|i| i.film.relative_errors().lores);
    println!("{} records, noise of LORES {lores:?}", cache.len());
    assert!(lores[1] < lores[0], "less noise with a quarter of the trials");
    let world = World { cache: Some(cache), ..prepared.world() };
    let camera = &prepared.scene.cameras[0];
    let [without, with] =
        [prepared.world(), world].map(|world| bias::measure(&world, camera, &fixed(96, 72, 1, 9), 1 << 16));
    for band in 0..3 {
        let change = (with.mean[band] - without.mean[band]) / without.reference[band];
        let error = with.standard_error[band].hypot(without.standard_error[band]) / without.reference[band];
        println!("band {band}: {change:.5} +- {error:.5}");
        assert!(change.abs() < 0.005 + threshold(ALPHA, 3) * error, "band {band}: {change} +- {error}");
    }
}

#[test]
fn adaptive_sampling_agrees_with_fixed_sampling() {
    let room = scene(&lit_room());
    let (prepared, _) = prepare(&room, with(Method::Mcpt));
    let (width, height, block) = (64, 48, 16);
    let adaptive = RenderParams { min_trials: 4, max_trials: 256, ..fixed(width, height, 4, 11) };
    let adaptive = render(&prepared, &adaptive).film;
    let used: Vec<u32> = adaptive.pixels().map(|p| p.lores.trials()).collect();
    assert!(used.iter().min() < used.iter().max(), "trials are shared out unevenly");
    let plain = render(&prepared, &fixed(width, height, 256, 12)).film;
    let blocks: Vec<(u32, u32)> = (0..height / block).flat_map(|y| (0..width / block).map(move |x| (x, y))).collect();
    let limit = threshold(ALPHA, blocks.len() + 1);
    for (bx, by) in &blocks {
        let inside = |x: u32, y: u32| (x / block, y / block) == (*bx, *by);
        let z = Estimate::of(&adaptive, inside).z(Estimate::of(&plain, inside));
        assert!(z.abs() < limit, "block {bx}, {by}: z = {z}");
    }
    let (a, b) = (Estimate::whole(&adaptive), Estimate::whole(&plain));
    println!("adaptive {a:?}, fixed {b:?}, z {}", a.z(b));
    assert!(a.z(b).abs() < limit);
}

/// GSII differs from path tracing by its bias, which the bias meter knows without the path-traced image.
#[test]
fn gsii_is_path_tracing_plus_the_measured_bias() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/office-high.glb");
    let office = std::sync::Arc::new(gsii::scene::load(&path, &Default::default()).unwrap());
    let (gsii, _) = prepare(&office, with(Method::Gsii));
    let (mcpt, _) = prepare(&office, with(Method::Mcpt));
    let a = Estimate::whole(&render(&gsii, &fixed(48, 32, 128, 21)).film);
    let b = Estimate::whole(&render(&mcpt, &fixed(48, 32, 128, 22)).film);
    let measured = bias::measure(&gsii.world(), &office.cameras[0], &fixed(48, 32, 1, 23), 1 << 16);
    let bias = measured.mean.iter().sum::<f64>() / 3.0;
    let bias_error = measured.standard_error.iter().sum::<f64>() / 3.0;
    let z = (a.mean - b.mean - bias) / a.error.hypot(b.error).hypot(bias_error);
    println!("GSII {a:?}, MCPT {b:?}, bias {bias} +- {bias_error}, z {z}");
    assert!(z.abs() < threshold(ALPHA, 1));
    // What the method promises: indirect light within a few per cent.
    assert!((a.mean / b.mean - 1.0).abs() < 0.05, "{a:?} {b:?}");
}
