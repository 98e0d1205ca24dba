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

#[cfg(test)]
mod tests {
    use super::*;

    /// SPEC-010 of the reference cases, the weak white furnace: visible facets cover exactly the projected surface,
    /// `int G1 D max(0, o.h) dh = mu`. Midpoint rule in azimuth and in tangent over alpha, mapped to 0..1.
    #[test]
    fn weak_white_furnace() {
        const POINTS: u32 = 600;
        const AZIMUTHS: u32 = 128;
        for alpha in [0.05, 0.25, 1.0_f32] {
            for cosine in [1.0, 0.5, 0.1_f32] {
                let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
                let mut sum = 0.0;
                for i in 0..POINTS {
                    let x = (i as f32 + 0.5) / POINTS as f32;
                    let tangent = alpha * x / (1.0 - x);
                    let z = 1.0 / (1.0 + tangent * tangent).sqrt();
                    let solid_angle = z * tangent * z * z * alpha / ((1.0 - x) * (1.0 - x));
                    for j in 0..AZIMUTHS {
                        let (sin, cos) = (TAU * (j as f32 + 0.5) / AZIMUTHS as f32).sin_cos();
                        let h = Vec3::new(z * tangent * cos, z * tangent * sin, z);
                        let visible = masking(outgoing, alpha) * outgoing.dot(h).max(0.0) / cosine;
                        sum += f64::from(distribution(h, alpha) * visible * solid_angle);
                    }
                }
                let share = sum * f64::from(TAU) / f64::from(POINTS * AZIMUTHS);
                // The tolerance of the reference case.
                assert!((share - 1.0).abs() < 0.001, "{alpha} {cosine}: {share}");
            }
        }
    }
}
