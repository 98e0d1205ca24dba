//! glTF 2.0 import.
//!
//! Nothing in a file is believed: sizes, offsets, counts and indices are checked before they are used, in checked
//! arithmetic, and nothing is allocated by a number that the file's bytes do not back.

mod accessor;
mod animation;
mod buffers;
mod container;
mod deform;
mod instancing;
mod json;
mod materials;
mod motion;
#[cfg(test)]
mod moving_tests;
mod nodes;
mod primitive;
mod punctual;
#[cfg(test)]
mod tests;
mod textures;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use gltf::json::Root;

use self::animation::{Pose, Tracks};
use self::buffers::Buffers;
use self::container::Container;
use self::deform::Deformation;
use self::json::Document;
pub use self::motion::{Arrangement, Motion};
use self::nodes::Nodes;
use self::primitive::Outcome;
use self::textures::Textures;
use super::{GeometryId, Material, Scene, SceneBuilder};
use crate::error::Error;

/// Choices for [`load`].
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Leave out all textures: factors alone count. For tools that need only the geometry.
    pub without_textures: bool,
    /// Seconds into the file's animations; `None` leaves every node where it is without them.
    pub seconds: Option<f64>,
    /// What becomes the origin, in the file's coordinates; `None` is the middle of the bounds. Frames of an animation share one: what
    /// does not move keeps its bits.
    pub centre: Option<DVec3>,
}

/// Reads a `.gltf` or `.glb` file.
///
/// # Errors
/// [`Error::Input`] when the file cannot be read, is broken, needs an unsupported extension, or holds nothing to render.
pub fn load(path: &Path, options: &LoadOptions) -> crate::error::Result<Scene> {
    let fail = |reason: String| Error::Input { path: PathBuf::from(path), reason };
    let container = Container::open(path).map_err(fail)?;
    let document = Document::parse(&container.json).map_err(fail)?;
    let root = &document.root;
    let buffers = Buffers::new(root, path, container.bin.as_deref());
    let mut builder = SceneBuilder::new(path.to_string_lossy());
    builder.recentre_on(options.centre);
    let pose = match options.seconds {
        Some(seconds) => {
            let (tracks, warnings) = Tracks::read(root, &buffers).map_err(fail)?;
            warnings.into_iter().for_each(|warning| builder.warn(warning));
            tracks.pose(&document.transforms, seconds)
        }
        None => Pose::still(&document.transforms),
    };
    let nodes = Nodes::walk(&document, &pose.transforms).map_err(fail)?;
    for name in &document.ignored {
        builder.warn(format!("the file uses the extension {name}, which is not supported; it is ignored"));
    }
    if let Some(warning) = &nodes.warning {
        builder.warn(warning.clone());
    }
    let mut import = Import {
        root,
        buffers: &buffers,
        nodes: &nodes,
        weights: &pose.weights,
        builder,
        default_material: None,
        geometries: BTreeMap::new(),
        skipped: BTreeMap::new(),
    };
    import.materials(options).map_err(fail)?;
    for &node in &nodes.visited {
        import.node(node).map_err(|e| fail(format!("{}: {e}", nodes::label(root, node))))?;
    }
    let Import { mut builder, skipped, .. } = import;
    for (reason, count) in skipped {
        builder.warn(format!("{count} mesh primitives were skipped: {reason}"));
    }
    // Finishing needs the most memory: give back what the file took.
    drop((buffers, nodes));
    let scene = builder.finish()?;
    if scene.mesh.triangles.is_empty() {
        return Err(fail("the scene holds no triangles: nothing to render".into()));
    }
    Ok(scene)
}

/// What a builder's error says, without the path that it would be shown with.
fn reason(error: Error) -> String {
    match error {
        Error::Input { reason, .. } => reason,
        other => other.to_string(),
    }
}

/// State of an import.
struct Import<'a, 'b> {
    root: &'a Root,
    buffers: &'a Buffers<'b>,
    nodes: &'a Nodes,
    /// Weights of morph targets that an animation gives to nodes.
    weights: &'a BTreeMap<usize, Vec<f32>>,
    builder: SceneBuilder,
    /// Number of the material of primitives without one.
    default_material: Option<u32>,
    /// Primitives (mesh, primitive) that were read before, in the pose that the mesh gives them.
    geometries: BTreeMap<(usize, usize), Option<GeometryId>>,
    /// Why primitives were skipped, and how many.
    skipped: BTreeMap<&'static str, usize>,
}

impl Import<'_, '_> {
    /// Adds all materials, in the file's order, and their textures.
    fn materials(&mut self, options: &LoadOptions) -> Result<(), String> {
        let mut textures = Textures::new(self.root);
        for index in 0..self.root.materials.len() {
            let mut material = materials::convert(self.root, index, &mut textures, &mut self.builder)?;
            if options.without_textures {
                material.base_color_texture = None;
                material.metallic_roughness_texture = None;
                material.normal_texture = None;
                material.emission_texture = None;
            }
            self.builder.add_material(material);
        }
        match options.without_textures {
            true => Ok(()),
            false => textures.load(self.buffers, &mut self.builder),
        }
    }

    /// Adds what a node of the scene carries.
    fn node(&mut self, index: usize) -> Result<(), String> {
        let node = &self.root.nodes[index];
        let world = self.nodes.world[index];
        if let Some(camera) = &node.camera {
            let camera = punctual::camera(self.root, camera.value(), node.name.as_ref())?;
            self.builder.add_camera(camera, world);
        }
        let extensions = node.extensions.as_ref();
        if let Some(light) = extensions.and_then(|e| e.khr_lights_punctual.as_ref()) {
            let light = self.root.get(light.light).ok_or("its light does not exist")?;
            self.builder.add_light(punctual::light(light, &nodes::label(self.root, index))?, world);
        }
        match &node.mesh {
            Some(mesh) => self.mesh(index, mesh.value(), world),
            None => Ok(()),
        }
    }

    fn mesh(&mut self, index: usize, mesh_index: usize, world: DAffine3) -> Result<(), String> {
        let node = &self.root.nodes[index];
        let mesh = self.root.meshes.get(mesh_index).ok_or_else(|| format!("mesh {mesh_index} does not exist"))?;
        let places = instancing::transforms(self.root, self.buffers, node)?;
        let animated = self.weights.get(&index);
        let weights = animated.or(node.weights.as_ref()).or(mesh.weights.as_ref());
        let mut deformation = Deformation { weights: weights.map_or(&[], Vec::as_slice), joints: None };
        if let Some(skin) = &node.skin {
            deformation.joints = Some(deform::joints(self.root, self.buffers, self.nodes, skin.value())?);
            self.builder.warn("the scene has skinned meshes; they are shown in the pose that the nodes give them");
        }
        // Only what the mesh alone decides can be shared between nodes.
        let shared = animated.is_none() && node.weights.is_none() && node.skin.is_none();
        let world = if node.skin.is_some() { DAffine3::IDENTITY } else { world };
        let base = node.name.as_ref().or(mesh.name.as_ref()).cloned().unwrap_or_else(|| format!("node {index}"));
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let name = if mesh.primitives.len() > 1 { format!("{base}[{number}]") } else { base.clone() };
            let known = if shared { self.geometries.get(&(mesh_index, number)).copied() } else { None };
            let geometry = match known {
                Some(geometry) => geometry,
                None => {
                    let outcome = primitive::read(self.root, self.buffers, primitive, &deformation);
                    let geometry = match outcome.map_err(|e| format!("mesh {mesh_index}, primitive {number}: {e}"))? {
                        Outcome::Triangles(data) => Some(self.builder.add_geometry(&name, data).map_err(reason)?),
                        Outcome::Skipped(why) => {
                            *self.skipped.entry(why).or_default() += 1;
                            None
                        }
                    };
                    if shared {
                        self.geometries.insert((mesh_index, number), geometry);
                    }
                    geometry
                }
            };
            let Some(geometry) = geometry else { continue };
            let material = match &primitive.material {
                Some(material) => material.value() as u32,
                None => self.default_material(),
            };
            for place in places.as_deref().unwrap_or(&[DAffine3::IDENTITY]) {
                self.builder.add_instance(name.clone(), geometry, material, world * *place).map_err(reason)?;
            }
        }
        Ok(())
    }

    fn default_material(&mut self) -> u32 {
        let builder = &mut self.builder;
        let material = || Material { name: "default".into(), ..Material::default() };
        *self.default_material.get_or_insert_with(|| builder.add_material(material()))
    }
}
