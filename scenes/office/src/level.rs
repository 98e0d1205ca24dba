//! Finds the level of detail that meets a number of surfaces or triangles.

use crate::office::{Detail, Office};

/// Surfaces of the paper's environment ("Results").
pub const PAPER_SURFACES: u64 = 10_948;

/// Usual tessellation with as much clutter as makes the number of surfaces come closest.
pub fn for_surfaces(surfaces: u64, seed: u32) -> Detail {
    closest(surfaces, (0.5, 2.0), |clutter| {
        let detail = Detail { tessellation: 1.0, clutter };
        (detail, Office::build(detail, seed).surface_count())
    })
}

/// The level whose number of triangles comes closest; with `clutter`, the tessellation of just so many things.
pub fn for_triangles(triangles: u64, clutter: Option<f32>, seed: u32) -> Detail {
    closest(triangles, (0.001, 1000.0), |scale| {
        let detail = clutter.map_or(Detail::level(scale), |clutter| Detail { tessellation: scale, clutter });
        (detail, Office::build(detail, seed).triangle_count())
    })
}

/// Bisects the logarithm of a scale on which `measure` grows, and keeps the closest seen.
fn closest(target: u64, (mut low, mut high): (f32, f32), measure: impl Fn(f32) -> (Detail, u64)) -> Detail {
    let (mut best, mut found) = measure(low);
    for _ in 0..24 {
        let middle = (low * high).sqrt();
        let (detail, count) = measure(middle);
        if count.abs_diff(target) < found.abs_diff(target) {
            (best, found) = (detail, count);
        }
        match count.cmp(&target) {
            std::cmp::Ordering::Less => low = middle,
            std::cmp::Ordering::Greater => high = middle,
            std::cmp::Ordering::Equal => break,
        }
    }
    best
}
