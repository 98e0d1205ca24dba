//! Tests against cases with exact solutions. Numbers in test names are those of the cases: RAD (radiosity), FF (form factors),
//! HARD (numerically hard).

mod closed;
mod form_factors;
mod lighting;
mod patches;
mod slopes;

use std::time::Instant;

use glam::{DVec3, Mat3, Vec3};

use super::*;
use crate::backend::embree::EmbreeBackend;
use crate::backend::{PartKind, RayBackend, RayScene};
use crate::scene::{Material, Mesh, Object, PunctualLight};
use crate::simplify::TriangleSource;

/// A scene with all that radiosity needs.
struct Room {
    scene: Scene,
    lights: Lights,
    geometry: SimplifiedGeometry,
    rays: Box<dyn RayScene>,
}

/// Triangles of one surface: positions three by three, and a material.
type Surface = (Vec<[Vec3; 3]>, Material);

impl Room {
    /// Each entry of `surfaces` becomes one surface.
    fn new(surfaces: Vec<Surface>, lights: Vec<PunctualLight>) -> Room {
        let mut mesh = Mesh::default();
        let mut materials = Vec::new();
        let mut geometry = SimplifiedGeometry::default();
        for (number, (triangles, material)) in surfaces.into_iter().enumerate() {
            let first = mesh.triangles.len() as u32;
            for corners in triangles {
                let vertex = mesh.positions.len() as u32;
                mesh.positions.extend(corners);
                mesh.triangles.push([vertex, vertex + 1, vertex + 2]);
                mesh.object_of_triangle.push(number as u32);
                geometry.surface_of_triangle.push(number as u32);
            }
            mesh.objects.push(Object {
                name: format!("surface {number}"),
                material: number as u32,
                triangles: first..mesh.triangles.len() as u32,
                axes: Mat3::IDENTITY,
                kind: PartKind::Opaque,
            });
            materials.push(material);
        }
        mesh.measure();
        geometry.positions = mesh.positions.clone();
        geometry.triangles = mesh.triangles.clone();
        geometry.sources =
            (0..mesh.triangles.len() as u32).map(|triangle| TriangleSource::Scene { triangle }).collect();
        geometry.surfaces = mesh.objects.len() as u32;
        geometry.parts = mesh.parts();
        let scene = Scene { mesh, materials, lights, ..Scene::default() };
        let rays = EmbreeBackend::new(1).unwrap().build(&geometry.triangle_set()).unwrap();
        Room { lights: Lights::new(&scene), scene, geometry, rays }
    }

    fn input(&self) -> RadiosityScene<'_> {
        RadiosityScene {
            scene: &self.scene,
            lights: &self.lights,
            geometry: &self.geometry,
            clusters: &[],
            rays: &*self.rays,
        }
    }

    fn solve(&self, params: &RadiosityParams) -> Result<Solution> {
        let start = Instant::now();
        let solution = solve(&self.input(), params, &Progress::silent());
        if let Ok(s) = &solution {
            println!(
                "{} patches, {} shots, {:.2e} rays, error {:.2e}, imbalance {:.1e}, {:.2} s",
                s.patches,
                s.shots,
                s.rays as f64,
                s.error,
                s.ledger.imbalance(),
                start.elapsed().as_secs_f64()
            );
            assert!(s.ledger.imbalance() < 1e-6, "{:?}", s.ledger);
        }
        solution
    }

    /// Area, emission and area-weighted mean radiosity (emission included) of the front of a surface.
    fn surface(&self, solution: &Solution, surface: usize) -> (f64, DVec3) {
        let (mut area, mut sum) = (0.0, DVec3::ZERO);
        for t in self.scene.mesh.objects[surface].triangles.clone() {
            // Exact for triangles that lie in one patch; otherwise a midpoint rule over 400 parts.
            let n = 20;
            for i in 0..n {
                for j in 0..n - i {
                    let (u, v) = ((i as f32 + 1.0 / 3.0) / n as f32, (j as f32 + 1.0 / 3.0) / n as f32);
                    let part = self.scene.mesh.area(t) / f64::from(n * (n + 1) / 2);
                    area += part;
                    sum += part * solution.radiosity(t, u, v, true).as_dvec3();
                }
            }
        }
        let emission = std::f64::consts::PI * self.scene.materials[surface].emission.as_dvec3();
        (area, sum / area + emission)
    }
}

/// Mean radiosity without emission of the fronts of all patches, which must have equal areas. Exact, unlike
/// [`Room::surface`], which samples.
fn mean_over_patches(solution: &Solution) -> f64 {
    let sum: f64 = solution.of_patch.iter().map(|p| f64::from(p.radiosity[0].x)).sum();
    sum / solution.patches as f64
}

/// Lambertian material of exitance `e`.
fn material(rho: f32, e: f32) -> Material {
    Material::emitter(Vec3::splat(e / std::f32::consts::PI), Vec3::splat(rho))
}

/// The faces x0, x1, y0, y1, z0, z1 of a box, normals inward.
fn box_faces([x, y, z]: [f32; 3]) -> [[Vec3; 4]; 6] {
    let p = Vec3::new;
    [
        [p(0., 0., 0.), p(0., y, 0.), p(0., y, z), p(0., 0., z)],
        [p(x, 0., 0.), p(x, 0., z), p(x, y, z), p(x, y, 0.)],
        [p(0., 0., 0.), p(0., 0., z), p(x, 0., z), p(x, 0., 0.)],
        [p(0., y, 0.), p(x, y, 0.), p(x, y, z), p(0., y, z)],
        [p(0., 0., 0.), p(x, 0., 0.), p(x, y, 0.), p(0., y, 0.)],
        [p(0., 0., z), p(0., y, z), p(x, y, z), p(x, 0., z)],
    ]
}

/// A parallelogram as `n` times `n` quads of two triangles.
fn diced([a, b, c, d]: [Vec3; 4], n: u32) -> Vec<[Vec3; 3]> {
    let at = |i: u32, j: u32| {
        let (s, t) = (i as f32 / n as f32, j as f32 / n as f32);
        a.lerp(b, s).lerp(d.lerp(c, s), t)
    };
    let cell = |i: u32, j: u32| {
        let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[p, q, r], [p, r, s]]
    };
    (0..n).flat_map(|j| (0..n).map(move |i| (i, j))).flat_map(|(i, j)| cell(i, j)).collect()
}

/// A closed box with one surface a face.
fn closed_box(size: [f32; 3], rho: [f32; 6], exitance: [f32; 6]) -> Room {
    let surfaces = box_faces(size).into_iter().zip(rho.into_iter().zip(exitance));
    Room::new(surfaces.map(|(face, (r, e))| (diced(face, 1), material(r, e))).collect(), Vec::new())
}

/// One patch a face, light sources shoot. A tolerance of 5e-3 is five standard errors.
fn one_patch() -> RadiosityParams {
    RadiosityParams {
        keep_places: false,
        unshot: 1e-4,
        direct: DirectLight::Shoot,
        error: 1e-3,
        seed: 1,
        ..RadiosityParams::new(1e6)
    }
}

fn assert_close(what: &str, value: f64, expected: f64, relative: f64) {
    let off = value / expected - 1.0;
    println!("{what}: {value:.6}, expected {expected:.6}, off {off:.1e}");
    assert!(off.abs() <= relative, "{what}: {value} instead of {expected}");
}
