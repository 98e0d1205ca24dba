//! How well a box stands for its cluster, on lines that were not used to fit it.

use glam::Vec3;

use super::flux::{LineTally, box_hit_shares, mean_reflectance};
use super::half_surface;
use crate::simplify::FitResidual;

impl FitResidual {
    /// Compares a box with edges `edges` to what `fresh` lines tell about the cluster in a bounding box with edges `size`.
    ///
    /// The share of uniform lines that a convex box inside the bounding box intercepts is the ratio of their surfaces, exactly,
    /// so only the cluster is sampled.
    pub(crate) fn new(size: Vec3, edges: Vec3, reflectance: &[Vec<Vec3>; 6], fresh: &LineTally) -> Self {
        let of_box = half_surface(edges) / half_surface(size);
        let of_cluster = fresh.hit_share();
        if of_cluster == 0.0 {
            return FitResidual { intercepted_error: f32::INFINITY, ..FitResidual::default() };
        }
        let ratio = of_box / of_cluster;
        let shares = box_hit_shares(edges, size);
        let misfit = |axis: usize| (shares[axis] - f64::from(fresh.hits[axis]) / f64::from(fresh.lines)).abs();
        FitResidual {
            hit_share: of_cluster as f32,
            intercepted: (ratio - 1.0) as f32,
            intercepted_error: (ratio * fresh.relative_error()) as f32,
            directional: ((misfit(0) + misfit(1) + misfit(2)) / of_cluster) as f32,
            hidden: fresh.hidden_share() as f32,
            reflected: mean_reflectance(reflectance, edges) - fresh.albedo(),
        }
    }
}
