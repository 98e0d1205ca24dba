//! Light sources that shoot: all their light, or the part that mirrors and glass bend on its way.

use std::ops::Range;

use glam::DVec3;

use super::arrived::Arrived;
use super::ledger::Tally;
use super::shoot::{Deposit, Load, Photons, Shot, Tracer};
use crate::backend::{Hit, Ray};
use crate::lighting::{EmittedRay, Lights};
use crate::sampling;
use crate::scene::{Mesh, Scene};
use crate::shading::SurfacePoint;

/// Light that was shot from light sources.
pub(super) struct Emitted {
    /// Flux that set out.
    pub flux: DVec3,
    /// What became of it, besides arriving.
    pub tally: Tally,
    /// Number of shots.
    pub shots: u64,
}

/// Shoots all light: emitting patches as any patch, with exactly their flux, and what shines without area or from outside. Uses about `rays` rays.
pub(super) fn shoot_all(tracer: &Tracer<'_>, rays: u64, arrived: &mut Arrived, stream: u32) -> Emitted {
    let area = |side: u32| tracer.patches.open_area(side);
    let punctual = punctual(tracer.input.scene);
    let of_patches: DVec3 = tracer.optics.emission.iter().map(|&(side, exitance)| area(side) * exitance).sum();
    let of_lights = DVec3::from_array(punctual.flux());
    let total = of_patches + of_lights;
    let importance = |flux: DVec3| (0..3).filter(|&c| total[c] > 0.0).map(|c| flux[c] / total[c]).sum::<f64>();
    let density = rays as f64 / importance(total);

    let shots: Vec<Shot> = tracer
        .optics
        .emission
        .iter()
        .map(|&(side, exitance)| {
            let flux = area(side) * exitance;
            let rays = (importance(flux) * density).round().clamp(1.0, u32::MAX.into()) as u32;
            let stream = sampling::hash_all(&[stream, side]);
            Shot { side, rays, flux: flux / f64::from(rays), stream, from: None }
        })
        .collect();
    let mut tally = tracer.shoot(&shots, arrived);
    let mut flux = of_patches;
    if !punctual.is_empty() {
        let count = ((importance(of_lights) * density) as u64).max(1024);
        let photons = |range: Range<u64>, photons: &mut Photons| {
            emit(tracer.input.scene, &punctual, range, count, sampling::hash(stream), photons);
        };
        let of_lights = tracer.trace(count, &photons, Deposit::All, arrived);
        tally.add(&of_lights);
        // Colours of rays differ, so what set out is known only from what became of it.
        let all: DVec3 = arrived.flux.iter().sum();
        flux = all + tally.escaped + tally.lost - tally.passed_on;
    }
    Emitted { flux, tally, shots: shots.len() as u64 }
}

/// Shoots `count` rays from the light sources and keeps what a mirror or a refracting surface has bent: light that shadow rays
/// cannot find. It sets out a second time here: it was counted where it met the mirror or glass.
pub(super) fn shoot_bent(tracer: &Tracer<'_>, count: u64, arrived: &mut Arrived, stream: u32) -> Tally {
    let input = tracer.input;
    let photons = |range: Range<u64>, photons: &mut Photons| {
        emit(input.scene, input.lights, range, count, stream, photons);
    };
    tracer.trace(count, &photons, Deposit::Bent, arrived)
}

/// The lights of `scene` that have no area, and its environment.
fn punctual(scene: &Scene) -> Lights {
    let mesh = Mesh { bounds: scene.mesh.bounds, ..Mesh::default() };
    let environment = scene.environment.clone();
    Lights::new(&Scene { mesh, lights: scene.lights.clone(), environment, ..Scene::default() })
}

/// Photons `range` of `count` from `lights`.
fn emit(scene: &Scene, lights: &Lights, range: Range<u64>, count: u64, stream: u32, photons: &mut Photons) {
    for k in range {
        let (s, choice) = (sampling::sobol(k as u32, 0, stream), sampling::sobol(k as u32, 1, stream)[0]);
        let Some(emitted) = lights.sample_emission(scene, [choice, s[0], s[1], s[2], s[3]]) else {
            continue;
        };
        let flux = emitted.flux.as_dvec3() / count as f64;
        photons.push(off_surface(scene, &emitted), Load::new(flux, u64::from(stream) << 32 | k));
    }
}

/// The ray, moved off the emitting triangle.
fn off_surface(scene: &Scene, emitted: &EmittedRay) -> Ray {
    if emitted.triangle == Hit::NONE {
        return emitted.ray;
    }
    let on = Hit { t: 0.0, u: emitted.uv.x, v: emitted.uv.y, triangle: emitted.triangle };
    let origin = SurfacePoint::new(scene, &on).ray_origin(emitted.ray.direction);
    Ray { origin, ..emitted.ray }
}
