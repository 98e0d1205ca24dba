//! The box that conserves intercepted flux.
//!
//! By Cauchy's theorem the mean projected area of a convex body is a quarter of its surface, so an opaque box takes the right
//! share of isotropic light exactly when its surface is `S' = p S`, with `p` the share of uniform lines through the bounding
//! box (surface `S`) that hit the cluster. Its proportions follow from the projected areas around the three axes. What its
//! patches reflect is the *escape albedo*: the light that leaves the cluster after any number of bounces inside it, of what
//! arrived through the patch. That is less than the reflectance of the leaves wherever light is trapped between them
//! (p-theory of plant canopies).

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Mat3, Vec3};

use super::lines::{Buffers, FirstBounce, Line, LineEnd};
use super::{LEAST_THICKNESS, Probe, Stage, fill_patches, frame_along, half_surface, patch_index};
use crate::backend::RayBackend;
use crate::error::Result;
use crate::scene::Scene;
use crate::shading::share_of;

/// Fewest lines for one cluster; the number doubles until the error is small or the budget is used up.
pub const LEAST_LINES: u32 = 1024;

/// Relative standard error of `p` at which no more lines are needed.
const WANTED_ERROR: f64 = 0.04;

/// Lines followed at a time.
const BATCH: u32 = 512;

/// What lines tell about a cluster.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineTally {
    /// Lines followed.
    pub(crate) lines: u32,
    /// Lines that hit, by the axis that their direction is closest to.
    pub(crate) hits: [u32; 3],
    /// Summed escape weights of all hits.
    pub(crate) escaped: DVec3,
    /// For each patch of the bounding box: hits, and their summed escape weights.
    pub(crate) patches: [Vec<(u32, Vec3)>; 6],
    /// Hits whose light went on from the surface that was hit ...
    pub(crate) reflected: u32,
    /// ... and met the cluster again beyond `r_thresh`.
    pub(crate) hidden: u32,
    /// Rays traced.
    pub(crate) rays: u64,
}

impl LineTally {
    /// Follows lines until the standard error of the hit share is small against it, or `most` are used.
    pub(crate) fn measure(probe: &Probe<'_>, resolution: u32, most: u32, stream: u32, buffers: &mut Buffers) -> Self {
        let patches = std::array::from_fn(|_| vec![(0, Vec3::ZERO); (resolution * resolution) as usize]);
        let mut tally = LineTally { patches, ..LineTally::default() };
        while tally.lines < most && (tally.lines < LEAST_LINES || tally.relative_error() > WANTED_ERROR) {
            // Prefixes of powers of two are well distributed.
            let next = (2 * tally.lines).max(LEAST_LINES).min(most);
            while tally.lines < next {
                let end = (tally.lines + BATCH).min(next);
                let rays = probe.follow_lines(tally.lines..end, stream, buffers, |line, end| {
                    let LineEnd::Hit { escaped, first } = end else { return };
                    tally.reflected += u32::from(first != FirstBounce::Absorbed);
                    tally.hidden += u32::from(first == FirstBounce::Hidden);
                    tally.hits[dominant_axis(line)] += 1;
                    tally.escaped += escaped.as_dvec3();
                    let patch = &mut tally.patches[line.face][patch_index(line.at.x, line.at.y, resolution)];
                    *patch = (patch.0 + 1, patch.1 + escaped);
                });
                tally.lines = end;
                tally.rays += rays;
            }
        }
        tally
    }

    pub(crate) fn hit_count(&self) -> u32 {
        self.hits.iter().sum()
    }

    /// Share of lines that hit.
    pub(crate) fn hit_share(&self) -> f64 {
        f64::from(self.hit_count()) / f64::from(self.lines.max(1))
    }

    /// Standard error of the hit share over the hit share. That of independent lines, which low-discrepancy ones stay
    /// below; infinite when nothing was hit.
    pub(crate) fn relative_error(&self) -> f64 {
        let hits = f64::from(self.hit_count());
        ((1.0 - self.hit_share()) / hits).sqrt()
    }

    /// Share of the light leaving the cluster's surfaces that meets them again beyond `r_thresh`.
    pub(crate) fn hidden_share(&self) -> f64 {
        f64::from(self.hidden) / f64::from(self.reflected.max(1))
    }

    /// Mean escape albedo over all hits.
    pub(crate) fn albedo(&self) -> Vec3 {
        (self.escaped / f64::from(self.hit_count().max(1))).as_vec3()
    }
}

fn dominant_axis(line: &Line) -> usize {
    line.direction.abs().max_position()
}

/// A fitted box, in the axes of the bounding box and centred in it.
#[derive(Clone, Debug)]
pub struct FluxFit {
    /// Share of uniform lines through the bounding box that hit the cluster.
    pub hit_share: f64,
    /// Edge lengths, in the units that the bounding box has.
    pub edges: Vec3,
    /// Escape albedo of each patch.
    pub reflectance: [Vec<Vec3>; 6],
    /// Mean escape albedo of the cluster.
    pub albedo: Vec3,
}

impl FluxFit {
    /// The box for a cluster with bounding-box edges `size`, of which `tally` was measured.
    pub(crate) fn new(size: Vec3, tally: &LineTally) -> Self {
        let edges = box_edges(size, tally);
        let measured = tally
            .patches
            .each_ref()
            .map(|face| face.iter().map(|&(hits, sum)| (hits > 0).then(|| sum / hits as f32)).collect::<Vec<_>>());
        let albedo = tally.albedo();
        let mut reflectance = fill_patches(&measured, albedo);
        match_mean(&mut reflectance, edges, albedo);
        FluxFit { hit_share: tally.hit_share(), edges, reflectance, albedo }
    }
}

/// Fits a flux-conserving box to `triangles` of `scene` along `axes`, with `lines` (at most 65536) uniform lines.
///
/// # Errors
/// When the backend fails.
pub fn fit_flux(
    scene: &Arc<Scene>,
    backend: &dyn RayBackend,
    triangles: &[u32],
    axes: Mat3,
    resolution: u32,
    lines: u32,
    seed: u32,
) -> Result<FluxFit> {
    let frame = frame_along(scene, triangles, axes);
    let stage = Stage::new(scene, &[(triangles, frame)]);
    let rays = stage.build(scene, backend)?;
    let probe = Probe::new(scene, &stage, rays.as_ref(), 0, &frame, f32::INFINITY);
    let tally = LineTally::measure(&probe, resolution, lines, seed, &mut Buffers::default());
    Ok(FluxFit::new(2.0 * frame.half, &tally))
}

/// Mean reflectance of a box in isotropic light: its patches weighted by area.
pub(crate) fn mean_reflectance(reflectance: &[Vec<Vec3>; 6], edges: Vec3) -> Vec3 {
    let sum: DVec3 = (0..6)
        .map(|face| {
            let patches = &reflectance[face];
            let mean = patches.iter().map(|r| r.as_dvec3()).sum::<DVec3>() / patches.len() as f64;
            mean * face_area(edges, face / 2)
        })
        .sum();
    (sum / (2.0 * half_surface(edges))).as_vec3()
}

fn face_area(edges: Vec3, axis: usize) -> f64 {
    f64::from(edges[(axis + 1) % 3]) * f64::from(edges[(axis + 2) % 3])
}

/// Scales all patches of a band alike so that the box reflects the cluster's albedo in isotropic light. The patches were
/// weighted by hits, the box weights them by area. No patch rises above the brightest that was measured.
fn match_mean(reflectance: &mut [Vec<Vec3>; 6], edges: Vec3, albedo: Vec3) {
    let brightest = reflectance.iter().flatten().fold(albedo, |m, r| m.max(*r));
    let mean = mean_reflectance(reflectance, edges);
    let factor = share_of(albedo, mean, Vec3::ONE);
    for patch in reflectance.iter_mut().flatten() {
        *patch = (*patch * factor).min(brightest);
    }
}

/// `integral of |w_z|` over the directions closer to the z axis than to the others: `2 pi` times the form factor of a square
/// seen from below its centre at half of its edge length.
fn integral_along() -> f64 {
    4.0 * std::f64::consts::SQRT_2 * std::f64::consts::FRAC_1_SQRT_2.atan()
}

/// Edge lengths with `half_surface = p S / 2`.
fn box_edges(size: Vec3, tally: &LineTally) -> Vec3 {
    let half = half_surface(size);
    let target = tally.hit_share() * half;
    let faces = projected_areas(size, tally);
    // Faces b_x = y z and so on give x = sqrt(b_y b_z / b_x).
    let wanted = DVec3::new(
        (faces.y * faces.z / faces.x).sqrt(),
        (faces.z * faces.x / faces.y).sqrt(),
        (faces.x * faces.y / faces.z).sqrt(),
    );
    let thinnest = LEAST_THICKNESS * size.max_element();
    edges_with_surface(wanted, size.max(Vec3::splat(thinnest)), thinnest, target)
}

/// What [`LineTally::hits`] would be on average, over the number of lines, of a box with edges `edges` inside a bounding box
/// with edges `size`.
pub(crate) fn box_hit_shares(edges: Vec3, size: Vec3) -> DVec3 {
    let along = integral_along();
    let across = 0.5 * (2.0 * PI - along);
    let faces = DVec3::from_array(std::array::from_fn(|axis| face_area(edges, axis)));
    ((along - across) * faces + across * faces.element_sum()) / (2.0 * PI * half_surface(size))
}

/// Face areas `b` of the box whose projected area `sum b_i |w_i|` agrees with the cluster's in the mean over the directions
/// around each axis.
///
/// With `P_i` the integral of the cluster's projected area over the directions closest to axis i, `P = M b`, where M holds
/// the same integrals of `|w_j|`. The sum over i is the mean projected area, so the sum of `b` is `p S / 2` whatever
/// the rest. Where the areas are within three standard errors of the bounding box's own proportions those are taken:
/// proportions of noise would make strips of flat things.
fn projected_areas(size: Vec3, tally: &LineTally) -> DVec3 {
    let half = half_surface(size);
    let (along, lines) = (integral_along(), f64::from(tally.lines.max(1)));
    let across = 0.5 * (2.0 * PI - along);
    // Lines through the box have measure pi S.
    let measure = 2.0 * PI * half;
    let p = tally.hit_share();
    let sum = p * half;
    let sum_variance = half * half * p * (1.0 - p) / lines;
    // Flat boxes have faces without area, and a cluster that no line hit has none at all; a trace of the bounding box
    // keeps proportions finite.
    let floor = 1e-6 * sum + 1e-9 * half;
    DVec3::from_array(std::array::from_fn(|axis| {
        let share = f64::from(tally.hits[axis]) / lines;
        let measured = (measure * share - across * sum) / (along - across);
        let variance = (measure * measure * share * (1.0 - share) / lines + across * across * sum_variance)
            / ((along - across) * (along - across));
        let proportional = p * face_area(size, axis);
        let area = if (measured - proportional).abs() <= 3.0 * variance.sqrt() { proportional } else { measured };
        area.max(floor)
    }))
}

/// Edges in the proportions of `wanted`, between `least` and `most`, whose half surface is `target` (as far as `most`
/// allows). The half surface grows with a common factor on `wanted`, so bisection finds it.
fn edges_with_surface(wanted: DVec3, most: Vec3, least: f32, target: f64) -> Vec3 {
    let edges = |factor: f64| (wanted * factor).as_vec3().clamp(Vec3::splat(least), most);
    let top = (most.as_dvec3() / wanted).max_element();
    let (mut low, mut high) = (0.0, top);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if half_surface(edges(middle)) < target {
            low = middle;
        } else {
            high = middle;
        }
    }
    edges(high)
}
