//! Every lobe of the materials, in whole images.
//!
//! Statistical tests use fixed seeds; the stated false-alarm rate is the chance with which another seed would fail although nothing
//! is wrong.

#[allow(dead_code, reason = "its main is not needed")]
#[path = "../../examples/materials.rs"]
mod example;

use std::sync::Arc;

use crate::common::{self, Estimate, fixed, prepare, render, threshold};
use glam::Vec3;
use gsii::pipeline::{Method, Settings};
use gsii::render::bias;
use gsii::scene::{Environment, Material, Scene};

const ALPHA: f64 = 1e-4;
/// Three pixels for each ball of the picture and its surroundings.
const SIZE: [u32; 2] = [72, 30];

fn scene(change: impl Fn(&mut Material)) -> Arc<Scene> {
    let mut scene = common::scene(&example::gltf());
    let made = Arc::make_mut(&mut scene);
    made.materials.iter_mut().for_each(change);
    made.environment = Some(Arc::new(Environment::uniform(Vec3::ONE)));
    scene
}

fn settings(method: Method) -> Settings {
    Settings { method, ..Settings::default() }
}

/// Where the same light comes from everywhere, what loses none of it cannot be seen: metal and lacquer of any roughness, glass of any
/// roughness, solid or thin, a normal map or not.
#[test]
fn white_materials_vanish_in_uniform_surroundings() {
    let glass = |material: &mut Material, roughness: f32, refracts: bool| {
        (material.metallic, material.transmission) = (0.0, 1.0);
        (material.roughness, material.refracts) = (roughness, refracts);
    };
    type Change<'a> = &'a dyn Fn(&mut Material);
    let lobes: [(&str, Change<'_>); 9] = [
        ("matt", &|m| (m.metallic, m.specular) = (0.0, 0.0)),
        ("mirror", &|m| (m.metallic, m.roughness) = (1.0, 0.0)),
        ("metal of roughness 0.5", &|m| (m.metallic, m.roughness) = (1.0, 0.5)),
        ("metal of roughness 1", &|m| (m.metallic, m.roughness) = (1.0, 1.0)),
        ("lacquer of roughness 0.2", &|m| (m.metallic, m.roughness) = (0.0, 0.2)),
        ("clear glass", &|m| glass(m, 0.0, true)),
        ("glass of roughness 0.4", &|m| glass(m, 0.4, true)),
        ("glass of roughness 1", &|m| glass(m, 1.0, true)),
        ("thin glass of roughness 0.6", &|m| glass(m, 0.6, false)),
    ];
    for (name, change) in lobes {
        let scene = scene(|material| {
            (material.base_color, material.base_color_texture, material.normal_texture) = (Vec3::ONE, None, None);
            (material.transmission, material.attenuation_distance) = (0.0, f32::INFINITY);
            if material.name == "floor" {
                (material.base_color, material.specular) = (Vec3::ONE, 0.0);
            } else {
                change(material);
            }
        });
        // GSII shades with the same code; `all_materials_agree_with_path_tracing` compares the two.
        let prepared = prepare(&scene, settings(Method::Mcpt)).0;
        let got = Estimate::whole(&render(&prepared, &fixed(SIZE[0], SIZE[1], 32, 3)).film);
        // Tabulated albedos are within 2 % of the integral, and the balls fill less than a third of the picture, where light
        // meets up to a few boundaries; much less on average.
        let table = 0.005;
        let bound = table + threshold(ALPHA, lobes.len()) * got.error;
        println!("{name}: {got:?}, bound {bound}");
        assert!((got.mean - 1.0).abs() < bound, "{name}: {}", got.mean);
        assert!(bound < 0.03, "the test says something: {bound}");
    }
}

/// Light along one diameter of a ball of glass: what the ball's inside leaves is the attenuation colour to the power of the distance.
/// All methods follow what the camera sees through glass with the same code.
#[test]
fn glass_absorbs_along_the_way() {
    const TRIALS: u32 = 256;
    let (color, distance) = (Vec3::new(0.1, 0.5, 0.9), 0.7_f32);
    let scene = |absorbs: bool| {
        scene(|material| {
            (material.metallic, material.transmission, material.roughness) = (0.0, 1.0, 0.0);
            (material.base_color, material.normal_texture, material.base_color_texture) = (Vec3::ONE, None, None);
            // An index that reflects nothing and does not bend.
            (material.ior, material.specular, material.refracts) = (1.0, 0.0, true);
            material.attenuation_color = color;
            material.attenuation_distance = if absorbs { distance } else { f32::INFINITY };
        })
    };
    let film =
        |absorbs| render(&prepare(&scene(absorbs), settings(Method::Mcpt)).0, &fixed(SIZE[0], SIZE[1], TRIALS, 0)).film;
    let [clear, tinted] = [false, true].map(film);
    // This pixel looks at the middle of the ball in the middle: its edges are 0.1 to the right and 0.06 above or below.
    let middle = |film: &gsii::render::Film| {
        let at = (SIZE[1] / 2 - 2) * SIZE[0] + SIZE[0] / 2;
        let pixel = film.pixels().nth(at as usize).unwrap();
        let (h, l) = (pixel.hires.mean(), pixel.lores.mean());
        Vec3::from_array([0, 1, 2].map(|band| (h[band] + l[band]) as f32))
    };
    let (got, all) = (middle(&tinted), middle(&clear));
    assert_eq!(all, Vec3::ONE, "clear glass that does not bend");
    // A chord at most 0.12 from the centre is between 0.97 and 1 long; the polyhedron's facets take 0.005 of that at most.
    let after = |length: f32| color.powf(length / distance);
    let (most, least) = (after(0.965), after(1.0));
    println!("{got}, between {least} and {most}");
    // Russian roulette ends some of the paths and strengthens the others, all bands alike: their ratios have no noise.
    let (ratio, high, low) = (got / got.z, most / most.z, least / least.z);
    assert!(ratio.cmple(1.0001 * high).all() && ratio.cmpge(0.9999 * low).all(), "{ratio} {low} {high}");
    // It ends 0.14 of them: 4.4 standard errors of what remains, one false alarm in 1e5.
    let noise = 4.4 * (0.14 / 0.86 / TRIALS as f32).sqrt();
    assert!(got.z < most.z * (1.0 + noise) && got.z > least.z * (1.0 - noise), "{got} {noise}");
}

/// Rough metal, rough and absorbing glass, a normal map and a mirror under an image: GSII against converged path tracing, up to the bias
/// that it states.
#[test]
fn all_materials_agree_with_path_tracing() {
    let folder = tempfile::tempdir().unwrap();
    example::write(folder.path()).unwrap();
    let mut scene =
        gsii::scene::load(&folder.path().join("materials.gltf"), &gsii::scene::LoadOptions::default()).unwrap();
    assert_eq!(scene.notes.warnings, Vec::<String>::new());
    let (environment, _) = Environment::read(&folder.path().join("surroundings.exr")).unwrap();
    scene.environment = Some(Arc::new(environment));
    let scene = Arc::new(scene);
    let of = |method: Method, trials: u32, seed: u32| {
        let (prepared, _) = prepare(&scene, settings(method));
        let film = render(&prepared, &fixed(SIZE[0], SIZE[1], trials, seed)).film;
        (prepared, film)
    };
    let (_, reference) = of(Method::Mcpt, 512, 1);
    let (prepared, film) = of(Method::Gsii, 128, 2);
    let measured = bias::measure(&prepared.world(), &scene.cameras[0], &fixed(SIZE[0], SIZE[1], 1, 3), 1 << 16);
    let mean = |v: [f64; 3]| v.iter().sum::<f64>() / 3.0;
    let (exact, got) = (Estimate::whole(&reference), Estimate::whole(&film));
    let error = exact.error.hypot(got.error).hypot(mean(measured.standard_error));
    let z = (got.mean - exact.mean - mean(measured.mean)) / error;
    println!("path tracing {exact:?}, GSII {got:?}, bias {:?}, z {z}", measured);
    assert!(z.abs() < threshold(ALPHA, 1), "z = {z}");
    assert!(error < 0.01 * exact.mean, "the test says something: {error}");
    // Each ball by itself: nothing but noise and at most 2 % of bias.
    for (i, (x, _)) in example::balls().into_iter().enumerate() {
        let column = (SIZE[0] as f32 * (0.5 + x / 7.2)) as u32;
        let inside = |x: u32, y: u32| x.abs_diff(column) < 4 && y.abs_diff(SIZE[1] / 2 - 2) < 4;
        let (exact, got) = (Estimate::of(&reference, inside), Estimate::of(&film, inside));
        let error = exact.error.hypot(got.error);
        println!("ball {i}: {:.4} +- {:.4}", got.mean / exact.mean, error / exact.mean);
        let bound = 0.02 * exact.mean + threshold(ALPHA, 5) * error;
        assert!((got.mean - exact.mean).abs() < bound, "ball {i}: {got:?} {exact:?}");
    }
}

/// Light that comes under a screen, by way of a floor of rough metal: a wall far away gets what the floor reflects forward. Taken for diffuse, as the
/// radiosity solution does, the floor would give it two thirds of that.
#[test]
fn rough_reflection_far_away_has_a_direction() {
    use crate::common::Body;
    let bodies = [
        Body::block([0.0; 3], [4.0, 3.0, 5.0], true, 0.3, 0.0),
        Body::block([0.0, 0.001, 0.0], [4.0, 0.02, 5.0], false, 0.8, 0.0),
        Body::block([0.0, 1.0, 2.5], [4.0, 3.0, 2.6], false, 0.3, 0.0),
        Body::block([1.5, 1.8, 4.5], [2.5, 2.2, 4.9], false, 0.0, 10.0),
    ];
    let mut scene = common::scene(&common::gltf(&bodies, [2.0, 0.8, 2.4]));
    let floor = &mut Arc::make_mut(&mut scene).materials[1];
    (floor.metallic, floor.roughness) = (1.0, 0.4);
    let film = |method: Method, trials: u32, seed: u32| {
        let prepared = prepare(&scene, settings(method)).0;
        render(&prepared, &fixed(SIZE[0], SIZE[1], trials, seed)).film
    };
    let (reference, film) = (film(Method::Mcpt, 2048, 1), film(Method::Gsii, 512, 2));
    // The upper part of the picture shows the wall.
    for rows in [0..SIZE[1] / 4, SIZE[1] / 4..SIZE[1] / 2] {
        let inside = |x: u32, y: u32| x.abs_diff(SIZE[0] / 2) < 12 && rows.contains(&y);
        let (exact, got) = (Estimate::of(&reference, inside), Estimate::of(&film, inside));
        let error = exact.error.hypot(got.error);
        println!("rows {rows:?}: {:.4} +- {:.4}", got.mean / exact.mean, error / exact.mean);
        // Patches still are even, and the radiosity solution has a statistical error of its own.
        let bound = 0.03 * exact.mean + threshold(ALPHA, 2) * error;
        assert!((got.mean - exact.mean).abs() < bound, "rows {rows:?}: {got:?} {exact:?}");
        assert!(bound < 0.2 * exact.mean, "the test says something: {error}");
    }
}
