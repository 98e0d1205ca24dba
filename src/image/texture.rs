//! Decoding the images of a scene file, which may lie in memory.

use std::io::Write;

use super::oiio::{Attempt, Reader};

/// A decoded texture: RGBA whatever the file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// `width * height * 4` values, row by row from the top as stored, colour not multiplied by opacity.
    pub data: Data,
    /// Whether the file stores floating-point numbers, which are linear by convention. Integers mean what the scene
    /// file says they mean: sRGB for colour, linear for other quantities; nothing has been decoded.
    pub floating_point: bool,
}

/// Texel storage.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// The file has eight bits per channel or less.
    U8(Vec<u8>),
    /// The file has more; integers are scaled to 0..1.
    F32(Vec<f32>),
}

/// Decodes an image file that lies in memory. `name` (a file name or MIME type) says by what follows its last `.` or
/// `/` which format it is, if its first bytes do not. The error is a reason, without the name.
pub fn decode_texture(name: &str, bytes: &[u8]) -> std::result::Result<Pixels, String> {
    if bytes.is_empty() {
        return Err("the image is empty".to_owned());
    }
    let suffix = format!(".{}", format_of(name, bytes));
    // Not every format is read from memory (WebP and Netpbm are not in 2.4).
    let mut spilled = tempfile::Builder::new();
    let _file;
    let mut reader = match Reader::from_memory(&format!("memory{suffix}"), bytes) {
        Ok(reader) => reader,
        Err(_) => {
            let mut file = spilled.suffix(&suffix).tempfile().map_err(|error| error.to_string())?;
            file.write_all(bytes).and_then(|()| file.flush()).map_err(|error| error.to_string())?;
            let reader = Reader::open(file.path())?;
            _file = file; // removed after the reader is done
            reader
        }
    };
    let (width, height) = (reader.width(), reader.height());
    let floating_point = reader.is_floating();
    let data = if reader.is_8_bit() && !floating_point {
        Data::U8(rgba(&mut reader, Reader::read_u8, 0, 255)?)
    } else {
        Data::F32(rgba(&mut reader, Reader::read_f32, 0.0, 1.0)?)
    };
    Ok(Pixels { width, height, data, floating_point })
}

/// Extension of the format. The contents have the last word on the formats of glTF, whose files are often misnamed.
fn format_of<'a>(name: &'a str, bytes: &[u8]) -> &'a str {
    if bytes.starts_with(b"\x89PNG") {
        "png"
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        "jpg"
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        "webp"
    } else {
        name.rsplit(['.', '/']).next().unwrap_or(name)
    }
}

/// Reads the colour channels and opacity into pixels of four values and fills in what the file does not have.
fn rgba<'memory, T: Copy>(
    reader: &mut Reader<'memory>,
    read: impl FnOnce(&mut Reader<'memory>, usize, usize) -> Attempt<Vec<T>>,
    zero: T,
    one: T,
) -> Attempt<Vec<T>> {
    let alpha = reader.alpha_channel();
    let (colours, has_alpha) = match reader.channels() {
        1 => (1, false),
        2 if alpha == Some(1) => (1, true),
        2 => (2, false),
        3 => (3, false),
        _ => (3, alpha == Some(3)),
    };
    let mut values = read(reader, colours + usize::from(has_alpha), 4)?;
    if colours == 3 && has_alpha {
        return Ok(values);
    }
    for pixel in values.chunks_exact_mut(4) {
        let opacity = if has_alpha { pixel[colours] } else { one };
        match colours {
            1 => (pixel[1], pixel[2]) = (pixel[0], pixel[0]),
            2 => pixel[2] = zero,
            _ => (),
        }
        pixel[3] = opacity;
    }
    Ok(values)
}
