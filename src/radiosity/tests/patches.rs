//! How geometry is cut into patches.

use glam::{Quat, Vec3};

use super::*;
use crate::backend::{Coherence, Ray, Visible};

fn cut(room: &Room, size: f64) -> Patches {
    Patches::new(&room.geometry, &[], &RadiosityParams::new(size as f32)).unwrap()
}

#[test]
fn hard_012_patches_do_not_depend_on_the_tessellation() {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    let wall = box_faces([3.0, 2.0, 1.0])[4].map(|p| turn * p);
    let plain = cut(&Room::new(vec![(diced(wall, 1), material(0.5, 0.0))], Vec::new()), 0.25);
    let fine = cut(&Room::new(vec![(diced(wall, 100), material(0.5, 0.0))], Vec::new()), 0.25);
    for patches in [&plain, &fine] {
        assert_eq!(patches.len(), 12 * 8);
        for &area in &patches.area {
            assert!((area - 0.0625).abs() < 1e-6, "{area}");
        }
    }
}

#[test]
fn areas_add_up_and_points_lie_on_their_patch() {
    // A bent strip, a sliver, a lone triangle far away.
    let p = Vec3::new;
    let strip: Vec<[Vec3; 3]> = (0..40)
        .flat_map(|i| {
            let at = |i: i32, z: f32| {
                let (sin, cos) = (0.05 * i as f32).sin_cos();
                p(3.0 * cos, 3.0 * sin, z)
            };
            [[at(i, 0.0), at(i + 1, 0.0), at(i + 1, 1.0)], [at(i, 0.0), at(i + 1, 1.0), at(i, 1.0)]]
        })
        .collect();
    let sliver = vec![[p(0., 0., 0.), p(1., 0., 0.), p(0.5, 1e-6, 0.)]];
    let far = vec![[p(1e4, 1e4, 0.), p(1e4 + 0.3, 1e4, 0.), p(1e4, 1e4 + 0.2, 0.1)]];
    let room = Room::new([strip, sliver, far].map(|t| (t, material(0.5, 0.0))).into(), Vec::new());
    let patches = cut(&room, 0.2);
    let total: f64 = (0..room.geometry.triangles.len() as u32).map(|t| room.scene.mesh.area(t)).sum();
    assert_close("area", patches.area.iter().sum(), total, 1e-9);
    // 6 m along the arc and 1 m up in cells of 0.2; charts of 60 degrees cost a few more, joined edge cells some less.
    assert!((120..240).contains(&patches.len()), "{}", patches.len());
    let mut elsewhere = 0;
    for patch in 0..patches.len() as u32 {
        for i in 0..64 {
            let s = sampling::sobol(i, 0, patch);
            let (t, uv) = patches.sample(patch, [s[0], s[1]]);
            elsewhere += u32::from(patches.map.at(t, uv.x, uv.y) != patch);
        }
    }
    // Only points that rounding takes over a cell's edge.
    assert!(elsewhere <= 2, "{elsewhere} points of {} lie on another patch", 64 * patches.len());
}

#[test]
fn nothing_that_covers_a_patch_is_overlooked() {
    const REACH: f32 = 0.1;
    let oblique = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    for turn in [Quat::IDENTITY, oblique] {
        // A room with a board just above the floor, one against a wall, and a leaning one that touches the floor with an edge.
        let boards = [
            ([0.5, 0.4, 0.02], Vec3::new(0.3, 0.35, 0.004), Quat::IDENTITY),
            ([0.02, 0.7, 0.5], Vec3::new(1.975, 0.2, 0.6), Quat::IDENTITY),
            ([0.02, 0.3, 0.6], Vec3::new(1.0, 1.2, 0.0), Quat::from_rotation_y(0.4)),
        ];
        let mut faces: Vec<[Vec3; 4]> = box_faces([2.0; 3]).into();
        for (size, at, lean) in boards {
            faces.extend(box_faces(size).map(|face| face.map(|p| at + lean * p)));
        }
        let surface = |face: [Vec3; 4]| (diced(face.map(|p| turn * p), 2), material(0.5, 0.0));
        let room = Room::new(faces.into_iter().map(surface).collect(), Vec::new());
        let patches = cut(&room, 0.2);
        let may_be_covered = crate::radiosity::patches::neighbours::may_be_covered(&room.geometry, &patches, REACH);
        let (mut covered, mut open) = (0, 0);
        for side in 0..2 * patches.len() as u32 {
            let rays = (0..64).map(|i| {
                let s = sampling::sobol(i, 0, side);
                let point = patches.point(&room.geometry, side / 2, [s[0], s[1]]);
                let normal = shoot::side_normal(&point, side);
                let t_far = REACH * patches.diameter[side as usize / 2];
                Ray { t_far, ..Ray::new(point.ray_origin(normal), normal) }
            });
            let mut met = [false; 64];
            room.rays.occluded(&rays.collect::<Vec<_>>(), Visible::All, Coherence::Incoherent, &mut met);
            let may = may_be_covered[side as usize / 2][side as usize % 2];
            assert!(may || met == [false; 64], "side {side}");
            covered += u32::from(met != [false; 64]);
            open += u32::from(!may);
        }
        assert!(covered > 40 && open > patches.len() as u32, "{covered} sides are covered, {open} are told to be open");
    }
}

#[test]
fn number_of_patches_is_bounded() {
    let room = closed_box([1.0; 3], [0.5; 6], [0.0; 6]);
    let params = RadiosityParams { max_patches: 1000, ..RadiosityParams::new(1e-4) };
    let patches = Patches::new(&room.geometry, &[], &params).unwrap();
    assert!((500..=1000).contains(&patches.len()), "{}", patches.len());
    assert!(patches.size > 1e-4);
}

#[test]
fn rounded_edge_is_no_patch_of_its_own() {
    // A board's top and side, with four strips between them that turn by 22.5 degrees from one to the next.
    let (top, side, radius) = (0.99, 0.49, 0.004);
    let mut profile = vec![Vec3::ZERO];
    profile.extend((0..=4).map(|i| {
        let (sin, cos) = (0.25 * i as f32 * std::f32::consts::FRAC_PI_2).sin_cos();
        Vec3::new(top + radius * sin, radius * (cos - 1.0), 0.0)
    }));
    profile.push(profile[5] - side * Vec3::Y);
    let quads = profile.windows(2).flat_map(|p| {
        let [a, b] = [p[0], p[1]];
        [[a, a + Vec3::Z, b + Vec3::Z], [a, b + Vec3::Z, b]]
    });
    let room = Room::new(vec![(quads.collect(), material(0.5, 0.0))], Vec::new());
    assert_eq!(room.geometry.surfaces, 1);
    let patches = cut(&room, 0.25);
    assert_eq!(patches.len(), 4 * 4 + 2 * 4);
    let total: f64 = (0..room.geometry.triangles.len() as u32).map(|t| room.scene.mesh.area(t)).sum();
    assert_close("area", patches.area.iter().sum(), total, 1e-9);
    // Against large patches all of it is small.
    assert_eq!(cut(&room, 10.0).len(), 1);
}

#[test]
fn each_surface_has_its_fewest_patches() {
    let room = closed_box([4.0, 3.0, 0.01], [0.5; 6], [0.0; 6]);
    // Faces of 4 x 3, and strips of 3 and 4 by a hundredth.
    for (least, faces, strips) in [(1, 1, 1), (2, 2, 2), (7, 8, 7), (12, 12, 12)] {
        let params = RadiosityParams { least_patches: least, ..RadiosityParams::new(10.0) };
        assert_eq!(Patches::new(&room.geometry, &[], &params).unwrap().len(), 2 * faces + 4 * strips, "{least}");
    }
    // Where patches of the size are more, the size decides.
    let params = RadiosityParams { least_patches: 7, ..RadiosityParams::new(0.5) };
    assert_eq!(Patches::new(&room.geometry, &[], &params).unwrap().len(), 2 * (8 * 6) + 2 * 7 + 2 * 8);
}

/// As many patches as the paper's N+C scene, which its authors could not finish.
#[test]
#[ignore = "takes a minute"]
fn seventy_five_thousand_patches() {
    let room = closed_box([5.0, 4.0, 2.75], [0.56; 6], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let solution = room.solve(&RadiosityParams { error: 0.02, ..RadiosityParams::new(0.0345) }).unwrap();
    assert!((70_000..80_000).contains(&solution.patches) && solution.error < 0.021);
    let solution = room.solve(&RadiosityParams { error: 0.02, ..RadiosityParams::new(0.15) }).unwrap();
    assert!(solution.error < 0.021);
}
