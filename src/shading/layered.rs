//! Everything that is not plain Lambertian: diffuse under a coat, metal, glass, and mixtures of them.

use std::f32::consts::FRAC_1_PI;

use glam::{Mat3, Vec2, Vec3};

use super::albedo::{self, Split};
use super::bsdf::BsdfSample;
use super::glass::Glass;
use super::{fresnel, ggx};
use crate::backend::PartKind;
use crate::sampling::{basis, cosine_hemisphere};
use crate::scene::Material;

/// GGX width below which a lobe is a delta function: a ten-thousandth of a radian is less than a pixel sees.
const SMOOTH_ALPHA: f32 = 1e-4;

/// Cosine up to which a shading normal is turned towards the viewer when it faces away.
const MIN_VIEW_COSINE: f32 = 1e-3;

/// What the material does not say by itself: textures evaluated, and the point's geometry.
pub struct Local {
    /// Shading normal on the side of `outgoing`.
    pub normal: Vec3,
    /// Direction the light leaves in.
    pub outgoing: Vec3,
    /// Base colour, 0..=1.
    pub base_color: Vec3,
    /// 0..=1.
    pub metallic: f32,
    /// 0..=1.
    pub roughness: f32,
    /// Strength of the dielectric's specular lobe, 0..=1.
    pub specular: f32,
    /// Its colour at normal incidence.
    pub specular_color: Vec3,
    /// Share of what is no metal that transmits, 0..=1.
    pub transmission: f32,
    /// Whether `outgoing` is on the counter-clockwise side.
    pub front: bool,
}

/// A mixture of metal, coated diffuse and glass that share one roughness.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
    /// Columns are tangent, bitangent and shading normal.
    frame: Mat3,
    /// In `frame`.
    outgoing: Vec3,
    roughness: f32,
    alpha: f32,
    /// Whether specular reflection and transmission are delta functions.
    smooth: bool,
    /// Whether the specular lobe belongs to f_h.
    specular_is_high: bool,
    /// Schlick's colours of metal and coat together, weighted by their shares.
    f0: Vec3,
    f90: Vec3,
    /// Albedo of the specular lobe towards `outgoing`.
    specular_albedo: Vec3,
    /// Albedo of what scatters several times between microfacets, towards `outgoing`.
    multiple_albedo: Vec3,
    /// One over the cosine-weighted average of one minus the lossless albedo.
    multiple_scale: f32,
    /// Albedo of the diffuse base under the coat, towards `outgoing`.
    diffuse_albedo: Vec3,
    /// One over the cosine-weighted average of what the coat lets through.
    diffuse_scale: Vec3,
    /// Cosine-weighted average over `outgoing` of the weakly directional part's albedo.
    mean_albedo_low: Vec3,
    /// The same of diffuse and multiple scattering.
    mean_albedo_diffuse: Vec3,
    coat: Coat,
    glass: Option<Glass>,
}

/// Reflection of a dielectric coat, at full weight: what it takes from the base.
#[derive(Clone, Copy, Debug)]
struct Coat {
    f0: Vec3,
    f90: Vec3,
    multiple: Vec3,
}

impl Coat {
    /// Albedo, single and multiple scattering together.
    fn albedo(&self, split: Split) -> Vec3 {
        split.with(self.f0, self.f90) + self.multiple * (1.0 - split.total())
    }
}

/// Colour of light that met microfacets more than once (Kulla and Conty 2017): a geometric series of the average
/// Fresnel reflectance, of which the share `1 - e` is caught again each time.
fn multiple_color(f0: Vec3, f90: Vec3, average: f32) -> Vec3 {
    let f = albedo::SMOOTH_AVERAGE.with(f0, f90);
    f * f * average / (Vec3::ONE - f * (1.0 - average))
}

/// Whether a lobe of this roughness is a delta function.
pub fn is_smooth(roughness: f32) -> bool {
    roughness * roughness < SMOOTH_ALPHA
}

fn luminous(v: Vec3) -> f32 {
    v.element_sum()
}

impl Layered {
    /// Mixture for a material at a point.
    pub fn new(material: &Material, kind: PartKind, at: &Local, glossy_threshold: f32) -> Self {
        let transmission = (1.0 - at.metallic) * at.transmission;
        let opaque = (1.0 - at.metallic) - transmission;
        let mut glass = (transmission > 0.0).then(|| Glass::new(material, kind, transmission, at));
        let roughness = match &glass {
            // Nothing bends light at a boundary between equal indices, however rough.
            Some(glass) if glass.is_index_matched() => 0.0,
            _ => at.roughness,
        };
        let alpha = roughness * roughness;
        let smooth = is_smooth(roughness);

        let facing = at.normal.dot(at.outgoing);
        let normal = if facing < MIN_VIEW_COSINE {
            (at.normal + at.outgoing * (MIN_VIEW_COSINE - facing)).normalize()
        } else {
            at.normal
        };
        let frame = basis(normal);
        let outgoing = frame.transpose() * at.outgoing;

        let normal_reflectance = fresnel::at_normal(material.ior);
        let mut coat = Coat {
            f0: (normal_reflectance * at.specular_color).min(Vec3::ONE) * at.specular,
            // Grazing reflectance vanishes with F0, so that an index of one has no interface (Lagarde 2014).
            f90: Vec3::splat(at.specular * (50.0 * normal_reflectance).min(1.0)),
            multiple: Vec3::ZERO,
        };
        let mut multiple = Vec3::ZERO;
        let mut multiple_scale = 0.0;
        let mut here = albedo::smooth(outgoing.z);
        let mut average = albedo::SMOOTH_AVERAGE;
        if !smooth {
            here = albedo::directional(outgoing.z, roughness);
            average = albedo::average(roughness);
            coat.multiple = multiple_color(coat.f0, coat.f90, average.total());
            multiple = opaque * coat.multiple + at.metallic * multiple_color(at.base_color, Vec3::ONE, average.total());
            glass = glass.map(|glass| glass.with_compensation(outgoing.z, roughness, here.total()));
            multiple_scale = 1.0 / (1.0 - average.total()).max(f32::MIN_POSITIVE);
        }
        let f0 = at.metallic * at.base_color + opaque * coat.f0;
        let f90 = Vec3::splat(at.metallic) + opaque * coat.f90;
        let specular_is_high = smooth || roughness < glossy_threshold;
        let let_through = (Vec3::ONE - coat.albedo(average)).max(Vec3::splat(f32::MIN_POSITIVE));
        let mean_diffuse = opaque * at.base_color * let_through + multiple * (1.0 - average.total());
        let mean_rough = if specular_is_high { Vec3::ZERO } else { average.with(f0, f90) };
        Layered {
            frame,
            outgoing,
            roughness,
            alpha,
            smooth,
            specular_is_high,
            f0,
            f90,
            specular_albedo: here.with(f0, f90),
            multiple_albedo: multiple * (1.0 - here.total()).max(0.0),
            multiple_scale,
            diffuse_albedo: opaque * at.base_color * (Vec3::ONE - coat.albedo(here)).max(Vec3::ZERO),
            diffuse_scale: let_through.recip(),
            mean_albedo_low: mean_diffuse + mean_rough,
            mean_albedo_diffuse: mean_diffuse,
            coat,
            glass,
        }
    }

    /// Albedo of diffuse, multiple scattering and, when rough, specular reflection.
    pub fn albedo_low(&self) -> Vec3 {
        self.albedo_diffuse() + self.albedo_rough()
    }

    /// Albedo of diffuse and multiple scattering.
    pub fn albedo_diffuse(&self) -> Vec3 {
        self.diffuse_albedo + self.multiple_albedo
    }

    /// Albedo of rough specular reflection.
    pub fn albedo_rough(&self) -> Vec3 {
        if self.specular_is_high { Vec3::ZERO } else { self.specular_albedo }
    }

    /// Cosine-weighted average over outgoing directions of [`Layered::albedo_low`].
    pub fn mean_albedo_low(&self) -> Vec3 {
        self.mean_albedo_low
    }

    /// The same of [`Layered::albedo_diffuse`].
    pub fn mean_albedo_diffuse(&self) -> Vec3 {
        self.mean_albedo_diffuse
    }

    /// A direction (world) from the rough specular lobe alone, its `f cos / pdf` and `pdf`.
    pub fn sample_rough(&self, u: [f32; 2]) -> Option<(Vec3, Vec3, f32)> {
        let h = ggx::sample_visible(self.outgoing, self.alpha, u);
        let incoming = 2.0 * self.outgoing.dot(h) * h - self.outgoing;
        if incoming.z <= 0.0 {
            return None;
        }
        let lobe = Reflection::new(self.outgoing, incoming, self.alpha);
        let weight = self.schlick(lobe.along) * (lobe.value / lobe.pdf);
        (lobe.pdf > 0.0).then(|| (self.frame * incoming, weight, lobe.pdf))
    }

    /// Albedo of glass and, when not rough, specular reflection.
    pub fn albedo_high(&self) -> Vec3 {
        let specular = if self.specular_is_high { self.specular_albedo } else { Vec3::ZERO };
        let Some(glass) = &self.glass else { return specular };
        specular
            + if self.smooth {
                glass.smooth_albedo(self.outgoing)
            } else {
                glass.rough_albedo(self.outgoing, self.alpha)
            }
    }

    /// See [`super::Bsdf::straight_transmittance`].
    pub fn straight_transmittance(&self) -> Vec3 {
        match &self.glass {
            Some(glass) if self.smooth && glass.is_pane() => glass.fresnel(self.outgoing.z).1,
            _ => Vec3::ZERO,
        }
    }

    /// `f_l cos` for `incoming` (world) on the reflecting side of the geometric surface, and the sampling density.
    pub fn eval_low(&self, incoming: Vec3) -> (Vec3, f32) {
        self.low(self.frame.transpose() * incoming)
    }

    /// The part of [`Layered::eval_low`] that is no rough reflection.
    pub fn eval_diffuse(&self, incoming: Vec3) -> Vec3 {
        self.diffuse(self.frame.transpose() * incoming)
    }

    /// The rest of it, and the density of [`Layered::sample_rough`].
    pub fn eval_rough(&self, incoming: Vec3) -> (Vec3, f32) {
        self.rough(self.frame.transpose() * incoming)
    }

    /// A direction (world), `f_l cos / pdf` and `pdf`. The two lobes are one mixture density.
    pub fn sample_low(&self, u: [f32; 3]) -> Option<(Vec3, Vec3, f32)> {
        let incoming = if u[0] < self.diffuse_share() {
            cosine_hemisphere(Vec2::new(u[1], u[2]))
        } else {
            let h = ggx::sample_visible(self.outgoing, self.alpha, [u[1], u[2]]);
            2.0 * self.outgoing.dot(h) * h - self.outgoing
        };
        let (value, pdf) = self.low(incoming);
        (pdf > 0.0).then(|| (self.frame * incoming, value / pdf, pdf))
    }

    /// Probability of the cosine lobe in f_l's mixture.
    fn diffuse_share(&self) -> f32 {
        if self.specular_is_high {
            return 1.0;
        }
        let diffuse = luminous(self.diffuse_albedo + self.multiple_albedo);
        let specular = luminous(self.specular_albedo);
        if diffuse + specular > 0.0 { diffuse / (diffuse + specular) } else { 1.0 }
    }

    fn low(&self, incoming: Vec3) -> (Vec3, f32) {
        if incoming.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let share = self.diffuse_share();
        let (rough, rough_pdf) = self.rough(incoming);
        (self.diffuse(incoming) + rough, share * incoming.z * FRAC_1_PI + (1.0 - share) * rough_pdf)
    }

    fn diffuse(&self, incoming: Vec3) -> Vec3 {
        if incoming.z <= 0.0 {
            return Vec3::ZERO;
        }
        let there =
            if self.smooth { albedo::smooth(incoming.z) } else { albedo::directional(incoming.z, self.roughness) };
        let through = (Vec3::ONE - self.coat.albedo(there)).max(Vec3::ZERO) * self.diffuse_scale;
        let caught = (1.0 - there.total()).max(0.0) * self.multiple_scale;
        (self.diffuse_albedo * through + self.multiple_albedo * caught) * (incoming.z * FRAC_1_PI)
    }

    fn rough(&self, incoming: Vec3) -> (Vec3, f32) {
        if self.specular_is_high || incoming.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let lobe = Reflection::new(self.outgoing, incoming, self.alpha);
        (self.schlick(lobe.along) * lobe.value, lobe.pdf)
    }

    fn schlick(&self, along: f32) -> Vec3 {
        self.f0 + (self.f90 - self.f0) * fresnel::schlick_weight(along)
    }

    /// Reflectance and transmittance of f_h at microfacets whose normal has cosine `along` with `outgoing`.
    fn high_fresnel(&self, along: f32) -> (Vec3, Vec3) {
        let specular = if self.specular_is_high { self.schlick(along) } else { Vec3::ZERO };
        let (reflected, transmitted) = self.glass.as_ref().map_or_else(Default::default, |glass| glass.fresnel(along));
        (specular + reflected, transmitted)
    }

    /// `f_h cos` without delta functions and the sampling density, for `incoming` (world); `behind`: it is on the
    /// other side of the geometric surface.
    pub fn eval_high(&self, incoming: Vec3, behind: bool) -> (Vec3, f32) {
        const NOTHING: (Vec3, f32) = (Vec3::ZERO, 0.0);
        let local = self.frame.transpose() * incoming;
        if self.smooth || (local.z < 0.0) != behind || local.z == 0.0 {
            return NOTHING;
        }
        let lobe = if behind {
            let Some(lobe) = self.glass.as_ref().and_then(|g| g.transmission(self.outgoing, local, self.alpha)) else {
                return NOTHING;
            };
            lobe
        } else {
            Reflection::new(self.outgoing, local, self.alpha)
        };
        let (reflected, transmitted) = self.high_fresnel(lobe.along);
        let Some(share) = reflected_share(reflected, transmitted) else { return NOTHING };
        if behind {
            (transmitted * lobe.value, (1.0 - share) * lobe.pdf)
        } else {
            (reflected * lobe.value, share * lobe.pdf)
        }
    }

    /// Samples f_h: a microfacet, then reflection or transmission by their shares there.
    pub fn sample_high(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let h = if self.smooth { Vec3::Z } else { ggx::sample_visible(self.outgoing, self.alpha, [u[1], u[2]]) };
        let along = self.outgoing.dot(h);
        let (reflected, transmitted) = self.high_fresnel(along);
        let share = reflected_share(reflected, transmitted)?;
        let transmits = u[0] >= share;
        let (probability, color) = if transmits { (1.0 - share, transmitted) } else { (share, reflected) };
        let glass = self.glass.as_ref().filter(|_| transmits);
        let incoming = match glass {
            Some(glass) => glass.transmit(self.outgoing, h)?,
            None => 2.0 * along * h - self.outgoing,
        };
        if (incoming.z < 0.0) != transmits || incoming.z == 0.0 {
            return None;
        }
        let mut weight = color / probability;
        let mut pdf = None;
        if self.smooth {
            weight *= glass.map_or(1.0, Glass::radiance_scale);
        } else {
            let lobe = match glass {
                Some(glass) => glass.transmission(self.outgoing, incoming, self.alpha)?,
                None => Reflection::new(self.outgoing, incoming, self.alpha),
            };
            if lobe.pdf <= 0.0 {
                return None;
            }
            weight *= lobe.value / lobe.pdf;
            pdf = Some(probability * lobe.pdf);
        }
        Some(BsdfSample {
            direction: self.frame * incoming,
            weight,
            pdf,
            transmitted: transmits,
            straight: self.smooth && glass.is_some_and(Glass::is_pane),
        })
    }
}

/// Probability of reflection among reflection and transmission; `None` when both are black.
fn reflected_share(reflected: Vec3, transmitted: Vec3) -> Option<f32> {
    let (r, t) = (luminous(reflected), luminous(transmitted));
    (r + t > 0.0).then(|| r / (r + t))
}

/// A GGX lobe without its Fresnel term, for one pair of directions.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// Cosine between `outgoing` and the microfacet.
    pub along: f32,
    /// `f cos` for a Fresnel term of one.
    pub value: f32,
    /// Density of sampling a visible microfacet and following it.
    pub pdf: f32,
}

impl Reflection {
    /// Reflection of light from `incoming` to `outgoing`, both above the surface, in its frame.
    pub fn new(outgoing: Vec3, incoming: Vec3, alpha: f32) -> Self {
        let h = (outgoing + incoming).normalize();
        let scale = ggx::distribution(h, alpha) / (4.0 * outgoing.z);
        Reflection {
            along: outgoing.dot(h),
            value: scale * ggx::masking_shadowing(outgoing, incoming, alpha),
            pdf: scale * ggx::masking(outgoing, alpha),
        }
    }
}
