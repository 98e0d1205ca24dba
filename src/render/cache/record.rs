//! What one place tells about the indirect light around it.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use crate::sampling::basis;

/// Strata of the hemisphere: rings of equal projected solid angle, cut into sectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Strata {
    pub rings: usize,
    pub sectors: usize,
}

impl Strata {
    /// Number of strata, and of rays.
    pub fn len(self) -> usize {
        self.rings * self.sectors
    }

    /// Strata for about so many rays, as wide as high.
    pub fn of(rays: f32) -> Self {
        let rings = ((rays / 3.0).sqrt().round() as usize).max(4);
        Strata { rings, sectors: 3 * rings }
    }

    /// Numbers of all rays, in blocks of neighbouring directions.
    pub fn in_blocks(self) -> impl Iterator<Item = usize> {
        let blocks = |count: usize, of: usize| (0..count).step_by(of).map(move |low| low..(low + of).min(count));
        let (rings, sectors) = BLOCK;
        blocks(self.rings, rings).flat_map(move |rings| {
            blocks(self.sectors, sectors).flat_map(move |sectors| {
                rings.clone().flat_map(move |ring| sectors.clone().map(move |sector| ring * self.sectors + sector))
            })
        })
    }

    /// The direction of ray `k` (ring by ring) around the third axis of `frame`, cosine-distributed in its stratum; `u` uniform in 0..1.
    pub fn direction(self, frame: &Mat3, k: usize, u: [f32; 2]) -> Vec3 {
        let (ring, sector) = (k / self.sectors, k % self.sectors);
        let sin2 = (ring as f32 + u[0]) / self.rings as f32;
        let (sin, cos) = (TAU * (sector as f32 + u[1]) / self.sectors as f32).sin_cos();
        let radius = sin2.sqrt();
        *frame * Vec3::new(radius * cos, radius * sin, (1.0 - sin2).max(0.0).sqrt())
    }
}

/// Rings and sectors of a block of rays that are traced as one packet.
const BLOCK: (usize, usize) = (4, 2);

/// Largest angle between normals over which a record is used: 20 degrees, as the cosine.
pub(super) const LEAST_COSINE: f32 = 0.939_692_6;

/// Largest change that gradients may make, as a share of the record's own light.
pub(super) const MOST_CHANGE: f32 = 0.5;

/// A point may lie this far in front of a record's tangent plane, as a share of the record's reach, before the record is taken to
/// see what the point does not (Ward 1988, section 2.2).
pub(super) const IN_FRONT: f32 = 0.1;

/// Indirect light at one point of a surface, and how it changes around it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Record {
    pub position: Vec3,
    /// Unit shading normal on the lit side.
    pub normal: Vec3,
    /// Harmonic mean distance of what the hemisphere sees, scene units.
    pub distance: f32,
    /// Distance over which the record is used, scene units.
    pub reach: f32,
    /// What [`Record::reach`] may not fall below.
    pub least_reach: f32,
    /// Whether light changes too fast around here to be interpolated: the record only says so.
    pub refuses: bool,
    /// Irradiance over pi: the radiance that a white diffuse surface reflects, W/(sr m^2).
    pub radiance: Vec3,
    /// The part of `radiance` that the brightest ray brought, bands together.
    pub brightest: f32,
    /// Rays that it is the mean of.
    pub rays: u32,
    /// Variance of what a single ray brings, over the square of its mean, bands together: known where two records were made into one.
    pub variance: Option<f32>,
    /// Change of each band with the normal: scalar product with the axis of rotation times its sine.
    pub by_rotation: [Vec3; 3],
    /// Change of each band with the position.
    pub by_translation: [Vec3; 3],
}

impl Record {
    /// From the radiance that each ray of [`Strata::direction`] brings, and the distance of what it meets (infinite where nothing).
    /// `None` when something is not finite.
    ///
    /// Gradients after Ward and Heckbert, "Irradiance gradients" (1992), for strata of equal projected solid angle.
    pub fn new(
        position: Vec3,
        normal: Vec3,
        least_reach: f32,
        strata: Strata,
        radiance: &[Vec3],
        distances: &[f32],
    ) -> Option<Self> {
        let (Strata { rings, sectors }, rays) = (strata, strata.len());
        let sum: Vec3 = radiance.iter().sum();
        let inverse: f64 = distances.iter().map(|&d| 1.0 / f64::from(d.max(f32::MIN_POSITIVE))).sum();
        let mean = sum / rays as f32;
        let distance = (rays as f64 / inverse) as f32;
        let at = |ring: usize, sector: usize| ring * sectors + sector % sectors;
        let closest = |a: usize, b: usize| distances[a].min(distances[b]);
        let boundary = |ring: usize| (ring as f32 / rings as f32).sqrt();
        // Columns: change of one band along the frame's axes
        let (mut rotation, mut translation) = (Mat3::ZERO, Mat3::ZERO);
        let outer = |axis: Vec3, value: Vec3| Mat3::from_cols(axis * value.x, axis * value.y, axis * value.z);
        let cosines: Vec<f32> =
            (0..=rings).map(|ring| (1.0 - boundary(ring) * boundary(ring)).max(0.0).sqrt()).collect();
        // Mean over each ring of the tangent of the angle with the normal: at the horizon its value in the middle is far off.
        let tangents: Vec<f32> = (0..rings)
            .map(|ring| {
                let primitive = |s: f32| s.asin() - s * (1.0 - s * s).max(0.0).sqrt();
                (primitive(boundary(ring + 1)) - primitive(boundary(ring))) * rings as f32
            })
            .collect();
        for sector in 0..sectors {
            let angle = |s: f32| TAU * s / sectors as f32;
            let (sin, cos) = angle(sector as f32 + 0.5).sin_cos();
            let (outward, around) = (Vec3::new(cos, sin, 0.0), Vec3::new(-sin, cos, 0.0));
            let (sin, cos) = angle(sector as f32).sin_cos();
            let around_before = Vec3::new(-sin, cos, 0.0);
            let before = sector + sectors - 1;
            for ring in 0..rings {
                let here = radiance[at(ring, sector)];
                let sin2 = (ring as f32 + 0.5) / rings as f32;
                let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).sqrt());
                rotation += outer(around, here * tangents[ring]);
                if ring > 0 {
                    let s = boundary(ring);
                    let d = closest(at(ring, sector), at(ring - 1, sector));
                    let weight = TAU / sectors as f32 * s * (1.0 - s * s) / d;
                    translation += outer(outward, (here - radiance[at(ring - 1, sector)]) * weight);
                }
                let d = closest(at(ring, sector), at(ring, before));
                let weight = cos * (cosines[ring] - cosines[ring + 1]) / (sin * d);
                translation += outer(around_before, (here - radiance[at(ring, before)]) * weight);
            }
        }
        let frame = basis(normal);
        let columns = |m: Mat3, scale: f32| [m.x_axis, m.y_axis, m.z_axis].map(|g| frame * g * scale);
        let by_rotation = columns(rotation, 1.0 / rays as f32);
        let by_translation = columns(translation, FRAC_1_PI);
        let finite =
            mean.is_finite() && by_rotation.iter().chain(&by_translation).all(|g| g.is_finite()) && distance > 0.0;
        finite.then_some(Record {
            position,
            normal,
            distance,
            reach: least_reach,
            least_reach,
            refuses: false,
            radiance: mean,
            brightest: radiance.iter().map(|r| r.element_sum()).fold(0.0, f32::max) / rays as f32,
            rays: rays as u32,
            variance: None,
            by_rotation,
            by_translation,
        })
    }

    /// This one and `other`, of the same place and as many rays, in one.
    pub fn averaged(&self, other: &Record, rays: usize) -> Record {
        let half = |a: Vec3, b: Vec3| 0.5 * (a + b);
        let halves = |a: [Vec3; 3], b: [Vec3; 3]| [0, 1, 2].map(|i| half(a[i], b[i]));
        let (sum, difference) =
            ((self.radiance + other.radiance).element_sum(), (self.radiance - other.radiance).element_sum());
        Record {
            // Harmonic, as of all rays together.
            distance: 2.0 / (1.0 / self.distance + 1.0 / other.distance),
            radiance: half(self.radiance, other.radiance),
            brightest: 0.5 * self.brightest.max(other.brightest),
            // Of the mean of two it is (difference / sum)^2.
            rays: self.rays + other.rays,
            variance: (sum > 0.0).then(|| (difference / sum).powi(2) * 2.0 * rays as f32),
            by_rotation: halves(self.by_rotation, other.by_rotation),
            by_translation: halves(self.by_translation, other.by_translation),
            ..*self
        }
    }

    /// Relative variance of its light, bands together, where it is known.
    pub fn noise(&self) -> Option<f64> {
        self.variance.map(|variance| f64::from(variance) / f64::from(self.rays))
    }

    /// Whether all numbers in it are possible.
    pub fn is_sound(&self) -> bool {
        let vectors = [self.position, self.normal, self.radiance].into_iter();
        vectors.chain(self.by_rotation).chain(self.by_translation).all(Vec3::is_finite)
            && [self.distance, self.reach].iter().all(|x| *x > 0.0)
            && self.reach.is_finite()
    }

    /// Distance over which the light would vanish or double if it went on changing as fast as here.
    pub fn scale_of_change(&self) -> f32 {
        let change: f32 = self.by_translation.iter().map(|g| g.length()).sum();
        if change > 0.0 { self.radiance.element_sum() / change } else { f32::INFINITY }
    }

    /// Weight of the record at a point: one at its own, falling linearly to zero at the end of its reach (Tabellion and
    /// Lamorlette 2004).
    pub fn weight(&self, position: Vec3, normal: Vec3) -> f32 {
        // Squares as far as that decides: most records that are asked do not reach the point
        let offset = position - self.position;
        let (d2, r2) = (offset.length_squared(), self.reach * self.reach);
        let cos = normal.dot(self.normal);
        if d2 >= r2 || cos <= LEAST_COSINE || offset.dot(normal + self.normal) < -2.0 * IN_FRONT * self.reach {
            return 0.0;
        }
        let turned = (1.0 - cos).max(0.0) / (1.0 - LEAST_COSINE);
        1.0 - (d2 / r2).max(turned).sqrt()
    }

    /// Irradiance over pi at a nearby point, by the gradients.
    pub fn at(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let (axis, offset) = (self.normal.cross(normal), position - self.position);
        let change = |band: usize| axis.dot(self.by_rotation[band]) + offset.dot(self.by_translation[band]);
        // Next to edges gradients are large and hold only for a short way.
        let change = Vec3::new(change(0), change(1), change(2));
        let limit = MOST_CHANGE * self.radiance;
        self.radiance + change.clamp(-limit, limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, sobol};

    /// A record at `position` in a world where a ray brings what `radiance` says of its origin and direction, from a distance.
    fn record(position: Vec3, normal: Vec3, stream: u32, world: &dyn Fn(Vec3, Vec3) -> (f32, f32)) -> Record {
        let strata = Strata { rings: 16, sectors: 48 };
        let frame = basis(normal);
        let (radiance, distances): (Vec<Vec3>, Vec<f32>) = (0..strata.len())
            .map(|k| {
                let [u, v, ..] = sobol(k as u32, 0, stream);
                let (l, d) = world(position, strata.direction(&frame, k, [u, v]));
                (Vec3::splat(l), d)
            })
            .unzip();
        Record::new(position, normal, 0.1, strata, &radiance, &distances).unwrap()
    }

    #[test]
    fn blocks_hold_every_ray_once() {
        for strata in [Strata { rings: 16, sectors: 48 }, Strata { rings: 7, sectors: 21 }, Strata::of(1.0)] {
            let mut all: Vec<usize> = strata.in_blocks().collect();
            all.sort_unstable();
            assert_eq!(all, (0..strata.len()).collect::<Vec<_>>());
        }
        assert_eq!(Strata::of(768.0), Strata { rings: 16, sectors: 48 });
    }

    /// Light that depends on the direction only: `L = 1 + x` gives `E / pi = 1 + 2/3 n_x`.
    #[test]
    fn rotation() {
        let world = |_: Vec3, d: Vec3| (1.0 + d.x, f32::INFINITY);
        let record = record(Vec3::ZERO, Vec3::Z, 1, &world);
        assert!((record.radiance.x - 1.0).abs() < 0.005, "{}", record.radiance);
        for angle in [-0.2_f32, 0.1, 0.3] {
            let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
            let expected = 1.0 + 2.0 / 3.0 * normal.x;
            let found = record.at(Vec3::ZERO, normal).x;
            // A stratified mean of 768, and the cosine of 0.3 that a gradient leaves out
            assert!((found - expected).abs() < 0.02, "{angle}: {found} {expected}");
        }
    }

    /// Light of one half or three halves from each direction by chance: a ray is off by half of the mean.
    #[test]
    fn two_records_tell_how_far_a_ray_is_off() {
        let chance = |_: Vec3, d: Vec3| (0.5 + (hash_all(&d.to_array().map(f32::to_bits)) & 1) as f32, 1.0);
        let count = 400;
        let of_pair = |i: u32| {
            let [a, b] = [2 * i, 2 * i + 1].map(|stream| record(Vec3::ZERO, Vec3::Z, stream, &chance));
            let both = a.averaged(&b, 768);
            assert!((both.radiance - 0.5 * (a.radiance + b.radiance)).length() < 1e-6);
            // Every other ray of 1536 brings three halves of the mean.
            let share = both.brightest / both.radiance.element_sum();
            assert!((share * 1536.0 / 1.5 - 1.0).abs() < 0.1, "{share}");
            both.variance.unwrap()
        };
        let variance = (0..count).map(of_pair).sum::<f32>() / count as f32;
        // A square of a normal number has the relative standard deviation sqrt(2): five of them, of the mean of so many.
        let error = 5.0 * (2.0 / count as f32).sqrt();
        assert!((variance / 0.25 - 1.0).abs() < error, "{variance}");
    }

    /// A ceiling whose light varies along x: the gradient against the difference of records made at both sides.
    #[test]
    fn translation() {
        let ceiling = |p: Vec3, d: Vec3| {
            let t = (1.0 - p.z) / d.z;
            (1.0 + 0.5 * (2.0 * (p + t * d).x).sin(), t)
        };
        for x in [0.0, 0.4, 1.0] {
            let at = |x: f32| Vec3::new(x, 0.2, 0.0);
            let here = record(at(x), Vec3::Z, 3, &ceiling);
            let mean =
                |x: f32| (0..16).map(|s| record(at(x), Vec3::Z, 100 + s, &ceiling).radiance.x).sum::<f32>() / 16.0;
            let expected = (mean(x + 0.2) - mean(x - 0.2)) / 0.4;
            let found = (here.at(at(x + 0.1), Vec3::Z).x - here.at(at(x - 0.1), Vec3::Z).x) / 0.2;
            assert!((found - expected).abs() < 0.05, "{x}: {found} {expected}");
        }
    }
}
