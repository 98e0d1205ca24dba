//! How well the simplified scene stands for the detailed one beyond `r_thresh`, all else equal.
//!
//! At points that the camera and gather rays see, the irradiance that arrives from beyond `r_thresh` is gathered from radiosities
//! on normal + simple surfaces, and along the same rays from radiosities on normal + complex surfaces. Printed are the mean
//! over points of the absolute difference, and the difference of the means, over the mean; for boxes fitted both ways and for
//! clusters that are just dropped.
//!
//! `cargo run --release --example far_field -- [--r-thresh X] [--patch-size X] [--longest X] [--points N] [--rays N] SCENE...`

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
use gsii::simplify::{BoxFit, Cluster, SimplifiedGeometry, TriangleSource, simplify};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let (mut settings, mut scenes) = (Settings { radiosity_error: 0.02, ..Settings::default() }, Vec::new());
    let (mut points, mut rays) = (10_000, 64);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--r-thresh" => settings.r_thresh = Some(value()?.parse()?),
            "--patch-size" => settings.patch_size = Some(value()?.parse()?),
            "--longest" => settings.longest_cluster = value()?.parse()?,
            "--points" => points = value()?.parse()?,
            "--rays" => rays = value()?.parse()?,
            _ => scenes.push(arg),
        }
    }
    println!(
        "{:<18} {:>7} {:>6} {:>8}  {:<9} {:>10} {:>10}",
        "scene", "r_thresh", "boxes", "surfaces", "clusters", "mean |d|", "mean d"
    );
    for scene in scenes {
        if let Err(error) = measure(Path::new(&scene), settings.clone(), points, rays) {
            println!("{scene}: {error}");
        }
    }
    Ok(())
}

/// A geometry with its radiosities.
struct Lit {
    geometry: SimplifiedGeometry,
    rays: Box<dyn RayScene>,
    solution: Solution,
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
        let solution = solve(&input, &settings.radiosity_params(), &Progress::silent())?;
        Ok(Lit { geometry, rays, solution })
    }

    /// Mean radiosity that the rays of each point meet.
    fn gather(&self, rays: &[Ray], rays_a_point: usize) -> Vec<f64> {
        let mut hits = vec![Hit::MISS; rays.len()];
        self.rays.closest(rays, Visible::All, Coherence::Incoherent, &mut hits);
        let radiosity = |(ray, hit): (&Ray, &Hit)| {
            if !hit.is_hit() {
                return 0.0;
            }
            let [a, b, c] = self.geometry.triangles[hit.triangle as usize].map(|v| self.geometry.positions[v as usize]);
            let front = (b - a).cross(c - a).dot(ray.direction) < 0.0
                || matches!(self.geometry.sources[hit.triangle as usize], TriangleSource::BoxFace { .. });
            f64::from(self.solution.radiosity(hit.triangle, hit.u, hit.v, front).element_sum()) / 3.0
        };
        let all: Vec<f64> = rays.iter().zip(&hits).map(radiosity).collect();
        all.chunks(rays_a_point).map(|of_point| of_point.iter().sum::<f64>() / rays_a_point as f64).collect()
    }
}

fn measure(path: &Path, mut settings: Settings, points: u32, rays_a_point: u32) -> Outcome<()> {
    let scene = Arc::new(load(path, &LoadOptions::default())?);
    let backend = settings.backend.create(0)?;
    let lights = Lights::new(&scene);
    let camera = scene.cameras[0].clone();
    let everything = |surfaces: &[u32]| SimplifiedGeometry::complete(&scene, surfaces);
    let unclassified = everything(&vec![0; scene.mesh.triangles.len()]);
    let detailed = unclassified.build(&scene, backend.as_ref())?;
    auto::fill_in(&mut settings, &scene, detailed.as_ref(), std::slice::from_ref(&camera));

    let far = far_rays(&scene, detailed.as_ref(), &camera, settings.r_thresh(), points, rays_a_point);
    let mut reference = None;
    for (name, box_fit) in [("flux", BoxFit::Flux), ("paper1993", BoxFit::Paper1993), ("none", BoxFit::Flux)] {
        settings.box_fit = box_fit;
        let s = simplify(&scene, backend.as_ref(), &settings.simplify_params(), &Progress::silent())?;
        let lit =
            |geometry, clusters: &[Cluster]| Lit::new(&scene, &lights, backend.as_ref(), geometry, clusters, &settings);
        if reference.is_none() {
            reference = Some(lit(everything(&s.surface_of_triangle), &[])?.gather(&far, rays_a_point as usize));
        }
        let simple = if name == "none" {
            lit(SimplifiedGeometry::normal(&scene, &s.surfaces, &s.surface_of_triangle), &[])?
        } else {
            lit(s.geometry.clone(), &s.clusters)?
        };
        let expected = reference.as_deref().unwrap_or_default();
        let found = simple.gather(&far, rays_a_point as usize);
        let sum: f64 = expected.iter().sum();
        let difference: f64 = found.iter().zip(expected).map(|(a, b)| a - b).sum();
        let absolute: f64 = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).sum();
        println!(
            "{:<18} {:>7.3} {:>6} {:>8}  {name:<9} {:>9.2}% {:>+9.2}%",
            path.file_stem().unwrap_or_default().to_string_lossy(),
            settings.r_thresh(),
            s.clusters.len(),
            simple.geometry.surfaces,
            100.0 * absolute / sum,
            100.0 * difference / sum
        );
    }
    Ok(())
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
        let stream = hash_all(&[STREAM, p]);
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
