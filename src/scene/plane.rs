//! What rays that leave a triangle have to know of its plane.

use glam::{DVec3, Vec3};

/// Unit roundoff of f32, 2^-24.
const ROUNDOFF: f64 = f32::EPSILON as f64 * 0.5;

/// Roundings that one product in the determinant of a ray-triangle test goes through: translation of the vertices
/// (1), two edges from them (3 each, as their error is absolute), two products, a difference and a dot product (5),
/// rounded up for terms of second order.
const TEST_ROUNDINGS: f64 = 16.0;

/// Rays start at least this far from their triangle, as a share of its size.
const SMALLEST_OFFSET: f64 = 1e-12;

/// Unit normal of a triangle, and how far off it rays start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plane {
    /// Unit normal of the counter-clockwise side; zero where the triangle has no area.
    pub normal: Vec3,
    /// Distance from which a later intersection test in f32 cannot find the triangle again.
    pub clearance: f32,
    /// Bound on the error along each axis of a point interpolated in f64, before it is rounded to f32.
    pub interpolation: f32,
    /// Whether the triangle is shaded with this normal all over.
    pub flat: bool,
}

impl Plane {
    /// Of a flat triangle with these corners. Evaluated in f64.
    ///
    /// The clearance bounds the error of an f32 intersection test: the signed distance to the plane is a determinant of
    /// vectors no longer than the triangle's extent `w` along each axis, divided by the length of the normal; its six products
    /// are each off by at most `TEST_ROUNDINGS` roundings. That holds for Moeller-Trumbore as for Embree's robust
    /// (Pluecker) test, and is nothing for walls along the axes.
    pub fn of(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let cross = (b - a).cross(c - a);
        let double_area = cross.length();
        let interpolation = 8.0 * f64::EPSILON * (a.abs() + b.abs() + c.abs()).max_element();
        let interpolation = (interpolation as f32).next_up();
        if double_area == 0.0 {
            return Plane { interpolation, flat: true, ..Plane::default() };
        }
        let normal = cross / double_area;
        let rounding = ROUNDOFF * a.abs().max(b.abs()).max(c.abs()) + f64::from(interpolation);
        let extent = a.max(b).max(c) - a.min(b).min(c) + rounding;
        let test_error = |w: DVec3| 6.0 * TEST_ROUNDINGS * ROUNDOFF * w.x * w.y * w.z / double_area;
        // The origin moves off the triangle by the bound itself, which lengthens the vectors a little.
        let moved = normal.abs().dot(rounding) + test_error(extent);
        // In a plane through the origin along the axes all of this is zero, and rays started in the plane would hit it at 0.
        let least = SMALLEST_OFFSET * extent.max_element();
        let clearance = test_error(extent + 2.0 * moved * normal.abs()).max(least);
        Plane { normal: normal.as_vec3(), clearance: (clearance as f32).next_up(), interpolation, flat: true }
    }
}
