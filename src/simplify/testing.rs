//! Shapes, scenes and a brute-force backend for tests.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Mat3, Vec3};

use super::SimplifyParams;
use crate::backend::{Coherence, Hit, HitFilter, Part, PartKind, Ray, RayBackend, RayScene, TriangleSet, Visible};
use crate::error::Result;
use crate::scene::{Aabb, Material, Object, Scene};

/// Builds scenes triangle by triangle, one object for each call of [`SceneBuilder::object`].
#[derive(Default)]
pub(crate) struct SceneBuilder {
    scene: Scene,
}

impl SceneBuilder {
    /// Adds triangles, each with vertices of its own, as one object.
    pub(crate) fn object(mut self, material: Material, triangles: &[[Vec3; 3]]) -> Self {
        let mesh = &mut self.scene.mesh;
        let start = mesh.triangles.len() as u32;
        for corners in triangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.object_of_triangle.push(mesh.objects.len() as u32);
        }
        mesh.objects.push(Object {
            name: format!("object {}", mesh.objects.len()),
            material: self.scene.materials.len() as u32,
            triangles: start..mesh.triangles.len() as u32,
            axes: Mat3::IDENTITY,
            kind: PartKind::Opaque,
        });
        self.scene.materials.push(material);
        self
    }

    pub(crate) fn grey(self, reflectance: f32, triangles: &[[Vec3; 3]]) -> Self {
        self.object(Material::lambertian(Vec3::splat(reflectance)), triangles)
    }

    pub(crate) fn build(mut self) -> Scene {
        self.scene.mesh.measure();
        self.scene
    }
}

pub(crate) fn all_triangles(scene: &Scene) -> Vec<u32> {
    (0..scene.mesh.triangles.len() as u32).collect()
}

pub(crate) fn params(r_thresh: f32, beta: f32) -> SimplifyParams {
    SimplifyParams {
        r_thresh,
        beta,
        box_fit: super::BoxFit::Flux,
        crease_angle: 30f32.to_radians(),
        longest: 3.0,
        face_resolution: 2,
        seed: 1,
    }
}

/// The quad `a`, `a + u`, `a + u + v`, `a + v`.
pub(crate) fn quad(a: Vec3, u: Vec3, v: Vec3) -> Vec<[Vec3; 3]> {
    vec![[a, a + u, a + u + v], [a, a + u + v, a + v]]
}

/// The same, cut into `n * n` quads whose vertices coincide exactly.
pub(crate) fn diced_quad(a: Vec3, u: Vec3, v: Vec3, n: u32) -> Vec<[Vec3; 3]> {
    let at = |i: u32, j: u32| a + u * (i as f32 / n as f32) + v * (j as f32 / n as f32);
    (0..n * n)
        .flat_map(|k| {
            let (i, j) = (k % n, k / n);
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[p, q, r], [p, r, s]]
        })
        .collect()
}

/// A solid box, outward winding.
pub(crate) fn solid(lo: [f32; 3], hi: [f32; 3]) -> Vec<[Vec3; 3]> {
    room_faces(Vec3::from(lo), Vec3::from(hi)).into_iter().flat_map(|[a, u, v]| quad(a, u, v)).collect()
}

/// Origin and edges of the six faces x-, x+, ... of a box, normals outward.
pub(crate) fn room_faces(lo: Vec3, hi: Vec3) -> [[Vec3; 3]; 6] {
    let d = hi - lo;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    [[lo, z, y], [lo + x, y, z], [lo, x, z], [lo + y, z, x], [lo, y, x], [lo + z, x, y]]
}

/// A latitude-longitude sphere of the same volume-free silhouette error on all sides: vertices lie on the sphere.
pub(crate) fn sphere(centre: Vec3, radius: f32, rings: u32) -> Vec<[Vec3; 3]> {
    let at = |i: u32, j: u32| {
        let (theta, phi) = (PI * i as f32 / rings as f32, TAU * (j % (2 * rings)) as f32 / (2 * rings) as f32);
        centre + radius * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..2 * rings {
            let [p, q, r, s] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            if i > 0 {
                triangles.push([p, q, r]);
            }
            if i + 1 < rings {
                triangles.push([p, r, s]);
            }
        }
    }
    triangles
}

/// Tests every triangle, in f64 (blocks of triangles are skipped by their bounds).
pub(crate) struct BruteForce;

impl RayBackend for BruteForce {
    fn name(&self) -> String {
        "brute force".into()
    }

    fn build(&self, set: &TriangleSet<'_>) -> Result<Box<dyn RayScene>> {
        let mut triangles = Vec::new();
        for Part { triangles: range, kind } in set.parts {
            for t in range.clone() {
                let corners = set.triangles[t as usize].map(|i| set.positions[i as usize]);
                triangles.push(BruteTriangle { corners, index: t, kind: *kind });
            }
        }
        assert_eq!(triangles.len(), set.triangles.len(), "parts together hold every triangle");
        Ok(Box::new(BruteScene { triangles, filter: set.filter.clone() }))
    }
}

struct BruteTriangle {
    corners: [Vec3; 3],
    index: u32,
    kind: PartKind,
}

struct BruteScene {
    triangles: Vec<BruteTriangle>,
    filter: Option<std::sync::Arc<dyn HitFilter>>,
}

const BLOCK: usize = 32;

impl BruteScene {
    fn nearest(&self, ray: &Ray, visible: Visible, blocks: &[Aabb]) -> Hit {
        let mut best = Hit::MISS;
        for (block, bounds) in self.triangles.chunks(BLOCK).zip(blocks) {
            let (a, b) = ((bounds.min - ray.origin) / ray.direction, (bounds.max - ray.origin) / ray.direction);
            let enter = a.min(b).to_array().into_iter().fold(0.0, f32::max);
            let leave = a.max(b).to_array().into_iter().fold(f32::INFINITY, f32::min);
            if enter > leave * 1.0001 + 1e-4 {
                continue;
            }
            for triangle in block {
                let seen = match visible {
                    Visible::All => true,
                    Visible::WithoutPanes => triangle.kind != PartKind::Pane,
                    Visible::OnlyPanes => triangle.kind == PartKind::Pane,
                };
                if let Some(hit) = self.intersect(ray, triangle).filter(|h| seen && h.t < best.t) {
                    best = hit;
                }
            }
        }
        best
    }

    /// Moeller and Trumbore 1997, with a rounding margin on the edges so that solids are closed.
    fn intersect(&self, ray: &Ray, triangle: &BruteTriangle) -> Option<Hit> {
        let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
        let (d, o): (DVec3, DVec3) = (ray.direction.as_dvec3(), ray.origin.as_dvec3());
        let (e, f) = (b - a, c - a);
        let p = d.cross(f);
        let det = e.dot(p);
        if det == 0.0 || (triangle.kind == PartKind::OneSided && det < 0.0) {
            return None;
        }
        let u = (o - a).dot(p) / det;
        let q = (o - a).cross(e);
        let v = d.dot(q) / det;
        let t = f.dot(q) / det;
        let margin = -1e-9;
        if u < margin || v < margin || u + v > 1.0 - margin || t < ray.t_near.into() || t > ray.t_far.into() {
            return None;
        }
        let hit = Hit { t: t as f32, u: u as f32, v: v as f32, triangle: triangle.index };
        let filtered = triangle.kind == PartKind::Filtered;
        let accepted = !filtered || self.filter.as_ref().is_none_or(|f| f.accepts(hit.triangle, hit.u, hit.v));
        accepted.then_some(hit)
    }
}

impl RayScene for BruteScene {
    fn closest(&self, rays: &[Ray], visible: Visible, _: Coherence, hits: &mut [Hit]) {
        let blocks: Vec<Aabb> =
            self.triangles.chunks(BLOCK).map(|b| Aabb::of(b.iter().flat_map(|t| t.corners))).collect();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.nearest(ray, visible, &blocks);
        }
    }

    fn occluded(&self, rays: &[Ray], visible: Visible, coherence: Coherence, occluded: &mut [bool]) {
        let mut hits = vec![Hit::MISS; rays.len()];
        self.closest(rays, visible, coherence, &mut hits);
        occluded.iter_mut().zip(&hits).for_each(|(o, h)| *o = h.is_hit());
    }

    fn memory_bytes(&self) -> usize {
        0
    }
}
