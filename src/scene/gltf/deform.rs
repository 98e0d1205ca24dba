//! Morph targets and skins, in the pose of the file (no animation).

use glam::{DAffine3, DMat4, Vec3};
use gltf::json::Root;
use gltf::json::accessor::Type;
use gltf::json::mesh::Semantic;

use super::accessor::Elements;
use super::buffers::Buffers;
use super::nodes::Nodes;
use super::primitive::{Attributes, DIFFERENCE, JOINT, MATRIX, WEIGHT};
use crate::scene::builder::{MeshData, normal_matrix};

/// What a node does to the vertices of its mesh before its transform.
#[derive(Default)]
pub(super) struct Deformation<'a> {
    /// Weights of the morph targets; missing ones are zero.
    pub weights: &'a [f32],
    /// Joint matrices to world space; then the node's own transform does not count (specification 3.7.3.3).
    pub joints: Option<Vec<DMat4>>,
}

/// World space joint matrices of a skin.
pub(super) fn joints(root: &Root, buffers: &Buffers<'_>, nodes: &Nodes, skin: usize) -> Result<Vec<DMat4>, String> {
    let skin = root.skins.get(skin).ok_or_else(|| format!("skin {skin} does not exist"))?;
    let inverse = match &skin.inverse_bind_matrices {
        Some(accessor) => {
            let e = Elements::new(root, buffers, accessor.value())?;
            let e = e.expect("inverseBindMatrices", &[Type::Mat4], MATRIX)?;
            match e.count >= skin.joints.len() {
                true => Some(e),
                false => return Err(format!("{} inverseBindMatrices for {} joints", e.count, skin.joints.len())),
            }
        }
        None => None,
    };
    let matrix = |(i, node): (usize, &gltf::json::Index<gltf::json::Node>)| {
        let bind = match &inverse {
            Some(e) => DMat4::from_cols_array(&e.floats::<16>(i).map(f64::from)),
            None => DMat4::IDENTITY,
        };
        DMat4::from(nodes.world[node.value()]) * bind
    };
    Ok(skin.joints.iter().enumerate().map(matrix).collect())
}

impl Deformation<'_> {
    /// Deforms `data`, whose vertices are the primitive's `vertices`.
    pub(super) fn apply(
        &self,
        attributes: &Attributes<'_, '_>,
        vertices: &[u32],
        data: &mut MeshData,
    ) -> Result<(), String> {
        self.morph(attributes, vertices, data)?;
        match &self.joints {
            Some(joints) => skin(joints, attributes, vertices, data),
            None => Ok(()),
        }
    }

    fn morph(&self, attributes: &Attributes<'_, '_>, vertices: &[u32], data: &mut MeshData) -> Result<(), String> {
        let targets = attributes.targets();
        for (target, &weight) in targets.iter().zip(self.weights).filter(|(_, w)| **w != 0.0) {
            let add = |accessor: &Option<_>, values: &mut [Vec3], name: &str| -> Result<(), String> {
                let accessor: &Option<gltf::json::Index<gltf::json::Accessor>> = accessor;
                let Some(accessor) = accessor.as_ref().filter(|_| !values.is_empty()) else { return Ok(()) };
                let e = attributes.accessor(accessor.value(), name, &[Type::Vec3], DIFFERENCE)?;
                for (value, &v) in values.iter_mut().zip(vertices) {
                    *value += weight * Vec3::from_array(e.floats(v as usize));
                }
                Ok(())
            };
            add(&target.positions, &mut data.positions, "morph target POSITION")?;
            add(&target.normals, &mut data.normals, "morph target NORMAL")?;
        }
        Ok(())
    }
}

fn skin(
    joints: &[DMat4],
    attributes: &Attributes<'_, '_>,
    vertices: &[u32],
    data: &mut MeshData,
) -> Result<(), String> {
    let mut sets = Vec::new();
    for set in 0..2 {
        let numbers = attributes.get(Semantic::Joints(set), &[Type::Vec4], JOINT)?;
        let weights = attributes.get(Semantic::Weights(set), &[Type::Vec4], WEIGHT)?;
        sets.extend(numbers.zip(weights));
    }
    for (i, &v) in vertices.iter().enumerate() {
        let mut sum = DMat4::ZERO;
        let mut total = 0.0;
        for (numbers, weights) in &sets {
            for (joint, weight) in numbers.integers::<4>(v as usize).into_iter().zip(weights.floats::<4>(v as usize)) {
                if weight != 0.0 {
                    let matrix = joints
                        .get(joint as usize)
                        .ok_or_else(|| format!("vertex {v} refers to joint {joint} of {}", joints.len()))?;
                    sum += *matrix * f64::from(weight);
                    total += f64::from(weight);
                }
            }
        }
        let matrix = if total > 0.0 { sum * (1.0 / total) } else { DMat4::IDENTITY };
        let affine = DAffine3::from_mat4(matrix);
        data.positions[i] = affine.transform_point3(data.positions[i].as_dvec3()).as_vec3();
        if let Some(normal) = data.normals.get_mut(i) {
            *normal = (normal_matrix(&affine.matrix3) * normal.as_dvec3()).as_vec3();
        }
    }
    Ok(())
}
