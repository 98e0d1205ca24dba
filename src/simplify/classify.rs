//! Which surfaces are small enough to be simplified.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::cluster::Extent;
use super::{SimplifyParams, Surface};
use crate::backend::PartKind;
use crate::error::{Error, Result};
use crate::scene::{Aabb, Material, Scene};

/// Perceptual roughness under which a metal counts as a mirror. A mirror shows its surroundings, which no diffuse box does.
const MIRROR_ROUGHNESS: f32 = 0.25;

/// Metalness from which the specular lobe carries most of the reflectance.
const MIRROR_METALLIC: f32 = 0.5;

/// Surfaces and clusters larger than this share of the scene's diagonal are no detail, whatever `r_thresh` says: they
/// enclose. Without this bound a large `r_thresh` would turn the walls of a room into clutter.
const ENCLOSING_SHARE: f32 = 0.25;

/// `A_thresh = 2 pi beta r_thresh^2` (Eq. 6), in squared scene units.
pub fn area_threshold(r_thresh: f32, beta: f32) -> f64 {
    2.0 * PI * f64::from(beta) * f64::from(r_thresh) * f64::from(r_thresh)
}

/// Refuses parameters that make no sense; gives `A_thresh`.
///
/// # Errors
/// [`Error::Usage`], naming the parameter.
pub fn check(params: &SimplifyParams) -> Result<f64> {
    let refuse = |what: &str, value: f32, why: &str| Err(Error::Usage(format!("{what} = {value}: {why}")));
    if params.r_thresh.is_nan() || params.r_thresh < 0.0 {
        return refuse("r_thresh", params.r_thresh, "must be a length, 0 or more (infinity is allowed)");
    }
    if !(0.0..=1.0).contains(&params.beta) {
        return refuse("beta", params.beta, "must lie between 0 and 1");
    }
    if !(0.0..=std::f32::consts::PI).contains(&params.crease_angle) {
        return refuse("crease angle", params.crease_angle, "must lie between 0 and pi radians");
    }
    if params.longest.is_nan() || params.longest < 1.0 {
        return refuse("longest cluster", params.longest, "must be 1 or more, in units of r_thresh");
    }
    if params.face_resolution == 0 {
        return Err(Error::Usage("face resolution = 0: a box face needs at least one patch".into()));
    }
    let a_thresh = area_threshold(params.r_thresh, params.beta);
    if a_thresh.is_nan() {
        return Err(Error::Usage(
            "r_thresh = infinity with beta = 0: A_thresh = 2 pi beta r_thresh^2 has no value; use a beta above 0 or a finite r_thresh"
                .into(),
        ));
    }
    Ok(a_thresh)
}

/// The largest diagonal of a cluster that is harmless as such. A point inside a cluster sees nothing of it between `r_thresh`
/// and the wall of its box; in one no wider than `r_thresh` there is nothing to be seen there.
pub fn size_limit(scene: &Scene, r_thresh: f32) -> f32 {
    r_thresh.min(ENCLOSING_SHARE * scene.mesh.bounds.diagonal())
}

/// How large clusters may become: `longest` is in units of `r_thresh`.
pub fn extent(scene: &Scene, r_thresh: f32, longest: f32) -> Extent {
    let compact = size_limit(scene, r_thresh);
    Extent { compact, longest: size_limit(scene, r_thresh * longest.max(1.0)) }
}

/// Small surfaces by what can be done with them.
#[derive(Debug, Default)]
pub struct Small {
    /// Small in area, and in extent or beside others: may be clustered.
    pub clusterable: Vec<u32>,
    /// Small in area, not in extent, nothing near them: may be dropped.
    pub long_isolated: Vec<u32>,
}

/// Finds the small surfaces: area strictly below `a_thresh`, and no light source, mirror or glass.
pub fn find_small(scene: &Scene, surfaces: &[Surface], a_thresh: f64, extent: Extent) -> Small {
    let small = (0u32..).zip(surfaces).filter(|(_, s)| is_small(scene, s, a_thresh)).map(|(i, _)| i);
    let of = |s: u32| &surfaces[s as usize];
    let (mut clusterable, long): (Vec<u32>, Vec<u32>) = small.partition(|&i| of(i).bounds.diagonal() <= extent.compact);
    // Anything that touches another surface may be part of an enclosure (GSII-025: the walls of a room whose area is below
    // A_thresh), and without it light would leak.
    let gap = neighbour_gap(extent.compact);
    let neighbours = BoundsAlongX::new(surfaces.iter().map(|s| s.bounds).collect());
    let alone = |&i: &u32| !neighbours.any_overlap_but(&of(i).bounds.expanded(gap), i);
    let (long_isolated, beside): (Vec<u32>, Vec<u32>) = long.par_iter().copied().partition(alone);
    clusterable.extend(beside.into_iter().filter(|&i| of(i).bounds.diagonal() <= extent.longest));
    clusterable.sort_unstable();
    Small { clusterable, long_isolated }
}

/// Whether a surface is small enough to be simplified and not of a kind that never is.
pub fn is_small(scene: &Scene, surface: &Surface, a_thresh: f64) -> bool {
    let object = &scene.mesh.objects[surface.object as usize];
    let material = &scene.materials[object.material as usize];
    surface.area < a_thresh && object.kind != PartKind::Pane && can_be_simplified(material)
}

/// What no box may cover: triangles of light sources, whose light it would swallow, mirrors and glass.
pub fn uncoverable(scene: &Scene) -> BoundsAlongX {
    let triangles = scene.mesh.objects.iter().filter(|o| !can_be_simplified(&scene.materials[o.material as usize]));
    let bounds = |t: u32| Aabb::of(scene.mesh.corners(t));
    BoundsAlongX::new(triangles.flat_map(|o| o.triangles.clone()).map(bounds).collect())
}

/// Bounds sorted by where they begin along x.
pub struct BoundsAlongX {
    bounds: Vec<Aabb>,
    order: Vec<u32>,
    /// For each place in `order`, the farthest end of the bounds up to there.
    reach: Vec<f32>,
}

impl BoundsAlongX {
    fn new(bounds: Vec<Aabb>) -> Self {
        let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
        order.sort_by(|&a, &b| bounds[a as usize].min.x.total_cmp(&bounds[b as usize].min.x));
        let mut farthest = f32::NEG_INFINITY;
        let reach = order.iter().map(|&i| {
            farthest = farthest.max(bounds[i as usize].max.x);
            farthest
        });
        BoundsAlongX { reach: reach.collect(), order, bounds }
    }

    /// Whether any of the bounds overlap `bounds`.
    pub fn any_overlap(&self, bounds: &Aabb) -> bool {
        self.any_overlap_but(bounds, u32::MAX)
    }

    /// Whether any of the bounds but number `except` overlap `bounds`.
    fn any_overlap_but(&self, bounds: &Aabb, except: u32) -> bool {
        let end = self.order.partition_point(|&i| self.bounds[i as usize].min.x <= bounds.max.x);
        let candidates = self.order[..end].iter().zip(&self.reach[..end]).rev();
        candidates
            .take_while(|&(_, &reach)| reach >= bounds.min.x)
            .any(|(&i, _)| i != except && self.bounds[i as usize].overlaps(bounds))
    }
}

/// Small surfaces closer than this belong together.
pub fn neighbour_gap(limit: f32) -> f32 {
    0.25 * limit
}

/// Light sources would be swallowed by a box, mirrors and glass are nothing like one.
fn can_be_simplified(material: &Material) -> bool {
    let mirror = material.metallic >= MIRROR_METALLIC && material.roughness < MIRROR_ROUGHNESS;
    !material.is_emitter() && !mirror && material.transmission == 0.0
}
