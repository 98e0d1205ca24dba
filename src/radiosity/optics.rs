//! What patches reflect and emit.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RadiosityScene;
use super::patches::Patches;
use crate::backend::Hit;
use crate::error::{Error, Result};
use crate::sampling;
use crate::scene::{Material, Scene};
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use crate::simplify::TriangleSource;

/// Points at which a material that varies over a patch is looked at.
const POINTS: u32 = 16;
/// Reflectance up to which rounding is forgiven.
const SLACK: f32 = 1e-5;

/// Reflectance and emission of patches.
pub(super) struct Optics {
    /// Diffuse reflectance of each patch, 0..=1: everything but mirror-like reflection, and transmission.
    pub reflectance: Vec<Vec3>,
    /// Sides that emit and their exitance in W/m^2, in ascending order.
    pub emission: Vec<(u32, DVec3)>,
    /// Whether a patch also reflects like a mirror or transmits.
    pub specular: Vec<bool>,
    /// Whether any does.
    pub any_specular: bool,
}

impl Optics {
    /// Averages the materials of `input` over `patches`.
    ///
    /// # Errors
    /// [`Error::Unsolvable`] when a surface reflects more than it receives, or less than nothing.
    pub fn new(input: &RadiosityScene<'_>, patches: &Patches) -> Result<Optics> {
        // A material that is the same everywhere is looked at on the first patch that has it.
        let mut looked_at = vec![None; input.scene.materials.len()];
        for patch in 0..patches.len() as u32 {
            if let Some(material) = even_material(input, patches, patch) {
                looked_at[material].get_or_insert_with(|| mean(input, patches, patch));
            }
        }
        let known = |patch: u32| even_material(input, patches, patch).and_then(|material| looked_at[material]);
        let look = |patch: u32| known(patch).unwrap_or_else(|| mean(input, patches, patch));
        let means: Vec<Mean> = (0..patches.len() as u32).into_par_iter().map(look).collect();
        let mut optics = Optics {
            reflectance: Vec::with_capacity(means.len()),
            emission: Vec::new(),
            specular: means.iter().map(|m| m.specular).collect(),
            any_specular: means.iter().any(|m| m.specular),
        };
        for (patch, Mean { reflectance, radiance, .. }) in (0..).zip(means) {
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

/// Means over a patch.
#[derive(Clone, Copy, Default)]
struct Mean {
    reflectance: Vec3,
    radiance: Vec3,
    specular: bool,
}

/// The material of a patch of the scene, where no texture or vertex colour changes it.
fn even_material(input: &RadiosityScene<'_>, patches: &Patches, patch: u32) -> Option<usize> {
    let TriangleSource::Scene { triangle } = source(input, patches, patch) else { return None };
    let even = input.scene.mesh.colors.is_empty() && material(input.scene, triangle).texture_slots().next().is_none();
    even.then(|| input.scene.mesh.object(triangle).material as usize)
}

fn mean(input: &RadiosityScene<'_>, patches: &Patches, patch: u32) -> Mean {
    if let Some(cell) = patches.box_cell[patch as usize] {
        let equivalent = &input.clusters[cell.cluster as usize].equivalent_box;
        let reflectance = equivalent.reflectance[usize::from(cell.face)][cell.index as usize];
        return Mean { reflectance, ..Mean::default() };
    }
    let TriangleSource::Scene { triangle } = source(input, patches, patch) else {
        return Mean::default(); // boxes were dealt with
    };
    let scene = input.scene;
    let look = material(scene, triangle);
    let varies = look.base_color_texture.is_some() || look.emission_texture.is_some() || !scene.mesh.colors.is_empty();
    if look.is_lambertian() && !varies {
        return Mean { reflectance: look.base_color, radiance: look.emission, specular: false };
    }
    let (mut reflectance, mut radiance, mut specular) = (DVec3::ZERO, DVec3::ZERO, false);
    for i in 0..POINTS {
        let s = sampling::sobol(i, 0, patch);
        let (on, uv) = patches.sample(patch, [s[0], s[1]]);
        let TriangleSource::Scene { triangle } = input.geometry.sources[on as usize] else { continue };
        let point = SurfacePoint::new(scene, &Hit { t: 0.0, u: uv.x, v: uv.y, triangle });
        let bsdf = Bsdf::new(scene, &point, point.shading_normal, Lobes::MIRRORS);
        reflectance += bsdf.mean_albedo_low().as_dvec3();
        specular |= bsdf.albedo_high() != Vec3::ZERO;
        if look.is_emitter() {
            radiance += scene.emission(triangle, uv.x, uv.y).as_dvec3();
        }
    }
    let n = f64::from(POINTS);
    Mean { reflectance: (reflectance / n).as_vec3(), radiance: (radiance / n).as_vec3(), specular }
}
