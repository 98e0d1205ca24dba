//! Triangles that cannot be rendered, or would be rendered twice.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{ImportNotes, Mesh};

/// Twice the area of the smallest triangle that is kept, squared scene units: products of smaller edges lose digits in single precision,
/// and Embree takes them for nothing at all.
const LEAST_CROSS: f64 = (f32::MIN_POSITIVE / f32::EPSILON) as f64;

/// Why a triangle is dropped.
#[derive(Clone, Copy, PartialEq)]
enum Flaw {
    None,
    NotFinite,
    Degenerate,
    Duplicate,
}

/// Drops useless triangles and objects without any, counts them in `notes` and computes the bounds. `emits` tells the
/// materials that emit.
pub(super) fn clean(mesh: &mut Mesh, emits: &[bool], notes: &mut ImportNotes) {
    let mut flaws: Vec<Flaw> = mesh.triangles.par_iter().map(|&t| flaw(mesh, t)).collect();
    let shared = mark_duplicates(mesh, emits, &mut flaws, notes);
    if let Some(t) = flaws.iter().position(|&f| f == Flaw::NotFinite) {
        notes.non_finite_triangles = flaws.iter().filter(|&&f| f == Flaw::NotFinite).count();
        notes.warn(format!(
            "{} triangles with coordinates that are not finite or too large were dropped, the first in '{}'",
            notes.non_finite_triangles,
            mesh.object(t as u32).name
        ));
    }
    notes.degenerate_triangles = flaws.iter().filter(|&&f| f == Flaw::Degenerate).count();
    notes.duplicate_triangles = flaws.iter().filter(|&&f| f == Flaw::Duplicate).count();
    if flaws.iter().any(|&f| f != Flaw::None) {
        compact(mesh, &flaws, &shared);
    }
    mesh.positions.par_iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = Vec3::ZERO);
    mesh.measure();
}

fn flaw(mesh: &Mesh, triangle: [u32; 3]) -> Flaw {
    let corners = triangle.map(|i| mesh.positions[i as usize]);
    if !corners.iter().all(|p| p.is_finite()) {
        return Flaw::NotFinite;
    }
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let cross = (b - a).cross(c - a).length();
    let height = cross / longest;
    // Each corner was rounded by up to 2^-24 of its coordinates: a height of twice that (opposite errors of corner and
    // base) cannot be told from zero, and the normal is noise. Zero edges give 0/0.
    let extent = [a, b, c].iter().fold(0.0, |m: f64, p: &DVec3| m.max(p.abs().max_element()));
    if height > extent * 2.0_f64.powi(-23) && cross >= LEAST_CROSS { Flaw::None } else { Flaw::Degenerate }
}

/// Marks triangles with the same three corners as another; of those, the first that emits stays, else the first. Gives each that
/// stays with an object that lost one to it.
fn mark_duplicates(mesh: &Mesh, emits: &[bool], flaws: &mut [Flaw], notes: &mut ImportNotes) -> Vec<(u32, u32)> {
    let key = |t: u32| {
        let mut corners = mesh.corners(t).map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits)); // -0 is 0
        corners.sort_unstable();
        corners
    };
    let mut hashes: Vec<(u64, u32)> = (0..mesh.triangles.len() as u32)
        .into_par_iter()
        .filter(|&t| flaws[t as usize] == Flaw::None)
        .map(|t| {
            // FNV-1a over words; collisions only cost a comparison.
            let hash = key(t).as_flattened().iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, &w| {
                (h ^ u64::from(w)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29)
            });
            (hash, t)
        })
        .collect();
    hashes.par_sort_unstable();
    let mut first = None;
    let mut shared = Vec::new();
    for run in hashes.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1) {
        let mut run: Vec<_> = run.iter().map(|&(_, t)| (key(t), t)).collect();
        run.sort_unstable();
        for same in run.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
            let emitter = same.iter().find(|(_, t)| emits[mesh.object(*t).material as usize]);
            let keep = emitter.unwrap_or(&same[0]).1;
            for &(_, t) in same.iter().filter(|(_, t)| *t != keep) {
                flaws[t as usize] = Flaw::Duplicate;
                let (owner, loser) = (mesh.object_of_triangle[keep as usize], mesh.object_of_triangle[t as usize]);
                if owner != loser {
                    shared.push((keep, loser));
                }
                first = first.min(Some((t, keep))).or(Some((t, keep)));
            }
        }
    }
    if let Some((dropped, kept)) = first {
        let (dropped, kept) = (&mesh.object(dropped).name, &mesh.object(kept).name);
        notes.warn(format!(
            "some triangles lie exactly on others and were dropped, the first in '{dropped}' on '{kept}'"
        ));
    }
    shared
}

fn compact(mesh: &mut Mesh, flaws: &[Flaw], shared: &[(u32, u32)]) {
    const GONE: u32 = u32::MAX;
    let triangles = std::mem::take(&mut mesh.triangles);
    let mut kept = Vec::with_capacity(triangles.len());
    let mut owners = Vec::with_capacity(triangles.len());
    let mut objects = Vec::with_capacity(mesh.objects.len());
    let (mut new_triangle, mut new_object) = (vec![GONE; triangles.len()], vec![GONE; mesh.objects.len()]);
    for (old, mut object) in std::mem::take(&mut mesh.objects).into_iter().enumerate() {
        let first = kept.len();
        for t in object.triangles.clone().map(|t| t as usize).filter(|&t| flaws[t] == Flaw::None) {
            new_triangle[t] = kept.len() as u32;
            kept.push(triangles[t]);
            owners.push(objects.len() as u32);
        }
        if kept.len() > first {
            new_object[old] = objects.len() as u32;
            object.triangles = first as u32..kept.len() as u32;
            objects.push(object);
        }
    }
    mesh.triangles = kept;
    mesh.object_of_triangle = owners;
    mesh.objects = objects;
    let renumbered = shared.iter().map(|&(t, object)| (new_triangle[t as usize], new_object[object as usize]));
    mesh.shared = renumbered.filter(|&(_, object)| object != GONE).collect();
    mesh.shared.sort_unstable();
}
