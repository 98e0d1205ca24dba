//! Light sources with area: irradiance, uniformity in solid angle, extreme shapes and places.

use glam::{DVec3, Vec3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::area::{AreaLight, AreaLights, Seen, View};
use super::*;
use crate::scene::texture::{Texels, Wrap};
use crate::scene::{Alpha, Texture, TextureSlot};

/// Relative rounding of an irradiance: f32 weights and directions.
const ROUNDING: f64 = 1e-6;

fn check(polygon: &[Vec3], radiance: f32, receiver: ([f32; 3], [f32; 3]), expected: f64, what: &str) {
    let scene = scene(&[(polygon.to_vec(), emitter(radiance))], &[]);
    let (position, normal) = (Vec3::from(receiver.0), Vec3::from(receiver.1).normalize());
    let exact = f64::from(radiance) * lambert(polygon, position, normal);
    assert!((exact - expected).abs() <= 2e-6 * expected.max(1e-3), "{what}: reference {exact} instead of {expected}");
    irradiance(&scene, position, normal, 1 << 15, 1).assert_near(expected, ROUNDING + 1e-6, what);
}

#[test]
fn published_irradiances() {
    let square = points([[-0.5, -0.5, 1.0], [-0.5, 0.5, 1.0], [0.5, 0.5, 1.0], [0.5, -0.5, 1.0]]);
    let up = [0.0, 0.0, 1.0];
    check(&square, 1.0, ([0.0; 3], up), 0.7522746884541075, "DIR-001 a");
    check(&square, 1.0, ([1.0, 0.0, 0.0], up), 0.26500485234506055, "DIR-001 b");
    check(&square, 1.0, ([0.0; 3], [1.0, 0.0, 0.0]), 0.08751026477375237, "DIR-001 c");
    check(&square, 1.0, ([0.25, 0.0, 0.0], [0.6, 0.0, 0.8]), 0.4801289568872302, "DIR-001 d");
    check(&square, 1.0, ([3.0, 3.0, 0.0], up), 0.0028629878444064076, "DIR-001 e");

    let triangle = points([[0.0, 0.0, 2.0], [0.0, 1.0, 2.5], [1.5, 0.0, 3.0]]);
    check(&triangle, 5.0, ([0.2, 0.2, 0.0], up), 0.5236346487339228, "DIR-002 a");
    check(&triangle, 5.0, ([1.0, 1.0, 0.0], [0.3, 0.0, 0.954]), 0.5210060145074081, "DIR-002 b");

    let ceiling = points([[1.5, 1.5, 3.0], [1.5, 2.5, 3.0], [2.5, 2.5, 3.0], [2.5, 1.5, 3.0]]);
    let wall = [32.676898014391845, 75.19392456629544, 81.32317212494463, 69.06062701304937, 53.4035311081542];
    for (i, expected) in wall.into_iter().enumerate() {
        check(&ceiling, 1000.0, ([2.0, 0.0, 2.75 - 0.5 * i as f32], [0.0, 1.0, 0.0]), expected, "CIE-003 wall");
    }
    let floor = [61.424098538461486, 79.25515731623122, 95.66727633333511, 105.77824217629438];
    for (i, expected) in floor.into_iter().enumerate() {
        check(&ceiling, 1000.0, ([2.0, 0.25 + 0.5 * i as f32, 0.0], up), expected, "CIE-003 floor");
    }
    check(&ceiling, 1.0, ([2.0, 2.0, 0.0], up), 0.1071496562944277, "HARD-006");

    let pi = std::f64::consts::PI;
    let parallel = points([[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [1.0, 2.0, 1.0], [1.0, 0.0, 1.0]]);
    check(&parallel, 1.0, ([0.0; 3], up), pi * 0.16737500991438375, "FF-021");
    // The published order shows its back: turned over
    let upright = points([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]);
    check(&upright, 1.0, ([0.5, 0.5, 0.0], up), pi * 0.1901358823848066, "FF-022");
    let mut tilted = points([[-2.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-2.0, 1.0, 1.0]]);
    tilted.reverse();
    check(&tilted, 1.0, ([0.0; 3], [0.6, 0.0, 0.8]), pi * 0.44667479456158604, "FF-023");
    let abutting = points([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    check(&abutting, 1.0, ([0.5, 0.0, -1.0 / 8192.0], [0.0, 1.0, 0.0]), pi * 0.49990427204891097, "HARD-005");
}

/// CIE-001's Lambertian point: a square of 1e-3.
#[test]
fn tiny_square() {
    let h = 0.5e-3;
    let square = points([[-h, -h, 3.0], [-h, h, 3.0], [h, h, 3.0], [h, -h, 3.0]]);
    let side = f64::from(h + h);
    for ([x, y], expected) in [([0.0, 0.0], 111.11111111111111), ([1.0, 0.0], 90.0), ([1.5, 1.5], 49.382716049382715)] {
        let scene = scene(&[(square.clone(), emitter(1e9))], &[]);
        let expected = expected * side * side / 1e-6;
        // The light's extent changes the value by (size / distance)^2 = 1e-7
        irradiance(&scene, Vec3::new(x, y, 0.0), Vec3::Z, 4096, 2).assert_near(expected, ROUNDING, "CIE-001");
    }
}

/// A sphere of triangles: octahedron, each face cut `levels` times.
fn sphere(centre: Vec3, radius: f32, levels: u32) -> Vec<Vec<Vec3>> {
    let mut faces = Vec::new();
    for octant in 0..8 {
        let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let mut face = vec![Vec3::X * sign(0), Vec3::Y * sign(1), Vec3::Z * sign(2)];
        if sign(0) * sign(1) * sign(2) < 0.0 {
            face.swap(1, 2);
        }
        faces.push(face);
    }
    for _ in 0..levels {
        faces = faces
            .iter()
            .flat_map(|f| {
                let m = [0, 1, 2].map(|k| (f[k] + f[(k + 1) % 3]).normalize());
                [vec![f[0], m[0], m[2]], vec![m[0], f[1], m[1]], vec![m[2], m[1], f[2]], m.to_vec()]
            })
            .collect();
    }
    faces.iter().map(|f| f.iter().map(|&p| centre + radius * p).collect()).collect()
}

#[test]
fn spheres() {
    let cases = [
        (1.0_f32, 3.0_f32, 0.0_f32, 1.0_f32, 0.3490658503988659, "DIR-003"),
        (1.0, 2.0, 80.0, 1.0, 0.17183197512739562, "DIR-004"),
        (1e-4, 10.0, 60.0, 1e6, 0.00015707963267948965, "DIR-005"),
    ];
    for (radius, distance, degrees, radiance, expected, what) in cases {
        // The light is at the origin, the receiver away from it: positions keep their precision
        let faces = sphere(Vec3::ZERO, radius, 4);
        let position = distance * Vec3::NEG_Z;
        let angle = degrees.to_radians();
        let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
        let exact: f64 = faces.iter().map(|f| f64::from(radiance) * lambert(f, position, normal)).sum();
        // Chords of 5.6 degrees lie up to 1 - cos 2.8 deg, 0.12 %, inside of the sphere: area at most 0.3 % less; at the
        // horizon the profile counts
        assert!((exact / expected - 1.0).abs() < 0.01, "{what}: {exact} {expected}");
        let polygons: Vec<_> = faces.into_iter().map(|f| (f, emitter(radiance))).collect();
        irradiance(&scene(&polygons, &[]), position, normal, 1 << 15, 3).assert_near(exact, ROUNDING, what);
    }
}

/// DIR-006 and FF-024, the disc as a polygon of 256 corners.
#[test]
fn discs() {
    for (radius, position, expected) in
        [(0.5, Vec3::new(0.3, 0.2, 0.0), 0.5330844561202592), (1.0, Vec3::ZERO, 0.5 * std::f64::consts::PI)]
    {
        let polygon: Vec<Vec3> = (0..256)
            .map(|i| {
                let (sin, cos) = (i as f32 * std::f32::consts::TAU / 256.0).sin_cos();
                Vec3::new(radius * cos, -radius * sin, 1.0)
            })
            .collect();
        let exact = lambert(&polygon, position, Vec3::Z);
        // (2 pi / 256)^2 / 6 of the area is missing: 1e-4
        assert!((exact / expected - 1.0).abs() < 2e-4);
        irradiance(&scene(&[(polygon, emitter(1.0))], &[]), position, Vec3::Z, 1 << 15, 4)
            .assert_near(exact, ROUNDING, "disc");
    }
}

/// Random triangles and rectangles around a point, at random distances, some cut by the horizon, some from behind.
#[test]
fn random_shapes() {
    for i in 0..200 {
        let [a, e, f] = [0, 1, 2].map(|k| random_point(10 + k, i));
        let scale = 10_f32.powf(3.0 * random(14, i, 0) - 2.0);
        let (e, f) = (scale * e, scale * f);
        let polygon = if i % 2 == 0 {
            vec![a, a + e, a + f]
        } else {
            let f = f - e * (f.dot(e) / e.length_squared());
            vec![a, a + e, a + e + f, a + f]
        };
        let normal = random_point(15, i).normalize();
        let exact = lambert(&polygon, Vec3::ZERO, normal);
        let mut material = emitter(1.0);
        let estimate = irradiance(&scene(&[(polygon.clone(), material.clone())], &[]), Vec3::ZERO, normal, 4096, i);
        // Corners are rounded by 6e-8 of their size; what they subtend changes by that over the least thickness
        estimate.assert_near(exact, 2e-5, &format!("shape {i}"));
        let other = polygon.iter().rev().copied().collect::<Vec<_>>();
        material.double_sided = true;
        let both = irradiance(&scene(&[(polygon, material)], &[]), Vec3::ZERO, normal, 4096, i);
        both.assert_near(exact + lambert(&other, Vec3::ZERO, normal), 2e-5, &format!("double-sided shape {i}"));
    }
}

fn single(polygon: &[Vec3]) -> AreaLight {
    let scene = scene(&[(polygon.to_vec(), emitter(1.0))], &[]);
    let mut lights = AreaLights::new(&scene).lights;
    assert_eq!(lights.len(), 1);
    lights.remove(0)
}

/// Solid angle of a triangle seen from the origin, by its interior angles (Girard).
fn girard(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(DVec3::normalize);
    let angle = |p: DVec3, q: DVec3, r: DVec3| {
        let (m, n) = (p.cross(q), p.cross(r));
        m.cross(n).length().atan2(m.dot(n))
    };
    angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - std::f64::consts::PI
}

/// Cells of a 4 x 4 grid (or the 16 triangles of one) get samples in proportion to their solid angles.
/// Chi-square with up to 15 degrees of freedom, at 1e-6 for each of 60 shapes.
#[test]
fn uniform_in_solid_angle() {
    let n = 1 << 14;
    for i in 0..60 {
        let rectangle = i % 2 == 1;
        let [a, e, f] = [0, 1, 2].map(|k| random_point(20 + k, i));
        // Some very close to the plane, some thin
        let thin = 10_f32.powi(-((i / 2 % 4) as i32));
        // Rounded corners of thinner rectangles are no right angles to 1e-4
        let mut f = if rectangle { thin.max(1e-2) } else { thin } * f;
        if rectangle {
            f -= e * (f.dot(e) / e.length_squared());
        }
        let normal = e.cross(f).normalize();
        let a = if i % 3 == 0 { a - normal * (a.dot(normal) + 1e-4) } else { a };
        let a = if a.dot(normal) > 0.0 { -a } else { a };
        let polygon = if rectangle { vec![a, a + e, a + e + f, a + f] } else { vec![a, a + e, a + f] };
        let light = single(&polygon);
        assert_eq!(light.is_rectangle(), rectangle);
        let [a, b, c] = [polygon[0], polygon[1], polygon[polygon.len() - 1]].map(Vec3::as_dvec3);
        let (e, f) = (b - a, c - a);
        let corner = |s: u32, t: u32| a + 0.25 * (f64::from(s) * e + f64::from(t) * f);
        let mut expected = [0.0; 32];
        for s in 0..4_u32 {
            for t in 0..4_u32 {
                let cell = 2 * (4 * s + t) as usize;
                let far = [corner(s + 1, t), corner(s + 1, t + 1), corner(s, t + 1)];
                if rectangle || s + t < 4 {
                    expected[cell] = girard([corner(s, t), far[0], far[2]]);
                }
                if rectangle || s + t < 3 {
                    expected[cell + 1] = girard(far);
                }
            }
        }
        let total: f64 = expected.iter().sum();
        // Smaller ones and rectangles far away are sampled by other densities, on purpose
        let view = light.view(Vec3::ZERO, Vec3::ZERO);
        if total < 2e-7 || !matches!(view, None | Some(View::SolidAngle(_))) {
            continue;
        }
        // Corners up to 3 from the origin are rounded, the fourth of a rectangle may leave the plane by twice that
        let height = a.dot(e.cross(f).normalize()).abs();
        let width = e.cross(f).length() / e.length().max(f.length());
        let rounding = 1e-6 + 4.0 * 3.0 * f64::from(f32::EPSILON) * (1.0 / height + 1.0 / width);
        let mut counts = [0_u32; 32];
        for k in 0..n {
            let u = [random(30 + i, k, 0), random(30 + i, k, 1)];
            let seen = view.as_ref().and_then(|view| light.sample(DVec3::ZERO, view, u));
            let Some(Seen { direction, distance, density, .. }) = seen else { panic!("shape {i} does not face") };
            assert!((density * total - 1.0).abs() < rounding, "shape {i}: {density} {total}");
            let offset = direction.as_dvec3() * f64::from(distance) - a;
            // Coordinates along two edges that need not be perpendicular
            let (ee, ff, ef) = (e.dot(e), f.dot(f), e.dot(f));
            let (oe, of) = (offset.dot(e), offset.dot(f));
            let det = ee * ff - ef * ef;
            let at = [4.0 * (oe * ff - of * ef) / det, 4.0 * (of * ee - oe * ef) / det];
            let cell = at.map(|v| v.clamp(0.0, 3.999_999));
            let upper = usize::from(cell[0].fract() + cell[1].fract() > 1.0);
            counts[2 * (4 * cell[0] as usize + cell[1] as usize) + upper] += 1;
        }
        let (mut chi2, mut freedom, mut rest, mut rest_count) = (0.0, -1.0, 0.0, 0.0);
        for (e, &c) in expected.iter().zip(&counts) {
            let e = f64::from(n) * e / total;
            if e >= 10.0 {
                chi2 += (f64::from(c) - e).powi(2) / e;
                freedom += 1.0;
            } else {
                rest += e;
                rest_count += f64::from(c);
            }
        }
        if rest >= 10.0 {
            chi2 += (rest_count - rest).powi(2) / rest;
            freedom += 1.0;
        }
        if freedom >= 1.0 {
            let p = ChiSquared::new(freedom).unwrap().sf(chi2);
            assert!(p > 1e-6, "shape {i}: chi2 {chi2} with {freedom} degrees, p {p}");
        }
    }
}

/// F2: thin lights; needles with an aspect of 1e6, and a strip.
#[test]
fn slivers() {
    let w = 1e-6;
    for (k, polygon) in [
        points([[0.0, 0.0, 1.0], [0.0, w, 1.0], [1.0, w, 1.0], [1.0, 0.0, 1.0]]),
        points([[0.0, 0.0, 1.0], [0.0, w, 1.0], [1.0, 0.0, 1.0]]),
        points([[0.0, 0.0, 1.0], [0.5, w, 1.0], [1.0, 0.0, 1.0]]),
    ]
    .into_iter()
    .enumerate()
    {
        for (position, normal) in [(Vec3::new(0.2, 0.3, 0.0), Vec3::Z), (Vec3::new(0.5, -1.0, 0.9), Vec3::Y)] {
            let exact = 1e6 * lambert(&polygon, position, normal);
            let scene = scene(&[(polygon.clone(), emitter(1e6))], &[]);
            irradiance(&scene, position, normal, 1 << 14, 5).assert_near(exact, 1e-5, &format!("sliver {k}"));
        }
    }
}

/// F5: a point close under a large panel sees pi L.
#[test]
fn almost_touching() {
    let panel = points([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]);
    let triangle = points([[-1.0, -1.0, 0.0], [0.0, 2.0, 0.0], [1.0, -1.0, 0.0]]);
    for polygon in [panel, triangle] {
        for z in [1e-1_f32, 1e-3, 1e-4, 1e-6, 1e-8] {
            let position = Vec3::new(0.1, 0.2, -z);
            let exact = lambert(&polygon, position, Vec3::Z);
            let scene = scene(&[(polygon.clone(), emitter(1.0))], &[]);
            irradiance(&scene, position, Vec3::Z, 1 << 13, 6).assert_near(exact, 1e-6, &format!("{z} below"));
        }
    }
}

/// Points on the light, its plane, edges and corners, behind it and very far away: everything finite, nothing negative.
#[test]
fn degenerate_places() {
    let square = points([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let triangle = points([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]);
    for (polygon, both) in [(&square, false), (&square, true), (&triangle, false), (&triangle, true)] {
        let material = Material { double_sided: both, ..emitter(1.0) };
        let scene = scene(&[(polygon.clone(), material)], &[]);
        let lights = Lights::new(&scene);
        let mut places = polygon.clone();
        for (i, &p) in polygon.iter().enumerate() {
            let next = polygon[(i + 1) % polygon.len()];
            places.extend([0.5 * (p + next), 2.0 * p - next, 1e12 * p, p + 1e-30 * Vec3::Z]);
        }
        places.extend((-40..=20).flat_map(|k| {
            let h = 10_f32.powi(k) * Vec3::Z;
            [h, -h, Vec3::new(0.3, 0.3, 0.0) + h, Vec3::new(0.3, 0.3, 0.0) - h, Vec3::new(3.0, 0.0, 0.0) + h]
        }));
        for place in places {
            for normal in [Vec3::ZERO, Vec3::Z, Vec3::NEG_Z, Vec3::X] {
                for i in 0..64 {
                    let mut u = random3(7, i, 0);
                    // Also the ends of the range
                    u[1] = [u[1], 0.0, 1.0 - f32::EPSILON / 2.0][i as usize % 3];
                    u[2] = [u[2], 0.0, 1.0 - f32::EPSILON / 2.0][i as usize / 3 % 3];
                    let Some(s) = lights.sample(&scene, &Lit { position: place, normal, u }) else { continue };
                    let pdf = s.pdf.unwrap();
                    assert!(pdf > 0.0 && s.weight.is_finite() && s.weight.min_element() >= 0.0, "{place} {s:?}");
                    assert!(s.direction.is_normalized() && s.distance >= 0.0, "{place} {s:?}");
                    let again = lights.pdf(&scene, place, normal, s.direction, s.distance, s.triangle);
                    assert!(again >= 0.0, "{place} {again}");
                }
            }
        }
    }
}

/// Both halves of a quad become one light in whose own order each coordinate grows with its random number, whatever
/// the order of vertices and triangles.
#[test]
fn rectangles_are_joined_and_keep_strata() {
    const ROUNDING: f64 = 1e-6;
    let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 2.0, 0.0), 2.0 * Vec3::Y];
    for turn in 0..4 {
        for [first, second] in [[[0, 1, 2], [0, 2, 3]], [[1, 2, 0], [3, 0, 2]], [[2, 3, 0], [1, 2, 0]]] {
            let mut scene = scene(&[(corners.to_vec(), emitter(1.0))], &[]);
            let turned = |t: [usize; 3]| t.map(|k| ((k + turn) % 4) as u32);
            scene.mesh.triangles = vec![turned(first), turned(second)];
            let lights = AreaLights::new(&scene).lights;
            assert_eq!(lights.len(), 1);
            for i in 0..100 {
                let u = [random(8, i, 0), random(8, i, 1)];
                let from = Vec3::new(0.3, 0.2, 1.0).as_dvec3();
                let view = lights[0].view(from.as_vec3(), Vec3::ZERO).unwrap();
                let point = |u: [f32; 2]| {
                    let Seen { triangle, uv, direction, distance, .. } = lights[0].sample(from, &view, u).unwrap();
                    let [a, b, c] = scene.mesh.corners(triangle).map(Vec3::as_dvec3);
                    let [v, w] = uv.to_array().map(f64::from);
                    let named = (1.0 - v - w) * a + v * b + w * c;
                    // The barycentric weights name the same point, up to the rounding of directions and distances around 1
                    let position = from + direction.as_dvec3() * f64::from(distance);
                    assert!(named.distance(position) < ROUNDING, "{named} {position}");
                    named
                };
                let right = point([0.5 * (u[0] + 1.0), u[1]]);
                let up = point([u[0], 0.5 * (u[1] + 1.0)]);
                // One coordinate does not depend on the second number; the other does not fall
                let (across, along) = (right - point(u), up - point(u));
                let axis = usize::from(along.x.abs() > along.y.abs());
                assert!(along[axis].abs() < ROUNDING && along[1 - axis] != 0.0, "{along}");
                assert!(across[axis] != 0.0);
            }
        }
    }
    // Neither a parallelogram nor a bent or a wrongly wound quad
    for (points, turned) in [
        ([Vec3::ZERO, Vec3::X, Vec3::new(1.5, 1.0, 0.0), Vec3::new(0.5, 1.0, 0.0)], false),
        ([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.1), Vec3::Y], false),
        ([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y], true),
    ] {
        let mut scene = scene(&[(points.to_vec(), emitter(1.0))], &[]);
        if turned {
            scene.mesh.triangles[1].swap(1, 2);
        }
        assert_eq!(AreaLights::new(&scene).lights.len(), 2);
    }
}

/// F6: nothing without area or light becomes a light.
#[test]
fn useless_lights_are_dropped() {
    let flat = points([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    let black = points([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let dark = (LightKind::Point { position: Vec3::ZERO }, Vec3::ZERO);
    let scene = scene(&[(flat, emitter(1.0)), (black, emitter(0.0))], &[dark]);
    let lights = Lights::new(&scene);
    assert!(lights.is_empty());
    assert_eq!(lights.dropped(), 2);
    assert!(lights.sample(&scene, &Lit { position: Vec3::Z, normal: Vec3::ZERO, u: [0.5; 3] }).is_none());
    assert_eq!(lights.pdf(&scene, Vec3::Z, Vec3::ZERO, Vec3::NEG_Z, 1.0, 0), 0.0);
    assert!(lights.sample_emission(&scene, [0.5; 5]).is_none());
    assert_eq!(lights.flux(), [0.0; 3]);
}

/// A light whose texture is bright in one quarter, on top of half a coverage: the same irradiance as that quarter alone at
/// half the radiance, and the same flux.
#[test]
fn textured_light() {
    let corners = points([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let material = Material {
        emission_texture: Some(TextureSlot { texture: 0, uv_set: 0, transform: glam::Affine2::IDENTITY }),
        alpha: Alpha::Blend,
        opacity: 0.5,
        ..emitter(8.0)
    };
    let mut scene = scene(&[(corners.clone(), material)], &[]);
    scene.mesh.uvs[0] = corners.iter().map(|p| p.truncate()).collect();
    let side = 64;
    let texel = |i: usize| if i % side < side / 2 && i / side < side / 2 { [1.0; 4] } else { [0.0, 0.0, 0.0, 1.0] };
    scene.textures = vec![Texture {
        name: String::new(),
        width: side as u32,
        height: side as u32,
        texels: Texels::Float((0..side * side).flat_map(texel).collect()),
        wrap: [Wrap::Clamp; 2],
        smaller: Vec::new(),
    }];
    let quarter: Vec<Vec3> = corners.iter().map(|&p| 0.5 * p).collect();
    let (position, normal) = (Vec3::new(0.3, -0.4, 0.8), Vec3::NEG_Z);
    // Bilinear filtering blurs the edge by one texel of 32, evenly to both sides; the fall of the irradiance over it is
    // second order: (1 / 64)^2
    let exact = 4.0 * lambert(&quarter, position, normal);
    irradiance(&scene, position, normal, 1 << 15, 11).assert_near(exact, 1e-3, "textured");
    let lights = Lights::new(&scene);
    let flux = 4.0 * 0.25 * std::f64::consts::PI;
    assert!((lights.flux()[0] / flux - 1.0).abs() < 1e-3, "{:?} {flux}", lights.flux());
    let shot = Estimate::of((0..1 << 14).map(|i| {
        let u = [0, 1, 2, 3, 4].map(|k| random(12, i, k));
        lights.sample_emission(&scene, u).map_or(0.0, |e| f64::from(e.flux.x))
    }));
    shot.assert_near(flux, 1e-3, "shot");
}

/// Many points at once get what each gets alone, bit for bit.
#[test]
fn samples_do_not_depend_on_company() {
    let square =
        |x: f32, size: f32| points([[x, 0.0, 3.0], [x, size, 3.0], [x + size, size, 3.0], [x + size, 0.0, 3.0]]);
    let triangle = points([[-3.0, 0.0, 2.0], [-3.0, 1.0, 2.0], [-2.0, 0.0, 2.0]]);
    let shapes = [square(0.0, 1.0), square(2.0, 0.5), square(-2.0, 0.001), square(-8.0, 5.0), triangle];
    let polygons: Vec<_> = shapes.into_iter().map(|shape| (shape, emitter(1.0))).collect();
    let lamp = LightKind::Point { position: Vec3::new(1.0, -2.0, 2.0) };
    let scene = scene(&polygons, &[(lamp, Vec3::ONE), (LightKind::Directional { direction: Vec3::NEG_Z }, Vec3::ONE)]);
    let lights = Lights::new(&scene);
    let lit: Vec<Lit> = (0..1001)
        .map(|i| {
            let normal = if i % 7 == 0 { Vec3::ZERO } else { random_point(41, i).normalize() };
            Lit { position: random_point(40, i), normal, u: random3(42, i, 0) }
        })
        .collect();
    let mut together = Vec::new();
    lights.sample_all(&scene, &lit, &mut together);
    let mut kinds = [0; 3];
    for (lit, together) in lit.iter().zip(&together) {
        let alone = lights.sample(&scene, lit);
        assert_eq!(alone, *together, "{lit:?}");
        let kind = together.map_or(0, |sample| if sample.pdf.is_some() { 2 } else { 1 });
        kinds[kind] += 1;
    }
    assert!(kinds.iter().all(|&count| count > 50), "{kinds:?}");
}

/// Points of a tilted light are off its plane by rounding, half of them to the front: none may be lit by the light it lies on.
#[test]
fn tilted_lights_do_not_light_themselves() {
    for both in [false, true] {
        for seed in 0..16 {
            let random = |k: u32| crate::sampling::unit(crate::sampling::hash_all(&[seed, k]));
            let corner = |k: u32| 20.0 * Vec3::new(random(k), random(k + 1), random(k + 2)) - 10.0;
            let polygon = vec![corner(0), corner(3), corner(6)];
            let material = Material { double_sided: both, ..emitter(1.0) };
            let scene = scene(&[(polygon, material)], &[]);
            let lights = Lights::new(&scene);
            for k in 0..256 {
                let hit = crate::backend::Hit {
                    t: 1.0,
                    u: 0.9 * random(2 * k + 9),
                    v: 0.1 * random(2 * k + 10),
                    triangle: 0,
                };
                let point = crate::shading::SurfacePoint::new(&scene, &hit);
                for normal in [point.geometric_normal, -point.geometric_normal] {
                    let sample = lights
                        .sample(&scene, &Lit { position: point.position, normal, u: [0.5, random(k), random(k + 1)] });
                    assert!(sample.is_none(), "{sample:?}");
                }
            }
        }
    }
}
