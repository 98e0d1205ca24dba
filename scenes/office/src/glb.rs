//! Writes a scene as binary glTF 2.0.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};

use glam::{Quat, Vec3};
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::{Stride, Target, View};
use json::extensions::material::{EmissiveStrength, EmissiveStrengthFactor, Specular, SpecularFactor};
use json::validation::{Checked::Valid, USize64};
use json::{Index, Root};

use crate::flight::{Flight, Key, looking};
use crate::paint::Paint;
use crate::scene::{Camera, Mesh, Primitive, Scene};

/// What the binary chunk holds, one buffer view each, in this order: everything of four bytes first keeps all aligned.
const VIEWS: [&str; 5] = ["positions", "normals", "indices 32", "keys", "indices 16"];

/// Accessors of equal content, so that meshes that differ in material only share their data.
#[derive(Default)]
struct Data<'a> {
    shapes: Vec<&'a Primitive>,
    known: HashMap<Vec<u32>, usize>,
    lengths: [usize; 5],
    keys: &'a [Key],
    accessors: Vec<json::Accessor>,
    attributes: Vec<Attributes>,
}

#[derive(Clone, Copy)]
struct Attributes {
    positions: Index<json::Accessor>,
    normals: Option<Index<json::Accessor>>,
    indices: Index<json::Accessor>,
}

impl<'a> Data<'a> {
    fn add(&mut self, primitive: &'a Primitive) -> Attributes {
        let key = content(primitive);
        if let Some(&known) = self.known.get(&key) {
            return self.attributes[known];
        }
        self.known.insert(key, self.shapes.len());
        self.shapes.push(primitive);
        let vertices = primitive.positions.len();
        let low = primitive.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = primitive.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let positions = self.accessor(0, vertices, 12 * vertices, ComponentType::F32, Type::Vec3);
        self.accessors[positions.value()].min = Some(serde_json::json!(low.to_array()));
        self.accessors[positions.value()].max = Some(serde_json::json!(high.to_array()));
        let normals = (!primitive.normals.is_empty())
            .then(|| self.accessor(1, vertices, 12 * vertices, ComponentType::F32, Type::Vec3));
        let count = 3 * primitive.triangles.len();
        let indices = if is_small(primitive) {
            self.accessor(4, count, 2 * count, ComponentType::U16, Type::Scalar)
        } else {
            self.accessor(2, count, 4 * count, ComponentType::U32, Type::Scalar)
        };
        let attributes = Attributes { positions, normals, indices };
        self.attributes.push(attributes);
        attributes
    }

    fn accessor(
        &mut self,
        view: usize,
        count: usize,
        bytes: usize,
        component: ComponentType,
        kind: Type,
    ) -> Index<json::Accessor> {
        let offset = self.lengths[view];
        self.lengths[view] += bytes;
        self.accessors.push(json::Accessor {
            buffer_view: Some(Index::new(view as u32)),
            byte_offset: (offset > 0).then(|| USize64::from(offset)),
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        });
        Index::new(self.accessors.len() as u32 - 1)
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let vectors = |out: &mut dyn Write, all: &[Vec3]| {
            all.iter().flat_map(|v| v.to_array()).try_for_each(|x| out.write_all(&x.to_le_bytes()))
        };
        self.shapes.iter().try_for_each(|p| vectors(out, &p.positions))?;
        self.shapes.iter().try_for_each(|p| vectors(out, &p.normals))?;
        let (small, large): (Vec<&Primitive>, Vec<&Primitive>) = self.shapes.iter().partition(|p| is_small(p));
        for i in large.iter().flat_map(|p| p.triangles.as_flattened()) {
            out.write_all(&i.to_le_bytes())?;
        }
        let keys = || self.keys.iter();
        let floats = keys().map(|k| k.time).chain(keys().flat_map(|k| k.eye.to_array()));
        for x in floats.chain(keys().flat_map(|k| k.rotation.to_array())) {
            out.write_all(&x.to_le_bytes())?;
        }
        for i in small.iter().flat_map(|p| p.triangles.as_flattened()) {
            out.write_all(&(*i as u16).to_le_bytes())?;
        }
        Ok(())
    }
}

/// 65535 is the primitive restart value and no index may reach it.
fn is_small(primitive: &Primitive) -> bool {
    primitive.positions.len() <= 65535
}

fn content(primitive: &Primitive) -> Vec<u32> {
    let vectors = primitive.positions.iter().chain(&primitive.normals).flat_map(|v| v.to_array().map(f32::to_bits));
    let lengths = [primitive.positions.len() as u32, primitive.normals.len() as u32];
    lengths.into_iter().chain(vectors).chain(primitive.triangles.iter().flatten().copied()).collect()
}

/// Writes the scene.
pub fn write(scene: &Scene, out: &mut impl Write) -> io::Result<()> {
    let mut data = Data::default();
    let meshes = scene.meshes.iter().map(|mesh| convert_mesh(mesh, &mut data)).collect();
    let animations = scene.flight.iter().map(|flight| convert_flight(flight, scene, &mut data)).collect();
    let binary = data.lengths.iter().sum::<usize>().next_multiple_of(4);
    let mut offset = 0;
    let mut buffer_views: Vec<View> = Vec::new();
    for (view, name) in VIEWS.iter().enumerate() {
        let vertices = view < 2;
        buffer_views.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(data.lengths[view]),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: vertices.then_some(Stride(12)),
            name: Some((*name).into()),
            target: (*name != "keys").then_some(Valid(if vertices {
                Target::ArrayBuffer
            } else {
                Target::ElementArrayBuffer
            })),
            extensions: None,
            extras: Default::default(),
        });
        offset += data.lengths[view];
    }
    drop_empty_views(&mut buffer_views, &mut data.accessors);
    let root = Root {
        asset: json::Asset {
            generator: Some("gsii office".into()),
            copyright: Some("MIT OR Apache-2.0".into()),
            ..Default::default()
        },
        accessors: std::mem::take(&mut data.accessors),
        animations,
        buffer_views,
        buffers: vec![json::Buffer {
            byte_length: USize64::from(binary),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        }],
        extensions_used: vec!["KHR_materials_emissive_strength".into(), "KHR_materials_specular".into()],
        cameras: scene.cameras.iter().map(convert_camera).collect(),
        materials: scene.materials.iter().map(convert_material).collect(),
        meshes,
        scene: Some(Index::new(0)),
        scenes: vec![json::Scene {
            name: Some("office".into()),
            nodes: (0..scene.nodes.len())
                .filter(|&i| scene.nodes[i].parent.is_none())
                .chain(scene.nodes.len()..scene.nodes.len() + scene.cameras.len())
                .map(|i| Index::new(i as u32))
                .collect(),
            extensions: None,
            extras: Default::default(),
        }],
        nodes: convert_nodes(scene),
        ..Default::default()
    };
    let mut text = serde_json::to_vec(&root)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = |n: usize| u32::try_from(n).map_err(|_| io::Error::other("scene too large for .glb (4 GiB)"));
    out.write_all(b"glTF")?;
    for word in [2, length(28 + text.len() + binary)?, length(text.len())?] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&length(binary)?.to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    data.write(out)?;
    out.write_all(&[0; 4][..binary - data.lengths.iter().sum::<usize>()])?;
    out.flush()
}

/// glTF allows no buffer view without bytes.
fn drop_empty_views(views: &mut Vec<View>, accessors: &mut [json::Accessor]) {
    for view in (0..views.len()).rev().filter(|&v| v < VIEWS.len()) {
        if views[view].byte_length.0 == 0 {
            views.remove(view);
            for accessor in accessors.iter_mut() {
                if let Some(index) = accessor.buffer_view.filter(|index| index.value() > view) {
                    accessor.buffer_view = Some(Index::new(index.value() as u32 - 1));
                }
            }
        }
    }
}

fn convert_mesh<'a>(mesh: &'a Mesh, data: &mut Data<'a>) -> json::Mesh {
    let primitives = mesh.primitives.iter().map(|primitive| {
        let found = data.add(primitive);
        let mut attributes = BTreeMap::from([(Valid(json::mesh::Semantic::Positions), found.positions)]);
        if let Some(normals) = found.normals {
            attributes.insert(Valid(json::mesh::Semantic::Normals), normals);
        }
        json::mesh::Primitive {
            attributes,
            indices: Some(found.indices),
            material: Some(Index::new(primitive.material as u32)),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
            extensions: None,
            extras: Default::default(),
        }
    });
    json::Mesh {
        primitives: primitives.collect(),
        name: Some(mesh.name.clone()),
        weights: None,
        extensions: None,
        extras: Default::default(),
    }
}

fn convert_material(paint: &Paint) -> json::Material {
    // glTF keeps the factor within 0..1 and the rest in the strength.
    let strength = paint.emission.iter().copied().fold(0.0, f32::max);
    let [r, g, b] = paint.color;
    json::Material {
        name: Some(paint.name.into()),
        double_sided: paint.sheet,
        pbr_metallic_roughness: json::material::PbrMetallicRoughness {
            base_color_factor: json::material::PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: json::material::StrengthFactor(0.0),
            roughness_factor: json::material::StrengthFactor(1.0),
            ..Default::default()
        },
        emissive_factor: json::material::EmissiveFactor(
            paint.emission.map(|e| if strength > 0.0 { e / strength } else { 0.0 }),
        ),
        extensions: Some(json::extensions::material::Material {
            specular: Some(Specular { specular_factor: SpecularFactor(0.0), ..Default::default() }),
            emissive_strength: (strength > 0.0)
                .then_some(EmissiveStrength { emissive_strength: EmissiveStrengthFactor(strength) }),
            ..Default::default()
        }),
        ..Default::default()
    }
}

/// The last camera moves.
fn convert_flight<'a>(flight: &'a Flight, scene: &Scene, data: &mut Data<'a>) -> json::Animation {
    use json::animation::{Channel, Interpolation, Property, Sampler, Target};
    let (keys, node) = (&flight.keys, scene.nodes.len() + scene.cameras.len() - 1);
    data.keys = keys;
    let n = keys.len();
    let times = data.accessor(3, n, 4 * n, ComponentType::F32, Type::Scalar);
    let ends = [keys.first(), keys.last()].map(|key| serde_json::json!([key.map_or(0.0, |key| key.time)]));
    let [min, max] = ends.map(Some);
    let accessor = &mut data.accessors[times.value()];
    (accessor.min, accessor.max) = (min, max);
    let eyes = data.accessor(3, n, 12 * n, ComponentType::F32, Type::Vec3);
    let rotations = data.accessor(3, n, 16 * n, ComponentType::F32, Type::Vec4);
    let sampler = |output| Sampler {
        input: times,
        interpolation: Valid(Interpolation::Linear),
        output,
        extensions: None,
        extras: Default::default(),
    };
    let channel = |sampler, property| Channel {
        sampler: Index::new(sampler),
        target: Target {
            node: Index::new(node as u32),
            path: Valid(property),
            extensions: None,
            extras: Default::default(),
        },
        extensions: None,
        extras: Default::default(),
    };
    json::Animation {
        name: Some(flight.camera.name.into()),
        channels: vec![channel(0, Property::Translation), channel(1, Property::Rotation)],
        samplers: vec![sampler(eyes), sampler(rotations)],
        extensions: None,
        extras: Default::default(),
    }
}

fn convert_camera(camera: &Camera) -> json::Camera {
    json::Camera {
        name: Some(camera.name.into()),
        orthographic: None,
        perspective: Some(json::camera::Perspective {
            aspect_ratio: Some(camera.aspect),
            yfov: camera.y_fov.to_radians(),
            zfar: None,
            znear: 0.01,
            extensions: None,
            extras: Default::default(),
        }),
        type_: Valid(json::camera::Type::Perspective),
        extensions: None,
        extras: Default::default(),
    }
}

fn convert_nodes(scene: &Scene) -> Vec<json::Node> {
    let mut children: Vec<Vec<Index<json::Node>>> = vec![Vec::new(); scene.nodes.len()];
    for (i, node) in scene.nodes.iter().enumerate() {
        if let Some(parent) = node.parent {
            children[parent].push(Index::new(i as u32));
        }
    }
    let mut nodes: Vec<json::Node> = Vec::with_capacity(scene.nodes.len() + scene.cameras.len());
    for (node, children) in scene.nodes.iter().zip(children) {
        let pose = node.pose;
        nodes.push(json::Node {
            name: Some(node.name.clone()),
            mesh: node.mesh.map(|mesh| Index::new(mesh as u32)),
            children: (!children.is_empty()).then_some(children),
            translation: (pose.translation != Vec3::ZERO).then(|| pose.translation.to_array()),
            rotation: (pose.rotation != Quat::IDENTITY).then(|| json::scene::UnitQuaternion(pose.rotation.to_array())),
            scale: (pose.scale != Vec3::ONE).then(|| pose.scale.to_array()),
            ..Default::default()
        });
    }
    for (i, camera) in scene.cameras.iter().enumerate() {
        let rotation = looking(camera.eye, camera.target);
        nodes.push(json::Node {
            name: Some(camera.name.into()),
            camera: Some(Index::new(i as u32)),
            translation: Some(camera.eye.to_array()),
            rotation: Some(json::scene::UnitQuaternion(rotation.to_array())),
            ..Default::default()
        });
    }
    nodes
}
