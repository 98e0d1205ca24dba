//! Points on patches, uniform by area.

use glam::Vec2;

use super::{Patches, Piece};
use crate::shading::SurfacePoint;
use crate::simplify::SimplifiedGeometry;

/// How far points are drawn towards the middle of their piece, as a share of its size: a point on an edge may by rounding lie
/// behind the wall that meets it there.
const INSET: f32 = 1.0 / 1_048_576.0;

/// A barycentric drawn that far.
pub(in crate::radiosity) fn inset(b: f32) -> f32 {
    b + INSET * (1.0 / 3.0 - b)
}

impl Patches {
    /// What a patch is made of.
    pub(super) fn pieces(&self, patch: u32) -> &[Piece] {
        &self.pieces[self.first_piece[patch as usize] as usize..self.first_piece[patch as usize + 1] as usize]
    }

    /// The point of `patch` that belongs to `s`, uniform in 0..1, as barycentrics of a triangle.
    pub fn sample(&self, patch: u32, s: [f32; 2]) -> (u32, Vec2) {
        let pieces = self.pieces(patch);
        let i = pieces.partition_point(|p| p.share <= s[0]).min(pieces.len() - 1);
        let before = if i == 0 { 0.0 } else { pieces[i - 1].share };
        let x = ((s[0] - before) / (pieces[i].share - before)).clamp(0.0, 1.0);
        // Map of the square to the triangle with little distortion (Heitz 2019).
        let (b1, b2) = if s[1] > x { (0.5 * x, s[1] - 0.5 * x) } else { (x - 0.5 * s[1], 0.5 * s[1]) };
        let (b1, b2) = (inset(b1), inset(b2));
        let [p, q, r] = pieces[i].uv;
        (pieces[i].triangle, p + b1 * (q - p) + b2 * (r - p))
    }

    /// [`Patches::sample`] as a point that rays can start from.
    pub fn point(&self, geometry: &SimplifiedGeometry, patch: u32, s: [f32; 2]) -> SurfacePoint {
        let (triangle, uv) = self.sample(patch, s);
        self.point_at(geometry, triangle, uv)
    }

    /// Barycentrics of a triangle as a point that rays can start from.
    pub fn point_at(&self, geometry: &SimplifiedGeometry, triangle: u32, uv: Vec2) -> SurfacePoint {
        let corners = geometry.triangles[triangle as usize].map(|i| geometry.positions[i as usize]);
        SurfacePoint::on_plane(corners, &self.planes[triangle as usize], triangle, uv.x, uv.y)
    }
}
