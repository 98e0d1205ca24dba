//! Small scenes and statistics for the tests.

#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::path::PathBuf;
use std::sync::Arc;

use base64::Engine;
use gsii::pipeline::{Prepared, Settings, Stats, choose_camera};
use gsii::progress::Progress;
use gsii::render::{Film, RenderParams, Rendering};
use gsii::scene::{LoadOptions, Scene, load};
use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};

/// The folder `shared` beside the project, or beside a folder that holds it; prints that it skips where there is none.
pub fn shared() -> Option<PathBuf> {
    let project = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let found =
        project.ancestors().skip(1).take(2).map(|folder| folder.join("shared")).find(|f| f.join("scenes").is_dir());
    if found.is_none() {
        println!("skipped: there is no folder ../shared with scenes and references");
    }
    found
}

/// A closed mesh of one Lambertian material.
pub struct Body {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub reflectance: f32,
    pub radiance: f32,
}

impl Body {
    /// An axis-parallel box between two corners, its front faces outside, or inside for a room.
    pub fn block(low: [f32; 3], high: [f32; 3], inside: bool, reflectance: f32, radiance: f32) -> Body {
        let positions =
            (0..8).map(|i| std::array::from_fn(|axis| if i >> axis & 1 == 1 { high[axis] } else { low[axis] }));
        // Corners of each face, counter-clockwise from outside; bit k of a corner's number is its side along axis k.
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let triangles = triangles.map(|[a, b, c]| if inside { [a, c, b] } else { [a, b, c] });
        Body { positions: positions.collect(), triangles: triangles.collect(), reflectance, radiance }
    }
}

/// glTF text with its buffer inside, seen from a camera at `eye` that looks along -z.
pub fn gltf(bodies: &[Body], eye: [f32; 3]) -> String {
    let mut bytes: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut meshes, mut materials, mut nodes) = (vec![], vec![], vec![], vec![], vec![]);
    for (i, body) in bodies.iter().enumerate() {
        let low: [f32; 3] = std::array::from_fn(|a| body.positions.iter().map(|p| p[a]).fold(f32::INFINITY, f32::min));
        let high: [f32; 3] =
            std::array::from_fn(|a| body.positions.iter().map(|p| p[a]).fold(f32::NEG_INFINITY, f32::max));
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 12 * body.positions.len()}));
        bytes.extend(body.positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 12 * body.triangles.len()}));
        bytes.extend(body.triangles.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let count = body.positions.len();
        accessors.push(json!({"bufferView": 2 * i, "componentType": 5126, "count": count, "type": "VEC3", "min": low, "max": high}));
        accessors.push(json!({"bufferView": 2 * i + 1, "componentType": 5125, "count": 3 * body.triangles.len(), "type": "SCALAR"}));
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1, "material": i}]}));
        let [rho, strength] = [body.reflectance, body.radiance];
        materials.push(json!({
            "pbrMetallicRoughness": {"baseColorFactor": [rho, rho, rho, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0},
            "emissiveFactor": if strength > 0.0 { [1.0; 3] } else { [0.0; 3] },
            "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}, "KHR_materials_emissive_strength": {"emissiveStrength": strength}},
        }));
        nodes.push(json!({"mesh": i}));
    }
    nodes.push(json!({"name": "eye", "camera": 0, "translation": eye}));
    let uri =
        format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(&bytes));
    let root: Value = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength"],
        "buffers": [{"byteLength": bytes.len(), "uri": uri}],
        "bufferViews": views, "accessors": accessors, "meshes": meshes, "materials": materials,
        "cameras": [{"type": "perspective", "name": "eye", "perspective": {"yfov": 1.0, "aspectRatio": 1.5, "znear": 0.01}}],
        "nodes": nodes, "scene": 0, "scenes": [{"nodes": (0..=bodies.len()).collect::<Vec<_>>()}],
    });
    root.to_string()
}

/// A room of 4 x 3 x 5 with `radiance` on its walls and 75 small blocks of another reflectance on the floor.
pub fn cluttered_room(walls: f32, radiance: f32, clutter: f32) -> Vec<Body> {
    let mut bodies = vec![Body::block([0.0; 3], [4.0, 3.0, 5.0], true, walls, radiance)];
    for i in 0..75u32 {
        let (x, y, z) = (i % 5, i / 5 % 3, i / 15);
        let low = [1.2 + 0.13 * x as f32, 0.01 + 0.14 * y as f32, 1.5 + 0.13 * z as f32];
        let size = 0.07 + 0.004 * (i * 7 % 11) as f32;
        bodies.push(Body::block(low, low.map(|c| c + size), false, clutter, 0.0));
    }
    bodies
}

/// The eye in [`cluttered_room`].
pub const EYE: [f32; 3] = [2.0, 1.2, 4.6];

/// A dark-walled room with a lamp under the ceiling and clutter.
pub fn lit_room() -> String {
    let mut bodies = cluttered_room(0.6, 0.0, 0.5);
    bodies.push(Body::block([1.5, 2.8, 1.5], [2.5, 2.9, 2.5], false, 0.0, 10.0));
    gltf(&bodies, EYE)
}

/// Reads glTF text.
pub fn scene(text: &str) -> Arc<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, text).unwrap();
    Arc::new(load(&path, &LoadOptions::default()).unwrap())
}

/// Fixed sampling.
pub fn fixed(width: u32, height: u32, trials: u32, seed: u32) -> RenderParams {
    RenderParams {
        width,
        height,
        region: None,
        min_trials: trials,
        max_trials: trials,
        interpolate: false,
        error: f32::INFINITY,
        hires_error: 0.05,
        lores_error: 0.05,
        time_limit: None,
        features: false,
        seed,
        frame: None,
    }
}

/// As [`fixed`], with indirect light interpolated.
pub fn interpolated(width: u32, height: u32, trials: u32, seed: u32) -> RenderParams {
    RenderParams { interpolate: true, ..fixed(width, height, trials, seed) }
}

/// Everything before the first pixel, seen from the first camera.
pub fn prepare(scene: &Arc<Scene>, settings: Settings) -> (Prepared, Stats) {
    let mut stats = Stats::new();
    let camera = choose_camera(scene, None).unwrap().clone();
    let prepared = Prepared::new(Arc::clone(scene), &camera, settings, &Progress::silent(), &mut stats).unwrap();
    (prepared, stats)
}

/// Renders from the first camera.
pub fn render(prepared: &Prepared, params: &RenderParams) -> Rendering {
    prepared.render(&prepared.scene.cameras[0], params, &Progress::silent())
}

/// Radiance of every pixel and band.
pub fn values(film: &Film) -> Vec<f64> {
    film.pixels()
        .flat_map(|p| {
            let (h, l) = (p.hires.mean(), p.lores.mean());
            [h[0] + l[0], h[1] + l[1], h[2] + l[2]]
        })
        .collect()
}

/// Mean of some pixels over all bands, and its standard error.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    /// Of the pixels for which `inside` is true (column, row). The error comes from the two independent halves of the trials of
    /// each pixel and pass; pixels are independent of each other.
    pub fn of(film: &Film, inside: impl Fn(u32, u32) -> bool) -> Estimate {
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for (i, pixel) in film.pixels().enumerate() {
            let i = i as u32;
            if !inside(i % film.width, i / film.width) {
                continue;
            }
            let mean = |m: [f64; 3]| m.iter().sum::<f64>() / 3.0;
            sum += mean(pixel.hires.mean()) + mean(pixel.lores.mean());
            count += 1.0;
            let half =
                |pass: &gsii::render::film::PixelSum| pass.halves().map_or(0.0, |(a, b)| 0.5 * (mean(a) - mean(b)));
            if pixel.hires.trials() == pixel.lores.trials() {
                square += (half(&pixel.hires) + half(&pixel.lores)).powi(2);
            } else {
                // Passes share the trials that both have, so their errors may be correlated: the sum of both bounds it.
                square += (half(&pixel.hires).abs() + half(&pixel.lores).abs()).powi(2);
            }
        }
        Estimate { mean: sum / count, error: f64::sqrt(square) / count }
    }

    /// Of the whole image.
    pub fn whole(film: &Film) -> Estimate {
        Estimate::of(film, |_, _| true)
    }

    /// Standard errors between two independent estimates.
    pub fn z(self, other: Estimate) -> f64 {
        let error = self.error.hypot(other.error);
        let difference = self.mean - other.mean;
        if difference == 0.0 { 0.0 } else { difference / error }
    }
}

/// The |z| that the largest of `tests` two-sided tests exceeds with probability `alpha` (Sidak).
pub fn threshold(alpha: f64, tests: usize) -> f64 {
    let each = 1.0 - (1.0 - alpha).powf(1.0 / tests as f64);
    Normal::standard().inverse_cdf(1.0 - 0.5 * each)
}

/// Puts `text` into the part of `docs/accuracy.md` that stands between the comments `<!-- name -->` and `<!-- end of name -->`, where
/// the environment asks for it (`GSII_WRITE_ACCURACY=1`).
pub fn write_accuracy(name: &str, text: &str) {
    if std::env::var_os("GSII_WRITE_ACCURACY").is_none() {
        return;
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/accuracy.md");
    let document = std::fs::read_to_string(&path).unwrap();
    let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let (before, rest) = document.split_once(&start).unwrap();
    let (_, after) = rest.split_once(&end).unwrap();
    std::fs::write(&path, format!("{before}{start}{text}{end}{after}")).unwrap();
}
