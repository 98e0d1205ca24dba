//! Isolated small surfaces that the simplified scene does without.
//!
//! The paper bounds the solid angle of each dropped surface by `2 pi beta` (Eq. 4-6). Ten thousand surfaces just under the
//! threshold are a wall, though, so the bound is put on their sum instead: whatever is dropped from one region, three
//! voxels of size `r_thresh` wide, has less area than `A_thresh` together. What exceeds that stays.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

/// Something that could be dropped.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Any point of it; its extent is at most about `r_thresh`.
    pub centre: Vec3,
    /// Bound on the area that it can turn towards a point.
    pub area: f64,
}

/// For each candidate, whether it is dropped. The smallest go first: they cost a box as much as large ones do and matter
/// least.
pub fn choose_dropped(candidates: &[Candidate], a_thresh: f64, r_thresh: f32) -> Vec<bool> {
    let mut dropped = vec![false; candidates.len()];
    let mut order: Vec<usize> = (0..candidates.len()).filter(|&i| candidates[i].area < a_thresh).collect();
    order.sort_by(|&a, &b| candidates[a].area.total_cmp(&candidates[b].area).then(a.cmp(&b)));
    // Dropped area in the 27 voxels around each voxel. Only looked up, never iterated.
    let mut around: HashMap<IVec3, f64> = HashMap::new();
    for i in order {
        let Candidate { centre, area } = candidates[i];
        let voxel = (centre / r_thresh).floor().as_ivec3();
        let fits = |c: IVec3, around: &HashMap<IVec3, f64>| around.get(&c).copied().unwrap_or(0.0) + area <= a_thresh;
        if neighbourhood(voxel).all(|c| fits(c, &around)) {
            neighbourhood(voxel).for_each(|c| *around.entry(c).or_default() += area);
            dropped[i] = true;
        }
    }
    dropped
}

fn neighbourhood(voxel: IVec3) -> impl Iterator<Item = IVec3> {
    (0..27).map(move |i| voxel + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1))
}
