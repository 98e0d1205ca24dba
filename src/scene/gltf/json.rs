//! The JSON part of glTF: version and extension checks, parsing, and index checks.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::Root;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use serde::Deserialize;
use serde_json::Value;

/// Extensions that are implemented. Others are refused when required and warned about when used.
const SUPPORTED: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A parsed document, all indices in range.
pub(super) struct Document {
    /// The document as the `gltf` crate sees it, without `extras`.
    pub root: Root,
    /// Where each node stands in its parent, in double precision.
    pub transforms: Vec<Transform>,
    /// Names of used extensions that are not supported.
    pub ignored: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Asset,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Asset {
    version: String,
    min_version: Option<String>,
}

/// A node's transform in f64: the `gltf` crate rounds to f32, which moves what stands far from the origin.
#[derive(Clone, Deserialize)]
pub(super) struct Transform {
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    /// Quaternion x, y, z, w of any length.
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct Transforms {
    #[serde(default)]
    nodes: Vec<Transform>,
}

impl Document {
    /// Parses and checks the JSON text.
    pub(super) fn parse(text: &[u8]) -> Result<Document, String> {
        let mut value: Value = serde_json::from_slice(text).map_err(|e| format!("the JSON is broken: {e}"))?;
        if let Value::Object(root) = &value
            && !root.get("asset").and_then(|a| a.get("version")).is_some_and(Value::is_string)
        {
            return Err("asset.version is missing or no string: this is not glTF 2.0".into());
        }
        let head: Head = typed(&value)?;
        check_version(&head.asset)?;
        let unknown = |name: &&String| !SUPPORTED.contains(&name.as_str());
        if let Some(name) = head.extensions_required.iter().find(unknown) {
            return Err(format!(
                "the file requires the extension {name}, which is not supported; export it without, or convert it"
            ));
        }
        let mut ignored: Vec<String> = head.extensions_used.iter().filter(unknown).cloned().collect();
        ignored.sort();
        ignored.dedup();
        let transforms: Transforms = typed(&value)?;
        prepare(&mut value);
        let root: Root = typed(&value)?;
        check_indices(&root)?;
        Ok(Document { root, transforms: transforms.nodes, ignored })
    }
}

/// Deserialises, naming the place of a mistake by its JSON path.
fn typed<'a, T: Deserialize<'a>>(value: &'a Value) -> Result<T, String> {
    serde_path_to_error::deserialize(value).map_err(|e| format!("bad glTF at {}: {}", e.path(), e.inner()))
}

fn check_version(asset: &Asset) -> Result<(), String> {
    let parse = |v: &str| -> Option<(u32, u32)> {
        let (major, minor) = v.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    let (Some((major, _)), minimum) = (parse(&asset.version), asset.min_version.as_deref().map(parse)) else {
        return Err(format!("asset.version '{}' is no version number", asset.version));
    };
    if major != 2 {
        return Err(format!("glTF version {} is not supported, only 2.x; convert the file", asset.version));
    }
    match minimum {
        None | Some(Some((2, 0))) => Ok(()),
        _ => Err(format!("the file needs glTF version {}", asset.min_version.as_deref().unwrap_or_default())),
    }
}

/// Makes the document acceptable to the `gltf` crate: without `extras` (its raw JSON values cannot be read inside
/// extensions) and with the arrays that it takes for mandatory although the specification does not.
fn prepare(value: &mut Value) {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(map) => {
                map.remove("extras");
                map.values_mut().for_each(strip);
            }
            Value::Array(array) => array.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(value);
    for animation in value.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            // Without a node it is for an extension to say what moves.
            channels.retain(|channel| channel.pointer("/target").is_none_or(|target| target.get("node").is_some()));
        }
    }
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Value::Object(scene) = scene {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    if let Some(lights) = value.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut) {
        for light in lights.iter_mut().filter_map(Value::as_object_mut) {
            light.remove("extensions");
        }
    }
}

/// Every index must refer to something. The crate's own validation does that, after a check that it forgets.
fn check_indices(root: &Root) -> Result<(), String> {
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            for (semantic, accessor) in &primitive.attributes {
                if accessor.value() >= root.accessors.len() {
                    let (a, n) = (accessor.value(), root.accessors.len());
                    let semantic = semantic.to_string();
                    return Err(format!("mesh {m}, primitive {p}: {semantic} refers to accessor {a} of {n}"));
                }
            }
        }
    }
    let mut first = None;
    root.validate(root, Default::default, &mut |path, fault| {
        let path = path().0;
        // Bounds are computed from the data, primitives without positions are skipped, required extensions and
        // strides are checked elsewhere, textures without an image when they are used.
        let elsewhere = fault == Fault::Unsupported
            || path.contains(".attributes")
            || path.contains("animations")
            || path.ends_with(".source")
            || path.ends_with(".byteStride") && fault != Fault::IndexOutOfBounds;
        let index = fault == Fault::IndexOutOfBounds;
        if (index || !elsewhere) && first.is_none() {
            first = Some(format!("bad glTF at {path}: {}", fault.to_string().to_lowercase()));
        }
    });
    match first {
        Some(reason) => Err(reason),
        None => Ok(()),
    }
}

impl Transform {
    /// As a map.
    pub(super) fn affine(&self) -> Result<DAffine3, String> {
        if let Some(m) = &self.matrix {
            let m = DMat4::from_cols_array(m);
            let affine = m.row(3).truncate() == DVec3::ZERO && m.w_axis.w == 1.0;
            return match m.is_finite() && affine {
                true => Ok(DAffine3::from_mat4(m)),
                false => Err("the matrix is not finite, or its last row is not 0 0 0 1".into()),
            };
        }
        let translation = self.translation.map_or(DVec3::ZERO, DVec3::from_array);
        let scale = self.scale.map_or(DVec3::ONE, DVec3::from_array);
        let rotation = self.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
        let length = rotation.length();
        if !(translation.is_finite() && scale.is_finite() && length.is_finite()) {
            return Err("translation, rotation or scale is not finite".into());
        }
        if length == 0.0 {
            return Err("the rotation is a quaternion of length zero".into());
        }
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
    }
}

/// The value of a [`Checked`] that validation has accepted.
pub(super) fn valid<T: Copy>(checked: &Checked<T>) -> Option<T> {
    match checked {
        Checked::Valid(value) => Some(*value),
        Checked::Invalid => None,
    }
}
