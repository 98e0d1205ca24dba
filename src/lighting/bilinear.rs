//! Points of a rectangle chosen about in proportion to the light that arrives from them.

use glam::Vec3;

/// Least weight of a corner, as a share of the largest: keeps estimates bounded where a corner is below the horizon and the
/// rest is not.
const LEAST: f32 = 0.05;

/// A density on the unit square that is bilinear between its corners.
///
/// Its corner values are those of the geometry term `cos cos' / d^2` (pbrt 4ed 6.5.4 and A.5.15 do so for the cosine alone).
#[derive(Clone, Copy, Debug)]
pub(super) struct Bilinear {
    /// At (0, 0), (1, 0), (0, 1) and (1, 1); their mean is one.
    weights: [f32; 4],
}

impl Bilinear {
    /// `corners` are relative to the point that is lit, whose distance from the plane is proportional to `height`; its unit
    /// `normal` is zero where light from all directions counts.
    pub(super) fn new(corners: [Vec3; 4], height: f32, normal: Vec3) -> Self {
        let weights = corners.map(|c| {
            let d2 = c.length_squared();
            if normal == Vec3::ZERO {
                // cos' is height / d
                height.abs() / (d2 * d2.sqrt())
            } else {
                height.abs() * c.dot(normal).max(0.0) / (d2 * d2)
            }
        });
        let least = LEAST * weights.iter().fold(0.0, |a: f32, &b| a.max(b));
        let weights = weights.map(|w| w.max(least));
        let mean = 0.25 * weights.iter().sum::<f32>();
        let usable = mean > 0.0 && mean.is_finite();
        Bilinear { weights: if usable { weights.map(|w| w / mean) } else { [1.0; 4] } }
    }

    /// The density at a point of the unit square.
    pub(super) fn at(&self, [s, t]: [f32; 2]) -> f32 {
        let [a, b, c, d] = self.weights;
        (1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * c + s * d)
    }

    /// The point for `u`, each coordinate grows with its random number.
    pub(super) fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        let [a, b, c, d] = self.weights;
        let t = linear(u[1], a + b, c + d);
        let s = linear(u[0], (1.0 - t) * a + t * c, (1.0 - t) * b + t * d);
        [s, t]
    }
}

/// A number in 0..=1 with a density that goes linearly from `a` to `b`, both above zero.
fn linear(u: f32, a: f32, b: f32) -> f32 {
    let root = (a * a * (1.0 - u) + b * b * u).sqrt();
    (u * (a + b) / (a + root)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::sobol;

    /// Owen-scrambled points fill every quarter of the square as the density says: the integral of a bilinear function over a
    /// cell is its value at the centre times the area.
    #[test]
    fn samples_follow_the_density() {
        let corners = [(0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (2.0, 1.0)].map(|(x, y)| Vec3::new(x - 0.5, y, 1.5));
        for normal in [Vec3::ZERO, Vec3::Z, Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.995, 0.0, 0.1)] {
            let density = Bilinear::new(corners, 1.5, normal);
            const N: u32 = 1 << 12;
            let mut counts = [[0_u32; 4]; 4];
            for i in 0..N {
                let u = sobol(i, 0, 7);
                let [s, t] = density.sample([u[0], u[1]]);
                assert!((0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t));
                counts[((4.0 * t) as usize).min(3)][((4.0 * s) as usize).min(3)] += 1;
            }
            for (y, row) in counts.iter().enumerate() {
                for (x, &count) in row.iter().enumerate() {
                    let expected = density.at([(x as f32 + 0.5) / 4.0, (y as f32 + 0.5) / 4.0]) / 16.0;
                    // Discrepancy of a two-dimensional net under a smooth map: some log N / N, far below 1 %.
                    let found = count as f32 / N as f32;
                    assert!((found - expected).abs() < 2.0 * 12.0 / N as f32, "{normal} {x} {y}: {found} {expected}");
                }
            }
        }
    }
}
