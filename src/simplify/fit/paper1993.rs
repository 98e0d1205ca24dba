//! The paper's box, to the letter of its pseudo-code.
//!
//! What the pseudo-code leaves open: patches that no ray hit have no reflectance ([`PaperFit::reflectance`] is `None` there;
//! `fill_patches` takes the mean of their face, else that of the cluster). The two faces across an axis
//! see the same silhouette, so their fractions are averaged. A length can come out as zero (plates without thickness, GSII-007;
//! a diagonal sheet, GSII-008); [`PaperFit::lengths`] says so, the box itself gets a least thickness.

use std::sync::Arc;

use glam::{DVec3, Mat3, Vec2, Vec3};

use super::{LEAST_THICKNESS, MARGIN, Probe, Stage, face_axes, face_side, frame_along, patch_index};
use crate::backend::{Coherence, Hit, Ray, RayBackend, Visible};
use crate::error::Result;
use crate::sampling;
use crate::scene::Scene;

/// Perpendicular rays along each edge of a patch: jittered, one in each cell.
pub const RAYS_ALONG_PATCH: u32 = 8;

/// What the pseudo-code computes.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperFit {
    /// `frac(face)`: share of perpendicular rays that hit, for x-, x+, y-, y+, z-, z+.
    pub frac: [f64; 6],
    /// `new_x_length` and so on, scene units.
    pub lengths: DVec3,
    /// `rho(patch)`: mean reflectance of the surfaces hit, `None` where nothing was.
    pub reflectance: [Vec<Option<Vec3>>; 6],
    /// Mean reflectance over all hits.
    pub mean_reflectance: Vec3,
    /// Rays traced.
    pub rays: u64,
}

impl PaperFit {
    /// Shoots `rays_along^2` rays at each of `resolution^2` patches of each face of the bounding box with edges `size`.
    pub(crate) fn measure(probe: &Probe<'_>, size: Vec3, resolution: u32, rays_along: u32, stream: u32) -> Self {
        let cells = resolution * rays_along;
        let (mut rays, mut spots, mut hits) = (Vec::new(), Vec::new(), Vec::new());
        let mut frac = [0.0; 6];
        let mut reflectance: [Vec<Option<Vec3>>; 6] = Default::default();
        let (mut all_hits, mut all_sum, mut traced) = (0u64, DVec3::ZERO, 0);
        for face in 0..6 {
            let mut patches = vec![(0u32, DVec3::ZERO); (resolution * resolution) as usize];
            let mut face_hits = 0u64;
            for row in 0..cells {
                rays.clear();
                spots.clear();
                for column in 0..cells {
                    let key = sampling::hash_all(&[stream, face as u32, row, column]);
                    let jitter = Vec2::new(sampling::unit(key), sampling::unit(sampling::hash(key)));
                    let spot = (Vec2::new(column as f32, row as f32) + jitter) / cells as f32;
                    rays.push(perpendicular(probe, face, spot));
                    spots.push(spot);
                }
                hits.clear();
                hits.resize(rays.len(), Hit::MISS);
                probe.rays.closest(&rays, Visible::All, Coherence::Coherent, &mut hits);
                traced += rays.len() as u64;
                for (hit, spot) in hits.iter().zip(&spots).filter(|(hit, _)| hit.is_hit()) {
                    let rho = probe.reflectance(hit.triangle, hit.u, hit.v).as_dvec3();
                    let patch = &mut patches[patch_index(spot.x, spot.y, resolution)];
                    *patch = (patch.0 + 1, patch.1 + rho);
                    face_hits += 1;
                    all_sum += rho;
                }
            }
            all_hits += face_hits;
            frac[face] = face_hits as f64 / (f64::from(cells) * f64::from(cells));
            reflectance[face] =
                patches.iter().map(|&(n, sum)| (n > 0).then(|| (sum / f64::from(n)).as_vec3())).collect();
        }
        let axis = |i: usize| 0.5 * (frac[2 * i] + frac[2 * i + 1]);
        let (yz, xz, xy) = (axis(0), axis(1), axis(2));
        let lengths = DVec3::new((xy * xz).sqrt(), (xy * yz).sqrt(), (xz * yz).sqrt()) * size.as_dvec3();
        let mean_reflectance = (all_sum / all_hits.max(1) as f64).as_vec3();
        PaperFit { frac, lengths, reflectance, mean_reflectance, rays: traced }
    }

    /// Edge lengths of the box that stands for it: `lengths`, but at least a trace of the bounding box's largest edge.
    pub fn edges(&self, size: Vec3) -> Vec3 {
        self.lengths.as_vec3().max(Vec3::splat(LEAST_THICKNESS * size.max_element()))
    }

    /// Whether a length came out as (almost) zero, so that the box has lost its volume.
    pub fn vanished(&self, size: Vec3) -> bool {
        self.lengths.min_element() < f64::from(LEAST_THICKNESS * size.max_element())
    }
}

/// Runs the paper's pseudo-code on `triangles` of `scene`, with the bounding box along `axes`, `resolution^2` patches a face
/// and `rays_along^2` rays a patch.
///
/// # Errors
/// When the backend fails.
pub fn fit_paper1993(
    scene: &Arc<Scene>,
    backend: &dyn RayBackend,
    triangles: &[u32],
    axes: Mat3,
    resolution: u32,
    rays_along: u32,
    seed: u32,
) -> Result<PaperFit> {
    let frame = frame_along(scene, triangles, axes);
    let stage = Stage::new(scene, &[(triangles, frame)]);
    let rays = stage.build(scene, backend)?;
    let probe = Probe::new(scene, &stage, rays.as_ref(), 0, &frame, f32::INFINITY);
    Ok(PaperFit::measure(&probe, 2.0 * frame.half, resolution, rays_along, seed))
}

/// The ray through `spot` (0..1) of a face, straight into the box. It starts outside, so that surfaces in the face itself are
/// hit.
fn perpendicular(probe: &Probe<'_>, face: usize, spot: Vec2) -> Ray {
    let (normal_axis, first, second) = face_axes(face);
    let bounds = probe.bounds;
    let outward = face_side(face);
    let mut origin = if outward < 0.0 { bounds.min } else { bounds.max };
    origin[first] = (bounds.min[first] + spot.x * bounds.size()[first]).min(bounds.max[first]);
    origin[second] = (bounds.min[second] + spot.y * bounds.size()[second]).min(bounds.max[second]);
    origin[normal_axis] += outward * MARGIN;
    let mut direction = Vec3::ZERO;
    direction[normal_axis] = -outward;
    probe.ray(origin, direction)
}
