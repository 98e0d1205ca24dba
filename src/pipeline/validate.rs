//! Embree against obvhs on the rays that rendering a scene would trace.

use std::ops::Range;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::{BackendKind, Method, Settings, auto};
use crate::backend::compare::{Comparison, compare};
use crate::backend::{Coherence, Hit, Ray, RayBackend, RayScene, TriangleSet, Visible};
use crate::error::{Error, Result};
use crate::lighting::{Lights, Lit};
use crate::progress::Progress;
use crate::sampling::{basis, cosine_hemisphere, hash_all, sobol};
use crate::scene::alpha::AlphaFilter;
use crate::scene::{Camera, Scene};
use crate::shading::SurfacePoint;
use crate::simplify::{self, SimplifiedGeometry};

/// Rays made and compared at a time.
const CHUNK: u32 = 1 << 16;

/// Camera rays in a row of the grid they are spread over: packets of neighbours, as in rendering.
const ROW: u32 = 256;

/// Attempts per wanted ray, where camera rays miss the scene or points see no light.
const ATTEMPTS: u32 = 8;

/// Shadow rays end this far before the light, relative, as in rendering.
const SHADOW_MARGIN: f32 = 1.0 / 8192.0;

/// What a ray is traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera, in the detailed scene.
    Camera,
    /// Near part of a gather ray: cosine-distributed from what the camera sees, up to `r_thresh`, in the detailed scene.
    GatherNear,
    /// Far part of a gather ray, from `r_thresh` on, in the simplified scene.
    GatherFar,
    /// From what the camera sees to a light source, in the detailed scene without panes.
    Shadow,
    /// Cosine-distributed from uniform points of the simplified scene, in the simplified scene.
    Radiosity,
}

impl RayKind {
    /// Every kind, in the order of the report.
    pub const ALL: [RayKind; 5] =
        [RayKind::Camera, RayKind::GatherNear, RayKind::GatherFar, RayKind::Shadow, RayKind::Radiosity];

    /// For a table.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Camera => "camera",
            RayKind::GatherNear => "gather, near",
            RayKind::GatherFar => "gather, far",
            RayKind::Shadow => "shadow",
            RayKind::Radiosity => "radiosity",
        }
    }
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Report {
    /// Names and versions of both libraries.
    pub backends: [String; 2],
    /// Triangles of the detailed and of the simplified scene.
    pub triangles: [usize; 2],
    /// `r_thresh` that near and far parts meet at, on average.
    pub r_thresh: f32,
    /// One comparison for each kind of ray.
    pub kinds: Vec<(RayKind, Comparison)>,
}

impl Report {
    /// All kinds together.
    pub fn total(&self) -> Comparison {
        self.kinds.iter().fold(Comparison::default(), |sum, (_, comparison)| sum.merge(comparison.clone()))
    }
}

/// Traces `rays` rays of each kind through both libraries and explains every difference.
///
/// Kinds that the scene has no rays for (shadow rays without lights) get fewer.
///
/// # Errors
/// Usage errors in the settings; backends that fail.
pub fn validate(
    scene: &Arc<Scene>,
    camera: &Camera,
    mut settings: Settings,
    rays: u32,
    progress: &Progress,
) -> Result<Report> {
    settings.check()?;
    if settings.r_thresh.is_some_and(|r| r == 0.0 || r.is_infinite()) {
        return Err(Error::Usage("--r-thresh must be above 0 and finite: gather rays are cut there".to_owned()));
    }
    settings.method = Method::Gsii;
    let backends = [BackendKind::Embree, BackendKind::Obvhs].map(|kind| kind.create(settings.threads));
    let [embree, obvhs] = backends;
    let backends = [embree?, obvhs?];

    let filter: Arc<dyn crate::backend::HitFilter> = Arc::new(AlphaFilter::new(Arc::clone(scene)));
    let parts = scene.mesh.parts();
    let mesh = &scene.mesh;
    let detailed = Pair::build(
        TriangleSet {
            positions: &mesh.positions,
            triangles: &mesh.triangles,
            parts: &parts,
            filter: Some(Arc::clone(&filter)),
        },
        &backends,
    )?;
    auto::fill_in(&mut settings, scene, detailed.scenes[0].as_ref(), std::slice::from_ref(camera));
    let geometry = simplify::simplify(scene, backends[0].as_ref(), &settings.simplify_params(), progress)?.geometry;
    let simplified =
        Pair::build(TriangleSet { filter: Some(geometry.filter(filter)), ..geometry.triangle_set() }, &backends)?;

    let source = Source {
        scene,
        camera,
        lights: Lights::new(scene),
        detailed: detailed.scenes[0].as_ref(),
        by_area: AreaTable::new(&geometry),
        r_thresh: settings.r_thresh(),
        seed: settings.seed,
    };
    let bar = progress.stage("comparing", u64::from(rays) * RayKind::ALL.len() as u64);
    let kinds = RayKind::ALL.map(|kind| {
        let pair = match kind {
            RayKind::Camera | RayKind::GatherNear | RayKind::Shadow => &detailed,
            RayKind::GatherFar | RayKind::Radiosity => &simplified,
        };
        let mut sum = Comparison::default();
        for first in (0..rays.saturating_mul(ATTEMPTS)).step_by(CHUNK as usize) {
            let missing = u64::from(rays) - sum.rays;
            let mut batch = source.rays(kind, first..first.saturating_add(CHUNK));
            batch.truncate(missing as usize);
            sum = sum.merge(pair.compare(kind, &batch));
            bar.inc(batch.len() as u64);
            if sum.rays == u64::from(rays) {
                break;
            }
        }
        (kind, sum)
    });
    bar.finish_and_clear();
    Ok(Report {
        backends: backends.each_ref().map(|b| b.name()),
        triangles: [mesh.triangles.len(), geometry.triangles.len()],
        r_thresh: settings.r_thresh(),
        kinds: kinds.into(),
    })
}

/// The same triangles in both libraries.
struct Pair<'a> {
    set: TriangleSet<'a>,
    scenes: [Box<dyn RayScene>; 2],
}

impl<'a> Pair<'a> {
    fn build(set: TriangleSet<'a>, [a, b]: &[Box<dyn RayBackend>; 2]) -> Result<Self> {
        let scenes = [a.build(&set)?, b.build(&set)?];
        Ok(Pair { set, scenes })
    }

    fn compare(&self, kind: RayKind, rays: &[Ray]) -> Comparison {
        let visible = if kind == RayKind::Shadow { Visible::WithoutPanes } else { Visible::All };
        let coherent = matches!(kind, RayKind::Camera | RayKind::Shadow);
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        let [a, b] = &self.scenes;
        compare(rays, visible, coherence, a.as_ref(), b.as_ref(), &self.set)
    }
}

/// Makes rays.
struct Source<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    lights: Lights,
    detailed: &'a dyn RayScene,
    by_area: AreaTable<'a>,
    r_thresh: f32,
    seed: u32,
}

impl Source<'_> {
    /// The rays with these numbers that exist.
    fn rays(&self, kind: RayKind, numbers: Range<u32>) -> Vec<Ray> {
        let stream = hash_all(&[self.seed, kind as u32]);
        if kind == RayKind::Radiosity {
            return numbers.map(|i| self.by_area.ray(i, stream)).collect();
        }
        let views: Vec<Ray> = numbers.clone().map(|i| self.view(i, stream)).collect();
        if kind == RayKind::Camera {
            return views;
        }
        let mut hits = vec![Hit::MISS; views.len()];
        self.detailed.closest(&views, Visible::All, Coherence::Coherent, &mut hits);
        let seen = numbers.zip(views.iter().zip(&hits)).filter(|(_, (_, hit))| hit.is_hit());
        seen.filter_map(|(i, (view, hit))| self.leaving(kind, view, hit, sobol(i, 1, stream))).collect()
    }

    /// Neighbours in number are neighbours in the image; every [`ROW`] squared of them fill it anew.
    fn view(&self, number: u32, stream: u32) -> Ray {
        let u = sobol(number, 0, stream);
        let cell = number % (ROW * ROW);
        let film = (Vec2::new((cell % ROW) as f32, (cell / ROW) as f32) + Vec2::new(u[0], u[1])) / ROW as f32;
        self.camera.ray(film, self.camera.aspect.unwrap_or(1.5))
    }

    fn leaving(&self, kind: RayKind, view: &Ray, hit: &Hit, u: [f32; 4]) -> Option<Ray> {
        let point = SurfacePoint::new(self.scene, hit);
        let normal = point.geometric_normal;
        let normal = if normal.dot(view.direction) < 0.0 { normal } else { -normal };
        if kind == RayKind::Shadow {
            let lit = Lit { position: point.position, normal, u: [u[0], u[1], u[2]] };
            let light = self.lights.sample(self.scene, &lit)?;
            let ray = Ray::new(point.ray_origin(light.direction), light.direction);
            return Some(Ray { t_far: light.distance * (1.0 - SHADOW_MARGIN), ..ray });
        }
        let direction = basis(normal) * cosine_hemisphere(Vec2::new(u[0], u[1]));
        let ray = Ray::new(point.ray_origin(direction), direction);
        let near = self.r_thresh * (0.5 + u[2]);
        Some(if kind == RayKind::GatherNear { Ray { t_far: near, ..ray } } else { Ray { t_near: near, ..ray } })
    }
}

/// Chooses points uniform by area.
struct AreaTable<'a> {
    geometry: &'a SimplifiedGeometry,
    /// Areas of the triangles up to and with each, summed.
    sums: Vec<f64>,
}

impl<'a> AreaTable<'a> {
    fn new(geometry: &'a SimplifiedGeometry) -> Self {
        let mut sum = 0.0;
        let sums = geometry.triangles.iter().map(|t| {
            let [a, b, c] = corners(geometry, t).map(|p| p.as_dvec3());
            sum += 0.5 * (b - a).cross(c - a).length();
            sum
        });
        let sums = sums.collect();
        AreaTable { geometry, sums }
    }

    fn ray(&self, number: u32, stream: u32) -> Ray {
        let (u, v) = (sobol(number, 0, stream), sobol(number, 1, stream));
        let wanted = f64::from(u[0]) * self.sums.last().copied().unwrap_or(0.0);
        let triangle = self.sums.partition_point(|&sum| sum <= wanted);
        let Some(t) = self.geometry.triangles.get(triangle) else {
            // No geometry: a ray that hits nothing.
            return Ray::new(Vec3::ZERO, Vec3::X);
        };
        // Uniform barycentrics by folding the square.
        let (b1, b2) = if u[1] + u[2] > 1.0 { (1.0 - u[1], 1.0 - u[2]) } else { (u[1], u[2]) };
        let point = SurfacePoint::flat(corners(self.geometry, t), triangle as u32, b1, b2);
        let normal = if u[3] < 0.5 { point.geometric_normal } else { -point.geometric_normal };
        let direction = basis(normal) * cosine_hemisphere(Vec2::new(v[0], v[1]));
        Ray::new(point.ray_origin(direction), direction)
    }
}

fn corners(geometry: &SimplifiedGeometry, triangle: &[u32; 3]) -> [Vec3; 3] {
    triangle.map(|i| geometry.positions[i as usize])
}
