//! Reading an image file.

use std::path::Path;

use super::buffer::Image;
use super::metadata::{Metadata, Value};
use super::oiio::{Attempt, Reader};
use crate::error::{Error, Result};
use crate::srgb::srgb_decode;

/// Reads the first image of a file. Integer files are decoded from sRGB unless they say that they are linear, so the
/// result is linear whatever the format; opacity stays as stored.
pub fn read(path: &Path) -> Result<Image> {
    read_with_metadata(path).map(|(image, _)| image)
}

/// As [`read`], with the entries of the file's header.
pub fn read_with_metadata(path: &Path) -> Result<(Image, Metadata)> {
    attempt(path).map_err(|reason| Error::Input { path: path.to_owned(), reason })
}

fn attempt(path: &Path) -> Attempt<(Image, Metadata)> {
    let file = std::fs::metadata(path).map_err(|error| error.to_string())?;
    // Anything else (a pipe, a device) might block or never end.
    if !file.is_file() {
        return Err(if file.is_dir() { "this is a folder, not an image" } else { "not a regular file" }.to_owned());
    }
    if file.len() == 0 {
        return Err("the file is empty".to_owned());
    }
    let mut reader = Reader::open(path)?;
    let metadata = reader.metadata();
    let names = reader.channel_names();
    let interleaved = reader.read_f32(names.len(), names.len())?;
    let decode = !reader.is_floating() && !says_linear(&metadata);

    let mut image = Image::new(reader.width(), reader.height());
    for (index, name) in names.iter().enumerate() {
        let values = interleaved[index..].iter().step_by(names.len()).copied();
        let values = if decode && reader.alpha_channel() != Some(index) {
            values.map(srgb_decode).collect()
        } else {
            values.collect()
        };
        if image.channel(name).is_some() {
            return Err(format!("it has two channels named {name:?}"));
        }
        image.push(name.clone(), values);
    }
    Ok((image, metadata))
}

/// OpenImageIO's names for linear colour: `Linear`, `scene_linear`, since 2.5 `lin_rec709` and others.
fn says_linear(metadata: &Metadata) -> bool {
    match metadata.get("oiio:ColorSpace") {
        Some(Value::Text(space)) => {
            let space = space.to_ascii_lowercase();
            space.starts_with("lin") || space == "scene_linear"
        }
        _ => false,
    }
}
