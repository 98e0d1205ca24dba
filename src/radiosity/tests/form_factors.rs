//! Form factors between two patches as one shot of the solver finds them: how fast their error falls. Their values are checked
//! by the reference cases (`tests/cases`).

use glam::Vec3;

use super::*;
use crate::radiosity::shoot::Shot;

/// Share of the flux that leaves the front of the first surface and arrives on the front of the second, with `rays` rays.
fn form_factor(room: &Room, rays: u32, seed: u32) -> f64 {
    let patches = Patches::new(&room.geometry, &[], &RadiosityParams::new(1e9)).unwrap();
    let optics = Optics::new(&room.input(), &patches).unwrap();
    let tracer = Tracer { input: &room.input(), patches: &patches, optics: &optics };
    let mut arrived = Arrived::new(vec![DVec3::ZERO; 2 * patches.len()], Whereabouts::default(), 0, 0);
    let flux = DVec3::splat(1.0 / f64::from(rays));
    tracer.shoot(&[Shot { side: 0, rays, flux, stream: seed, from: None }], &mut arrived);
    let incident = arrived.flux;
    assert_eq!(incident[0].x + incident[1].x, 0.0, "a ray met its own plane");
    let second = room.scene.mesh.objects[1].triangles.start;
    let patch = patches.map.at(second, 0.3, 0.3) as usize;
    assert_eq!(incident[2 * patch + 1].x, 0.0, "a ray came from behind");
    incident[2 * patch].x
}

fn room(surfaces: &[[Vec3; 4]]) -> Room {
    Room::new(surfaces.iter().map(|&q| (diced(q, 1), material(0.5, 0.0))).collect(), Vec::new())
}

/// Unit square in the plane at `z`, facing up or down.
fn level(z: f32, up: bool) -> [Vec3; 4] {
    let p = Vec3::new;
    let q = [p(0., 0., z), p(1., 0., z), p(1., 1., z), p(0., 1., z)];
    if up { q } else { [q[0], q[3], q[2], q[1]] }
}

/// Low-discrepancy rays: the error falls faster than that of independent rays (FF-041).
#[test]
fn ff_041_error_against_rays() {
    let r = room(&[level(0.0, true), level(1.0, false)]);
    let f = 0.19982489569838738;
    let rms: Vec<f64> = [1000_u32, 10_000, 100_000]
        .into_iter()
        .map(|rays| {
            let square: f64 = (0..32).map(|seed| (form_factor(&r, rays, 100 + seed) - f).powi(2)).sum();
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
