//! Shapes, scenes, radiosity solutions and point probes for the recipes.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Mat3, Vec3};
use gsii::backend::embree::EmbreeBackend;
use gsii::backend::{RayBackend, RayScene};
use gsii::lighting::Lights;
use gsii::pipeline::{Method, Prepared, Settings, Stats};
use gsii::progress::Progress;
use gsii::radiosity::{DirectLight, RadiosityParams, RadiosityScene, Solution, solve};
use gsii::render::film::{Film, Pixel};
use gsii::render::{RenderParams, render};
use gsii::sampling::{basis, hash_all};
use gsii::scene::{Camera, LightKind, Material, MeshData, Projection, PunctualLight, Scene, SceneBuilder};
use gsii::simplify::{BoxFit, SimplifiedGeometry, SimplifyParams, simplify};
use rayon::prelude::*;

use crate::report::Estimate;

/// Independent seeds of every measurement with noise.
pub const SEEDS: u32 = 16;

pub type Triangles = Vec<[DVec3; 3]>;
pub type Quad = [DVec3; 4];

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A convex polygon as a fan of triangles.
pub fn polygon(points: &[DVec3]) -> Triangles {
    (1..points.len() - 1).map(|i| [points[0], points[i], points[i + 1]]).collect()
}

/// The same, with the other side to the front.
pub fn flipped(triangles: Triangles) -> Triangles {
    triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

/// A polygon with its front towards `point`.
pub fn facing(points: &[DVec3], point: DVec3) -> Triangles {
    let triangles = polygon(points);
    let [a, b, c] = triangles[0];
    if (b - a).cross(c - a).dot(point - a) >= 0.0 { triangles } else { flipped(triangles) }
}

/// Rectangle in the plane at `z`, facing up or down.
pub fn level(x: [f64; 2], y: [f64; 2], z: f64, up: bool) -> Triangles {
    let q = [v(x[0], y[0], z), v(x[1], y[0], z), v(x[1], y[1], z), v(x[0], y[1], z)];
    if up { polygon(&q) } else { flipped(polygon(&q)) }
}

/// A regular polygon of `corners` corners with the area of the disc.
pub fn disc(centre: DVec3, normal: DVec3, radius: f64, corners: u32) -> Triangles {
    let step = 2.0 * PI / f64::from(corners);
    let reach = radius * (step / step.sin()).sqrt();
    let frame = basis(normal.as_vec3()).as_dmat3();
    let at = |i: u32| {
        let (sin, cos) = (step * f64::from(i)).sin_cos();
        centre + reach * (frame.x_axis * cos + frame.y_axis * sin)
    };
    (0..corners).map(|i| [centre, at(i), at((i + 1) % corners)]).collect()
}

/// An octahedron divided `levels` times, vertices on the sphere, front outward.
pub fn sphere(centre: DVec3, radius: f64, levels: u32) -> Triangles {
    let p = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
    let mut faces: Triangles =
        (0..4).flat_map(|i| [[p[i], p[(i + 1) % 4], DVec3::Z], [p[(i + 1) % 4], p[i], -DVec3::Z]]).collect();
    for _ in 0..levels {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [d, e, f] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    faces.into_iter().map(|t| t.map(|p| centre + radius * p)).collect()
}

/// A sphere with the surface of the ideal one: by Cauchy's theorem it also has its mean projected area.
pub fn ball(centre: DVec3, radius: f64, levels: u32) -> Triangles {
    let unit = sphere(DVec3::ZERO, 1.0, levels);
    let scale = radius * (4.0 * PI / area(&unit)).sqrt();
    unit.into_iter().map(|t| t.map(|p| centre + scale * p)).collect()
}

pub fn area(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
}

/// The faces x0, x1, y0, y1, z0, z1 of a box, normals inward, corners as the cases number them.
pub fn box_faces(lo: DVec3, hi: DVec3) -> [Quad; 6] {
    let p = |x: u8, y: u8, z: u8| {
        v([lo.x, hi.x][usize::from(x)], [lo.y, hi.y][usize::from(y)], [lo.z, hi.z][usize::from(z)])
    };
    [
        [p(0, 0, 0), p(0, 1, 0), p(0, 1, 1), p(0, 0, 1)],
        [p(1, 0, 0), p(1, 0, 1), p(1, 1, 1), p(1, 1, 0)],
        [p(0, 0, 0), p(0, 0, 1), p(1, 0, 1), p(1, 0, 0)],
        [p(0, 1, 0), p(1, 1, 0), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)],
        [p(0, 0, 1), p(0, 1, 1), p(1, 1, 1), p(1, 0, 1)],
    ]
}

/// A closed solid, front outward.
pub fn solid(lo: DVec3, hi: DVec3) -> Triangles {
    box_faces(lo, hi).iter().flat_map(|q| flipped(polygon(q))).collect()
}

/// A parallelogram as `n` times `n` quads whose vertices coincide exactly.
pub fn diced([a, b, c, d]: Quad, n: u32) -> Triangles {
    let at = |i: u32, j: u32| {
        let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
        a.lerp(b, s).lerp(d.lerp(c, s), t)
    };
    (0..n * n)
        .flat_map(|k| {
            let (i, j) = (k % n, k / n);
            polygon(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        })
        .collect()
}

pub fn grey(rho: f64) -> Material {
    Material::lambertian(Vec3::splat(rho as f32))
}

/// A Lambertian surface of exitance `e`, W/m^2.
pub fn glow(rho: f64, e: f64) -> Material {
    Material::emitter(Vec3::splat((e / PI) as f32), Vec3::splat(rho as f32))
}

/// A smooth metal.
pub fn mirror(reflectance: f64) -> Material {
    Material { base_color: Vec3::splat(reflectance as f32), metallic: 1.0, roughness: 0.0, ..Material::default() }
}

/// A scene in the making.
#[derive(Clone)]
pub struct Model(pub SceneBuilder);

impl Model {
    pub fn new() -> Model {
        Model(SceneBuilder::new("case"))
    }

    /// Adds triangles as one object.
    pub fn add(&mut self, name: &str, triangles: Triangles, material: Material) -> &mut Self {
        self.place(name, triangles, material, DVec3::ZERO)
    }

    /// The same, moved by the object's transform.
    pub fn place(&mut self, name: &str, triangles: Triangles, material: Material, to: DVec3) -> &mut Self {
        let material = self.0.add_material(Material { name: name.to_owned(), ..material });
        self.0.add_mesh(name, mesh_data(triangles), material, DAffine3::from_translation(to)).unwrap();
        self
    }

    pub fn light(&mut self, intensity: Vec3, kind: LightKind) -> &mut Self {
        let light = PunctualLight { name: "light".to_owned(), intensity, kind };
        self.0.add_light(light, DAffine3::IDENTITY);
        self
    }

    /// An isotropic light of intensity `i`, W/sr.
    pub fn point_light(&mut self, i: f64, at: DVec3) -> &mut Self {
        self.light(Vec3::splat(i as f32), LightKind::Point { position: at.as_vec3() })
    }

    /// A directional light of irradiance `e`.
    pub fn sun(&mut self, e: f64, direction: DVec3) -> &mut Self {
        let direction = direction.normalize().as_vec3().normalize();
        self.light(Vec3::splat(e as f32), LightKind::Directional { direction })
    }

    pub fn finish(&self) -> Arc<Scene> {
        Arc::new(self.0.clone().finish().unwrap())
    }
}

fn mesh_data(triangles: Triangles) -> MeshData {
    MeshData {
        positions: triangles.iter().flatten().map(|p| p.as_vec3()).collect(),
        triangles: (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    }
}

/// Names of the faces of a box, in the cases' order.
pub const FACES: [&str; 6] = ["x0", "x1", "y0", "y1", "z0", "z1"];

/// A closed box from the origin to `size`, one object a face.
pub fn closed_box(size: DVec3, rho: [f64; 6], exitance: [f64; 6]) -> Model {
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, size).iter().enumerate() {
        model.add(FACES[i], polygon(face), glow(rho[i], exitance[i]));
    }
    model
}

pub fn embree() -> EmbreeBackend {
    EmbreeBackend::new(0).unwrap()
}

/// A complete scene with all that radiosity needs.
pub struct Room {
    pub scene: Arc<Scene>,
    pub lights: Lights,
    pub geometry: SimplifiedGeometry,
    pub rays: Box<dyn RayScene>,
}

impl Room {
    pub fn new(scene: Arc<Scene>) -> Room {
        let params = simplify_params(0.0, 0.0, BoxFit::Flux);
        let simplified = simplify(&scene, &embree(), &params, &Progress::silent()).unwrap();
        let geometry = SimplifiedGeometry::complete(&scene, &simplified.surface_of_triangle);
        let rays = embree().build(&geometry.triangle_set()).unwrap();
        Room { lights: Lights::new(&scene), scene, geometry, rays }
    }

    pub fn solve(&self, params: &RadiosityParams) -> gsii::Result<Solution> {
        let input = RadiosityScene {
            scene: &self.scene,
            lights: &self.lights,
            geometry: &self.geometry,
            clusters: &[],
            rays: &*self.rays,
        };
        solve(&input, params, &Progress::silent())
    }

    /// Triangles of all objects of that name.
    pub fn triangles(&self, name: &str) -> Vec<u32> {
        let objects = self.scene.mesh.objects.iter().filter(|o| o.name == name);
        let triangles: Vec<u32> = objects.flat_map(|o| o.triangles.clone()).collect();
        assert!(!triangles.is_empty(), "no object {name}");
        triangles
    }

    pub fn area(&self, triangles: &[u32]) -> f64 {
        triangles.iter().map(|&t| self.scene.mesh.area(t)).sum()
    }

    /// Area-weighted mean radiosity without emission of the fronts of triangles. Exact for triangles that lie in one patch;
    /// otherwise a midpoint rule over 4096 parts of each, fewer where there are thousands.
    pub fn mean_of(&self, solution: &Solution, triangles: &[u32]) -> DVec3 {
        let n = ((1e6 / triangles.len() as f64).sqrt() as u32).clamp(1, 64);
        let parts = f64::from(n * (n + 1) / 2) + f64::from(n * (n - 1) / 2);
        let mut sum = DVec3::ZERO;
        for &t in triangles {
            let share = self.scene.mesh.area(t) / parts;
            for i in 0..n {
                for j in 0..n - i {
                    let mut add = |third: f32| {
                        let (u, v) = ((i as f32 + third) / n as f32, (j as f32 + third) / n as f32);
                        sum += share * solution.radiosity(t, u, v, true).as_dvec3();
                    };
                    add(1.0 / 3.0);
                    if i + j + 1 < n {
                        add(2.0 / 3.0);
                    }
                }
            }
        }
        sum / self.area(triangles)
    }

    /// Mean radiosity without emission of the objects of a name, first band.
    pub fn mean(&self, solution: &Solution, name: &str) -> f64 {
        self.mean_of(solution, &self.triangles(name)).x
    }
}

pub fn simplify_params(r_thresh: f64, beta: f64, box_fit: BoxFit) -> SimplifyParams {
    SimplifyParams {
        r_thresh: r_thresh as f32,
        beta: beta as f32,
        box_fit,
        crease_angle: 30_f32.to_radians(),
        face_resolution: 2,
        longest: gsii::simplify::LONGEST_CLUSTER,
        seed: 1,
    }
}

/// One patch a surface, all of it, and light sources shoot: the paper's solver.
pub fn one_patch(error: f64, seed: u32) -> RadiosityParams {
    RadiosityParams {
        unshot: 1e-4,
        leave_out_covered: false,
        keep_places: false,
        direct: DirectLight::Shoot,
        error: error as f32,
        seed,
        ..RadiosityParams::new(1e18)
    }
}

/// Values for each of [`SEEDS`] seeds, and the estimate of each value.
pub fn over_seeds(values: impl Fn(u32) -> Vec<f64>) -> Vec<Estimate> {
    over_some_seeds(SEEDS, values)
}

/// The same for another number of seeds.
pub fn over_some_seeds(seeds: u32, values: impl Fn(u32) -> Vec<f64>) -> Vec<Estimate> {
    transposed(&(0..seeds).map(|s| values(hash_all(&[0x5eed, s]))).collect::<Vec<_>>())
}

fn transposed(by_seed: &[Vec<f64>]) -> Vec<Estimate> {
    (0..by_seed[0].len()).map(|i| Estimate::of(&by_seed.iter().map(|s| s[i]).collect::<Vec<_>>())).collect()
}

/// A parallel camera that looks straight at a point of a surface from `distance` before it and sees `2 size` of it.
pub fn look_at(scene: &Scene, point: DVec3, normal: DVec3, distance: f64, size: f64) -> Camera {
    let normal = normal.normalize();
    Camera {
        name: "probe".to_owned(),
        position: (point + normal * distance - scene.centre).as_vec3(),
        axes: upright(normal.as_vec3().normalize()),
        projection: Projection::Orthographic { x_mag: size as f32, y_mag: size as f32 },
        aspect: None,
    }
}

/// Camera axes that look against `back`; the first points along +x where that is possible.
pub fn upright(back: Vec3) -> Mat3 {
    let up = if back.z.abs() > 0.9 { Vec3::Y } else { Vec3::Z };
    let right = up.cross(back).normalize();
    Mat3::from_cols(right, back.cross(right), back)
}

pub fn mcpt() -> Settings {
    Settings { method: Method::Mcpt, ..Settings::default() }
}

pub fn prepare(scene: &Arc<Scene>, settings: Settings) -> gsii::Result<Prepared> {
    let mut stats = Stats::default();
    Prepared::new(Arc::clone(scene), &scene.cameras[0], settings, &Progress::silent(), &mut stats)
}

pub fn image(prepared: &Prepared, camera: &Camera, size: [u32; 2], trials: u32, seed: u32) -> Film {
    let params = RenderParams {
        region: None,
        width: size[0],
        height: size[1],
        min_trials: trials,
        max_trials: trials,
        interpolate: false,
        error: f32::INFINITY,
        hires_error: 1.0,
        lores_error: 1.0,
        time_limit: None,
        features: false,
        seed,
        frame: None,
    };
    let film = render(&prepared.world(), camera, &params, &Progress::silent()).film;
    assert!(film.tiles.iter().all(|t| t.dropped == 0), "trials that are not finite");
    film
}

/// What of a pixel counts, first band.
#[derive(Clone, Copy)]
pub enum Part {
    Direct,
    Indirect,
    All,
}

impl Part {
    pub fn of(self, pixel: &Pixel) -> [f64; 3] {
        let (h, l) = (pixel.hires.mean(), pixel.lores.mean());
        match self {
            Part::Direct => h,
            Part::Indirect => l,
            Part::All => std::array::from_fn(|i| h[i] + l[i]),
        }
    }
}

/// Radiance that each camera sees in its one pixel, over seeds of both the radiosity solution and the image.
pub fn radiance(scene: &Arc<Scene>, settings: &Settings, cameras: &[Camera], trials: u32, part: Part) -> Vec<Estimate> {
    radiance_of(scene, settings, cameras, [1, 1], trials, part)
}

/// The same with a mean over several pixels, each with trials of its own.
pub fn radiance_of(
    scene: &Arc<Scene>,
    settings: &Settings,
    cameras: &[Camera],
    size: [u32; 2],
    trials: u32,
    part: Part,
) -> Vec<Estimate> {
    all_parts(scene, settings, cameras, size, trials).into_iter().map(|parts| parts[part as usize]).collect()
}

/// The same for each [`Part`].
pub fn all_parts(
    scene: &Arc<Scene>,
    settings: &Settings,
    cameras: &[Camera],
    size: [u32; 2],
    trials: u32,
) -> Vec<[Estimate; 3]> {
    all_parts_of(&prepare_seeds(scene, settings), cameras, size, trials)
}

/// Seed of the `s`-th measurement.
fn seed_of(s: usize) -> u32 {
    hash_all(&[0xca5e, s as u32])
}

/// The scene prepared once for each seed, or once where no radiosity solution depends on it.
pub fn prepare_seeds(scene: &Arc<Scene>, settings: &Settings) -> Vec<Prepared> {
    let with = |s: usize| prepare(scene, Settings { seed: seed_of(s), ..settings.clone() }).unwrap();
    let first = with(0);
    let solutions = if first.far.is_some() { SEEDS as usize } else { 1 };
    [first].into_iter().chain((1..solutions).map(with)).collect()
}

/// [`all_parts`] of what [`prepare_seeds`] made.
pub fn all_parts_of(prepared: &[Prepared], cameras: &[Camera], size: [u32; 2], trials: u32) -> Vec<[Estimate; 3]> {
    let jobs: Vec<(usize, usize)> = (0..SEEDS as usize).flat_map(|s| (0..cameras.len()).map(move |c| (s, c))).collect();
    let values: Vec<[f64; 3]> = jobs
        .par_iter()
        .map(|&(s, c)| {
            let film = image(&prepared[s % prepared.len()], &cameras[c], size, trials, seed_of(s));
            [Part::Direct, Part::Indirect, Part::All]
                .map(|part| film.pixels().map(|p| part.of(p)[0]).sum::<f64>() / f64::from(size[0] * size[1]))
        })
        .collect();
    let by_seed: Vec<Vec<f64>> = values.chunks(cameras.len()).map(|v| v.concat()).collect();
    transposed(&by_seed).chunks(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// A small receiver of reflectance 1/2 at a point; [`irradiance`] turns what a camera sees of it into irradiance.
pub fn receiver(model: &mut Model, point: DVec3, normal: DVec3, size: f64) {
    model.add("receiver", disc(point, normal.normalize(), size, 4), grey(0.5));
}

/// Irradiance from the radiance of a Lambertian surface of reflectance 1/2.
pub fn irradiance(radiance: Estimate) -> Estimate {
    radiance.times(PI / 0.5)
}
