//! Images in and out through OpenImageIO, view transform, error metrics.
//!
//! Inside the program an [`Image`] is linear: Rec. 709 primaries, scene-referred, named float channels. What the file
//! needs instead (integers, a tone curve, sRGB encoding) is done on the way out by [`write()`] and undone by [`read`] as
//! far as it can be.

mod buffer;
mod input;
mod merge;
mod metadata;
pub mod metrics;
mod oiio;
mod output;
mod texture;
pub mod view;

#[cfg(test)]
mod tests;

pub use buffer::{Channel, Image};
pub use input::{read, read_with_metadata};
pub use merge::{REGION, merge};
pub use metadata::{Metadata, Value};
pub use metrics::{CrossMetrics, Metrics, compare, compare_halves};
pub use oiio::{library_version, set_threads, writable_extensions};
pub use output::{Compression, WriteOptions, check_writable, write};
pub use texture::{Data, Pixels, decode_texture};
pub use view::{ViewTransform, auto_exposure};
