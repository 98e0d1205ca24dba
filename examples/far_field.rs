//! How well the simplified scene stands for the detailed one beyond `r_thresh`, all else equal.
//!
//! At points that the camera and gather rays see, the irradiance that arrives from beyond `r_thresh` is gathered from radiosities
//! on normal + simple surfaces, and along the same rays from radiosities on normal + complex surfaces. Everything is done
//! twice with independent random numbers, rays and radiosities alike. Printed are, in per cent of the mean irradiance,
//!
//! * `mean |d|`: the mean over points of the absolute difference, noise included;
//! * `noise`: the part of it that repetition changes, half the mean absolute difference between both repetitions;
//! * `rms d`: the root of the mean over points of the product of both repetitions' differences, which is free of noise and an upper
//!   bound of the mean absolute difference;
//! * `mean d`: the difference of the means;
//!
//! for boxes fitted both ways and for clusters that are just dropped. `--by-surface` says where the flux boxes' difference
//! comes from: by what a ray meets in N+C and what it meets in N+S, and by cluster those that have most part in `rms d`.
//!
//! `cargo run --release --example far_field -- [--r-thresh X] [--beta X] [--patch-size X] [--longest X] [--face-resolution N]
//! [--points N] [--rays N] [--error X] [--by-surface] [--only flux] SCENE...`

use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use gsii::backend::{Coherence, Hit, Ray, RayBackend, RayScene, Visible};
use gsii::lighting::Lights;
use gsii::pipeline::{Settings, auto};
use gsii::progress::Progress;
use gsii::radiosity::{RadiosityScene, Solution, solve};
use gsii::sampling::{basis, cosine_hemisphere, hash_all, sobol, unit};
use gsii::scene::{Camera, LoadOptions, Scene, load};
use gsii::shading::SurfacePoint;
use gsii::simplify::{BoxFit, Class, Cluster, Simplified, SimplifiedGeometry, TriangleSource, simplify};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Repetitions with independent random numbers.
const HALVES: usize = 2;

struct Options {
    settings: Settings,
    points: u32,
    rays: u32,
    by_surface: bool,
    only: Option<String>,
}

fn main() -> Outcome<()> {
    let settings = Settings { radiosity_error: 0.02, ..Settings::default() };
    let mut options = Options { settings, points: 10_000, rays: 64, by_surface: false, only: None };
    let mut scenes = Vec::new();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--r-thresh" => options.settings.r_thresh = Some(value()?.parse()?),
            "--beta" => options.settings.beta = value()?.parse()?,
            "--patch-size" => options.settings.patch_size = Some(value()?.parse()?),
            "--longest" => options.settings.longest_cluster = value()?.parse()?,
            "--face-resolution" => options.settings.face_resolution = value()?.parse()?,
            "--error" => options.settings.radiosity_error = value()?.parse()?,
            "--points" => options.points = value()?.parse()?,
            "--rays" => options.rays = value()?.parse()?,
            "--by-surface" => options.by_surface = true,
            "--only" => options.only = Some(value()?),
            _ => scenes.push(arg),
        }
    }
    println!(
        "{:<18} {:>8} {:>7} {:>6} {:>8} {:>8}  {:<9} {:>8} {:>7} {:>7} {:>8}",
        "scene", "r_thresh", "beta", "boxes", "surfaces", "patches", "clusters", "mean |d|", "noise", "rms d", "mean d"
    );
    for scene in scenes {
        if let Err(error) = measure(Path::new(&scene), &options) {
            println!("{scene}: {error}");
        }
    }
    Ok(())
}

/// A geometry with its radiosities.
struct Lit {
    geometry: SimplifiedGeometry,
    rays: Box<dyn RayScene>,
    solutions: [Solution; HALVES],
}

/// What a ray meets.
#[derive(Clone, Copy)]
struct Met {
    source: Option<TriangleSource>,
    radiosity: f64,
}

impl Lit {
    fn new(
        scene: &Arc<Scene>,
        lights: &Lights,
        backend: &dyn RayBackend,
        geometry: SimplifiedGeometry,
        clusters: &[Cluster],
        settings: &Settings,
    ) -> Outcome<Self> {
        let rays = geometry.build(scene, backend)?;
        let input = RadiosityScene { scene, lights, geometry: &geometry, clusters, rays: rays.as_ref() };
        let solve =
            |seed| solve(&input, &Settings { seed, ..settings.clone() }.radiosity_params(), &Progress::silent());
        let solutions = [solve(1)?, solve(2)?];
        Ok(Lit { geometry, rays, solutions })
    }

    fn meet(&self, rays: &[Ray], half: usize) -> Vec<Met> {
        let mut hits = vec![Hit::MISS; rays.len()];
        self.rays.closest(rays, Visible::All, Coherence::Incoherent, &mut hits);
        let met = |(ray, hit): (&Ray, &Hit)| {
            if !hit.is_hit() {
                return Met { source: None, radiosity: 0.0 };
            }
            let source = self.geometry.sources[hit.triangle as usize];
            let solution = &self.solutions[half];
            let front =
                solution.is_front(hit.triangle, ray.direction) || matches!(source, TriangleSource::BoxFace { .. });
            let radiosity = solution.radiosity(hit.triangle, hit.u, hit.v, front);
            Met { source: Some(source), radiosity: f64::from(radiosity.element_sum()) / 3.0 }
        };
        rays.iter().zip(&hits).map(met).collect()
    }
}

fn measure(path: &Path, options: &Options) -> Outcome<()> {
    let mut settings = options.settings.clone();
    let scene = Arc::new(load(path, &LoadOptions::default())?);
    let backend = settings.backend.create(0)?;
    let lights = Lights::new(&scene);
    let camera = scene.cameras[0].clone();
    let everything = |surfaces: &[u32]| SimplifiedGeometry::complete(&scene, surfaces);
    let unclassified = everything(&vec![0; scene.mesh.triangles.len()]);
    let detailed = unclassified.build(&scene, backend.as_ref())?;
    auto::fill_in(&mut settings, &scene, detailed.as_ref(), std::slice::from_ref(&camera));

    let far: [Vec<Ray>; HALVES] = std::array::from_fn(|half| {
        far_rays(&scene, detailed.as_ref(), &camera, settings.r_thresh(), options.points, options.rays, half as u32)
    });
    let mut reference: Option<[Vec<Met>; HALVES]> = None;
    for (name, box_fit) in [("flux", BoxFit::Flux), ("paper1993", BoxFit::Paper1993), ("none", BoxFit::Flux)] {
        if options.only.as_ref().is_some_and(|only| only != name) {
            continue;
        }
        settings.box_fit = box_fit;
        let s = simplify(&scene, backend.as_ref(), &settings.simplify_params(), &Progress::silent())?;
        let lit =
            |geometry, clusters: &[Cluster]| Lit::new(&scene, &lights, backend.as_ref(), geometry, clusters, &settings);
        if reference.is_none() {
            let complete = lit(everything(&s.surface_of_triangle), &[])?;
            reference = Some(std::array::from_fn(|half| complete.meet(&far[half], half)));
        }
        let simple = if name == "none" {
            lit(SimplifiedGeometry::normal(&scene, &s.surfaces, &s.surface_of_triangle), &[])?
        } else {
            lit(s.geometry.clone(), &s.clusters)?
        };
        let found: [Vec<Met>; HALVES] = std::array::from_fn(|half| simple.meet(&far[half], half));
        let Some(expected) = &reference else { continue };
        let e = Errors::new(expected, &found, options.rays as usize);
        println!(
            "{:<18} {:>8.4} {:>7.4} {:>6} {:>8} {:>8}  {name:<9} {:>7.2}% {:>6.2}% {:>6.2}% {:>+7.2}%",
            path.file_stem().unwrap_or_default().to_string_lossy(),
            settings.r_thresh(),
            settings.beta,
            s.clusters.len(),
            simple.geometry.surfaces,
            simple.solutions[0].patches,
            100.0 * e.absolute,
            100.0 * e.noise,
            100.0 * e.rms,
            100.0 * e.mean
        );
        if options.by_surface && name == "flux" {
            let parts = Parts::new(&s, expected, &found, options.rays as usize);
            parts.by_surface();
            parts.by_cluster(&s);
        }
    }
    Ok(())
}

/// Differences of irradiance, over its mean.
struct Errors {
    absolute: f64,
    noise: f64,
    rms: f64,
    mean: f64,
}

impl Errors {
    fn new(expected: &[Vec<Met>; HALVES], found: &[Vec<Met>; HALVES], rays_a_point: usize) -> Self {
        let of_points = |met: &[Met]| -> Vec<f64> {
            met.chunks(rays_a_point).map(|m| m.iter().map(|m| m.radiosity).sum::<f64>() / rays_a_point as f64).collect()
        };
        let (expected, found) = (expected.each_ref().map(|m| of_points(m)), found.each_ref().map(|m| of_points(m)));
        let n = expected[0].len() as f64;
        let mean_irradiance = expected.iter().flatten().sum::<f64>() / (2.0 * n);
        let d = |half: usize, point: usize| (found[half][point] - expected[half][point]) / mean_irradiance;
        let mean = |f: &dyn Fn(f64, f64) -> f64| (0..expected[0].len()).map(|p| f(d(0, p), d(1, p))).sum::<f64>() / n;
        Errors {
            absolute: mean(&|a, b| 0.5 * (a + b).abs()),
            noise: mean(&|a, b| 0.5 * (a - b).abs()),
            rms: mean(&|a, b| a * b).max(0.0).sqrt(),
            mean: mean(&|a, b| 0.5 * (a + b)),
        }
    }
}

/// What a ray meets, and the cluster that it is part of.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Normal,
    Clustered(u32),
    Dropped,
    Box(u32),
    Nothing,
}

impl Kind {
    const NAMES: [&str; 5] = ["normal", "clustered", "dropped", "box", "nothing"];

    fn of(met: &Met, s: &Simplified) -> Self {
        match met.source {
            None => Kind::Nothing,
            Some(TriangleSource::BoxFace { cluster, .. }) => Kind::Box(cluster),
            Some(TriangleSource::Scene { triangle }) => {
                match s.surfaces[s.surface_of_triangle[triangle as usize] as usize].class {
                    Class::Normal => Kind::Normal,
                    Class::Complex { cluster: Some(cluster) } => Kind::Clustered(cluster),
                    Class::Complex { cluster: None } => Kind::Dropped,
                }
            }
        }
    }

    fn index(self) -> usize {
        match self {
            Kind::Normal => 0,
            Kind::Clustered(_) => 1,
            Kind::Dropped => 2,
            Kind::Box(_) => 3,
            Kind::Nothing => 4,
        }
    }

    fn cluster(self) -> Option<u32> {
        match self {
            Kind::Clustered(cluster) | Kind::Box(cluster) => Some(cluster),
            _ => None,
        }
    }
}

/// A part of the difference, over the mean irradiance.
#[derive(Clone, Copy, Default)]
struct Part {
    rays: u64,
    light: f64,
    mean: f64,
    /// Part in the square of `rms d`: mean over points of the products of this part with the other repetition's whole.
    square: f64,
}

impl Part {
    fn add(&mut self, other: Part) {
        self.rays += other.rays;
        self.light += other.light;
        self.mean += other.mean;
        self.square += other.square;
    }

    fn print(&self, what: &str, rays: u64) {
        println!(
            "  {what:<21} {:>6.2}%   {:>7.2}%   {:>+7.2}%   {:>+9.6}",
            100.0 * self.rays as f64 / rays as f64,
            100.0 * self.light,
            100.0 * self.mean,
            self.square
        );
    }
}

/// Where the difference comes from.
struct Parts {
    of_kinds: [[Part; 5]; 5],
    /// With what the clusters' boxes hide and what shows where the clusters stood.
    of_clusters: Vec<Part>,
    rays: u64,
}

impl Parts {
    fn new(s: &Simplified, expected: &[Vec<Met>; HALVES], found: &[Vec<Met>; HALVES], rays_a_point: usize) -> Self {
        let rays = expected.iter().map(Vec::len).sum::<usize>();
        let sum: f64 = expected.iter().flatten().map(|met| met.radiosity).sum();
        // One ray's part in the mean over all rays of both repetitions.
        let d = |half: usize, ray: usize| (found[half][ray].radiosity - expected[half][ray].radiosity) / sum;
        let points = expected[0].len() / rays_a_point;
        let of_point = |half: usize, point: usize| -> f64 {
            (point * rays_a_point..(point + 1) * rays_a_point).map(|ray| d(half, ray)).sum::<f64>()
                * (HALVES * points) as f64
        };
        let mut parts = Parts {
            of_kinds: [[Part::default(); 5]; 5],
            of_clusters: vec![Part::default(); s.clusters.len()],
            rays: rays as u64,
        };
        for half in 0..HALVES {
            for point in 0..points {
                let others = of_point(1 - half, point);
                for ray in point * rays_a_point..(point + 1) * rays_a_point {
                    let (e, f) = (&expected[half][ray], &found[half][ray]);
                    let (was, is) = (Kind::of(e, s), Kind::of(f, s));
                    let d = d(half, ray);
                    let part = Part { rays: 1, light: e.radiosity / sum, mean: d, square: d * others };
                    parts.of_kinds[was.index()][is.index()].add(part);
                    if let Some(cluster) = was.cluster().or(is.cluster()) {
                        parts.of_clusters[cluster as usize].add(part);
                    }
                }
            }
        }
        parts
    }

    fn by_surface(&self) {
        println!("  N+C meets  N+S meets     rays   of light     mean d   of rms d^2");
        for (row, of) in self.of_kinds.iter().zip(Kind::NAMES) {
            for (part, becomes) in row.iter().zip(Kind::NAMES).filter(|(part, _)| part.rays > 0) {
                part.print(&format!("{of:<10} {becomes:<10}"), self.rays);
            }
        }
    }

    fn by_cluster(&self, s: &Simplified) {
        const SHOWN: usize = 12;
        let mut order: Vec<usize> = (0..self.of_clusters.len()).collect();
        order.sort_by(|&a, &b| self.of_clusters[b].square.total_cmp(&self.of_clusters[a].square));
        for &i in order.iter().take(SHOWN) {
            let (c, b) = (&s.clusters[i], &s.clusters[i].equivalent_box);
            let what = format!(
                "cluster {i}: {} surfaces, p {:.2}, directional {:.2}, {:.2} -> {:.2} at {:.2}",
                c.surfaces.len(),
                c.residual.hit_share,
                c.residual.directional,
                c.bounds.size(),
                2.0 * b.half,
                b.centre
            );
            self.of_clusters[i].print(&what, self.rays);
        }
    }
}

/// The far parts of gather rays from `points` points, half of them seen by the camera and half by gather rays from there.
/// Rays that end in the near part are left as rays that hit nothing.
fn far_rays(
    scene: &Scene,
    detailed: &dyn RayScene,
    camera: &Camera,
    r_thresh: f32,
    points: u32,
    rays_a_point: u32,
    half: u32,
) -> Vec<Ray> {
    const STREAM: u32 = 0x6661_7266;
    let trace = |rays: &[Ray]| {
        let mut hits = vec![Hit::MISS; rays.len()];
        detailed.closest(rays, Visible::All, Coherence::Incoherent, &mut hits);
        hits
    };
    // A cosine-distributed ray from where a ray ended, on the side that it came from.
    let gather = |ray: &Ray, hit: &Hit, u: Vec2| {
        let point = SurfacePoint::new(scene, hit);
        let n = point.geometric_normal;
        let normal = if n.dot(ray.direction) < 0.0 { n } else { -n };
        let direction: Vec3 = basis(normal) * cosine_hemisphere(u);
        Ray::new(point.ray_origin(direction), direction)
    };
    let mut ends: Vec<(Ray, Hit)> = Vec::new();
    let mut first = 0;
    // Views of the sky give no point; a few rounds find enough wherever the camera sees anything.
    while (ends.len() as u32) < points && first < 20 * points {
        let views: Vec<Ray> = (first..first + points)
            .map(|i| {
                let u = sobol(i, 0, STREAM);
                camera.ray(Vec2::new(u[0], u[1]), camera.aspect.unwrap_or(1.5))
            })
            .collect();
        let hits = trace(&views);
        let seen: Vec<(Ray, Hit)> = views.into_iter().zip(hits).filter(|(_, h)| h.is_hit()).collect();
        let onward: Vec<Ray> = (first..)
            .zip(&seen)
            .map(|(i, (ray, hit))| {
                let u = sobol(i, 1, STREAM);
                gather(ray, hit, Vec2::new(u[0], u[1]))
            })
            .collect();
        let hits = trace(&onward);
        let met = onward.into_iter().zip(hits).filter(|(_, h)| h.is_hit());
        ends.extend(seen.iter().copied().step_by(2).chain(met.step_by(2)));
        first += points;
    }
    ends.truncate(points as usize);

    let mut rays: Vec<Ray> = Vec::with_capacity(ends.len() * rays_a_point as usize);
    for (p, (ray, hit)) in (0u32..).zip(&ends) {
        let stream = hash_all(&[STREAM, p, half]);
        for i in 0..rays_a_point {
            let u = sobol(i, 0, stream);
            let near = r_thresh * (0.5 + unit(hash_all(&[stream, i])));
            rays.push(Ray { t_far: near, ..gather(ray, hit, Vec2::new(u[0], u[1])) });
        }
    }
    let hits = trace(&rays);
    for (ray, hit) in rays.iter_mut().zip(&hits) {
        // Nothing lies between here and there.
        (ray.t_near, ray.t_far) = if hit.is_hit() { (0.0, 0.0) } else { (ray.t_far, f32::INFINITY) };
    }
    rays
}
