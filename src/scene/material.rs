//! Surface materials: glTF's metallic-roughness model with the extensions that matter for light transport.

use glam::{Affine2, Vec3};

/// A texture as one parameter of a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureSlot {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: u32,
    /// Which set of texture coordinates, 0 or 1.
    pub uv_set: u8,
    /// `KHR_texture_transform`, applied to the coordinates.
    pub transform: Affine2,
}

/// Largest perceptual roughness of a surface that transmits like a mirror reflects: lobes under a tenth of a degree wide.
pub const MAX_SMOOTH_ROUGHNESS: f32 = 0.03;

/// What alpha means for a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// Alpha is ignored.
    Opaque,
    /// Present where alpha is at least the cutoff.
    Mask {
        /// Cutoff, 0..1.
        cutoff: f32,
    },
    /// Present with probability alpha (coverage).
    Blend,
}

/// A surface material. Colours are linear RGB reflectances or radiances.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name, for messages.
    pub name: String,
    /// Base colour, each band 0..=1: reflectance of the diffuse lobe or F0 of the metal.
    pub base_color: Vec3,
    /// Opacity, 0..=1: what alpha of texture and vertex colour are multiplied with.
    pub opacity: f32,
    /// Multiplies base colour and opacity.
    pub base_color_texture: Option<TextureSlot>,
    /// 0 dielectric ..= 1 metal.
    pub metallic: f32,
    /// Perceptual roughness 0..=1; the GGX width is its square.
    pub roughness: f32,
    /// Green multiplies roughness, blue metallic.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normal map.
    pub normal_texture: Option<TextureSlot>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
    /// Emitted radiance, W/(sr m^2) per band.
    pub emission: Vec3,
    /// Multiplies emission.
    pub emission_texture: Option<TextureSlot>,
    /// Index of refraction of the dielectric (`KHR_materials_ior`).
    pub ior: f32,
    /// Strength of the dielectric specular lobe (`KHR_materials_specular`), 0..=1.
    pub specular: f32,
    /// Alpha multiplies `specular`.
    pub specular_texture: Option<TextureSlot>,
    /// Colour of the dielectric specular lobe at normal incidence.
    pub specular_color: Vec3,
    /// Multiplies `specular_color`.
    pub specular_color_texture: Option<TextureSlot>,
    /// Share of the diffuse lobe replaced by transmission (`KHR_materials_transmission`), 0..=1.
    pub transmission: f32,
    /// Red multiplies `transmission`.
    pub transmission_texture: Option<TextureSlot>,
    /// Whether transmitted light refracts (`KHR_materials_volume` with thickness); otherwise it goes straight on.
    pub refracts: bool,
    /// Colour that white light takes on after [`Material::attenuation_distance`] inside.
    pub attenuation_color: Vec3,
    /// Distance for the attenuation colour; infinite for clear glass.
    pub attenuation_distance: f32,
    /// What alpha means.
    pub alpha: Alpha,
    /// Whether both faces emit. Both faces always reflect, with the same properties.
    pub double_sided: bool,
}

impl Default for Material {
    /// glTF's default material: white, fully rough metal.
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: Vec3::ONE,
            opacity: 1.0,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emission_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            refracts: false,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
            alpha: Alpha::Opaque,
            double_sided: false,
        }
    }
}

impl Material {
    /// A purely Lambertian reflector.
    pub fn lambertian(reflectance: Vec3) -> Self {
        Material { base_color: reflectance, metallic: 0.0, specular: 0.0, ..Material::default() }
    }

    /// A Lambertian reflector that emits `radiance` from its front face.
    pub fn emitter(radiance: Vec3, reflectance: Vec3) -> Self {
        Material { emission: radiance, ..Material::lambertian(reflectance) }
    }

    /// Whether it emits at all.
    pub fn is_emitter(&self) -> bool {
        self.emission.max_element() > 0.0
    }

    /// Whether light may leave it in a single direction for each that it comes from: smooth metals and coats, glass.
    pub fn may_be_sharp(&self) -> bool {
        let specular = self.metallic > 0.0 || self.specular > 0.0;
        let smooth = self.roughness < MAX_SMOOTH_ROUGHNESS || self.metallic_roughness_texture.is_some();
        self.transmission > 0.0 || (specular && smooth)
    }

    /// Whether it is Lambertian everywhere: no specular lobe, no transmission, no metal.
    pub fn is_lambertian(&self) -> bool {
        self.metallic == 0.0 && self.specular == 0.0 && self.transmission == 0.0
    }

    /// Whether light loses some of itself on its way through the inside.
    pub fn absorbs(&self) -> bool {
        let tinted = self.attenuation_distance.is_finite() && self.attenuation_color != Vec3::ONE;
        tinted && self.refracts && self.transmission > 0.0
    }

    /// Share of light that is left after `distance` on the inside (Beer and Lambert), of a material that [`absorbs`](Self::absorbs).
    pub fn left_after(&self, distance: f32) -> Vec3 {
        self.attenuation_color.powf(distance / self.attenuation_distance)
    }

    /// Whether it transmits light without scattering it: glass with a surface as smooth as a mirror's.
    pub fn transmits_smoothly(&self) -> bool {
        self.transmission > 0.0 && self.metallic < 1.0 && self.roughness <= MAX_SMOOTH_ROUGHNESS && !self.is_emitter()
    }

    /// All textures that it reads.
    pub fn texture_slots(&self) -> impl Iterator<Item = &TextureSlot> {
        let slots = [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emission_texture,
            &self.specular_texture,
            &self.specular_color_texture,
            &self.transmission_texture,
        ];
        slots.into_iter().flatten()
    }

    /// Those that may be averaged over a footprint.
    pub(super) fn filtered_slots(&self) -> impl Iterator<Item = &TextureSlot> {
        let base_color = if self.alpha == Alpha::Opaque { &self.base_color_texture } else { &None };
        let slots = [
            base_color,
            &self.metallic_roughness_texture,
            &self.specular_texture,
            &self.specular_color_texture,
            &self.transmission_texture,
        ];
        slots.into_iter().flatten()
    }

    /// Whether all values are possible; `textures` is the number of textures of the scene.
    pub(super) fn check(&self, textures: usize) -> Result<(), String> {
        let zero_one = |name: &str, values: &[f32]| match values.iter().all(|v| (0.0..=1.0).contains(v)) {
            true => Ok(()),
            false => Err(format!("material '{}': {name} is {values:?}, must lie in 0..=1", self.name)),
        };
        let at_least =
            |name: &str, values: &[f32], least: f32| match values.iter().all(|v| *v >= least && v.is_finite()) {
                true => Ok(()),
                false => Err(format!("material '{}': {name} is {values:?}, must be finite and >= {least}", self.name)),
            };
        zero_one("the base colour (reflectance)", &self.base_color.to_array())?;
        zero_one("the opacity", &[self.opacity])?;
        zero_one("metallic", &[self.metallic])?;
        zero_one("roughness", &[self.roughness])?;
        zero_one("specular", &[self.specular])?;
        zero_one("transmission", &[self.transmission])?;
        zero_one("the attenuation colour", &self.attenuation_color.to_array())?;
        at_least("the specular colour", &self.specular_color.to_array(), 0.0)?;
        at_least("the emission", &self.emission.to_array(), 0.0)?;
        at_least("the index of refraction", &[self.ior], 1.0)?;
        at_least("the scale of the normal map", &[self.normal_scale], f32::MIN)?;
        if let Alpha::Mask { cutoff } = self.alpha {
            at_least("the alpha cutoff", &[cutoff], 0.0)?;
        }
        if self.attenuation_distance.is_nan() || self.attenuation_distance <= 0.0 {
            let d = self.attenuation_distance;
            return Err(format!("material '{}': the attenuation distance is {d}, must be positive", self.name));
        }
        for slot in self.texture_slots() {
            if slot.texture as usize >= textures || slot.uv_set > 1 || !slot.transform.is_finite() {
                return Err(format!("material '{}': impossible use of texture {}", self.name, slot.texture));
            }
        }
        Ok(())
    }
}
