//! Energy, reciprocity and sampling of the scattering function.
//!
//! Statistical tests have fixed seeds. `Z` makes a false alarm of one comparison 4e-9 (normal distribution); there are
//! less than 10^4 comparisons in a test, so that it fails without a reason with probability below 4e-5.

use glam::{Vec2, Vec3};

use super::testing::scene_of;
use super::{Bsdf, Lobes, SurfacePoint, albedo};
use crate::backend::{Hit, PartKind};
use crate::sampling::{hash_all, sobol, uniform_sphere, unit};
use crate::scene::{Material, Scene};

const Z: f64 = 5.9;
/// Rounding of sums of products that are themselves at most about one.
const ROUNDING: f32 = 32.0 * f32::EPSILON;
const COSINES: [f32; 5] = [1.0, 0.8, 0.5, 0.2, 0.05];
const HIT: Hit = Hit { t: 1.0, u: 0.25, v: 0.25, triangle: 0 };

/// A triangle facing +z.
fn scene(material: Material) -> Scene {
    scene_of([Vec3::ZERO, Vec3::X, Vec3::Y], material)
}

fn towards(cosine: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).sqrt();
    Vec3::new(0.6 * sine, -0.8 * sine, cosine)
}

fn bsdf(scene: &Scene, outgoing: Vec3, threshold: f32) -> Bsdf {
    Bsdf::new(scene, &SurfacePoint::new(scene, &HIT), outgoing, Lobes { threshold, ..Lobes::MIRRORS })
}

fn metal(base_color: Vec3, roughness: f32) -> Material {
    Material { base_color, roughness, ..Material::default() }
}

fn dielectric(base_color: Vec3, roughness: f32, ior: f32) -> Material {
    Material { metallic: 0.0, ior, ..metal(base_color, roughness) }
}

fn glass(roughness: f32, ior: f32, refracts: bool) -> Material {
    Material { transmission: 1.0, refracts, ..dielectric(Vec3::ONE, roughness, ior) }
}

fn mixtures(base_color: Vec3, roughness: f32) -> [Material; 6] {
    let coat = dielectric(base_color, roughness, 1.5);
    [
        metal(base_color, roughness),
        Material { metallic: 0.4, ..coat.clone() },
        Material { specular: 0.5, specular_color: Vec3::new(1.0, 0.6, 0.3), ..coat.clone() },
        Material { ior: 2.4, ..coat.clone() },
        Material { ior: 1.0, ..coat.clone() },
        coat,
    ]
}

/// Sums of an estimator, for the z-test.
#[derive(Clone, Copy, Default)]
struct Estimate {
    sum: f64,
    squares: f64,
    count: f64,
}

impl Estimate {
    fn add(&mut self, x: f32) {
        let x = f64::from(x);
        self.sum += x;
        self.squares += x * x;
        self.count += 1.0;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count
    }

    /// Squared standard error.
    fn variance(&self) -> f64 {
        (self.squares / self.count - self.mean().powi(2)).max(0.0) / self.count
    }
}

fn random(seed: u32, index: u32) -> [f32; 3] {
    std::array::from_fn(|axis| unit(hash_all(&[seed, index, axis as u32])))
}

#[test]
fn lambertian_is_exact() {
    let reflectance = Vec3::new(0.2, 0.5, 0.9);
    let scene = scene(Material { double_sided: true, ..Material::lambertian(reflectance) });
    for side in [1.0, -1.0] {
        let b = bsdf(&scene, side * towards(0.3), 0.25);
        assert_eq!(b.lambertian(), Some(reflectance));
        assert_eq!((b.albedo_low(), b.albedo_high()), (reflectance, Vec3::ZERO));
        assert_eq!(b.eval_high(side * towards(0.9)), (Vec3::ZERO, 0.0));
        assert!(b.sample_high([0.5; 3]).is_none());
        let value = b.eval_low(side * towards(0.7));
        assert!((value - reflectance * 0.7 / std::f32::consts::PI).abs().max_element() < ROUNDING);
        assert_eq!(b.eval_low(-side * towards(0.7)), Vec3::ZERO);
        for i in 0..100 {
            let sample = b.sample_low(random(1, i)).expect("a cosine lobe about the geometric normal stays above");
            assert_eq!(sample.weight, reflectance);
            assert!(side * sample.direction.z > 0.0);
        }
    }
    // The same surface through the general path: no coat takes nothing.
    let general = Material { metallic: 1e-30, ..Material::lambertian(reflectance) };
    let scene = self::scene(general);
    let b = bsdf(&scene, towards(0.3), 0.25);
    assert!(b.lambertian().is_none());
    assert!((b.eval_low(towards(0.7)) - reflectance * 0.7 / std::f32::consts::PI).abs().max_element() < ROUNDING);
}

#[test]
fn emission_leaves_the_front_face() {
    let radiance = Vec3::new(1.0, 2.0, 3.0);
    let mut scene = scene(Material::emitter(radiance, Vec3::ZERO));
    assert_eq!(bsdf(&scene, Vec3::Z, 0.25).emission(), radiance);
    assert_eq!(bsdf(&scene, Vec3::NEG_Z, 0.25).emission(), Vec3::ZERO);
    scene.materials[0].double_sided = true;
    assert_eq!(bsdf(&scene, Vec3::NEG_Z, 0.25).emission(), radiance);
}

/// White surfaces without loss reflect everything, for every roughness and angle, by construction of the albedo.
#[test]
fn white_furnace_by_albedo() {
    for step in 0..=20 {
        let roughness = step as f32 / 20.0;
        for material in mixtures(Vec3::ONE, roughness) {
            let scene = scene(material.clone());
            for cosine in COSINES {
                for threshold in [0.0, 2.0] {
                    let b = bsdf(&scene, towards(cosine), threshold);
                    let albedo = b.albedo_low() + b.albedo_high();
                    let off = (albedo - Vec3::ONE).abs().max_element();
                    assert!(off < ROUNDING, "{albedo} at {cosine}, {material:?}");
                }
            }
        }
    }
}

/// The mean albedo is the cosine-weighted average of the albedo, to the error of a midpoint rule over the same table that is linear between its
/// cosines.
#[test]
fn mean_albedo_is_the_average_over_directions() {
    const POINTS: u32 = 1024;
    let material = mixtures(Vec3::new(0.9, 0.5, 0.1), 0.0).into_iter();
    for (material, roughness) in
        material.flat_map(|m| [0.0, 0.1, 0.3, 0.7, 1.0].map(|roughness| (m.clone(), roughness)))
    {
        let scene = scene(Material { roughness, ..material.clone() });
        for threshold in [0.0, 2.0] {
            let at = |i: u32| ((i as f32 + 0.5) / POINTS as f32).sqrt();
            let sum: Vec3 = (0..POINTS).map(|i| bsdf(&scene, towards(at(i)), threshold).albedo_low()).sum();
            let (mean, of_bsdf) = (sum / POINTS as f32, bsdf(&scene, Vec3::Z, threshold).mean_albedo_low());
            let off = (mean - of_bsdf).abs().max_element();
            assert!(off < 1e-3, "{mean} is not {of_bsdf}, roughness {roughness}, {material:?}");
        }
    }
}

/// The same, and coloured surfaces, by following samples: their mean weight is the albedo, up to the error of its
/// table. The specification's own mix reaches 1.43 (SPEC-009 of the reference cases).
#[test]
fn white_furnace_by_sampling() {
    const SAMPLES: u32 = 1 << 14;
    let mut seed = 0;
    for roughness in [0.0, 0.02, 0.1, 0.2, 0.5, 0.8, 1.0] {
        for material in mixtures(Vec3::ONE, roughness).into_iter().chain(mixtures(Vec3::new(0.9, 0.5, 0.1), roughness))
        {
            let scene = scene(material.clone());
            for cosine in COSINES {
                seed += 1;
                for threshold in [0.0, 2.0] {
                    let b = bsdf(&scene, towards(cosine), threshold);
                    compare_albedo(b.albedo_low(), |u| b.sample_low(u).map(|s| s.weight), SAMPLES, seed, &material);
                    compare_albedo(b.albedo_high(), |u| b.sample_high(u).map(|s| s.weight), SAMPLES, seed, &material);
                }
            }
        }
    }
}

fn compare_albedo(
    expected: Vec3,
    sample: impl Fn([f32; 3]) -> Option<Vec3>,
    samples: u32,
    seed: u32,
    material: &Material,
) {
    let mut estimates = [Estimate::default(); 3];
    for i in 0..samples {
        let weight = sample(random(seed, i)).unwrap_or(Vec3::ZERO);
        for (estimate, w) in estimates.iter_mut().zip(weight.to_array()) {
            estimate.add(w);
        }
    }
    // A band's specular albedo is a mixture of both tabulated parts.
    let table = f64::from(albedo::TOTAL_ERROR + albedo::SPLIT_ERROR);
    for (estimate, expected) in estimates.iter().zip(expected.to_array()) {
        let off = (estimate.mean() - f64::from(expected)).abs();
        let bound = table + Z * estimate.variance().sqrt();
        assert!(off < bound, "{} instead of {expected}, {material:?}", estimate.mean());
    }
}

/// Light that a lobe sends into several broad functions of direction: by following its samples, and by evaluating it
/// in uniform directions. Equal only if `weight` is `f cos / pdf` and `pdf` the density of the samples.
#[test]
fn samples_agree_with_evaluation() {
    const SAMPLES: u32 = 1 << 14;
    let probes = |d: Vec3| [1.0, d.x, d.y, d.z, d.x * d.z, d.y * d.y];
    let mut seed = 1000;
    for roughness in [0.35, 0.6, 1.0] {
        let base = Vec3::new(0.9, 0.5, 0.1);
        let transmitting = [(1.5, true), (1.5, false), (1.1, true)].map(|(ior, refracts)| Material {
            base_color: base,
            transmission: 0.7,
            ..glass(roughness, ior, refracts)
        });
        for material in mixtures(base, roughness).into_iter().chain(transmitting) {
            let scene = scene(material.clone());
            for cosine in [1.0, 0.5, 0.2, -0.7] {
                for threshold in [0.0, 2.0] {
                    seed += 1;
                    let b = bsdf(&scene, towards(cosine), threshold);
                    let mut sums = [[[Estimate::default(); 6]; 2]; 2];
                    for i in 0..SAMPLES {
                        let u = random(seed, i);
                        let uniform = uniform_sphere(Vec2::new(u[0], u[1]));
                        let low = b.sample_low(u);
                        let high = b.sample_high(u);
                        let pairs = [(low, b.eval_low(uniform)), (high, b.eval_high(uniform).0)];
                        for ((sampled, evaluated), (sample, value)) in sums.iter_mut().map(|[s, e]| (s, e)).zip(pairs) {
                            let (direction, weight) = sample.map_or((Vec3::Z, 0.0), |s| (s.direction, s.weight.y));
                            let uniform_weight = value.y * 4.0 * std::f32::consts::PI;
                            for k in 0..6 {
                                sampled[k].add(weight * probes(direction)[k]);
                                evaluated[k].add(uniform_weight * probes(uniform)[k]);
                            }
                        }
                        if let Some(sample) = high {
                            let (value, pdf) = b.eval_high(sample.direction);
                            let expected = sample.pdf.expect("rough");
                            // The half vector is recovered from rounded directions.
                            assert!((pdf - expected).abs() <= 1e-3 * expected, "{pdf} {expected} {material:?}");
                            let off = (value - sample.weight * expected).abs().max_element();
                            assert!(off <= 1e-3 * value.max_element(), "{value} {sample:?}");
                        }
                        if let Some(sample) = low {
                            let value = b.eval_low(sample.direction);
                            let off = (value - sample.weight * sample.pdf.expect("rough")).abs().max_element();
                            assert!(off <= 1e-3 * value.max_element(), "{value} {sample:?} {material:?}");
                        }
                    }
                    for (lobe, [sampled, evaluated]) in sums.iter().enumerate() {
                        for (k, (s, e)) in sampled.iter().zip(evaluated).enumerate() {
                            let off = (s.mean() - e.mean()).abs();
                            let bound = Z * (s.variance() + e.variance()).sqrt() + 1e-6;
                            let means = (s.mean(), e.mean());
                            assert!(off < bound, "lobe {lobe}, probe {k}, {means:?}, {cosine}, {material:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn reflection_is_reciprocal() {
    for roughness in [0.1, 0.3, 0.7, 1.0] {
        for material in mixtures(Vec3::new(0.9, 0.5, 0.1), roughness) {
            let scene = scene(material.clone());
            for i in 0..200 {
                let [a, b, c, d] = sobol(i, 0, 7);
                let [p, q] = [Vec2::new(a, b), Vec2::new(c, d)].map(|u| {
                    let w = uniform_sphere(u);
                    Vec3::new(w.x, w.y, w.z.abs())
                });
                if p.z.min(q.z) < 0.01 {
                    continue;
                }
                for threshold in [0.0, 2.0] {
                    let f = |from: Vec3, to: Vec3| {
                        let b = bsdf(&scene, to, threshold);
                        (b.eval_low(from) + b.eval_high(from).0) / from.z
                    };
                    let (there, back) = (f(p, q), f(q, p));
                    // Relative rounding of the tail of D, at a half vector of rounded length.
                    let bound = 1e-4 * there.max(back) + ROUNDING;
                    assert!((there - back).abs().cmple(bound).all(), "{there} {back} {p} {q} {material:?}");
                }
            }
        }
    }
}

#[test]
fn white_mirror_reflects_everything_in_one_direction() {
    let scene = scene(metal(Vec3::ONE, 0.0));
    for cosine in COSINES {
        let b = bsdf(&scene, towards(cosine), 0.25);
        assert!((b.albedo_high() - Vec3::ONE).abs().max_element() < ROUNDING);
        assert_eq!(b.albedo_low(), Vec3::ZERO);
        let sample = b.sample_high([0.3, 0.1, 0.9]).expect("a mirror");
        let mirrored = towards(cosine) * Vec3::new(-1.0, -1.0, 1.0);
        assert!((sample.direction - mirrored).length() < ROUNDING);
        assert!((sample.weight - Vec3::ONE).abs().max_element() < ROUNDING);
        assert!(sample.pdf.is_none() && !sample.transmitted && !sample.straight);
    }
}

/// Reflected and transmitted power of clear glass, and the radiance it passes on.
#[test]
fn clear_glass_conserves_energy() {
    for ior in [1.0, 1.1, 1.333, 1.5, 2.4] {
        for (refracts, kind) in [(true, PartKind::Opaque), (true, PartKind::Pane), (false, PartKind::Pane)] {
            let mut scene = scene(glass(0.0, ior, refracts));
            scene.mesh.objects[0].kind = kind;
            for cosine in COSINES.into_iter().flat_map(|c| [c, -c]) {
                let outgoing = towards(cosine);
                let b = bsdf(&scene, outgoing, 0.25);
                assert!((b.albedo_high() - Vec3::ONE).abs().max_element() < ROUNDING, "{ior} {kind:?} {cosine}");
                assert!(b.albedo_low().max_element() <= ROUNDING);
                let bends = refracts && kind == PartKind::Opaque && ior > 1.0;
                assert_eq!(b.straight_transmittance() == Vec3::ZERO, kind != PartKind::Pane);
                let eta = if cosine > 0.0 { ior } else { 1.0 / ior };
                for i in 0..50 {
                    let Some(sample) = b.sample_high(random(3, i)) else { panic!("glass loses nothing") };
                    let scale = if bends && sample.transmitted { 1.0 / (eta * eta) } else { 1.0 };
                    assert!((sample.weight / scale - Vec3::ONE).abs().max_element() < ROUNDING);
                    assert!(sample.pdf.is_none());
                    assert_eq!(sample.straight, sample.transmitted && kind == PartKind::Pane);
                    if sample.straight {
                        assert_eq!(sample.direction, -outgoing);
                    } else if sample.transmitted {
                        // Snell's law, as equality of tangential components.
                        let off = sample.direction.truncate() * eta + outgoing.truncate();
                        assert!(!bends || off.length() < ROUNDING * eta.max(1.0), "{off}");
                        assert!(sample.direction.z * cosine < 0.0);
                    }
                }
            }
        }
    }
}

/// SPEC-002: from inside beyond the critical angle everything is reflected, at the usual weight.
#[test]
fn total_internal_reflection() {
    let scene = scene(Material { specular: 0.3, ..glass(0.0, 1.5, true) });
    let critical = (1.0_f32 / 1.5).asin();
    let beyond = bsdf(&scene, -towards((critical + 0.001).cos()), 0.25);
    for i in 0..50 {
        let sample = beyond.sample_high(random(4, i)).expect("total reflection");
        assert!(!sample.transmitted && sample.direction.z < 0.0);
        assert!((sample.weight - Vec3::ONE).abs().max_element() < ROUNDING);
    }
    let before = bsdf(&scene, -towards((critical - 0.001).cos()), 0.25);
    assert!((0..200).any(|i| before.sample_high(random(4, i)).is_some_and(|s| s.transmitted)));
}

/// SPEC-003: a clear slab of index 1.5, as one sheet (polarised reference) and as two faces (`T_single_pass`).
#[test]
fn slab_transmits_as_referenced() {
    let degrees = [0.0, 30.0, 45.0, 60.0, 75.0, 85.0_f32];
    let sheet = [0.923_077, 0.920_734, 0.907_344, 0.848_128, 0.618_149, 0.246_931];
    let single_pass = [0.9216, 0.918_679, 0.902_044, 0.829_581, 0.557_919, 0.149_924];
    for (refracts, expected) in [(false, sheet), (true, single_pass)] {
        let mut scene = scene(glass(0.0, 1.5, refracts));
        scene.mesh.objects[0].kind = PartKind::Pane;
        for (degrees, expected) in degrees.iter().zip(expected) {
            let outgoing = towards(degrees.to_radians().cos());
            let mut transmittance = bsdf(&scene, outgoing, 0.25).straight_transmittance().x;
            if refracts {
                transmittance *= bsdf(&scene, -outgoing, 0.25).straight_transmittance().x;
            }
            // The tolerance of the reference case.
            assert!((transmittance / expected - 1.0).abs() < 1e-3, "{degrees}: {transmittance}, expected {expected}");
        }
    }
}

/// White furnace: rough glass passes on what comes in, and as much as it says.
#[test]
fn rough_glass_albedo_matches_its_samples() {
    let mut seed = 2000;
    for roughness in [0.05, 0.2, 0.5, 1.0] {
        for (ior, refracts) in [(1.5, true), (1.1, true), (2.4, true), (1.5, false)] {
            let material = glass(roughness, ior, refracts);
            let scene = scene(material.clone());
            for cosine in [1.0, 0.5, 0.2, -0.5, -0.9_f32] {
                seed += 1;
                let b = bsdf(&scene, towards(cosine), 0.25);
                assert!(b.albedo_high().max_element() <= 1.0 + ROUNDING);
                let eta = if cosine > 0.0 { ior } else { 1.0 / ior };
                let power = |u| {
                    let sample = b.sample_high(u)?;
                    Some(if refracts && sample.transmitted { sample.weight * eta * eta } else { sample.weight })
                };
                compare_albedo(b.albedo_high(), power, 1 << 14, seed, &material);
                compare_albedo(Vec3::ONE, power, 1 << 14, seed, &material);
            }
        }
    }
}

/// With a shading normal far from the geometric one, nothing comes through the surface from behind.
#[test]
fn light_stays_on_its_side_of_the_geometry() {
    for material in mixtures(Vec3::ONE, 0.4).into_iter().chain([Material::lambertian(Vec3::ONE), glass(0.4, 1.5, true)])
    {
        let mut scene = scene(material);
        scene.mesh.normals = vec![Vec3::new(0.8, 0.0, 0.6); 3];
        scene.mesh.measure();
        for (i, outgoing) in
            [towards(0.3), Vec3::new(-0.9, 0.1, 0.4).normalize(), -towards(0.5)].into_iter().enumerate()
        {
            let b = bsdf(&scene, outgoing, 0.25);
            for k in 0..500 {
                let u = random(5 + i as u32, k);
                let incoming = uniform_sphere(Vec2::new(u[0], u[1]));
                if incoming.z * outgoing.z <= 0.0 {
                    assert_eq!(b.eval_low(incoming), Vec3::ZERO);
                }
                assert!(b.eval_low(incoming).is_finite() && b.eval_high(incoming).0.is_finite());
                if let Some(sample) = b.sample_low(u) {
                    assert!(sample.direction.z * outgoing.z > 0.0 && sample.weight.is_finite());
                }
                if let Some(sample) = b.sample_high(u) {
                    assert_eq!(sample.direction.z * outgoing.z < 0.0, sample.transmitted);
                    assert!(sample.weight.is_finite());
                }
            }
        }
    }
}
