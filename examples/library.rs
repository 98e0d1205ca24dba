//! Renders a file with the library: `cargo run --release --example library -- SCENE.glb IMAGE.exr`

use std::path::Path;
use std::sync::Arc;

use gsii::image::{self, Metadata, WriteOptions};
use gsii::pipeline::{Method, Prepared, Settings, Stats, choose_camera};
use gsii::progress::Progress;
use gsii::render::layers::{Layer, develop};
use gsii::render::{RenderParams, bias};
use gsii::scene::{LoadOptions, load};

/// Renders what the first camera of `scene` sees, says how far it is to be trusted, and writes the image with two layers.
pub fn render(scene: &Path, output: &Path, width: u32, height: u32) -> gsii::Result<()> {
    let scene = Arc::new(load(scene, &LoadOptions::default())?);
    let camera = choose_camera(&scene, None)?.clone();
    // All lengths are chosen from the scene; `Method::Mcpt` would be path tracing.
    let settings = Settings { method: Method::Gsii, ..Settings::default() };
    let mut stats = Stats::new();
    let prepared = Prepared::new(scene, &camera, settings, &Progress::silent(), &mut stats)?;
    println!("{} triangles, of which clusters hide {} surfaces", stats.counts.triangles, stats.counts.complex);

    let params = RenderParams {
        width,
        height,
        region: None,
        min_trials: 16,
        max_trials: 512,
        error: 0.03,       // of the image
        hires_error: 0.12, // of any pixel
        lores_error: 0.12,
        time_limit: None,
        features: true, // albedo, normal and depth are recorded
        interpolate: true,
        seed: 0,
        frame: None,
    };
    let film = prepared.render(&camera, &params, &Progress::silent()).film;
    let total = film.mean(|pixel| pixel.hires.mean()) + film.mean(|pixel| pixel.lores.mean());
    let (off, interval) = bias::measure(&prepared.world(), &camera, &params, 4096).relative_to(total);
    println!("mean radiance {total:.4} W/(sr m^2), bias {:+.2} +- {:.2} %", 100.0 * off, 100.0 * interval);
    let image = develop(&film, &[Layer::Depth, Layer::Normal]);
    image::write(output, &image, &Metadata::default(), &WriteOptions::default())
}

fn main() -> gsii::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, output] = arguments.as_slice() else {
        return Err(gsii::Error::Usage("which scene, and which image?".to_owned()));
    };
    render(Path::new(scene), Path::new(output), 640, 360)
}
