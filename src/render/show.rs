//! A radiosity solution shown directly: what the camera sees of patches, without any gather.

use std::time::Duration;

use glam::Vec3;
use rayon::prelude::*;

use super::tally::{PassTimes, RayCounts};
use super::view::ViewRays;
use super::world::{FarField, World};
use super::{RenderParams, Rendering};
use crate::backend::{Coherence, Hit, Ray, Visible};
use crate::clock::Stopwatch;
use crate::scene::Camera;
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use crate::simplify::TriangleSource;

/// Renders radiosity plus emission of the first surface of `far`, `min_trials` rays a pixel; everything goes to HIRES.
pub fn show_radiosity(world: &World<'_>, far: &FarField<'_>, camera: &Camera, params: &RenderParams) -> Rendering {
    let start = Stopwatch::start();
    let mut film = params.film();
    let view = ViewRays::new(camera, [params.width, params.height], params.seed);
    film.tiles.par_iter_mut().for_each(|tile| {
        let n = params.min_trials.max(1);
        let mut rays = Vec::with_capacity(tile.pixels.len() * n as usize);
        for i in 0..tile.pixels.len() as u32 {
            rays.extend((0..n).map(|t| view.path(tile.pixel(i), t, i * n + t).ray));
        }
        let mut hits = vec![Hit::MISS; rays.len()];
        far.rays.closest(&rays, Visible::All, Coherence::Coherent, &mut hits);
        for (i, (ray, hit)) in rays.iter().zip(&hits).enumerate() {
            let (pixel, trial) = (i / n as usize, i as u32 % n);
            tile.pixels[pixel].hires.add(radiance(world, far, ray, hit), trial & 1 == 0);
        }
    });
    let spent = start.spent();
    let all_hires = |total| PassTimes { hires: total, lores: Duration::ZERO };
    let view = film.pixels().map(|p| u64::from(p.hires.trials())).sum();
    Rendering {
        film,
        rays: RayCounts { view, ..RayCounts::default() },
        times: all_hires(spent.wall_duration()),
        cpu_times: all_hires(spent.cpu_duration()),
        stopped: false,
        cache: None,
    }
}

fn radiance(world: &World<'_>, far: &FarField<'_>, ray: &Ray, hit: &Hit) -> Vec3 {
    if !hit.is_hit() {
        return world.lights.outside(ray.direction);
    }
    let reflected = far.reflected(hit, ray.direction);
    match far.geometry.sources[hit.triangle as usize] {
        TriangleSource::BoxFace { .. } => reflected,
        TriangleSource::Scene { triangle } => {
            let point = SurfacePoint::new(world.scene, &Hit { triangle, ..*hit });
            reflected + Bsdf::new(world.scene, &point, -ray.direction, Lobes::MIRRORS).emission()
        }
    }
}
