//! Surfaces of all shapes, sizes and places.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use gsii::pipeline::{Method, Settings};
use gsii::render::film::Film;
use gsii::scene::{MeshData, Scene};

use super::scenes::*;
use super::{SIGMA, range};
use crate::kit::*;

#[test]
fn what_is_no_surface_changes_nothing() {
    let clean = furnace();
    // A1: two equal corners, three corners in a line. A5: a wall there a second time, of another reflectance.
    let mut spoilt = clean.clone();
    let degenerate = (0..100).flat_map(|i| {
        let at = |k: f64| v(0.5 + 1e-3 * f64::from(i), 0.25 * k, 0.0);
        [[at(0.0), at(1.0), at(0.0)], [at(0.0), at(1.0), at(2.0)]]
    });
    spoilt.add("degenerate", degenerate.collect(), grey(0.9));
    spoilt.add("again", polygon(&box_faces(DVec3::ZERO, DVec3::ONE)[2]), grey(0.9));
    let [clean, spoilt] = [clean, spoilt].map(|m| Room::new(m.finish()));
    let notes = &spoilt.scene.notes;
    assert_eq!((notes.degenerate_triangles, notes.duplicate_triangles), (200, 2));
    let [a, b] = [&clean, &spoilt].map(|room| {
        let solution = room.solve(&one_patch(0.05, 1)).unwrap();
        (FACES.map(|f| room.mean(&solution, f).to_bits()), solution.ledger.emitted.map(f64::to_bits))
    });
    assert_eq!(a, b);
}

#[test]
fn mirrored_and_stretched_objects_keep_their_light() {
    // A8: every wall mirrored by its node; winding and facing follow.
    let mut model = Model::new();
    let plain = furnace();
    let material = model.0.add_material(glow(0.5, 1.0));
    for face in &box_faces(DVec3::ZERO, DVec3::ONE) {
        let positions = face.iter().map(|p| (*p * v(-1.0, 1.0, 1.0)).as_vec3()).collect();
        // The same order of corners: the mirror turns the winding, the importer turns it back.
        let data = MeshData { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..MeshData::default() };
        let mirror = DAffine3::from_scale(v(-1.0, 1.0, 1.0));
        // Mirrored data by a mirroring node: the room itself, inside out in the file.
        model.0.add_mesh("wall", flip(data), material, mirror).unwrap();
    }
    let [plain, mirrored] = [plain, model].map(|m| m.finish());
    for t in 0..plain.mesh.triangles.len() as u32 {
        assert_eq!(plain.mesh.normal(t), mirrored.mesh.normal(t), "triangle {t}");
    }
    // An emitting cube of edge 1 stretched to 1 x 2 x 3: the same radiance from a larger surface.
    let mut model = Model::new();
    let material = model.0.add_material(glow(0.0, 2.0));
    let cube = solid(DVec3::ZERO, DVec3::ONE);
    let data = MeshData {
        positions: cube.iter().flatten().map(|p| p.as_vec3()).collect(),
        triangles: (0..cube.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        ..MeshData::default()
    };
    model.0.add_mesh("lamp", data, material, DAffine3::from_scale(v(1.0, 2.0, 3.0))).unwrap();
    let room = Room::new(model.finish());
    let flux = room.solve(&one_patch(0.1, 1)).unwrap().ledger.emitted[0];
    let expected = 2.0 * 22.0;
    assert!((flux - expected).abs() < 1e-5 * expected, "{flux}");
}

/// The same triangles, seen from behind.
fn flip(mut data: MeshData) -> MeshData {
    data.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    data
}

#[test]
fn walls_of_slivers_are_walls() {
    // A2.
    let scene = furnace_of_slivers().finish();
    let room = Room::new(scene.clone());
    let solution = room.solve(&one_patch(0.01, 1)).unwrap();
    // The corner of a strip may lie half a roundoff beside the edge of the next wall.
    assert!(solution.ledger.escaped[0] < 1e-6 * solution.ledger.emitted[0], "{:?}", solution.ledger);
    for face in FACES {
        assert!((room.mean(&solution, face) - 1.0).abs() < 0.01, "{face}");
    }
    let camera = [look_at(&scene, v(0.5, 0.5, 0.0), v(0.2, 0.1, 1.0), 0.5, 0.3)];
    let seen = radiance_of(&scene, &mcpt(), &camera, [8, 8], 64, Part::All)[0].times(PI);
    assert!((seen.mean - 2.0).abs() < SIGMA * seen.error + 1e-3, "{seen:?}");
}

/// A small image of a [`furnished`] room whose length unit is `unit`.
fn small_image(scene: &Arc<Scene>, method: Method, unit: f64) -> Film {
    let [r_thresh, patch_size] = [0.5, 0.5].map(|length: f64| Some((unit * length) as f32));
    let prepared = prepare(scene, Settings { method, r_thresh, patch_size, ..Settings::default() }).unwrap();
    let camera = look_at(scene, scene.centre, v(0.2, -1.0, 0.4), 1.5 * unit, unit);
    image(&prepared, &camera, [24, 16], 16, 1)
}

fn values(film: &Film) -> Vec<[f64; 3]> {
    film.pixels().map(|p| Part::All.of(p)).collect()
}

#[test]
fn scenes_in_any_unit() {
    // B1: in units of 2^-13 and 2^13, images are the same, bit for bit: powers of two only change exponents.
    for method in [Method::Gsii, Method::Mcpt] {
        let [one, small, large] = [1.0, 2_f64.powi(-13), 2_f64.powi(13)].map(|unit| {
            let scene = furnished(unit, DVec3::ZERO, DVec3::ZERO).finish();
            values(&small_image(&scene, method, unit))
        });
        assert!(one.iter().any(|v| v[0] > 0.0));
        assert_eq!(one, small, "{method:?}");
        assert_eq!(one, large, "{method:?}");
    }
}

#[test]
fn scenes_far_from_the_origin() {
    let far = v(2_f64.powi(20), 0.0, 2_f64.powi(20));
    // B2: moved by the node it is the same scene, bit for bit.
    let [near, moved] = [DVec3::ZERO, far].map(|by| furnished(1.0, by, DVec3::ZERO).finish());
    for method in [Method::Gsii, Method::Mcpt] {
        let [a, b] = [&near, &moved].map(|scene| values(&small_image(scene, method, 1.0)));
        assert!(a.iter().any(|v| v[0] > 0.0));
        assert_eq!(a, b, "{method:?}");
        // Baked in, f32 leaves steps of 1/8: everything here is a multiple of that, so that nothing is lost, either.
        let baked = furnished(1.0, DVec3::ZERO, far).finish();
        assert_eq!(values(&small_image(&baked, method, 1.0)), a, "{method:?}, baked");
    }
    // Where it is no multiple of the steps, walls move by up to half of one; light stays finite and inside.
    let crooked = furnished(1.0, DVec3::ZERO, far + 0.3).finish();
    for method in [Method::Gsii, Method::Mcpt] {
        let [low, high, mean] = range(&small_image(&crooked, method, 1.0));
        assert!(low >= 0.0 && high.is_finite() && mean > 0.0, "{method:?}: {low} {high} {mean}");
    }
}

#[test]
fn small_things_in_huge_halls() {
    // B3.
    let cameras = |scene: &Scene| {
        // The pencil's top, its shadow beside it, and the desk where it lies in the light.
        [v(0.0, 0.5 * MILLIMETRE, MILLIMETRE), v(0.0, -0.25 * MILLIMETRE, 0.0), v(0.25, 0.25, 0.0)]
            .map(|p| look_at(scene, p, DVec3::Z, 0.125, 0.125 * MILLIMETRE))
            .to_vec()
    };
    let gsii = Settings { r_thresh: Some(0.1), patch_size: Some(0.1), ..Settings::default() };
    for (what, settings) in [("path tracing", mcpt()), ("GSII", gsii)] {
        let [open, hall] = [false, true].map(|hall| {
            let scene = desk(hall).finish();
            // Nothing beyond `r_thresh` reflects light to where the cameras look, so that solutions do not differ there, and two are
            // enough: in the hall each has hundreds of thousands of patches.
            let prepared = [1, 2].map(|seed| prepare(&scene, Settings { seed, ..settings.clone() }).unwrap());
            all_parts_of(&prepared, &cameras(&scene), [4, 4], 256).into_iter().map(|parts| parts[Part::All as usize])
        });
        for (place, (a, b)) in ["pencil", "shadow", "desk"].iter().zip(open.zip(hall)) {
            let error = a.error.hypot(b.error);
            println!("{what}, {place}: {a:?} {b:?}");
            assert!(a.mean > 0.0, "{what}, {place}");
            assert!((a.mean - b.mean).abs() < SIGMA * error + 1e-4 * a.mean, "{what}, {place}: {a:?} {b:?}");
        }
    }
}
