//! Points on patches, uniform by area, and ray origins on the right side of them.

use glam::{Vec2, Vec3};

use super::Patches;
use crate::simplify::SimplifiedGeometry;

/// A point on a patch, on its front or back.
#[derive(Clone, Copy, Debug)]
pub(in crate::radiosity) struct PatchPoint {
    /// Triangle of the geometry.
    pub triangle: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// Position.
    pub position: Vec3,
    /// Unit normal of the side.
    pub normal: Vec3,
    /// Distance by which a ray's origin has to be moved along `normal`.
    offset: f32,
}

/// How far points are drawn towards the middle of their piece, as a share of its size: a point on an edge may by rounding lie
/// behind the wall that meets it there.
const INSET: f32 = 1.0 / 65_536.0;

impl Patches {
    /// The point of `side` that belongs to `s`, uniform in 0..1, as barycentrics of a triangle.
    pub fn sample(&self, patch: u32, s: [f32; 2]) -> (u32, Vec2) {
        let range = self.first_piece[patch as usize] as usize..self.first_piece[patch as usize + 1] as usize;
        let pieces = &self.pieces[range];
        let i = pieces.partition_point(|p| p.share <= s[0]).min(pieces.len() - 1);
        let before = if i == 0 { 0.0 } else { pieces[i - 1].share };
        let x = ((s[0] - before) / (pieces[i].share - before)).clamp(0.0, 1.0);
        // Map of the square to the triangle with little distortion (Heitz 2019).
        let (b1, b2) = if s[1] > x { (0.5 * x, s[1] - 0.5 * x) } else { (x - 0.5 * s[1], 0.5 * s[1]) };
        let inset = |b: f32| b + INSET * (1.0 / 3.0 - b);
        let (b1, b2) = (inset(b1), inset(b2));
        let [p, q, r] = pieces[i].uv;
        (pieces[i].triangle, p + b1 * (q - p) + b2 * (r - p))
    }

    /// [`Patches::sample`] with all that a ray needs to start there.
    pub fn sample_side(&self, geometry: &SimplifiedGeometry, side: u32, s: [f32; 2]) -> PatchPoint {
        let (triangle, uv) = self.sample(side / 2, s);
        let front = side % 2 == 0;
        PatchPoint::new(geometry, self.normals[triangle as usize], triangle, uv, front)
    }
}

impl PatchPoint {
    /// The point at barycentrics `uv` of a triangle, on the side its unit `normal` shows to or the other.
    pub fn new(geometry: &SimplifiedGeometry, normal: Vec3, triangle: u32, uv: Vec2, front: bool) -> PatchPoint {
        let [a, b, c] = geometry.triangles[triangle as usize].map(|i| geometry.positions[i as usize]);
        let position = (1.0 - uv.x - uv.y) * a + uv.x * b + uv.y * c;
        // Rounding of the interpolation is bounded by the coordinates (Pharr et al., Physically Based Rendering 4ed, 6.8),
        // that of an intersection with the point's own triangle by the triangle's size, axis by axis.
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let size = high - low;
        let error = 8.0 * (0.5 * f32::EPSILON) * (low.abs().max(high.abs()) + size);
        let least = size.max_element() * 1e-12;
        let normal = if front { normal } else { -normal };
        PatchPoint { triangle, u: uv.x, v: uv.y, position, normal, offset: normal.abs().dot(error).max(least) }
    }

    /// Origin for a ray that leaves to the side of the normal.
    pub fn ray_origin(&self) -> Vec3 {
        let moved = self.position + self.offset * self.normal;
        // Where the move is lost in rounding, go to the next number away from the surface.
        let away = |from: f32, to: f32, n: f32| match (to == from, n) {
            (true, n) if n > 0.25 => from.next_up(),
            (true, n) if n < -0.25 => from.next_down(),
            _ => to,
        };
        Vec3::new(
            away(self.position.x, moved.x, self.normal.x),
            away(self.position.y, moved.y, self.normal.y),
            away(self.position.z, moved.z, self.normal.z),
        )
    }
}
