//! Simplifies scenes and prints one row for each: what the paper tabulates, and how well the boxes fit.
//!
//! `cargo run --release --example simplification_table -- [--r-thresh SHARE] [--beta X] [--paper] SCENE...`
//! where SHARE is `r_thresh` over the largest extent of the scene's content (default 0.053, the paper's).

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use gsii::backend::embree::EmbreeBackend;
use gsii::progress::Progress;
use gsii::scene::{LoadOptions, load};
use gsii::simplify::{BoxFit, Class, SimplifyParams, simplify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut share, mut beta, mut box_fit, mut scenes) =
        (0.053f32, 0.5 / std::f32::consts::PI, BoxFit::Flux, Vec::new());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--r-thresh" => share = args.next().ok_or("--r-thresh needs a value")?.parse()?,
            "--beta" => beta = args.next().ok_or("--beta needs a value")?.parse()?,
            "--paper" => box_fit = BoxFit::Paper1993,
            _ => scenes.push(arg),
        }
    }
    let backend = EmbreeBackend::new(0)?;
    println!(
        "{:<16} {:>9} {:>8} {:>7} {:>8} {:>8} {:>7} {:>9} {:>8} {:>8} {:>8} {:>9} {:>6} {:>6} {:>6}",
        "scene",
        "triangles",
        "surfaces",
        "normal",
        "complex",
        "clusters",
        "dropped",
        "simple tr",
        "mean|i|",
        "max|i|",
        "mean|c|",
        "rays",
        "s",
        "mean p",
        "turned"
    );
    for path in scenes {
        let path = Path::new(&path);
        let scene = match load(path, &LoadOptions::default())
            .or_else(|_| load(path, &LoadOptions { without_textures: true }))
        {
            Ok(scene) => Arc::new(scene),
            Err(error) => {
                println!("{error}");
                continue;
            }
        };
        // The extent that holds most of the surfaces, as a far sky or ground plane says nothing about the room.
        let r_thresh = share * content_extent(&scene);
        let params =
            SimplifyParams { r_thresh, beta, box_fit, crease_angle: 30f32.to_radians(), face_resolution: 2, seed: 1 };
        let start = Instant::now();
        let s = simplify(&scene, &backend, &params, &Progress::silent())?;
        let seconds = start.elapsed().as_secs_f64();
        let normal = s.surfaces.iter().filter(|s| s.class == Class::Normal).count();
        let dropped = s.surfaces.iter().filter(|s| s.class == Class::Complex { cluster: None }).count();
        let n = s.clusters.len().max(1) as f32;
        let i = || s.clusters.iter().map(|c| c.residual.intercepted.abs());
        let c = s.clusters.iter().map(|c| c.residual.reflected.abs().element_sum() / 3.0).sum::<f32>() / n;
        println!(
            "{:<16} {:>9} {:>8} {:>7} {:>8} {:>8} {:>7} {:>9} {:>8.4} {:>8.3} {:>8.4} {:>9} {:>6.2} {:>6.3} {:>6}",
            path.file_stem().unwrap_or_default().to_string_lossy(),
            scene.mesh.triangles.len(),
            s.surfaces.len(),
            normal,
            s.surfaces.len() - normal,
            s.clusters.len(),
            dropped,
            s.geometry.triangles.len(),
            i().fold(0.0, |a, b| a + b) / n,
            i().fold(0.0, f32::max),
            c,
            s.rays,
            seconds,
            s.clusters.iter().map(|c| c.residual.hit_share).sum::<f32>() / n,
            s.clusters.iter().filter(|c| c.equivalent_box.axes != glam::Mat3::IDENTITY).count()
        );
        for warning in &s.warnings {
            println!("    {warning}");
        }
    }
    Ok(())
}

/// Largest extent between the 1st and 99th percentile of triangle positions.
fn content_extent(scene: &gsii::scene::Scene) -> f32 {
    (0..3)
        .map(|axis| {
            let mut at: Vec<f32> =
                scene.mesh.triangles.iter().map(|t| scene.mesh.positions[t[0] as usize][axis]).collect();
            at.sort_by(f32::total_cmp);
            let n = at.len() - 1;
            at[n - n / 100] - at[n / 100]
        })
        .fold(0.0, f32::max)
}
