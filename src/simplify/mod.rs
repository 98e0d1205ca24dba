//! Geometric simplification: surfaces are classified, small ones clustered, clusters replaced by equivalent boxes.

pub mod geometry;

use glam::{Mat3, Vec3};

pub use geometry::{SimplifiedGeometry, TriangleSource};

use crate::backend::RayBackend;
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::{Aabb, Scene};

/// How a cluster's box is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BoxFit {
    /// Conserves intercepted flux, escape albedo a face patch. The default.
    #[default]
    Flux,
    /// The paper's pseudo-code, to the letter.
    Paper1993,
}

/// Parameters of [`simplify`].
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifyParams {
    /// `r_thresh`, scene length units, 0..=infinity.
    pub r_thresh: f32,
    /// The paper's beta, 0..=1.
    pub beta: f32,
    /// How boxes are fitted.
    pub box_fit: BoxFit,
    /// Largest angle between the normals of neighbouring triangles of one surface, radians.
    pub crease_angle: f32,
    /// Face patches along each edge of a box face.
    pub face_resolution: u32,
    /// Seed of the fitting rays.
    pub seed: u32,
}

/// What the paper calls a surface: connected triangles of one material that turn no more than the crease angle between
/// neighbours.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Sum of its triangles' areas, one side.
    pub area: f64,
    /// Number of triangles.
    pub triangles: u32,
    /// Index of its object in the mesh.
    pub object: u32,
    /// Bounds.
    pub bounds: Aabb,
    /// Whether it is kept, clustered or dropped.
    pub class: Class,
}

/// What becomes of a surface in the simplified scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Large enough (or a light source, mirror or glass): in both scenes.
    Normal,
    /// Small: only in the detailed scene, replaced by the box of this cluster, or by nothing when isolated.
    Complex {
        /// Index into [`Simplified::clusters`]; `None` for isolated small surfaces.
        cluster: Option<u32>,
    },
}

impl Class {
    /// Whether it is left out of the simplified scene without anything in its place.
    pub fn is_isolated(self) -> bool {
        self == Class::Complex { cluster: None }
    }
}

/// A group of small surfaces and the box that replaces it.
#[derive(Clone, Debug)]
pub struct Cluster {
    /// Indices into [`Simplified::surfaces`].
    pub surfaces: Vec<u32>,
    /// Number of triangles.
    pub triangles: u32,
    /// Bounds of the surfaces.
    pub bounds: Aabb,
    /// The box.
    pub equivalent_box: EquivalentBox,
    /// How well it stands for the cluster.
    pub residual: FitResidual,
}

/// A box with ideal diffuse reflectances that takes a cluster's place.
///
/// Faces are numbered x-, x+, y-, y+, z-, z+ in the box's own axes. Patch `(i, j)` of a face has index `j * n + i`, `i` along
/// the first and `j` along the second of the other two axes in ascending order.
#[derive(Clone, Debug)]
pub struct EquivalentBox {
    /// Centre, world space.
    pub centre: Vec3,
    /// Half of the edge lengths along `axes`.
    pub half: Vec3,
    /// Columns are the unit axes, world space, right-handed.
    pub axes: Mat3,
    /// Patches along each edge of a face.
    pub resolution: u32,
    /// Reflectances of `resolution^2` patches for each face.
    pub reflectance: [Vec<Vec3>; 6],
}

impl EquivalentBox {
    /// Axis-aligned bounds, world space.
    pub fn bounds(&self) -> Aabb {
        let reach = self.axes.x_axis.abs() * self.half.x
            + self.axes.y_axis.abs() * self.half.y
            + self.axes.z_axis.abs() * self.half.z;
        Aabb { min: self.centre - reach, max: self.centre + reach }
    }
}

/// Cluster against box, on rays that were not used to fit it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitResidual {
    /// Share of uniform lines through the bounding box that hit the cluster.
    pub hit_share: f32,
    /// Intercepted flux of the box over that of the cluster, minus 1.
    pub intercepted: f32,
    /// Standard error of `intercepted`.
    pub intercepted_error: f32,
    /// Mean reflected colour of the box minus that of the cluster.
    pub reflected: Vec3,
}

/// The outcome of simplification.
#[derive(Clone, Debug)]
pub struct Simplified {
    /// What it was made with.
    pub params: SimplifyParams,
    /// `2 pi beta r_thresh^2`, Eq. (6).
    pub a_thresh: f64,
    /// Surfaces.
    pub surfaces: Vec<Surface>,
    /// Index into `surfaces`, one a triangle of the scene.
    pub surface_of_triangle: Vec<u32>,
    /// Clusters.
    pub clusters: Vec<Cluster>,
    /// Normal and simple surfaces, ready for a backend and for radiosity.
    pub geometry: SimplifiedGeometry,
    /// Rays traced to fit boxes and measure residuals.
    pub rays: u64,
    /// Sentences for the user: what was kept although small, what fits badly.
    pub warnings: Vec<String>,
}

/// Classifies, clusters and fits boxes.
///
/// # Errors
/// When a backend fails to build a cluster's scene.
pub fn simplify(
    scene: &Scene,
    backend: &dyn RayBackend,
    params: &SimplifyParams,
    progress: &Progress,
) -> Result<Simplified> {
    let _ = (scene, backend, params, progress);
    todo!("simplify helper")
}
