//! How much of bare Embree's speed the two passes reach.
//!
//! Every ray of a small rendering of the office is recorded, then replayed in the same batches through the backend with
//! nothing around it. Printed is, for each pass, rays a second while rendering over rays a second of the replay. One thread.
//!
//! `cargo bench --bench passes -- Gsii HIRES` measures only what has one of these words in its name, of each kind.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use gsii::backend::{Coherence, Hit, Ray, RayScene, Visible};
use gsii::pipeline::{Method, Prepared, Settings, Stats, choose_camera};
use gsii::progress::Progress;
use gsii::render::path::Passes;
use gsii::render::world::Batch;
use gsii::render::{BATCH_TRIALS, FarField, Film, Workspace, World};
use gsii::scene::Camera;
use gsii::scene::gltf::{LoadOptions, load};

/// Runs of each kind; the median ratio is printed.
const RUNS: usize = 15;

/// Pixels of the picture.
const SIZE: [u32; 2] = [160, 90];

/// Trials a pixel.
const TRIALS: u32 = 64;

struct Query {
    rays: Vec<Ray>,
    visible: Visible,
    coherence: Coherence,
    occlusion: bool,
}

/// Passes queries on and keeps a copy of the rays.
struct Recorder<'a> {
    scene: &'a dyn RayScene,
    batches: Mutex<Vec<Query>>,
}

impl<'a> Recorder<'a> {
    fn new(scene: &'a dyn RayScene) -> Self {
        Recorder { scene, batches: Mutex::default() }
    }

    fn keep(&self, rays: &[Ray], visible: Visible, coherence: Coherence, occlusion: bool) {
        let mut batches = self.batches.lock().unwrap_or_else(PoisonError::into_inner);
        batches.push(Query { rays: rays.to_vec(), visible, coherence, occlusion });
    }

    /// Seconds to trace the recorded batches again.
    fn replay(&self) -> f64 {
        let batches = self.batches.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut hits, mut occluded) = (Vec::new(), Vec::new());
        let start = Instant::now();
        for b in batches.iter() {
            if b.occlusion {
                occluded.resize(b.rays.len(), false);
                self.scene.occluded(&b.rays, b.visible, b.coherence, &mut occluded);
                black_box(&occluded);
            } else {
                hits.resize(b.rays.len(), Hit::MISS);
                self.scene.closest(&b.rays, b.visible, b.coherence, &mut hits);
                black_box(&hits);
            }
        }
        start.elapsed().as_secs_f64()
    }
}

impl RayScene for Recorder<'_> {
    fn closest(&self, rays: &[Ray], visible: Visible, coherence: Coherence, hits: &mut [Hit]) {
        self.keep(rays, visible, coherence, false);
        self.scene.closest(rays, visible, coherence, hits);
    }

    fn occluded(&self, rays: &[Ray], visible: Visible, coherence: Coherence, occluded: &mut [bool]) {
        self.keep(rays, visible, coherence, true);
        self.scene.occluded(rays, visible, coherence, occluded);
    }

    fn memory_bytes(&self) -> usize {
        self.scene.memory_bytes()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let scene = Arc::new(load(Path::new("scenes/office-high.glb"), &LoadOptions::default())?);
    let camera = choose_camera(&scene, None)?.clone();
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let wanted = |name: &str, all: [&str; 2]| {
        words.iter().any(|w| w == name) || !words.iter().any(|w| all.contains(&w.as_str()))
    };
    for method in [Method::Gsii, Method::Mcpt] {
        if !wanted(&format!("{method:?}"), ["Gsii", "Mcpt"]) {
            continue;
        }
        let settings = Settings { method, ..Settings::default() };
        let prepared = Prepared::new(Arc::clone(&scene), &camera, settings, &Progress::silent(), &mut Stats::new())?;
        let world = prepared.world();
        println!("{method:?}, office-high, one thread:");
        for (name, passes) in [("HIRES", Passes::HIRES), ("LORES", Passes::LORES)] {
            if !wanted(name, ["HIRES", "LORES"]) {
                continue;
            }
            let (ratio, rate) = measure(&world, &camera, passes);
            println!("  {name}: {rate:.2} million rays a second, {ratio:.2} of the bare replay");
        }
    }
    Ok(())
}

/// Median ratio to the replay, and median million rays a second while rendering.
fn measure(world: &World<'_>, camera: &Camera, passes: Passes) -> (f64, f64) {
    let detailed = Recorder::new(world.detailed);
    let simplified = world.far.map(|far| Recorder::new(far.rays));
    let far = world.far.zip(simplified.as_ref()).map(|(far, rays)| FarField { rays, ..far });
    draw(&World { detailed: &detailed, far, ..*world }, camera, passes);
    let mut runs: Vec<(f64, f64)> = (0..RUNS)
        .map(|_| {
            let (seconds, rays) = draw(world, camera, passes);
            let replay = detailed.replay() + simplified.as_ref().map_or(0.0, Recorder::replay);
            (replay / seconds, rays as f64 / seconds / 1e6)
        })
        .collect();
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    runs[RUNS / 2]
}

/// Draws a small picture; seconds and rays.
fn draw(world: &World<'_>, camera: &Camera, passes: Passes) -> (f64, u64) {
    let mut film = Film::new(SIZE[0], SIZE[1]);
    let mut ws = Workspace::default();
    let start = Instant::now();
    for tile in &mut film.tiles {
        let pixels: Vec<u32> = (0..tile.pixels.len() as u32).collect();
        for first in (0..TRIALS).step_by(BATCH_TRIALS as usize) {
            let batch = Batch { pixels: &pixels, first, trials: BATCH_TRIALS, passes, features: false, seed: 0 };
            world.render_tile(&mut ws, camera, SIZE, batch, tile);
        }
    }
    (start.elapsed().as_secs_f64(), ws.counts.hires() + ws.counts.lores())
}
