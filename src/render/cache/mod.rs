//! An irradiance cache: indirect light of diffuse surfaces is gathered at few places and interpolated in between.
//!
//! Light from beyond `r_thresh` varies slowly over distances small against `r_thresh`: that is what simplification makes of it.
//! Records are placed where the image needs them, on ever finer grids of pixels, until every place is within reach of one
//! (Ward, Rubinstein and Clear 1988). How far a record reaches follows from the distances of what it sees, so that records are
//! close together next to other surfaces. Where none reaches, paths gather as without a cache.

mod clamp;
pub mod flight;
mod index;
mod record;

use glam::Vec3;
use rayon::prelude::*;

use super::integrator::{Captured, FarField, World};
use super::path::{Arrival, Path};
use super::view::ViewRays;
use super::workspace::Workspace;
use crate::backend::Ray;
use crate::sampling::{hash_all, sobol};
use crate::scene::Camera;
use clamp::clamped_distances;
use index::Index;
use record::{Record, Strata};

/// Pass after pass: the distance in pixels of the places that are looked at, and the rays of a record. Records that are close
/// together share their noise.
const PASSES: [(u32, Strata); 4] = [
    (16, Strata { rings: 16, sectors: 48 }),
    (8, Strata { rings: 12, sectors: 36 }),
    (4, Strata { rings: 10, sectors: 30 }),
    (2, Strata { rings: 8, sectors: 24 }),
];

/// A place that has less weight of records than this gets one of its own.
const COVERED: f32 = 0.4;

/// Reach of a record as a share of its harmonic mean distance.
const ACCURACY: f32 = 0.3;

/// Records refuse that had to be given more than this many times the reach that their distances allow, as a share.
const TOO_SMALL: f32 = 0.25;

/// Relative difference from what the others say at which a record refuses.
const TOLERANCE: f32 = 0.2;

/// Least reach in pixels.
const LEAST_PIXELS: f32 = 3.0;

/// Keeps the cache's random numbers apart from the image's.
const STREAM: u32 = 0x6361_6368;

/// Records of indirect light.
#[derive(Clone, Debug, Default)]
pub struct IrradianceCache {
    records: Vec<Record>,
    index: Index,
}

impl IrradianceCache {
    /// Fills a cache for one view. The same on any number of threads, unless `over` says that it must end.
    pub fn new(
        world: &World<'_>,
        camera: &Camera,
        size: [u32; 2],
        seed: u32,
        over: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let Some(far) = &world.far else { return IrradianceCache::default() };
        let view = ViewRays::new(camera, size, hash_all(&[seed, STREAM]));
        let mut cache = IrradianceCache::default();
        for (pass, (spacing, strata)) in PASSES.into_iter().enumerate() {
            let places = cache.places(world, &view, size, spacing, pass as u32);
            let fresh: Vec<Option<Record>> = places
                .par_iter()
                .enumerate()
                .map_init(Workspace::default, |ws, (number, place)| {
                    let stream = hash_all(&[seed, STREAM, pass as u32, number as u32]);
                    if over() { None } else { gather(world, far, ws, place, strata, stream) }
                })
                .collect();
            cache.records.extend(fresh.into_iter().flatten());
            cache.settle(far.r_thresh);
            log::debug!("irradiance cache: {} places at every {spacing} pixels, {} records", places.len(), cache.len());
        }
        cache.check();
        let refuse = cache.records.iter().filter(|r| r.refuses).count();
        log::debug!("irradiance cache: {refuse} of {} records refuse", cache.len());
        cache
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
        self.arrange();
    }

    /// Makes the records findable.
    fn arrange(&mut self) {
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

    /// Irradiance over pi at a point with shading normal `normal`; `None` where no record reaches, or most refuse.
    pub fn look_up(&self, position: Vec3, normal: Vec3) -> Option<Vec3> {
        let (mut sum, mut weights, mut refused) = (Vec3::ZERO, 0.0, 0.0);
        for (weight, record) in self.around(position, normal) {
            if record.refuses {
                refused += weight;
            } else {
                sum += weight * record.at(position, normal);
                weights += weight;
            }
        }
        (weights > refused).then(|| sum / weights)
    }

    /// Asks the others what each record measured itself. Records that are told something else refuse.
    fn check(&mut self) {
        let refuses: Vec<bool> = (0..self.records.len())
            .into_par_iter()
            .map(|number| {
                let own = &self.records[number];
                let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
                for (weight, other) in self.around(own.position, own.normal).filter(|(_, o)| !std::ptr::eq(*o, own)) {
                    sum += weight * other.at(own.position, own.normal);
                    weights += weight;
                }
                let (told, measured) = ((sum / weights).element_sum(), own.radiance.element_sum());
                weights > 0.0 && (told - measured).abs() > TOLERANCE * told.max(measured)
            })
            .collect();
        for (record, refuses) in self.records.iter_mut().zip(refuses) {
            record.refuses |= refuses;
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

/// Gathers the light of one place.
fn gather(
    world: &World<'_>,
    far: &FarField<'_>,
    ws: &mut Workspace,
    place: &Place,
    strata: Strata,
    stream: u32,
) -> Option<Record> {
    let Captured { point, normal, .. } = &place.captured;
    let paths: Vec<Path> = (0..strata.len())
        .map(|k| {
            let direction = strata.direction(*normal, k, stream);
            let [.., u, _] = sobol(k as u32, 0, stream);
            Path {
                near: far.r_thresh * (0.5 + u),
                arrival: Arrival::Soft,
                gathers: true,
                depth: 1,
                ..Path::view(Ray::new(point.ray_origin(direction), direction), k as u32, k as u32, stream)
            }
        })
        .collect();
    let (radiance, distances) = world.gather_with_distances(ws, &paths, strata.len());
    Record::new(point.position, *normal, LEAST_PIXELS * place.footprint, strata, radiance, distances)
}
