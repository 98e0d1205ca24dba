//! How preparation, LORES and memory grow with the number of triangles: one row of a table for one scene.
//!
//! Core seconds of an image of 320 x 213 pixels with 16 trials; memory is the most that the process held (file included) over what it held
//! before and over what Embree holds of the two scenes, for each triangle.
//!
//! `cargo run --release --example scaling -- SCENE`; `scripts/scaling.sh` makes offices of many sizes and the table of them.

use std::path::Path;
use std::sync::Arc;

use gsii::clock::Stopwatch;
use gsii::pipeline::{Prepared, Settings, Stats};
use gsii::progress::Progress;
use gsii::render::RenderParams;
use gsii::scene::{LoadOptions, load};

const SIZE: [u32; 2] = [320, 213];
const TRIALS: u32 = 16;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("which scene?")?;
    let before = status("VmRSS:");
    let start = Stopwatch::start();
    let scene = Arc::new(load(Path::new(&path), &LoadOptions::default())?);
    let loading = start.spent().cpu;
    let camera = scene.cameras.first().ok_or("the scene has no camera")?.clone();
    let (progress, mut stats) = (Progress::silent(), Stats::new());
    let prepared = Prepared::new(scene, &camera, Settings::default(), &progress, &mut stats)?;
    let params = RenderParams {
        width: SIZE[0],
        height: SIZE[1],
        region: None,
        min_trials: TRIALS,
        max_trials: TRIALS,
        error: f32::INFINITY,
        hires_error: 0.05,
        lores_error: 0.05,
        time_limit: None,
        features: false,
        interpolate: true,
        seed: 0,
        frame: None,
    };
    stats.record_rendering(&prepared.render(&camera, &params, &progress));
    let far = prepared.far.as_ref().ok_or("there is no far field")?;
    let embree = prepared.detailed.memory_bytes() + far.rays.memory_bytes();
    let own = status("VmHWM:").saturating_sub(before + embree as u64);
    let (seconds, triangles) = (&stats.cpu_seconds, stats.counts.triangles);
    println!(
        "| {triangles} | {} | {} | {loading:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.0} | {:.0} |",
        far.geometry.triangles.len(),
        stats.counts.patches,
        seconds.simplify,
        seconds.build,
        seconds.radiosity,
        seconds.hires,
        seconds.lores,
        own as f64 / triangles as f64,
        embree as f64 / triangles as f64,
    );
    Ok(())
}

/// A number of bytes that the system knows of this process; 0 where it tells nothing.
fn status(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(name));
    let kib = line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}
