//! Textures: which images are needed, and their decoding.

use std::collections::BTreeMap;

use glam::Affine2;
use gltf::json::Root;
use gltf::json::texture::WrappingMode;
use rayon::prelude::*;

use super::buffers::Buffers;
use super::json::valid;
use crate::image::{Data, Pixels, decode_texture};
use crate::scene::{SceneBuilder, Texels, Texture, TextureSlot, Wrap};
use crate::srgb::srgb_decode;

/// How the numbers of an image are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Coding {
    /// Colour, sRGB-encoded.
    Color,
    /// Linear values.
    Data,
}

/// Collects what materials need; images that nothing needs are not read.
pub(super) struct Textures<'a> {
    root: &'a Root,
    /// Image, coding and wrap modes, and the number of the texture made of them.
    wanted: BTreeMap<(usize, Coding, [Wrap; 2]), u32>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(root: &'a Root) -> Self {
        Textures { root, wanted: BTreeMap::new() }
    }

    /// A use of texture `index` of the file.
    pub(super) fn slot(
        &mut self,
        index: usize,
        uv_set: u32,
        transform: Affine2,
        coding: Coding,
    ) -> Result<TextureSlot, String> {
        let texture = self.root.textures.get(index).ok_or_else(|| format!("texture {index} does not exist"))?;
        let image = texture.source.value();
        if image >= self.root.images.len() {
            return Err(format!("texture {index} has no image in a supported format (PNG or JPEG)"));
        }
        let Some(uv_set) = u8::try_from(uv_set).ok().filter(|&s| s < 2) else {
            return Err(format!("texture {index} uses TEXCOORD_{uv_set}; only sets 0 and 1 are supported"));
        };
        let wrap = |mode| match mode {
            Some(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Some(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            Some(WrappingMode::Repeat) | None => Wrap::Repeat,
        };
        let sampler = texture.sampler.and_then(|s| self.root.samplers.get(s.value()));
        let wraps = sampler.map_or([Wrap::Repeat; 2], |s| [wrap(valid(&s.wrap_s)), wrap(valid(&s.wrap_t))]);
        let next = self.wanted.len() as u32;
        let texture = *self.wanted.entry((image, coding, wraps)).or_insert(next);
        Ok(TextureSlot { texture, uv_set, transform })
    }

    /// Reads and decodes the images and adds the textures in the order of their numbers.
    pub(super) fn load(self, buffers: &Buffers<'_>, builder: &mut SceneBuilder) -> Result<(), String> {
        let mut wanted: Vec<_> = self.wanted.into_iter().collect();
        wanted.sort_by_key(|(_, number)| *number);
        let root = self.root;
        let decoded = wanted.into_par_iter().map(|((image, coding, wrap), _)| {
            let name = name(root, image);
            let fail = |e: String| format!("image {image} '{name}': {e}");
            let pixels = decode_texture(&name, &bytes(root, buffers, image).map_err(fail)?).map_err(fail)?;
            let (width, height) = (pixels.width, pixels.height);
            Ok(Texture { name, width, height, texels: texels(pixels, coding), wrap, smaller: Vec::new() })
        });
        // Collected before the first error is taken, so that the message does not depend on the threads.
        let decoded: Vec<Result<Texture, String>> = decoded.collect();
        for texture in decoded {
            builder.add_texture(texture?);
        }
        Ok(())
    }
}

fn texels(pixels: Pixels, coding: Coding) -> Texels {
    match (pixels.data, coding) {
        (Data::U8(bytes), Coding::Color) => Texels::Srgb8(bytes),
        (Data::U8(bytes), Coding::Data) => Texels::Linear8(bytes),
        // Integers of more than eight bits are encoded all the same.
        (Data::F32(mut values), Coding::Color) if !pixels.floating_point => {
            for rgba in values.chunks_exact_mut(4) {
                rgba[..3].iter_mut().for_each(|v| *v = srgb_decode(*v));
            }
            Texels::Float(values)
        }
        (Data::F32(values), _) => Texels::Float(values),
    }
}

fn name(root: &Root, image: usize) -> String {
    let image_ = &root.images[image];
    match (&image_.name, &image_.uri) {
        (_, Some(uri)) if !uri.starts_with("data:") => uri.clone(),
        (Some(name), _) => name.clone(),
        _ => format!("#{image}"),
    }
}

fn bytes(root: &Root, buffers: &Buffers<'_>, image: usize) -> Result<Vec<u8>, String> {
    let image = &root.images[image];
    match (&image.uri, &image.buffer_view) {
        (Some(uri), _) => buffers.resource(uri),
        (None, Some(view)) => Ok(buffers.view(view.value())?.0.to_vec()),
        (None, None) => Err("neither a URI nor a bufferView".into()),
    }
}
