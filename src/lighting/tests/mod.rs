//! Tests against closed forms. Random numbers are independent, so that standard errors are known; seeds are fixed.
//! A comparison that is right fails with the probability of five standard errors, 6e-7; there are less than a thousand.

mod area;
mod choice;
mod emission;
mod environment;
mod punctual;

use glam::{DVec3, Mat3, Vec3};

use super::{Lights, Lit};
use crate::backend::PartKind;
use crate::sampling::{hash_all, unit};
use crate::scene::{LightKind, Material, Mesh, Object, PunctualLight, Scene};

const SIGMAS: f64 = 5.0;

/// Polygons fanned into triangles, one object each, and the lights.
fn scene(polygons: &[(Vec<Vec3>, Material)], lights: &[(LightKind, Vec3)]) -> Scene {
    let mut mesh = Mesh::default();
    let mut materials = Vec::new();
    for (points, material) in polygons {
        let base = mesh.positions.len() as u32;
        let first = mesh.triangles.len() as u32;
        mesh.positions.extend(points);
        for i in 1..points.len() as u32 - 1 {
            mesh.triangles.push([base, base + i, base + i + 1]);
            mesh.object_of_triangle.push(mesh.objects.len() as u32);
        }
        mesh.objects.push(Object {
            name: String::new(),
            material: materials.len() as u32,
            triangles: first..mesh.triangles.len() as u32,
            axes: Mat3::IDENTITY,
            kind: PartKind::Opaque,
        });
        materials.push(material.clone());
    }
    mesh.measure();
    let lights =
        lights.iter().map(|&(kind, intensity)| PunctualLight { name: String::new(), intensity, kind }).collect();
    Scene { mesh, materials, lights, ..Scene::default() }
}

fn emitter(radiance: f32) -> Material {
    Material::emitter(Vec3::splat(radiance), Vec3::ZERO)
}

fn points<const N: usize>(p: [[f32; 3]; N]) -> Vec<Vec3> {
    p.map(Vec3::from).to_vec()
}

/// The `i`th number of a stream.
fn random(seed: u32, i: u32, dimension: u32) -> f32 {
    unit(hash_all(&[seed, i, dimension]))
}

fn random3(seed: u32, i: u32, dimension: u32) -> [f32; 3] {
    [0, 1, 2].map(|k| random(seed, i, dimension + k))
}

/// A point in the cube -1..1.
fn random_point(seed: u32, i: u32) -> Vec3 {
    2.0 * Vec3::from(random3(seed, i, 100)) - Vec3::ONE
}

/// Mean and its standard error.
struct Estimate {
    mean: f64,
    error: f64,
}

impl Estimate {
    fn of(values: impl Iterator<Item = f64>) -> Estimate {
        let (mut n, mut mean, mut squares) = (0.0, 0.0, 0.0);
        for v in values {
            assert!(v.is_finite() && v >= 0.0, "{v}");
            n += 1.0;
            let d = v - mean;
            mean += d / n;
            squares += d * (v - mean);
        }
        Estimate { mean, error: (squares / (n * (n - 1.0))).sqrt() }
    }

    /// The rounding of f32 positions and weights allows for `rounding`, relative.
    fn assert_near(&self, expected: f64, rounding: f64, what: &str) {
        let allowed = SIGMAS * self.error + rounding * expected.abs();
        assert!(
            (self.mean - expected).abs() <= allowed,
            "{what}: {} +- {} instead of {expected}",
            self.mean,
            self.error
        );
    }
}

/// Irradiance estimate in the first band from `n` samples.
fn irradiance(scene: &Scene, position: Vec3, normal: Vec3, n: u32, seed: u32) -> Estimate {
    let lights = Lights::new(scene);
    Estimate::of((0..n).map(|i| match lights.sample(scene, &Lit { position, normal, u: random3(seed, i, 0) }) {
        None => 0.0,
        Some(s) => {
            assert!((s.direction.length() - 1.0).abs() < 1e-6);
            assert!(s.pdf.is_none_or(|p| p > 0.0));
            f64::from(s.weight.x) * f64::from(s.direction.dot(normal)).max(0.0)
        }
    }))
}

/// Irradiance / radiance that a polygon seen from its front sends to a surface: Lambert's formula, clipped at the horizon.
fn lambert(polygon: &[Vec3], position: Vec3, normal: Vec3) -> f64 {
    let (p, n) = (position.as_dvec3(), normal.as_dvec3().normalize());
    let points: Vec<DVec3> = polygon.iter().map(|q| q.as_dvec3() - p).collect();
    let mut clipped = Vec::new();
    for (i, &a) in points.iter().enumerate() {
        let b = points[(i + 1) % points.len()];
        let (ha, hb) = (a.dot(n), b.dot(n));
        if ha >= 0.0 {
            clipped.push(a);
        }
        if (ha < 0.0) != (hb < 0.0) {
            clipped.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    let mut sum = 0.0;
    for (i, &a) in clipped.iter().enumerate() {
        let cross = a.cross(clipped[(i + 1) % clipped.len()]);
        let sin = cross.length();
        if sin > 0.0 {
            let angle = sin.atan2(a.dot(clipped[(i + 1) % clipped.len()]));
            sum += angle * cross.dot(n) / sin;
        }
    }
    // Seen from the front the corners run clockwise around the view direction
    (-0.5 * sum).max(0.0)
}
