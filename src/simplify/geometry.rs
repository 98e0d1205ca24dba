//! The simplified scene as triangles: normal surfaces and box faces.

use glam::Vec3;

use crate::backend::{Part, TriangleSet};
use crate::scene::Scene;

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
    /// Surface of each triangle: patches never span two. Box faces have numbers of their own.
    pub surface_of_triangle: Vec<u32>,
    /// How many surface numbers there are.
    pub surfaces: u32,
    /// Parts for a backend.
    pub parts: Vec<Part>,
}

impl SimplifiedGeometry {
    /// The whole detailed scene (normal + complex), for PMM and for radiosity on N+C.
    pub fn complete(scene: &Scene, surface_of_triangle: &[u32]) -> Self {
        let _ = (scene, surface_of_triangle);
        todo!("simplify helper")
    }

    /// For a backend. `filter` decides on alpha-tested triangles of this geometry.
    pub fn triangle_set(&self) -> TriangleSet<'_> {
        TriangleSet { positions: &self.positions, triangles: &self.triangles, parts: &self.parts, filter: None }
    }
}
