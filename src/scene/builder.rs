//! Scenes from parts: what the importer uses, and programs that make scenes in code.

use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

use super::finish;
use super::{Camera, ImportNotes, Material, PunctualLight, Scene, Texture};
use crate::error::{Error, Result};

/// Triangles in the frame in which they were modelled.
#[derive(Clone, Debug, Default)]
pub struct MeshData {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Three vertex indices a triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals of any length, empty or one a vertex; zero or not finite where there is none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, each set empty or one a vertex.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours, each 0..=1, empty or one a vertex.
    pub colors: Vec<[f32; 4]>,
}

/// A geometry that was added to a [`SceneBuilder`], to be placed any number of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryId(pub(super) u32);

/// A geometry at a place, with a material.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub name: String,
    pub geometry: u32,
    pub material: u32,
    pub transform: DAffine3,
}

/// Collects the parts of a scene; [`SceneBuilder::finish`] checks them and makes a [`Scene`].
///
/// Transforms, and positions of cameras and lights, are in file coordinates; `finish` recentres everything on the centre
/// of the bounds, in f64.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    pub(super) name: String,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) geometries: Vec<MeshData>,
    pub(super) instances: Vec<Instance>,
    pub(super) lights: Vec<(DAffine3, PunctualLight)>,
    pub(super) cameras: Vec<(DAffine3, Camera)>,
    pub(super) notes: ImportNotes,
    pub(super) centre: Option<DVec3>,
    triangles: u64,
}

/// Most triangles that a scene may have: indices of triangles and of their corners fit into 32 bits with room to spare.
pub const MAX_TRIANGLES: u64 = 1 << 30;

impl SceneBuilder {
    /// An empty scene; `name` appears in messages.
    pub fn new(name: impl Into<String>) -> Self {
        SceneBuilder { name: name.into(), ..SceneBuilder::default() }
    }

    /// Makes a point of the file the origin, instead of the middle of the bounds.
    pub fn recentre_on(&mut self, centre: Option<DVec3>) {
        self.centre = centre;
    }

    /// An error about this scene.
    pub(super) fn error(&self, reason: impl Into<String>) -> Error {
        Error::Input { path: PathBuf::from(&self.name), reason: reason.into() }
    }

    /// Notes something that the user should know, once.
    pub fn warn(&mut self, sentence: impl Into<String>) {
        self.notes.warn(sentence.into());
    }

    /// Adds a texture; the result is its number for [`TextureSlot::texture`](super::TextureSlot::texture).
    pub fn add_texture(&mut self, texture: Texture) -> u32 {
        self.textures.push(texture);
        self.textures.len() as u32 - 1
    }

    /// Adds a material; the result is its number.
    pub fn add_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds triangles without placing them.
    ///
    /// # Errors
    /// When an index is out of range or an attribute has another length than the positions.
    pub fn add_geometry(&mut self, name: &str, mut data: MeshData) -> Result<GeometryId> {
        let n = data.positions.len();
        if let Some(t) = data.triangles.iter().position(|t| t.iter().any(|&i| i as usize >= n)) {
            let t = (t, data.triangles[t]);
            return Err(self.error(format!("{name}: triangle {} has the vertices {:?}, but there are {n}", t.0, t.1)));
        }
        let lengths = [("normals", data.normals.len()), ("colors", data.colors.len())]
            .into_iter()
            .chain([("texture coordinates", data.uvs[0].len()), ("second texture coordinates", data.uvs[1].len())]);
        for (what, length) in lengths {
            if length != 0 && length != n {
                return Err(self.error(format!("{name}: {length} {what} for {n} vertices")));
            }
        }
        self.tidy(name, &mut data);
        self.geometries.push(data);
        Ok(GeometryId(self.geometries.len() as u32 - 1))
    }

    /// Makes attributes usable, so that nothing later meets a NaN.
    fn tidy(&mut self, name: &str, data: &mut MeshData) {
        let mut bad = 0_usize;
        for normal in &mut data.normals {
            let unit = normal.as_dvec3().normalize_or_zero().as_vec3();
            bad += usize::from(unit == Vec3::ZERO);
            *normal = unit;
        }
        if bad > 0 {
            self.warn(format!("{name}: {bad} normals are zero or not finite; their corners are shaded flat"));
        }
        if data.normals.iter().all(|n| *n == Vec3::ZERO) {
            data.normals = Vec::new();
        }
        let mut bad = 0_usize;
        for uv in data.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
            bad += 1;
        }
        if bad > 0 {
            self.warn(format!("{name}: {bad} texture coordinates are not finite; set to zero"));
        }
        let mut bad = 0_usize;
        for c in data.colors.iter_mut().flatten().filter(|c| !(0.0..=1.0).contains(*c)) {
            *c = if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) };
            bad += 1;
        }
        if bad > 0 {
            self.warn(format!("{name}: {bad} vertex colour values lie outside of 0..1; clamped"));
        }
        if data.colors.iter().all(|c| *c == [1.0; 4]) {
            data.colors = Vec::new();
        }
    }

    /// Places a geometry. A transform that mirrors turns the winding; one without volume drops the object with a note.
    ///
    /// # Errors
    /// When `material` does not exist, the transform is not finite, or the scene becomes too large.
    pub fn add_instance(
        &mut self,
        name: impl Into<String>,
        geometry: GeometryId,
        material: u32,
        transform: DAffine3,
    ) -> Result<()> {
        let name = name.into();
        if material as usize >= self.materials.len() {
            return Err(self.error(format!("{name}: material {material} does not exist")));
        }
        let Some(data) = self.geometries.get(geometry.0 as usize) else {
            return Err(self.error(format!("{name}: geometry {} does not exist", geometry.0)));
        };
        if !transform.is_finite() {
            return Err(self.error(format!("{name}: the transform is not finite")));
        }
        self.triangles += data.triangles.len().max(data.positions.len()) as u64;
        if self.triangles > MAX_TRIANGLES {
            return Err(self.error(format!("more than {MAX_TRIANGLES} triangles or vertices, instances included")));
        }
        if flat(&transform.matrix3) {
            self.warn(format!("{name}: its scale is zero along an axis; dropped"));
            return Ok(());
        }
        self.instances.push(Instance { name, geometry: geometry.0, material, transform });
        Ok(())
    }

    /// Adds triangles and places them once.
    ///
    /// # Errors
    /// As [`SceneBuilder::add_geometry`] and [`SceneBuilder::add_instance`].
    pub fn add_mesh(
        &mut self,
        name: impl Into<String>,
        data: MeshData,
        material: u32,
        transform: DAffine3,
    ) -> Result<()> {
        let name = name.into();
        let geometry = self.add_geometry(&name, data)?;
        self.add_instance(name, geometry, material, transform)
    }

    /// Adds a light whose position and direction are in the frame that `transform` places (scale does not count).
    pub fn add_light(&mut self, light: PunctualLight, transform: DAffine3) {
        self.lights.push((transform, light));
    }

    /// Adds a camera whose position and axes are in the frame that `transform` places (scale does not count).
    pub fn add_camera(&mut self, camera: Camera, transform: DAffine3) {
        self.cameras.push((transform, camera));
    }

    /// Checks everything and makes the scene.
    ///
    /// Drops triangles that are not finite, have no area or repeat another, orders objects by kind, recentres. Adds a
    /// camera where there is none.
    ///
    /// # Errors
    /// Names the material, light or camera with impossible values.
    pub fn finish(self) -> Result<Scene> {
        finish::finish(self)
    }
}

impl ImportNotes {
    /// Adds a sentence unless it is there already.
    pub fn warn(&mut self, sentence: String) {
        if !self.warnings.contains(&sentence) {
            self.warnings.push(sentence);
        }
    }
}

/// Whether a linear map flattens space: a volume below the rounding error of f64 arithmetic on its columns.
fn flat(m: &DMat3) -> bool {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.normalize_or_zero());
    x.cross(y).dot(z).abs() <= 16.0 * f64::EPSILON
}

/// How normals go with a linear map: the cofactor matrix times the sign of the determinant, which is the inverse
/// transposed but for the length, and exists for every map. The result is not normalised.
pub(super) fn normal_matrix(m: &DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    cofactors * m.determinant().signum()
}
