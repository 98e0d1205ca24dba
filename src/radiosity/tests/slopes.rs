//! Light that changes over a patch.

use std::collections::HashMap;

use glam::{DVec2, Vec2};

use super::lighting::{floor_under, point_light};
use super::*;
use crate::radiosity::slope::Slope;

/// Points of the floor in the middle of so many by so many cells, each as a triangle, barycentrics and position.
fn floor_points(room: &Room, side: u32) -> Vec<(u32, [f32; 2], DVec2)> {
    let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(side) - 0.5;
    let points = (0..side * side).map(|k| DVec2::new(middle(k % side), middle(k / side)));
    let corner = |triangle: u32, k: usize| {
        let vertex = room.geometry.triangles[triangle as usize][k];
        room.geometry.positions[vertex as usize].truncate().as_dvec2()
    };
    let on = |p: DVec2| {
        (0..2).find_map(|triangle| {
            let [a, b, c] = [0, 1, 2].map(|k| corner(triangle, k));
            let at = glam::DMat2::from_cols(b - a, c - a).inverse() * (p - a);
            let inside = at.x >= 0.0 && at.y >= 0.0 && at.x + at.y <= 1.0;
            inside.then_some((triangle, [at.x as f32, at.y as f32], p))
        })
    };
    points.filter_map(on).collect()
}

/// The floor as one patch beside a lamp that is as high above it as it is wide: irradiance falls to a third from one edge to the other.
#[test]
fn light_that_falls_off_is_looked_up_as_its_linear_fit() {
    let lamp = Vec3::new(2.0, 0.5, 1.0);
    let room = floor_under(&[], &[lamp]);
    let points = floor_points(&room, 64);
    let exact = |p: DVec2| {
        let to = lamp.as_dvec3() - p.extend(0.0);
        0.5 * f64::from(point_light(lamp).intensity.x) * to.z / to.length().powi(3)
    };
    // The least squares' fit: coordinates of a square grid are independent of each other.
    let count = points.len() as f64;
    let mean = points.iter().map(|p| exact(p.2)).sum::<f64>() / count;
    let slope =
        points.iter().map(|p| p.2 * exact(p.2)).sum::<DVec2>() / points.iter().map(|p| p.2.x * p.2.x).sum::<f64>();
    let seeds = 32;
    let (mut sum, mut squares, mut of_mean) = (DVec2::ZERO, DVec2::ZERO, 0.0);
    for seed in 0..seeds {
        let params = RadiosityParams { error: 0.02, seed, ..RadiosityParams::new(2.0) };
        let solution = room.solve(&params).unwrap();
        assert_eq!(solution.patches, 1);
        let look_up = |p: &(u32, [f32; 2], DVec2)| f64::from(solution.look_up(p.0, p.1[0], p.1[1], true).0.x);
        let all = f64::from(solution.radiosity(0, 0.3, 0.3, true).x);
        let found =
            points.iter().map(|p| p.2 * look_up(p)).sum::<DVec2>() / points.iter().map(|p| p.2.x * p.2.x).sum::<f64>();
        let found = found / all * mean;
        sum += found;
        squares += found * found;
        of_mean += points.iter().map(look_up).sum::<f64>() / count / all;
    }
    let n = f64::from(seeds);
    let found = sum / n;
    let error = ((squares / n - found * found) / (n - 1.0)).max(DVec2::ZERO).map(f64::sqrt);
    println!("{found} +- {error}, exact {slope}, mean {}", of_mean / n);
    // The least variance takes 1.2 %, and shrinking the part 1 / z: the fit's relative variance, 0.08, times more than a thousand samples.
    let off = (found - slope).length();
    assert!(off < (0.012 + 1.0 / 80.0) * slope.length() + 4.0 * error.length(), "{found} {error} {slope}");
    // What is looked up is single precision, of 4096 points.
    assert!((of_mean / n - 1.0).abs() < 1e-5, "{}", of_mean / n);
}

/// The front of the floor under test cut into 4 x 4 patches, each with `RAYS` equal rays that arrive at independent points with a density that grows
/// as `1 + g (l - 1/2)`; and the slopes found.
fn slopes_by_chance(g: DVec2, seed: u32) -> Vec<Option<Slope>> {
    let room = floor_under(&[], &[]);
    let patches = Patches::new(&room.geometry, &[], &RadiosityParams::new(0.25)).unwrap();
    assert_eq!(patches.len(), 16);
    let mut moments = vec![Moments::default(); 2 * patches.len()];
    for side in (0..moments.len()).step_by(2) {
        let mut random = (0u32..).map(|k| sampling::unit(sampling::hash_all(&[seed, side as u32, k])));
        let mut arrived = 0;
        while arrived < RAYS {
            let [x, y, choice] = [0; 3].map(|_| random.next().unwrap());
            let local = Vec2::new(x, y);
            let most = 1.0 + 0.5 * (g.x.abs() + g.y.abs());
            if f64::from(choice) * most < 1.0 + g.dot(local.as_dvec2() - 0.5) {
                moments[side].add(1.0, local);
                arrived += 1;
            }
        }
    }
    let found: HashMap<u32, Slope> = slope::find(&patches, &moments, |_| false).into_iter().collect();
    (0..16).map(|patch| found.get(&(2 * patch)).copied()).collect()
}

const RAYS: u32 = 64;

/// What is looked up of evenly lit patches is their radiosity on average over patches, at each place, and differs from it by less than chance
/// makes of slopes that are shared and shrunk.
#[test]
fn slopes_of_even_light_are_small_noise() {
    let corners = [0.125, 0.875].map(|y| [0.125, 0.875].map(|x| Vec2::new(x, y))).concat();
    let (seeds, mut sums, mut squares, mut count) = (64, [0.0; 4], [0.0; 4], 0.0);
    for seed in 0..seeds {
        for slope in slopes_by_chance(DVec2::ZERO, seed) {
            count += 1.0;
            for (k, &corner) in corners.iter().enumerate() {
                let off = slope.map_or(0.0, |slope| f64::from(slope.at(corner)) - 1.0);
                sums[k] += off;
                squares[k] += off * off;
            }
        }
    }
    let mean_square = squares.iter().sum::<f64>() / 4.0 / count;
    println!("mean square {mean_square}, a patch's own noise {}", 1.0 / f64::from(RAYS));
    // With the weights of a side's own rays, 64, and of 3, 5 or 8 neighbours, 1 / (1/64 + 0.01) = 39, the relative variance of a slope over a
    // side is 4.1e-3, 2.7e-3 or 1.8e-3 in each dimension, 5.7e-3 in both on average over the patches. At 3/8 from the middle along both
    // axes a slope counts 12 * (3/8)^2 = 1.7 times that. Of a chi-square number z with two degrees of freedom, (1 - 1/z)^2 z, where it is
    // above 1, is 0.887 on average and not 2.
    let expected = 1.7 * 5.7e-3 * 0.887 / 2.0;
    assert!(mean_square < expected && mean_square > 0.1 * expected, "{mean_square} of {expected}");
    for (sum, square) in sums.into_iter().zip(squares) {
        let (mean, variance) = (sum / count, square / count);
        // Neighbours share slopes: at most nine patches are as one. Four tests at four standard errors: 2.5e-4.
        let error = (9.0 * variance / count).sqrt();
        println!("{mean} +- {error}");
        assert!(mean.abs() <= 4.0 * error && error < 0.01, "{mean} +- {error}");
    }
}

/// A slope is found as it is, but for what shrinking takes: at most one over z, which is here 181 |g|^2 / 12 = 12 in corners of the floor and
/// more elsewhere; and the 1.2 % that the least variance takes.
#[test]
fn a_slope_among_few_rays_is_found() {
    let g = DVec2::new(0.8, 0.4);
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..64 {
        for slope in slopes_by_chance(g, 1000 + seed) {
            let along = |x: f32, y: f32| slope.map_or(1.0, |slope| f64::from(slope.at(Vec2::new(x, y))));
            let found = DVec2::new(along(0.75, 0.5) - along(0.25, 0.5), along(0.5, 0.75) - along(0.5, 0.25)) * 2.0;
            let share = found.dot(g) / g.length_squared();
            sum += share;
            squares += share * share;
            count += 1.0;
        }
    }
    let mean = sum / count;
    let error = (9.0 * (squares / count - mean * mean) / count).sqrt();
    println!("{mean} +- {error} of the slope");
    assert!(
        mean > 1.0 - 1.0 / 12.0 - 0.012 - 4.0 * error && mean < 1.0 + 4.0 * error && error < 0.03,
        "{mean} +- {error}"
    );
}
