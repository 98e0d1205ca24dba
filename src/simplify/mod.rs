//! Geometric simplification: surfaces are classified, small ones clustered, clusters replaced by equivalent boxes.

pub mod classify;
pub mod cluster;
pub mod dropped;
pub mod export;
pub mod fit;
pub mod geometry;
mod replace;
pub mod report;
mod restore;
mod support;
pub mod surfaces;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

pub use geometry::{SimplifiedGeometry, TriangleSource};
use replace::{Replaced, Replacer};

use dropped::Candidate;

use crate::backend::{HitFilter, PartKind, RayBackend};
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::{Aabb, AlphaFilter, Scene};

/// How a cluster's box is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BoxFit {
    /// Conserves intercepted flux, escape albedo a face patch. The default.
    #[default]
    Flux,
    /// The paper's pseudo-code, to the letter.
    Paper1993,
}

/// Usual value of [`SimplifyParams::longest`]: longer boxes need fewer surfaces, but stand in other places than their clusters (measured in
/// `docs/simplification.md`).
pub const LONGEST_CLUSTER: f32 = 1.0;

/// Parameters of [`simplify`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimplifyParams {
    /// `r_thresh`, scene length units, 0..=infinity.
    pub r_thresh: f32,
    /// The paper's beta, 0..=1.
    pub beta: f32,
    /// How boxes are fitted.
    pub box_fit: BoxFit,
    /// Largest angle between the normals of neighbouring triangles of one surface, radians.
    pub crease_angle: f32,
    /// Largest diagonal of a cluster in units of `r_thresh`, 1..=infinity. Clusters up to 1 are always harmless: a point
    /// inside misses nothing of them. Longer ones (a row of books, the frame of a chair) are kept only where hardly any light
    /// that leaves their surfaces meets them again beyond `r_thresh`, which is measured.
    pub longest: f32,
    /// Most patches along each edge of a box face; fewer where the box would have more patches than its cluster has surfaces.
    pub face_resolution: u32,
    /// Seed of the fitting rays.
    pub seed: u32,
}

/// What the paper calls a surface: connected triangles of one material that turn no more than the crease angle between
/// neighbours.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Class {
    /// Large enough (or a light source, mirror or glass, or too few triangles for a box to be simpler): in both scenes.
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
#[derive(Clone, Debug, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitResidual {
    /// Share of uniform lines through the bounding box that hit the cluster.
    pub hit_share: f32,
    /// Intercepted flux of the box over that of the cluster, minus 1.
    pub intercepted: f32,
    /// Standard error of `intercepted`; infinite when no line hit the cluster, so that nothing is known.
    pub intercepted_error: f32,
    /// The same by direction: sum over the directions closest to each of the three axes of what the box intercepts too much
    /// or too little, over all that the cluster intercepts.
    pub directional: f32,
    /// Share of the light leaving the cluster's surfaces that meets them again beyond `r_thresh`.
    pub hidden: f32,
    /// Mean reflected colour of the box minus that of the cluster.
    pub reflected: Vec3,
}

/// The outcome of simplification.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
    /// Normal and simple surfaces, ready for a backend and for radiosity. Not in files: it follows from the rest.
    #[serde(skip)]
    pub geometry: SimplifiedGeometry,
    /// Rays traced to fit boxes and measure residuals.
    pub rays: u64,
    /// Sentences for the user: what was kept although small, what fits badly.
    pub warnings: Vec<String>,
}

/// Classifies, clusters and fits boxes.
///
/// # Errors
/// [`Error::Usage`](crate::error::Error::Usage) for parameters that make no sense;
/// [`Error::Backend`](crate::error::Error::Backend) when the backend fails.
pub fn simplify(
    scene: &Arc<Scene>,
    backend: &dyn RayBackend,
    params: &SimplifyParams,
    progress: &Progress,
) -> Result<Simplified> {
    let a_thresh = classify::check(params)?;
    let map = surfaces::find_surfaces(&scene.mesh, params.crease_angle);
    let mut warnings = Vec::new();

    let mut surfaces = map.surfaces.clone();
    let mut replaced = Replaced::default();
    if is_used(scene, params.r_thresh) {
        let extent = classify::extent(scene, params.r_thresh, params.longest);
        let small = classify::find_small(scene, &surfaces, a_thresh, extent);
        let mut groups = cluster::find_clusters(&scene.mesh, &map, &small.clusterable, extent);
        let mut dropper = dropped::Dropper::new(a_thresh, params.r_thresh);
        drop_isolated(&mut dropper, &mut surfaces, &mut groups, &small.long_isolated, extent);
        // Nothing that may become part of a box can carry one.
        let mut carriers = surfaces.clone();
        for s in groups.iter().flat_map(cluster::Group::surfaces) {
            carriers[s as usize].class = Class::Complex { cluster: None };
        }
        replaced = Replacer {
            scene,
            backend,
            params,
            compact: extent.compact,
            uncoverable: classify::uncoverable(scene),
            surface_of_triangle: &map.of_triangle,
            normal: &SimplifiedGeometry::normal(scene, &carriers, &map.of_triangle),
        }
        .replace(groups, progress)?;
        drop_small_boxes(&mut dropper, &mut surfaces, &mut replaced.clusters, extent);
        for (cluster, c) in (0u32..).zip(&replaced.clusters) {
            for &s in &c.surfaces {
                surfaces[s as usize].class = Class::Complex { cluster: Some(cluster) };
            }
        }
        let too_long = drop_strips(&mut dropper, scene, &mut surfaces, &map.of_triangle, extent);
        if too_long > 0 {
            warnings.push(format!(
                "{too_long} surfaces have less area than A_thresh = {a_thresh:.3e} but are longer than {:.3e}: they stay as they are, which costs time but no accuracy",
                extent.compact
            ));
        }
    }

    let mut geometry = SimplifiedGeometry::normal(scene, &surfaces, &map.of_triangle);
    warnings.extend(replaced.warnings);
    geometry.add_boxes(&replaced.clusters);
    Ok(Simplified {
        params: params.clone(),
        a_thresh,
        surfaces,
        surface_of_triangle: map.of_triangle,
        clusters: replaced.clusters,
        geometry,
        rays: replaced.rays,
        warnings,
    })
}

/// Whether any ray can be long enough to meet the simplified scene. The distance of the lookup may be drawn from
/// `r_thresh / 2` upwards, hence the factor. Otherwise (as for `r_thresh` = infinity) nothing needs to be simplified.
fn is_used(scene: &Scene, r_thresh: f32) -> bool {
    r_thresh > 0.0 && r_thresh <= 2.0 * scene.mesh.bounds.diagonal()
}

/// What became of surfaces that are dropped.
const GONE: Class = Class::Complex { cluster: None };

/// Takes the groups that are dropped out of `groups` and marks their surfaces. Long groups touch something else and may be
/// part of an enclosure: they stay.
fn drop_isolated(
    dropper: &mut dropped::Dropper,
    surfaces: &mut [Surface],
    groups: &mut Vec<cluster::Group>,
    long_isolated: &[u32],
    extent: cluster::Extent,
) {
    let of_group = |g: &cluster::Group| {
        let compact = g.bounds.diagonal() <= extent.compact;
        Candidate::compact(g.bounds.centre(), if compact { g.visible_area() } else { f64::INFINITY })
    };
    let of_surface = |&s: &u32| {
        let surface: &Surface = &surfaces[s as usize];
        Candidate::compact(surface.bounds.centre(), surface.area)
    };
    let candidates: Vec<_> = groups.iter().map(of_group).chain(long_isolated.iter().map(of_surface)).collect();
    let is_dropped = dropper.choose(&candidates);
    let (of_groups, of_long) = is_dropped.split_at(groups.len());
    for (&s, _) in long_isolated.iter().zip(of_long).filter(|(_, dropped)| **dropped) {
        surfaces[s as usize].class = GONE;
    }
    let mut of_groups = of_groups.iter();
    groups.retain(|group| {
        let dropped = of_groups.next().copied().unwrap_or(false);
        if dropped {
            group.surfaces().into_iter().for_each(|s| surfaces[s as usize].class = GONE);
        }
        !dropped
    });
}

/// Drops long clusters that come out so sparse that their boxes are below the threshold, as the paper does. Compact ones have
/// been decided on before they were fitted.
fn drop_small_boxes(
    dropper: &mut dropped::Dropper,
    surfaces: &mut [Surface],
    clusters: &mut Vec<Cluster>,
    extent: cluster::Extent,
) {
    let r_thresh = dropper.r_thresh;
    let candidates = clusters.iter().map(|c| {
        let long = c.bounds.diagonal() > extent.compact;
        // No direction shows more of a box than three of its faces.
        let area = fit::half_surface(2.0 * c.equivalent_box.half);
        Candidate::spread(c.equivalent_box.bounds(), if long { area } else { f64::INFINITY }, r_thresh)
    });
    let mut is_dropped = dropper.choose(&candidates.collect::<Vec<_>>()).into_iter();
    clusters.retain(|c| {
        let dropped = is_dropped.next().unwrap_or(false);
        if dropped {
            c.surfaces.iter().for_each(|&s| surfaces[s as usize].class = GONE);
        }
        !dropped
    });
}

/// Drops strips that no box replaces, as far as there is room left for them. Returns how many surfaces have little area and
/// stay normal because they are too long.
fn drop_strips(
    dropper: &mut dropped::Dropper,
    scene: &Scene,
    surfaces: &mut [Surface],
    surface_of_triangle: &[u32],
    extent: cluster::Extent,
) -> usize {
    let (a_thresh, r_thresh) = (dropper.a_thresh, dropper.r_thresh);
    let is_left = |s: &Surface| {
        s.class == Class::Normal && s.bounds.diagonal() > extent.compact && classify::is_small(scene, s, a_thresh)
    };
    let is_strip = |s: &Surface| is_left(s) && dropped::is_strip(s.area, s.bounds.diagonal(), r_thresh);
    let strips: Vec<u32> = (0u32..).zip(surfaces.iter()).filter(|(_, s)| is_strip(s)).map(|(i, _)| i).collect();
    let mut triangles = vec![Vec::new(); strips.len()];
    for (t, s) in (0u32..).zip(surface_of_triangle) {
        if let Ok(i) = strips.binary_search(s) {
            triangles[i].push(t);
        }
    }
    let candidates: Vec<_> = triangles.iter().map(|t| Candidate::strip(&scene.mesh, t, r_thresh)).collect();
    for (&s, _) in strips.iter().zip(dropper.choose(&candidates)).filter(|(_, dropped)| *dropped) {
        surfaces[s as usize].class = GONE;
    }
    surfaces.iter().filter(|s| is_left(s)).count()
}

/// The scene's filter for alpha-tested triangles, where it has any.
pub(crate) fn scene_filter(scene: &Arc<Scene>) -> Option<Arc<dyn HitFilter>> {
    let any = scene.mesh.objects.iter().any(|o| o.kind == PartKind::Filtered);
    any.then(|| Arc::new(AlphaFilter::new(scene.clone())) as Arc<dyn HitFilter>)
}
