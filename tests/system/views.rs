//! Many views of one scene: what was prepared is kept and reused, and frames of an animation do not flicker.

use std::path::{Path, PathBuf};

use crate::common::{EYE, lit_room};
use base64::Engine;
use gsii::image;
use serde_json::{Value, json};

/// Runs the program in a folder.
fn gsii(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output =
        std::process::Command::new(env!("CARGO_BIN_EXE_gsii")).current_dir(folder).args(arguments).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// A small image of `room.gltf`.
const BASE: [&str; 10] =
    ["render", "room.gltf", "--width", "45", "--height", "30", "--spp", "4", "--measure-bias", "64"];

/// Renders a small image in a folder.
fn render(folder: &Path, arguments: &[&str]) -> String {
    let (code, text) = gsii(folder, &[&BASE[..], arguments].concat());
    assert_eq!(code, Some(0), "{text}");
    text
}

fn folder_with(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("room.gltf"), scene).unwrap();
    folder
}

fn stats(path: PathBuf) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// All that an image says but when it was written, as text: numbers are printed so that they can be read back to the same bits.
fn everything(path: PathBuf) -> String {
    let (image, header) = image::read_with_metadata(&path).unwrap();
    let header: Vec<_> = header.iter().filter(|(name, _)| *name != "DateTime").collect();
    format!("{:?} {header:?}", image.channels())
}

/// Adds linear keys for a property of a node.
fn animate(scene: &str, node: usize, property: &str, times: &[f32], values: &[f32]) -> String {
    let mut root: Value = serde_json::from_str(scene).unwrap();
    let count = |name: &str| root[name].as_array().map_or(0, Vec::len);
    let (buffer, view, accessor) = (count("buffers"), count("bufferViews"), count("accessors"));
    let bytes: Vec<u8> = times.iter().chain(values).flat_map(|x| x.to_le_bytes()).collect();
    let uri =
        format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(&bytes));
    let kind = if values.len() == 4 * times.len() { "VEC4" } else { "VEC3" };
    let mut add = |name: &str, values: Vec<Value>| match &mut root[name] {
        Value::Array(array) => array.extend(values),
        other => *other = values.into(),
    };
    add("buffers", vec![json!({"byteLength": bytes.len(), "uri": uri})]);
    let split = 4 * times.len();
    add(
        "bufferViews",
        vec![
            json!({"buffer": buffer, "byteLength": split}),
            json!({"buffer": buffer, "byteOffset": split, "byteLength": bytes.len() - split}),
        ],
    );
    add(
        "accessors",
        vec![
            json!({"bufferView": view, "componentType": 5126, "count": times.len(), "type": "SCALAR"}),
            json!({"bufferView": view + 1, "componentType": 5126, "count": times.len(), "type": kind}),
        ],
    );
    let sampler = json!({"input": accessor, "output": accessor + 1});
    let channel = json!({"sampler": 0, "target": {"node": node, "path": property}});
    add("animations", vec![json!({"channels": [channel], "samplers": [sampler]})]);
    root.to_string()
}

/// The node of the camera in [`lit_room`].
fn camera_node(scene: &str) -> usize {
    let root: Value = serde_json::from_str(scene).unwrap();
    root["nodes"].as_array().unwrap().iter().position(|node| node.get("camera").is_some()).unwrap()
}

/// The lit room with a camera that goes a few steps aside within a quarter of a second.
fn flight() -> String {
    let room = lit_room();
    let end = [EYE[0] - 0.5, EYE[1] + 0.2, EYE[2] - 0.3];
    animate(&room, camera_node(&room), "translation", &[0.0, 0.25], &[EYE, end].concat())
}

/// What breaks a file.
type Damage<'a> = &'a dyn Fn(&mut Vec<u8>);

/// Makes changes to what is in the cache folder.
fn change_files(folder: &Path, change: impl Fn(&mut Vec<u8>)) -> usize {
    let files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    for file in &files {
        let mut bytes = std::fs::read(file).unwrap();
        change(&mut bytes);
        std::fs::write(file, bytes).unwrap();
    }
    files.len()
}

#[test]
fn a_kept_preparation_gives_the_same_bytes_and_a_damaged_one_is_made_again() {
    let folder = folder_with(&lit_room());
    let path = |name: &str| folder.path().join(name);
    let content = |name: &str| everything(path(name));
    render(folder.path(), &["-o", "without.exr"]);
    let with_cache = |name: &str, more: &[&str]| {
        let (image, report) = (format!("{name}.exr"), format!("{name}.json"));
        let text = render(folder.path(), &[&["--cache", "kept", "-o", &image, "--stats", &report], more].concat());
        let fetched = stats(path(&report))["cache"].clone();
        (content(&image), fetched["simplify"].clone(), fetched["radiosity"].clone(), text)
    };
    let original = content("without.exr");
    let (first, simplify, radiosity, _) = with_cache("first", &[]);
    assert_eq!((&simplify, &radiosity), (&json!("miss"), &json!("miss")));
    let (second, simplify, radiosity, _) = with_cache("second", &[]);
    assert_eq!((&simplify, &radiosity), (&json!("hit"), &json!("hit")));
    assert_eq!(stats(path("second.json"))["rays"]["radiosity"], 0);
    assert!(first == original && second == original, "the cache changes the image");

    // What does not matter for a stage does not make it anew; what matters does.
    let (_, simplify, radiosity, _) = with_cache("lights", &["--sky"]);
    assert_eq!((&simplify, &radiosity), (&json!("hit"), &json!("miss")));
    let (_, simplify, ..) = with_cache("beta", &["--beta", "0.01"]);
    assert_eq!(simplify, json!("miss"));
    let (_, simplify, ..) = with_cache("seed", &["--seed", "5"]);
    assert_eq!(simplify, json!("miss"));
    std::fs::write(path("room.gltf"), lit_room().replace("0.5,0.5,0.5,1.0", "0.5,0.5,0.4,1.0")).unwrap();
    let (changed, simplify, ..) = with_cache("scene", &[]);
    assert_eq!(simplify, json!("miss"));
    assert!(changed != original);
    std::fs::write(path("room.gltf"), lit_room()).unwrap();

    let kept = path("kept");
    let damages: [Damage<'_>; 4] = [
        &|bytes| bytes.truncate(bytes.len() / 2),
        &|bytes| {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 0x10;
        },
        &|bytes| bytes.clear(),
        &|bytes| *bytes = b"something else".to_vec(),
    ];
    for (i, damage) in damages.into_iter().enumerate() {
        assert!(change_files(&kept, damage) >= 2);
        let (again, simplify, radiosity, text) = with_cache("again", &[]);
        assert_eq!((&simplify, &radiosity), (&json!("miss"), &json!("miss")), "damage {i}");
        assert!(text.contains("made again"), "damage {i} is not mentioned: {text}");
        assert!(again == original, "damage {i} changes the image");
    }
}

#[test]
fn frames_are_prepared_once_skipped_when_there_and_the_same_wherever_they_are_rendered() {
    let folder = folder_with(&flight());
    let path = |name: &str| folder.path().join(name);
    let content = |name: &str| everything(path(name));
    let frames = |range: &str, more: &[&str]| {
        render(folder.path(), &[&["--frames", range, "--cache", "kept", "-o", "a-##.exr"], more].concat())
    };
    frames("0-6:2", &["--stats", "a-%02d.json"]);
    let files = ["a-00.exr", "a-02.exr", "a-04.exr", "a-06.exr"].map(content);
    assert!(files.windows(2).all(|pair| pair[0] != pair[1]));
    let spent = |name: &str, stage: &str| stats(path(name))["seconds"][stage].as_f64().unwrap();
    for stage in ["load", "simplify", "radiosity", "flight"] {
        assert!(spent("a-00.json", stage) > 0.0, "{stage}");
        assert_eq!(spent("a-02.json", stage), 0.0, "{stage}");
    }
    let parameters = |name: &str| stats(path(name))["parameters"].clone();
    for shared in ["r_thresh", "patch_size"] {
        assert_eq!(parameters("a-00.json")[shared], parameters("a-06.json")[shared]);
    }
    assert_eq!(parameters("a-06.json")["frame"], 6);

    // One of them by itself, without a pattern, on another machine of the farm: with the cache and without.
    render(folder.path(), &["--frames", "4", "--cache", "kept", "-o", "single.exr", "--stats", "single.json"]);
    render(folder.path(), &["--frames", "4", "-o", "alone.exr"]);
    assert!(content("single.exr") == files[2] && content("alone.exr") == files[2], "a frame depends on the others");
    let fetched = stats(path("single.json"))["cache"].clone();
    assert_eq!(fetched, json!({"simplify": "hit", "radiosity": "hit", "flight": "hit"}));

    std::fs::write(path("a-02.exr"), b"kept as it is").unwrap();
    std::fs::remove_file(path("a-04.exr")).unwrap();
    let text = frames("0-6:2", &[]);
    assert!(text.contains("3 of 4 frames are there already"), "{text}");
    assert!(std::fs::read(path("a-02.exr")).unwrap() == b"kept as it is" && content("a-04.exr") == files[2]);
    frames("2", &["--overwrite"]);
    assert!(content("a-02.exr") == files[1]);

    // A frame that time ran out for is there, or not even begun; --resume finishes it either way.
    for limit in ["0.001", "0.01", "0.03"] {
        let all = [&BASE[..], &["--frames", "2", "--overwrite", "--time-limit", limit, "-o", "a-##.exr"]].concat();
        gsii(folder.path(), &all);
        if path("a-02.exr.checkpoint").exists() {
            frames("0-6:2", &["--resume"]);
            assert!(content("a-02.exr") == files[1], "{limit}");
        }
    }

    let (code, text) = gsii(folder.path(), &["render", "room.gltf", "--frames", "0-1", "-o", "a.exr"]);
    assert_eq!(code, Some(2));
    assert!(text.contains("'####'"), "{text}");
}

/// Red, green and blue of a layer, one after the other.
fn channels(path: &Path, names: [&str; 3]) -> Vec<f64> {
    let image = image::read(path).unwrap();
    names.iter().flat_map(|name| image.channel(name).unwrap().iter().map(|&x| f64::from(x))).collect()
}

/// Eight frames of a still camera: what changes from frame to frame is the noise that each image states for itself, no more, and it
/// does change.
#[test]
fn still_frames_vary_by_their_noise() {
    const FRAMES: usize = 8;
    let folder = folder_with(&lit_room());
    render(folder.path(), &["--frames", "0-7", "-o", "a-#.exr"]);
    let files: Vec<PathBuf> = (0..FRAMES).map(|i| folder.path().join(format!("a-{i}.exr"))).collect();
    for (layer, deviation) in [
        (["hires.R", "hires.G", "hires.B"], ["hires_dev.R", "hires_dev.G", "hires_dev.B"]),
        (["lores.R", "lores.G", "lores.B"], ["lores_dev.R", "lores_dev.G", "lores_dev.B"]),
    ] {
        let frames: Vec<Vec<f64>> = files.iter().map(|f| channels(f, layer)).collect();
        let stated: Vec<Vec<f64>> = files.iter().map(|f| channels(f, deviation)).collect();
        let pixels = frames[0].len() / 3;
        // Of each pixel: variance over frames minus the mean of the stated variances, in the mean of the bands.
        let (mut temporal, mut spatial, mut excess) = (0.0, 0.0, Vec::new());
        for p in 0..pixels {
            let of_band = |i: usize| {
                let n = FRAMES as f64;
                let mean = frames.iter().map(|f| f[i]).sum::<f64>() / n;
                let variance = frames.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                let stated = stated.iter().map(|f| f[i].powi(2)).sum::<f64>() / n;
                [variance, stated]
            };
            let bands = [0, 1, 2].map(|c| of_band(c * pixels + p));
            let sum = |k: usize| bands.iter().map(|b| b[k]).sum::<f64>() / 3.0;
            temporal += sum(0);
            spatial += sum(1);
            excess.push(sum(0) - sum(1));
        }
        let mean = excess.iter().sum::<f64>() / pixels as f64;
        let variance = excess.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (pixels - 1) as f64;
        let error = (variance / pixels as f64).sqrt();
        println!("{}: temporal over spatial variance {:.3}", layer[0], temporal / spatial);
        // One false alarm in 1e6 for independent pixels.
        assert!(mean <= 4.75 * error, "{}: frames differ by more than their noise: {mean} +- {error}", layer[0]);
        assert!(temporal > 0.1 * spatial, "{}: the noise stands still", layer[0]);
    }
}

/// With a lamp that moves every frame is prepared anew; what one shows does not depend on the others.
#[test]
fn moving_nodes_are_prepared_for_each_frame() {
    let room = lit_room();
    let lamp = camera_node(&room) - 1;
    let moves = [[0.0_f32; 3], [0.0, 0.0, 2.0]].concat();
    let folder = folder_with(&animate(&room, lamp, "translation", &[0.1, 0.2], &moves));
    let content = |name: &str| everything(folder.path().join(name));
    render(folder.path(), &["--fps", "10", "--frames", "0-3", "-o", "a-#.exr", "--stats", "a-#.json"]);
    render(folder.path(), &["--fps", "10", "--frames", "2", "-o", "alone.exr"]);
    assert!(content("alone.exr") == content("a-2.exr"));
    let spent = |i: u32| stats(folder.path().join(format!("a-{i}.json")))["seconds"]["radiosity"].as_f64().unwrap();
    // Before the first key and after the last one nothing moves.
    assert!(spent(0) > 0.0 && spent(1) == 0.0 && spent(2) > 0.0 && spent(3) == 0.0);
    let brightness = |i: u32| {
        let picture = channels(&folder.path().join(format!("a-{i}.exr")), ["R", "G", "B"]);
        picture.iter().sum::<f64>()
    };
    let (before, after) = (brightness(0), brightness(2));
    assert!((after / before - 1.0).abs() > 0.02, "the lamp has moved: {before} {after}");
}
