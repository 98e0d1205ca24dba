//! Materials.

use glam::{Affine2, Vec2, Vec3};
use gltf::json::material::AlphaMode;
use gltf::json::{Root, texture};
use serde_json::Value;

use super::json::valid;
use super::textures::{Coding, Textures};
use crate::scene::{Alpha, Material, SceneBuilder, TextureSlot};

/// Stands in for the infinite index of refraction that `KHR_materials_ior` writes as 0 (a perfect mirror).
const MIRROR_IOR: f32 = 1000.0;

/// Converts material `index` of the file and asks for its textures.
pub(super) fn convert(
    root: &Root,
    index: usize,
    textures: &mut Textures<'_>,
    builder: &mut SceneBuilder,
) -> Result<Material, String> {
    let source = &root.materials[index];
    let name = source.name.clone().unwrap_or_else(|| format!("#{index}"));
    let mut slot = |info: &texture::Info, coding: Coding| -> Result<TextureSlot, String> {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let (affine, set) = match transform {
            Some(t) => (affine(t.offset.0, t.rotation.0, t.scale.0), t.tex_coord.unwrap_or(info.tex_coord)),
            None => (Affine2::IDENTITY, info.tex_coord),
        };
        textures.slot(info.index.value(), set, affine, coding).map_err(|e| format!("material '{name}': {e}"))
    };
    let pbr = &source.pbr_metallic_roughness;
    let [r, g, b, opacity] = pbr.base_color_factor.0;
    let mut material = Material {
        base_color: Vec3::new(r, g, b),
        opacity,
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        emission: Vec3::from_array(source.emissive_factor.0),
        double_sided: source.double_sided,
        ..Material::default()
    };
    material.alpha = match valid(&source.alpha_mode).ok_or_else(|| format!("material '{name}': unknown alphaMode"))? {
        AlphaMode::Opaque => Alpha::Opaque,
        AlphaMode::Mask => Alpha::Mask { cutoff: source.alpha_cutoff.map_or(0.5, |c| c.0) },
        AlphaMode::Blend => Alpha::Blend,
    };
    material.base_color_texture = pbr.base_color_texture.as_ref().map(|t| slot(t, Coding::Color)).transpose()?;
    material.metallic_roughness_texture =
        pbr.metallic_roughness_texture.as_ref().map(|t| slot(t, Coding::Data)).transpose()?;
    material.emission_texture = source.emissive_texture.as_ref().map(|t| slot(t, Coding::Color)).transpose()?;
    if let Some(extensions) = &source.extensions {
        extend(&mut material, extensions, &mut slot)?;
        if extensions.others.contains_key("KHR_materials_unlit") {
            // Unlit is not a thing in a world with light: the colour is taken for a reflectance.
            (material.metallic, material.roughness, material.specular) = (0.0, 1.0, 0.0);
            builder.warn(format!("material '{name}' is unlit; it is treated as a matt surface of its colour"));
        }
    }
    if let Some(normal) = &source.normal_texture {
        let others = normal.extensions.as_ref().map(|e| &e.others);
        let (affine, set) = transform_of(others.and_then(|o| o.get("KHR_texture_transform")))
            .map_err(|e| format!("material '{name}': normal texture: {e}"))?;
        let set = set.unwrap_or(normal.tex_coord);
        let slot = textures.slot(normal.index.value(), set, affine, Coding::Data);
        material.normal_texture = Some(slot.map_err(|e| format!("material '{name}': {e}"))?);
        material.normal_scale = normal.scale;
    }
    material.name = name;
    Ok(material)
}

fn extend(
    material: &mut Material,
    extensions: &gltf::json::extensions::material::Material,
    slot: &mut impl FnMut(&texture::Info, Coding) -> Result<TextureSlot, String>,
) -> Result<(), String> {
    let mut optional = |info: &Option<texture::Info>, coding| info.as_ref().map(|info| slot(info, coding)).transpose();
    if let Some(strength) = &extensions.emissive_strength {
        material.emission *= strength.emissive_strength.0;
    }
    if let Some(ior) = &extensions.ior {
        material.ior = if ior.ior.0 == 0.0 { MIRROR_IOR } else { ior.ior.0 };
    }
    if let Some(specular) = &extensions.specular {
        material.specular = specular.specular_factor.0;
        material.specular_color = Vec3::from_array(specular.specular_color_factor.0);
        material.specular_texture = optional(&specular.specular_texture, Coding::Data)?;
        material.specular_color_texture = optional(&specular.specular_color_texture, Coding::Color)?;
    }
    if let Some(transmission) = &extensions.transmission {
        material.transmission = transmission.transmission_factor.0;
        material.transmission_texture = optional(&transmission.transmission_texture, Coding::Data)?;
    }
    if let Some(volume) = &extensions.volume {
        // How thick it is says the geometry.
        material.refracts = volume.thickness_factor.0 > 0.0;
        material.attenuation_color = Vec3::from_array(volume.attenuation_color.0);
        material.attenuation_distance = volume.attenuation_distance.0;
    }
    Ok(())
}

/// `KHR_texture_transform`: translation times rotation times scale.
fn affine(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> Affine2 {
    // The extension turns coordinates clockwise in the image, whose v runs down.
    Affine2::from_scale_angle_translation(Vec2::from_array(scale), -rotation, Vec2::from_array(offset))
}

/// The same from raw JSON, for the places where the `gltf` crate does not parse it.
fn transform_of(value: Option<&Value>) -> Result<(Affine2, Option<u32>), String> {
    #[derive(Default, serde::Deserialize)]
    #[serde(default, rename_all = "camelCase")]
    struct Transform {
        offset: [f32; 2],
        rotation: f32,
        scale: Option<[f32; 2]>,
        tex_coord: Option<u32>,
    }
    let Some(value) = value else { return Ok((Affine2::IDENTITY, None)) };
    let t = <Transform as serde::Deserialize>::deserialize(value).map_err(|e| e.to_string())?;
    Ok((affine(t.offset, t.rotation, t.scale.unwrap_or([1.0; 2])), t.tex_coord))
}
