//! Form factors between two patches as one shot of the solver finds them.

use glam::Vec3;

use super::*;
use crate::radiosity::shoot::Shot;

/// Share of the flux that leaves the front of the first surface and arrives on the front and back of the second, with `rays` rays.
fn form_factor(room: &Room, rays: u32, seed: u32) -> [f64; 2] {
    let patches = Patches::new(&room.geometry, &[], &RadiosityParams::new(1e9)).unwrap();
    let optics = Optics::new(&room.input(), &patches).unwrap();
    let tracer = Tracer { input: &room.input(), patches: &patches, optics: &optics };
    let mut incident = vec![DVec3::ZERO; 2 * patches.len()];
    let flux = DVec3::splat(1.0 / f64::from(rays));
    tracer.shoot(&[Shot { side: 0, rays, flux, stream: seed }], &mut incident);
    assert_eq!(incident[0].x + incident[1].x, 0.0, "a ray met its own plane");
    let second = room.scene.mesh.objects[1].triangles.start;
    let patch = patches.map.at(second, 0.3, 0.3) as usize;
    [incident[2 * patch].x, incident[2 * patch + 1].x]
}

fn room(surfaces: &[[Vec3; 4]]) -> Room {
    Room::new(surfaces.iter().map(|&q| (diced(q, 1), material(0.5, 0.0))).collect(), Vec::new())
}

fn check(name: &str, room: &Room, rays: u32, expected: f64, tolerance: f64) {
    let [front, back] = form_factor(room, rays, 3);
    println!("{name}: {front:.8}, expected {expected:.8}, off {:.1e} of {tolerance:.1e}", (front - expected).abs());
    assert!((front - expected).abs() <= tolerance, "{name}: {front} instead of {expected}");
    assert_eq!(back, 0.0);
}

/// Rectangle in the plane at `z`, facing up or down.
fn level(x: [f32; 2], y: [f32; 2], z: f32, up: bool) -> [Vec3; 4] {
    let p = Vec3::new;
    let q = [p(x[0], y[0], z), p(x[1], y[0], z), p(x[1], y[1], z), p(x[0], y[1], z)];
    if up { q } else { [q[0], q[3], q[2], q[1]] }
}

/// Rectangle in the plane x = 0, facing +x.
fn upright(y: [f32; 2], z: [f32; 2]) -> [Vec3; 4] {
    let p = Vec3::new;
    [p(0.0, y[0], z[0]), p(0.0, y[1], z[0]), p(0.0, y[1], z[1]), p(0.0, y[0], z[1])]
}

/// Unit square hinged to [`level`]`([0, 1], [0, 1], 0)` along x = 0, facing it.
fn hinged(degrees: f64) -> [Vec3; 4] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (x, z) = (cos as f32, sin as f32);
    let p = Vec3::new;
    [p(0.0, 0.0, 0.0), p(0.0, 1.0, 0.0), p(x, 1.0, z), p(x, 0.0, z)]
}

const U: [f32; 2] = [0.0, 1.0];
const MILLION: u32 = 1_000_000;

#[test]
fn ff_parallel() {
    let gap = |z: f32| room(&[level(U, U, 0.0, true), level(U, U, z, false)]);
    check("FF-001", &gap(1.0), MILLION, 0.19982489569838738, 0.0016);
    check("FF-003", &gap(1.0 / 1024.0), MILLION, 0.99805226040458, 0.000177);
    check("FF-004", &gap(1.0 / 1_048_576.0), MILLION, 0.9999980926605164, 6.52e-6);
    check("FF-006", &gap(128.0), 10 * MILLION, 1.9427303149003667e-5, 6.58e-6);
    let wide = [0.0, 2.0];
    let r = room(&[level(wide, U, 0.0, true), level(wide, U, 0.5, false)]);
    check("FF-002", &r, MILLION, 0.5089886690414376, 0.002);
    let long = [0.0, 1024.0];
    let r = room(&[level(long, U, 0.0, true), level(long, U, 1.0, false)]);
    check("FF-005", &r, MILLION, 0.41394074567518546, 0.00197);
    let r = room(&[level(U, U, 0.0, true), level([2.0, 3.0], [1.0, 2.5], 0.7, false)]);
    check("FF-010", &r, MILLION, 0.008091946713705955, 0.000359);
    let r = room(&[level(U, [0.0, 1.0 / 1_048_576.0], 0.0, true), level(U, U, 1.0, false)]);
    check("HARD-004", &r, MILLION, 0.16559490416544012, 0.00149);
}

#[test]
fn ff_perpendicular_and_inclined() {
    let depth = |w: f32| room(&[level([0.0, w], U, 0.0, true), upright(U, U)]);
    check("FF-007", &depth(1.0), MILLION, 0.20004377607540316, 0.0016);
    check("FF-008", &depth(1.0 / 1024.0), MILLION, 0.49862133642753015, 0.002);
    let r = room(&[level(U, U, 0.0, true), upright([1.0, 2.0], U)]);
    check("FF-013", &r, MILLION, 0.04059223010155854, 0.00079);
    for (name, degrees, rays, expected, tolerance) in [
        ("FF-014", 120.0, MILLION, 0.08661500111827605, 0.00113),
        ("FF-015", 60.0, MILLION, 0.3709053211500514, 0.00193),
        ("FF-016", 10.0, MILLION, 0.8496061249628472, 0.00143),
        ("FF-017", 179.9, 10 * MILLION, 2.3608665446788676e-7, 1.61e-6),
    ] {
        check(name, &room(&[level(U, U, 0.0, true), hinged(degrees)]), rays, expected, tolerance);
    }
}

#[test]
fn ff_occluded() {
    let middle = [0.25, 0.75];
    for (name, z, expected, tolerance) in
        [("FF-033", 0.25, 0.11562060213241492, 0.00128), ("FF-034", 0.5, 0.09950629459898475, 0.0012)]
    {
        let r = room(&[level(U, U, 0.0, true), level(U, U, 1.0, false), level(middle, middle, z, true)]);
        check(name, &r, MILLION, expected, tolerance);
    }
}

#[test]
fn ff_038_exact_zeros() {
    let coplanar = room(&[level(U, U, 0.0, true), level([2.0, 3.0], U, 0.0, true)]);
    assert_eq!(form_factor(&coplanar, MILLION, 1), [0.0, 0.0]);
    let turned = room(&[level(U, U, 0.0, true), level(U, U, 1.0, true)]);
    assert_eq!(form_factor(&turned, MILLION, 1)[0], 0.0);
    let wide = [-2.0, 2.0];
    let hidden = room(&[level(U, U, 0.0, true), level(U, U, 1.0, false), level(wide, wide, 0.5, true)]);
    assert_eq!(form_factor(&hidden, MILLION, 1), [0.0, 0.0]);
}

/// Low-discrepancy rays: the error falls faster than that of independent rays (FF-041).
#[test]
fn ff_041_error_against_rays() {
    let r = room(&[level(U, U, 0.0, true), level(U, U, 1.0, false)]);
    let f = 0.19982489569838738;
    let rms: Vec<f64> = [1000_u32, 10_000, 100_000]
        .into_iter()
        .map(|rays| {
            let square: f64 = (0..32).map(|seed| (form_factor(&r, rays, 100 + seed)[0] - f).powi(2)).sum();
            let rms = (square / 32.0).sqrt();
            let binomial = (f * (1.0 - f) / f64::from(rays)).sqrt();
            println!("{rays} rays: rms {rms:.2e}, independent rays {binomial:.2e}");
            assert!(rms < binomial);
            rms
        })
        .collect();
    println!("slope {:.2}", (rms[2] / rms[0]).log10() / 2.0);
    // Each rms of 32 squares is known to 12.5 %; the slope -1/2 of independent rays would show as less than -0.6 only beyond
    // three standard errors.
    assert!((rms[2] / rms[0]).log10() / 2.0 < -0.6);
}
