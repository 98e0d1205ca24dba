//! What happens at a surface point: where it is, how light scatters there.
//!
//! A BSDF is split as in the paper, `f = f_h + f_l`: highly directional (mirror, glass, glossy under a roughness
//! threshold) and weakly directional (diffuse and rough lobes).

mod albedo;
pub mod bsdf;
pub mod fresnel;
pub mod ggx;
mod glass;
mod glass_albedo;
mod layered;
pub mod point;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use bsdf::{Bsdf, BsdfSample, Lobes};
pub use point::SurfacePoint;
