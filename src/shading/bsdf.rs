//! The scattering function at a point.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3, Vec4};

use super::SurfacePoint;
use super::layered::{self, Layered, Local};
use crate::sampling::{basis, cosine_hemisphere};
use crate::scene::{Scene, TextureSlot};

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction towards which light is followed.
    pub direction: Vec3,
    /// `f cos / pdf` per band.
    pub weight: Vec3,
    /// Density per solid angle; `None` for a delta lobe.
    pub pdf: Option<f32>,
    /// Whether the direction lies on the other side of the surface.
    pub transmitted: bool,
    /// Transmitted without bending: shadow rays account for this path already. Only on
    /// [`PartKind::Pane`](crate::backend::PartKind::Pane), as shadow rays stop at everything else.
    pub straight: bool,
}

/// The scattering function at a point seen from one side. All directions are unit, world space, and point away
/// from the surface.
///
/// glTF's metallic-roughness model, with these differences, each of which conserves energy where the specification's
/// sample code does not: the diffuse lobe gets what the coat leaves (Kulla and Conty 2017), in place of a mix by
/// Fresnel's term; light scattered between microfacets several times is returned; transmitting surfaces use the
/// exact Fresnel equations in place of Schlick's. The part that reflects is reciprocal; rough glass, whose lobes are scaled
/// towards the viewer, is not. Glass always belongs to f_h, whatever its roughness.
///
/// Paths carry radiance from the light to the camera: where light enters a refracting solid seen from outside,
/// `f` is divided by the square of the index of refraction, and multiplied where it leaves (pbrt 4ed 9.5.2).
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    emission: Vec3,
    /// On the side of `outgoing`, as is `shading_normal`.
    geometric_normal: Vec3,
    shading_normal: Vec3,
    outgoing: Vec3,
    /// Of the Lambertian surface; unused with `layered`.
    reflectance: Vec3,
    /// `None` for a Lambertian surface.
    layered: Option<Layered>,
}

/// How the specular lobes of opaque surfaces are told apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobes {
    /// Roughness below which a specular lobe counts as highly directional.
    pub threshold: f32,
    /// Smoother reflection of opaque surfaces is taken to be this rough (a bias: reflections blur, energy is kept). What is at
    /// least as rough as the threshold leaves no opaque surface highly directional. Zero changes nothing.
    pub least_roughness: f32,
    /// Whether perfectly smooth reflection stays as it is all the same.
    pub mirrors: bool,
}

impl Lobes {
    /// Only perfectly smooth reflection is highly directional.
    pub const MIRRORS: Lobes = Lobes { threshold: 0.0, least_roughness: 0.0, mirrors: true };
}

impl Bsdf {
    /// The scattering function at `point` of material `scene.mesh.object(point.triangle).material` for light leaving
    /// towards `outgoing`.
    pub fn new(scene: &Scene, point: &SurfacePoint, outgoing: Vec3, lobes: Lobes) -> Self {
        let object = scene.mesh.object(point.triangle);
        let material = &scene.materials[object.material as usize];
        let front = outgoing.dot(point.geometric_normal) >= 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let mut emission = Vec3::ZERO;
        if material.is_emitter() && (front || material.double_sided) {
            emission = scene.emission(point.triangle, point.u, point.v);
        }
        let base_color = scene.base_color_over(point.triangle, point.u, point.v, point.footprint);
        let shading_normal = side * point.shading_normal;
        let layered = (!material.is_lambertian()).then(|| {
            let texel = |slot: &Option<TextureSlot>| {
                let slot = slot.as_ref()?;
                Some(scene.texture_over(slot, point.triangle, point.u, point.v, point.footprint))
            };
            let surface = texel(&material.metallic_roughness_texture).unwrap_or(Vec4::ONE);
            let mut roughness = material.roughness * surface.y;
            if material.transmission == 0.0 && !(lobes.mirrors && layered::is_smooth(roughness)) {
                roughness = roughness.max(lobes.least_roughness);
            }
            let at = Local {
                normal: shading_normal,
                outgoing,
                base_color,
                metallic: material.metallic * surface.z,
                roughness,
                specular: material.specular * texel(&material.specular_texture).map_or(1.0, |t| t.w),
                specular_color: material.specular_color
                    * texel(&material.specular_color_texture).map_or(Vec3::ONE, |t| t.truncate()),
                transmission: material.transmission * texel(&material.transmission_texture).map_or(1.0, |t| t.x),
                front,
            };
            Layered::new(material, object.kind, &at, lobes.threshold)
        });
        Bsdf {
            emission,
            geometric_normal: side * point.geometric_normal,
            shading_normal,
            outgoing,
            reflectance: base_color,
            layered,
        }
    }

    /// Emitted radiance towards `outgoing`, W/(sr m^2).
    pub fn emission(&self) -> Vec3 {
        self.emission
    }

    /// `Some(reflectance)` when the point is Lambertian: the fast path.
    pub fn lambertian(&self) -> Option<Vec3> {
        self.layered.is_none().then_some(self.reflectance)
    }

    /// Directional-hemispherical reflectance of the weakly directional part for this outgoing direction, in 0..=1.
    pub fn albedo_low(&self) -> Vec3 {
        self.layered.as_ref().map_or(self.reflectance, Layered::albedo_low)
    }

    /// The diffuse share of [`Bsdf::albedo_low`], as if it were Lambertian.
    pub fn albedo_diffuse(&self) -> Vec3 {
        self.layered.as_ref().map_or(self.reflectance, Layered::albedo_diffuse)
    }

    /// The rest of it: rough reflection.
    pub fn albedo_rough(&self) -> Vec3 {
        self.layered.as_ref().map_or(Vec3::ZERO, Layered::albedo_rough)
    }

    /// Mean of [`Bsdf::albedo_low`] over outgoing directions, weighted by their cosine: the reflectance of a diffuse surface that reflects
    /// as much.
    pub fn mean_albedo_low(&self) -> Vec3 {
        self.layered.as_ref().map_or(self.reflectance, Layered::mean_albedo_low)
    }

    /// The same of [`Bsdf::albedo_diffuse`].
    pub fn mean_albedo_diffuse(&self) -> Vec3 {
        self.layered.as_ref().map_or(self.reflectance, Layered::mean_albedo_diffuse)
    }

    /// The same of the highly directional part (reflection and transmission): the share of power that goes on,
    /// without the change of radiance by the index of refraction.
    pub fn albedo_high(&self) -> Vec3 {
        self.layered.as_ref().map_or(Vec3::ZERO, Layered::albedo_high)
    }

    /// Share of light that passes in a straight line and reaches `outgoing`: what a shadow ray through this pane is
    /// multiplied with. Zero where [`BsdfSample::straight`] is never set.
    pub fn straight_transmittance(&self) -> Vec3 {
        self.layered.as_ref().map_or(Vec3::ZERO, Layered::straight_transmittance)
    }

    /// `f_l cos` for light arriving from `incoming`.
    pub fn eval_low(&self, incoming: Vec3) -> Vec3 {
        self.eval_low_with_pdf(incoming).0
    }

    /// The part of [`Bsdf::eval_low`] that is no rough reflection.
    pub fn eval_diffuse(&self, incoming: Vec3) -> Vec3 {
        match &self.layered {
            Some(layered) if self.geometric_normal.dot(incoming) > 0.0 => layered.eval_diffuse(incoming),
            Some(_) => Vec3::ZERO,
            None => self.eval_low(incoming),
        }
    }

    /// The rest of it, and the density of [`Bsdf::sample_rough`].
    pub fn eval_rough(&self, incoming: Vec3) -> (Vec3, f32) {
        match &self.layered {
            Some(layered) if self.geometric_normal.dot(incoming) > 0.0 => layered.eval_rough(incoming),
            _ => (Vec3::ZERO, 0.0),
        }
    }

    /// Whether rough reflection is all that is not diffuse: then what arrives along samples of [`Bsdf::sample_low`] may share light sources
    /// with next-event estimation.
    pub fn is_rough(&self) -> bool {
        let rough = |layered: &Layered| layered.albedo_rough() != Vec3::ZERO && layered.albedo_high() == Vec3::ZERO;
        self.layered.as_ref().is_some_and(rough)
    }

    /// [`Bsdf::eval_low`] and the density with which [`Bsdf::sample_low`] chooses `incoming`.
    pub fn eval_low_with_pdf(&self, incoming: Vec3) -> (Vec3, f32) {
        if self.geometric_normal.dot(incoming) <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        match &self.layered {
            None => {
                let pdf = self.shading_normal.dot(incoming).max(0.0) * FRAC_1_PI;
                (self.reflectance * pdf, pdf)
            }
            Some(layered) => layered.eval_low(incoming),
        }
    }

    /// `f_h cos` of the part of f_h that is no delta function, and its sampling density.
    pub fn eval_high(&self, incoming: Vec3) -> (Vec3, f32) {
        match &self.layered {
            None => (Vec3::ZERO, 0.0),
            Some(layered) => layered.eval_high(incoming, self.geometric_normal.dot(incoming) < 0.0),
        }
    }

    /// Samples `f_l cos`; `u` uniform in 0..1.
    pub fn sample_low(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let (direction, weight, pdf) = match &self.layered {
            None => {
                let local = cosine_hemisphere(Vec2::new(u[1], u[2]));
                (basis(self.shading_normal) * local, self.reflectance, local.z * FRAC_1_PI)
            }
            Some(layered) => layered.sample_low(u)?,
        };
        (self.geometric_normal.dot(direction) > 0.0 && pdf > 0.0).then_some(BsdfSample {
            direction,
            weight,
            pdf: Some(pdf),
            transmitted: false,
            straight: false,
        })
    }

    /// Samples the rough reflection in `f_l cos`; `u` uniform in 0..1.
    pub fn sample_rough(&self, u: [f32; 2]) -> Option<BsdfSample> {
        let (direction, weight, pdf) = self.layered.as_ref()?.sample_rough(u)?;
        let above = self.geometric_normal.dot(direction) > 0.0;
        above.then_some(BsdfSample { direction, weight, pdf: Some(pdf), transmitted: false, straight: false })
    }

    /// Samples `f_h cos`; `u` uniform in 0..1.
    pub fn sample_high(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let mut sample = self.layered.as_ref()?.sample_high(u)?;
        if sample.straight {
            // Exactly straight, whatever the shading frame did to it.
            sample.direction = -self.outgoing;
        }
        let behind = self.geometric_normal.dot(sample.direction) < 0.0;
        (behind == sample.transmitted).then_some(sample)
    }
}
