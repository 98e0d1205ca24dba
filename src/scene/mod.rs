//! What a scene is: triangles, materials, textures, lights and cameras, as read from glTF or made in code.

pub mod aabb;
pub mod camera;
pub mod gltf;
pub mod light;
pub mod material;
pub mod mesh;
pub mod texture;

use glam::{DVec3, Vec3, Vec4};

pub use aabb::Aabb;
pub use camera::{Camera, Projection};
pub use light::{LightKind, PunctualLight};
pub use material::{Alpha, Material, TextureSlot};
pub use mesh::{Mesh, Object};
pub use texture::Texture;

/// A complete scene in recentred world coordinates (metres unless the file says otherwise, y up).
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Where it came from, for messages: a path or a name given in code.
    pub name: String,
    /// All triangles.
    pub mesh: Mesh,
    /// Materials, indexed by [`Object::material`].
    pub materials: Vec<Material>,
    /// Decoded textures, indexed by [`TextureSlot::texture`].
    pub textures: Vec<Texture>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Cameras; an importer adds one that sees the scene where the file has none.
    pub cameras: Vec<Camera>,
    /// What was subtracted from file coordinates, so that the scene's centre is the origin.
    pub centre: DVec3,
    /// What the importer noticed and did about it.
    pub notes: ImportNotes,
}

/// What import dropped, clamped or could not use. Nothing here is an error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportNotes {
    /// Triangles without area (repeated or collinear vertices), dropped.
    pub degenerate_triangles: usize,
    /// Triangles with NaN, infinite or huge coordinates, dropped.
    pub non_finite_triangles: usize,
    /// Triangles that repeat another one exactly, dropped.
    pub duplicate_triangles: usize,
    /// One sentence for each thing the user should know, without repetition.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Base colour at barycentric weights `u` and `v` of a triangle: material x texture x vertex colour.
    pub fn base_color(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        let material = self.material(triangle);
        let mut color = material.base_color;
        if let Some(slot) = &material.base_color_texture {
            color *= self.texel(slot, triangle, u, v).truncate();
        }
        if !self.mesh.colors.is_empty() {
            let [a, b, c] = self.mesh.triangles[triangle as usize]
                .map(|i| Vec4::from_array(self.mesh.colors[i as usize]).truncate());
            color *= (1.0 - u - v) * a + u * b + v * c;
        }
        color
    }

    /// Emitted radiance of the emitting side at barycentric weights `u` and `v` of a triangle.
    pub fn emission(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        let material = self.material(triangle);
        match &material.emission_texture {
            Some(slot) => material.emission * self.texel(slot, triangle, u, v).truncate(),
            None => material.emission,
        }
    }

    fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.mesh.object(triangle).material as usize]
    }

    fn texel(&self, slot: &TextureSlot, triangle: u32, u: f32, v: f32) -> Vec4 {
        let uvs = &self.mesh.uvs[usize::from(slot.uv_set)];
        if uvs.is_empty() {
            return Vec4::ONE;
        }
        let [a, b, c] = self.mesh.triangles[triangle as usize].map(|i| uvs[i as usize]);
        let uv = slot.transform.transform_point2((1.0 - u - v) * a + u * b + v * c);
        self.textures[slot.texture as usize].sample(uv)
    }
}
