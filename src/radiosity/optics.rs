//! What patches reflect and emit.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RadiosityScene;
use super::patches::Patches;
use crate::backend::Hit;
use crate::error::{Error, Result};
use crate::sampling;
use crate::scene::{Material, Scene};
use crate::shading::{Bsdf, SurfacePoint};
use crate::simplify::TriangleSource;

/// Roughness under which the scattering function sets lobes apart. Only delta lobes are followed here, the rest is
/// reflected diffusely, so the smallest does.
pub(super) const GLOSSY_THRESHOLD: f32 = 0.0;

/// Points at which a material that varies over a patch is looked at.
const POINTS: u32 = 16;
/// Reflectance up to which rounding is forgiven.
const SLACK: f32 = 1e-5;

/// Reflectance and emission of patches.
pub(super) struct Optics {
    /// Diffuse reflectance of each patch, 0..=1: everything but mirror-like reflection and transmission.
    pub reflectance: Vec<Vec3>,
    /// Sides that emit and their exitance in W/m^2, in ascending order.
    pub emission: Vec<(u32, DVec3)>,
    /// Whether each material may reflect or transmit like a mirror or clear glass.
    specular: Vec<bool>,
}

impl Optics {
    /// Averages the materials of `input` over `patches`.
    ///
    /// # Errors
    /// [`Error::Unsolvable`] when a surface reflects more than it receives, or less than nothing.
    pub fn new(input: &RadiosityScene<'_>, patches: &Patches) -> Result<Optics> {
        let average: Vec<(Vec3, Vec3)> =
            (0..patches.len() as u32).into_par_iter().map(|p| average(input, patches, p)).collect();
        let mut optics = Optics {
            reflectance: Vec::with_capacity(average.len()),
            emission: Vec::new(),
            specular: input.scene.materials.iter().map(|m| !m.is_lambertian()).collect(),
        };
        for (patch, (reflectance, radiance)) in (0..).zip(average) {
            let ok = |x: f32| (0.0..=1.0 + SLACK).contains(&x); // false for NaN
            if !reflectance.to_array().into_iter().all(ok) {
                return Err(Error::Unsolvable(format!(
                    "{} has reflectance {reflectance}, which must lie in 0..=1",
                    owner(input, patches, patch)
                )));
            }
            optics.reflectance.push(reflectance.min(Vec3::ONE));
            if radiance.max_element() > 0.0 {
                let exitance = std::f64::consts::PI * radiance.as_dvec3();
                optics.emission.push((2 * patch, exitance));
                if let TriangleSource::Scene { triangle } = source(input, patches, patch)
                    && material(input.scene, triangle).double_sided
                {
                    optics.emission.push((2 * patch + 1, exitance));
                }
            }
        }
        Ok(optics)
    }

    /// Whether photons may have to be followed beyond their first hit at all.
    pub fn any_specular(&self) -> bool {
        self.specular.contains(&true)
    }

    /// Whether `material` may reflect or transmit without scattering.
    pub fn is_specular(&self, material: u32) -> bool {
        self.specular[material as usize]
    }
}

fn material(scene: &Scene, triangle: u32) -> &Material {
    &scene.materials[scene.mesh.object(triangle).material as usize]
}

fn source(input: &RadiosityScene<'_>, patches: &Patches, patch: u32) -> TriangleSource {
    input.geometry.sources[patches.triangle(patch) as usize]
}

fn owner(input: &RadiosityScene<'_>, patches: &Patches, patch: u32) -> String {
    match source(input, patches, patch) {
        TriangleSource::Scene { triangle } => {
            let object = input.scene.mesh.object(triangle);
            format!("material {} of {}", material(input.scene, triangle).name, object.name)
        }
        TriangleSource::BoxFace { cluster, face, .. } => format!("face {face} of the box of cluster {cluster}"),
    }
}

/// Mean diffuse reflectance and mean emitted radiance of a patch.
fn average(input: &RadiosityScene<'_>, patches: &Patches, patch: u32) -> (Vec3, Vec3) {
    if let Some(cell) = patches.box_cell[patch as usize] {
        let equivalent = &input.clusters[cell.cluster as usize].equivalent_box;
        return (equivalent.reflectance[usize::from(cell.face)][cell.index as usize], Vec3::ZERO);
    }
    let TriangleSource::Scene { triangle } = source(input, patches, patch) else {
        return (Vec3::ZERO, Vec3::ZERO); // boxes were dealt with
    };
    let scene = input.scene;
    let look = material(scene, triangle);
    let varies =
        look.base_color_texture.is_some() || look.emission_texture.is_some() || !scene.mesh.colors.is_empty();
    if look.is_lambertian() && !varies {
        return (look.base_color, look.emission);
    }
    let (mut reflectance, mut radiance) = (DVec3::ZERO, DVec3::ZERO);
    for i in 0..POINTS {
        let s = sampling::sobol(i, 0, patch);
        let (on, uv) = patches.sample(patch, [s[0], s[1]]);
        let TriangleSource::Scene { triangle } = input.geometry.sources[on as usize] else { continue };
        let point = SurfacePoint::new(scene, &Hit { t: 0.0, u: uv.x, v: uv.y, triangle });
        let toward = sampling::cosine_hemisphere(glam::Vec2::new(s[2], s[3]));
        // Light arrives on both sides of a surface; its back reflects like its front.
        let bsdf = Bsdf::new(scene, &point, sampling::basis(point.shading_normal) * toward, GLOSSY_THRESHOLD);
        reflectance += diffuse_albedo(&bsdf, i).as_dvec3();
        radiance += bsdf.emission().as_dvec3();
    }
    let n = f64::from(POINTS);
    ((reflectance / n).as_vec3(), (radiance / n).as_vec3())
}

/// Directional-hemispherical albedo of everything that scatters.
fn diffuse_albedo(bsdf: &Bsdf, index: u32) -> Vec3 {
    if let Some(reflectance) = bsdf.lambertian() {
        return reflectance;
    }
    let s = sampling::sobol(index, 1, 0);
    match bsdf.sample_high([s[0], s[1], s[2]]) {
        Some(sample) if sample.pdf.is_some() => bsdf.albedo_low() + bsdf.albedo_high(),
        _ => bsdf.albedo_low(),
    }
}
