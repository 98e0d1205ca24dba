//! The environment, against quadrature and other lights.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::*;
use crate::backend::obvhs::ObvhsBackend;
use crate::backend::{Coherence, Hit, Ray, RayBackend, TriangleSet, Visible};
use crate::scene::{Environment, SunDisk};

/// A scene of two triangles (for its bounds) in an environment.
fn within(environment: Environment) -> Scene {
    let floor = points([[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]]);
    let mut scene = scene(&[(floor, Material::default())], &[]);
    scene.environment = Some(Arc::new(environment));
    scene
}

/// Radiance from 0.01 to 100 without any order, with a black column and a black row.
fn uneven(w: usize, h: usize) -> Environment {
    let texel = |i: usize| {
        let (column, row) = (i % w, i / w);
        let value = |band| 10f32.powf(4.0 * random(90, i as u32, band) - 2.0);
        if column == 2 || row == 1 { Vec3::ZERO } else { Vec3::new(value(0), value(1), value(2)) }
    };
    Environment::new("uneven".to_owned(), [w, h], (0..w * h).map(texel).collect())
}

fn sun(direction: Vec3, radiance: f32) -> SunDisk {
    SunDisk { direction: direction.normalize(), sin_radius: 0.004_65, radiance: Vec3::splat(radiance) }
}

/// Integral over all directions of `value`, W/m^2: the midpoint rule with `n` steps from pole to pole.
fn integral(n: u32, value: impl Fn(Vec3) -> f64) -> f64 {
    let mut sum = 0.0;
    for i in 0..n {
        let theta = PI * (f64::from(i) + 0.5) / f64::from(n);
        for j in 0..2 * n {
            let phi = TAU * (f64::from(j) + 0.5) / f64::from(2 * n);
            let direction = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            sum += value(direction.as_vec3()) * theta.sin();
        }
    }
    sum * (PI / f64::from(n)).powi(2)
}

#[test]
fn irradiance_from_uniform_surroundings_is_pi() {
    let scene = within(Environment::uniform(Vec3::splat(2.0)));
    for i in 0..8 {
        let normal = random_point(91, i).normalize();
        irradiance(&scene, Vec3::ZERO, normal, 1 << 12, 92 + i).assert_near(2.0 * PI, 1e-6, "uniform");
    }
}

#[test]
fn irradiance_from_any_map_and_sun() {
    for (map, with_sun) in [(uneven(7, 5), false), (uneven(16, 8).rotated(1.0), true), (uneven(1, 4), false)] {
        let towards_sun = Vec3::new(0.3, 0.8, -0.4);
        let map = if with_sun { map.with_sun(sun(towards_sun, 1e5)) } else { map };
        let scene = within(map.clone());
        for i in 0..6 {
            let normal = random_point(93, i).normalize();
            let cos = |d: Vec3| f64::from(d.dot(normal)).max(0.0);
            let of_map = integral(800, |d| f64::from(map.map_radiance(d).x) * cos(d));
            let of_sun = map.sun().map_or(0.0, |s| f64::from(s.radiance.x) * s.solid_angle() * cos(s.direction));
            // The quadrature's error is of the order of its step squared; the sun is so small that its cosine hardly varies.
            let what = format!("sun {with_sun}, normal {normal}");
            irradiance(&scene, Vec3::ZERO, normal, 1 << 15, 94 + i).assert_near(of_map + of_sun, 2e-4, &what);
        }
    }
}

/// A bright texel is a small light at infinity: a directional light of the same irradiance lights everything alike.
#[test]
fn one_bright_pixel_is_a_directional_light() {
    let (w, h) = (512, 256);
    let (column, row) = (100, 70);
    let mut texels = vec![Vec3::ZERO; w * h];
    texels[row * w + column] = Vec3::splat(1000.0);
    let map = Environment::new("pixel".to_owned(), [w, h], texels);
    let middle = map.direction((column as f32 + 0.5) / w as f32, (PI * (row as f64 + 0.5) / h as f64).cos() as f32);
    assert_eq!(map.radiance(middle).round(), Vec3::splat(1000.0));
    // Bilinear interpolation makes a pyramid of the pixel, whose volume is its height times a texel.
    let theta = PI * (row as f64 + 0.5) / h as f64;
    let intensity = 1000.0 * (PI / h as f64) * (TAU / w as f64) * theta.sin();
    let light = LightKind::Directional { direction: -middle };
    let directional = scene(&[], &[(light, Vec3::splat(intensity as f32))]);
    let scene = within(map);
    for i in 0..8 {
        let normal = (middle + 0.8 * random_point(95, i)).normalize();
        let exact = irradiance(&directional, Vec3::ZERO, normal, 1, 0).mean;
        // Over the pyramid, two texels wide (0.0245 radians), sine and cosine are linear up to half of its square.
        irradiance(&scene, Vec3::ZERO, normal, 1 << 12, 96 + i).assert_near(exact, 3e-4, &format!("normal {normal}"));
    }
}

#[test]
fn densities_are_those_of_samples_and_add_up() {
    for map in [uneven(9, 6), uneven(9, 6).with_sun(sun(Vec3::new(1.0, 1.0, 0.2), 1e4))] {
        let scene = within(map);
        let lights = Lights::new(&scene);
        for i in 0..6 {
            let normal = if i == 0 { Vec3::ZERO } else { random_point(97, i).normalize() };
            // Outside of the sun, which takes a known share; 180 steps fit cells without a rest.
            let sun = scene.environment.as_ref().unwrap().sun();
            let of_map = integral(180, |d| match sun {
                Some(sun) if sun.holds(d) => 0.0,
                _ => f64::from(lights.pdf_outside(Vec3::ZERO, normal, d)),
            });
            let n = 1 << 14;
            let (mut from_sun, mut missed) = (0, 0);
            for k in 0..n {
                match lights.sample(&scene, &Lit { position: Vec3::ZERO, normal, u: random3(98, k, i) }) {
                    None => missed += 1,
                    Some(s) => {
                        let from_middle =
                            sun.map_or(f32::INFINITY, |sun| sun.direction.cross(s.direction).length() / sun.sin_radius);
                        if (from_middle - 1.0).abs() < 1e-3 {
                            from_sun += 1; // on the disk's edge, where rounding decides
                            continue;
                        }
                        let pdf = lights.pdf_outside(Vec3::ZERO, normal, s.direction);
                        // Next to the edge of a cell rounding may find the other one.
                        assert!(s.pdf.is_some_and(|p| (p - pdf).abs() <= 1e-5 * p), "{:?} {pdf}", s.pdf);
                        from_sun += u32::from(sun.is_some_and(|sun| sun.holds(s.direction)));
                    }
                }
            }
            let sum = of_map + f64::from(from_sun + missed) / f64::from(n);
            // Frequencies are known to half of an inverse square root.
            assert!((sum - 1.0).abs() < SIGMAS * 0.5 / f64::from(n).sqrt() + 1e-3, "{sum}");
        }
    }
}

#[test]
fn all_kinds_of_lights_together() {
    let map = Environment::uniform(Vec3::ONE).with_sun(sun(Vec3::Y, 2e4));
    let lamp = points([[-0.5, 1.0, -0.5], [0.5, 1.0, -0.5], [0.5, 1.0, 0.5], [-0.5, 1.0, 0.5]]);
    let far = (LightKind::Directional { direction: Vec3::new(0.0, -0.6, 0.8) }, Vec3::splat(3.0));
    let mut scene = scene(&[(lamp.clone(), emitter(4.0))], &[far]);
    scene.environment = Some(Arc::new(map.clone()));
    for i in 0..6 {
        let normal = random_point(99, i).normalize();
        let sun = map.sun().unwrap();
        let exact = PI
            + f64::from(sun.radiance.x) * sun.solid_angle() * f64::from(normal.y).max(0.0)
            + 3.0 * f64::from(normal.dot(Vec3::new(0.0, 0.6, -0.8))).max(0.0)
            + 4.0 * lambert(&lamp, Vec3::ZERO, normal);
        if normal.y.abs() < 0.01 {
            continue; // the horizon would cut the sun's disk
        }
        irradiance(&scene, Vec3::ZERO, normal, 1 << 15, 100 + i).assert_near(exact, 1e-4, &format!("normal {normal}"));
    }
}

/// What enters a window from outside is the same whether shot or gathered.
#[test]
fn shot_light_from_outside_arrives_where_gathered() {
    let scene = within(uneven(8, 6).with_sun(sun(Vec3::new(0.2, 1.0, 0.1), 1e5)));
    let lights = Lights::new(&scene);
    let n = 1 << 17;
    let shot = Estimate::of((0..n).map(|i| {
        let u = std::array::from_fn(|k| random(101, i, k as u32));
        let Some(e) = lights.sample_emission(&scene, u) else { return 0.0 };
        assert!(e.triangle == Hit::NONE && e.ray.origin.length() > 1.4, "rays start outside");
        let t = -e.ray.origin.y / e.ray.direction.y;
        let p = e.ray.at(t);
        if t > 0.0 && e.ray.direction.y < 0.0 && p.x.abs().max(p.z.abs()) < 0.5 { f64::from(e.flux.y) } else { 0.0 }
    }));
    let gathered = Estimate::of((0..n).map(|i| {
        let s = lights.sample(&scene, &Lit { position: Vec3::ZERO, normal: Vec3::Y, u: random3(102, i, 0) });
        s.map_or(0.0, |s| f64::from(s.weight.y) * f64::from(s.direction.y))
    }));
    let error = shot.error.hypot(gathered.error);
    assert!((shot.mean - gathered.mean).abs() < SIGMAS * error, "{} {} +- {error}", shot.mean, gathered.mean);
    assert!(error < 0.05 * gathered.mean, "the comparison says something: {error} of {}", gathered.mean);
}

/// A closed room with a small window: knowing where it is changes the noise and not the mean.
#[test]
fn looking_out_finds_the_window() {
    let wall = |corners: [[f32; 3]; 4]| (points(corners), Material::default());
    let (a, b) = (-1.0, 1.0);
    // The wall at z = 1 has a hole of 0.4 x 0.4 in its middle.
    let (c, d) = (-0.2, 0.2);
    let polygons = [
        wall([[a, a, a], [a, a, b], [a, b, b], [a, b, a]]),
        wall([[b, a, a], [b, b, a], [b, b, b], [b, a, b]]),
        wall([[a, a, a], [b, a, a], [b, a, b], [a, a, b]]),
        wall([[a, b, a], [a, b, b], [b, b, b], [b, b, a]]),
        wall([[a, a, a], [a, b, a], [b, b, a], [b, a, a]]),
        wall([[a, a, b], [b, a, b], [b, c, b], [a, c, b]]),
        wall([[a, d, b], [b, d, b], [b, b, b], [a, b, b]]),
        wall([[a, c, b], [c, c, b], [c, d, b], [a, d, b]]),
        wall([[d, c, b], [b, c, b], [b, d, b], [d, d, b]]),
    ];
    let mut room = scene(&polygons, &[]);
    // A map of one texel would be one block.
    let texels = vec![Vec3::ONE; 64 * 32];
    room.environment = Some(Arc::new(Environment::new("white".to_owned(), [64, 32], texels)));
    let set = TriangleSet {
        positions: &room.mesh.positions,
        triangles: &room.mesh.triangles,
        parts: &room.mesh.parts(),
        filter: None,
    };
    let rays = ObvhsBackend.build(&set).unwrap();
    let mut lights = Lights::new(&room);
    let irradiance = |lights: &Lights, position: Vec3, normal: Vec3, seed: u32| {
        Estimate::of((0..1 << 13).map(|i| {
            let Some(s) = lights.sample(&room, &Lit { position, normal, u: random3(seed, i, 0) }) else { return 0.0 };
            let mut blocked = [true];
            let ray = Ray::new(position + 1e-4 * normal, s.direction);
            rays.occluded(&[ray], Visible::All, Coherence::Incoherent, &mut blocked);
            if blocked[0] { 0.0 } else { f64::from(s.weight.x) * f64::from(s.direction.dot(normal)) }
        }))
    };
    let places = [
        (Vec3::new(0.1, -1.0, 0.3), Vec3::Y),
        (Vec3::new(-1.0, 0.2, -0.3), Vec3::X),
        (Vec3::new(0.3, 0.1, -1.0), Vec3::Z),
    ];
    let before = places.map(|(p, n)| irradiance(&lights, p, n, 103));
    lights.look_out(&room, rays.as_ref(), 1);
    let window = points([[c, c, b], [c, d, b], [d, d, b], [d, c, b]]);
    for ((p, n), before) in places.into_iter().zip(before) {
        let exact = lambert(&window, p, n);
        let after = irradiance(&lights, p, n, 104);
        before.assert_near(exact, 1e-4, "without");
        after.assert_near(exact, 1e-4, "with");
        println!("error {:.4} before, {:.4} after, of {exact:.4}", before.error, after.error);
        // Some 300 of the samples meet the window, so errors are known to about 5 %.
        assert!(after.error < 0.85 * before.error, "{} before, {} after", before.error, after.error);
    }
}

#[test]
fn black_surroundings_are_no_light() {
    let scene = within(Environment::uniform(Vec3::ZERO));
    let lights = Lights::new(&scene);
    assert!(lights.is_empty());
    assert_eq!(lights.outside(Vec3::X), Vec3::ZERO);
    assert!(lights.sample(&scene, &Lit { position: Vec3::ZERO, normal: Vec3::Y, u: [0.5; 3] }).is_none());
}
