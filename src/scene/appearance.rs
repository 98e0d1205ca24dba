//! What a surface point looks like: materials with their textures and vertex colours.

use glam::{Vec2, Vec3, Vec4};

use super::{Alpha, Material, Object, Scene, TextureSlot};
use crate::sampling;

/// Texels that one sample of [`Scene::mean_reflectance`] stands for, and bounds of the number of samples.
const TEXELS_PER_SAMPLE: f32 = 16.0;
const MIN_SAMPLES: u32 = 4;
const MAX_SAMPLES: u32 = 256;

impl Scene {
    /// Whether nothing gives light: no surface, no light without area, nothing around.
    pub fn is_dark(&self) -> bool {
        let emits = |object: &Object| self.materials[object.material as usize].is_emitter();
        self.lights.is_empty() && self.environment.is_none() && !self.mesh.objects.iter().any(emits)
    }

    /// The material of a triangle.
    pub fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.mesh.object(triangle).material as usize]
    }

    /// Texture coordinates of set 0 or 1 at a point; `u`, `v` as in [`Hit`](crate::backend::Hit). Zero without any.
    pub fn uv(&self, set: u8, triangle: u32, u: f32, v: f32) -> Vec2 {
        let uvs = &self.mesh.uvs[usize::from(set)];
        if uvs.is_empty() {
            return Vec2::ZERO;
        }
        let [a, b, c] = self.mesh.triangles[triangle as usize].map(|i| uvs[i as usize]);
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Linear RGBA of a texture as a material uses it, at a point.
    pub fn texture(&self, slot: &TextureSlot, triangle: u32, u: f32, v: f32) -> Vec4 {
        let uv = slot.transform.transform_point2(self.uv(slot.uv_set, triangle, u, v));
        self.textures[slot.texture as usize].sample(uv)
    }

    /// The same averaged over about `width` (scene units) around the point.
    pub fn texture_over(&self, slot: &TextureSlot, triangle: u32, u: f32, v: f32, width: f32) -> Vec4 {
        let texture = &self.textures[slot.texture as usize];
        if width == 0.0 || texture.smaller.is_empty() {
            return self.texture(slot, triangle, u, v);
        }
        let corner = |u, v| slot.transform.transform_point2(self.uv(slot.uv_set, triangle, u, v));
        let (a, b, c) = (corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0));
        let [p, q, r] = self.mesh.corners(triangle);
        let texels = (b - a).perp_dot(c - a).abs() * texture.width as f32 * texture.height as f32;
        let area = (q - p).cross(r - p).length();
        texture.sample_over(a + u * (b - a) + v * (c - a), width * (texels / area).sqrt())
    }

    /// Linear RGBA of the vertex colours at a point; white without any.
    pub fn vertex_color(&self, triangle: u32, u: f32, v: f32) -> Vec4 {
        if self.mesh.colors.is_empty() {
            return Vec4::ONE;
        }
        let corners = self.mesh.triangles[triangle as usize];
        let [a, b, c] = corners.map(|i| Vec4::from_array(self.mesh.colors[i as usize]));
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Factor, texture and vertex colour multiplied: colour and alpha, each 0..=1.
    fn base_rgba(&self, triangle: u32, u: f32, v: f32, width: f32) -> Vec4 {
        let material = self.material(triangle);
        let mut rgba = material.base_color.extend(material.opacity) * self.vertex_color(triangle, u, v);
        if let Some(slot) = &material.base_color_texture {
            // What is cut out often has another colour, which must not bleed into what is there.
            let width = if material.alpha == Alpha::Opaque { width } else { 0.0 };
            rgba *= self.texture_over(slot, triangle, u, v, width);
        }
        rgba.clamp(Vec4::ZERO, Vec4::ONE) // rounding, and float textures beyond 1
    }

    /// Base colour at a point, linear, each band 0..=1.
    pub fn base_color(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        self.base_color_over(triangle, u, v, 0.0)
    }

    /// The same averaged over about `width` (scene units) around the point.
    pub fn base_color_over(&self, triangle: u32, u: f32, v: f32, width: f32) -> Vec3 {
        self.base_rgba(triangle, u, v, width).truncate()
    }

    /// Alpha at a point, 0..=1, whatever the material's mode makes of it.
    pub fn alpha(&self, triangle: u32, u: f32, v: f32) -> f32 {
        self.base_rgba(triangle, u, v, 0.0).w
    }

    /// Probability that the surface is there at a point: 1 for opaque materials, 0 or 1 for masked, alpha for blended.
    pub fn opacity(&self, triangle: u32, u: f32, v: f32) -> f32 {
        match self.material(triangle).alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { cutoff } => f32::from(u8::from(self.alpha(triangle, u, v) >= cutoff)),
            Alpha::Blend => self.alpha(triangle, u, v),
        }
    }

    /// Emitted radiance at a point, W/(sr m^2) per band, of a face that emits.
    pub fn emission(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        let material = self.material(triangle);
        match &material.emission_texture {
            Some(slot) if material.is_emitter() => {
                material.emission * self.texture(slot, triangle, u, v).truncate().max(Vec3::ZERO)
            }
            _ => material.emission,
        }
    }

    /// Mean base colour of a triangle in linear light, each band 0..=1. Textures are read at well-distributed points, as
    /// many as the number of texels asks for, always the same.
    pub fn mean_reflectance(&self, triangle: u32) -> Vec3 {
        let material = self.material(triangle);
        let Some(slot) = &material.base_color_texture else {
            // Linear over the triangle: the centroid has the mean.
            return self.base_color(triangle, 1.0 / 3.0, 1.0 / 3.0);
        };
        let texture = &self.textures[slot.texture as usize];
        let corner = |u, v| slot.transform.transform_point2(self.uv(slot.uv_set, triangle, u, v));
        let (a, b, c) = (corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0));
        let texels = 0.5 * (b - a).perp_dot(c - a).abs() * texture.width as f32 * texture.height as f32;
        let samples = ((texels / TEXELS_PER_SAMPLE) as u32).clamp(MIN_SAMPLES, MAX_SAMPLES).next_power_of_two();
        let mut sum = glam::DVec3::ZERO;
        for i in 0..samples {
            let [x, y, ..] = sampling::sobol(i, 0, triangle);
            // Uniform on the triangle (Turk 1990).
            let root = x.sqrt();
            sum += self.base_color(triangle, root * (1.0 - y), root * y).as_dvec3();
        }
        (sum / f64::from(samples)).as_vec3()
    }
}
