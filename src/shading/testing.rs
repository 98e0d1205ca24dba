//! Small scenes for the tests of this module.

use glam::Vec3;

use crate::backend::PartKind;
use crate::scene::{Material, Mesh, Object, Scene};

/// A scene of one opaque triangle.
pub(super) fn scene_of(corners: [Vec3; 3], material: Material) -> Scene {
    let object = Object {
        name: "triangle".to_owned(),
        material: 0,
        triangles: 0..1,
        axes: glam::Mat3::IDENTITY,
        kind: PartKind::Opaque,
    };
    let mut mesh = Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2]],
        object_of_triangle: vec![0],
        objects: vec![object],
        ..Mesh::default()
    };
    mesh.measure();
    Scene { mesh, materials: vec![material], ..Scene::default() }
}
