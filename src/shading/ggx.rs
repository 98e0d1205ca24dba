//! The GGX microfacet distribution (Trowbridge and Reitz 1975; Walter et al. 2007) with height-correlated Smith
//! masking (Heitz 2014). Directions are in the frame of the macroscopic normal `+z`.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// Density of microfacet normals `h`, per solid angle. The tangent comes from `x` and `y`, as `1 - z^2` cancels for
/// smooth surfaces.
pub fn distribution(h: Vec3, alpha: f32) -> f32 {
    let scaled = h.truncate() / alpha;
    let e = scaled.length_squared() + h.z * h.z;
    1.0 / (PI * alpha * alpha * e * e)
}

/// Smith's auxiliary function: masked over visible area of microfacets from direction `w`.
pub fn lambda(w: Vec3, alpha: f32) -> f32 {
    let tangent_squared = w.truncate().length_squared() / (w.z * w.z);
    // (sqrt(1 + x) - 1) / 2 without cancellation for small x.
    let x = (alpha * alpha * tangent_squared).min(f32::MAX);
    0.5 * x / (1.0 + (1.0 + x).sqrt())
}

/// Share of microfacets visible from `w`.
pub fn masking(w: Vec3, alpha: f32) -> f32 {
    1.0 / (1.0 + lambda(w, alpha))
}

/// Share visible from both `a` and `b`, height-correlated.
pub fn masking_shadowing(a: Vec3, b: Vec3, alpha: f32) -> f32 {
    1.0 / (1.0 + lambda(a, alpha) + lambda(b, alpha))
}

/// Samples the normals visible from `outgoing` (Heitz 2018, by spherical caps as in Dupuy and Benyoub 2023).
pub fn sample_visible(outgoing: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let stretch = Vec3::new(alpha, alpha, 1.0);
    let view = (outgoing * stretch).normalize();
    // z from its distance to the top of the cap, so that its sine keeps its digits for smooth surfaces.
    let depth = u[0] * (1.0 + view.z);
    let sine = (depth * (2.0 - depth)).max(0.0).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    ((Vec3::new(sine * cos, sine * sin, 1.0 - depth) + view) * stretch).normalize()
}
