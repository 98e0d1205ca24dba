//! Choosing between lights: probabilities add up, and densities are those of the samples.

use glam::Vec3;

use super::*;

/// A mix of everything: triangles, rectangles, double-sided ones, points, spots, and perhaps a sun.
fn mixed(n: u32, sun: bool) -> Scene {
    let polygons: Vec<_> = (0..n)
        .map(|i| {
            let a = 3.0 * random_point(40, i);
            let (e, f) = (0.5 * random_point(41, i), 0.5 * random_point(42, i));
            let polygon = if i % 2 == 0 {
                vec![a, a + e, a + f]
            } else {
                let f = f - e * (f.dot(e) / e.length_squared());
                vec![a, a + e, a + e + f, a + f]
            };
            let colour = Vec3::from(random3(43, i, 0));
            (polygon, Material { double_sided: i % 3 == 0, ..Material::emitter(colour, Vec3::ZERO) })
        })
        .collect();
    let mut lights: Vec<_> = (0..n)
        .map(|i| {
            let position = 3.0 * random_point(44, i);
            let kind = if i % 2 == 0 {
                LightKind::Point { position }
            } else {
                let direction = random_point(45, i).normalize();
                LightKind::Spot { position, direction, cos_inner: 0.9, cos_outer: 0.5 }
            };
            (kind, 0.1 * Vec3::from(random3(46, i, 0)))
        })
        .collect();
    if sun {
        lights.push((LightKind::Directional { direction: Vec3::NEG_Z }, Vec3::ONE));
        lights.push((LightKind::Directional { direction: Vec3::new(0.6, 0.0, 0.8) }, Vec3::ONE));
    }
    scene(&polygons, &lights)
}

/// What all lights send to a point, from closed forms.
fn exact(scene: &Scene, position: Vec3, normal: Vec3) -> f64 {
    let mut sum = 0.0;
    for triangle in 0..scene.mesh.triangles.len() as u32 {
        let material = &scene.materials[scene.mesh.object(triangle).material as usize];
        let mut corners = scene.mesh.corners(triangle);
        let mut seen = lambert(&corners, position, normal);
        if material.double_sided {
            corners.swap(1, 2);
            seen += lambert(&corners, position, normal);
        }
        sum += f64::from(material.emission.x) * seen;
    }
    for light in &scene.lights {
        sum += match light.kind {
            LightKind::Directional { direction } => f64::from(light.intensity.x * -direction.dot(normal)).max(0.0),
            LightKind::Point { position: at } | LightKind::Spot { position: at, .. } => {
                let offset = at.as_dvec3() - position.as_dvec3();
                let cos = offset.normalize().dot(normal.as_dvec3()).max(0.0);
                let spot = match light.kind {
                    LightKind::Spot { direction, cos_inner, cos_outer, .. } => {
                        let along = -offset.normalize().dot(direction.as_dvec3());
                        let ramp = (along - f64::from(cos_outer)) / f64::from(cos_inner - cos_outer);
                        ramp.clamp(0.0, 1.0).powi(2)
                    }
                    _ => 1.0,
                };
                f64::from(light.intensity.x) * spot * cos / offset.length_squared()
            }
        };
    }
    sum
}

#[test]
fn irradiance_of_many() {
    for (n, sun) in [(1, false), (4, true), (8, false), (60, true), (400, false)] {
        let scene = mixed(n, sun);
        for i in 0..6 {
            let position = 4.0 * random_point(50, i);
            let normal = random_point(51, i).normalize();
            let estimate = irradiance(&scene, position, normal, 1 << 14, 52 + i);
            estimate.assert_near(exact(&scene, position, normal), 1e-5, &format!("{n} lights, receiver {i}"));
        }
    }
}

#[test]
fn probabilities_add_up() {
    for n in [1, 3, 8, 60, 400] {
        let scene = mixed(n, false);
        let lights = Lights::new(&scene);
        for i in 0..40 {
            let position = 4.0 * random_point(60, i);
            let normal = if i % 4 == 0 { Vec3::ZERO } else { random_point(61, i).normalize() };
            let at_root = lights.weigh(&Lit { position, normal, u: [0.0; 3] });
            let probability = |light| lights.tree.probability(&at_root, position, normal, light);
            let sum: f64 = (0..2 * n).map(probability).sum();
            // A group that looks promising as a whole may hold nothing that is: those choices give no sample
            // Sums of eight in f32, in up to four levels of the tree
            assert!(sum <= 1.0 + 4.0 * 8.0 * f64::from(f32::EPSILON), "{sum}");
            let draws = 4096;
            let mut missed = 0;
            for k in 0..draws {
                match lights.tree.sample(&at_root, position, normal, f64::from(random(62, k, i))) {
                    None => missed += 1,
                    Some((light, p)) => {
                        let again = probability(light);
                        assert!((p - again).abs() <= 1e-9 * p, "{p} {again}");
                    }
                }
            }
            let (missing, n) = (1.0 - sum, f64::from(draws));
            let spread = SIGMAS * (missing.max(0.0) * (1.0 - missing) / n).sqrt() + 10.0 / n;
            assert!((f64::from(missed) / n - missing).abs() <= spread, "{missed} of {draws}, {missing}");
        }
    }
}

#[test]
fn density_of_samples() {
    for (n, sun) in [(1, false), (1, true), (6, false), (200, true)] {
        let scene = mixed(n, sun);
        let lights = Lights::new(&scene);
        for i in 0..2000 {
            let position = 4.0 * random_point(70, i);
            let normal = if i % 4 == 0 { Vec3::ZERO } else { random_point(71, i).normalize() };
            let Some(s) = lights.sample(&scene, &Lit { position, normal, u: random3(72, i, 0) }) else { continue };
            let Some(pdf) = s.pdf else { continue };
            let again = lights.pdf(&scene, position, normal, s.direction, s.distance, s.triangle);
            // Chosen by area, the density is 1 / cosine at the light: of a direction rounded to f32
            let cos = f64::from(scene.mesh.normal(s.triangle).dot(s.direction).abs());
            let allowed = f64::from(f32::EPSILON) * (8.0 + 2.0 / cos) * f64::from(pdf);
            assert!(f64::from((pdf - again).abs()) <= allowed, "{pdf} {again}");
        }
    }
}

/// The density integrates over a light to the probability of choosing it.
#[test]
fn density_integrates_to_probability() {
    let scene = mixed(20, true);
    let lights = Lights::new(&scene);
    for i in 0..20 {
        let position = 4.0 * random_point(80, i);
        let at_root = lights.weigh(&Lit { position, normal: Vec3::ZERO, u: [0.0; 3] });
        let to_finite = lights.kinds(&at_root, Vec3::ZERO).unwrap().finite;
        for (l, light) in lights.areas.lights.iter().enumerate() {
            let probability = to_finite * lights.tree.probability(&at_root, position, Vec3::ZERO, l as u32);
            let side = (position.as_dvec3() - light.first_corner()).dot(light.normal());
            if side < 0.0 && !light.both_faces {
                continue;
            }
            let estimate = Estimate::of((0..4096).map(|k| {
                let point = light.uniform_point([random(81, k, 0), random(81, k, 1)]);
                let offset = point.position - position.as_dvec3();
                let (d, direction) = (offset.length(), offset.normalize());
                let pdf = lights.pdf(&scene, position, Vec3::ZERO, direction.as_vec3(), d as f32, point.triangle);
                f64::from(pdf) * direction.dot(light.normal()).abs() / (d * d) * light.area()
            }));
            estimate.assert_near(probability, 1e-4, &format!("receiver {i}, light {l}"));
        }
    }
}

/// Lights in one place, in a row, and far apart still make a tree.
#[test]
fn degenerate_trees() {
    let at = |place: fn(u32) -> Vec3| -> Scene {
        let lights: Vec<_> = (0..500).map(|i| (LightKind::Point { position: place(i) }, Vec3::ONE)).collect();
        scene(&[], &lights)
    };
    for scene in [at(|_| Vec3::Z), at(|i| i as f32 * Vec3::Z), at(|i| 1.05_f32.powi(i as i32) * Vec3::Z)] {
        let position = Vec3::new(0.5, 0.0, -1.0);
        let estimate = irradiance(&scene, position, Vec3::Z, 1 << 14, 9);
        estimate.assert_near(exact(&scene, position, Vec3::Z), 1e-5, "tree");
    }
}
