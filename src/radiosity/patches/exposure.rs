//! Which parts of a patch lie open.
//!
//! A wall behind a bookcase, the floor under a rug, the covers of books that stand side by side: much of the area in a furnished
//! room is covered by something that touches it. No gather ray ever meets these parts and no light reaches them. A patch that
//! spread its light over them as well would be too dark wherever it is looked up, and what it shot from there would be lost in the
//! gap: measured on the office, indirect light was 7 % too dark. So light arrives at, is looked up on, and leaves from the open part
//! only.

use glam::Vec3;
use rayon::prelude::*;

use super::{Patches, neighbours};
use crate::backend::{Coherence, Ray, Visible};
use crate::radiosity::RadiosityScene;
use crate::radiosity::shoot::side_normal;
use crate::sampling::{hash_all, unit};

/// Parts along each edge of the square that is mapped to a patch.
const PARTS: u32 = 4;
/// All parts.
const ALL: u16 = u16::MAX;
/// A part is covered when something lies above it within this share of the patch's diameter.
const REACH: f32 = 0.1;
/// Sides looked at by one job.
const JOB: usize = 64;

/// For each side, one bit for each of `PARTS x PARTS` parts of its area.
#[derive(Clone, Debug)]
pub(super) struct Exposure {
    open: Vec<u16>,
}

impl Exposure {
    /// Everything lies open.
    pub fn everything(sides: usize) -> Self {
        Exposure { open: vec![ALL; sides] }
    }

    /// Finds covered parts with one ray each, along the normal from a random point. A side without any open part is taken to be all
    /// open: something lies close above all of it, but they may still light each other.
    pub fn find(input: &RadiosityScene<'_>, patches: &Patches, seed: u32) -> Self {
        let may_be_covered = neighbours::may_be_covered(input.geometry, patches, REACH);
        let sides: Vec<u32> = (0..2 * patches.len() as u32)
            .filter(|&side| may_be_covered[side as usize / 2][side as usize % 2] && !patches.is_inside_of_box(side))
            .collect();
        let found: Vec<u16> = sides
            .par_chunks(JOB)
            .flat_map_iter(|sides| {
                let mut rays = Vec::with_capacity(sides.len() * (PARTS * PARTS) as usize);
                for &side in sides {
                    for part in 0..PARTS * PARTS {
                        let jitter = [0, 1].map(|axis| unit(hash_all(&[seed, side, part, axis])));
                        let s = within(part, jitter);
                        rays.push(normal_ray(input, patches, side, s));
                    }
                }
                let mut covered = vec![false; rays.len()];
                input.rays.occluded(&rays, Visible::WithoutPanes, Coherence::Incoherent, &mut covered);
                let bits = |parts: &[bool]| parts.iter().rev().fold(0, |bits, c| bits << 1 | u16::from(!c));
                let masks: Vec<u16> = covered
                    .chunks((PARTS * PARTS) as usize)
                    .map(|parts| match bits(parts) {
                        0 => ALL,
                        some => some,
                    })
                    .collect();
                masks
            })
            .collect();
        let mut exposure = Exposure::everything(2 * patches.len());
        for (side, open) in sides.into_iter().zip(found) {
            exposure.open[side as usize] = open;
        }
        exposure
    }

    /// Whether all of a side lies open.
    pub fn is_all_open(&self, side: u32) -> bool {
        self.open[side as usize] == ALL
    }

    /// Share of a side that lies open, above 0.
    pub fn share(&self, side: u32) -> f64 {
        f64::from(self.open[side as usize].count_ones()) / f64::from(PARTS * PARTS)
    }

    /// Maps the unit square to the open parts of a side, keeping areas.
    pub fn onto_open(&self, side: u32, [x, y]: [f32; 2]) -> [f32; 2] {
        let open = self.open[side as usize];
        if open == ALL {
            return [x, y];
        }
        let scaled = x * open.count_ones() as f32;
        let number = (scaled as u32).min(open.count_ones() - 1);
        let mut rest = open;
        for _ in 0..number {
            rest &= rest - 1;
        }
        within(rest.trailing_zeros(), [(scaled - number as f32).min(1.0 - f32::EPSILON), y])
    }
}

/// The point of the unit square at `s` of a part.
fn within(part: u32, s: [f32; 2]) -> [f32; 2] {
    let corner = [part % PARTS, part / PARTS];
    std::array::from_fn(|axis| (corner[axis] as f32 + s[axis]) / PARTS as f32)
}

fn normal_ray(input: &RadiosityScene<'_>, patches: &Patches, side: u32, s: [f32; 2]) -> Ray {
    let point = patches.point(input.geometry, side / 2, s);
    let normal: Vec3 = side_normal(&point, side);
    let t_far = REACH * patches.diameter[side as usize / 2];
    Ray { t_far, ..Ray::new(point.ray_origin(normal), normal) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_is_mapped_to_open_parts_evenly() {
        let exposure = Exposure { open: vec![0b1000_0000_0110_0001] };
        assert_eq!(exposure.share(0), 0.25);
        let mut hits = [0; 16];
        for i in 0..64 {
            for j in 0..64 {
                let s = [(i as f32 + 0.5) / 64.0, (j as f32 + 0.5) / 64.0];
                let [x, y] = exposure.onto_open(0, s);
                hits[(y * 4.0) as usize * 4 + (x * 4.0) as usize] += 1;
            }
        }
        for (part, &n) in hits.iter().enumerate() {
            assert_eq!(n, if [0, 5, 6, 15].contains(&part) { 1024 } else { 0 }, "part {part}");
        }
    }
}
