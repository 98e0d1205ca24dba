//! What the environment must be, whatever it looks like.

use std::collections::BTreeMap;

use glam::Vec3;

use crate::level;
use crate::office::{Detail, Office, ROOM};
use crate::reflectance::{Average, paint_walls};
use crate::scene::Scene;
use crate::surfaces::{sorted_edges, surfaces, weld};

fn paper(seed: u32) -> Scene {
    Office::build(level::for_surfaces(level::PAPER_SURFACES, seed), seed)
}

fn bytes(scene: &Scene) -> Vec<u8> {
    let mut out = Vec::new();
    crate::glb::write(scene, &mut out).unwrap();
    out
}

#[test]
fn number_of_surfaces_is_the_papers_within_one_per_cent() {
    for seed in [1, 2, 77] {
        let count = paper(seed).surface_count();
        assert!(count.abs_diff(level::PAPER_SURFACES) * 100 <= level::PAPER_SURFACES, "seed {seed}: {count}");
    }
}

#[test]
fn average_reflectance_is_met_by_the_walls_alone() {
    let base = paper(1);
    let [mut low, mut high] = [base.clone(), base];
    for (scene, rho) in [(&mut low, 0.41), (&mut high, 0.56)] {
        paint_walls(scene, rho);
        // Measured anew from the written colours; they are f32, so the sum is good to some 1e-7.
        assert!((Average::of(scene).rho() - rho).abs() < 1e-5);
    }
    let differing: Vec<_> =
        low.materials.iter().zip(&high.materials).filter(|(a, b)| a != b).map(|(a, _)| a.name).collect();
    assert_eq!(differing, ["wall paint"]);
    for paint in high.materials.iter().chain(&low.materials) {
        assert!(paint.color.iter().all(|c| (0.0..=0.9).contains(c)), "{paint:?}");
    }
}

#[test]
fn walls_never_reflect_more_than_they_may() {
    let mut scene = paper(1);
    assert!(paint_walls(&mut scene, 0.95).rho() < 0.95);
    assert!(paint_walls(&mut scene, 0.05).rho() > 0.05);
    paint_walls(&mut scene, 0.95);
    assert!(scene.materials.iter().flat_map(|paint| paint.color).all(|c| c <= 0.9));
}

#[test]
fn shell_is_closed() {
    let scene = paper(1);
    let mesh = scene.meshes.iter().find(|mesh| mesh.name == "shell").unwrap();
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for primitive in &mesh.primitives {
        let base = positions.len() as u32;
        positions.extend_from_slice(&primitive.positions);
        triangles.extend(primitive.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    let (_, index) = weld(&positions);
    // Every directed edge exists once, and so does its reverse.
    let mut directed: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for t in &triangles {
        let [a, b, c] = t.map(|i| index[i as usize]);
        for edge in [(a, b), (b, c), (c, a)] {
            *directed.entry(edge).or_default() += 1;
        }
    }
    for (&(a, b), &times) in &directed {
        assert_eq!((times, directed.get(&(b, a))), (1, Some(&1)), "edge {a}-{b}");
    }
}

#[test]
fn everything_is_finite_proper_and_inside_the_room() {
    for level in [0.01, 0.3, 1.0, 3.0] {
        let scene = Office::build(Detail::level(level), 5);
        for (node, primitive, map) in scene.instances() {
            assert!(!primitive.triangles.is_empty(), "{}", node.name);
            assert!(primitive.normals.is_empty() || primitive.normals.len() == primitive.positions.len());
            assert!(primitive.normals.iter().all(|n| n.is_normalized()), "{}", node.name);
            for t in &primitive.triangles {
                let [a, b, c] = t.map(|i| map.transform_point3(primitive.positions[i as usize]).as_dvec3());
                let longest = (b - a).length().max((c - b).length()).max((a - c).length());
                // World coordinates up to 6 are rounded to 2^-22; twice that is no height at all.
                assert!((b - a).cross(c - a).length() > longest * 5e-7, "{}: {a} {b} {c}", node.name);
            }
            // The window's reveal reaches out; the parts in it stay in it.
            let (low, high) = (Vec3::new(0.0, 0.0, -0.22), ROOM);
            for &p in &primitive.positions {
                let p = map.transform_point3(p);
                assert!((p - low).min_element() >= -2e-6 && (high - p).min_element() >= -2e-6, "{} at {p}", node.name);
            }
        }
    }
}

#[test]
fn stored_surface_counts_match_the_written_geometry() {
    // Splitting vertices for normals must not change what welding finds again.
    let scene = paper(1);
    for mesh in &scene.meshes {
        for primitive in &mesh.primitives {
            let (positions, index) = weld(&primitive.positions);
            let triangles: Vec<_> = primitive.triangles.iter().map(|t| t.map(|i| index[i as usize])).collect();
            assert_eq!(surfaces(&positions, &triangles).1, primitive.surfaces, "{}", mesh.name);
            assert!(sorted_edges(&triangles).len() == 3 * triangles.len());
        }
    }
}

#[test]
fn equal_arguments_give_equal_bytes_and_seeds_differ() {
    assert_eq!(bytes(&paper(3)), bytes(&paper(3)));
    assert_ne!(bytes(&paper(3)), bytes(&paper(4)));
}

#[test]
fn detail_series_grows_in_triangles_and_things() {
    let series: Vec<Scene> = [1_000, 10_000, 100_000, 1_000_000]
        .map(|triangles| Office::build(level::for_triangles(triangles, None, 1), 1))
        .into();
    for pair in series.windows(2) {
        assert!(pair[0].triangle_count() < pair[1].triangle_count());
        assert!(pair[0].nodes.len() < pair[1].nodes.len());
        assert!(pair[0].surface_count() < pair[1].surface_count());
    }
    for (scene, wanted) in series.iter().zip([1_000.0, 10_000.0, 100_000.0, 1_000_000.0_f64]) {
        let ratio = scene.triangle_count() as f64 / wanted;
        assert!((0.75..1.34).contains(&ratio), "{wanted}: {}", scene.triangle_count());
    }
}

#[test]
fn detail_of_the_same_things_is_tessellation() {
    let series = [40_000, 160_000].map(|n| Office::build(level::for_triangles(n, Some(0.3), 1), 1));
    for (scene, wanted) in series.iter().zip([4e4, 1.6e5]) {
        assert_eq!(scene.nodes.len(), series[0].nodes.len());
        let ratio = scene.triangle_count() as f64 / wanted;
        assert!((0.75..1.34).contains(&ratio), "{wanted}: {}", scene.triangle_count());
    }
}

#[test]
fn file_is_valid_gltf() {
    use gltf_json::validation::Validate;
    let file = bytes(&paper(1));
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], word(4), word(8)), (&b"glTF"[..], 2, file.len()));
    let json = word(12);
    assert_eq!((json % 4, &file[16..20], &file[24 + json..28 + json]), (0, &b"JSON"[..], &b"BIN\0"[..]));
    assert_eq!(word(20 + json) + 28 + json, file.len());
    let root = gltf_json::Root::from_slice(&file[20..20 + json]).unwrap();
    let mut errors = Vec::new();
    root.validate(&root, gltf_json::Path::new, &mut |path, error| errors.push(format!("{}: {error}", path())));
    assert!(errors.is_empty(), "{errors:?}");
    let names: Vec<_> = root.cameras.iter().map(|camera| camera.name.as_deref().unwrap()).collect();
    assert_eq!(names, ["overview", "desk", "pencils", "plant", "flight"]);
    for view in &root.buffer_views {
        assert!(
            view.byte_length.0 > 0 && view.byte_offset.unwrap().0 + view.byte_length.0 <= root.buffers[0].byte_length.0
        );
    }
    for material in &root.materials {
        let specular = material.extensions.as_ref().and_then(|all| all.specular.as_ref());
        assert_eq!(specular.map(|s| s.specular_factor.0), Some(0.0), "{:?}", material.name);
        assert_eq!(material.pbr_metallic_roughness.metallic_factor.0, 0.0);
    }
}
