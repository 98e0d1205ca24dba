//! The forms that things are made of. Lengths are metres, y is up, and solids stand on y = 0 unless they say otherwise.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Mat3, Vec2, Vec3, vec3};

use crate::shape::Shape;

/// Faces of a box, to leave out what can never be seen.
pub const X_LOW: u8 = 1;
pub const X_HIGH: u8 = 2;
pub const BOTTOM: u8 = 4;
pub const TOP: u8 = 8;
pub const Z_LOW: u8 = 16;
pub const Z_HIGH: u8 = 32;
pub const ALL_FACES: u8 = 63;

/// An axis-aligned box with the given `faces`.
pub fn cuboid(low: Vec3, high: Vec3, faces: u8) -> Shape {
    let p = |i: usize| {
        vec3(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    const CORNERS: [[usize; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mut shape = Shape::default();
    for (face, corners) in CORNERS.iter().enumerate() {
        if faces & (1 << face) != 0 {
            shape.polygon(&corners.map(p));
        }
    }
    shape
}

/// A box of the given size whose bottom face is centred on the origin.
pub fn block(width: f32, height: f32, depth: f32, faces: u8) -> Shape {
    cuboid(vec3(-width / 2.0, 0.0, -depth / 2.0), vec3(width / 2.0, height, depth / 2.0), faces)
}

/// A flat rectangle facing up, centred on the origin.
pub fn rectangle(width: f32, depth: f32) -> Shape {
    cuboid(vec3(-width / 2.0, -1.0, -depth / 2.0), vec3(width / 2.0, 0.0, depth / 2.0), TOP)
}

/// A box standing on y = 0 with edges chamfered at 45 degrees by `bevel`; all but the bottom edges when not `bottom`,
/// and then without bottom face.
pub fn bevelled(width: f32, height: f32, depth: f32, bevel: f32, bottom: bool) -> Shape {
    let (x, z) = (width / 2.0, depth / 2.0);
    let ring = |x, z, cut, y| rounded_rectangle(x, z, cut, 1, y);
    let mut loops = vec![ring(x, z, bevel, 0.0)];
    if bottom {
        loops = vec![ring(x - bevel, z - bevel, 0.0, 0.0), ring(x, z, bevel, bevel)];
    }
    loops.push(ring(x, z, bevel, height - bevel));
    loops.push(ring(x - bevel, z - bevel, 0.0, height));
    loft(&loops, bottom, true)
}

/// A rounded rectangle as a loop, counter-clockwise from above, with `steps` segments a corner.
pub fn rounded_rectangle(x: f32, z: f32, radius: f32, steps: usize, y: f32) -> Vec<Vec3> {
    let mut points = Vec::new();
    for (corner, (sx, sz)) in [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].into_iter().enumerate() {
        for step in 0..=steps {
            // Angle from +z towards +x turns counter-clockwise seen from above.
            let angle = FRAC_PI_2 * (corner as f32 + step as f32 / steps as f32);
            let (sin, cos) = angle.sin_cos();
            points.push(vec3(sx * (x - radius) + radius * sin, y, sz * (z - radius) + radius * cos));
        }
    }
    points
}

/// Skin over loops of equally many points, each counter-clockwise from above, from the lowest to the highest.
pub fn loft(loops: &[Vec<Vec3>], bottom: bool, top: bool) -> Shape {
    let mut shape = Shape::default();
    let columns = loops[0].len();
    shape.net(loops.len(), columns, true, |row, column| loops[row][column]);
    if bottom {
        let mut cap = loops[0].clone();
        cap.reverse();
        shape.polygon(&cap);
    }
    if top {
        shape.polygon(&loops[loops.len() - 1]);
    }
    shape
}

/// A soft box (cushion, moulded case): all edges rounded by `radius` with `steps` segments a quarter.
pub fn cushion(width: f32, height: f32, depth: f32, radius: f32, steps: usize) -> Shape {
    let radius = radius.min(0.49 * height).min(0.49 * width).min(0.49 * depth);
    let ring = |y: f32, angle: f32| {
        let inset = radius * (1.0 - angle.cos());
        // The corner radius shrinks with the inset, but never to nothing.
        rounded_rectangle(
            width / 2.0 - inset,
            depth / 2.0 - inset,
            (1.05 * radius - inset).max(0.05 * radius),
            steps,
            y,
        )
    };
    let mut loops = Vec::new();
    for step in 0..=steps {
        let angle = FRAC_PI_2 * (1.0 - step as f32 / steps as f32);
        loops.push(ring(radius * (1.0 - angle.sin()), angle));
    }
    for step in 0..=steps {
        let angle = FRAC_PI_2 * step as f32 / steps as f32;
        loops.push(ring(height - radius * (1.0 - angle.sin()), angle));
    }
    loft(&loops, true, true)
}

/// A solid of revolution about y: the profile of (radius, height) runs so that outside is on its right
/// (bottom to top along an outer wall). A radius of 0 closes the solid there.
pub fn lathe(profile: &[(f32, f32)], segments: usize) -> Shape {
    let mut shape = Shape::default();
    shape.net(profile.len(), segments, true, |row, column| {
        let (radius, y) = profile[row];
        let (sin, cos) = (TAU * column as f32 / segments as f32).sin_cos();
        vec3(radius * sin, y, radius * cos)
    });
    shape
}

/// A cylinder standing on y = 0, with both ends.
pub fn cylinder(radius: f32, height: f32, segments: usize) -> Shape {
    lathe(&[(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], segments)
}

/// A cylinder standing on y = 0 without its bottom.
pub fn peg(radius: f32, height: f32, segments: usize) -> Shape {
    lathe(&[(radius, 0.0), (radius, height), (0.0, height)], segments)
}

/// A ball around the origin.
pub fn ball(radius: f32, segments: usize) -> Shape {
    let rows = (segments / 2).max(2);
    let profile: Vec<_> = (0..=rows)
        .map(|row| {
            let angle = std::f32::consts::PI * row as f32 / rows as f32;
            let r = if row == 0 || row == rows { 0.0 } else { radius * angle.sin() };
            (r, -radius * angle.cos())
        })
        .collect();
    lathe(&profile, segments)
}

/// A round bar along a path with radius `radius(t)`, `t` from 0 to 1; both ends closed.
pub fn tube(path: &[Vec3], radius: impl Fn(f32) -> f32, segments: usize) -> Shape {
    let mut side = Vec3::ZERO;
    let rings: Vec<Vec<Vec3>> = (0..path.len())
        .map(|i| {
            let tangent = (path[(i + 1).min(path.len() - 1)] - path[i.saturating_sub(1)]).normalize();
            // Carrying the side vector along keeps the bar from twisting.
            side = if i == 0 { tangent.any_orthonormal_vector() } else { side.reject_from(tangent).normalize() };
            let other = tangent.cross(side);
            let r = radius(i as f32 / (path.len() - 1) as f32);
            (0..segments)
                .map(|s| {
                    let (sin, cos) = (TAU * s as f32 / segments as f32).sin_cos();
                    path[i] + r * (cos * side + sin * other)
                })
                .collect()
        })
        .collect();
    loft(&rings, true, true)
}

/// A round bar between two points.
pub fn bar(from: Vec3, to: Vec3, radius: f32, segments: usize) -> Shape {
    tube(&[from, to], |_| radius, segments)
}

/// A smooth path through points (Catmull-Rom), `steps` pieces a span.
pub fn curve(points: &[Vec3], steps: usize) -> Vec<Vec3> {
    let last = points.len() - 1;
    let at = |i: isize| points[i.clamp(0, last as isize) as usize];
    let mut path = Vec::new();
    for span in 0..last {
        let i = span as isize;
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            let p = b * 2.0
                + (c - a) * t
                + (a * 2.0 - b * 5.0 + c * 4.0 - d) * (t * t)
                + (b * 3.0 - a - c * 3.0 + d) * (t * t * t);
            path.push(p * 0.5);
        }
    }
    path.push(points[last]);
    path
}

/// A thin sheet: `point` maps the unit square; its front is where u cross v points.
pub fn sheet(u_steps: usize, v_steps: usize, point: impl Fn(Vec2) -> Vec3) -> Shape {
    let mut shape = Shape::default();
    shape.net(v_steps + 1, u_steps + 1, false, |row, column| {
        point(Vec2::new(column as f32 / u_steps as f32, row as f32 / v_steps as f32))
    });
    shape
}

/// A pointed leaf along +z, `length` long and `width` wide, folded along its middle by `fold` (rise of the edges over
/// half the width) and bent down by `droop` radians over its length.
pub fn leaf(length: f32, width: f32, fold: f32, droop: f32, across: usize, along: usize) -> Shape {
    sheet(across, along, |uv| {
        let t = uv.y;
        // Widest a third from the stem; the tip keeps a trace of width so that no triangle degenerates.
        let half = 0.5 * width * ((std::f32::consts::PI * t.powf(0.75)).sin().max(0.0) * 0.97 + 0.03);
        let s = 2.0 * uv.x - 1.0;
        let (z, y) = if droop.abs() < 1e-3 {
            (length * t, 0.0)
        } else {
            let radius = length / droop;
            ((droop * t).sin() * radius, ((droop * t).cos() - 1.0) * radius)
        };
        vec3(s * half, y + fold * s.abs() * half, z)
    })
}

/// A frame (picture, window) in the xy plane, front at +z: outer size, bar width, thickness. The back is left out.
pub fn frame(width: f32, height: f32, bar: f32, thickness: f32) -> Shape {
    let (x, y) = (width / 2.0, height / 2.0);
    let corner = |i: usize, inset: f32, z: f32| {
        let (sx, sy) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][i % 4];
        vec3(sx * (x - inset), sy * (y - inset), z)
    };
    let mut shape = Shape::default();
    // Mitred corners: the four bars meet at 45 degrees and nothing overlaps.
    for i in 0..4 {
        let j = i + 1;
        shape.polygon(&[
            corner(i, 0.0, thickness),
            corner(j, 0.0, thickness),
            corner(j, bar, thickness),
            corner(i, bar, thickness),
        ]);
        shape.polygon(&[
            corner(i, 0.0, 0.0),
            corner(j, 0.0, 0.0),
            corner(j, 0.0, thickness),
            corner(i, 0.0, thickness),
        ]);
        shape.polygon(&[
            corner(j, bar, 0.0),
            corner(i, bar, 0.0),
            corner(i, bar, thickness),
            corner(j, bar, thickness),
        ]);
    }
    shape
}

/// Section of a moulding against a wall: inset from its outer edge and height over the wall, from the outer edge over the front to
/// the inner one, edges rounded by `radius` with `steps` segments a quarter.
fn moulding_section(bar: f32, thickness: f32, radius: f32, steps: usize) -> Vec<(f32, f32)> {
    let quarter = |step: usize| (FRAC_PI_2 * step as f32 / steps as f32).sin_cos();
    let outer = (0..=steps).map(quarter).map(|(sin, cos)| (radius * (1.0 - cos), thickness - radius * (1.0 - sin)));
    let inner =
        (0..=steps).map(quarter).map(|(sin, cos)| (bar - radius * (1.0 - sin), thickness - radius * (1.0 - cos)));
    std::iter::once((0.0, 0.0)).chain(outer).chain(inner).chain([(bar, 0.0)]).collect()
}

/// A [`frame`] whose edges are rounded by `radius` with `steps` segments a quarter: with four or more it is one surface.
pub fn moulding(width: f32, height: f32, bar: f32, thickness: f32, radius: f32, steps: usize) -> Shape {
    let section = moulding_section(bar, thickness, radius, steps);
    let mut shape = Shape::default();
    shape.net(section.len(), 4, true, |row, corner| {
        let (sx, sy) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][corner];
        let (inset, z) = section[row];
        vec3(sx * (width / 2.0 - inset), sy * (height / 2.0 - inset), z)
    });
    shape
}

/// The same around a door, `width` and `height` outside, standing on y = 0: open below.
pub fn casing(width: f32, height: f32, bar: f32, thickness: f32, radius: f32, steps: usize) -> Shape {
    let section = moulding_section(bar, thickness, radius, steps);
    let mut shape = Shape::default();
    shape.net(section.len(), 4, false, |row, corner| {
        let (inset, z) = section[row];
        let side = width / 2.0 - inset;
        let top = height - inset;
        let (x, y) = [(side, 0.0), (side, top), (-side, top), (-side, 0.0)][corner];
        vec3(x, y, z)
    });
    shape
}

/// A path along straight lines whose corners are rounded to arcs of the given radius, `steps` pieces each.
pub fn rounded_path(points: &[Vec3], radius: f32, steps: usize) -> Vec<Vec3> {
    let mut path = vec![points[0]];
    for corner in points.windows(3) {
        let (before, after) = ((corner[1] - corner[0]).normalize(), (corner[2] - corner[1]).normalize());
        let turn = before.angle_between(after);
        let inward = after.reject_from(before).normalize();
        let start = corner[1] - before * radius * (0.5 * turn).tan();
        path.extend((0..=steps).map(|step| {
            let (sin, cos) = (turn * step as f32 / steps as f32).sin_cos();
            start + radius * (sin * before + (1.0 - cos) * inward)
        }));
    }
    path.push(points[points.len() - 1]);
    path
}

/// A ball of crumpled paper: an icosahedron cut `cuts` times whose vertices move in and out by up to `depth`.
pub fn crumpled(radius: f32, cuts: usize, depth: f32, mut random: impl FnMut() -> f32) -> Shape {
    let g = 0.5 * (1.0 + 5.0_f32.sqrt());
    let mut points: Vec<Vec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([vec3(0.0, a, b), vec3(a, b, 0.0), vec3(b, 0.0, a)]);
    }
    for p in &mut points {
        *p = p.normalize();
    }
    let mut faces: Vec<[u32; 3]> = Vec::new();
    let edge = 1.06;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let (p, q, r) = (points[a], points[b], points[c]);
                if p.distance(q) < edge && q.distance(r) < edge && r.distance(p) < edge {
                    let outward = Mat3::from_cols(p, q, r).determinant() > 0.0;
                    faces.push(if outward { [a as u32, b as u32, c as u32] } else { [a as u32, c as u32, b as u32] });
                }
            }
        }
    }
    for _ in 0..cuts {
        let mut middle = std::collections::HashMap::new();
        let mut next = Vec::with_capacity(4 * faces.len());
        for &[a, b, c] in &faces {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q): (u32, u32)| {
                *middle.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as u32 - 1
                })
            });
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = next;
    }
    let positions = points.iter().map(|p| *p * radius * (1.0 - depth * random())).collect();
    Shape { positions, triangles: faces }
}
