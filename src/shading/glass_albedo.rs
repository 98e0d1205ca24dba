//! Directional albedo of the rough boundary of a refracting solid, tabulated: one minus it is what single scattering loses.

use std::array::from_fn;
use std::sync::LazyLock;

use glam::Vec3;

use super::{fresnel, ggx};

/// Grid points along the index of refraction, roughness and the cosine.
const INDICES: usize = 19;
const ROUGHNESSES: usize = 16;
const COSINES: usize = 24;
/// Largest reflection coefficient `(eta - 1) / (eta + 1)` of the table: an index of 2.6. Its points are 0.05 apart, so that an
/// index of 1.5 is one of them.
const MAX_COEFFICIENT: f32 = 0.45;
const MIN_ROUGHNESS: f32 = 0.02;
/// Quadrature points per axis of the visible normals' square.
const RADIAL: u32 = 22;
const ANGULAR: u32 = 16;
/// Largest error of the sum of the tabulated parts.
#[cfg(test)]
pub const ERROR: f32 = 0.02;

/// Where light that arrives at a clear boundary goes when it meets one microfacet: shares of its power.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Reflected by Fresnel's equations.
    pub reflected: f32,
    /// Reflected beyond the critical angle.
    pub totally: f32,
    /// Refracted.
    pub refracted: f32,
}

impl Parts {
    /// All together.
    pub fn total(self) -> f32 {
        self.reflected + self.totally + self.refracted
    }

    fn lerp(self, other: Parts, t: f32) -> Parts {
        let mix = |a: f32, b: f32| a + (b - a) * t;
        Parts {
            reflected: mix(self.reflected, other.reflected),
            totally: mix(self.totally, other.totally),
            refracted: mix(self.refracted, other.refracted),
        }
    }
}

/// Parts towards `cosine` at `roughness` (square root of the GGX width), both 0..=1, for relative index `eta` (far side over the
/// viewer's side). Their sum is within 0.02 of the integral for `eta` between 1/2.6 and 2.6 and cosines above 0.02, with the largest errors near the critical angle.
pub fn directional(eta: f32, roughness: f32, cosine: f32) -> Parts {
    let alpha = roughness * roughness;
    let (i, r) = cell(0.5 + 0.5 * (eta - 1.0) / (eta + 1.0) / MAX_COEFFICIENT, INDICES);
    let (j, s) = cell((roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS), ROUGHNESSES);
    let (k, t) = cell(cosine * (1.0 + alpha) / (cosine + alpha).max(f32::MIN_POSITIVE), COSINES);
    let line = |i: usize, j: usize| TABLE[i][j][k].lerp(TABLE[i][j][k + 1], t);
    let face = |i: usize| line(i, j).lerp(line(i, j + 1), s);
    face(i).lerp(face(i + 1), r)
}

/// Index of the grid cell that holds `x` in 0..=1, and where in the cell.
fn cell(x: f32, points: usize) -> (usize, f32) {
    let scaled = x.clamp(0.0, 1.0) * (points - 1) as f32;
    let index = (scaled as usize).min(points - 2);
    (index, scaled - index as f32)
}

/// Computed on one thread: a parallel loop here could wait for a worker that itself waits for the table.
static TABLE: LazyLock<Box<[[[Parts; COSINES]; ROUGHNESSES]; INDICES]>> = LazyLock::new(|| {
    Box::new(from_fn(|i| {
        let coefficient = MAX_COEFFICIENT * (2.0 * i as f32 / (INDICES - 1) as f32 - 1.0);
        let eta = (1.0 + coefficient) / (1.0 - coefficient);
        from_fn(|j| {
            let alpha = (MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * j as f32 / (ROUGHNESSES - 1) as f32).powi(2);
            from_fn(|k| {
                let x = k as f32 / (COSINES - 1) as f32;
                integrate(eta, alpha, x * alpha / (1.0 + alpha - x), RADIAL, ANGULAR)
            })
        })
    }))
});

/// Parts by a midpoint rule over one half of the square from which visible normals are sampled.
fn integrate(eta: f32, alpha: f32, cosine: f32, radial: u32, angular: u32) -> Parts {
    let outgoing = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let lambda = ggx::lambda(outgoing, alpha);
    let mut parts = Parts::default();
    for i in 0..radial {
        // Facets steep enough to lose light are the last of the radial axis, fewer the smoother the surface is.
        let [upper, lower] = [i, i + 1].map(|k| (1.0 - k as f32 / radial as f32).powi(3));
        let (rest, weight) = (0.5 * (upper + lower), (upper - lower) / angular as f32);
        for j in 0..angular {
            let h = ggx::sample_visible(outgoing, alpha, [1.0 - rest, 0.5 * (j as f32 + 0.5) / angular as f32]);
            let along = outgoing.dot(h);
            let visible = |incoming: Vec3| {
                // G2 / G1, as a ratio of sums that stays finite at grazing angles.
                weight * (1.0 + lambda) / (1.0 + lambda + ggx::lambda(incoming, alpha))
            };
            let mirror = 2.0 * along * h - outgoing;
            let up = if mirror.z > 0.0 { visible(mirror) } else { 0.0 };
            let Some(bent) = fresnel::refracted_cosine(along, eta) else {
                parts.totally += up;
                continue;
            };
            let f = fresnel::unpolarised(along, eta);
            parts.reflected += f * up;
            let through = (along / eta - bent) * h - outgoing / eta;
            if through.z < 0.0 {
                parts.refracted += (1.0 - f) * visible(through);
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bound of this test is the accuracy that the documentation of [`directional`] promises.
    #[test]
    fn table_is_as_accurate_as_promised() {
        for eta in [1.0 / 2.4, 1.0 / 1.5, 1.0 / 1.15, 1.15, 1.5, 1.77, 2.4_f32] {
            for i in 1..=20 {
                let cosine = 0.02 + 0.98 * (i as f32 / 20.0).powi(2);
                for j in 0..=15 {
                    let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * j as f32 / 15.0 * 0.999;
                    let exact = integrate(eta, roughness * roughness, cosine, 120, 60).total();
                    let table = directional(eta, roughness, cosine).total();
                    assert!((table - exact).abs() < ERROR, "{eta} {roughness} {cosine}: {table}, exact {exact}");
                }
            }
        }
    }
}
