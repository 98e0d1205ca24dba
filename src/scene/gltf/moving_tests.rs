//! Animated files, made here.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::tests::{data_uri, triangle};
use super::*;

/// The triangle with a camera beside it, and keys for a property of a node.
fn moving(node: usize, path: &str, kind: &str, times: &[f32], values: &[f32]) -> Value {
    let mut value = triangle();
    let bytes: Vec<u8> = times.iter().chain(values).flat_map(|x| x.to_le_bytes()).collect();
    let width = match kind {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    };
    let split = 4 * times.len();
    let mut add = |list: &str, item: Value| value[list].as_array_mut().unwrap().push(item);
    add("nodes", json!({"camera": 0, "translation": [0.0, 0.0, 4.0]}));
    add("buffers", json!({"byteLength": bytes.len(), "uri": data_uri(&bytes)}));
    add("bufferViews", json!({"buffer": 1, "byteLength": split}));
    add("bufferViews", json!({"buffer": 1, "byteOffset": split, "byteLength": bytes.len() - split}));
    add("accessors", json!({"bufferView": 3, "componentType": 5126, "count": times.len(), "type": "SCALAR"}));
    add("accessors", json!({"bufferView": 4, "componentType": 5126, "count": values.len() / width, "type": kind}));
    value["scenes"][0]["nodes"] = json!([0, 1]);
    value["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let channel = json!({"sampler": 0, "target": {"node": node, "path": path}});
    value["animations"] = json!([{"channels": [channel], "samplers": [{"input": 3, "output": 4}]}]);
    value
}

fn written(value: &Value) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    (folder, path)
}

fn at(path: &Path, seconds: f64) -> Scene {
    let what = LoadOptions { seconds: Some(seconds), centre: Some(DVec3::ZERO), ..LoadOptions::default() };
    load(path, &what).unwrap()
}

#[test]
fn nodes_move() {
    let (_folder, path) = written(&moving(0, "translation", "VEC3", &[1.0, 3.0], &[0.0, 0.0, 0.0, 2.0, 0.0, 4.0]));
    for (seconds, x, z) in [(0.0, 0.0, 0.0), (2.0, 1.0, 2.0), (3.0, 2.0, 4.0), (5.0, 2.0, 4.0)] {
        assert_eq!(at(&path, seconds).mesh.positions[0].to_array(), [x, 0.0, z], "at {seconds} s");
    }
    let still = load(&path, &LoadOptions::default()).unwrap();
    assert_eq!(still.centre, DVec3::new(0.5, 0.5, 0.0), "without animation where the file says");
    let motion = Motion::read(&path).unwrap();
    assert_eq!(motion.span(), Some([1.0, 3.0]));
    let arrangement = |seconds| motion.arrangement(seconds).unwrap();
    assert_eq!(arrangement(0.0), arrangement(1.0));
    assert_ne!(arrangement(1.0), arrangement(1.5));
    assert_eq!(arrangement(3.0), arrangement(4.0));
}

#[test]
fn cameras_move_and_nothing_else_does() {
    let (_folder, path) = written(&moving(1, "translation", "VEC3", &[0.0, 1.0], &[0.0, 0.0, 4.0, 2.0, 1.0, 4.0]));
    let motion = Motion::read(&path).unwrap();
    assert_eq!(motion.arrangement(0.0).unwrap(), motion.arrangement(0.7).unwrap());
    for seconds in [0.0, 0.25, 1.0] {
        let centre = DVec3::new(0.5, 0.0, 0.0);
        let found = motion.cameras(seconds, centre).unwrap();
        let t = seconds as f32;
        assert_eq!(found[0].position.to_array(), [2.0 * t - 0.5, t, 4.0]);
        // As the scene has them when it is read at that moment.
        assert_eq!(motion.cameras(seconds, DVec3::ZERO).unwrap(), at(&path, seconds).cameras);
    }
}

#[test]
fn morph_weights_are_animated() {
    let mut value = moving(0, "weights", "SCALAR", &[0.0, 1.0], &[0.0, 1.0]);
    // The target adds the second set of positions.
    value["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 2}]);
    let (_folder, path) = written(&value);
    for t in [0.0, 0.5, 1.0] {
        let scene = at(&path, t);
        assert_eq!(scene.mesh.positions[1].to_array(), [1.0 + t as f32, 0.0, t as f32]);
    }
    let motion = Motion::read(&path).unwrap();
    assert_ne!(motion.arrangement(0.0).unwrap(), motion.arrangement(0.5).unwrap());
}

/// What breaks a file.
type Damage<'a> = &'a dyn Fn(&mut Value);

#[test]
fn broken_animations_are_refused_when_they_are_played() {
    let good = || moving(0, "translation", "VEC3", &[0.0, 1.0], &[0.0; 6]);
    let broken: [(&str, Damage<'_>); 6] = [
        ("ascend", &|v| *v = moving(0, "translation", "VEC3", &[1.0, 1.0], &[0.0; 6])),
        ("not finite", &|v| *v = moving(0, "scale", "VEC3", &[0.0, 1.0], &[f32::NAN; 6])),
        ("1 values for 2 keys", &|v| *v = moving(0, "translation", "VEC3", &[0.0, 1.0], &[0.0; 3])),
        ("node 9", &|v| v["animations"][0]["channels"][0]["target"]["node"] = json!(9)),
        ("cannot be", &|v| v["animations"][0]["channels"][0]["target"]["path"] = json!("rotation")),
        ("interpolation", &|v| v["animations"][0]["samplers"][0]["interpolation"] = json!("GUESS")),
    ];
    for (word, damage) in broken {
        let mut value = good();
        damage(&mut value);
        let (_folder, path) = written(&value);
        let what = LoadOptions { seconds: Some(0.5), ..LoadOptions::default() };
        for refusal in [load(&path, &what).err(), Motion::read(&path).err()] {
            let text = refusal.unwrap_or_else(|| panic!("'{word}' was accepted")).to_string();
            assert!(text.contains("animation 0, channel 0") && text.contains(word), "{text}");
        }
        load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("not played, it does no harm: {e}"));
    }
}
