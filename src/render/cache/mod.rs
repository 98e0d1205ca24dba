//! An irradiance cache: indirect light of diffuse surfaces is gathered at few places and interpolated in between.
//!
//! Light from beyond `r_thresh` varies slowly over distances small against `r_thresh`: that is what simplification makes of it.
//! Records are placed where the image needs them, on ever finer grids of pixels, until every place is within reach of one
//! (Ward, Rubinstein and Clear 1988). How far a record reaches follows from the distances of what it sees, so that records are
//! close together next to other surfaces. Where none reaches, paths gather as without a cache.

mod clamp;
mod error;
mod flight;
mod index;
mod nearby;
mod record;

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::RenderParams;
use super::path::{Arrival, Path};
use super::view::ViewRays;
use super::workspace::Workspace;
use super::world::{Captured, FarField, World};
use crate::backend::Ray;
use crate::sampling::{SobolStream, basis, hash_all};
use crate::scene::Camera;
use clamp::clamped_distances;
use index::Index;
pub use nearby::Nearby;
use record::{Record, Strata};

/// Pass after pass: the distance in pixels of the places that are looked at, and the rays of a record. Records that are close
/// together share their noise.
const PASSES: [(u32, f32); 4] = [(16, 768.0), (8, 432.0), (4, 300.0), (2, 192.0)];

/// Relative error of an image for which records have so many rays, as where none is asked for. Noise of records is not seen in that of pixels,
/// and falls as slowly as any.
const ERROR: f32 = 0.02;

/// For smaller errors they have more of them by this power, fewer for larger ones, ...
const RAYS_POWER: f32 = 1.5;

/// ... by a factor between these.
const RAYS: [f32; 2] = [0.25, 8.0];

/// Relative standard deviation of a record's single ray for which records have so many rays. They get more in proportion to it, as is best where
/// the rest of the work has a noise of its own (Neyman), but at most so many times as many.
const DEVIATION: f32 = 0.5;
const MOST_RAYS: f32 = 3.0;

/// A place that has less weight of records than this gets one of its own.
const COVERED: f32 = 0.4;

/// Reach of a record as a share of its harmonic mean distance.
const ACCURACY: f32 = 0.3;

/// Records refuse that had to be given more than this many times the reach that their distances allow, as a share.
const TOO_SMALL: f32 = 0.25;

/// Relative difference from what the others say at which a record refuses, in errors of the image: what interpolates worse than that is
/// gathered by each path, so that an image comes to any error ...
const TOLERANCE: f32 = 4.0;

/// ... within these bounds: below the first, records differ by their noise.
const TOLERANCES: [f32; 2] = [0.03, 0.2];

/// Least reach in pixels.
const LEAST_PIXELS: f32 = 3.0;

/// Places at which light is gathered between two looks at what there is.
const CHUNK: usize = 4096;

/// Keeps the second gather of a place apart from the first.
const TWICE: u32 = 0x7477_6963;

/// Keeps the cache's random numbers apart from the image's.
const STREAM: u32 = 0x6361_6368;

/// Records of indirect light.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(from = "Unindexed")]
pub struct IrradianceCache {
    /// Those of the passes that are done.
    records: Vec<Record>,
    /// Passes of [`PASSES`] that are done.
    passes: usize,
    /// Those of the first `next` places of the pass after them.
    fresh: Vec<Record>,
    next: usize,
    #[serde(skip)]
    index: Index,
}

/// A cache in a file: the index follows from the rest.
#[derive(Deserialize)]
struct Unindexed {
    records: Vec<Record>,
    passes: usize,
    fresh: Vec<Record>,
    next: usize,
}

impl From<Unindexed> for IrradianceCache {
    fn from(Unindexed { records, passes, fresh, next }: Unindexed) -> Self {
        IrradianceCache { index: Index::new(&records), records, passes, fresh, next }
    }
}

impl IrradianceCache {
    /// Whether all passes are done.
    pub fn is_full(&self) -> bool {
        self.passes == PASSES.len()
    }

    /// Whether there is anything in it.
    pub fn is_begun(&self) -> bool {
        self.passes > 0 || self.next > 0
    }

    /// Goes on filling the cache for a view until it is full. The same on any number of threads. `each` looks at what there is from
    /// time to time. Ends with false, and with what there is, where `over` says so.
    pub fn fill(
        &mut self,
        world: &World<'_>,
        camera: &Camera,
        params: &RenderParams,
        over: &(dyn Fn() -> bool + Sync),
        each: &mut dyn FnMut(&Self),
    ) -> bool {
        let Some(far) = &world.far else {
            self.passes = PASSES.len();
            return true;
        };
        let (size, seed) = ([params.width, params.height], params.seed);
        let view = ViewRays::new(camera, size, hash_all(&[seed, STREAM]));
        let fineness = Fineness::of(params.error);
        while let Some(&(spacing, rays)) = PASSES.get(self.passes) {
            let pass = self.passes as u32;
            let strata = Strata::of(rays * fineness.rays * self.rays_for_noise());
            let places = self.places(world, &view, size, spacing, pass);
            while self.next < places.len() {
                let chunk = self.next..(self.next + CHUNK).min(places.len());
                let stream = |number: usize| hash_all(&[seed, STREAM, pass, number as u32]);
                let gathered = gather_all(world, far, (&places, chunk.clone()), strata, pass, &stream, over);
                if over() {
                    return false;
                }
                self.fresh.extend(gathered);
                self.next = chunk.end;
                each(self);
            }
            self.records.append(&mut self.fresh);
            self.next = 0;
            self.settle(far.r_thresh);
            self.passes += 1;
            log::debug!("irradiance cache: {} places at every {spacing} pixels, {} records", places.len(), self.len());
            if self.is_full() {
                self.check(fineness.tolerance);
                let refuse = self.records.iter().filter(|r| r.refuses).count();
                log::debug!("irradiance cache: {refuse} of {} records refuse", self.len());
            }
        }
        true
    }

    /// Factor on the rays of records by how noisy those of the first pass are.
    fn rays_for_noise(&self) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for variance in self.records.iter().filter_map(|record| record.variance) {
            sum += variance;
            count += 1;
        }
        let deviation = (sum / count.max(1) as f32).sqrt();
        (deviation / DEVIATION).clamp(1.0, MOST_RAYS)
    }

    /// Diffuse places at the pixels of a grid that the records so far do not cover.
    fn places(&self, world: &World<'_>, view: &ViewRays, size: [u32; 2], spacing: u32, pass: u32) -> Vec<Place> {
        let [columns, rows] = size.map(|s| s.div_ceil(spacing));
        let row = |y: u32| -> Vec<Path> {
            let pixel = |x: u32| [x, y].map(|i| i * spacing + spacing / 2);
            let inside = (0..columns).map(pixel).filter(|p| p[0] < size[0] && p[1] < size[1]);
            inside.enumerate().map(|(i, p)| view.path(p, 2 * pass, i as u32)).collect()
        };
        let found = (0..rows).into_par_iter().map_init(Workspace::default, |ws, y| {
            let reached = world
                .first_gathers(ws, &row(y))
                .into_iter()
                .map(|captured| Place { footprint: view.footprint(captured.point.position), captured });
            let covered = |p: &Place| {
                let (position, normal) = (p.captured.point.position, p.captured.normal);
                self.around(position, normal).map(|(weight, _)| weight).sum::<f32>() >= COVERED
            };
            reached.filter(|p| p.captured.diffuse && !covered(p)).collect::<Vec<_>>()
        });
        found.collect::<Vec<_>>().concat()
    }

    /// Works out how far each record reaches.
    fn settle(&mut self, r_thresh: f32) {
        let distances = clamped_distances(&self.records, r_thresh / ACCURACY);
        for (record, distance) in self.records.iter_mut().zip(distances) {
            record.refuses = ACCURACY * distance < TOO_SMALL * record.least_reach;
            record.reach = (ACCURACY * distance).max(record.least_reach);
        }
        self.index = Index::new(&self.records);
    }

    /// The records that reach a point, with their weights.
    fn around(&self, position: Vec3, normal: Vec3) -> impl Iterator<Item = (f32, &Record)> {
        let weighted = move |number: usize| {
            let record = &self.records[number];
            (record.weight(position, normal), record)
        };
        self.index.around(position).map(weighted).filter(|(weight, _)| *weight > 0.0)
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Irradiance over pi at a point with shading normal `normal` that is seen with pixels of the width `pixel` (which only decides how
    /// much is kept in `nearby`); `None` where no record reaches, or most refuse.
    pub fn look_up(&self, nearby: &mut Nearby, pixel: f32, position: Vec3, normal: Vec3) -> Option<Vec3> {
        nearby.around(&self.index, &self.records, pixel, position)?.look_up(position, normal)
    }

    /// What the others say about a record's place; `None` where none of those that `ask` names reaches.
    fn told(&self, own: &Record, ask: impl Fn(&Record) -> bool) -> Option<Vec3> {
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        let others = self.around(own.position, own.normal).filter(|(_, other)| !std::ptr::eq(*other, own));
        for (weight, other) in others.filter(|(_, other)| ask(other)) {
            sum += weight * other.at(own.position, own.normal);
            weights += weight;
        }
        (weights > 0.0).then(|| sum / weights)
    }

    /// Asks the others what each record measured itself. Records that are told something else refuse, and those that no other can vouch for
    /// where as much depends on a single ray.
    fn check(&mut self, tolerance: f32) {
        let is_off = |own: &Record| {
            let measured = own.radiance.element_sum();
            match self.told(own, |_| true).map(Vec3::element_sum) {
                Some(told) => (told - measured).abs() > tolerance * told.max(measured),
                None => own.brightest > tolerance * measured,
            }
        };
        let refuses: Vec<bool> = self.records.par_iter().map(is_off).collect();
        for (record, refuses) in self.records.iter_mut().zip(refuses) {
            record.refuses |= refuses;
        }
    }
}

/// How good records must be for an image of a given error.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fineness {
    /// Factor on their rays.
    rays: f32,
    /// Relative difference from what the others say at which one refuses.
    tolerance: f32,
}

impl Fineness {
    /// For an image of relative error `error`; infinite where none is asked for.
    fn of(error: f32) -> Self {
        if !error.is_finite() {
            // Few trials may follow: what they gather themselves would be noise.
            return Fineness { rays: 1.0, tolerance: TOLERANCES[1] };
        }
        Fineness {
            rays: (ERROR / error).powf(RAYS_POWER).clamp(RAYS[0], RAYS[1]),
            tolerance: (TOLERANCE * error).clamp(TOLERANCES[0], TOLERANCES[1]),
        }
    }
}

/// A place that may get a record.
#[derive(Clone)]
struct Place {
    captured: Captured,
    /// Width of a pixel there, scene units.
    footprint: f32,
}

/// Gathers the light of some of the places of a pass, each with random numbers of its own `stream`; of none from when `over` says so.
fn gather_all(
    world: &World<'_>,
    far: &FarField<'_>,
    (places, chosen): (&[Place], Range<usize>),
    strata: Strata,
    pass: u32,
    stream: &(dyn Fn(usize) -> u32 + Sync),
    over: &(dyn Fn() -> bool + Sync),
) -> Vec<Record> {
    // Places of the first pass show by two values of each how noisy records are.
    let one = |ws: &mut Workspace, number: usize| {
        if over() { None } else { gather(world, far, ws, &places[number], strata, stream(number), pass == 0) }
    };
    let records: Vec<Option<Record>> = chosen.into_par_iter().map_init(Workspace::default, one).collect();
    records.into_iter().flatten().collect()
}

/// Gathers the light of one place, once or twice.
fn gather(
    world: &World<'_>,
    far: &FarField<'_>,
    ws: &mut Workspace,
    place: &Place,
    strata: Strata,
    stream: u32,
    twice: bool,
) -> Option<Record> {
    let Captured { point, normal, .. } = &place.captured;
    let frame = basis(*normal);
    let mut once = |stream: u32| {
        let stream = SobolStream::new(stream);
        let paths: Vec<Path> = strata
            .in_blocks()
            .map(|k| {
                let (numbers, [u, v, near, _]) = stream.point(k as u32);
                let direction = strata.direction(&frame, k, [u, v]);
                Path {
                    near: far.r_thresh * (0.5 + near),
                    arrival: Arrival::Soft,
                    gathers: true,
                    depth: 1,
                    ..Path::view(Ray::new(point.ray_origin(direction), direction), k as u32, numbers)
                }
            })
            .collect();
        let (radiance, distances) = world.gather_with_distances(ws, &paths, strata.len());
        Record::new(point.position, *normal, LEAST_PIXELS * place.footprint, strata, radiance, distances)
    };
    let record = once(stream)?;
    if !twice {
        return Some(record);
    }
    once(hash_all(&[stream, TWICE])).map(|again| record.averaged(&again, strata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cache of records at `positions`, each with one ray in 48 that is so many times as bright as the others.
    fn cache(positions: &[(Vec3, f32)]) -> IrradianceCache {
        let strata = Strata::of(48.0);
        let record = |&(position, times): &(Vec3, f32)| {
            let radiance: Vec<Vec3> =
                (0..strata.len()).map(|k| Vec3::splat(if k == 7 { times } else { 1.0 })).collect();
            Record::new(position, Vec3::Z, 1.0, strata, &radiance, &vec![10.0; strata.len()]).unwrap()
        };
        let records: Vec<Record> = positions.iter().map(record).collect();
        IrradianceCache { index: Index::new(&records), records, ..IrradianceCache::default() }
    }

    fn refuses(mut cache: IrradianceCache, tolerance: f32) -> Vec<bool> {
        cache.check(tolerance);
        cache.records.iter().map(|record| record.refuses).collect()
    }

    /// A ray that is 11 times as bright brings 11/58 of the light.
    #[test]
    fn a_record_alone_must_not_depend_on_one_ray() {
        assert_eq!(refuses(cache(&[(Vec3::ZERO, 1.0)]), 0.12), [false]);
        assert_eq!(refuses(cache(&[(Vec3::ZERO, 11.0)]), 0.12), [true]);
        assert_eq!(refuses(cache(&[(Vec3::ZERO, 11.0)]), 0.2), [false]);
        let far = 5.0 * Vec3::X;
        assert_eq!(refuses(cache(&[(Vec3::ZERO, 11.0), (far, 1.0)]), 0.12), [true, false]);
    }

    /// Where two reach each other, what they say decides: 58/48 differs from 1 by 17 % of the larger.
    #[test]
    fn records_that_contradict_each_other_refuse() {
        let near = 0.1 * Vec3::X;
        assert_eq!(refuses(cache(&[(Vec3::ZERO, 11.0), (near, 11.0)]), 0.12), [false, false]);
        let mut odd = cache(&[(Vec3::ZERO, 11.0), (near, 1.0)]);
        odd.records.iter_mut().for_each(|record| record.by_translation = [Vec3::ZERO; 3]);
        assert_eq!(refuses(odd.clone(), 0.12), [true, true]);
        assert_eq!(refuses(odd, 0.2), [false, false]);
    }
}
