//! A radiosity solution shown directly: what the camera sees of patches, without any gather.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::RenderParams;
use super::film::Film;
use super::integrator::{FarField, World};
use crate::backend::{Coherence, Hit, Ray, Visible};
use crate::sampling::{hash_all, sobol};
use crate::scene::Camera;
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use crate::simplify::TriangleSource;

/// Renders radiosity plus emission of the first surface of `far`, `min_trials` rays a pixel; everything goes to HIRES.
pub fn show_radiosity(world: &World<'_>, far: &FarField<'_>, camera: &Camera, params: &RenderParams) -> Film {
    let mut film = params.film();
    let size = Vec2::new(params.width as f32, params.height as f32);
    film.tiles.par_iter_mut().for_each(|tile| {
        let n = params.min_trials.max(1);
        let mut rays = Vec::with_capacity(tile.pixels.len() * n as usize);
        for i in 0..tile.pixels.len() as u32 {
            let corner = [tile.origin[0] + i % tile.size[0], tile.origin[1] + i / tile.size[0]];
            for t in 0..n {
                let stream = hash_all(&[corner[1] * params.width + corner[0], t & 1, params.seed]);
                let u = sobol(t >> 1, 0, stream);
                let film = Vec2::new(corner[0] as f32 + u[0], corner[1] as f32 + u[1]) / size;
                rays.push(camera.ray(film, size.x / size.y));
            }
        }
        let mut hits = vec![Hit::MISS; rays.len()];
        far.rays.closest(&rays, Visible::All, Coherence::Coherent, &mut hits);
        for (i, (ray, hit)) in rays.iter().zip(&hits).enumerate() {
            let (pixel, trial) = (i / n as usize, i as u32 % n);
            tile.pixels[pixel].hires.add(radiance(world, far, ray, hit), trial & 1 == 0);
        }
    });
    film
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
