//! Photons from the light sources to where they land.

use glam::Vec3;
use rayon::prelude::*;

use super::aim::Seen;
use super::map::Photon;
use super::sources::Sources;
use super::targets::Target;
use crate::backend::edge::settle_edges;
use crate::backend::{Coherence, Hit, Ray, RayScene, Visible};
use crate::sampling::sobol;
use crate::scene::Scene;
use crate::shading::{Bsdf, BsdfSample, Lobes, SurfacePoint};

/// Photons that are wanted ...
const WANTED: u64 = 1 << 18;
/// ... most that set out for them ...
const MOST: u64 = 1 << 21;
/// ... and those that set out first, to see how many land.
const PILOT: u64 = 1 << 14;

/// Photons that are traced as one batch.
const BATCH: u64 = 4096;

/// Events after which a photon is given up: light can be trapped in glass for ever.
const MAX_EVENTS: u32 = 64;

/// Blocks of random numbers that setting out takes.
const START_BLOCKS: u32 = 2;

/// All that photons fly through.
#[derive(Clone, Copy)]
pub(super) struct Flight<'a> {
    pub scene: &'a Scene,
    pub rays: &'a dyn RayScene,
    /// Whether a material bends light, for each material.
    pub bends: &'a [bool],
    pub sources: &'a Sources,
    pub targets: &'a [Target],
}

/// A photon on its way.
#[derive(Clone, Copy)]
struct Flying {
    ray: Ray,
    flux: Vec3,
    /// Whether anything has changed its course.
    bent: bool,
    /// Its number.
    number: u32,
}

impl Flight<'_> {
    /// Photons where they land on weakly directional surfaces, about as many as wanted. Those that only tell how many are needed have no
    /// part in the result, which has no bias therefore.
    pub fn photons(&self, stream: u32) -> Vec<Photon> {
        if self.sources.is_empty() {
            return Vec::new();
        }
        let pilot = self.fly(PILOT, stream ^ 1).len() as u64;
        self.fly((WANTED * PILOT / pilot.max(1)).clamp(PILOT, MOST), stream)
    }

    /// Sends out `count` photons; those that land, always in the same order.
    fn fly(&self, count: u64, stream: u32) -> Vec<Photon> {
        let batches: Vec<Vec<Photon>> = (0..count.div_ceil(BATCH))
            .into_par_iter()
            .map_init(Seen::default, |seen, batch| {
                let numbers = batch * BATCH..((batch + 1) * BATCH).min(count);
                let flying = numbers.filter_map(|number| {
                    let number = number as u32;
                    let block = |b: u32| sobol(number, b, stream);
                    let (ray, flux) = self.sources.emit(self.scene, self.targets, seen, block(0), block(1))?;
                    Some(Flying { ray, flux: flux / count as f32, bent: false, number })
                });
                self.follow(flying.collect(), stream)
            })
            .collect();
        batches.concat()
    }

    fn follow(&self, mut flying: Vec<Flying>, stream: u32) -> Vec<Photon> {
        let (mut landed, mut next) = (Vec::new(), Vec::new());
        let (mut rays, mut hits): (Vec<Ray>, Vec<Hit>) = (Vec::new(), Vec::new());
        for event in 0..MAX_EVENTS {
            if flying.is_empty() {
                break;
            }
            rays.clear();
            rays.extend(flying.iter().map(|f| f.ray));
            hits.resize(rays.len(), Hit::MISS);
            self.rays.closest(&rays, Visible::All, Coherence::Incoherent, &mut hits);
            settle_edges(self.rays, &mut rays, &mut hits);
            next.clear();
            for ((photon, ray), hit) in flying.iter().zip(&rays).zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                let point = SurfacePoint::new(self.scene, hit);
                let toward = -ray.direction;
                let bends = self.bends[self.scene.mesh.object(hit.triangle).material as usize];
                if !(bends || photon.bent) {
                    continue;
                }
                let bsdf = Bsdf::new(self.scene, &point, toward, Lobes::MIRRORS);
                if photon.bent && bsdf.albedo_low() != Vec3::ZERO {
                    let side = if toward.dot(point.geometric_normal) >= 0.0 { 1.0 } else { -1.0 };
                    let normal = side * point.geometric_normal;
                    landed.push(Photon { position: point.position, normal, toward, flux: photon.flux });
                }
                if bends {
                    let u = sobol(photon.number, START_BLOCKS + event, stream);
                    next.extend(self.bend(photon, &point, &bsdf, toward, u));
                }
            }
            std::mem::swap(&mut flying, &mut next);
        }
        landed
    }

    /// How a photon that comes from `toward` goes on.
    fn bend(&self, photon: &Flying, point: &SurfacePoint, bsdf: &Bsdf, toward: Vec3, u: [f32; 4]) -> Option<Flying> {
        let sample = bsdf.sample_high([u[0], u[1], u[2]])?;
        let share = sample.weight * self.flux_per_radiance(point, toward, &sample);
        let survival = share.max_element().min(1.0);
        (u[3] < survival).then(|| Flying {
            ray: Ray::new(point.ray_origin(sample.direction), sample.direction),
            flux: photon.flux * share / survival,
            bent: photon.bent || !sample.straight,
            number: photon.number,
        })
    }

    /// Sampled weights are those of radiance on its way to the eye. Flux does not change with the index of refraction (pbrt 4ed 9.5.2), and
    /// shading normals make a difference between the two directions of light (Veach 1997, 5.3).
    fn flux_per_radiance(&self, point: &SurfacePoint, toward: Vec3, sample: &BsdfSample) -> f32 {
        let (geometric, shading) = (point.geometric_normal, point.shading_normal);
        let cosines = |normal: Vec3| [toward, sample.direction].map(|d| normal.dot(d).abs());
        let ([g_in, g_out], [s_in, s_out]) = (cosines(geometric), cosines(shading));
        let of_normals = if sample.straight || g_in * s_out == 0.0 { 1.0 } else { (s_in * g_out) / (g_in * s_out) };
        let material = &self.scene.materials[self.scene.mesh.object(point.triangle).material as usize];
        if !sample.transmitted || sample.straight || !material.refracts {
            return of_normals;
        }
        let squared = material.ior.max(1.0).powi(2);
        of_normals * if toward.dot(geometric) > 0.0 { squared } else { squared.recip() }
    }
}
