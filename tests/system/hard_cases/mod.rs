//! Numerically hard scenes that have no number of their own among the reference cases: what must not change, leak, vanish or break.

mod light;
mod rays;
mod scenes;
mod surfaces;

use gsii::render::RenderParams;
use gsii::render::film::Film;

use crate::kit::Part;

/// Four standard errors: a false alarm in 16 000 comparisons.
const SIGMA: f64 = 4.0;

/// Fixed sampling.
fn fixed([width, height]: [u32; 2], trials: u32) -> RenderParams {
    RenderParams {
        width,
        height,
        min_trials: trials,
        max_trials: trials,
        interpolate: false,
        region: None,
        error: f32::INFINITY,
        hires_error: 1.0,
        lores_error: 1.0,
        time_limit: None,
        features: false,
        seed: 1,
        frame: None,
    }
}

/// Darkest and brightest value of an image and its mean, first band.
fn range(film: &Film) -> [f64; 3] {
    let values: Vec<f64> = film.pixels().map(|p| Part::All.of(p)[0]).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        mean,
    ]
}
