//! Caustics (`L_{l,c}`): light that perfect mirrors and glass bend on its way from a light source to a weakly directional surface.
//!
//! A gather ray finds a small light source behind a mirror rarely, and one without area never. Light from those starts at the light
//! source instead: photons fly towards what may bend them, and those that were bent are kept where they land. Each path
//! `L S+ D` is computed once, whatever follows the D:
//!
//! | light source | computed by |
//! |---|---|
//! | without area (`KHR_lights_punctual`) | photons |
//! | emitting object small against the scene | photons |
//! | larger emitting object | gather rays that meet it after a highly directional event |
//! | environment, sky and sun | gather rays that leave the scene after a highly directional event |
//!
//! S is here a perfectly smooth reflection or glass of any roughness, as for the radiosity solution; smooth reflection that is not
//! perfect belongs to gather rays (see [`Lobes::least_roughness`]). Light that panes let through straight is direct light. Path
//! tracing uses no photons: caustics from lights without area are missing there.

mod aim;
mod grid;
mod map;
mod sources;
mod targets;
#[cfg(test)]
mod tests;
mod trace;

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;

use crate::backend::{Hit, RayScene};
use crate::lighting::{LightSample, Lights};
use crate::sampling::hash_all;
use crate::scene::{Material, Scene};
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use map::PhotonMap;
use sources::Sources;
use targets::targets;
use trace::Flight;

/// Largest projected solid angle of an emitting object, seen from a quarter of the scene's diagonal, whose caustics are left to photons:
/// the standard deviation of gather rays that meet a larger one by chance is at most ten times what it brings.
const SMALL: f64 = 0.03;

/// Roughness below which reflection is a delta function.
const SMOOTH: f32 = 0.01;

/// Cosine between shading and geometric normal from which on a surface is taken to be flat.
const FLAT: f32 = 0.999;

/// Share of rough reflection in the albedo up to which it is taken to be diffuse.
const WEAK: f32 = 0.1;

/// Keeps the photons' random numbers apart from all others.
const STREAM: u32 = 0x7068_6f74;

/// Photons of a scene.
#[derive(Clone, Debug)]
pub struct Caustics {
    /// Whether photons carry the caustics of a triangle's emission, for each triangle.
    small: Vec<bool>,
    /// Whether a material bends light, for each material.
    bends: Vec<bool>,
    /// Photons from light sources with area, which path tracing meets as well.
    of_areas: Arc<PhotonMap>,
    /// Photons from light sources without area.
    of_points: Arc<PhotonMap>,
}

impl Caustics {
    /// Traces photons through `rays`, which is built from `scene`; the same on any number of threads. `None` where nothing bends light
    /// or all light sources are large. `reach`: largest distance over which photons are averaged, scene units.
    pub fn new(scene: &Scene, lights: &Lights, rays: &dyn RayScene, reach: f32, seed: u32) -> Option<Caustics> {
        let bends: Vec<bool> = scene.materials.iter().map(bends_light).collect();
        let targets = targets(scene, &bends);
        if targets.is_empty() {
            return None;
        }
        let small = small_emitters(scene, lights);
        let of_areas = Sources::of_areas(scene, lights, &small, &targets);
        let of_points = Sources::of_points(scene, lights, &targets);
        if of_areas.is_empty() && of_points.is_empty() {
            return None;
        }
        let map = |sources: &Sources, number: u32| {
            let flight = Flight { scene, rays, bends: &bends, sources, targets: &targets };
            Arc::new(PhotonMap::new(flight.photons(hash_all(&[seed, STREAM, number])), reach))
        };
        let (of_areas, of_points) = (map(&of_areas, 0), map(&of_points, 1));
        Some(Caustics { small, bends, of_areas, of_points })
    }

    /// The same without the photons of light sources that path tracing cannot meet: for comparison with it.
    pub fn of_areas_only(&self) -> Caustics {
        Caustics { of_points: Arc::default(), ..self.clone() }
    }

    /// The same without any photon: what they would bring is missing.
    pub fn emptied(&self) -> Caustics {
        Caustics { of_areas: Arc::default(), ..self.of_areas_only() }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.of_areas.len() + self.of_points.len()
    }

    /// Whether no photon landed.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What scatters at a point without bending light, where something else does.
    pub fn unbending(&self, scene: &Scene, point: &SurfacePoint, outgoing: Vec3) -> Option<Bsdf> {
        if !self.bends[scene.mesh.object(point.triangle).material as usize] {
            return None;
        }
        let bsdf = Bsdf::new(scene, point, outgoing, Lobes::MIRRORS);
        (bsdf.albedo_high() != Vec3::ZERO).then_some(bsdf)
    }

    /// Whether photons carry the caustics of the light source of this sample.
    pub fn carry(&self, light: &LightSample) -> bool {
        light.pdf.is_none() || self.carry_from(light.triangle)
    }

    /// Whether photons carry the caustics of a triangle's emission.
    pub fn carry_from(&self, triangle: u32) -> bool {
        triangle != Hit::NONE && self.small[triangle as usize]
    }

    /// Radiance that photons make leave a point towards `outgoing`, W/(sr m^2), where it scatters as `bsdf` says, or what does not bend
    /// light as `unbending`. Glossy lobes take part for paths that gather; view chains follow them to the light source.
    pub fn at(
        &self,
        point: &SurfacePoint,
        outgoing: Vec3,
        bsdf: &Bsdf,
        unbending: Option<&Bsdf>,
        gathers: bool,
    ) -> Vec3 {
        let weak = unbending.unwrap_or(bsdf);
        let glossy = gathers && unbending.is_none() && bsdf.albedo_high() != Vec3::ZERO;
        if weak.albedo_low() == Vec3::ZERO && !glossy {
            return Vec3::ZERO;
        }
        let scatter = |toward: Vec3| {
            let low = weak.eval_low(toward);
            if glossy { low + bsdf.eval_high(toward).0 } else { low }
        };
        // Weak reflection of a coat goes with the diffuse, as in the irradiance cache.
        let (albedo, rough) = (weak.albedo_low(), weak.albedo_rough());
        let flat = point.shading_normal.dot(point.geometric_normal) > FLAT;
        let even = flat && !glossy && rough.max_element() <= WEAK * albedo.max_element();
        let diffuse = even.then_some(albedo * FRAC_1_PI);
        let front = outgoing.dot(point.geometric_normal) >= 0.0;
        let normal = if front { point.geometric_normal } else { -point.geometric_normal };
        let of = |map: &PhotonMap| map.radiance(point.position, normal, diffuse, &scatter);
        of(&self.of_areas) + of(&self.of_points)
    }
}

/// Whether a material bends light wherever it is. Textures that are smooth in places are left to gather rays.
fn bends_light(material: &Material) -> bool {
    let reflects = material.metallic > 0.0 || material.specular > 0.0;
    let transmits = material.transmission > 0.0 && material.metallic < 1.0;
    transmits || (reflects && material.roughness < SMOOTH)
}

/// Which triangles belong to a small emitting object.
fn small_emitters(scene: &Scene, lights: &Lights) -> Vec<bool> {
    let mesh = &scene.mesh;
    let mut areas = vec![0.0; mesh.objects.len()];
    for emitting in lights.triangles() {
        areas[mesh.object_of_triangle[emitting.triangle as usize] as usize] += mesh.area(emitting.triangle);
    }
    let distance = 0.25 * f64::from(mesh.bounds.diagonal());
    let mut small = vec![false; mesh.triangles.len()];
    for emitting in lights.triangles() {
        let area = areas[mesh.object_of_triangle[emitting.triangle as usize] as usize];
        small[emitting.triangle as usize] = area <= SMALL * distance * distance;
    }
    small
}
