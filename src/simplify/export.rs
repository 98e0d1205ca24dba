//! The simplified scene as binary glTF, for any viewer.
//!
//! Reflectances and radiosities are vertex colours; every triangle has vertices of its own. Boxes are one mesh each, a quad
//! for every face patch.

use std::io::{self, Write};

use glam::{Quat, Vec3};
use serde_json::{Value, json};

use super::fit::{face_axes, face_side};
use super::{Simplified, TriangleSource};
use crate::radiosity::Solution;
use crate::scene::{Camera, Projection, Scene};

/// Triangles are cut until their edges are about as long as a patch to show radiosities, but not finer than this.
const MOST_CUTS: u32 = 64;

/// Share of the shown radiosities (by area) that may be brighter than white.
const ABOVE_WHITE: f64 = 0.01;

/// glTF's numbers for types.
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const TRIANGLES: u32 = 4;

/// Vertices of one mesh: three a triangle.
#[derive(Default)]
struct Shape {
    name: String,
    positions: Vec<Vec3>,
    colours: Vec<Vec3>,
    emission: Vec3,
    is_box: bool,
}

impl Shape {
    fn push(&mut self, corners: [Vec3; 3], colour: Vec3) {
        self.positions.extend(corners);
        self.colours.extend([colour; 3]);
    }

    fn quad(&mut self, [a, b, c, d]: [Vec3; 4], colour: Vec3) {
        self.push([a, b, c], colour);
        self.push([a, c, d], colour);
    }
}

/// Writes `simplified` as a GLB: colours are reflectances, or with `radiosity` what the solution on the simplified scene says.
///
/// # Errors
/// What the writer says.
pub fn write(
    scene: &Scene,
    simplified: &Simplified,
    radiosity: Option<&Solution>,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut shapes = match radiosity {
        Some(solution) => radiosities(scene, simplified, solution),
        None => reflectances(scene, simplified),
    };
    shapes.retain(|s| !s.positions.is_empty());
    let white = radiosity.map(|_| scale_to_white(&mut shapes));
    let root = document(scene, simplified, &shapes, white);
    write_glb(&root, &shapes, out)
}

fn reflectances(scene: &Scene, simplified: &Simplified) -> Vec<Shape> {
    let geometry = &simplified.geometry;
    let mut shapes = empty_shapes(scene, simplified);
    for source in &geometry.sources {
        if let TriangleSource::Scene { triangle } = *source {
            let object = scene.mesh.object_of_triangle[triangle as usize] as usize;
            shapes[object].push(scene.mesh.corners(triangle), scene.mean_reflectance(triangle));
        }
    }
    for (cluster, shape) in simplified.clusters.iter().zip(&mut shapes[scene.mesh.objects.len()..]) {
        let b = &cluster.equivalent_box;
        let n = b.resolution;
        for face in 0..6 {
            let (normal_axis, first, second) = face_axes(face);
            for (patch, &colour) in (0u32..).zip(&b.reflectance[face]) {
                let (i, j) = (patch % n, patch / n);
                let corner = |di: u32, dj: u32| {
                    let mut local = Vec3::ZERO;
                    local[normal_axis] = face_side(face);
                    local[first] = 2.0 * (i + di) as f32 / n as f32 - 1.0;
                    local[second] = 2.0 * (j + dj) as f32 / n as f32 - 1.0;
                    b.centre + b.axes * (local * b.half)
                };
                let [p, q, r, s] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                // Outward counter-clockwise; see `SimplifiedGeometry::add_boxes`.
                shape.quad(if matches!(face, 0 | 3 | 4) { [p, s, r, q] } else { [p, q, r, s] }, colour);
            }
        }
    }
    shapes
}

/// Both sides of every triangle, cut to the size of patches. Boxes have only their outer side.
fn radiosities(scene: &Scene, simplified: &Simplified, solution: &Solution) -> Vec<Shape> {
    let geometry = &simplified.geometry;
    let mut shapes = empty_shapes(scene, simplified);
    for (t, source) in (0u32..).zip(&geometry.sources) {
        let [a, b, c] = geometry.triangles[t as usize].map(|v| geometry.positions[v as usize]);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let n = ((longest / solution.patch_size).ceil() as u32).clamp(1, MOST_CUTS);
        let (shape, two_sided) = match *source {
            TriangleSource::Scene { triangle } => (scene.mesh.object_of_triangle[triangle as usize] as usize, true),
            TriangleSource::BoxFace { cluster, .. } => (scene.mesh.objects.len() + cluster as usize, false),
        };
        let shape = &mut shapes[shape];
        let at = |(u, v): (f32, f32)| a + u * (b - a) + v * (c - a);
        let step = 1.0 / n as f32;
        for i in 0..n {
            for j in 0..n - i {
                let (u, v) = (i as f32 * step, j as f32 * step);
                let lower = [(u, v), (u + step, v), (u, v + step)];
                let upper = [(u + step, v), (u + step, v + step), (u, v + step)];
                for corners in [Some(lower), (i + j + 1 < n).then_some(upper)].into_iter().flatten() {
                    let middle = corners.iter().fold((0.0, 0.0), |m, c| (m.0 + c.0 / 3.0, m.1 + c.1 / 3.0));
                    let [p, q, r] = corners.map(at);
                    shape.push([p, q, r], solution.radiosity(t, middle.0, middle.1, true));
                    let back = solution.radiosity(t, middle.0, middle.1, false);
                    if two_sided && back != Vec3::ZERO {
                        shape.push([p, r, q], back);
                    }
                }
            }
        }
    }
    shapes
}

/// One for each object of the scene, then one for each cluster.
fn empty_shapes(scene: &Scene, simplified: &Simplified) -> Vec<Shape> {
    let objects = scene.mesh.objects.iter().map(|o| {
        let emission = scene.materials[o.material as usize].emission;
        Shape { name: o.name.clone(), emission, ..Shape::default() }
    });
    let boxes = (0..simplified.clusters.len()).map(|i| Shape {
        name: format!("cluster {i}"),
        is_box: true,
        ..Shape::default()
    });
    objects.chain(boxes).collect()
}

/// Divides all colours by the radiosity that but a few are below, and gives that.
fn scale_to_white(shapes: &mut [Shape]) -> f32 {
    let mut seen: Vec<(f32, f64)> = shapes
        .iter()
        .flat_map(|s| s.positions.chunks_exact(3).zip(s.colours.chunks_exact(3)))
        .map(|(p, c)| (c[0].max_element(), f64::from((p[1] - p[0]).cross(p[2] - p[0]).length())))
        .collect();
    seen.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = ABOVE_WHITE * seen.iter().map(|s| s.1).sum::<f64>();
    let white = seen.iter().find(|(_, area)| {
        left -= area;
        left < 0.0
    });
    let white = white.map_or(0.0, |w| w.0);
    let white = if white > 0.0 { white } else { 1.0 };
    shapes.iter_mut().flat_map(|s| &mut s.colours).for_each(|c| *c = (*c / white).clamp(Vec3::ZERO, Vec3::ONE));
    white
}

fn document(scene: &Scene, simplified: &Simplified, shapes: &[Shape], white: Option<f32>) -> Value {
    // One material for all that does not emit, one for each light source's radiance.
    let mut emissions = vec![Vec3::ZERO];
    let mut material_of = Vec::with_capacity(shapes.len());
    for shape in shapes {
        let i = emissions.iter().position(|e| *e == shape.emission).unwrap_or_else(|| {
            emissions.push(shape.emission);
            emissions.len() - 1
        });
        material_of.push(i);
    }
    let materials: Vec<Value> = emissions.iter().map(|&e| material(e, white.is_some())).collect();

    let (mut accessors, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    let mut groups: [Vec<usize>; 2] = Default::default();
    let mut first = 0;
    for (shape, &material) in shapes.iter().zip(&material_of) {
        let count = shape.positions.len();
        let low = shape.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = shape.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let offset = 12 * first;
        accessors.push(json!({
            "bufferView": 0, "byteOffset": offset, "componentType": FLOAT, "count": count, "type": "VEC3",
            "min": low.to_array(), "max": high.to_array(),
        }));
        accessors.push(json!({
            "bufferView": 1, "byteOffset": offset, "componentType": FLOAT, "count": count, "type": "VEC3",
        }));
        let attributes = json!({ "POSITION": accessors.len() - 2, "COLOR_0": accessors.len() - 1 });
        meshes.push(json!({
            "name": shape.name,
            "primitives": [{ "attributes": attributes, "material": material, "mode": TRIANGLES }],
        }));
        groups[usize::from(shape.is_box)].push(nodes.len());
        nodes.push(json!({ "name": shape.name, "mesh": meshes.len() - 1 }));
        first += count;
    }
    let cameras: Vec<Value> = scene.cameras.iter().map(camera).collect();
    let mut roots = Vec::new();
    for (name, children) in ["normal surfaces", "simple surfaces"].iter().zip(&groups) {
        if !children.is_empty() {
            roots.push(nodes.len());
            nodes.push(json!({ "name": name, "children": children, "translation": scene.centre.to_array() }));
        }
    }
    for (i, camera) in scene.cameras.iter().enumerate() {
        roots.push(nodes.len());
        nodes.push(json!({
            "name": camera.name, "camera": i,
            "translation": (camera.position.as_dvec3() + scene.centre).to_array(),
            "rotation": Quat::from_mat3(&camera.axes).normalize().to_array(),
        }));
    }
    let params = &simplified.params;
    let mut about = json!({
        "r_thresh": params.r_thresh, "beta": params.beta, "A_thresh": simplified.a_thresh, "box": params.box_fit,
        "colours": "linear reflectances",
    });
    if let Some(white) = white {
        about["colours"] = json!("radiosities without emission, clipped");
        about["white_radiosity"] = json!(white);
        about["scale"] = json!("radiosity in W/m^2 = linear vertex colour times white_radiosity");
    }
    let mut scene_json = json!({ "name": scene.name });
    let mut root = json!({
        "asset": { "version": "2.0", "generator": concat!("gsii ", env!("CARGO_PKG_VERSION")), "extras": { "gsii": about } },
        "scene": 0,
    });
    // Empty lists are not allowed.
    let mut used = Vec::new();
    if white.is_some() {
        used.push("KHR_materials_unlit");
    } else {
        used.push("KHR_materials_specular");
        if emissions.iter().any(|e| e.max_element() > 1.0) {
            used.push("KHR_materials_emissive_strength");
        }
    }
    if !roots.is_empty() {
        scene_json["nodes"] = json!(roots);
    }
    root["scenes"] = json!([scene_json]);
    if first > 0 {
        root["buffers"] = json!([{ "byteLength": 24 * first }]);
        root["bufferViews"] = json!([
            { "buffer": 0, "byteOffset": 0, "byteLength": 12 * first, "byteStride": 12, "target": ARRAY_BUFFER },
            { "buffer": 0, "byteOffset": 12 * first, "byteLength": 12 * first, "byteStride": 12, "target": ARRAY_BUFFER },
        ]);
        root["materials"] = json!(materials);
        root["extensionsUsed"] = json!(used);
    }
    for (key, list) in [("accessors", accessors), ("meshes", meshes), ("nodes", nodes), ("cameras", cameras)] {
        if !list.is_empty() {
            root[key] = json!(list);
        }
    }
    root
}

/// A Lambertian material whose colour is the vertex colour; with `unlit`, the vertex colour as it is.
fn material(emission: Vec3, unlit: bool) -> Value {
    let mut material = json!({
        "name": if emission == Vec3::ZERO { "surface" } else { "light source" },
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
    });
    if unlit {
        material["extensions"] = json!({ "KHR_materials_unlit": {} });
        return material;
    }
    material["extensions"] = json!({ "KHR_materials_specular": { "specularFactor": 0.0 } });
    let strength = emission.max_element().max(1.0);
    if emission != Vec3::ZERO {
        material["emissiveFactor"] = json!((emission / strength).to_array());
    }
    if strength > 1.0 {
        material["extensions"]["KHR_materials_emissive_strength"] = json!({ "emissiveStrength": strength });
    }
    material
}

fn camera(camera: &Camera) -> Value {
    match camera.projection {
        Projection::Perspective { y_fov } => {
            let mut perspective = json!({ "yfov": y_fov, "znear": 0.01 });
            if let Some(aspect) = camera.aspect {
                perspective["aspectRatio"] = json!(aspect);
            }
            json!({ "name": camera.name, "type": "perspective", "perspective": perspective })
        }
        Projection::Orthographic { x_mag, y_mag } => json!({
            "name": camera.name, "type": "orthographic",
            "orthographic": { "xmag": x_mag, "ymag": y_mag, "znear": 0.0, "zfar": 1e4 },
        }),
    }
}

/// Header, JSON chunk padded with spaces, binary chunk: positions, then colours.
fn write_glb(root: &Value, shapes: &[Shape], out: &mut impl Write) -> io::Result<()> {
    let mut text = serde_json::to_vec(root)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary = 24 * shapes.iter().map(|s| s.positions.len()).sum::<usize>();
    let length = |bytes: usize| {
        u32::try_from(bytes).map_err(|_| io::Error::other("the scene is larger than the 4 GiB of a binary glTF file"))
    };
    let with_binary = if binary > 0 { 8 + binary } else { 0 };
    out.write_all(b"glTF")?;
    out.write_all(&2u32.to_le_bytes())?;
    out.write_all(&length(12 + 8 + text.len() + with_binary)?.to_le_bytes())?;
    out.write_all(&length(text.len())?.to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if binary > 0 {
        out.write_all(&length(binary)?.to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        let positions = shapes.iter().flat_map(|s| &s.positions);
        for number in positions.chain(shapes.iter().flat_map(|s| &s.colours)).flat_map(|v| v.to_array()) {
            out.write_all(&number.to_le_bytes())?;
        }
    }
    out.flush()
}
