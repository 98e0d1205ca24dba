//! Samples of the light sources' light on patches.

use glam::{DVec3, Vec3};

use super::RadiosityScene;
use super::arrived::Place;
use super::patches::Patches;
use super::shoot::side_normal;
use crate::backend::Coherence;
use crate::lighting::shadow::{ShadowBuffers, ShadowRay, light_visibility};
use crate::lighting::{LightSample, Lit};
use crate::shading::SurfacePoint;

/// Random numbers for one sample, each in 0..1.
pub(super) struct Draw {
    /// The side that is lit.
    pub side: u32,
    /// Where.
    pub point: [f32; 2],
    /// From where.
    pub light: [f32; 3],
}

/// What a sample brought.
pub(super) struct Arriving {
    /// Number of its draw.
    pub draw: u32,
    /// The side that is lit.
    pub side: u32,
    /// Where.
    pub place: Place,
    /// The sample of that point's irradiance, W/m^2; 0 where something is in the way.
    pub irradiance: DVec3,
}

/// Memory for many samples.
#[derive(Default)]
pub(super) struct Sampled {
    points: Vec<SurfacePoint>,
    /// Number of the draw and side of each point.
    drawn: Vec<(u32, u32)>,
    lit: Vec<Lit>,
    samples: Vec<Option<LightSample>>,
    rays: Vec<ShadowRay>,
    through: Vec<Vec3>,
    shadow: ShadowBuffers,
    arriving: Vec<Arriving>,
}

impl Sampled {
    /// Light on the sides of patches, in the order of `draws`: one entry for each shadow ray. What is left out brings nothing.
    pub fn light(
        &mut self,
        input: &RadiosityScene<'_>,
        patches: &Patches,
        draws: impl Iterator<Item = Draw>,
    ) -> &[Arriving] {
        let Sampled { points, drawn, lit, samples, rays, through, shadow, arriving } = self;
        points.clear();
        drawn.clear();
        lit.clear();
        for (number, draw) in (0..).zip(draws) {
            if patches.is_inside_of_box(draw.side) {
                continue;
            }
            let point = patches.open_point(input.geometry, draw.side, draw.point);
            lit.push(Lit { position: point.position, normal: side_normal(&point, draw.side), u: draw.light });
            points.push(point);
            drawn.push((number, draw.side));
        }
        input.lights.sample_all(input.scene, lit, samples);
        rays.clear();
        arriving.clear();
        for (((point, lit), sample), &(draw, side)) in
            points.iter().zip(lit.iter()).zip(samples.iter()).zip(drawn.iter())
        {
            let Some(light) = sample else { continue };
            let cos = light.direction.dot(lit.normal);
            if cos <= 0.0 || light.weight.max_element() <= 0.0 {
                continue;
            }
            rays.push(ShadowRay::towards(light, point));
            let irradiance = f64::from(cos) * light.weight.as_dvec3();
            arriving.push(Arriving { draw, side, place: Place::lit(point, light.direction), irradiance });
        }
        through.clear();
        through.resize(rays.len(), Vec3::ONE);
        let sources = Some(input.geometry.sources.as_slice());
        light_visibility(input.rays, input.scene, sources, rays, Coherence::Coherent, shadow, through);
        for (arriving, seen) in arriving.iter_mut().zip(through.iter()) {
            arriving.irradiance *= seen.as_dvec3();
        }
        arriving
    }
}
