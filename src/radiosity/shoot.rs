//! Shooting: photons leave patches (or light sources), meet patches, and are reflected specularly on the way where a surface
//! is a mirror or glass.

use std::ops::Range;

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::RadiosityScene;
use super::arrived::{Arrived, Landing, Place, Places};
use super::ledger::Tally;
use super::optics::Optics;
use super::patches::Patches;
use crate::backend::{Coherence, Hit, Ray, Visible, edge};
use crate::sampling;
use crate::shading::{Bsdf, Lobes, SurfacePoint, share_of};
use crate::simplify::TriangleSource;

/// Rays traced in one call of the backend. What a chunk deposits fits into memory that an allocator keeps at hand.
const CHUNK: u64 = 1024;
/// Chunks whose deposits are kept until they are added up in order.
const GROUP: u64 = 256;
/// Specular reflections after which a photon is given up.
const MAX_CHAIN: usize = 32;
/// Weight under which photons go on only with proportional probability.
const ROULETTE: f32 = 0.25;

/// Light of one patch side that is shot with equal shares over a number of rays.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    /// The side.
    pub side: u32,
    /// Number of rays.
    pub rays: u32,
    /// Flux of each ray.
    pub flux: DVec3,
    /// Stream of low-discrepancy points.
    pub stream: u32,
    /// Where the light leaves from, and how: where it arrived and as it is reflected there. `None`: from everywhere and to everywhere alike.
    pub from: Option<Places>,
}

/// What a ray carries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// Flux, W.
    pub flux: DVec3,
    /// Number for random decisions.
    pub id: u64,
    /// Whether a mirror or a refracting surface has changed its course.
    pub bent: bool,
    /// How often it was traced again because it met an edge.
    pub retries: u8,
}

impl Load {
    /// A load that sets out.
    pub fn new(flux: DVec3, id: u64) -> Self {
        Load { flux, id, bent: false, retries: 0 }
    }

    /// Random numbers of its own, for step `depth` of its way.
    fn random(&self, depth: u32) -> impl FnMut() -> f32 + use<> {
        let mut key = sampling::hash_all(&[self.id as u32, (self.id >> 32) as u32, depth]);
        move || {
            key = sampling::hash(key.wrapping_add(0x9e37_79b9));
            sampling::unit(key)
        }
    }

    /// The ray and load for another try, when `hit` lies on an edge, or once when it is a miss that is `doubtful`.
    fn again(&self, ray: &Ray, hit: &Hit, doubtful: bool, depth: u32) -> Option<(Ray, Load)> {
        let lost = doubtful && self.retries == 0 && !hit.is_hit();
        if !(lost || edge::is_on_edge(hit)) || self.retries == edge::RETRIES {
            return None;
        }
        let mut random = self.random(depth);
        let ray = edge::turned(ray, [random(), random(), random()]);
        Some((ray, Load { retries: self.retries + 1, ..*self }))
    }
}

/// Rays and what they carry, index by index.
#[derive(Default)]
pub(super) struct Photons {
    /// Rays.
    pub rays: Vec<Ray>,
    /// Loads.
    pub loads: Vec<Load>,
    /// Flux that did not set out though the mean reflectance of its patch says so, W; negative where more did.
    kept: DVec3,
    /// Light that coated sides reflected.
    coated: Vec<Coated>,
}

/// Light that a side reflected which is not Lambertian. Sums of them tell how much more of it than of light from everywhere was reflected diffusely.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coated {
    /// The side.
    pub side: u32,
    /// Flux, W, and the same times the diffuse albedo towards where it came from over the mean of that.
    pub flux: DVec2,
}

impl Photons {
    /// Adds a photon.
    pub fn push(&mut self, ray: Ray, load: Load) {
        self.rays.push(ray);
        self.loads.push(load);
    }

    fn clear(&mut self) {
        self.rays.clear();
        self.loads.clear();
        self.kept = DVec3::ZERO;
        self.coated.clear();
    }
}

/// Which photons light the patches they meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Deposit {
    /// All.
    All,
    /// Only those that were bent: the rest is known already.
    Bent,
}

/// All that shooting needs.
pub(super) struct Tracer<'a> {
    /// The scene.
    pub input: &'a RadiosityScene<'a>,
    /// Its patches.
    pub patches: &'a Patches,
    /// How they reflect.
    pub optics: &'a Optics,
}

#[derive(Default)]
struct Scratch {
    photons: Photons,
    next: Photons,
    hits: Vec<Hit>,
}

#[derive(Default)]
struct Output {
    landings: Vec<Landing>,
    coated: Vec<Coated>,
    tally: Tally,
}

/// Unit geometric normal of `side` at a point of its patch.
pub(super) fn side_normal(point: &SurfacePoint, side: u32) -> Vec3 {
    if side.is_multiple_of(2) { point.geometric_normal } else { -point.geometric_normal }
}

impl Tracer<'_> {
    /// Shoots `shots` and adds the light that arrives to `arrived`.
    pub fn shoot(&self, shots: &[Shot], arrived: &mut Arrived) -> Tally {
        let mut ends = Vec::with_capacity(shots.len());
        let mut total = 0;
        for shot in shots {
            total += u64::from(shot.rays);
            ends.push(total);
        }
        let emit = |range: Range<u64>, photons: &mut Photons| {
            let mut at = ends.partition_point(|&end| end <= range.start);
            for k in range {
                while ends[at] <= k {
                    at += 1;
                }
                let shot = &shots[at];
                let index = u64::from(shot.rays) - (ends[at] - k);
                let id = u64::from(shot.stream) << 32 | index;
                let leaving = self.leaving(shot, sampling::sobol(index as u32, 0, shot.stream), &mut photons.coated);
                if let Some((ray, flux)) = leaving {
                    photons.push(ray, Load::new(flux, id));
                }
                photons.kept += shot.flux - leaving.map_or(DVec3::ZERO, |(_, flux)| flux);
            }
        };
        self.trace(total, &emit, Deposit::All, arrived)
    }

    /// A ray of a shot and its flux, W. Where light is not reflected alike into all directions, the flux differs from ray to ray: what arrives
    /// along the surface, a coat reflects more of.
    fn leaving(&self, shot: &Shot, s: [f32; 4], coated: &mut Vec<Coated>) -> Option<(Ray, DVec3)> {
        let geometry = self.input.geometry;
        let place = shot.from.as_ref().map(|places| places.choose(s[0]));
        let point = match place {
            Some(place) => self.patches.point_at(geometry, place.triangle, place.uv),
            None => self.patches.open_point(geometry, shot.side, [s[0], s[1]]),
        };
        if let Some(place) = place
            && let TriangleSource::Scene { triangle } = geometry.sources[place.triangle as usize]
            && !self.input.scene.material(triangle).is_lambertian()
        {
            // Reflection is reciprocal.
            let on_scene = SurfacePoint { triangle, ..point };
            let bsdf = Bsdf::new(self.input.scene, &on_scene, place.from, Lobes::MIRRORS);
            let (diffuse, mean) = (bsdf.albedo_diffuse().element_sum(), bsdf.mean_albedo_diffuse().element_sum());
            let flux = shot.flux.element_sum();
            let over_mean = if mean > 0.0 { f64::from(diffuse / mean) } else { 1.0 };
            coated.push(Coated { side: shot.side, flux: DVec2::new(flux, flux * over_mean) });
            let sample = bsdf.sample_low([s[1], s[2], s[3]])?;
            let mean = self.optics.reflectance[shot.side as usize / 2];
            let weight = share_of(sample.weight, mean, Vec3::ZERO);
            let ray = Ray::new(point.ray_origin(sample.direction), sample.direction);
            return Some((ray, shot.flux * weight.as_dvec3()));
        }
        let local = sampling::cosine_hemisphere(Vec2::new(s[2], s[3]));
        let direction = sampling::basis(side_normal(&point, shot.side)) * local;
        Some((Ray::new(point.ray_origin(direction), direction), shot.flux))
    }

    /// Traces the photons `0..count`, which `emit` makes, and adds what arrives to `arrived`. The result does not depend on the
    /// number of threads: chunks have a fixed size and are added up in order.
    pub fn trace(
        &self,
        count: u64,
        emit: &(impl Fn(Range<u64>, &mut Photons) + Sync),
        deposit: Deposit,
        arrived: &mut Arrived,
    ) -> Tally {
        let mut tally = Tally::default();
        let chunks = count.div_ceil(CHUNK);
        for group in (0..chunks).step_by(GROUP as usize) {
            let outputs: Vec<Output> = (group..(group + GROUP).min(chunks))
                .into_par_iter()
                .map_init(Scratch::default, |scratch, chunk| {
                    scratch.photons.clear();
                    emit(chunk * CHUNK..((chunk + 1) * CHUNK).min(count), &mut scratch.photons);
                    self.follow(scratch, deposit)
                })
                .collect();
            for output in outputs {
                for landing in output.landings {
                    arrived.add(landing);
                }
                arrived.note_coated(&output.coated);
                tally.add(&output.tally);
            }
        }
        tally
    }

    fn follow(&self, scratch: &mut Scratch, deposit: Deposit) -> Output {
        let Scratch { photons, next, hits } = scratch;
        let tally = Tally { kept: photons.kept, ..Tally::default() };
        let coated = std::mem::take(&mut photons.coated);
        let mut output = Output { landings: Vec::with_capacity(photons.rays.len()), coated, tally };
        for depth in 0..MAX_CHAIN {
            if photons.rays.is_empty() {
                return output;
            }
            hits.resize(photons.rays.len(), Hit::MISS);
            self.input.rays.closest(&photons.rays, Visible::All, Coherence::Incoherent, hits);
            output.tally.rays += photons.rays.len() as u64;
            next.clear();
            let doubtful = edge::misses_are_doubtful(hits);
            for ((ray, load), hit) in photons.rays.iter().zip(&photons.loads).zip(hits.iter()) {
                let counts = deposit == Deposit::All || load.bent;
                if let Some((ray, load)) = load.again(ray, hit, doubtful, depth as u32) {
                    next.push(ray, load);
                    continue;
                }
                if !hit.is_hit() {
                    if counts {
                        output.tally.escaped += load.flux;
                    }
                    continue;
                }
                let (patch, local) = self.patches.map.locate(hit.triangle, hit.u, hit.v);
                if counts {
                    let front = ray.direction.dot(self.patches.planes[hit.triangle as usize].normal) < 0.0;
                    let side = 2 * patch + u32::from(!front);
                    output.landings.push(Landing { side, flux: load.flux, place: Place::met(ray, hit), local });
                }
                if self.optics.specular[patch as usize]
                    && let Some((ray, load)) = self.pass_on(patch, hit, ray.direction, load, depth as u32)
                {
                    if deposit == Deposit::All || load.bent {
                        output.tally.passed_on += load.flux;
                    }
                    next.push(ray, load);
                }
            }
            std::mem::swap(photons, next);
        }
        output.tally.lost = photons.loads.iter().map(|l| l.flux).sum();
        photons.clear();
        output
    }

    /// How a photon goes on from a mirror, glass or a pane.
    fn pass_on(&self, patch: u32, hit: &Hit, direction: Vec3, load: &Load, depth: u32) -> Option<(Ray, Load)> {
        let TriangleSource::Scene { triangle } = self.input.geometry.sources[hit.triangle as usize] else {
            return None;
        };
        let scene = self.input.scene;
        let point = SurfacePoint::new(scene, &Hit { triangle, ..*hit });
        let bsdf = Bsdf::new(scene, &point, -direction, Lobes::MIRRORS);
        let mut random = load.random(depth);
        let sample = bsdf.sample_high([random(), random(), random()])?;
        let material = &scene.materials[scene.mesh.object(triangle).material as usize];
        let mut weight = sample.weight;
        if sample.transmitted && !sample.straight && material.refracts {
            // Flux, unlike radiance, does not change with the index of refraction (pbrt 4ed 9.5.2).
            let squared = material.ior.max(1.0).powi(2);
            let front = direction.dot(point.geometric_normal) < 0.0;
            weight *= if front { squared } else { 1.0 / squared };
        }
        // What the patch takes for diffuse reflection cannot go on as well.
        let weight = weight.min(Vec3::ONE - self.optics.reflectance[patch as usize]).max(Vec3::ZERO)
            * point.absorption(scene, -direction, hit.t);
        let survival = (weight.max_element() / ROULETTE).min(1.0);
        if random() >= survival {
            return None;
        }
        let flux = load.flux * (weight / survival).as_dvec3();
        let load = Load { flux, bent: load.bent || !sample.straight, ..*load };
        Some((Ray::new(point.ray_origin(sample.direction), sample.direction), load))
    }
}
