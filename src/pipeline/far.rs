//! The far field: simplified scene and radiosity solution, made or taken from the cache folder.

use std::sync::Arc;

use super::cache::{Cache, Key};
use super::stats::CacheUse;
use super::{Settings, Stats};
use crate::backend::{RayBackend, RayScene};
use crate::clock::Stopwatch;
use crate::error::Result;
use crate::lighting::Lights;
use crate::progress::Progress;
use crate::radiosity::{self, RadiosityParams, RadiosityScene, Solution};
use crate::render::{IrradianceCache, Nearness};
use crate::scene::{Digest, Scene};
use crate::simplify::{self, Simplified, SimplifiedGeometry, SimplifyParams, TriangleSource};

/// The far field's parts; see [`FarField`](crate::render::FarField).
pub struct Far {
    /// How the simplification came about; `None` where the geometry is complete (PMM).
    pub simplified: Option<Simplified>,
    /// The triangles that radiosity was solved on.
    pub geometry: SimplifiedGeometry,
    /// The same, for rays.
    pub rays: Box<dyn RayScene>,
    /// Radiosities.
    pub solution: Solution,
    /// See [`FarField::plain`](crate::render::FarField::plain).
    pub plain: Vec<bool>,
    /// Where near parts of gather rays need the detailed scene.
    pub nearness: Option<Nearness>,
}

impl Far {
    pub(super) fn new(
        scene: &Arc<Scene>,
        lights: &Lights,
        backend: &dyn RayBackend,
        settings: &Settings,
        kept: &mut Kept,
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<Far> {
        let start = Stopwatch::start();
        let simplified = kept.simplify(scene, backend, &settings.simplify_params(), progress)?;
        stats.record_simplified(&simplified);
        let complete = settings.complete_geometry();
        let geometry = if complete {
            SimplifiedGeometry::complete(scene, &simplified.surface_of_triangle)
        } else {
            simplified.geometry.clone()
        };
        stats.record_time(start, |s| &mut s.simplify);

        let start = Stopwatch::start();
        let rays = geometry.build(scene, backend)?;
        let nearness = (!complete).then(|| {
            let reach = 1.5 * settings.r_thresh();
            let clusters = simplified.clusters.iter().map(|c| c.bounds.union(c.equivalent_box.bounds()));
            let dropped = simplified.surfaces.iter().filter(|s| s.class.is_isolated()).map(|s| s.bounds);
            Nearness::new(scene.mesh.bounds, clusters.chain(dropped), reach)
        });
        stats.record_time(start, |s| &mut s.build);

        let start = Stopwatch::start();
        let clusters: &[_] = if complete { &[] } else { &simplified.clusters };
        let input = RadiosityScene { scene, lights, geometry: &geometry, clusters, rays: rays.as_ref() };
        let solution = kept.solve(&input, complete, &settings.radiosity_params(), progress)?;
        stats.record_time(start, |s| &mut s.radiosity);
        stats.record_solution(&solution);
        let plain = geometry.sources.iter().map(|source| is_plain(scene, source, complete)).collect();
        Ok(Far { simplified: (!complete).then_some(simplified), geometry, rays, solution, plain, nearness })
    }
}

/// Whether all that leaves a triangle of the far field's geometry is taken from the radiosity solution: for PMM with rough reflection as if it
/// were diffuse.
fn is_plain(scene: &Scene, source: &TriangleSource, complete: bool) -> bool {
    match *source {
        TriangleSource::BoxFace { .. } => true,
        TriangleSource::Scene { triangle } => {
            let material = scene.material(triangle);
            !material.is_emitter() && if complete { !material.may_be_sharp() } else { material.is_lambertian() }
        }
    }
}

/// Simplifies and solves, or takes from the cache folder what was made before, where there is one.
#[derive(Default)]
pub(super) struct Kept(Option<Inside>);

/// The folder, and what names the results for a scene in it.
struct Inside {
    cache: Cache,
    scene: Digest,
    backend: String,
    /// Key of the simplified scene, which the radiosity solution follows from.
    simplified: String,
    /// Key of the radiosity solution, which shared irradiance caches follow from.
    radiosity: String,
    used: CacheUse,
}

impl Kept {
    /// Opens the folder that the settings name.
    ///
    /// # Errors
    /// When it cannot be made.
    pub(super) fn open(settings: &Settings, scene: &Scene, backend: &dyn RayBackend) -> Result<Kept> {
        let Some(folder) = &settings.cache else { return Ok(Kept(None)) };
        Ok(Kept(Some(Inside {
            cache: Cache::open(folder)?,
            scene: scene.digest(),
            backend: backend.name(),
            simplified: String::new(),
            radiosity: String::new(),
            used: CacheUse::default(),
        })))
    }

    /// What was taken from the folder so far.
    pub(super) fn used(&self) -> Option<CacheUse> {
        self.0.as_ref().map(|inside| inside.used)
    }

    /// [`simplify::simplify`]; what is read counts no rays.
    pub(super) fn simplify(
        &mut self,
        scene: &Arc<Scene>,
        backend: &dyn RayBackend,
        params: &SimplifyParams,
        progress: &Progress,
    ) -> Result<Simplified> {
        let make = || simplify::simplify(scene, backend, params, progress);
        let Some(Inside { cache, scene: digest, backend: name, simplified, used, .. }) = &mut self.0 else {
            return make();
        };
        let key = Key::new("simplified", &[digest.surfaces.to_hex().as_str(), name, &format!("{params:?}")]);
        let (result, fetched) = cache.fetch(key, progress, |s: Simplified| s.restored(scene), make)?;
        (*simplified, used.simplify) = (key.as_cause(), Some(fetched));
        Ok(result)
    }

    /// [`radiosity::solve`](radiosity::solve()) on what [`Kept::simplify`] gave; what is read counts no rays.
    fn solve(
        &mut self,
        input: &RadiosityScene<'_>,
        complete: bool,
        params: &RadiosityParams,
        progress: &Progress,
    ) -> Result<Solution> {
        let geometry = if complete { "complete" } else { "simplified" };
        let make = || radiosity::solve(input, params, progress);
        let Some(Inside { cache, scene, simplified, radiosity, used, .. }) = &mut self.0 else { return make() };
        let key = Key::new("radiosity", &[simplified, &scene.lights.to_hex(), geometry, &format!("{params:?}")]);
        let triangles = input.geometry.triangles.len();
        let (solution, fetched) = cache.fetch(key, progress, |s: Solution| s.restored(triangles), make)?;
        (*radiosity, used.radiosity) = (key.as_cause(), Some(fetched));
        Ok(solution)
    }

    /// An irradiance cache that `fill` makes from what [`Kept::solve`] gave and from `causes`.
    pub(super) fn flight(
        &mut self,
        causes: &str,
        progress: &Progress,
        fill: impl FnOnce() -> IrradianceCache,
    ) -> Result<IrradianceCache> {
        let Some(Inside { cache, radiosity, used, .. }) = &mut self.0 else { return Ok(fill()) };
        let key = Key::new("flight", &[radiosity, causes]);
        let sound = |flight: IrradianceCache| flight.is_sound().then_some(flight);
        let (flight, fetched) = cache.fetch(key, progress, sound, || Ok(fill()))?;
        used.flight = Some(fetched);
        Ok(flight)
    }
}
