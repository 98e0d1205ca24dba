//! Equivalent boxes: everything that is measured with rays against a cluster's own surfaces.
//!
//! Clusters interpenetrate, and a ray must meet one of them only. Building one acceleration structure for each of thousands
//! of clusters wastes time on commits, skipping foreign hits wastes rays; so all clusters of a pass go into one scene in which
//! each is moved to a cell of its own, turned into its box's axes and scaled to unit size (`Stage`). Rays end before they
//! leave the cell. Unit size also makes error bounds the same for a thumbtack and a tree.

pub mod flux;
pub mod frame;
pub mod lines;
pub mod paper1993;
#[cfg(test)]
mod paper_tests;
pub mod residual;

use std::sync::Arc;

use glam::{Mat3, Vec3};

pub use flux::{FluxFit, fit_flux};
pub use frame::Frame;
pub use paper1993::{PaperFit, fit_paper1993};

use super::geometry::RemappedFilter;
use crate::backend::{Part, PartKind, Ray, RayBackend, RayScene, TriangleSet};
use crate::error::Result;
use crate::scene::{Aabb, Scene};

/// Distance between the centres of neighbouring cells, in units of a cluster's largest edge: room for [`MARGIN`] on both
/// sides.
const SPACING: f32 = 1.25;

/// Rays start this far before the bounding box and may go on as far behind it. Less than half of the gap between cells.
const MARGIN: f32 = 0.05;

/// Boxes are never thinner than this share of their cluster's largest edge: radiosity needs faces with area, and rays need
/// two sides that do not coincide.
pub const LEAST_THICKNESS: f32 = 1e-3;

/// Clusters side by side, ready for a backend.
pub(crate) struct Stage {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<Part>,
    /// Triangle of the scene for each triangle here.
    source: Arc<[u32]>,
    /// Bounds of each cluster in its cell, as placed: the reference for all rays.
    bounds: Vec<Aabb>,
}

impl Stage {
    /// Places clusters, each a list of triangles of `scene` and the frame of its bounding box.
    pub(crate) fn new(scene: &Scene, clusters: &[(&[u32], Frame)]) -> Self {
        let side = (clusters.len() as f64).cbrt().ceil() as usize;
        let middle = 0.5 * (side as f32 - 1.0);
        let count = clusters.iter().map(|(t, _)| t.len()).sum::<usize>();
        let mut stage = Stage {
            positions: Vec::with_capacity(3 * count),
            triangles: Vec::with_capacity(count),
            parts: Vec::new(),
            source: Arc::new([]),
            bounds: vec![Aabb::EMPTY; clusters.len()],
        };
        let mut source = Vec::with_capacity(count);
        for kind in [PartKind::Opaque, PartKind::Filtered] {
            let start = stage.triangles.len() as u32;
            for (i, (triangles, frame)) in clusters.iter().enumerate() {
                let cell = Vec3::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32) - middle;
                let (to_local, scale) = (frame.axes.transpose(), frame.scale());
                for &t in triangles.iter() {
                    let object = scene.mesh.object(t);
                    if (object.kind == PartKind::Filtered) != (kind == PartKind::Filtered) {
                        continue;
                    }
                    let first = stage.positions.len() as u32;
                    stage.triangles.push([first, first + 1, first + 2]);
                    source.push(t);
                    for corner in scene.mesh.corners(t) {
                        let placed = to_local * (corner - frame.centre) * scale + SPACING * cell;
                        stage.bounds[i] = stage.bounds[i].with(placed);
                        stage.positions.push(placed);
                    }
                }
            }
            let end = stage.triangles.len() as u32;
            if start < end {
                stage.parts.push(Part { triangles: start..end, kind });
            }
        }
        stage.source = source.into();
        stage
    }

    /// Builds the acceleration structure.
    pub(crate) fn build(&self, scene: &Arc<Scene>, backend: &dyn RayBackend) -> Result<Box<dyn RayScene>> {
        let filtered = self.parts.iter().any(|p| p.kind == PartKind::Filtered);
        let filter = if filtered { super::scene_filter(scene) } else { None };
        backend.build(&TriangleSet {
            positions: &self.positions,
            triangles: &self.triangles,
            parts: &self.parts,
            filter: filter.map(|f| RemappedFilter::share(self.source.clone(), f)),
        })
    }
}

/// One cluster on a stage, ready to be probed.
#[derive(Clone, Copy)]
pub(crate) struct Probe<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) stage: &'a Stage,
    pub(crate) rays: &'a dyn RayScene,
    pub(crate) bounds: Aabb,
    /// `r_thresh` at the stage's scale.
    pub(crate) reach: f32,
}

impl<'a> Probe<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        stage: &'a Stage,
        rays: &'a dyn RayScene,
        cluster: usize,
        frame: &Frame,
        r_thresh: f32,
    ) -> Self {
        Probe { scene, stage, rays, bounds: stage.bounds[cluster], reach: r_thresh * frame.scale() }
    }

    /// The ray from `origin` to where it has left the cluster.
    fn ray(&self, origin: Vec3, direction: Vec3) -> Ray {
        let room = self.bounds.expanded(MARGIN);
        // + 0.0 turns -0 into 0, which leaves at plus infinity through `room.max`
        let direction = direction + 0.0;
        let far = Vec3::select(direction.cmpge(Vec3::ZERO), room.max, room.min);
        let exit = ((far - origin) / direction).to_array().into_iter().fold(f32::INFINITY, f32::min);
        Ray { origin, t_near: 0.0, direction, t_far: exit.max(0.0) }
    }

    fn triangle(&self, placed: u32) -> [Vec3; 3] {
        self.stage.triangles[placed as usize].map(|i| self.stage.positions[i as usize])
    }

    fn reflectance(&self, placed: u32, u: f32, v: f32) -> Vec3 {
        self.scene.base_color(self.stage.source[placed as usize], u, v)
    }
}

/// Axes along and across face `face` (0..6): its normal axis, then the other two in ascending order.
pub(crate) fn face_axes(face: usize) -> (usize, usize, usize) {
    match face / 2 {
        0 => (0, 1, 2),
        1 => (1, 0, 2),
        _ => (2, 0, 1),
    }
}

/// -1 for the three faces at the lower end of their axes, 1 for the others.
pub(crate) fn face_side(face: usize) -> f32 {
    if face & 1 == 0 { -1.0 } else { 1.0 }
}

/// Index of the patch at `s`, `t` (0..=1) of a face with `resolution^2` patches.
pub(crate) fn patch_index(s: f32, t: f32, resolution: u32) -> usize {
    let cell = |x: f32| ((x * resolution as f32) as u32).min(resolution - 1);
    (cell(t) * resolution + cell(s)) as usize
}

/// Halved surface of a box: the sum of its three face areas.
pub(crate) fn half_surface(edges: Vec3) -> f64 {
    let [x, y, z] = edges.as_dvec3().to_array();
    x * y + y * z + z * x
}

/// Fills patches that nothing was measured for with the mean of their face, else with that of the cluster.
pub(crate) fn fill_patches(measured: &[Vec<Option<Vec3>>; 6], cluster_mean: Vec3) -> [Vec<Vec3>; 6] {
    std::array::from_fn(|face| {
        let known: Vec<Vec3> = measured[face].iter().flatten().copied().collect();
        let mean = if known.is_empty() { cluster_mean } else { known.iter().sum::<Vec3>() / known.len() as f32 };
        measured[face].iter().map(|p| p.unwrap_or(mean)).collect()
    })
}

/// A frame around `triangles` in the given axes.
pub(crate) fn frame_along(scene: &Scene, triangles: &[u32], axes: Mat3) -> Frame {
    Frame::around(triangles.iter().flat_map(|&t| scene.mesh.corners(t)), axes)
}
