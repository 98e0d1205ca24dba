//! Light that changes over a patch.

use glam::DVec2;

use super::lighting::{floor_under, point_light};
use super::*;

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
    // 64 points, one in each of 8 x 8 cells, stand for the area. The standard deviation of their second moment is 3.1 % of it, and of their mean
    // 1/8/sqrt(12)/8 = 0.45 % of the patch's width, over which light changes by 0.7 of its mean; four of these, and the 1.2 % that the
    // covariance's least variance takes.
    let off = (found - slope).length();
    assert!(off < (4.0 * 0.031 + 0.012) * slope.length() + 4.0 * error.length(), "{found} {error} {slope}");
    assert!((of_mean / n - 1.0).abs() < 4.0 * 0.0045 * 0.7 * 2.0_f64.sqrt(), "{}", of_mean / n);
}

/// One side of even light in a hundred may have a slope by chance. Such a slope is noise: what is looked up at one and the same place of a side is its
/// radiosity on average over sides.
#[test]
fn slopes_of_even_light_are_noise() {
    let room = floor_under(&[], &[Vec3::new(0.0, 0.0, 1e4)]);
    // Four points in the corners of each of 4 x 4 patches.
    let points = floor_points(&room, 16);
    let corner = |p: DVec2| {
        let place = ((p + 0.5) * 4.0).fract().round().as_ivec2();
        let is_corner = ((p + 0.5) * 16.0).floor().as_ivec2().rem_euclid(glam::IVec2::splat(4));
        ([0, 3].contains(&is_corner.x) && [0, 3].contains(&is_corner.y)).then_some((2 * place.y + place.x) as usize)
    };
    let seeds = 64;
    let (mut sloping, mut sums, mut squares, mut count) = (0, [0.0; 4], [0.0; 4], 0);
    for seed in 0..seeds {
        let params = RadiosityParams { error: 0.15, seed, ..RadiosityParams::new(0.25) };
        let solution = room.solve(&params).unwrap();
        assert_eq!(solution.patches, 16);
        sloping += solution.slopes.len();
        count += solution.patches;
        for &(t, [u, v], p) in &points {
            let Some(corner) = corner(p) else { continue };
            let ratio = solution.look_up(t, u, v, true).0.x / solution.radiosity(t, u, v, true).x;
            assert!((0.0..=4.0).contains(&ratio));
            sums[corner] += f64::from(ratio);
            squares[corner] += f64::from(ratio * ratio);
        }
    }
    let n = count as f64;
    println!("slopes on {sloping} of {count}");
    // A hundredth, and four standard errors.
    assert!((sloping as f64) < 0.01 * n + 4.0 * (0.01 * n).sqrt(), "{sloping} of {count}");
    for (sum, square) in sums.into_iter().zip(squares) {
        let mean = sum / n;
        let error = ((square / n - mean * mean) / (n - 1.0)).sqrt();
        println!("{mean} +- {error}");
        // Four tests at four standard errors: 2.5e-4. The patch's own noise, 10 %, is common to both and cancels.
        assert!((mean - 1.0).abs() <= 4.0 * error && error < 0.02, "{mean} +- {error}");
    }
}
