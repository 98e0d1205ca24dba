//! From a scene to everything the renderer needs, and the record of what was done.

pub mod auto;
pub mod identity;
pub mod settings;
pub mod stats;
pub mod validate;

use std::sync::Arc;

pub use settings::{BackendKind, GeometryKind, Method, Settings};
pub use stats::Stats;

use crate::backend::embree::EmbreeBackend;
use crate::backend::obvhs::ObvhsBackend;
use crate::backend::{RayBackend, RayScene, TriangleSet};
use crate::clock::Stopwatch;
use crate::error::{Error, Result};
use crate::lighting::Lights;
use crate::progress::Progress;
use crate::radiosity::{self, RadiosityParams, RadiosityScene, Solution};
use crate::render::{self, FarField, Nearness, RenderParams, Rendering, Round, Session, Watcher, World};
use crate::scene::{Camera, Scene};
use crate::shading::Lobes;
use crate::simplify::{self, Simplified, SimplifiedGeometry, SimplifyParams, TriangleSource};

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
    /// Settings with every automatic choice filled in.
    pub settings: Settings,
}

/// The far field's parts; see [`FarField`].
pub struct Far {
    /// How the simplification came about; `None` where the geometry is complete (PMM).
    pub simplified: Option<Simplified>,
    /// The triangles that radiosity was solved on.
    pub geometry: SimplifiedGeometry,
    /// The same, for rays.
    pub rays: Box<dyn RayScene>,
    /// Radiosities.
    pub solution: Solution,
    /// See [`FarField::plain`].
    pub plain: Vec<bool>,
    /// Where near parts of gather rays need the detailed scene.
    pub nearness: Option<Nearness>,
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
        let far = match settings.method {
            Method::Mcpt => None,
            // Gather rays change to the far field at half of r_thresh or later: here none is as long.
            Method::Gsii if 0.5 * settings.r_thresh() > scene.mesh.bounds.size().length() => None,
            _ => Some(Far::new(&scene, &lights, backend.as_ref(), &settings, progress, stats)?),
        };
        stats.parameters = settings.parameters();
        Ok(Prepared { scene, lights, detailed, far, settings })
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
            },
            cache: None,
            max_depth: self.settings.max_depth,
        }
    }
}

impl Prepared {
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

impl Far {
    fn new(
        scene: &Arc<Scene>,
        lights: &Lights,
        backend: &dyn RayBackend,
        settings: &Settings,
        progress: &Progress,
        stats: &mut Stats,
    ) -> Result<Far> {
        let start = Stopwatch::start();
        let simplified = simplify::simplify(scene, backend, &settings.simplify_params(), progress)?;
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
        let solution = radiosity::solve(&input, &settings.radiosity_params(), progress)?;
        stats.record_time(start, |s| &mut s.radiosity);
        stats.record_solution(&solution);
        let plain = geometry.sources.iter().map(|source| is_plain(scene, source)).collect();
        Ok(Far { simplified: (!complete).then_some(simplified), geometry, rays, solution, plain, nearness })
    }
}

/// Whether all that leaves a triangle of the far field's geometry is in the radiosity solution.
fn is_plain(scene: &Scene, source: &TriangleSource) -> bool {
    match *source {
        TriangleSource::BoxFace { .. } => true,
        TriangleSource::Scene { triangle } => {
            let material = scene.material(triangle);
            !material.is_emitter() && !material.may_be_sharp()
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
        settings = automatic(scene, camera, settings)?;
    }
    let simplified = simplify::simplify(scene, backend.as_ref(), &settings.simplify_params(), progress)?;
    stats.record_simplified(&simplified);
    Ok((simplified, settings))
}

/// Settings with every automatic choice filled in; nothing else is done.
///
/// # Errors
/// Usage errors in the settings, backend failures.
pub fn automatic(scene: &Arc<Scene>, camera: &Camera, mut settings: Settings) -> Result<Settings> {
    settings.check()?;
    let backend = settings.backend.create(settings.threads)?;
    let detailed = build_detailed(scene, backend.as_ref())?;
    auto::fill_in(&mut settings, scene, detailed.as_ref(), std::slice::from_ref(camera));
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

/// The camera that a name or a number means.
///
/// # Errors
/// When the scene has no such camera; the message lists those it has.
pub fn choose_camera<'a>(scene: &'a Scene, wanted: Option<&str>) -> Result<&'a Camera> {
    let Some(wanted) = wanted else {
        return scene.cameras.first().ok_or_else(|| Error::Usage(format!("{} has no camera", scene.name)));
    };
    let by_name = scene.cameras.iter().find(|c| c.name == wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| scene.cameras.get(i));
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<String> = scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} ({})", c.name)).collect();
        Error::Usage(format!("{} has no camera '{wanted}'; it has {}", scene.name, names.join(", ")))
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

    /// Parameters for [`radiosity::solve`].
    pub fn radiosity_params(&self) -> RadiosityParams {
        RadiosityParams {
            patch_size: self.patch_size.unwrap_or(f32::MAX),
            max_rays: self.radiosity_rays,
            focus: self.focus,
            unshot: self.unshot,
            direct: self.direct,
            error: self.radiosity_error,
            seed: self.seed,
            ambient: true,
            leave_out_covered: true,
            max_patches: 400_000,
        }
    }
}
