//! # gsii
//!
//! Physically accurate images of cluttered scenes on a CPU: *Geometric Simplification for Indirect Illumination*
//! (Rushmeier, Patterson, Veerasamy 1993) on Embree and OpenImageIO.
//!
//! Data flows one way: [`scene`] is simplified ([`simplify`]), solved ([`radiosity`]), rendered
//! ([`render`]) and written ([`image`]); ray queries of every stage go through [`backend`].
//!
//! # Example
//!
//! ```no_run
#![doc = include_str!("../examples/library.rs")]
//! ```

pub mod backend;
pub mod cli;
pub mod clock;
pub mod error;
pub mod image;
pub mod lighting;
pub mod pipeline;
pub mod progress;
pub mod radiosity;
pub mod render;
pub mod sampling;
pub mod scene;
pub mod shading;
pub mod simplify;
pub mod srgb;
pub mod study;
pub mod unfinished;

pub use error::{Error, Result};
