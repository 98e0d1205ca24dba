//! Rays that leave the lights.

use glam::Vec3;

use super::*;
use crate::backend::Hit;

fn uniform5(seed: u32, i: u32) -> [f32; 5] {
    [0, 1, 2, 3, 4].map(|k| random(seed, i, k))
}

/// The rays of each light carry its flux, in its directions.
#[test]
fn flux_is_that_of_the_light() {
    let pi = std::f64::consts::PI;
    let square = || points([[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let both = Material { double_sided: true, ..emitter(3.0) };
    let position = Vec3::new(1.0, 2.0, 3.0);
    let spot = |cos_inner, cos_outer| LightKind::Spot { position, direction: Vec3::NEG_Y, cos_inner, cos_outer };
    let polygons = [(square(), emitter(3.0)), (square(), both)];
    let cases: Vec<(Scene, f64)> = vec![
        (scene(&polygons[..1], &[]), 6.0 * pi),
        (scene(&polygons[1..], &[]), 12.0 * pi),
        (scene(&[], &[(LightKind::Point { position }, Vec3::splat(5.0))]), 20.0 * pi),
        // 2 pi (1 - cos_inner + (cos_inner - cos_outer) / 3)
        (scene(&[], &[(spot(0.9, 0.6), Vec3::splat(5.0))]), 5.0 * 2.0 * pi * (0.1 + 0.1)),
        (scene(&[], &[(spot(0.9, 0.9), Vec3::splat(5.0))]), 5.0 * 2.0 * pi * (0.1 - 0.001 + 0.001 / 3.0)),
    ];
    for (scene, expected) in &cases {
        let lights = Lights::new(scene);
        // Coordinates and cosines in f32
        assert!((lights.flux()[0] / expected - 1.0).abs() < 3e-6, "{:?} {expected}", lights.flux());
        let estimate = Estimate::of((0..4096).map(|i| {
            let e = lights.sample_emission(scene, uniform5(1, i)).unwrap();
            assert!(e.ray.direction.is_normalized());
            f64::from(e.flux.x)
        }));
        // One light: every ray carries the mean
        assert!(estimate.error < 1e-6 * expected);
        estimate.assert_near(*expected, 3e-6, "flux");
    }
    // Irradiance 2 on a disk around the square
    let down = LightKind::Directional { direction: Vec3::new(0.0, 0.6, -0.8) };
    let scene = scene(&[(square(), emitter(0.0))], &[(down, Vec3::splat(2.0))]);
    let lights = Lights::new(&scene);
    assert!((lights.flux()[0] / (2.0 * pi * 1.25) - 1.0).abs() < 1e-6);
    // The share that meets the square is what the square receives: 2 * area * cos
    let received = Estimate::of((0..1 << 15).map(|i| {
        let e = lights.sample_emission(&scene, uniform5(2, i)).unwrap();
        assert!(
            e.triangle == Hit::NONE && (e.ray.origin - scene.mesh.bounds.centre()).length() > lights.emission.radius
        );
        let hit = e.ray.at(-e.ray.origin.z / e.ray.direction.z);
        let inside = (0.0..2.0).contains(&hit.x) && (0.0..1.0).contains(&hit.y);
        if inside { f64::from(e.flux.x) } else { 0.0 }
    }));
    received.assert_near(2.0 * 2.0 * 0.8, 1e-5, "received");
}

/// Shooting and gathering agree: the flux through a window is the same counted either way.
#[test]
fn shot_light_arrives_where_gathered() {
    let triangle = points([[0.0, 0.0, 2.0], [0.0, 1.0, 2.5], [1.5, 0.0, 3.0]]);
    let square = points([[-2.0, -0.5, 1.0], [-2.0, 0.5, 1.5], [-1.0, 0.5, 1.5], [-1.0, -0.5, 1.0]]);
    let position = Vec3::new(0.5, -1.0, 1.0);
    let direction = Vec3::new(0.0, 0.3, -1.0).normalize();
    let spot = LightKind::Spot { position, direction, cos_inner: 0.95, cos_outer: 0.5 };
    let polygons = [(triangle, emitter(5.0)), (square, Material { double_sided: true, ..emitter(2.0) })];
    let scene = scene(&polygons, &[(spot, Vec3::splat(3.0))]);
    let lights = Lights::new(&scene);
    // Window 0..1 squared at z = 0
    let inside = |p: Vec3| (0.0..1.0).contains(&p.x) && (0.0..1.0).contains(&p.y);
    let n = 1 << 16;
    let shot = Estimate::of((0..n).map(|i| {
        let e = lights.sample_emission(&scene, uniform5(3, i)).unwrap();
        if e.triangle != Hit::NONE {
            let normal = scene.mesh.normal(e.triangle);
            assert_eq!(e.ray.direction.dot(normal) > 0.0, e.front);
            let [a, b, c] = scene.mesh.corners(e.triangle);
            let named = (1.0 - e.uv.x - e.uv.y) * a + e.uv.x * b + e.uv.y * c;
            assert!(named.distance(e.ray.origin) < 1e-6);
        }
        let t = -e.ray.origin.z / e.ray.direction.z;
        if t > 0.0 && inside(e.ray.at(t)) { f64::from(e.flux.x) } else { 0.0 }
    }));
    let gathered = Estimate::of((0..n).map(|i| {
        let at = Vec3::new(random(4, i, 3), random(4, i, 4), 0.0);
        let s = lights.sample(&scene, &Lit { position: at, normal: Vec3::Z, u: random3(4, i, 0) });
        s.map_or(0.0, |s| f64::from(s.weight.x) * f64::from(s.direction.z))
    }));
    let error = shot.error.hypot(gathered.error);
    assert!((shot.mean - gathered.mean).abs() < SIGMAS * error, "{} {} +- {error}", shot.mean, gathered.mean);
}

#[test]
fn lists() {
    let square = points([[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let sun = (LightKind::Directional { direction: Vec3::NEG_Z }, Vec3::ONE);
    let lamp = (LightKind::Point { position: Vec3::Z }, Vec3::ONE);
    let scene = scene(&[(square.clone(), emitter(0.0)), (square, emitter(3.0))], &[sun, lamp]);
    let lights = Lights::new(&scene);
    let listed: Vec<_> = lights.triangles().map(|t| t.triangle).collect();
    assert_eq!(listed, [2, 3]);
    assert_eq!(lights.punctual().count(), 2);
}
