//! Random and low-discrepancy numbers, without state: every value is a function of seed, index and dimension.

use std::f32::consts::PI;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use sobol_burley::parts::{self, Int4};

/// Blocks of four dimensions that a point has before they repeat.
const BLOCKS: u32 = sobol_burley::NUM_DIMENSION_SETS_4D;

/// Points of one scrambling.
const INDICES: u32 = 1 << 16;

/// A point of an Owen-scrambled Sobol sequence: as many dimensions as wanted, four at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SobolPoint {
    /// Place in the sequence, bits reversed.
    place: u32,
    seed: u32,
}

impl SobolPoint {
    /// `stream` keeps unrelated uses (pixels, patches, clusters) apart; `index` is the sample's number: among the first 65536 every
    /// prefix of a power of two is well distributed; later points belong to further scramblings.
    #[inline]
    pub fn new(index: u32, stream: u32) -> Self {
        let seed = hash(stream ^ (index / INDICES).wrapping_mul(0x9e37_79b9));
        SobolPoint { place: shuffled((index % INDICES).reverse_bits(), seed), seed }
    }

    /// The point with the same number in another scrambling, independent of this one.
    pub fn elsewhere(self, key: u32) -> Self {
        let seed = hash_all(&[self.seed, key]);
        SobolPoint { place: shuffled(self.place, seed), seed }
    }

    /// Four numbers in 0..1. `dimension` numbers blocks of four; beyond 64 of them (long paths) blocks repeat under another scrambling.
    #[inline]
    pub fn block(self, dimension: u32) -> [f32; 4] {
        if dimension >= BLOCKS {
            return self.elsewhere(dimension / BLOCKS).block(dimension % BLOCKS);
        }
        scrambled(dimension, self.place, scrambles(dimension, self.seed))
    }
}

/// Points of one stream in a row: what they have in common is worked out once.
#[derive(Clone, Copy, Debug)]
pub struct SobolStream {
    stream: u32,
    seed: u32,
    /// Of the first block.
    scrambles: Int4,
}

impl SobolStream {
    /// See [`SobolPoint::new`].
    pub fn new(stream: u32) -> Self {
        let seed = hash(stream);
        SobolStream { stream, seed, scrambles: scrambles(0, seed) }
    }

    /// [`SobolPoint::new`], and its first block of numbers.
    #[inline]
    pub fn point(&self, index: u32) -> (SobolPoint, [f32; 4]) {
        if index >= INDICES {
            let point = SobolPoint::new(index, self.stream);
            return (point, point.block(0));
        }
        let place = shuffled(index.reverse_bits(), self.seed);
        (SobolPoint { place, seed: self.seed }, scrambled(0, place, self.scrambles))
    }
}

/// What a block of dimensions is scrambled with.
#[inline]
fn scrambles(dimension: u32, seed: u32) -> Int4 {
    let seed = seed.wrapping_mul(0x9c8f_2d3b) ^ dimension;
    parts::hash_int4([LANES[0] ^ seed, LANES[1] ^ seed, LANES[2] ^ seed, LANES[3] ^ seed].into())
}

/// A block of dimensions of the point at a place of the sequence.
#[inline]
fn scrambled(dimension: u32, place: u32, scrambles: Int4) -> [f32; 4] {
    let quarters = &QUARTERS[dimension as usize];
    let of = |quarter: usize| quarters[quarter][(place >> (28 - 4 * quarter)) as usize & 15];
    let point = (of(0) ^ of(1)) ^ (of(2) ^ of(3));
    parts::owen_scramble_int4_rev(point, scrambles).reverse_bits().to_f32_norm()
}

/// Four numbers of one point: see [`SobolPoint`].
pub fn sobol(index: u32, dimension: u32, stream: u32) -> [f32; 4] {
    SobolPoint::new(index, stream).block(dimension)
}

/// A place in the sequence under the scrambling of `seed`; bits reversed.
#[inline]
fn shuffled(place: u32, seed: u32) -> u32 {
    parts::owen_scramble_rev(place, parts::hash(seed ^ 0x79c6_8e4a))
}

/// Scrambles of the four dimensions of a block.
const LANES: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];

/// Points of the Sobol sequence, of which every other is a sum of four: by block of dimensions, quarter of the 16 bits of the index, and
/// value of the quarter.
static QUARTERS: LazyLock<Vec<[[Int4; 16]; 4]>> = LazyLock::new(|| {
    let point = |block: u32, quarter: u32, value: u32| parts::sobol_int4_rev(value << (28 - 4 * quarter), block);
    let quarter = |block: u32, quarter: u32| std::array::from_fn(|value| point(block, quarter, value as u32));
    let block = |block: u32| std::array::from_fn(|q| quarter(block, q as u32));
    (0..BLOCKS).map(block).collect()
});

/// A good 32-bit hash (Ettinger's two-round mixer).
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Hash of several numbers, order counts.
pub fn hash_all(values: &[u32]) -> u32 {
    values.iter().fold(0x2545_f491, |h, &v| hash(h ^ v.wrapping_add(0x9e37_79b9).wrapping_add(h << 6)))
}

/// A uniform number in 0..1 from a hash value.
pub fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A cosine-distributed unit vector about +z, `pdf = z / pi`. Concentric map (Shirley and Chiu 1997).
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// A uniform point on the unit disk.
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let o = 2.0 * u - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    if o.x.abs() > o.y.abs() {
        let (sin, cos) = sin_cos_eighth((PI / 4.0) * (o.y / o.x));
        o.x * Vec2::new(cos, sin)
    } else {
        let (sin, cos) = sin_cos_eighth((PI / 4.0) * (o.x / o.y));
        o.y * Vec2::new(sin, cos)
    }
}

/// Sine and cosine of an angle between -pi/4 and pi/4: Taylor's series, whose rest is less than 3e-8 there, half a rounding.
fn sin_cos_eighth(x: f32) -> (f32, f32) {
    let y = x * x;
    let sin = x * (1.0 + y * (-1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5040.0 + y * (1.0 / 362_880.0)))));
    let cos = 1.0 + y * (-0.5 + y * (1.0 / 24.0 + y * (-1.0 / 720.0 + y * (1.0 / 40_320.0))));
    (sin, cos)
}

/// A uniform unit vector.
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// An orthonormal basis whose third axis is the unit vector `n` (Duff et al. 2017).
pub fn basis(n: Vec3) -> glam::Mat3 {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    glam::Mat3::from_cols(
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
        n,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_those_of_the_library() {
        for i in 0..4096 {
            let index = hash(i) >> if i < 2048 { 16 } else { 24 };
            let (block, stream) = (hash(i ^ 7) % BLOCKS, hash(i ^ 9));
            assert_eq!(sobol(index, block, stream), sobol_burley::sample_4d(index, block, hash(stream)));
            let index = if i % 2 == 0 { index } else { hash(i) };
            let point = SobolPoint::new(index, stream);
            assert_eq!(SobolStream::new(stream).point(index), (point, point.block(0)));
        }
    }

    /// Each of 256 points in a strip of its own in every dimension, before and after; and not the same ones.
    #[test]
    fn other_scramblings_are_as_well_distributed() {
        let points: Vec<SobolPoint> = (0..256).map(|i| SobolPoint::new(i, 5)).collect();
        let others: Vec<SobolPoint> = points.iter().map(|p| p.elsewhere(3)).collect();
        for dimension in [0, 7, 63, 64, 200] {
            for lane in 0..4 {
                let strips = |of: &[SobolPoint]| of.iter().map(|p| (256.0 * p.block(dimension)[lane]) as u32).collect();
                let [own, other]: [Vec<u32>; 2] = [&points, &others].map(|p| strips(p));
                assert_ne!(own, other);
                for mut strips in [own, other] {
                    strips.sort_unstable();
                    assert!(strips.iter().copied().eq(0..256), "{dimension} {lane}");
                }
            }
        }
    }
}
