//! A scene as the study sees it: with its camera, its size in pixels and a name for what is in it.

use std::path::Path;
use std::sync::Arc;

use xxhash_rust::xxh3::Xxh3;

use crate::error::Result;
use crate::pipeline::choose_camera;
use crate::scene::{self, Camera, Scene, Texels};

/// One scene of a study.
pub struct Subject {
    /// File name without its ending: how the report calls it.
    pub name: String,
    /// The scene.
    pub scene: Arc<Scene>,
    /// What looks at it.
    pub camera: Camera,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Hash of all that an image of the scene depends on.
    pub contents: String,
    /// Mean reflectance over bands and area, light sources left out: the paper's rho_ave.
    pub reflectance: f64,
}

impl Subject {
    /// Reads a scene; `width` pixels wide, as high as its camera says (3:2 where it does not).
    ///
    /// # Errors
    /// As [`scene::load`] and [`choose_camera`].
    pub fn load(path: &Path, camera: Option<&str>, width: u32) -> Result<Subject> {
        let scene = scene::load(path, &scene::LoadOptions::default())?;
        let camera = choose_camera(&scene, camera)?.clone();
        let height = (width as f32 / camera.aspect.unwrap_or(1.5)).round().max(1.0) as u32;
        let name = path.file_stem().map_or_else(|| scene.name.clone(), |s| s.to_string_lossy().into_owned());
        let (contents, reflectance) = (contents(&scene), reflectance(&scene));
        Ok(Subject { name, camera, size: [width, height], contents, reflectance, scene: Arc::new(scene) })
    }

    /// The largest linear dimension of the room, which the paper measures `r_thresh` in.
    pub fn length(&self) -> f32 {
        self.scene.mesh.bounds.size().max_element()
    }

    /// Pixels along each edge of the squares over which the paper's mean relative differences are taken: its images were about
    /// 100 pixels wide.
    pub fn coarse(&self) -> usize {
        ((self.size[0] as f32 / 100.0).round() as usize).max(1)
    }

    /// Hash of everything that a converged image of this scene at this size depends on.
    pub fn view(&self) -> String {
        key(&format!("{} {:?} {:?}", self.contents, self.camera, self.size))
    }
}

/// A short name for a text, for files: 64 bits in hexadecimal.
pub fn key(text: &str) -> String {
    format!("{:016x}", xxhash_rust::xxh3::xxh3_64(text.as_bytes()))
}

fn contents(scene: &Scene) -> String {
    let mesh = &scene.mesh;
    let mut hash = Xxh3::new();
    let mut floats = |values: &mut dyn Iterator<Item = f32>| values.for_each(|v| hash.update(&v.to_le_bytes()));
    floats(&mut mesh.positions.iter().chain(&mesh.normals).flat_map(|p| p.to_array()));
    floats(&mut mesh.uvs.iter().flatten().flat_map(|p| p.to_array()));
    floats(&mut mesh.colors.iter().flatten().copied());
    mesh.triangles.iter().flatten().for_each(|i| hash.update(&i.to_le_bytes()));
    for object in &mesh.objects {
        hash.update(&object.triangles.start.to_le_bytes());
        hash.update(format!("{:?}", scene.materials[object.material as usize]).as_bytes());
    }
    for texture in &scene.textures {
        hash.update(format!("{} {} {:?}", texture.width, texture.height, texture.wrap).as_bytes());
        match &texture.texels {
            Texels::Srgb8(bytes) | Texels::Linear8(bytes) => hash.update(bytes),
            Texels::Float(values) => values.iter().for_each(|v| hash.update(&v.to_le_bytes())),
        }
    }
    hash.update(format!("{:?}", scene.lights).as_bytes());
    format!("{:016x}", hash.digest())
}

fn reflectance(scene: &Scene) -> f64 {
    let triangles = 0..scene.mesh.triangles.len() as u32;
    let (sum, area) = triangles.filter(|&t| !scene.material(t).is_emitter()).fold((0.0, 0.0), |(sum, total), t| {
        let area = scene.mesh.area(t);
        (sum + area * f64::from(scene.mean_reflectance(t).element_sum()) / 3.0, total + area)
    });
    if area > 0.0 { sum / area } else { 0.0 }
}
