//! Triangles of a scene.

use std::ops::Range;

use glam::{Mat3, Vec2, Vec3};

use rayon::prelude::*;

use super::{Aabb, Plane};
use crate::backend::{Part, PartKind};

/// Distance between unit vectors that rounding explains.
const SAME_NORMAL: f32 = 1e-6;

/// All triangles of a scene, in recentred world coordinates.
///
/// Triangles are ordered by object, and objects by [`Object::kind`], so that each kind is one contiguous part.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, finite.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one a vertex; `Vec3::ZERO` where the file gives none (flat shading). Empty when no
    /// vertex has one.
    pub normals: Vec<Vec3>,
    /// Two sets of texture coordinates, each empty or one a vertex.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours, empty (all white) or one a vertex.
    pub colors: Vec<[f32; 4]>,
    /// Three vertex indices a triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Mesh::objects`], one a triangle.
    pub object_of_triangle: Vec<u32>,
    /// Plane of each triangle.
    pub planes: Vec<Plane>,
    /// The objects, in the order of their triangles.
    pub objects: Vec<Object>,
    /// Triangles that another object had as well (where two blocks touch), each with that object: it lost its own.
    pub shared: Vec<(u32, u32)>,
    /// Bounds of all triangles.
    pub bounds: Aabb,
}

/// One mesh primitive of one node: the triangles that share a material and a modelling frame.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name of node and mesh, for messages.
    pub name: String,
    /// Index into [`Scene::materials`](super::Scene::materials).
    pub material: u32,
    /// Its triangles.
    pub triangles: Range<u32>,
    /// Columns are the axes in which the node models the object: orthonormal, world space.
    pub axes: Mat3,
    /// How rays treat it.
    pub kind: PartKind,
}

impl Mesh {
    /// Corner positions of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        // Not `map`, which compilers make a call of.
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// The object a triangle belongs to.
    pub fn object(&self, triangle: u32) -> &Object {
        &self.objects[self.object_of_triangle[triangle as usize] as usize]
    }

    /// Area of a triangle. Computed in f64, so that slivers keep their area.
    pub fn area(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle).map(Vec3::as_dvec3);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Unit geometric normal of a triangle (counter-clockwise side).
    pub fn normal(&self, triangle: u32) -> Vec3 {
        self.planes[triangle as usize].normal
    }

    /// Brings bounds and planes up to date with the triangles.
    pub fn measure(&mut self) {
        let corners = |t: &[u32; 3]| t.map(|i| self.positions[i as usize]);
        let plane = |t: &[u32; 3]| {
            let plane = Plane::of(corners(t));
            Plane { flat: self.is_flat(t, plane.normal), ..plane }
        };
        let planes = self.triangles.par_iter().map(plane).collect();
        let bounds = self.triangles.par_iter().map(|t| Aabb::of(corners(t))).reduce(Aabb::default, Aabb::union);
        (self.planes, self.bounds) = (planes, bounds);
    }

    /// Whether a triangle has no shading normals, or those of its plane but for rounding.
    fn is_flat(&self, triangle: &[u32; 3], normal: Vec3) -> bool {
        if self.normals.is_empty() {
            return true;
        }
        let normals = triangle.map(|i| self.normals[i as usize]);
        normals.contains(&Vec3::ZERO) || normals.iter().all(|n| n.distance(normal) <= SAME_NORMAL)
    }

    /// Contiguous triangle ranges by kind, for a backend.
    pub fn parts(&self) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        for object in &self.objects {
            match parts.last_mut() {
                Some(last) if last.kind == object.kind => last.triangles.end = object.triangles.end,
                _ => parts.push(Part { triangles: object.triangles.clone(), kind: object.kind }),
            }
        }
        parts
    }
}
