//! Joining the parts of an image.

use std::path::{Path, PathBuf};

use super::buffer::Image;
use super::input::read_with_metadata;
use super::metadata::{Metadata, Value};
use crate::error::{Error, Result};

/// Header entry that says which pixels of the whole image a part holds: left, top, and those after right and bottom.
pub const REGION: &str = "gsii:region";

/// A part and where it belongs.
struct Part<'a> {
    path: &'a Path,
    image: Image,
    metadata: Metadata,
    low: [u32; 2],
    whole: [u32; 2],
}

/// Reads the parts of an image, which must cover it exactly once, and joins them. Every value keeps its bits; header entries
/// stay that are the same in all parts.
///
/// # Errors
/// Files that are no parts, or not of one image, with what is missing or there twice.
pub fn merge(paths: &[PathBuf]) -> Result<(Image, Metadata)> {
    let parts = paths.iter().map(|path| Part::read(path)).collect::<Result<Vec<_>>>()?;
    let Some(first) = parts.first() else {
        return Err(Error::Usage("there are no parts to merge".to_owned()));
    };
    let names = |part: &Part| part.image.channels().iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    let [width, height] = first.whole;
    let mut holder: Vec<u32> = vec![u32::MAX; width as usize * height as usize];
    for (number, part) in parts.iter().enumerate() {
        if part.whole != first.whole || names(part) != names(first) {
            return Err(part.refuse(&format!(
                "its whole image has {} x {} pixels and {} channels, that of {} {} x {} and {}: they do not belong together",
                part.whole[0],
                part.whole[1],
                part.image.channels().len(),
                first.path.display(),
                width,
                height,
                first.image.channels().len()
            )));
        }
        for i in part.places() {
            if let Some(other) = parts.get(holder[i] as usize) {
                return Err(part.refuse(&match part.path == other.path {
                    true => "it is given twice".to_owned(),
                    false => format!("it overlaps {}", other.path.display()),
                }));
            }
            holder[i] = number as u32;
        }
    }
    if let Some(missing) = holder.iter().position(|&h| h == u32::MAX) {
        let (x, y) = (missing as u32 % width, missing as u32 / width);
        let count = holder.iter().filter(|&&h| h == u32::MAX).count();
        return Err(Error::Usage(format!(
            "the parts do not hold the whole image of {width} x {height} pixels: {count} are missing, the first at column {x}, \
             row {y}"
        )));
    }
    let mut whole = Image::new(width, height);
    for (index, name) in names(first).into_iter().enumerate() {
        let mut values = vec![0.0; holder.len()];
        for part in &parts {
            for (i, value) in part.places().zip(&part.image.channels()[index].values) {
                values[i] = *value;
            }
        }
        whole.push(name, values);
    }
    let mut metadata = Metadata::new();
    let ours = |name: &str| name == "Software" || name.starts_with("gsii:") && name != REGION;
    for (name, value) in first.metadata.iter().filter(|(name, _)| ours(name)) {
        if parts.iter().all(|part| part.metadata.get(name) == Some(value)) {
            metadata.set(name, value.clone());
        }
    }
    Ok((whole, metadata))
}

impl<'a> Part<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        let (image, metadata) = read_with_metadata(path)?;
        let refuse = |reason: &str| Error::Input { path: path.to_owned(), reason: reason.to_owned() };
        let number = |name: &str| match metadata.get(name) {
            Some(Value::Integer(n)) => u32::try_from(*n).ok(),
            _ => None,
        };
        let numbers = match metadata.get(REGION) {
            Some(Value::Text(text)) => text.split_whitespace().map(|n| n.parse().ok()).collect::<Option<Vec<u32>>>(),
            _ => None,
        };
        let known = numbers.zip(number("gsii:width").zip(number("gsii:height")));
        let Some((region, (width, height))) = known else {
            return Err(refuse(
                "it does not say which part of an image it is: parts are EXR files rendered with --tile or --crop",
            ));
        };
        match region[..] {
            [x0, y0, x1, y1]
                if x0 < x1
                    && y0 < y1
                    && x1 <= width
                    && y1 <= height
                    && width.max(height) <= 1 << 16
                    && [x1 - x0, y1 - y0] == [image.width(), image.height()] =>
            {
                Ok(Part { path, image, metadata, low: [x0, y0], whole: [width, height] })
            }
            _ => Err(refuse("the part of an image that it says to be does not fit its size")),
        }
    }

    /// Indices of its pixels in the whole image, row by row.
    fn places(&self) -> impl Iterator<Item = usize> + use<> {
        let ([x, y], [w, h], across) = (self.low, [self.image.width(), self.image.height()], self.whole[0] as usize);
        (y..y + h).flat_map(move |y| (x..x + w).map(move |x| y as usize * across + x as usize))
    }

    fn refuse(&self, reason: &str) -> Error {
        Error::Input { path: self.path.to_owned(), reason: reason.to_owned() }
    }
}
