//! What a scene is: triangles, materials, textures, lights and cameras, as read from glTF or made in code.

pub mod aabb;
pub mod alpha;
pub mod appearance;
pub mod builder;
pub mod camera;
mod clean;
mod digest;
pub mod environment;
mod finish;
pub mod gltf;
pub mod light;
pub mod material;
pub mod mesh;
mod overview;
mod pane;
pub mod plane;
pub mod sky;
#[cfg(test)]
mod tests;
pub mod texture;

use std::sync::Arc;

use glam::DVec3;

pub use aabb::Aabb;
pub use alpha::AlphaFilter;
pub use builder::{GeometryId, MeshData, SceneBuilder};
pub use camera::{Camera, Lens, Projection};
pub use digest::Digest;
pub use environment::{Environment, SunDisk};
pub use gltf::{LoadOptions, Motion, load};
pub use light::{LightKind, PunctualLight};
pub use material::{Alpha, Material, TextureSlot};
pub use mesh::{Mesh, Object};
pub use plane::Plane;
pub use texture::{Texels, Texture, Wrap};

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
    /// What lies around it; `None` is black.
    pub environment: Option<Arc<Environment>>,
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
