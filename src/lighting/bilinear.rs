//! Points of a rectangle chosen about in proportion to the light that arrives from them; eight rectangles, each seen from its own
//! point, at once.

use glam::Vec3;

use super::bounds::larger;

/// Least weight of a corner, as a share of the largest: keeps estimates bounded where a corner is below the horizon and the
/// rest is not.
const LEAST: f32 = 0.05;

/// Number of rectangles side by side.
pub(super) const LANES: usize = 8;

/// A rectangle as seen from the point that is lit, in single precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenRectangle {
    /// First corner.
    pub corner: Vec3,
    /// Edges from there, and their cross product.
    pub edges: [Vec3; 2],
    pub cross: Vec3,
    /// Unit normal at the point that is lit; zero where light from all directions counts.
    pub normal: Vec3,
}

/// A point of a rectangle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RectanglePoint {
    /// In units of the edges.
    pub at: [f32; 2],
    /// Unit vector to it.
    pub direction: Vec3,
    pub distance: f32,
    /// Per solid angle; not a number above zero where the rectangle is seen edge-on.
    pub density: f32,
}

impl SeenRectangle {
    /// The point for `u`.
    #[inline(always)]
    pub(super) fn sample(&self, u: [f32; 2]) -> RectanglePoint {
        let density = Bilinear::new(self.corner, self.edges, self.normal);
        let at = density.sample(u);
        let offset = self.corner + at[0] * self.edges[0] + at[1] * self.edges[1];
        let d2 = offset.length_squared();
        let distance = d2.sqrt();
        let density = density.at(at) * (d2 * distance) / offset.dot(self.cross).abs();
        RectanglePoint { at, direction: offset / distance, distance, density }
    }
}

/// Rectangles that wait until there are enough to sample them with vector instructions.
#[derive(Debug, Default)]
#[repr(align(32))]
pub(super) struct Rectangles {
    /// Components of corner, edges, cross product and normal, and the random numbers; an array over rectangles each.
    inputs: [[f32; LANES]; 17],
    count: usize,
}

impl Rectangles {
    /// Adds one of at most [`LANES`].
    pub(super) fn push(&mut self, seen: &SeenRectangle, u: [f32; 2]) {
        let SeenRectangle { corner: p, edges: [e, f], cross: c, normal: n } = *seen;
        let values = [p.x, p.y, p.z, e.x, e.y, e.z, f.x, f.y, f.z, c.x, c.y, c.z, n.x, n.y, n.z, u[0], u[1]];
        for (input, value) in self.inputs.iter_mut().zip(values) {
            input[self.count] = value;
        }
        self.count += 1;
    }

    /// Samples all, in their order, and forgets them.
    pub(super) fn sample(&mut self) -> impl Iterator<Item = RectanglePoint> + use<> {
        let mut outputs = [[0.0; LANES]; 7];
        // Compilers turn this into vector instructions as long as nothing in it branches
        for lane in 0..LANES {
            let scalar = |i: usize| self.inputs[i][lane];
            let vector = |i: usize| Vec3::new(scalar(i), scalar(i + 1), scalar(i + 2));
            let seen = SeenRectangle {
                corner: vector(0),
                edges: [vector(3), vector(6)],
                cross: vector(9),
                normal: vector(12),
            };
            let RectanglePoint { at, direction, distance, density } = seen.sample([scalar(15), scalar(16)]);
            let values = [at[0], at[1], direction.x, direction.y, direction.z, distance, density];
            for (output, value) in outputs.iter_mut().zip(values) {
                output[lane] = value;
            }
        }
        let count = std::mem::take(&mut self.count);
        (0..count).map(move |lane| {
            let [s, t, x, y, z, distance, density] = outputs.map(|output| output[lane]);
            RectanglePoint { at: [s, t], direction: Vec3::new(x, y, z), distance, density }
        })
    }
}

/// A density on the unit square that is bilinear between its corners.
///
/// Its corner values are those of the geometry term `cos cos' / d^2` (pbrt 4ed 6.5.4 and A.5.15 do so for the cosine alone).
#[derive(Clone, Copy, Debug)]
pub(super) struct Bilinear {
    /// At (0, 0), (1, 0), (0, 1) and (1, 1), up to a common factor.
    weights: [f32; 4],
    mean: f32,
}

impl Bilinear {
    /// Of a parallelogram with one `corner`, relative to the point that is lit, and two edges. The unit `normal` is zero where light
    /// from all directions counts.
    #[inline(always)]
    pub(super) fn new(corner: Vec3, [e, f]: [Vec3; 2], normal: Vec3) -> Self {
        let anywhere = normal == Vec3::ZERO;
        // cos' is the distance from the plane, which all have in common, over d
        let weights = [corner, corner + e, corner + f, corner + e + f].map(|c| {
            let d2 = c.length_squared();
            let above = larger(c.dot(normal), 0.0);
            (if anywhere { d2.sqrt() } else { above }) / (d2 * d2)
        });
        let [a, b, c, d] = weights;
        let least = LEAST * larger(larger(a, b), larger(c, d));
        let weights = weights.map(|w| larger(w, least));
        let mean = 0.25 * ((weights[0] + weights[1]) + (weights[2] + weights[3]));
        let usable = mean > 0.0 && mean < f32::INFINITY;
        Bilinear { weights: weights.map(|w| if usable { w } else { 1.0 }), mean: if usable { mean } else { 1.0 } }
    }

    /// The density at a point of the unit square.
    #[inline(always)]
    pub(super) fn at(&self, [s, t]: [f32; 2]) -> f32 {
        let [a, b, c, d] = self.weights;
        ((1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * c + s * d)) / self.mean
    }

    /// The point for `u`, each coordinate grows with its random number.
    #[inline(always)]
    fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        let [a, b, c, d] = self.weights;
        let t = linear(u[1], a + b, c + d);
        let s = linear(u[0], (1.0 - t) * a + t * c, (1.0 - t) * b + t * d);
        [s, t]
    }
}

/// A number in 0..=1 with a density that goes linearly from `a` to `b`, both above zero.
#[inline(always)]
fn linear(u: f32, a: f32, b: f32) -> f32 {
    let root = (a * a * (1.0 - u) + b * b * u).sqrt();
    let x = u * (a + b) / (a + root);
    if x < 1.0 { x } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::sobol;

    /// Owen-scrambled points fill every quarter of the square as the density says: the integral of a bilinear function over a
    /// cell is its value at the centre times the area.
    #[test]
    fn samples_follow_the_density() {
        let (corner, edges) = (Vec3::new(-0.5, 0.0, 1.5), [Vec3::new(2.0, 0.0, 0.0), Vec3::Y]);
        for normal in [Vec3::ZERO, Vec3::Z, Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.995, 0.0, 0.1)] {
            let density = Bilinear::new(corner, edges, normal);
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
