//! Images against converged references of an independent path tracer, where they are at hand (`../shared/refs/images`).

mod common;

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{Estimate, fixed, interpolated, prepare, render, shared, threshold, values};
use gsii::image::{self, Image};
use gsii::pipeline::{Method, Settings};
use gsii::render::{Film, RenderParams};
use gsii::scene::{LoadOptions, load};

const SIZE: u32 = 256;

fn film(scene: &Path, method: Method, params: &RenderParams) -> Film {
    let scene = Arc::new(load(scene, &LoadOptions::default()).unwrap());
    let (prepared, _) = prepare(&scene, Settings { method, ..Settings::default() });
    render(&prepared, params).film
}

fn as_image(film: &Film) -> Image {
    let values = values(film);
    let mut image = Image::new(film.width, film.height);
    for (band, name) in ["R", "G", "B"].into_iter().enumerate() {
        image.push(name, values[band..].iter().step_by(3).map(|&v| v as f32).collect());
    }
    image
}

/// Mean over all bands and the pixels for which `inside` is true.
fn mean(image: &Image, inside: impl Fn(u32, u32) -> bool) -> f64 {
    let bands = image.rgb_or_grey().unwrap();
    let pixels = (0..image.pixels() as u32).filter(|&i| inside(i % image.width(), i / image.width()));
    let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), i| {
        (sum + bands.iter().map(|b| f64::from(b[i as usize])).sum::<f64>() / 3.0, count + 1.0)
    });
    sum / count
}

fn check_gsii(name: &str, params: &RenderParams) {
    let Some(shared) = shared() else { return };
    let reference = image::read(&shared.join(format!("refs/images/{name}.exr"))).unwrap();
    let film = film(&shared.join(format!("scenes/{name}.glb")), Method::Gsii, params);
    let metrics = image::compare(&reference, &as_image(&film)).unwrap();
    let ratio = Estimate::whole(&film).mean / mean(&reference, |_, _| true);
    println!("{name}: mean ratio {ratio:.5}, relMSE {:.3e}, bands {:?}", metrics.rel_mse, metrics.relative_bias);
    assert!((ratio - 1.0).abs() <= 0.01, "mean ratio {ratio}");
    assert!(metrics.rel_mse <= 2e-3, "relMSE {}", metrics.rel_mse);
}

#[test]
fn gsii_agrees_with_the_reference_of_cornell() {
    check_gsii("cornell", &interpolated(SIZE, SIZE, 32, 0));
    check_gsii("cornell", &fixed(SIZE, SIZE, 256, 0));
}

#[test]
fn gsii_agrees_with_the_reference_of_clutter() {
    check_gsii("clutter", &interpolated(SIZE, SIZE, 32, 0));
    check_gsii("clutter", &fixed(SIZE, SIZE, 256, 0));
}

/// Blocks of 16 x 16 pixels: none may be off by more than the largest of 256 normal deviates is with probability 1e-4.
fn check_path_tracing(name: &str) {
    let Some(shared) = shared() else { return };
    let reference = image::read(&shared.join(format!("refs/images/{name}.exr"))).unwrap();
    let film = film(&shared.join(format!("scenes/{name}.glb")), Method::Mcpt, &fixed(SIZE, SIZE, 64, 0));
    let ratio = Estimate::whole(&film).mean / mean(&reference, |_, _| true);
    assert!((ratio - 1.0).abs() <= 0.003, "mean ratio {ratio}");
    let block = 16;
    let across = SIZE / block;
    let limit = threshold(1e-4, (across * across) as usize);
    let mut worst = 0.0f64;
    for number in 0..across * across {
        let inside = |x: u32, y: u32| y / block * across + x / block == number;
        let got = Estimate::of(&film, inside);
        let exact = mean(&reference, inside);
        let z = if got.mean == exact { 0.0 } else { (got.mean - exact) / got.error };
        worst = worst.max(z.abs());
        assert!(z.abs() < limit, "{name}, block {number}: {got:?}, reference {exact}, z = {z:.2}, limit {limit:.2}");
    }
    println!("{name}: mean ratio {ratio:.5}, largest deviation of a block {worst:.2} standard errors of {limit:.2}");
}

#[test]
fn path_tracing_agrees_with_the_reference_of_cornell() {
    check_path_tracing("cornell");
}

#[test]
fn path_tracing_agrees_with_the_reference_of_clutter() {
    check_path_tracing("clutter");
}

/// Lambertian variants of real interiors against references in two halves.
#[test]
#[ignore = "needs python3 and several minutes: four interiors at 256 x 144 with 256 trials a pixel"]
fn interiors_agree_with_their_references() {
    let Some(shared) = shared() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut off = Vec::new();
    for name in ["white-room", "bathroom", "classroom", "modern-hall"] {
        let diffuse = folder.path().join(format!("{name}.glb"));
        let made = Command::new("python3")
            .arg(shared.join("scenes/make_diffuse.py"))
            .args([&shared.join(format!("scenes/{name}.glb")), &diffuse])
            .status();
        assert!(made.unwrap().success());
        let halves =
            ["a", "b"].map(|half| image::read(&shared.join(format!("refs/images/{name}.{half}.exr"))).unwrap());
        let film = film(&diffuse, Method::Gsii, &fixed(256, 144, 256, 0));
        let image = as_image(&film);
        let cross = image::compare_halves([&halves[0], &halves[1]], &image).unwrap();
        let reference = 0.5 * (mean(&halves[0], |_, _| true) + mean(&halves[1], |_, _| true));
        let ratio = mean(&image, |_, _| true) / reference;
        println!("{name}: mean ratio {ratio:.4}, relMSE without the reference's noise {:.3e}", cross.rel_mse);
        if (ratio - 1.0).abs() > 0.03 {
            off.push(format!("{name}: mean ratio {ratio:.4}"));
        }
    }
    assert!(off.is_empty(), "{off:?}");
}
