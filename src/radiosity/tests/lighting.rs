//! Light sources without area and gathered direct light.

use std::f32::consts::PI;

use glam::{DVec3, Vec2, Vec3};

use super::*;
use crate::backend::Hit;
use crate::scene::LightKind;
use crate::shading::{Bsdf, Lobes, SurfacePoint};

fn light(intensity: f32, kind: LightKind) -> PunctualLight {
    PunctualLight { name: "light".to_owned(), intensity: Vec3::splat(intensity), kind }
}

#[test]
fn hard_007_no_light() {
    let room = closed_box([5.0, 4.0, 2.75], [0.5; 6], [0.0; 6]);
    for direct in [DirectLight::Gather, DirectLight::Shoot] {
        let solution = room.solve(&RadiosityParams { direct, ..RadiosityParams::new(0.25) }).unwrap();
        assert_eq!((solution.shots, solution.rays, solution.error), (0, 0, 0.0));
        assert_eq!(solution.ledger, Ledger::default());
        assert_eq!(room.surface(&solution, 2).1, DVec3::ZERO);
    }
}

#[test]
fn hard_009_open_scene() {
    let p = Vec3::new;
    let square = [p(0., 0., 0.), p(1., 0., 0.), p(1., 1., 0.), p(0., 1., 0.)];
    let sun = light(1.0, LightKind::Directional { direction: -Vec3::Z });
    let room = Room::new(vec![(diced(square, 1), material(0.5, 0.0))], vec![sun]);
    for direct in [DirectLight::Gather, DirectLight::Shoot] {
        let params = RadiosityParams { direct, error: 1e-3, unshot: 1e-4, ..RadiosityParams::new(0.5) };
        let solution = room.solve(&params).unwrap();
        let (b, ledger) = (room.surface(&solution, 0).1.x, solution.ledger);
        // Shot light meets each of four patches with a share of the rays, gathered light is exact.
        assert_close("B", b, 0.5, if direct == DirectLight::Gather { 1e-3 } else { 4e-3 });
        let missed = if direct == DirectLight::Gather { 0.0 } else { ledger.emitted[0] - b / 0.5 };
        assert_close("escaped", ledger.escaped[0] - missed, b, 1e-3);
    }
}

#[test]
fn rad_015_area_mean_in_a_closed_room() {
    // Other reflectances are reference cases.
    let (rho, expected) = (0.5, 104.166667);
    for direct in [DirectLight::Gather, DirectLight::Shoot] {
        let lamp = light(10_000.0 / (4.0 * PI), LightKind::Point { position: Vec3::splat(2.0) });
        let surfaces = box_faces([4.0; 3]).map(|face| (diced(face, 1), material(rho, 0.0)));
        let room = Room::new(surfaces.into(), vec![lamp]);
        let params = RadiosityParams { direct, error: 5e-3, unshot: 1e-3, seed: 2, ..RadiosityParams::new(0.5) };
        let solution = room.solve(&params).unwrap();
        let emitted = solution.ledger.emitted[0];
        // B = rho (direct + indirect); the indirect part follows from the direct without further noise.
        let indirect = mean_over_patches(&solution) / f64::from(rho) - emitted / 96.0;
        assert_close(&format!("{direct:?}"), indirect, expected * emitted / 10_000.0, 1e-5);
        assert_close("emitted", solution.ledger.emitted[0], 10_000.0, 3e-3);
    }
}

#[test]
fn gathered_and_shot_light_agree() {
    let room = closed_box([1.0; 3], [0.7, 0.1, 0.5, 0.3, 0.2, 0.8], [0.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    let solve = |direct| {
        let params = RadiosityParams { direct, patch_size: 0.25, error: 5e-3, ..one_patch() };
        room.solve(&params).unwrap()
    };
    let (shot, gathered) = (solve(DirectLight::Shoot), solve(DirectLight::Gather));
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
    for t in 0..12 {
        for (u, v) in [(0.1, 0.1), (0.7, 0.2), (0.15, 0.6), (0.4, 0.35)] {
            let [a, b] = [&shot, &gathered].map(|s| f64::from(s.radiosity(t, u, v, true).x));
            sum += (a / b - 1.0).powi(2);
            worst = worst.max((a / b - 1.0).abs());
            count += 1;
        }
    }
    let rms = f64::sqrt(sum / f64::from(count));
    println!("rms {rms:.1e}, worst {worst:.1e}");
    // Both have a mean relative error of at most 5e-3; patches that get little light have more.
    assert!(rms < 0.02);
}

/// A bright point.
pub(super) fn point_light(position: Vec3) -> PunctualLight {
    light(1e4, LightKind::Point { position })
}

/// A square floor around the origin, one unit wide, under walls that hide what they hide from it.
pub(super) fn floor_under(walls: &[[Vec3; 4]], lamps: &[Vec3]) -> Room {
    let p = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let floor = [p(-0.5, -0.5), p(0.5, -0.5), p(0.5, 0.5), p(-0.5, 0.5)];
    let surfaces = std::iter::once(&floor).chain(walls).map(|square| (diced(*square, 1), material(0.5, 0.0)));
    let lamps = lamps.iter().copied().map(point_light).collect();
    Room::new(surfaces.collect(), lamps)
}

/// Patches of the floor whose direct light is found to be uneven, and all.
fn uneven_patches(room: &Room, patch_size: f32, seed: u32) -> (usize, usize) {
    let input = room.input();
    let patches = Patches::new(&room.geometry, &[], &RadiosityParams::new(patch_size)).unwrap();
    let found = crate::radiosity::direct::gather(&input, &patches, true, seed, 0.075);
    let floor: Vec<usize> = (0..patches.len()).filter(|&p| patches.triangle(p as u32) < 2).collect();
    (floor.iter().filter(|&p| found.uneven[2 * p].is_some()).count(), floor.len())
}

/// One of two lamps is hidden, so a sample of light brings twice the irradiance or nothing: a relative standard deviation of 1, but every point has
/// the same irradiance to 6 %.
#[test]
fn noise_of_light_samples_is_no_unevenness() {
    let p = Vec3::new;
    let wall = [p(-20., 6., 0.5), p(20., 6., 0.5), p(20., 6., 20.), p(-20., 6., 20.)];
    let room = floor_under(&[wall], &[p(0., -10., 10.), p(0., 10., 10.)]);
    let (uneven, all) = uneven_patches(&room, 0.0625, 1);
    println!("{uneven} of {all}");
    // Of 32 pairs of independent samples, both meet the open lamp in 8 +- 1.4, and 11 are needed: 4 % of 256 patches, 10 +- 3.2, and four of these
    // more. Samples that are strata of one sequence differ less.
    assert!(all == 256 && uneven <= 23, "{uneven} of {all}");
}

/// A sixteenth of the floor is lit: a relative standard deviation of 3.9, and no sample of light varies by itself.
#[test]
fn a_strip_of_light_is_uneven() {
    let p = Vec3::new;
    let plate = [p(-0.4375, -1., 0.5), p(1., -1., 0.5), p(1., 1., 0.5), p(-0.4375, 1., 0.5)];
    let room = floor_under(&[plate], &[p(0.0, 0.0, 1e4)]);
    let found: usize = (0..64).map(|seed| uneven_patches(&room, 2.0, seed).0).sum();
    println!("{found} of 64");
    // The pilot may miss it with all of its 8 and then 16 samples, and the pairs with their 32 points. Independent points would see it with a
    // probability of 0.69, in 44 +- 3.7 cases (less four of these: 3e-5); strata only help.
    assert!(found >= 29, "{found} of 64");
}

#[test]
fn same_result_with_any_number_of_threads() {
    let room = closed_box([3.0, 2.0, 2.5], [0.7, 0.1, 0.5, 0.3, 0.2, 0.8], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    for direct in [DirectLight::Gather, DirectLight::Shoot] {
        let params = RadiosityParams { direct, error: 0.05, ..RadiosityParams::new(0.3) };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let s = pool.install(|| room.solve(&params)).unwrap();
            let of_patch: Vec<_> = s.of_patch.iter().map(|p| (p.radiosity, p.deviation)).collect();
            (of_patch, s.ledger, s.rays, s.shots)
        };
        let one = run(1);
        assert!(one == run(2) && one == run(5));
    }
}

/// A lamp shines along a floor that is metal or under a coat, and at nothing else: of its light, as much arrives at the wall behind as an integral
/// over floor and directions says, and much more than even reflection would bring.
#[test]
fn rough_reflection_leaves_in_its_direction() {
    let p = Vec3::new;
    let square = [p(-0.5, -0.5, 0.), p(0.5, -0.5, 0.), p(0.5, 0.5, 0.), p(-0.5, 0.5, 0.)];
    let wall = [p(2., -2., 0.), p(2., -2., 2.), p(2., 2., 2.), p(2., 2., 0.)];
    let meets_wall = |from: Vec3, direction: Vec3| {
        let at = from + direction * ((2.0 - from.x) / direction.x);
        direction.x > 0.0 && at.y.abs() < 2.0 && (0.0..2.0).contains(&at.z)
    };
    let position = p(-3.0, 0.0, 0.6);
    // Hides the wall, and nothing of the floor.
    let plate = [p(-1., -4., 0.3), p(-1., -4., 2.), p(-1., 4., 2.), p(-1., 4., 0.3)];
    let coat = Material { base_color: Vec3::splat(0.5), metallic: 0.0, ..Material::default() };
    for (floor, above) in [
        (Material { base_color: p(0.9, 0.6, 0.3), roughness: 0.4, ..Material::default() }, 4.0),
        (Material { roughness: 0.3, ..coat }, 1.5),
    ] {
        // The others reflect a hundredth, of which the floor returns less than a thousandth part of what is measured.
        let surfaces = vec![
            (diced(square, 1), floor),
            (diced(wall, 1), material(0.01, 0.0)),
            (diced(plate, 1), material(0.01, 0.0)),
        ];
        let room = Room::new(surfaces, vec![light(1.0, LightKind::Point { position })]);
        let (mut exact, mut even) = (DVec3::ZERO, 0.0);
        let points = 1 << 17;
        for i in 0..points {
            let ([u, v, a, b], [c, which, ..]) = (sampling::sobol(i, 0, 1), sampling::sobol(i, 1, 1));
            let corner = u + v > 1.0;
            let hit = Hit {
                t: 0.0,
                u: if corner { 1.0 - u } else { u },
                v: if corner { 1.0 - v } else { v },
                triangle: u32::from(which < 0.5),
            };
            let point = SurfacePoint::new(&room.scene, &hit);
            let to_lamp = position - point.position;
            let irradiance = f64::from(to_lamp.normalize().z / to_lamp.length_squared());
            let bsdf = Bsdf::new(&room.scene, &point, to_lamp.normalize(), Lobes::MIRRORS);
            let sample = bsdf.sample_low([c, a, b]).filter(|s| meets_wall(point.position, s.direction));
            exact += irradiance * sample.map_or(Vec3::ZERO, |s| s.weight).as_dvec3();
            let evenly = sampling::cosine_hemisphere(Vec2::new(a, b));
            even +=
                if meets_wall(point.position, evenly) { irradiance * f64::from(bsdf.mean_albedo_low().x) } else { 0.0 };
        }
        let (exact, even) = (exact / f64::from(points), even / f64::from(points));
        let seeds = 16;
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for seed in 0..seeds {
            // Most light goes to the plate, hence the low limit of what may stay unshot.
            let params = RadiosityParams { unshot: 1e-6, error: 0.02, seed, ..RadiosityParams::new(10.0) };
            let (area, radiosity) = room.surface(&room.solve(&params).unwrap(), 1);
            let arrived = area * radiosity / 0.01;
            sum += arrived;
            squares += arrived * arrived;
        }
        let n = f64::from(seeds);
        let mean = sum / n;
        let error = ((squares / n - mean * mean) / (n - 1.0)).max(DVec3::ZERO).map(f64::sqrt);
        println!("{mean} +- {error}, exact {exact}, even reflection {even}");
        // Three tests of each floor at four standard errors: 4e-4 in all, and the integral's own error.
        assert!((mean - exact).abs().cmple(4.0 * error + 0.003 * exact).all(), "{mean} +- {error} {exact}");
        assert!(error.cmplt(0.02 * exact).all() && exact.x > above * even, "{error} {exact} {even}");
    }
}

/// Light from straight above passes a coat more easily than light from everywhere: so much more is reflected diffusely, and looked up.
#[test]
fn what_is_looked_up_under_a_coat_knows_where_light_came_from() {
    let floor = Material { base_color: Vec3::splat(0.5), metallic: 0.0, roughness: 0.3, ..Material::default() };
    let square = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let height = 100.0;
    let kind = LightKind::Point { position: Vec3::new(0.0, 0.0, height) };
    let room = Room::new(vec![(diced(square, 1), floor)], vec![light(height * height, kind)]);
    let point = SurfacePoint::new(&room.scene, &Hit { t: 0.0, u: 0.3, v: 0.3, triangle: 0 });
    let bsdf = Bsdf::new(&room.scene, &point, Vec3::Z, Lobes::MIRRORS);
    let over_mean = bsdf.albedo_diffuse().x / bsdf.mean_albedo_diffuse().x;
    // An irradiance of one.
    let expected = bsdf.mean_albedo_low().x * over_mean;
    let found = room.solve(&RadiosityParams::new(0.5)).unwrap().look_up(0, 0.3, 0.3, true).0.x;
    println!("{found}, expected {expected}, {over_mean} times the mean");
    // Cosines and distances differ by less than 5e-5 over the floor.
    assert!((found / expected - 1.0).abs() < 2e-4 && over_mean > 1.02, "{found} {expected} {over_mean}");
}
