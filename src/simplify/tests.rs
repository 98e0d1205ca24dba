//! The whole stage, on known scenes.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::classify::{self, area_threshold};
use super::fit::{fit_flux, fit_paper1993};
use super::testing::*;
use super::*;
use crate::backend::PartKind;
use crate::sampling;
use crate::scene::{Alpha, Material};

/// The paper's beta: `A_thresh = r_thresh^2`.
const PAPER_BETA: f32 = 0.5 * FRAC_1_PI;

fn run(scene: &Arc<Scene>, params: &SimplifyParams) -> Simplified {
    simplify(scene, &BruteForce, params, &Progress::silent()).unwrap()
}

/// Quads of the given areas, square, far apart, each an object.
fn isolated_quads(areas: &[f32]) -> Arc<Scene> {
    let builder = areas.iter().enumerate().fold(SceneBuilder::default(), |b, (i, area)| {
        let side = area.sqrt();
        b.grey(0.5, &quad(Vec3::X * (10 * i) as f32, Vec3::X * side, Vec3::Y * side))
    });
    Arc::new(builder.build())
}

fn is_normal(s: &Simplified) -> Vec<bool> {
    s.surfaces.iter().map(|s| s.class == Class::Normal).collect()
}

/// Unit-cube room, walls diced into `n * n` quads, facing inward; the ceiling (y+) emits.
fn room(n: u32, reflectance: f32) -> SceneBuilder {
    room_faces(Vec3::ZERO, Vec3::ONE).into_iter().enumerate().fold(SceneBuilder::default(), |b, (i, [a, u, v])| {
        let grey = Vec3::splat(reflectance);
        let material = if i == 3 { Material::emitter(Vec3::ONE, grey) } else { Material::lambertian(grey) };
        b.object(material, &diced_quad(a, v, u, n))
    })
}

#[test]
fn gsii_001_threshold_is_strict_and_counts_surfaces() {
    assert!((area_threshold(0.5, PAPER_BETA) / 0.25 - 1.0).abs() < 1e-6);
    let s = run(&isolated_quads(&[0.2499, 0.2501, 0.0001, 4.0]), &params(0.5, PAPER_BETA));
    assert_eq!(s.surfaces.len(), 4, "two triangles are one surface");
    assert_eq!(is_normal(&s), [false, true, false, true]);
    // Strictly smaller: at r_thresh = 2, beta = 1/8 the threshold is exactly pi.
    let mut surfaces = s.surfaces.clone();
    surfaces[0].area = area_threshold(2.0, 0.125);
    let extent = cluster::Extent { compact: 100.0, longest: 100.0 };
    let small = classify::find_small(&isolated_quads(&[1.0; 4]), &surfaces, surfaces[0].area, extent);
    assert!(!small.clusterable.contains(&0) && small.clusterable.contains(&1));
}

#[test]
fn gsii_002_office_setting() {
    assert!((area_threshold(0.053 * 6.0, PAPER_BETA) / 0.101124 - 1.0).abs() < 1e-6);
}

#[test]
fn gsii_003_one_dropped_disc_loses_less_than_twice_beta() {
    let (beta, r) = (0.01f64, 3.0f64);
    // Form factor of a facing disc: A / (A + pi r^2).
    let area = area_threshold(r as f32, beta as f32);
    let lost = area / (area + std::f64::consts::PI * r * r);
    assert!((lost - 0.0196078431372549).abs() < 1e-6 && lost < 2.0 * beta);
}

#[test]
fn gsii_023_other_values() {
    assert!((area_threshold(1.5, 0.02) / 0.2827433388230814 - 1.0).abs() < 1e-6);
    let s = run(&isolated_quads(&[0.28, 0.285, 0.2827]), &params(1.5, 0.02));
    assert_eq!(is_normal(&s), [false, true, false]);
}

#[test]
fn parameters_without_meaning_are_refused() {
    let scene = isolated_quads(&[1.0]);
    for (r, beta) in [(f32::INFINITY, 0.0), (f32::NAN, 0.1), (-1.0, 0.1), (1.0, 1.5), (1.0, -0.1), (1.0, f32::NAN)] {
        let outcome = simplify(&scene, &BruteForce, &params(r, beta), &Progress::silent());
        assert!(matches!(outcome, Err(crate::Error::Usage(_))), "r_thresh {r}, beta {beta}");
    }
}

#[test]
fn limits_leave_everything_normal() {
    let scene = isolated_quads(&[0.01, 0.02]);
    for (r, beta) in [(0.0, 1.0), (1.0, 0.0), (f32::INFINITY, 1.0), (1e30, 1.0)] {
        let s = run(&scene, &params(r, beta));
        assert!(is_normal(&s).into_iter().all(|n| n), "r_thresh {r}, beta {beta}");
        assert_eq!(s.geometry.triangles.len(), 4);
    }
}

#[test]
fn any_threshold_leaves_walls_and_counts_everything_once() {
    let scene = Arc::new(room(1, 0.5).grey(0.5, &leaves(400, 0.02, Vec3::splat(0.2), Vec3::splat(0.8), 5)).build());
    for (r, beta) in
        [(1e-6, 0.5), (0.01, 1.0), (0.1, 1.0), (0.3, 0.0), (0.3, 1.0), (1.0, 1.0), (3.0, 1.0), (1e20, 1e-30)]
    {
        let s = run(&scene, &params(r, beta));
        assert!(is_normal(&s)[..6].iter().all(|&n| n), "r_thresh {r}, beta {beta}");
        let clustered: usize = s.clusters.iter().map(|c| c.surfaces.len()).sum();
        let others = s.surfaces.iter().filter(|s| s.class == Class::Normal || s.class.is_isolated()).count();
        assert_eq!(clustered + others, s.surfaces.len());
        assert!(s.geometry.positions.iter().all(|p| p.is_finite()));
    }
}

#[test]
fn hard_012_diced_walls_are_six_surfaces() {
    let s = run(&Arc::new(room(100, 0.5).build()), &params(0.1, PAPER_BETA));
    assert_eq!(s.surfaces.len(), 6);
    assert!(is_normal(&s).into_iter().all(|n| n));
    assert!(s.surfaces.iter().all(|s| (s.area - 1.0).abs() < 1e-4 && s.triangles == 20_000));
}

#[test]
fn gsii_025_walls_below_the_threshold_stay() {
    let scene = Arc::new(room(1, 0.5).build());
    for r in [1.2, 1.45, 2.0] {
        let s = run(&scene, &params(r, PAPER_BETA));
        assert!(s.a_thresh > 1.0);
        assert!(is_normal(&s).into_iter().all(|n| n), "r_thresh {r}");
        assert!(s.warnings.iter().any(|w| w.starts_with("5 surfaces")), "{:?}", s.warnings);
    }
}

#[test]
fn light_sources_mirrors_and_glass_are_never_simplified() {
    let kinds = [
        Material::emitter(Vec3::ONE, Vec3::ZERO),
        Material { roughness: 0.0, ..Material::default() },
        Material { transmission: 1.0, ..Material::lambertian(Vec3::ONE) },
        Material::lambertian(Vec3::splat(0.5)),
    ];
    let mut builder = room(1, 0.5);
    for (i, material) in kinds.into_iter().enumerate() {
        for k in 0..20 {
            let at = Vec3::new(0.4 + 0.01 * i as f32, 0.4, 0.4 + 0.006 * k as f32);
            builder = builder.object(material.clone(), &quad(at, Vec3::X * 0.005, Vec3::Y * 0.005));
        }
    }
    let scene = Arc::new(builder.build());
    // A small beta, so that nothing is dropped by A_thresh that a cluster should hold.
    let s = run(&scene, &params(0.3, 1e-4));
    for surface in &s.surfaces[6..] {
        let lambertian = scene.materials[scene.mesh.objects[surface.object as usize].material as usize].is_lambertian();
        let expected =
            lambertian && !scene.materials[scene.mesh.objects[surface.object as usize].material as usize].is_emitter();
        assert_eq!(surface.class != Class::Normal, expected);
    }
    assert!(!s.clusters.is_empty());
}

/// `n` small random quads in the unit cube between `lo` and `hi`.
fn leaves(n: u32, side: f32, lo: Vec3, hi: Vec3, seed: u32) -> Vec<[Vec3; 3]> {
    (0..n)
        .flat_map(|i| {
            let [x, y, z, a] = sampling::sobol(i, 0, seed);
            let [b, c, ..] = sampling::sobol(i, 1, seed);
            let basis = sampling::basis(sampling::uniform_sphere(glam::Vec2::new(a, b)));
            let turned = basis * Mat3::from_rotation_z(6.3 * c);
            quad(lo + (hi - lo) * Vec3::new(x, y, z), turned.x_axis * side, turned.y_axis * side)
        })
        .collect()
}

#[test]
fn clusters_respect_the_cap_and_dropped_areas_their_bound() {
    let scene = Arc::new(room(1, 0.5).grey(0.5, &leaves(3000, 0.01, Vec3::splat(0.1), Vec3::splat(0.9), 5)).build());
    let p = params(0.25, 0.02);
    let s = run(&scene, &p);
    assert!(s.clusters.len() > 10);
    for c in &s.clusters {
        let diagonal = c.bounds.diagonal() / p.r_thresh;
        assert!(diagonal <= 1.0 || (diagonal <= p.longest && c.residual.hidden <= replace::MOST_HIDDEN), "{diagonal}");
    }
    let dropped: Vec<&Surface> = s.surfaces.iter().filter(|s| s.class == Class::Complex { cluster: None }).collect();
    assert!(!dropped.is_empty());
    // Any ball of radius r_thresh lies in three voxels along each axis.
    for i in 0..1000 {
        let [x, y, z, _] = sampling::sobol(i, 0, 77);
        let ball = Vec3::new(x, y, z);
        let inside = |s: &&&Surface| s.bounds.centre().distance(ball) <= p.r_thresh - 0.5 * s.bounds.diagonal();
        let area: f64 = dropped.iter().filter(inside).map(|s| s.area).sum();
        assert!(area <= s.a_thresh, "{area} > {}", s.a_thresh);
    }
    // Every small surface is in exactly the cluster that lists it.
    for (i, cluster) in (0u32..).zip(&s.clusters) {
        assert!(cluster.surfaces.iter().all(|&m| s.surfaces[m as usize].class == Class::Complex { cluster: Some(i) }));
    }
    let listed: usize = s.clusters.iter().map(|c| c.surfaces.len()).sum();
    let normal = is_normal(&s).into_iter().filter(|&n| n).count();
    assert_eq!(listed + dropped.len() + normal, s.surfaces.len());
}

#[test]
fn same_result_whatever_the_number_of_threads() {
    let scene = Arc::new(room(1, 0.5).grey(0.5, &leaves(500, 0.01, Vec3::splat(0.3), Vec3::splat(0.6), 5)).build());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let s = pool.install(|| run(&scene, &params(0.2, 0.001)));
        format!("{:?} {:?} {:?}", s.surfaces, s.clusters, s.geometry)
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn geometry_is_consistent_and_boxes_face_outward() {
    let scene = Arc::new(room(2, 0.5).grey(0.5, &leaves(300, 0.01, Vec3::splat(0.3), Vec3::splat(0.6), 5)).build());
    let s = run(&scene, &params(0.3, 1e-3));
    let g = &s.geometry;
    assert!(!s.clusters.is_empty());
    assert_eq!(g.triangles.len(), 48 + 12 * s.clusters.len());
    assert_eq!(g.surfaces as usize, 6 + 6 * s.clusters.len());
    assert_eq!(g.parts.iter().map(|p| p.triangles.len()).sum::<usize>(), g.triangles.len());
    assert_eq!(g.parts.last().map(|p| p.kind), Some(PartKind::OneSided));
    for (t, source) in g.triangles.iter().zip(&g.sources) {
        let [a, b, c] = t.map(|i| g.positions[i as usize]);
        match *source {
            TriangleSource::Scene { triangle } => assert_eq!([a, b, c], scene.mesh.corners(triangle)),
            TriangleSource::BoxFace { cluster, face, second } => {
                let shape = &s.clusters[cluster as usize].equivalent_box;
                let outward = shape.axes.col(face as usize / 2) * fit::face_side(face.into());
                assert!((b - a).cross(c - a).normalize().dot(outward) > 0.999);
                // Corner (0,0), and the corner that tells the halves apart: (1,0) or (0,1).
                let local = |p: Vec3| shape.axes.transpose() * (p - shape.centre) / shape.half;
                let (_, i, j) = fit::face_axes(face.into());
                assert!(local(a)[i] < -0.99 && local(a)[j] < -0.99);
                let apart = [b, c].map(local).into_iter().find(|p| p[i] * p[j] < 0.0).unwrap();
                assert_eq!(second, apart[j] > 0.0);
            }
        }
    }
    let complete = SimplifiedGeometry::complete(&scene, &s.surface_of_triangle);
    assert_eq!((complete.triangles.len(), complete.surfaces as usize), (48 + 600, s.surfaces.len()));
}

#[test]
fn boxes_stay_on_the_floor() {
    // Loose layers of scraps, the lowest on the floor.
    let mut builder = room(1, 0.5);
    for k in 0..500 {
        let [x, z, ..] = sampling::sobol(k, 0, 4);
        let corner = Vec3::new(0.4 + 0.1 * x, 0.0005 + 0.01 * (k % 10) as f32, 0.4 + 0.1 * z);
        builder = builder.grey(0.5, &quad(corner, Vec3::X * 0.004, Vec3::Z * 0.004));
    }
    let s = run(&Arc::new(builder.build()), &params(0.4, 1e-4));
    assert!(!s.clusters.is_empty());
    for cluster in s.clusters.iter().filter(|c| c.bounds.min.y < 0.001) {
        let shape = &cluster.equivalent_box;
        let half_height = shape.axes.row(1).abs().dot(shape.half);
        assert!(half_height < 0.9 * 0.5 * cluster.bounds.size().y, "lower than its cluster, or nothing is shown");
        let bottom = shape.centre.y - half_height;
        assert!(bottom > 0.0 && bottom < 0.001, "{bottom}");
    }
}

#[test]
fn a_box_never_replaces_something_simpler() {
    // Six quads have the twelve triangles of a box; a seventh makes the box worth it. None can be dropped.
    let with = |n: u32| {
        let quads: Vec<_> = (0..n)
            .flat_map(|k| quad(Vec3::new(0.4 + 0.011 * k as f32, 0.4, 0.4), Vec3::X * 0.01, Vec3::Y * 0.01))
            .collect();
        let s = run(&Arc::new(room(1, 0.5).grey(0.5, &quads).build()), &params(0.2, 4.1e-4));
        assert!(
            s.surfaces[6].area < s.a_thresh && s.surfaces.iter().all(|s| s.class != Class::Complex { cluster: None })
        );
        (s.clusters.len(), s.geometry.triangles.len())
    };
    assert_eq!(with(6), (0, 12 + 12));
    assert_eq!(with(7), (1, 12 + 12));
}

#[test]
fn a_box_has_no_more_patches_than_its_cluster_has_surfaces() {
    // Balls of 224 triangles each, a surface and about a patch.
    let patches = |n: u32| {
        let builder = (0..n).fold(room(1, 0.5), |b, k| {
            let centre = Vec3::new(0.4 + 0.011 * (k % 5) as f32, 0.4 + 0.011 * (k / 5) as f32, 0.4);
            b.grey(0.5, &sphere(centre, 0.005, 8))
        });
        let s = run(&Arc::new(builder.build()), &params(0.2, 1.5e-3));
        assert!(s.surfaces.iter().all(|s| s.class != Class::Complex { cluster: None }), "nothing is dropped");
        assert!(s.clusters.len() <= 1);
        s.clusters.first().map(|c| c.equivalent_box.reflectance.iter().map(Vec::len).sum::<usize>())
    };
    assert_eq!([5, 6, 23, 24].map(patches), [None, Some(6), Some(6), Some(24)]);
}

#[test]
fn clusters_that_rays_pass_through_stay_finite() {
    let side = |opacity: f32| {
        let material = Material { opacity, alpha: Alpha::Mask { cutoff: 0.5 }, ..Material::lambertian(Vec3::ONE) };
        let mut scene =
            room(1, 0.5).object(material, &leaves(100, 0.01, Vec3::splat(0.4), Vec3::splat(0.5), 3)).build();
        scene.mesh.objects[6].kind = PartKind::Filtered;
        let s = run(&Arc::new(scene), &params(0.3, 2e-4));
        assert_eq!(s.clusters.len(), 1);
        s.clusters[0].clone()
    };
    let (solid, gone) = (side(1.0), side(0.0));
    assert!(solid.residual.hit_share > 0.01 && gone.residual.hit_share == 0.0);
    let shape = &gone.equivalent_box;
    assert!(shape.half.is_finite() && shape.half.min_element() > 0.0 && shape.centre.is_finite());
    assert!(shape.half.max_element() < 0.01 * solid.equivalent_box.half.max_element());
    assert!(shape.reflectance.iter().flatten().all(|r| r.is_finite()));
}

/// Mean projected area of the cluster over that of the fitted box, minus 1, and three standard errors, on lines that the fit
/// has not seen.
fn flux_residual(triangles: &[[Vec3; 3]]) -> (f64, f64, f64) {
    let scene = Arc::new(SceneBuilder::default().grey(0.5, triangles).build());
    let all = all_triangles(&scene);
    let fit = |seed| fit_flux(&scene, &BruteForce, &all, Mat3::IDENTITY, 2, 8192, seed).unwrap();
    let (fitted, fresh) = (fit(1), fit(2));
    let size = scene.mesh.bounds.size();
    let surface = |e: Vec3| 2.0 * fit::half_surface(e);
    assert!(fitted.edges.cmple(size.max(Vec3::splat(1e-3 * size.max_element())) * 1.0001).all());
    let residual = surface(fitted.edges) / (fresh.hit_share * surface(size)) - 1.0;
    // Both shares are sampled; each stops at 2 % or after 8192 lines.
    let error = (2.0 * (1.0 - fresh.hit_share) / (fresh.hit_share * 8192.0)).sqrt().max(0.02 * 2f64.sqrt());
    (residual, 3.0 * error, fresh.hit_share)
}

#[test]
fn flux_fit_conserves_intercepted_light() {
    // algorithms.md 0: leaf cloud, rods, shelves, sphere; and flat things. 3 sigma on six shapes: false alarm under 2 %.
    let rods: Vec<_> = (0..49)
        .flat_map(|k| {
            let (x, z) = ((k % 7) as f32 / 6.5, (k / 7) as f32 / 6.5);
            solid([x, 0.0, z], [x + 0.07, 1.0, z + 0.07])
        })
        .collect();
    let shelves: Vec<_> =
        (0..10).flat_map(|k| solid([0.0, k as f32 / 9.1, 0.0], [1.0, k as f32 / 9.1 + 0.005, 1.0])).collect();
    let shapes = [
        ("leaves", leaves(1000, 0.03, Vec3::splat(0.0), Vec3::splat(1.0), 9)),
        ("rods", rods),
        ("shelves", shelves),
        ("sphere", sphere(Vec3::ZERO, 0.5, 12)),
        ("quad", quad(Vec3::ZERO, Vec3::X, Vec3::Y * 0.5)),
        ("leaning quad", quad(Vec3::ZERO, Vec3::X, Vec3::new(0.0, 1.0, 1.0))),
    ];
    for (name, triangles) in shapes {
        let (residual, bound, p) = flux_residual(&triangles);
        assert!(residual.abs() <= bound, "{name}: {residual} > {bound} at p = {p}");
    }
}

#[test]
fn escape_albedo_of_a_convex_body_is_its_reflectance() {
    let scene = Arc::new(SceneBuilder::default().grey(0.6, &sphere(Vec3::ZERO, 0.5, 12)).build());
    let fit = fit_flux(&scene, &BruteForce, &all_triangles(&scene), Mat3::IDENTITY, 2, 2048, 1).unwrap();
    assert!(fit.reflectance.iter().flatten().all(|r| (*r - 0.6).abs().max_element() < 1e-5));
}

#[test]
fn gsii_018_escape_albedo_of_a_bowl() {
    // Hemisphere, inside reflectance 0.8: the opening reflects 2/3; the paper's patch says 0.8.
    let bowl: Vec<_> = sphere(Vec3::ZERO, 1.0, 24).into_iter().filter(|t| t.iter().all(|p| p.y <= 1e-6)).collect();
    let scene = Arc::new(SceneBuilder::default().grey(0.8, &bowl).build());
    let all = all_triangles(&scene);
    let paper = fit_paper1993(&scene, &BruteForce, &all, Mat3::IDENTITY, 1, 16, 1).unwrap();
    assert!((paper.reflectance[3][0].unwrap() - 0.8).abs().max_element() < 1e-6);
    // The opening has escape albedo 2/3 for uniform light; all of what enters through the face y+ and hits is inside the
    // bowl or, past its rim, on the outside with 0.8, so look at the middle of the face only.
    let flux = fit_flux(&scene, &BruteForce, &all, Mat3::IDENTITY, 5, 32768, 1).unwrap();
    let middle = flux.reflectance[3][12].x / flux.albedo.x;
    let rim = flux.reflectance[3][0].x / flux.albedo.x;
    assert!(middle < rim, "{middle} {rim}");
}

/// A row of books, longer than `r_thresh`.
fn books(length: f32) -> Vec<[Vec3; 3]> {
    let n = (length / 0.02) as u32;
    (0..n)
        .flat_map(|k| {
            let x = 0.1 + 0.02 * k as f32;
            solid([x, 0.01, 0.1], [x + 0.019, 0.15 + 0.002 * (k % 5) as f32, 0.2])
        })
        .collect()
}

#[test]
fn long_dense_rows_are_one_cluster_and_long_sparse_ones_are_not() {
    // A_thresh = 0.0196 is above the area of a side of a book.
    let p = params(0.25, 0.05);
    let row = run(&Arc::new(room(1, 0.5).grey(0.5, &books(0.6)).build()), &p);
    let longest = row.clusters.iter().map(|c| c.bounds.diagonal()).fold(0.0, f32::max);
    assert!(longest > 1.5 * p.r_thresh, "{longest}");
    // Two facing plates of leaves farther apart than r_thresh see each other across the gap.
    let mut plates = leaves(300, 0.02, Vec3::new(0.3, 0.3, 0.3), Vec3::new(0.3, 0.6, 0.6), 1);
    plates.extend(leaves(300, 0.02, Vec3::new(0.7, 0.3, 0.3), Vec3::new(0.7, 0.6, 0.6), 2));
    plates.extend(leaves(40, 0.02, Vec3::new(0.3, 0.3, 0.3), Vec3::new(0.7, 0.3, 0.6), 3));
    let gap = run(&Arc::new(room(1, 0.5).grey(0.5, &plates).build()), &p);
    assert!(!gap.clusters.is_empty());
    for c in &gap.clusters {
        assert!(c.bounds.diagonal() <= p.r_thresh || c.residual.hidden <= replace::MOST_HIDDEN);
    }
}

#[test]
fn boxes_never_cover_a_light_source_a_mirror_or_glass() {
    // Something inside a ring of clutter, as in a shade.
    let inner = solid([0.49, 0.49, 0.49], [0.51, 0.51, 0.51]);
    let around: Vec<_> = (0..40)
        .flat_map(|k| {
            let (sin, cos) = (k as f32 * 0.157).sin_cos();
            let at = Vec3::new(0.5 + 0.05 * cos, 0.47, 0.5 + 0.05 * sin);
            solid(at.to_array(), (at + Vec3::new(0.005, 0.06, 0.005)).to_array())
        })
        .collect();
    let middle = Aabb { min: Vec3::splat(0.49), max: Vec3::splat(0.51) };
    let covered = |material: Material| {
        let scene = room(1, 0.5).object(material, &inner).grey(0.5, &around).build();
        let s = run(&Arc::new(scene), &params(0.25, 1e-4));
        assert!(!s.clusters.is_empty());
        s.clusters.iter().any(|c| c.equivalent_box.bounds().overlaps(&middle))
    };
    assert!(!covered(Material::emitter(Vec3::ONE, Vec3::ZERO)));
    assert!(!covered(Material { roughness: 0.0, ..Material::default() }));
    assert!(!covered(Material { transmission: 1.0, ..Material::lambertian(Vec3::ONE) }));
    assert!(covered(Material::lambertian(Vec3::ONE)), "nothing else is spared");
}

#[test]
fn touching_blocks_are_as_solid_as_they_were_modelled() {
    // A row longer than any cluster may be. Where two blocks touch the file's two faces are one, and the second block is open.
    let side = 0.02;
    let n = 40;
    let mut builder = room(1, 0.5);
    for k in 0..n {
        let lo = Vec3::new(0.1 + side * k as f32, 0.3, 0.3);
        let hi = Vec3::new(0.1 + side * (k + 1) as f32, 0.32, 0.32);
        let closed = solid(lo.to_array(), hi.to_array());
        builder = builder.grey(0.5, if k == 0 { &closed } else { &closed[2..] });
    }
    let mut scene = builder.build();
    for k in 1..n {
        let before = scene.mesh.objects[6 + k as usize - 1].triangles.clone();
        // The last block's x+ follows its x-, where it has one.
        let first = before.start + if k == 1 { 2 } else { 0 };
        scene.mesh.shared.extend([(first, 6 + k), (first + 1, 6 + k)]);
    }
    let s = run(&Arc::new(scene), &params(0.1, 0.01));
    assert!(
        s.clusters.len() > 1 && s.clusters.iter().map(|c| c.surfaces.len()).sum::<usize>() == 6 + 5 * (n as usize - 1)
    );
    for c in &s.clusters {
        assert_eq!(c.residual.hit_share, 1.0);
        let off = 2.0 * c.equivalent_box.half - c.bounds.size();
        assert!(
            off.abs().max_element() < 1e-5 && (c.equivalent_box.centre - c.bounds.centre()).length() < 1e-5,
            "{off}"
        );
    }
}

#[test]
fn flat_clusters_become_thin_boxes() {
    let scraps: Vec<_> = (0..100)
        .flat_map(|k| {
            let at = Vec3::new(0.4 + 0.011 * (k % 10) as f32, 0.5, 0.4 + 0.011 * (k / 10) as f32);
            quad(at, Vec3::X * 0.01, Vec3::Z * 0.01)
        })
        .collect();
    let scene = Arc::new(room(1, 0.5).grey(0.5, &scraps).build());
    for box_fit in [BoxFit::Flux, BoxFit::Paper1993] {
        let s = run(&scene, &SimplifyParams { box_fit, ..params(0.3, 5e-4) });
        assert_eq!(s.clusters.len(), 1);
        let [x, y, z] = (2.0 * s.clusters[0].equivalent_box.half).to_array();
        assert!(y > 0.0 && y < 0.01 * x.min(z).max(0.02), "{x} {y} {z}");
        assert!(s.geometry.positions.iter().all(|p| p.is_finite()));
        if box_fit == BoxFit::Flux {
            // Both sides of the scraps, 1 % of which the thickness may add.
            assert!((x * z / 0.01 - 1.0).abs() < 0.05, "{x} {z}");
        } else {
            assert!(s.warnings.iter().any(|w| w.contains("vanished")), "{:?}", s.warnings);
        }
    }
}

#[test]
fn narrow_strips_are_dropped_and_wide_ones_stay() {
    // Both have less area than A_thresh = 0.04, are longer than r_thresh and stand on the floor.
    let with = |width: f32| {
        let strip = quad(Vec3::new(0.1, 0.0, 0.5), Vec3::X * 0.8, Vec3::Y * width);
        let s = run(&Arc::new(room(1, 0.5).grey(0.5, &strip).build()), &params(0.2, PAPER_BETA));
        s.surfaces[6].class
    };
    assert_eq!((with(0.015), with(0.045)), (Class::Complex { cluster: None }, Class::Normal));
}

#[test]
fn exported_files_can_be_read_again() {
    let scene = Arc::new(room(2, 0.5).grey(0.25, &leaves(300, 0.01, Vec3::splat(0.3), Vec3::splat(0.6), 5)).build());
    let s = run(&scene, &params(0.3, 1e-3));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("simplified.glb");
    let mut bytes = Vec::new();
    export::write(&scene, &s, None, &mut bytes).unwrap();
    assert_eq!(bytes.len() % 4, 0);
    std::fs::write(&path, bytes).unwrap();
    let read = crate::scene::load(&path, &crate::scene::LoadOptions::default()).unwrap();
    let patches: usize =
        s.clusters.iter().map(|c| c.equivalent_box.reflectance.iter().map(Vec::len).sum::<usize>()).sum();
    assert_eq!(read.mesh.triangles.len(), 48 + 2 * patches);
    let area = |scene: &Scene| (0..scene.mesh.triangles.len() as u32).map(|t| scene.mesh.area(t)).sum::<f64>();
    let boxes: f64 = s.clusters.iter().map(|c| 2.0 * fit::half_surface(2.0 * c.equivalent_box.half)).sum();
    assert!((area(&read) / (6.0 + boxes) - 1.0).abs() < 1e-4);
    // Each patch faces outward and has its reflectance.
    let of_boxes = read.mesh.objects.iter().filter(|o| o.name.starts_with("cluster"));
    let mut colours = of_boxes.flat_map(|o| o.triangles.clone()).map(|t| read.base_color(t, 0.3, 0.3));
    assert!(colours.all(|c| c.max_element() <= 0.25 + 1e-5 && c.min_element() > 0.1));
}

#[test]
fn report_has_a_row_for_each_cluster() {
    let scene = Arc::new(room(1, 0.5).grey(0.5, &leaves(300, 0.01, Vec3::splat(0.3), Vec3::splat(0.6), 5)).build());
    let s = run(&scene, &params(0.3, 1e-3));
    let rows = report::rows(&s);
    assert!(!rows.is_empty() && rows.len() == s.clusters.len());
    let mut csv = Vec::new();
    report::write_csv(&rows, &mut csv).unwrap();
    let text = String::from_utf8(csv).unwrap();
    let columns = |line: &str| line.split(',').count();
    let header = text.lines().next().unwrap();
    assert_eq!(text.lines().count(), rows.len() + 1);
    assert!(text.lines().all(|l| columns(l) == columns(header)) && columns(header) == 21);
    let mut json = Vec::new();
    report::write_json(&rows, &mut json).unwrap();
    let read: Vec<serde_json::Value> = serde_json::from_slice(&json).unwrap();
    assert_eq!(read.len(), rows.len());
    assert!(
        read.iter().zip(&rows).all(|(json, row)| json["surfaces"] == row.surfaces && json["edges"][2] == row.edges[2])
    );
}
