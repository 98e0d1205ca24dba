//! Tests of the builder and of what finishing does.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use super::*;
use crate::backend::{HitFilter, PartKind};

/// A unit square in the plane z = 0, front face towards +z.
fn square() -> MeshData {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    MeshData {
        positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: [[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(Vec2::from).to_vec(), Vec::new()],
        ..MeshData::default()
    }
}

/// A box from -1 to 1, front faces outward, or inward.
fn cube(inward: bool) -> MeshData {
    let positions: Vec<Vec3> =
        (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let triangles = triangles.map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] }).collect();
    MeshData { positions, triangles, ..MeshData::default() }
}

fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

fn build(parts: &[(MeshData, Material, DAffine3)]) -> Scene {
    let mut builder = SceneBuilder::new("test");
    for (data, material, transform) in parts {
        let material = builder.add_material(material.clone());
        builder.add_mesh("part", data.clone(), material, *transform).unwrap();
    }
    builder.finish().unwrap()
}

fn grey() -> Material {
    Material::lambertian(Vec3::splat(0.5))
}

#[test]
fn far_scenes_are_the_same_as_near_ones() {
    let near = build(&[(cube(false), grey(), at(0.0, 0.0, 0.0)), (square(), grey(), at(3.0, 0.0, 0.0))]);
    let far = 2.0_f64.powi(20);
    let moved = build(&[(cube(false), grey(), at(far, 0.0, far)), (square(), grey(), at(far + 3.0, 0.0, far))]);
    assert_eq!(near.mesh.positions, moved.mesh.positions);
    assert_eq!(moved.centre - near.centre, DVec3::new(far, 0.0, far));
    assert_eq!(near.mesh.bounds.centre(), Vec3::ZERO);
}

#[test]
fn mirrored_objects_keep_their_outside() {
    let mut data = cube(false);
    data.normals = data.positions.clone();
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 2.0, 1.0));
    let scene = build(&[(data, grey(), mirror)]);
    for t in 0..12 {
        let [a, b, c] = scene.mesh.corners(t);
        assert!(scene.mesh.normal(t).dot(a + b + c) > 0.0, "triangle {t} faces inward");
        for i in scene.mesh.triangles[t as usize] {
            assert!(scene.mesh.normals[i as usize].dot(scene.mesh.normal(t)) > 0.0);
        }
    }
    // The inverse transposed, not the matrix: y is stretched, so normals lean away from y.
    let n = scene.mesh.normals[0].abs();
    assert!((n - Vec3::new(1.0, 0.5, 1.0).normalize()).length() < 1e-6, "{n}");
}

#[test]
fn useless_triangles_are_dropped_and_counted() {
    let mut data = square();
    data.positions.extend([Vec3::new(0.3, 0.3, 0.0), Vec3::new(0.7, 0.7, 0.0), Vec3::new(f32::NAN, 0.0, 0.0)]);
    data.positions.push(Vec3::new(1e30, 0.0, 0.0));
    data.uvs = Default::default();
    data.triangles.extend([[0, 0, 1], [0, 4, 5], [0, 1, 6], [0, 1, 7], [2, 1, 0]]);
    let scene = build(&[(data, grey(), at(0.0, 0.0, 0.0)), (square(), grey(), at(0.0, 0.0, 0.0))]);
    assert_eq!(scene.notes.degenerate_triangles, 2);
    assert_eq!(scene.notes.non_finite_triangles, 2);
    assert_eq!(scene.notes.duplicate_triangles, 3);
    assert_eq!((scene.mesh.triangles.len(), scene.mesh.objects.len()), (2, 1));
    assert!(scene.mesh.positions.iter().all(|p| p.is_finite()));
    assert_eq!(scene.mesh.bounds.size(), Vec3::new(1.0, 1.0, 0.0));
}

#[test]
fn triangles_too_small_for_single_precision_are_dropped() {
    let of_size = |size: f64| build(&[(square(), grey(), DAffine3::from_scale(DVec3::splat(size)))]);
    let [small, too_small] = [1e-15, 1e-16].map(of_size);
    assert_eq!((small.mesh.triangles.len(), small.notes.degenerate_triangles), (2, 0));
    assert_eq!((too_small.mesh.triangles.len(), too_small.notes.degenerate_triangles), (0, 2));
}

#[test]
fn of_two_equal_triangles_the_emitter_stays() {
    let lamp = Material::emitter(Vec3::ONE, Vec3::ZERO);
    let scene = build(&[(square(), grey(), at(0.0, 0.0, 0.0)), (square(), lamp, at(0.0, 0.0, 0.0))]);
    assert_eq!(scene.mesh.triangles.len(), 2);
    assert!((0..2).all(|t| scene.material(t).is_emitter()));
    assert!(scene.mesh.shared.is_empty(), "the other object is gone");
}

#[test]
fn what_an_object_loses_to_another_is_noted() {
    let above = (square(), grey(), at(0.0, 0.0, 1.0));
    let mut both = MeshData { uvs: Default::default(), ..square() };
    both.positions.extend(square().positions);
    both.positions[4..].iter_mut().for_each(|p| p.z = 1.0);
    both.triangles.extend(square().triangles.into_iter().map(|t| t.map(|i| i + 4)));
    let scene = build(&[above, (both, grey(), at(0.0, 0.0, 0.0))]);
    assert_eq!((scene.mesh.triangles.len(), scene.mesh.objects.len()), (4, 2));
    assert_eq!(scene.mesh.shared, [(0, 1), (1, 1)]);
}

#[test]
fn slivers_stay() {
    let mut data = square();
    data.positions[2].y = 1e-6;
    data.positions[3].y = 1e-6;
    assert_eq!(build(&[(data, grey(), at(0.0, 0.0, 0.0))]).mesh.triangles.len(), 2);
}

#[test]
fn flat_transforms_are_dropped_with_a_note() {
    let mut builder = SceneBuilder::new("test");
    let material = builder.add_material(grey());
    let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
    builder.add_mesh("flattened", cube(false), material, flat).unwrap();
    builder.add_mesh("kept", cube(false), material, DAffine3::from_scale(DVec3::splat(1e-9))).unwrap();
    let scene = builder.finish().unwrap();
    assert_eq!(scene.mesh.objects.len(), 1);
    assert!(scene.notes.warnings.iter().any(|w| w.contains("flattened")));
}

#[test]
fn impossible_materials_are_refused_by_name() {
    let white = Material { name: "white".into(), ..Material::lambertian(Vec3::ONE) };
    build(&[(square(), white.clone(), at(0.0, 0.0, 0.0))]);
    let changes: [fn(&mut Material); 8] = [
        |m| m.base_color.x = 1.0 + f32::EPSILON,
        |m| m.base_color.y = -0.1,
        |m| m.base_color.z = f32::NAN,
        |m| m.emission.x = f32::INFINITY,
        |m| m.emission.x = -1.0,
        |m| m.ior = 0.5,
        |m| m.roughness = 2.0,
        |m| m.attenuation_distance = 0.0,
    ];
    for (i, change) in changes.iter().enumerate() {
        let mut builder = SceneBuilder::new("test");
        let mut material = white.clone();
        change(&mut material);
        builder.add_material(material);
        let error = builder.finish().expect_err(&format!("change {i}")).to_string();
        assert!(error.contains("'white'"), "{error}");
    }
}

#[test]
fn impossible_lights_are_refused_by_name() {
    let point = LightKind::Point { position: Vec3::ZERO };
    let nowhere = LightKind::Point { position: Vec3::NAN };
    let spot =
        |cos_inner, cos_outer| LightKind::Spot { position: Vec3::ZERO, direction: Vec3::NEG_Z, cos_inner, cos_outer };
    let bad = [f32::NAN, f32::INFINITY, -1.0].map(|x| (Vec3::new(1.0, x, 1.0), point));
    let kinds = [nowhere, spot(0.5, 0.9), spot(1.0, -0.5), spot(f32::NAN, 0.5), spot(1.0, f32::NAN)];
    for (intensity, kind) in bad.into_iter().chain(kinds.map(|kind| (Vec3::ONE, kind))) {
        let mut builder = SceneBuilder::new("test");
        let material = builder.add_material(grey());
        builder.add_mesh("square", square(), material, at(0.0, 0.0, 0.0)).unwrap();
        builder.add_light(PunctualLight { name: "lamp".into(), intensity, kind }, at(0.0, 0.0, 1.0));
        let error = builder.finish().expect_err(&format!("{intensity} {kind:?}")).to_string();
        assert!(error.contains("'lamp'"), "{error}");
    }
}

#[test]
fn broken_parts_are_refused() {
    let mut builder = SceneBuilder::new("test");
    let material = builder.add_material(grey());
    let mut data = square();
    data.triangles.push([0, 1, 4]);
    assert!(builder.add_geometry("x", data).is_err());
    let mut data = square();
    data.normals = vec![Vec3::Z; 3];
    assert!(builder.add_geometry("x", data).is_err());
    assert!(builder.add_mesh("x", square(), material + 1, at(0.0, 0.0, 0.0)).is_err());
    assert!(builder.add_mesh("x", square(), material, at(f64::NAN, 0.0, 0.0)).is_err());
}

#[test]
fn objects_are_ordered_by_kind() {
    let glass = Material { transmission: 1.0, roughness: 0.0, metallic: 0.0, refracts: true, ..grey() };
    let thin = Material { refracts: false, ..glass.clone() };
    let blend = Material { alpha: Alpha::Blend, opacity: 0.5, ..grey() };
    let solid = Material { alpha: Alpha::Blend, ..grey() };
    let slab = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.01));
    let scene = build(&[
        (cube(false), glass.clone(), slab),
        (cube(false), blend, at(5.0, 0.0, 0.0)),
        (cube(false), glass, at(10.0, 0.0, 0.0)),
        (cube(false), thin, at(15.0, 0.0, 0.0)),
        (cube(false), solid, at(20.0, 0.0, 0.0)),
    ]);
    let materials: Vec<u32> = scene.mesh.objects.iter().map(|o| o.material).collect();
    assert_eq!(materials, [2, 4, 1, 0, 3]);
    let parts: Vec<_> = scene.mesh.parts().into_iter().map(|p| (p.kind, p.triangles)).collect();
    assert_eq!(parts, [(PartKind::Opaque, 0..24), (PartKind::Filtered, 24..36), (PartKind::Pane, 36..60)]);
    assert!((0..60).all(|t| scene.mesh.object(t).triangles.contains(&t)));
}

fn checker() -> Texture {
    let texels = [[0, 0, 0, 255], [255, 255, 255, 0], [255, 255, 255, 0], [0, 0, 0, 255]].concat();
    let (name, wrap) = ("checker".into(), [Wrap::Repeat; 2]);
    Texture { name, width: 2, height: 2, texels: Texels::Linear8(texels), wrap, smaller: Vec::new() }
}

fn textured(alpha: Alpha) -> Scene {
    let mut builder = SceneBuilder::new("test");
    let texture = builder.add_texture(checker());
    let slot = TextureSlot { texture, uv_set: 0, transform: glam::Affine2::IDENTITY };
    let material = Material { base_color_texture: Some(slot), alpha, ..Material::lambertian(Vec3::splat(0.8)) };
    let material = builder.add_material(material);
    builder.add_mesh("square", square(), material, at(0.0, 0.0, 0.0)).unwrap();
    builder.finish().unwrap()
}

#[test]
fn textures_are_read_at_the_point() {
    let scene = textured(Alpha::Opaque);
    // (u, v) = (1/4, 1/4) of the first triangle is at (0.5, 0.25): half way between a black and a white texel.
    assert_eq!(scene.uv(0, 0, 0.25, 0.25), Vec2::new(0.5, 0.25));
    assert!((scene.base_color(0, 0.25, 0.25) - Vec3::splat(0.4)).length() < 1e-6);
    // The triangle is half black and half white by symmetry; 4 scrambled Sobol points of values in 0..=0.8.
    let mean = scene.mean_reflectance(0).x;
    assert!((mean - 0.4).abs() < 0.2, "{mean}");
    assert_eq!(mean, scene.mean_reflectance(0).x);
}

#[test]
fn masks_are_sharp_and_blending_is_alpha_on_average() {
    let mask = Arc::new(textured(Alpha::Mask { cutoff: 0.5 }));
    assert_eq!(mask.mesh.objects[0].kind, PartKind::Filtered);
    let filter = AlphaFilter::new(mask.clone());
    // Texel centres: (0.75, 0.25) is transparent, (0.75, 0.75) opaque.
    assert!(!filter.accepts(0, 0.5, 0.25) && mask.opacity(0, 0.5, 0.25) == 0.0);
    assert!(filter.accepts(0, 0.0, 0.75) && mask.opacity(0, 0.0, 0.75) == 1.0);

    let blend = Arc::new(textured(Alpha::Blend));
    let filter = AlphaFilter::new(blend.clone());
    let n = 4096;
    let (mut accepted, mut expected, mut variance) = (0.0, 0.0, 0.0);
    for i in 0..n {
        let [x, y, ..] = crate::sampling::sobol(i, 0, 7);
        let (u, v) = (0.5 * x, 0.5 * y);
        let p = f64::from(blend.opacity(0, u, v));
        accepted += f64::from(u8::from(filter.accepts(0, u, v)));
        expected += p;
        variance += p * (1.0 - p);
        assert_eq!(filter.accepts(0, u, v), filter.accepts(0, u, v));
    }
    // A sum of Bernoulli numbers; 5 standard deviations fail falsely once in 1.7 million, and the seed is fixed.
    assert!((accepted - expected).abs() < 5.0 * f64::sqrt(variance), "{accepted} instead of {expected}");
}

#[test]
fn black_emission_textures_do_not_emit() {
    let mut builder = SceneBuilder::new("test");
    let black = Texture { texels: Texels::Srgb8(vec![0; 16]), ..checker() };
    let texture = builder.add_texture(black);
    let slot = TextureSlot { texture, uv_set: 0, transform: glam::Affine2::IDENTITY };
    let lamp = Material { emission_texture: Some(slot), ..Material::emitter(Vec3::ONE, Vec3::ZERO) };
    let lamp = builder.add_material(lamp);
    builder.add_mesh("lamp", square(), lamp, at(0.0, 0.0, 0.0)).unwrap();
    let scene = builder.finish().unwrap();
    assert!(!scene.materials[0].is_emitter() && scene.notes.warnings.len() == 1);
}

#[test]
fn the_camera_of_last_resort_sees_everything_or_stands_inside() {
    let outside = build(&[(cube(false), grey(), at(7.0, 0.0, 0.0))]);
    let camera = &outside.cameras[0];
    let Projection::Perspective { y_fov } = camera.projection else { panic!("perspective") };
    for corner in &outside.mesh.positions {
        let local = camera.axes.transpose() * (*corner - camera.position);
        let limit = -local.z * (0.5 * y_fov).tan();
        assert!(local.z < 0.0 && local.y.abs() < limit && local.x.abs() < limit, "{local} is out of view");
    }
    let room = build(&[(cube(true), grey(), at(7.0, 0.0, 0.0))]);
    let position = room.cameras[0].position;
    assert!(position.abs().max_element() < 1.0, "{position} is not in the room");
}

#[test]
fn cameras_and_lights_follow_their_nodes() {
    let mut builder = SceneBuilder::new("test");
    let material = builder.add_material(grey());
    builder.add_mesh("cube", cube(false), material, at(10.0, 0.0, 0.0)).unwrap();
    let camera = Camera {
        name: "c".into(),
        position: Vec3::ZERO,
        axes: Mat3::IDENTITY,
        projection: Projection::Perspective { y_fov: 1.0 },
        aspect: None,
    };
    // A quarter turn about y takes -z to -x; mirroring and scale must not change the image.
    let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let place = at(10.0, 2.0, 0.0) * turn * DAffine3::from_scale(DVec3::new(-3.0, 3.0, 3.0));
    builder.add_camera(camera.clone(), place);
    let spot = LightKind::Spot { position: Vec3::ZERO, direction: Vec3::NEG_Z, cos_inner: 1.0, cos_outer: 0.5 };
    builder.add_light(PunctualLight { name: "l".into(), intensity: Vec3::ONE, kind: spot }, place);
    let scene = builder.clone().finish().unwrap();
    let placed = &scene.cameras[0];
    assert!((placed.position - Vec3::new(0.0, 2.0, 0.0)).length() < 1e-6);
    assert!((placed.axes.z_axis - Vec3::X).length() < 1e-6 && (placed.axes.determinant() - 1.0).abs() < 1e-6);
    let LightKind::Spot { direction, .. } = scene.lights[0].kind else { panic!("spot") };
    assert!((direction - Vec3::NEG_X).length() < 1e-6);

    builder.add_camera(camera, DAffine3::from_scale(DVec3::ZERO));
    assert!(builder.finish().unwrap_err().to_string().contains("camera 'c'"));
}
