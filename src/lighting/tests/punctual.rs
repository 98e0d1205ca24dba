//! Light sources without area.

use glam::Vec3;

use super::super::punctual::spot_attenuation;
use super::*;

fn point(position: Vec3, intensity: f32) -> (LightKind, Vec3) {
    (LightKind::Point { position }, Vec3::splat(intensity))
}

/// CIE-002 and CIE-009; one light needs no luck.
#[test]
fn point_lights() {
    let cases: [(f32, f32, [f32; 2], f64); 6] = [
        (3.0, 1000.0, [0.0, 0.0], 111.11111111111111),
        (3.0, 1000.0, [0.5, 0.5], 102.45563439837635),
        (3.0, 1000.0, [1.5, 1.5], 60.481228216868594),
        (2.4, 350.0, [1.2, 0.7], 39.390344253490234),
        (2.4, 350.0, [3.0, 0.0], 14.81322944742876),
        (2.4, 350.0, [5.0, 4.0], 2.627045122338878),
    ];
    for (h, i, [x, y], expected) in cases {
        let scene = scene(&[], &[point(Vec3::new(0.0, 0.0, h), i)]);
        let estimate = irradiance(&scene, Vec3::new(x, y, 0.0), Vec3::Z, 16, 1);
        assert_eq!(estimate.error, 0.0);
        estimate.assert_near(expected, 1e-6, "point light");
    }
}

/// Grids of point lights: right on average, and far less noise than with a uniform choice.
#[test]
fn many_lights() {
    for (k, h, expected, what) in [(64, 3.0, 7.819555539806755, "DIR-011"), (101, 1.5, 17.36286576346579, "DIR-014")] {
        let cell = |i: i32| -2.0 + 4.0 * (i as f32 + 0.5) / k as f32;
        let intensity = 100.0 / (k * k) as f32;
        let grid: Vec<_> = (0..k * k).map(|i| point(Vec3::new(cell(i % k), cell(i / k), h), intensity)).collect();
        let scene = scene(&[], &grid);
        let n = 1 << 16;
        let tree = irradiance(&scene, Vec3::ZERO, Vec3::Z, n, 2);
        // Four standard errors, as the cases ask for: false alarms 6e-5
        assert!((tree.mean - expected).abs() <= 4.0 * tree.error, "{what}: {} +- {}", tree.mean, tree.error);
        let uniform = Estimate::of((0..n).map(|i| {
            let chosen = &grid[(f64::from(random(3, i, 0)) * grid.len() as f64) as usize];
            let LightKind::Point { position } = chosen.0 else { unreachable!() };
            let d2 = f64::from(position.length_squared());
            100.0 * f64::from(position.z) / (d2 * d2.sqrt())
        }));
        uniform.assert_near(expected, 1e-6, what);
        println!("{what}: {} +- {}, uniform choice +- {}", tree.mean, tree.error, uniform.error);
        assert!(tree.error < 0.5 * uniform.error, "{what}: {} {}", tree.error, uniform.error);
        assert!(tree.error < 0.002 * expected);
    }
}

/// DIR-012 and DIR-013.
#[test]
fn directional_lights() {
    for degrees in [89.0_f64, 89.99] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let direction = -Vec3::new(sin as f32, 0.0, cos as f32);
        let scene = scene(&[], &[(LightKind::Directional { direction }, Vec3::ONE)]);
        irradiance(&scene, Vec3::ZERO, Vec3::Z, 16, 4).assert_near(cos, 1e-6, "DIR-012");
    }
    let down = LightKind::Directional { direction: Vec3::NEG_Z };
    let scene = scene(&[], &[(down, Vec3::new(1e6, 0.0, 0.0)), (down, Vec3::new(0.0, 1e-6, 0.0))]);
    let lights = Lights::new(&scene);
    let band = |b: usize| {
        Estimate::of((0..4096).map(|i| {
            let s = lights.sample(&scene, &Lit { position: Vec3::ZERO, normal: Vec3::Z, u: random3(5, i, 0) }).unwrap();
            assert!(s.pdf.is_none() && s.distance == f32::INFINITY);
            f64::from(s.weight[b]) * f64::from(s.direction.z)
        }))
    };
    for (b, expected) in [(0, 1e6), (1, 1e-6), (2, 0.0)] {
        let estimate = band(b);
        estimate.assert_near(expected, 1e-6, "DIR-013");
        // Either light half of the time: relative error 1 / sqrt(n), whatever its strength
        assert!(estimate.error <= 1.1 * expected / 64.0);
    }
}

/// The same for point lights in one place, which the tree chooses from.
#[test]
fn faint_band_is_served() {
    let at = |x: f32| LightKind::Point { position: Vec3::new(x, 0.0, 1.0) };
    let mut all = vec![(at(0.0), Vec3::new(1e6, 0.0, 0.0)), (at(0.0), Vec3::new(0.0, 1e-6, 0.0))];
    all.extend((0..100).map(|i| (at(0.001 * i as f32), Vec3::new(1e4, 0.0, 0.0))));
    let scene = scene(&[], &all);
    let lights = Lights::new(&scene);
    let green = Estimate::of((0..4096).map(|i| {
        let s = lights.sample(&scene, &Lit { position: Vec3::ZERO, normal: Vec3::Z, u: random3(6, i, 0) });
        s.map_or(0.0, |s| f64::from(s.weight.y) * f64::from(s.direction.z))
    }));
    green.assert_near(1e-6, 1e-6, "green");
    assert!(green.error < 0.05e-6);
}

/// Spots follow the recommended attenuation, also the sharpest ones.
#[test]
fn spot_lights() {
    assert_eq!(spot_attenuation(0.9, 0.8, 0.6), 1.0);
    assert_eq!(spot_attenuation(0.5, 0.8, 0.6), 0.0);
    assert!((spot_attenuation(0.7, 0.8, 0.6) - 0.25).abs() < 1e-6);
    let kind = |cos_inner, cos_outer| LightKind::Spot {
        position: Vec3::new(0.0, 0.0, 2.0),
        direction: Vec3::NEG_Z,
        cos_inner,
        cos_outer,
    };
    for (cos_inner, cos_outer) in [(0.95, 0.7), (0.8, 0.8), (1.0, 0.0)] {
        for i in 0..50 {
            let x = 0.1 * i as f32;
            let scene = scene(&[], &[(kind(cos_inner, cos_outer), Vec3::splat(8.0))]);
            let distance = f64::from(x).hypot(2.0);
            let cos = 2.0 / distance;
            let width = f64::from((cos_inner - cos_outer).max(0.001));
            let ramp = ((cos - f64::from(cos_outer)) / width).clamp(0.0, 1.0);
            let expected = 8.0 * ramp * ramp * cos / (distance * distance);
            let estimate = irradiance(&scene, Vec3::new(x, 0.0, 0.0), Vec3::Z, 4, 7);
            // The cosine in f32, divided by the width of the ramp
            let rounding = 8.0 * 4e-7 / width;
            assert!((estimate.mean - expected).abs() <= rounding, "{cos}: {} {expected}", estimate.mean);
        }
    }
}
