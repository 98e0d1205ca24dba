//! A camera for scenes that bring none.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::{Camera, Mesh, Projection};

/// Directions that are tried to find out whether the scene is a closed room.
const PROBES: u32 = 64;
/// Share of probes that must meet a front face for that.
const CLOSED_SHARE: f64 = 0.9;

/// A camera that sees the scene: from inside where the centre is surrounded by front faces, as in a room; otherwise
/// from outside, with everything in view.
pub(super) fn camera(mesh: &Mesh) -> Camera {
    let bounds = if mesh.bounds.is_empty() { super::Aabb::of([-Vec3::ONE, Vec3::ONE]) } else { mesh.bounds };
    let centre = bounds.centre();
    let probes: Vec<Option<Probe>> = (0..PROBES).into_par_iter().map(|i| probe(mesh, centre, spiral(i))).collect();
    let surrounding = probes.iter().flatten().filter(|p| p.front).count();
    let (position, target, y_fov) = if surrounding as f64 >= CLOSED_SHARE * f64::from(PROBES) {
        // Step back from the centre along the longest free horizontal way, and look across the room.
        let way = |i: u32| {
            let angle = std::f32::consts::TAU * (i as f32 + 0.5) / 16.0;
            let d = Vec3::new(angle.cos(), 0.0, angle.sin());
            (d, probe(mesh, centre, d).map_or(0.0, |p| p.distance))
        };
        let ways: Vec<(Vec3, f32)> = (0..16).into_par_iter().map(way).collect();
        let longest = ways.into_iter().fold((Vec3::X, 0.0), |best, w| if w.1 > best.1 { w } else { best });
        (centre + 0.9 * longest.1 * longest.0, centre, 75_f32.to_radians())
    } else {
        let y_fov = 45_f32.to_radians();
        let radius = (0.5 * bounds.diagonal()).max(f32::MIN_POSITIVE);
        let direction = Vec3::new(0.6, 0.45, 1.0).normalize();
        (centre + direction * (1.05 * radius / (0.5 * y_fov).sin()), centre, y_fov)
    };
    let back = (position - target).try_normalize().unwrap_or(Vec3::Z);
    let right = Vec3::Y.cross(back).normalize();
    Camera {
        name: "overview".into(),
        position,
        axes: Mat3::from_cols(right, back.cross(right), back),
        projection: Projection::Perspective { y_fov },
        aspect: None,
    }
}

/// Nearest triangle along a direction.
struct Probe {
    distance: f32,
    front: bool,
}

/// Evenly spread directions (spherical Fibonacci points).
fn spiral(i: u32) -> Vec3 {
    let golden = 0.5 * (1.0 + 5_f64.sqrt());
    let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(PROBES);
    let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / golden).sin_cos();
    let r = (1.0 - z * z).sqrt();
    glam::DVec3::new(r * cos, r * sin, z).as_vec3()
}

/// Nearest hit by trying every triangle (Möller and Trumbore 1997): this happens 80 times in the life of a scene, and the
/// acceleration structure does not exist yet.
fn probe(mesh: &Mesh, origin: Vec3, direction: Vec3) -> Option<Probe> {
    let mut nearest = None;
    let mut limit = f32::INFINITY;
    for t in 0..mesh.triangles.len() as u32 {
        let [a, b, c] = mesh.corners(t);
        let (e1, e2, s) = (b - a, c - a, origin - a);
        let p = direction.cross(e2);
        let det = e1.dot(p);
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = direction.dot(q) / det;
        let distance = e2.dot(q) / det;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance < limit {
            limit = distance;
            nearest = Some(Probe { distance, front: det > 0.0 });
        }
    }
    nearest
}
