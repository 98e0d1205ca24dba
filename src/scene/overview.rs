//! A camera for scenes that bring none.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::{Camera, Mesh, Projection};

/// Directions that are tried to find out whether the scene is a closed room.
const PROBES: u32 = 64;
/// Directions that are tried at once.
const GROUP: u32 = 8;
/// Share of probes that must meet a front face for that.
const CLOSED_SHARE: f64 = 0.9;

/// A camera that sees the scene: from inside where the centre is surrounded by front faces, as in a room; otherwise
/// from outside, with everything in view.
pub(super) fn camera(mesh: &Mesh) -> Camera {
    let bounds = if mesh.bounds.is_empty() { super::Aabb::of([-Vec3::ONE, Vec3::ONE]) } else { mesh.bounds };
    let centre = bounds.centre();
    let (position, target, y_fov) = if is_room(mesh, centre) {
        // Step back from the centre along the longest free horizontal way, and look across the room.
        let ways: Vec<Vec3> = (0..16)
            .map(|i| {
                let (sin, cos) = (std::f32::consts::TAU * (i as f32 + 0.5) / 16.0).sin_cos();
                Vec3::new(cos, 0.0, sin)
            })
            .collect();
        let free = probe(mesh, centre, &ways).into_iter().map(|p| p.map_or(0.0, |p| p.distance));
        let ways = ways.iter().copied().zip(free);
        let longest = ways.fold((Vec3::X, 0.0), |best, w| if w.1 > best.1 { w } else { best });
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

/// Whether nearly all directions from `centre` meet a front face first.
fn is_room(mesh: &Mesh, centre: Vec3) -> bool {
    let mut open = 0;
    // Most scenes that are no rooms show it in the first few directions.
    for group in 0..PROBES / GROUP {
        let directions: Vec<Vec3> = (0..GROUP).map(|i| spiral(group + i * (PROBES / GROUP))).collect();
        open += probe(mesh, centre, &directions).iter().filter(|p| !p.is_some_and(|p| p.front)).count();
        if open as f64 > (1.0 - CLOSED_SHARE) * f64::from(PROBES) {
            return false;
        }
    }
    true
}

/// Nearest triangle along a direction.
#[derive(Clone, Copy)]
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

/// Nearest hits by trying every triangle (Möller and Trumbore 1997): this happens a few dozen times in the life of a
/// scene, and the acceleration structure does not exist yet.
fn probe(mesh: &Mesh, origin: Vec3, directions: &[Vec3]) -> Vec<Option<Probe>> {
    let nearer = |a: Option<Probe>, b: Option<Probe>| match (a, b) {
        (Some(x), Some(y)) if y.distance < x.distance => b,
        (None, _) => b,
        _ => a,
    };
    let chunk = |triangles: &[[u32; 3]]| {
        let mut nearest = vec![None; directions.len()];
        for t in triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let (e1, e2, s) = (b - a, c - a, origin - a);
            let q = s.cross(e1);
            for (nearest, &direction) in nearest.iter_mut().zip(directions) {
                let p = direction.cross(e2);
                let det = e1.dot(p);
                let (u, v, distance) = (s.dot(p) / det, direction.dot(q) / det, e2.dot(q) / det);
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 {
                    *nearest = nearer(*nearest, Some(Probe { distance, front: det > 0.0 }));
                }
            }
        }
        nearest
    };
    // Chunks of fixed size, combined in order.
    let chunks: Vec<Vec<Option<Probe>>> = mesh.triangles.par_chunks(1 << 16).map(chunk).collect();
    let none = vec![None; directions.len()];
    chunks.into_iter().fold(none, |all, c| all.into_iter().zip(c).map(|(a, b)| nearer(a, b)).collect())
}
