//! `EXT_mesh_gpu_instancing`.

use glam::{DAffine3, DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::{Node, Root};
use serde_json::Value;

use super::accessor::Elements;
use super::buffers::Buffers;

/// Transforms of a node's instances in the node's frame, or `None` where the node is not instanced.
pub(super) fn transforms(root: &Root, buffers: &Buffers<'_>, node: &Node) -> Result<Option<Vec<DAffine3>>, String> {
    let Some(extension) = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing")) else {
        return Ok(None);
    };
    let attribute = |name: &str, kind: Type, components: &[ComponentType]| match extension
        .pointer("/attributes")
        .and_then(|a| a.get(name))
    {
        Some(index) => {
            let index = Value::as_u64(index).and_then(|i| usize::try_from(i).ok());
            let index = index.ok_or_else(|| format!("EXT_mesh_gpu_instancing: {name} is no accessor number"))?;
            Elements::new(root, buffers, index)?.expect(name, &[kind], components).map(Some)
        }
        None => Ok(None),
    };
    let float = [ComponentType::F32];
    let translation = attribute("TRANSLATION", Type::Vec3, &float)?;
    let rotation = attribute("ROTATION", Type::Vec4, &[ComponentType::F32, ComponentType::I8, ComponentType::I16])?;
    let scale = attribute("SCALE", Type::Vec3, &float)?;
    let mut counts = [&translation, &rotation, &scale].into_iter().flatten().map(|e| e.count);
    let Some(count) = counts.next() else { return Ok(Some(vec![DAffine3::IDENTITY])) };
    if counts.any(|c| c != count) {
        return Err("EXT_mesh_gpu_instancing: the attributes differ in length".into());
    }
    let vector = |e: &Option<Elements<'_>>, i, default| match e {
        Some(e) => DVec3::from_array(e.floats::<3>(i).map(f64::from)),
        None => default,
    };
    let place = |i| {
        let q = rotation.as_ref().map_or(DQuat::IDENTITY, |e| DQuat::from_array(e.floats::<4>(i).map(f64::from)));
        let q = q.normalize();
        let place = DAffine3::from_scale_rotation_translation(
            vector(&scale, i, DVec3::ONE),
            if q.is_finite() { q } else { return Err(format!("instance {i}: the rotation has length zero")) },
            vector(&translation, i, DVec3::ZERO),
        );
        if place.is_finite() { Ok(place) } else { Err(format!("instance {i}: translation or scale is not finite")) }
    };
    (0..count).map(place).collect::<Result<Vec<_>, _>>().map(Some)
}
