//! Small files made here, so that the tests need no others.

use std::path::Path;

use base64::Engine;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::*;
use crate::scene::{Alpha, LightKind, Projection};

pub(super) fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// A triangle (0,0,0) (1,0,0) (0,1,0), its positions twice (the second time with z = 1) and 16 bit indices.
pub(super) fn triangle() -> Value {
    let mut bytes = Vec::new();
    for z in [0.0_f32, 1.0] {
        for v in [0.0, 0.0, z, 1.0, 0.0, z, 0.0, 1.0, z] {
            bytes.extend(v.to_le_bytes());
        }
    }
    bytes.extend([0_u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 36},
            {"buffer": 0, "byteOffset": 72, "byteLength": 6},
        ],
        "buffers": [{"byteLength": 78, "uri": data_uri(&bytes)}],
    })
}

fn load_json(value: &Value) -> crate::error::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    load(&path, &LoadOptions::default())
}

fn refused(value: &Value) -> String {
    load_json(value).expect_err("must be refused").to_string()
}

#[test]
fn a_triangle_loads() {
    let scene = load_json(&triangle()).unwrap();
    assert_eq!(scene.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(scene.centre, DVec3::new(0.5, 0.5, 0.0));
    assert_eq!(scene.mesh.normal(0), Vec3::Z);
    assert_eq!((scene.materials[0].metallic, scene.materials[0].roughness), (1.0, 1.0));
    assert_eq!(scene.cameras.len(), 1);
}

#[test]
fn side_files_are_found_and_missing_ones_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut value = triangle();
    let uri = value["buffers"][0]["uri"].as_str().unwrap().to_string();
    let bytes = base64::engine::general_purpose::STANDARD.decode(uri.split_once(',').unwrap().1).unwrap();
    value["buffers"][0]["uri"] = json!("a%20b%C3%A9.bin");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    let missing = load(&path, &LoadOptions::default()).unwrap_err().to_string();
    assert!(missing.contains("a bé.bin"), "{missing}");
    std::fs::write(folder.path().join("a bé.bin"), &bytes[..77]).unwrap();
    let short = load(&path, &LoadOptions::default()).unwrap_err().to_string();
    assert!(short.contains("78") && short.contains("77"), "{short}");
    std::fs::write(folder.path().join("a bé.bin"), &bytes).unwrap();
    assert_eq!(load(&path, &LoadOptions::default()).unwrap().mesh.triangles.len(), 1);
    assert!(load(Path::new("/nonexistent.glb"), &LoadOptions::default()).is_err());
}

#[test]
fn transforms_compose_in_double_precision() {
    let mut value = triangle();
    value["nodes"] = json!([
        {"children": [1], "translation": [100000000.25, 0.0, 0.0]},
        {"mesh": 0, "rotation": [0.0, 0.0, 1.0, 1.0], "scale": [2.0, 1.0, 1.0]},
    ]);
    let scene = load_json(&value).unwrap();
    // A quarter turn about z: x becomes y, y becomes -x.
    assert!((scene.centre - DVec3::new(100_000_000.25 - 0.5, 1.0, 0.0)).length() < 1e-7, "{}", scene.centre);
    assert!((scene.mesh.bounds.size() - Vec3::new(1.0, 2.0, 0.0)).length() < 1e-6);
}

#[test]
fn morph_targets_and_skins_are_posed() {
    let mut value = triangle();
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 2}]);
    value["meshes"][0]["weights"] = json!([0.5]);
    let scene = load_json(&value).unwrap();
    // The target adds the triangle lifted to z = 1.
    assert_eq!(scene.mesh.bounds.size(), Vec3::new(1.5, 1.5, 0.0));
    assert_eq!(scene.centre.z, 0.5);

    let mut value = triangle();
    let mut bytes = vec![0_u8; 12];
    bytes.extend([1.0_f32, 0.0, 0.0, 0.0].repeat(3).iter().flat_map(|w| w.to_le_bytes()));
    value["buffers"].as_array_mut().unwrap().push(json!({"byteLength": 60, "uri": data_uri(&bytes)}));
    let views = value["bufferViews"].as_array_mut().unwrap();
    views.push(json!({"buffer": 1, "byteLength": 12}));
    views.push(json!({"buffer": 1, "byteOffset": 12, "byteLength": 48}));
    let accessors = value["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"bufferView": 3, "componentType": 5121, "count": 3, "type": "VEC4"}));
    accessors.push(json!({"bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC4"}));
    value["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4});
    value["skins"] = json!([{"joints": [1]}]);
    value["scenes"] = json!([{"nodes": [0, 1]}]);
    value["nodes"] = json!([{"mesh": 0, "skin": 0, "translation": [9.0, 9.0, 9.0]}, {"translation": [0.0, 0.0, 4.0]}]);
    let scene = load_json(&value).unwrap();
    assert_eq!(scene.centre, DVec3::new(0.5, 0.5, 4.0));
    assert!(scene.notes.warnings.iter().any(|w| w.contains("skinned")));
}

#[test]
fn lights_cameras_and_materials_arrive() {
    let mut value = triangle();
    value["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_volume", "XYZ_unknown"]);
    value["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 3.0, "color": [1.0, 0.5, 0.0], "spot": {}, "extras": {"a": 1}}]}});
    value["nodes"] = json!([{"mesh": 0, "children": [1, 2]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0.0, 0.0, 5.0]},
        {"camera": 0, "name": "eye"}]);
    value["cameras"] = json!([{"type": "orthographic",
        "orthographic": {"xmag": 2.0, "ymag": 1.0, "zfar": 9.0, "znear": 0.0}}]);
    value["materials"] = json!([{"name": "m", "alphaMode": "MASK", "emissiveFactor": [1.0, 1.0, 0.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 7.0},
            "KHR_materials_transmission": {"transmissionFactor": 0.5},
            "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2.0, "extras": {}}}}]);
    value["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = load_json(&value).unwrap();
    let light = &scene.lights[0];
    assert_eq!(light.intensity, Vec3::new(3.0, 1.5, 0.0));
    let LightKind::Spot { position, direction, .. } = light.kind else { panic!("{light:?}") };
    assert_eq!((position, direction), (Vec3::new(-0.5, -0.5, 5.0), Vec3::NEG_Z));
    assert_eq!(scene.cameras[0].name, "eye");
    assert_eq!(scene.cameras[0].projection, Projection::Orthographic { x_mag: 2.0, y_mag: 1.0 });
    let m = &scene.materials[0];
    assert_eq!((m.emission, m.alpha), (Vec3::new(7.0, 7.0, 0.0), Alpha::Mask { cutoff: 0.5 }));
    assert!(m.refracts && m.transmission == 0.5 && m.attenuation_distance == 2.0);
    assert_eq!(scene.notes.warnings.iter().filter(|w| w.contains("XYZ_unknown")).count(), 1);
}

/// Textures of extensions of materials arrive with their coding, and what they say is seen where it is looked for.
#[test]
fn extension_textures_arrive() {
    let mut value = triangle();
    // Two texels side by side: black, and red half as bright as it can be encoded.
    value["images"] = json!([{"name": "t.ppm", "uri": data_uri(b"P6 2 1 255\n\0\0\0\x80\0\0")}]);
    value["textures"] = json!([{"source": 0, "sampler": 0}]);
    value["samplers"] = json!([{"wrapS": 33071, "wrapT": 33071}]);
    value["materials"] = json!([{"extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1.0, "transmissionTexture": {"index": 0}},
        "KHR_materials_specular": {"specularTexture": {"index": 0}, "specularColorTexture": {"index": 0}},
        "KHR_materials_volume": {"thicknessFactor": 0.1, "thicknessTexture": {"index": 0}}}}]);
    value["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = load_json(&value).unwrap();
    assert_eq!(scene.notes.warnings, Vec::<String>::new());
    let m = &scene.materials[0];
    let read = |slot: &Option<crate::scene::TextureSlot>| {
        let texture = &scene.textures[slot.as_ref().unwrap().texture as usize];
        [0.0, 1.0].map(|u| texture.sample(glam::Vec2::new(u, 0.5)).to_array())
    };
    let byte = 128.0 / 255.0;
    assert_eq!(read(&m.transmission_texture), [[0.0, 0.0, 0.0, 1.0], [byte, 0.0, 0.0, 1.0]]);
    assert_eq!(m.specular_texture, m.transmission_texture);
    assert_eq!(read(&m.specular_color_texture)[1][0], crate::srgb::srgb_decode(byte));
}

#[test]
fn instances_are_flattened() {
    let mut value = triangle();
    value["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    // The positions of the triangle serve as three translations.
    value["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}});
    let scene = load_json(&value).unwrap();
    assert_eq!((scene.mesh.triangles.len(), scene.mesh.objects.len()), (3, 3));
    assert_eq!(scene.mesh.bounds.size(), Vec3::new(2.0, 2.0, 0.0));
    assert_eq!(scene.centre.z, 1.0);
}

/// What a broken file does to [`triangle`], and a word that the reason must contain.
type Damage = (fn(&mut Value), &'static str);

#[test]
fn broken_files_are_refused_with_a_reason() {
    let damages: &[Damage] = &[
        (|v| v["asset"]["version"] = json!("1.0"), "1.0"),
        (|v| v["extensionsRequired"] = json!(["ABC_new"]), "ABC_new"),
        (|v| v["scenes"][0]["nodes"] = json!([7]), "scenes[0].nodes[0]"),
        (|v| v["nodes"][0]["children"] = json!([0]), "child"),
        (|v| v["nodes"] = json!([{"children": [1]}, {"children": [0]}]), "descendant"),
        (|v| v["nodes"] = json!([{"children": [2]}, {"children": [2]}, {}]), "parents"),
        (|v| v["nodes"][0]["rotation"] = json!([0, 0, 0, 0]), "length zero"),
        (|v| v["nodes"][0]["matrix"] = json!(vec![0; 16]), "matrix"),
        (|v| v["accessors"][0]["count"] = json!(4), "fit"),
        (|v| v["accessors"][0]["count"] = json!(u64::MAX), "fit"),
        (|v| v["accessors"][0]["byteOffset"] = json!(u64::MAX), "fit"),
        (|v| v["accessors"][0]["componentType"] = json!(1), "componentType"),
        (|v| v["accessors"][0]["type"] = json!("VEC2"), "POSITION"),
        (|v| v["accessors"][1]["componentType"] = json!(5122), "indices"),
        (|v| v["bufferViews"][0]["byteLength"] = json!(1_u64 << 40), "past"),
        (|v| v["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "past"),
        (|v| v["bufferViews"][0]["byteStride"] = json!(4), "byteStride"),
        (|v| v["buffers"][0]["byteLength"] = json!(79), "79"),
        (|v| v["buffers"][0] = json!({"byteLength": 78}), "no data"),
        (|v| v["buffers"][0]["uri"] = json!("http://example.org/x.bin"), "http"),
        (|v| v["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99), "99"),
        (|v| v["meshes"][0]["primitives"][0]["mode"] = json!(0), "nothing to render"),
        (
            |v| {
                v["accessors"][0] = json!({"componentType": 5126, "count": 4_000_000_000_u64, "type": "VEC3",
                    "sparse": {"count": 1, "indices": {"bufferView": 2, "componentType": 5123},
                        "values": {"bufferView": 0}}});
            },
            "without a bufferView",
        ),
        (
            |v| {
                v["materials"] = json!([{"name": "bright",
                    "pbrMetallicRoughness": {"baseColorFactor": [1.5, 1.0, 1.0, 1.0]}}]);
            },
            "bright",
        ),
        (
            |v| {
                v["images"] = json!([{"uri": "none.png"}]);
                v["textures"] = json!([{"source": 0}]);
                v["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
            },
            "none.png",
        ),
        (
            |v| {
                v["images"] = json!([{"uri": "data:image/png;base64,iVBORw0KGgo=", "name": "torn"}]);
                v["textures"] = json!([{"source": 0}]);
                v["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
            },
            "torn",
        ),
    ];
    for (i, (damage, word)) in damages.iter().enumerate() {
        let mut value = triangle();
        damage(&mut value);
        let reason = refused(&value);
        assert!(reason.contains(word), "damage {i}: '{word}' is not in: {reason}");
    }
}

#[test]
fn deep_hierarchies_do_not_overflow_the_stack() {
    let mut value = triangle();
    let n = 200_000;
    let mut nodes: Vec<Value> = (1..n).map(|i| json!({"children": [i]})).collect();
    nodes.push(json!({"mesh": 0}));
    value["nodes"] = json!(nodes);
    assert_eq!(load_json(&value).unwrap().mesh.triangles.len(), 1);
}

#[test]
fn every_byte_may_be_wrong() {
    // Flipping bytes anywhere must give a scene or an error, never a panic.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    let text = triangle().to_string().into_bytes();
    for i in 0..text.len() {
        let mut broken = text.clone();
        broken[i] = match broken[i] {
            b'0'..=b'8' => broken[i] + 1,
            b'"' => b'9',
            other => other ^ 1,
        };
        std::fs::write(&path, &broken).unwrap();
        let _ = load(&path, &LoadOptions::default());
    }
}
