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

use glam::Vec3;

pub use bsdf::{Bsdf, BsdfSample, Lobes};
pub use point::SurfacePoint;

/// `part / whole` by band, and `of_nothing` in bands where there is no whole.
pub fn share_of(part: Vec3, whole: Vec3, of_nothing: Vec3) -> Vec3 {
    Vec3::select(whole.cmpgt(Vec3::ZERO), part / whole, of_nothing)
}
