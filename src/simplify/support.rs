//! What carries a cluster: a box that is smaller than its cluster must not lift off the table it stands on, or light leaks
//! under it.

use glam::Vec3;
use rayon::prelude::*;

use super::fit::{Frame, face_axes, face_side};
use crate::backend::{Coherence, Hit, Ray, RayScene, Visible};

/// Probes along each edge of a face.
const PROBES: usize = 3;

/// How far on both sides of a face a normal surface may be to carry it, in units of the box's largest edge.
const REACH: f32 = 0.02;

/// The share of a face's probes that must find something.
const LEAST_CONTACT: usize = PROBES * PROBES / 3;

/// A box that rests on something keeps this distance, in units of the cluster's largest edge: two faces in one plane would
/// shade each other or not as rounding decides.
const CLEARANCE: f32 = 2e-3;

/// Which faces (x-, x+, y-, ...) of each frame lie against normal surfaces.
pub(crate) fn contacts(normal: &dyn RayScene, frames: &[Frame]) -> Vec<[bool; 6]> {
    frames
        .par_chunks(64)
        .flat_map_iter(|frames| {
            let rays: Vec<Ray> = frames.iter().flat_map(|f| (0..6).flat_map(|face| probes(f, face))).collect();
            let mut hits = vec![Hit::MISS; rays.len()];
            normal.closest(&rays, Visible::WithoutPanes, Coherence::Incoherent, &mut hits);
            let touches: Vec<bool> = hits
                .chunks_exact(PROBES * PROBES)
                .map(|face| face.iter().filter(|h| h.is_hit()).count() >= LEAST_CONTACT)
                .collect();
            touches.chunks_exact(6).map(|t| std::array::from_fn(|face| t[face])).collect::<Vec<_>>()
        })
        .collect()
}

fn probes(frame: &Frame, face: usize) -> impl Iterator<Item = Ray> {
    let frame = *frame;
    let (normal_axis, first, second) = face_axes(face);
    let outward = face_side(face);
    let reach = REACH * 2.0 * frame.half.max_element();
    (0..PROBES * PROBES).map(move |i| {
        let spot = |k: usize| (2 * k + 1) as f32 / PROBES as f32 - 1.0;
        let mut local = Vec3::ZERO;
        local[normal_axis] = outward * (frame.half[normal_axis] - reach);
        local[first] = spot(i % PROBES) * frame.half[first];
        local[second] = spot(i / PROBES) * frame.half[second];
        let direction = outward * frame.axes.col(normal_axis);
        Ray { origin: frame.centre + frame.axes * local, t_near: 0.0, direction, t_far: 2.0 * reach }
    })
}

/// Centre of a box with edges `edges`, in the axes of `frame` and from its centre, that keeps the cluster's contacts: along
/// each axis the box stays at the face that touches something; it is centred where none or both do.
pub(crate) fn resting_offset(frame: &Frame, edges: Vec3, contacts: [bool; 6]) -> Vec3 {
    let room = frame.half - 0.5 * edges;
    let clearance = CLEARANCE * 2.0 * frame.half.max_element();
    Vec3::from_array(std::array::from_fn(|axis| match (contacts[2 * axis], contacts[2 * axis + 1]) {
        (true, false) => clearance - room[axis],
        (false, true) => room[axis] - clearance,
        _ => 0.0,
    }))
}
