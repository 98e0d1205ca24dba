//! What the radiosity solution says of a point of the far field, and what is worked out there besides.

use glam::Vec3;

use super::path::Path;
use crate::lighting::LightSample;
use crate::scene::Material;
use crate::shading::{Bsdf, fresnel, share_of};

/// Share of paths that gather rough reflection apart from diffuse, per unit of its albedo.
const PATHS_PER_ALBEDO: f32 = 4.0;

/// Share of looked-up radiance above which what a light source adds by rough reflection is always brought.
const LITTLE: f32 = 0.5;

/// What the radiosity solution says of a point of the far field.
#[derive(Clone, Copy, Debug)]
pub struct LookUp {
    /// Reflected radiance, W/(sr m^2).
    pub radiance: Vec3,
    /// Whether direct light is not in it and is to be sampled at the point.
    pub unlit: bool,
    /// Whether rough reflection, which is in it as if it were diffuse, is to be followed instead.
    pub rough: bool,
    /// Probability with which what is not in it is worked out: the others are taken for diffuse.
    pub probability: f32,
}

impl LookUp {
    /// What is reflected diffusely towards the direction from which `bsdf` is seen, over the radiance.
    pub fn diffuse_share(&self, bsdf: &Bsdf) -> Vec3 {
        if !self.rough {
            return Vec3::ONE;
        }
        share_of(bsdf.albedo_diffuse(), bsdf.mean_albedo_low(), Vec3::ZERO)
    }

    /// `f cos` for a sampled light source, of what is not in the radiance: rough and glossy reflection, and all of it where direct light is not.
    /// `carried`: photons bring the light that the point bends.
    pub fn scattered(&self, bsdf: &Bsdf, carried: bool, path: &Path, light: &LightSample) -> Vec3 {
        let mut reflected = Vec3::ZERO;
        if !carried {
            let (high, pdf) = bsdf.eval_high(light.direction);
            reflected += high * light.share(pdf);
        }
        if self.rough {
            let (rough, pdf) = bsdf.eval_rough(light.direction);
            reflected += rough * light.share(pdf);
        }
        if self.unlit {
            let diffuse = if self.rough { bsdf.eval_diffuse(light.direction) } else { bsdf.eval_low(light.direction) };
            return diffuse + reflected;
        }
        // What is little against what is looked up is brought by some paths for all.
        let brings = (reflected * light.weight).element_sum();
        let survival = (brings / (LITTLE * self.radiance.element_sum()).max(f32::MIN_POSITIVE)).min(1.0);
        if survival > 0.0 && path.random(0)[3] < survival * self.probability {
            reflected / survival
        } else {
            Vec3::ZERO
        }
    }
}

/// Probability of following rough reflection of this albedo apart from diffuse: little light is left, and some paths bring it for all.
pub(super) fn rough_probability(albedo: f32) -> f32 {
    (PATHS_PER_ALBEDO * albedo).min(1.0)
}

/// Bound of the albedo of a material's rough reflection towards directions with this cosine, in 0..=1; 1 where its reflection may be anything.
pub(super) fn most_specular(material: &Material, cosine: f32) -> f32 {
    if material.is_emitter() || material.may_be_sharp() || material.metallic > 0.0 {
        return 1.0;
    }
    let f0 = fresnel::at_normal(material.ior) * material.specular_color.max_element();
    material.specular * (f0 + (1.0 - f0) * fresnel::schlick_weight(cosine)).min(1.0)
}
