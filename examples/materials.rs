//! Writes a scene of all that materials can do: five balls on a checkered floor, of rough metal, rough glass, glass that absorbs, lacquer
//! over a normal map, and a mirror; and an image to put around it.
//!
//!     cargo run --release --example materials -- FOLDER
//!     gsii render FOLDER/materials.gltf --environment FOLDER/surroundings.exr -o materials.png

use std::f32::consts::{PI, TAU};
use std::path::Path;

use base64::Engine;
use gsii::image::{self, Image, Metadata, WriteOptions};
use serde_json::{Value, json};

/// Vertices of a ball along its equator and from pole to pole.
const AROUND: u32 = 64;
const DOWN: u32 = 32;
/// Texels along each side of the normal map.
const BUMPS: u32 = 256;
/// Size of the image of the surroundings.
const SKY: [u32; 2] = [256, 128];

/// Where each ball stands and the glTF material that it is made of, from left to right.
pub fn balls() -> [(f32, Value); 5] {
    let metal = |roughness: f32, color: [f32; 3]| {
        let [r, g, b] = color;
        json!({"pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 1.0, "roughnessFactor": roughness}})
    };
    let glass = |roughness: f32, color: [f32; 3], distance: f32| {
        json!({"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": roughness},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_volume":
                {"thicknessFactor": 1.0, "attenuationColor": color, "attenuationDistance": distance}}})
    };
    let lacquer = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.03, 0.02, 1.0], "metallicFactor": 0.0,
            "roughnessFactor": 0.25}, "normalTexture": {"index": 1}});
    [
        (-2.4, metal(0.45, [0.95, 0.7, 0.35])),
        (-1.2, glass(0.35, [1.0; 3], 1.0)),
        (0.0, glass(0.0, [0.1, 0.6, 0.4], 0.6)),
        (1.2, lacquer),
        (2.4, metal(0.0, [0.9, 0.9, 0.92])),
    ]
}

/// Positions, texture coordinates and triangles.
type Ball = (Vec<[f32; 3]>, Vec<[f32; 2]>, Vec<[u32; 3]>);

/// Positions and normals (equal but for the radius), texture coordinates and triangles of a ball of radius 0.5.
fn ball() -> Ball {
    let (mut normals, mut uvs, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=DOWN {
        for k in 0..=AROUND {
            let (u, v) = (k as f32 / AROUND as f32, i as f32 / DOWN as f32);
            let ((sin, cos), (height, width)) = ((-TAU * u).sin_cos(), ((PI * v).cos(), (PI * v).sin()));
            normals.push([width * cos, height, width * sin]);
            uvs.push([4.0 * u, 2.0 * v]);
        }
    }
    for i in 0..DOWN {
        for k in 0..AROUND {
            let at = i * (AROUND + 1) + k;
            let below = at + AROUND + 1;
            triangles.extend([[at, below, below + 1], [at, below + 1, at + 1]]);
        }
    }
    (normals, uvs, triangles)
}

fn data(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// An image as a portable pixmap.
fn pixmap(side: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> String {
    let mut bytes = format!("P6 {side} {side} 255\n").into_bytes();
    bytes.extend((0..side * side).flat_map(|i| texel(i % side, i / side)));
    data("image/x-portable-pixmap", &bytes)
}

/// Round dimples in rows.
fn bumps() -> String {
    pixmap(BUMPS, |x, y| {
        let at = |i: u32| (4.0 * (i as f32 + 0.5) / BUMPS as f32).fract() - 0.5;
        let (x, y) = (at(x), at(y));
        let slope = if x.hypot(y) < 0.4 { 1.6 } else { 0.0 };
        let [nx, ny] = [slope * x, -slope * y];
        [nx, ny, (1.0 - nx * nx - ny * ny).sqrt()].map(|n| (127.5 * n + 128.0) as u8)
    })
}

/// The scene as glTF text.
pub fn gltf() -> String {
    let (normals, uvs, triangles) = ball();
    let floor = [[-12.0, -0.5, -12.0], [-12.0, -0.5, 12.0], [12.0, -0.5, 12.0], [12.0, -0.5, -12.0_f32]];
    let floor_uvs = [[0.0, 0.0], [0.0, 12.0], [12.0, 12.0], [12.0, 0.0_f32]];
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let indices = |triangles: &[[u32; 3]]| triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
    let positions: Vec<f32> = normals.as_flattened().iter().map(|n| 0.5 * n).collect();
    let parts: [(Vec<u8>, u32, usize, &str); 7] = [
        (floats(&positions), 5126, normals.len(), "VEC3"),
        (floats(normals.as_flattened()), 5126, normals.len(), "VEC3"),
        (floats(uvs.as_flattened()), 5126, uvs.len(), "VEC2"),
        (indices(&triangles), 5125, 3 * triangles.len(), "SCALAR"),
        (floats(floor.as_flattened()), 5126, 4, "VEC3"),
        (floats(floor_uvs.as_flattened()), 5126, 4, "VEC2"),
        (indices(&[[0, 1, 2], [0, 2, 3]]), 5125, 6, "SCALAR"),
    ];
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (part, component, count, kind)) in parts.iter().enumerate() {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": part.len()}));
        let mut accessor = json!({"bufferView": i, "componentType": component, "count": count, "type": kind});
        match i {
            0 => (accessor["min"], accessor["max"]) = (json!([-0.5, -0.5, -0.5]), json!([0.5, 0.5, 0.5])),
            4 => (accessor["min"], accessor["max"]) = (json!(floor[0]), json!(floor[2])),
            _ => (),
        }
        accessors.push(accessor);
        bytes.extend(part);
    }
    let mut materials = vec![json!({"name": "floor", "pbrMetallicRoughness":
        {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 0.6}})];
    let mut meshes =
        vec![json!({"primitives": [{"attributes": {"POSITION": 4, "TEXCOORD_0": 5}, "indices": 6, "material": 0}]})];
    let mut nodes = vec![json!({"mesh": 0, "name": "floor"})];
    for (i, (x, material)) in balls().into_iter().enumerate() {
        materials.push(material);
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3,
            "material": i + 1}]}));
        nodes.push(json!({"mesh": i + 1, "name": format!("ball {i}"), "translation": [x, 0.0, 0.0]}));
    }
    // Looks down by ten degrees.
    let half = (-5.0_f32).to_radians();
    nodes.push(
        json!({"name": "eye", "camera": 0, "translation": [0.0, 1.0, 6.5], "rotation": [half.sin(), 0.0, 0.0, half.cos()]}),
    );
    let checks = pixmap(64, |x, y| if (x / 32 + y / 32) % 2 == 0 { [200, 196, 188] } else { [70, 74, 82] });
    json!({
        "asset": {"version": "2.0", "generator": "gsii, examples/materials.rs"},
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_volume"],
        "buffers": [{"byteLength": bytes.len(), "uri": data("application/octet-stream", &bytes)}],
        "bufferViews": views, "accessors": accessors, "meshes": meshes, "materials": materials,
        "images": [{"name": "checks.ppm", "uri": checks}, {"name": "bumps.ppm", "uri": bumps()}],
        "textures": [{"source": 0}, {"source": 1}],
        "cameras": [{"type": "perspective", "name": "eye",
            "perspective": {"yfov": 0.45, "aspectRatio": 2.4, "znear": 0.01}}],
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}], "nodes": nodes, "scene": 0,
    })
    .to_string()
}

/// Radiance from outside at `x`, `y` in 0..1 of a latitude-longitude image: a pale sky over grey ground, a window and a low sun.
pub fn surroundings(x: f32, y: f32) -> [f32; 3] {
    let spot = |at: [f32; 2], radius: f32| (-((x - at[0]).hypot(0.5 * (y - at[1])) / radius).powi(2)).exp();
    let sky = if y < 0.5 { [0.5 + 0.4 * y, 0.7 + 0.3 * y, 1.1] } else { [0.25, 0.24, 0.22] };
    let (sun, window) = (60.0 * spot([0.62, 0.3], 0.02), 6.0 * spot([0.95, 0.25], 0.05));
    [sky[0] + sun + window, sky[1] + 0.9 * sun + window, sky[2] + 0.7 * sun + window]
}

/// Writes both files into a folder.
pub fn write(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("materials.gltf"), gltf())?;
    let [width, height] = SKY;
    let mut map = Image::new(width, height);
    for (band, name) in ["R", "G", "B"].into_iter().enumerate() {
        let at = |i: u32| {
            let [x, y] = [(i % width) as f32 / width as f32, (i / width) as f32 / height as f32];
            surroundings(x + 0.5 / width as f32, y + 0.5 / height as f32)[band]
        };
        map.push(name, (0..width * height).map(at).collect());
    }
    image::write(&folder.join("surroundings.exr"), &map, &Metadata::default(), &WriteOptions::default())?;
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("which folder?")?;
    write(Path::new(&folder))
}
