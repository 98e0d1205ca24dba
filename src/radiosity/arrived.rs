//! Light that has arrived at the sides of patches, and where on them.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::patches::inset;
use super::shoot::Coated;
use super::slope::Moments;
use crate::backend::{Hit, Ray};
use crate::sampling;
use crate::shading::SurfacePoint;

/// Fewest and most points kept of a side.
const KEPT: [usize; 2] = [16, 256];

/// A point of a side, and from where light arrived there.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    /// Triangle of the geometry.
    pub triangle: u32,
    /// Barycentrics.
    pub uv: Vec2,
    /// Unit vector towards where the light came from.
    pub from: Vec3,
}

impl Place {
    /// `point`, lit from a direction.
    pub fn lit(point: &SurfacePoint, from: Vec3) -> Place {
        Place { triangle: point.triangle, uv: Vec2::new(point.u, point.v), from }
    }

    /// Where a ray arrived, drawn a little from the edges of the triangle.
    pub fn met(ray: &Ray, hit: &Hit) -> Place {
        Place { triangle: hit.triangle, uv: Vec2::new(inset(hit.u), inset(hit.v)), from: -ray.direction }
    }
}

/// Light that arrived somewhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landing {
    /// The side.
    pub side: u32,
    /// W.
    pub flux: DVec3,
    /// Where.
    pub place: Place,
    /// The same in the coordinates of the grid's cell, 0..=1.
    pub local: Vec2,
}

/// Points of one side where light arrived, each kept as likely as its share in the light.
#[derive(Clone, Debug)]
pub(super) struct Places {
    at: Box<[Place]>,
    /// All light so far, W.
    flux: f64,
}

impl Places {
    /// None yet, and room for `wanted`, as far as that is sensible: about as many as rays arrive or leave. Fewer would make the light of
    /// large patches uncertain.
    pub fn new(wanted: usize) -> Self {
        Places { at: vec![Place::default(); wanted.clamp(KEPT[0], KEPT[1])].into(), flux: 0.0 }
    }

    /// Light arrived at `place`; `random` in 0..1 is a number of its own.
    pub fn offer(&mut self, place: Place, flux: f64, random: f32) {
        if flux <= 0.0 {
            return;
        }
        self.flux += flux;
        // Each kept point is replaced with the probability flux / all flux: so many of them in a row, from a random one on.
        let kept = self.at.len();
        let start = random * kept as f32;
        let (first, rest) = (start as usize, start.fract());
        let count = (kept as f32 * (flux / self.flux) as f32 + rest) as usize;
        for k in 0..count.min(kept) {
            self.at[(first + k) % kept] = place;
        }
    }

    /// One of the points, by a number in 0..1.
    pub fn choose(&self, u: f32) -> Place {
        self.at[((u * self.at.len() as f32) as usize).min(self.at.len() - 1)]
    }
}

/// Where light arrived, one entry a side; empty where it is not to be remembered.
#[derive(Clone, Debug, Default)]
pub(super) struct Whereabouts {
    /// As places to shoot from.
    pub places: Vec<Option<Places>>,
    /// As moments over the side, of the light that is looked up.
    pub moments: Vec<Moments>,
}

impl Whereabouts {
    /// Of no light yet, on so many sides.
    pub fn nowhere(sides: usize) -> Self {
        Whereabouts { places: vec![None; sides], moments: vec![Moments::default(); sides] }
    }
}

/// Light that has arrived at all sides.
#[derive(Clone, Debug)]
pub(super) struct Arrived {
    /// Flux, W.
    pub flux: Vec<DVec3>,
    /// Where it arrived: as moments from the start on, as places what arrived since the side last shot.
    at: Whereabouts,
    /// Sums of [`Coated::flux`], one a side; empty where places are not remembered.
    coated: Vec<DVec2>,
    /// Points wanted of a side.
    wanted: usize,
    /// For random numbers.
    stream: u32,
    count: u32,
}

impl Arrived {
    /// `flux` on each side, and where that arrived, `at`, if it is to be remembered: about `wanted` places for each side, from now on.
    pub fn new(flux: Vec<DVec3>, at: Whereabouts, wanted: usize, stream: u32) -> Self {
        Arrived { coated: vec![DVec2::ZERO; at.places.len()], flux, at, wanted, stream, count: 0 }
    }

    /// Adds light.
    pub fn add(&mut self, Landing { side, flux, place, local }: Landing) {
        self.flux[side as usize] += flux;
        if let Some(places) = self.at.places.get_mut(side as usize) {
            self.at.moments[side as usize].add(flux.element_sum(), local);
            self.count = self.count.wrapping_add(1);
            let random = sampling::unit(sampling::hash(self.stream ^ self.count));
            places.get_or_insert_with(|| Places::new(self.wanted)).offer(place, flux.element_sum(), random);
        }
    }

    /// Adds light that coated sides reflected.
    pub fn note_coated(&mut self, coated: &[Coated]) {
        for &Coated { side, flux } in coated {
            self.coated[side as usize] += flux;
        }
    }

    /// Sums of [`Coated::flux`], one a side; none where places are not remembered.
    pub fn coated(&self) -> &[DVec2] {
        &self.coated
    }

    /// Where light arrived, one entry a side; none where that is not remembered.
    pub fn moments(&self) -> &[Moments] {
        &self.at.moments
    }

    /// Takes the places of what a side shoots now; `None` where they are not remembered.
    pub fn take_places(&mut self, side: u32) -> Option<Places> {
        self.at.places.get_mut(side as usize)?.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three points with 1, 2 and 4 parts of the light are chosen that often: 4 standard errors of 16 x 4096 choices that may depend on
    /// each other within a side, false alarms once in 5000 runs (numbers are fixed).
    #[test]
    fn places_are_kept_as_likely_as_their_light() {
        let runs = 4096;
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            let mut found = [[0.0_f64; 2]; 3];
            for run in 0..runs {
                let mut places = Places::new(KEPT[0]);
                for &triangle in &order {
                    let flux = [1.0, 2.0, 4.0][triangle as usize];
                    let random = sampling::unit(sampling::hash_all(&[run, triangle]));
                    places.offer(Place { triangle, ..Place::default() }, flux, random);
                }
                let mut of_run = [0.0; 3];
                for k in 0..KEPT[0] {
                    let u = (k as f32 + 0.5) / KEPT[0] as f32;
                    of_run[places.choose(u).triangle as usize] += 1.0 / KEPT[0] as f64;
                }
                for (sum, x) in found.iter_mut().zip(of_run) {
                    sum[0] += x;
                    sum[1] += x * x;
                }
            }
            let n = f64::from(runs);
            for (sum, expected) in found.iter().zip([1.0, 2.0, 4.0].map(|x| x / 7.0)) {
                let mean = sum[0] / n;
                let error = ((sum[1] / n - mean * mean) / n).sqrt();
                assert!((mean - expected).abs() < 4.0 * error, "{order:?}: {mean} of {expected} +- {error}");
            }
        }
    }
}
