//! Uniform sampling of the solid angle that rectangles and triangles subtend, in f64: the differences of nearly equal
//! angles that appear here are worthless in f32 for thin, grazing or distant light sources.
//!
//! Coordinates are relative to the point that is lit.

use std::f64::consts::TAU;

use glam::DVec3;

/// A rectangle in its own frame: the point that is lit is the origin, the rectangle spans `x` times `y` in the plane at
/// height `z > 0`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    /// Range along the first axis, `x[0] < x[1]`.
    pub x: [f64; 2],
    /// Range along the second axis.
    pub y: [f64; 2],
    /// Distance of the plane.
    pub z: f64,
}

impl Rectangle {
    /// Subtended solid angle, 0..2 pi.
    ///
    /// `sum of +-atan(x y / (z r))` over the corners, as the argument of one complex product: one arctangent instead
    /// of four. The terms are those of Urena, Fajardo and King (2013), without their arc cosines near 1.
    pub(super) fn solid_angle(&self) -> f64 {
        let ([x0, x1], [y0, y1], z) = (self.x, self.y, self.z);
        let corner = |x: f64, y: f64| (z * (x * x + y * y + z * z).sqrt(), x * y);
        let product =
            multiply(multiply(corner(x1, y1), corner(x0, y0)), conjugate(multiply(corner(x0, y1), corner(x1, y0))));
        if x0 < 0.0 && x1 > 0.0 && y0 < 0.0 && y1 > 0.0 {
            full_turn(product)
        } else {
            // At most half of the hemisphere; a rounding error below zero must not become a full turn
            product.1.atan2(product.0).max(0.0)
        }
    }

    /// The point of the rectangle at `u`, uniform in solid angle; each coordinate grows with its random number.
    /// `solid_angle` is that of this rectangle. Urena, Fajardo, King: "An area-preserving parametrization for spherical
    /// rectangles" (2013), section 4.
    pub(super) fn sample(&self, solid_angle: f64, u: [f64; 2]) -> [f64; 2] {
        let ([x0, x1], [y0, y1], z) = (self.x, self.y, self.z);
        let (h0, h1) = ((y0 * y0 + z * z).sqrt(), (y1 * y1 + z * z).sqrt());
        // z components of the inward normals of the planes through the edges y0 and y1
        let (b0, b1) = (-y0 / h0, y1 / h1);
        // 2 pi less the inner angles at the two corners of edge x0
        let corner = |y: f64, sign: f64| (sign * x0 * y, z * (x0 * x0 + y * y + z * z).sqrt());
        let k = TAU - full_turn(multiply(corner(y1, 1.0), corner(y0, -1.0)));
        let (sin, cos) = (u[0] * solid_angle + k).sin_cos();
        let f = (cos * b0 - b1) / sin;
        // their cu / sqrt(1 - cu^2) with b0^2 - 1 = -z^2 / h0^2 put in, so that nothing cancels twice
        let below = f * f - (z / h0) * (z / h0);
        let x = if below > 0.0 { f.signum() * z / below.sqrt() } else { f.signum() * f64::INFINITY };
        // 0 / 0 where an end of the range is seen along the plane
        let x = if x.is_nan() { if u[0] < 0.5 { x0 } else { x1 } } else { x.clamp(x0, x1) };
        let d2 = x * x + z * z;
        let (s0, s1) = (y0 / (d2 + y0 * y0).sqrt(), y1 / (d2 + y1 * y1).sqrt());
        let s = s0 + u[1] * (s1 - s0);
        let rest = 1.0 - s * s;
        let y = if rest > 0.0 { s * (d2 / rest).sqrt() } else { s.signum() * f64::INFINITY };
        [x, y.clamp(y0, y1)]
    }
}

/// A triangle seen from the origin, front side towards it or not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// Triple product of the corner directions, not negative.
    triple: f64,
    /// Distances of the corners.
    lengths: [f64; 3],
}

impl Triangle {
    /// The triangle `corner`, `corner + edges[0]`, `corner + edges[1]`; `cross` is the cross product of the edges.
    pub(super) fn new(corner: DVec3, edges: [DVec3; 2], cross: DVec3) -> Self {
        let (b, c) = (corner + edges[0], corner + edges[1]);
        let lengths = [corner.length(), b.length(), c.length()];
        // Taken from the edges: the product of the corner directions would cancel for small triangles
        let triple = corner.dot(cross).abs() / (lengths[0] * lengths[1] * lengths[2]);
        Triangle { a: corner / lengths[0], b: b / lengths[1], c: c / lengths[2], triple, lengths }
    }

    /// Subtended solid angle, 0..2 pi (Van Oosterom and Strackee 1983). NaN when the origin is a corner.
    pub(super) fn solid_angle(&self) -> f64 {
        2.0 * self.triple.atan2(1.0 + self.a.dot(self.b) + self.b.dot(self.c) + self.c.dot(self.a))
    }

    /// Distance of the farthest corner.
    pub(super) fn farthest(&self) -> f64 {
        self.lengths.into_iter().fold(0.0, f64::max)
    }

    /// A unit direction into the triangle, uniform in solid angle, and the barycentric weights of the second and third
    /// corner there. `solid_angle` is that of this triangle.
    ///
    /// Arvo (1995), pbrt 4ed 6.5.4: the first number cuts off a part of the area through the second corner, the second
    /// moves along the cut. The cut is found with half-angle tangents in Van Oosterom and Strackee's formula, which
    /// gives the same map as Arvo's and needs no interior angles: those of slivers are inexact.
    pub(super) fn sample(&self, solid_angle: f64, u: [f64; 2]) -> (DVec3, [f64; 2]) {
        let Triangle { a, b, c, triple, lengths } = *self;
        let out_of_edge = a.cross(c);
        let sin_b = out_of_edge.length();
        if sin_b == 0.0 {
            return (b, [1.0, 0.0]);
        }
        // Along the edge from a to c: cos s a + sin s e. tan(area / 2) = t T / (1 + a.b + t b.e) with t = tan(s / 2)
        let e = out_of_edge.cross(a) / sin_b;
        let (sin, cos) = (0.5 * u[0] * solid_angle).sin_cos();
        let (num, den) = (sin * (1.0 + a.dot(b)), cos * (triple / sin_b) - sin * b.dot(e));
        let norm = num * num + den * den;
        let p = if norm > 0.0 { ((den * den - num * num) / norm) * a + (2.0 * num * den / norm) * e } else { c };
        // Along the arc from b to p with 1 - cos uniform
        let h = 0.5 * u[1] * (p - b).length_squared();
        let towards = (p - p.dot(b) * b).normalize_or_zero();
        let w = (1.0 - h) * b + (h * (2.0 - h)).max(0.0).sqrt() * towards;
        // w = (wa A + wb B + wc C) / sum, by Cramer's rule: ratios of triple products
        let wa = (w.dot(b.cross(c)) / lengths[0]).abs();
        let wb = (w.dot(c.cross(a)) / lengths[1]).abs();
        let wc = (w.dot(a.cross(b)) / lengths[2]).abs();
        let sum = wa + wb + wc;
        (w, if sum > 0.0 { [wb / sum, wc / sum] } else { [1.0, 0.0] })
    }
}

/// Uniform barycentric weights of the second and third corner of a triangle (square-root map).
pub(super) fn uniform_triangle(u: [f64; 2]) -> [f64; 2] {
    let s = u[0].sqrt();
    [s * (1.0 - u[1]), s * u[1]]
}

type Complex = (f64, f64);

fn multiply(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn conjugate(a: Complex) -> Complex {
    (a.0, -a.1)
}

/// Argument in 0..2 pi.
fn full_turn(a: Complex) -> f64 {
    let angle = a.1.atan2(a.0);
    if angle < 0.0 { angle + TAU } else { angle }
}
