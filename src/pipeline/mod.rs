//! From a scene to everything the renderer needs, and the record of what was done.

pub mod auto;
pub mod cache;
mod far;
pub mod identity;
pub mod settings;
pub mod stats;
pub mod validate;

use std::sync::Arc;

pub use cache::Cache;
pub use far::Far;
pub use settings::{BackendKind, GeometryKind, Method, Settings};
pub use stats::Stats;

use crate::backend::embree::EmbreeBackend;
use crate::backend::obvhs::ObvhsBackend;
use crate::backend::{RayBackend, RayScene, TriangleSet};
use crate::clock::Stopwatch;
use crate::error::{Error, Result};
use crate::lighting::Lights;
use crate::progress::Progress;
use crate::radiosity::RadiosityParams;
use crate::render::{
    self, Caustics, FarField, IrradianceCache, RenderParams, Rendering, Round, Session, Watcher, World,
};
use crate::scene::{Camera, Scene};
use crate::shading::Lobes;
use crate::simplify::{self, Simplified, SimplifyParams};
use far::Kept;

/// A scene, prepared for one method: acceleration structures, simplified scene, radiosity solution.
pub struct Prepared {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Its light sources.
    pub lights: Lights,
    /// Normal and complex surfaces.
    pub detailed: Box<dyn RayScene>,
    /// What light from beyond `r_thresh` is taken from; `None` for path tracing.
    pub far: Option<Far>,
    /// Photons from small light sources, where mirrors or glass bend their light; `None` for path tracing.
    pub caustics: Option<Caustics>,
    /// Settings with every automatic choice filled in.
    pub settings: Settings,
    /// Indirect light that all images are interpolated from; see [`Prepared::share_between`].
    flight: Option<IrradianceCache>,
    kept: Kept,
}

impl Prepared {
    /// Does everything that comes before the first pixel; times and counts go to `stats`.
    ///
    /// # Errors
    /// Usage errors in the settings, backend failures, scenes without a steady state.
    pub fn new(
        scene: Arc<Scene>,
        camera: &Camera,
        settings: Settings,
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<Prepared> {
        Self::for_cameras(scene, std::slice::from_ref(camera), settings, progress, stats)
    }

    /// As [`Prepared::new`], for several cameras: what is chosen from the scene suits all of them.
    ///
    /// # Errors
    /// As [`Prepared::new`].
    pub fn for_cameras(
        scene: Arc<Scene>,
        cameras: &[Camera],
        mut settings: Settings,
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<Prepared> {
        settings.check()?;
        let backend = settings.backend.create(settings.threads)?;
        let start = Stopwatch::start();
        let detailed = build_detailed(&scene, backend.as_ref())?;
        let mut lights = Lights::new(&scene);
        lights.look_out(&scene, detailed.as_ref(), settings.seed);
        stats.record_time(start, |s| &mut s.build);
        stats.backend = backend.name();
        stats.counts.triangles = scene.mesh.triangles.len() as u64;

        auto::fill_in(&mut settings, &scene, detailed.as_ref(), cameras);
        let mut kept = Kept::open(&settings, &scene, backend.as_ref())?;
        let far = match settings.method {
            Method::Mcpt => None,
            // Gather rays change to the far field at half of r_thresh or later: here none is as long.
            Method::Gsii if 0.5 * settings.r_thresh() > scene.mesh.bounds.size().length() => None,
            _ => Some(Far::new(&scene, &lights, backend.as_ref(), &settings, &mut kept, progress, stats)?),
        };
        let caustics = match (settings.method, &far) {
            (Method::Gsii | Method::Pmm, Some(_)) => {
                let start = Stopwatch::start();
                let reach = settings.radiosity_params().patch_size;
                let caustics = Caustics::new(&scene, &lights, detailed.as_ref(), reach, settings.seed);
                stats.record_time(start, |s| &mut s.caustics);
                caustics
            }
            _ => None,
        };
        stats.counts.photons = caustics.as_ref().map_or(0, |c| c.len() as u64);
        stats.parameters = settings.parameters();
        stats.cache = kept.used();
        Ok(Prepared { scene, lights, detailed, far, caustics, settings, flight: None, kept })
    }

    /// What the renderer works with.
    pub fn world(&self) -> World<'_> {
        World {
            scene: &self.scene,
            lights: &self.lights,
            detailed: self.detailed.as_ref(),
            simplified: self.far.as_ref().and_then(|far| far.simplified.as_ref()),
            far: self.far.as_ref().map(|far| FarField {
                rays: far.rays.as_ref(),
                geometry: &far.geometry,
                solution: &far.solution,
                plain: &far.plain,
                r_thresh: if self.settings.method == Method::Gsii { self.settings.r_thresh() } else { 0.0 },
                nearness: far.nearness.as_ref(),
            }),
            gather_lobes: Lobes {
                threshold: self.settings.glossy_threshold,
                // Path tracing is the reference: nothing is blurred there.
                least_roughness: if self.far.is_some() { self.settings.filter_glossy } else { 0.0 },
                mirrors: false,
            },
            cache: self.flight.as_ref(),
            caustics: self.caustics.as_ref(),
            max_depth: self.settings.max_depth,
        }
    }
}

impl Prepared {
    /// Fills one irradiance cache for many views, each a camera with the size of its image in pixels: what is interpolated is then
    /// the same in all images of the scene. Does nothing where nothing is interpolated.
    ///
    /// # Errors
    /// None but those of the cache folder.
    pub fn share_between(
        &mut self,
        views: &[(Camera, [u32; 2])],
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<()> {
        if self.settings.method == Method::Radiosity || !self.world().has_two_fields() {
            return Ok(());
        }
        let start = Stopwatch::start();
        let stage = progress.stage("irradiance cache", 0);
        let mut kept = std::mem::take(&mut self.kept);
        let settings = Settings { cache: None, threads: 0, ..self.settings.clone() };
        let fill = || IrradianceCache::for_views(&self.world(), views, settings.seed, &|| progress.stopped());
        let flight = kept.flight(&format!("{settings:?} {views:?}"), progress, fill)?;
        stats.cache = kept.used();
        (self.kept, self.flight) = (kept, Some(flight));
        stage.finish_and_clear();
        stats.record_time(start, |s| &mut s.flight);
        Ok(())
    }

    /// Renders with the method that this was prepared for.
    pub fn render(&self, camera: &Camera, params: &RenderParams, progress: &Progress) -> Rendering {
        self.resume(camera, params, Session::new(params), progress, None)
    }

    /// Goes on with a rendering while `watcher` looks at it; see [`render::resume`]. Radiosity is shown from the beginning, in one go.
    pub fn resume(
        &self,
        camera: &Camera,
        params: &RenderParams,
        session: Session,
        progress: &Progress,
        watcher: Option<&mut dyn Watcher>,
    ) -> Rendering {
        let world = self.world();
        match (self.settings.method, world.far) {
            (Method::Radiosity, Some(far)) => render::show::show_radiosity(&world, &far, camera, params),
            _ => render::resume(&world, camera, params, session, progress, watcher),
        }
    }

    /// Renders with as many trials for every pixel, showing `watch` the image whenever their number has doubled; see
    /// [`render::render_rounds`]. Radiosity is shown in one round.
    pub fn render_rounds(
        &self,
        camera: &Camera,
        params: &RenderParams,
        progress: &Progress,
        watch: &mut dyn FnMut(&Round<'_>) -> bool,
    ) {
        if self.settings.method == Method::Radiosity {
            let trials = params.max_trials;
            let rendering = self.render(camera, &RenderParams { min_trials: trials, ..params.clone() }, progress);
            watch(&Round { film: &rendering.film, trials, rays: rendering.rays, times: rendering.times });
        } else {
            render::render_rounds(&self.world(), camera, params, progress, watch);
        }
    }
}

/// Simplifies a scene and does nothing else; gives the settings with every automatic choice filled in.
///
/// # Errors
/// Usage errors in the settings, backend failures.
pub fn simplify_only(
    scene: &Arc<Scene>,
    camera: &Camera,
    mut settings: Settings,
    progress: &Progress,
    stats: &mut Stats,
) -> Result<(Simplified, Settings)> {
    settings.check()?;
    let backend = settings.backend.create(settings.threads)?;
    if settings.r_thresh.is_none() || settings.patch_size.is_none() {
        settings = automatic(scene, std::slice::from_ref(camera), settings)?;
    }
    let mut kept = Kept::open(&settings, scene, backend.as_ref())?;
    let start = Stopwatch::start();
    let simplified = kept.simplify(scene, backend.as_ref(), &settings.simplify_params(), progress)?;
    stats.record_time(start, |s| &mut s.simplify);
    stats.cache = kept.used();
    stats.record_simplified(&simplified);
    Ok((simplified, settings))
}

/// Settings with every automatic choice filled in, so that they suit all `cameras`; nothing else is done.
///
/// # Errors
/// Usage errors in the settings, backend failures.
pub fn automatic(scene: &Arc<Scene>, cameras: &[Camera], mut settings: Settings) -> Result<Settings> {
    settings.check()?;
    let backend = settings.backend.create(settings.threads)?;
    let detailed = build_detailed(scene, backend.as_ref())?;
    auto::fill_in(&mut settings, scene, detailed.as_ref(), cameras);
    Ok(settings)
}

fn build_detailed(scene: &Arc<Scene>, backend: &dyn RayBackend) -> Result<Box<dyn RayScene>> {
    backend.build(&TriangleSet {
        positions: &scene.mesh.positions,
        triangles: &scene.mesh.triangles,
        parts: &scene.mesh.parts(),
        filter: simplify::scene_filter(scene),
    })
}

impl BackendKind {
    /// Starts the library.
    ///
    /// # Errors
    /// When it cannot be used, for instance because it is older than the headers it was bound with.
    pub fn create(self, threads: usize) -> Result<Box<dyn RayBackend>> {
        Ok(match self {
            BackendKind::Embree => Box::new(EmbreeBackend::new(threads)?),
            BackendKind::Obvhs => Box::new(ObvhsBackend),
        })
    }
}

/// The camera that a name or a number means; the first one without either.
///
/// # Errors
/// When the scene has no such camera; the message lists those it has.
pub fn choose_camera<'a>(scene: &'a Scene, wanted: Option<&str>) -> Result<&'a Camera> {
    choose_camera_among(&scene.name, &scene.cameras, wanted)
}

/// The same of `cameras` that are not, or not yet, those of a scene called `scene`.
///
/// # Errors
/// As [`choose_camera`].
pub fn choose_camera_among<'a>(scene: &str, cameras: &'a [Camera], wanted: Option<&str>) -> Result<&'a Camera> {
    let Some(wanted) = wanted else {
        return cameras.first().ok_or_else(|| Error::Usage(format!("{scene} has no camera")));
    };
    let by_name = cameras.iter().find(|c| c.name == wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| cameras.get(i));
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<String> = cameras.iter().enumerate().map(|(i, c)| format!("{i} ({})", c.name)).collect();
        Error::Usage(format!("{scene} has no camera '{wanted}'; it has {}", names.join(", ")))
    })
}

/// Keeps the parameter types of the stages in one place.
impl Settings {
    /// Parameters for [`simplify::simplify`]. PMM and radiosity on N+C keep every surface.
    pub fn simplify_params(&self) -> SimplifyParams {
        SimplifyParams {
            r_thresh: if self.complete_geometry() { 0.0 } else { self.r_thresh() },
            beta: self.beta,
            box_fit: self.box_fit,
            crease_angle: self.crease_angle,
            longest: self.longest_cluster,
            face_resolution: self.face_resolution,
            seed: self.seed,
        }
    }

    /// Parameters for [`radiosity::solve`](crate::radiosity::solve()).
    pub fn radiosity_params(&self) -> RadiosityParams {
        RadiosityParams {
            patch_size: self.patch_size.unwrap_or(f32::MAX),
            least_patches: self.least_patches,
            max_rays: self.radiosity_rays,
            focus: self.focus,
            unshot: self.unshot,
            direct: self.direct,
            error: self.radiosity_error,
            seed: self.seed,
            ambient: true,
            leave_out_covered: true,
            // PMM and radiosity shown directly are the paper's: light is spread over patches, and all of it is looked up.
            keep_places: self.method == Method::Gsii && !self.complete_geometry(),
            max_patches: 400_000,
        }
    }
}
