//! The simplified scene as triangles: normal surfaces and box faces.

use std::sync::Arc;

use glam::Vec3;

use super::fit::{face_axes, face_side};
use super::{Class, Cluster, EquivalentBox, Surface};
use crate::backend::{HitFilter, Part, PartKind, RayBackend, RayScene, TriangleSet};
use crate::error::Result;
use crate::scene::Scene;

/// Triangles of a box.
pub const BOX_TRIANGLES: u32 = 12;

/// Where a triangle of the simplified geometry comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriangleSource {
    /// A triangle of the scene, same winding.
    Scene {
        /// Index into the scene's triangles.
        triangle: u32,
    },
    /// Half of a box face, outward counter-clockwise. The first half (`second == false`) has the corners (0,0) (1,0) (1,1)
    /// and the second (0,0) (1,1) (0,1) in face coordinates, in the order that makes the normal point outward.
    BoxFace {
        /// Index into [`Simplified::clusters`](super::Simplified::clusters).
        cluster: u32,
        /// 0..6: x-, x+, y-, y+, z-, z+.
        face: u8,
        /// Which half.
        second: bool,
    },
}

/// Triangles that radiosity is solved on: normal + simple surfaces, or normal + complex ([`SimplifiedGeometry::complete`]).
#[derive(Clone, Debug, Default)]
pub struct SimplifiedGeometry {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex indices a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Where each triangle comes from.
    pub sources: Vec<TriangleSource>,
    /// Surface of each triangle: patches never span two. Numbered from 0 without gaps, in the order of the triangles. Box
    /// faces have numbers of their own.
    pub surface_of_triangle: Vec<u32>,
    /// How many surface numbers there are.
    pub surfaces: u32,
    /// Parts for a backend.
    pub parts: Vec<Part>,
}

impl SimplifiedGeometry {
    /// The whole detailed scene (normal + complex), for PMM and for radiosity on N+C.
    pub fn complete(scene: &Scene, surface_of_triangle: &[u32]) -> Self {
        Self::of_triangles(scene, surface_of_triangle, |_| true)
    }

    /// Normal surfaces only: clusters gone without anything in their place.
    pub fn normal(scene: &Scene, surfaces: &[Surface], surface_of_triangle: &[u32]) -> Self {
        Self::of_triangles(scene, surface_of_triangle, |s| surfaces[s as usize].class == Class::Normal)
    }

    /// The surfaces that `keep` chooses, in the scene's order, with vertices and surfaces renumbered.
    fn of_triangles(scene: &Scene, surface_of_triangle: &[u32], keep: impl Fn(u32) -> bool) -> Self {
        const NEW: u32 = u32::MAX;
        let mesh = &scene.mesh;
        let mut geometry = SimplifiedGeometry::default();
        let mut vertices = vec![NEW; mesh.positions.len()];
        let mut numbers = vec![NEW; surface_of_triangle.iter().max().map_or(0, |&m| m as usize + 1)];
        for (t, &surface) in surface_of_triangle.iter().enumerate() {
            if !keep(surface) {
                continue;
            }
            let number = &mut numbers[surface as usize];
            if *number == NEW {
                *number = geometry.surfaces;
                geometry.surfaces += 1;
            }
            geometry.surface_of_triangle.push(*number);
            let corners = mesh.triangles[t].map(|v| {
                let vertex = &mut vertices[v as usize];
                if *vertex == NEW {
                    *vertex = geometry.positions.len() as u32;
                    geometry.positions.push(mesh.positions[v as usize]);
                }
                *vertex
            });
            geometry.push(corners, TriangleSource::Scene { triangle: t as u32 }, mesh.object(t as u32).kind);
        }
        geometry
    }

    /// Adds the faces of the clusters' boxes.
    pub(crate) fn add_boxes(&mut self, clusters: &[Cluster]) {
        for (cluster, c) in (0u32..).zip(clusters) {
            for face in 0..6u8 {
                let corners = box_face(&c.equivalent_box, face.into());
                let first = self.positions.len() as u32;
                self.positions.extend(corners);
                for second in [false, true] {
                    let [b, c] = if second { [2, 3] } else { [1, 2] };
                    // Face coordinates are right-handed about +x, -y and +z (axes in ascending order), so the faces x+,
                    // y- and z+ wind as they are.
                    let flip = matches!(face, 0 | 3 | 4);
                    let [b, c] = if flip { [c, b] } else { [b, c] };
                    self.surface_of_triangle.push(self.surfaces);
                    let source = TriangleSource::BoxFace { cluster, face, second };
                    self.push([first, first + b, first + c], source, PartKind::OneSided);
                }
                self.surfaces += 1;
            }
        }
    }

    fn push(&mut self, triangle: [u32; 3], source: TriangleSource, kind: PartKind) {
        let index = self.triangles.len() as u32;
        self.triangles.push(triangle);
        self.sources.push(source);
        match self.parts.last_mut() {
            Some(last) if last.kind == kind => last.triangles.end = index + 1,
            _ => self.parts.push(Part { triangles: index..index + 1, kind }),
        }
    }

    /// For a backend, without alpha tests; see [`SimplifiedGeometry::build`].
    pub fn triangle_set(&self) -> TriangleSet<'_> {
        TriangleSet { positions: &self.positions, triangles: &self.triangles, parts: &self.parts, filter: None }
    }

    /// Builds the acceleration structure, alpha tests included.
    ///
    /// # Errors
    /// When the backend fails.
    pub fn build(&self, scene: &Arc<Scene>, backend: &dyn RayBackend) -> Result<Box<dyn RayScene>> {
        let filter = super::scene_filter(scene).map(|f| self.filter(f));
        backend.build(&TriangleSet { filter, ..self.triangle_set() })
    }

    /// The scene's hit filter, for the triangles of this geometry.
    pub fn filter(&self, scene_filter: Arc<dyn HitFilter>) -> Arc<dyn HitFilter> {
        let scene_triangle = |source: &TriangleSource| match *source {
            TriangleSource::Scene { triangle } => triangle,
            // Box faces are not filtered; the number is never asked for.
            TriangleSource::BoxFace { .. } => u32::MAX,
        };
        RemappedFilter::share(self.sources.iter().map(scene_triangle).collect(), scene_filter)
    }
}

/// Corners (0,0) (1,0) (1,1) (0,1) of a box face.
fn box_face(b: &EquivalentBox, face: usize) -> [Vec3; 4] {
    let (normal_axis, first, second) = face_axes(face);
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(s, t)| {
        let mut local = Vec3::ZERO;
        local[normal_axis] = face_side(face);
        local[first] = s;
        local[second] = t;
        b.centre + b.axes * (local * b.half)
    })
}

/// Puts the triangles of one geometry to a filter that knows another's.
pub(crate) struct RemappedFilter {
    /// Triangle of the other geometry for each of this one.
    source: Arc<[u32]>,
    inner: Arc<dyn HitFilter>,
}

impl RemappedFilter {
    pub(crate) fn share(source: Arc<[u32]>, inner: Arc<dyn HitFilter>) -> Arc<dyn HitFilter> {
        Arc::new(RemappedFilter { source, inner })
    }
}

impl HitFilter for RemappedFilter {
    fn accepts(&self, triangle: u32, u: f32, v: f32) -> bool {
        self.inner.accepts(self.source[triangle as usize], u, v)
    }
}
