//! Direct light: choosing a light source and a point on it (next-event estimation).
//!
//! Emitting triangles, and rectangles made of two, are sampled uniformly in solid angle (`spherical`); which light is
//! decided by a tree over lights (`tree`) in proportion to what each may contribute.

mod area;
mod bilinear;
mod bounds;
mod emission;
mod punctual;
pub mod shadow;
mod spherical;
mod tree;

#[cfg(test)]
mod tests;

use glam::Vec3;

use crate::backend::Hit;
use crate::sampling::{hash_all, unit};
use crate::scene::{Aabb, LightKind, PunctualLight, Scene};
use area::{AreaLight, AreaLights, Seen};
use bounds::{Bounds, Cone, Emitter};
use emission::FluxTable;
pub use emission::{EmittedRay, EmittingTriangle};
use tree::{Leaf, LightTree};

/// A sampled light source, seen from a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// Distance to the light; infinite for directional lights.
    pub distance: f32,
    /// Radiance divided by the density of the sample (per solid angle), or for lights without area the irradiance on a
    /// facing surface divided by the probability of the light: multiply with `f cos` for an unbiased estimate.
    pub weight: Vec3,
    /// Density per solid angle; `None` for lights without area, which no ray can hit.
    pub pdf: Option<f32>,
    /// The emitting triangle, or `Hit::NONE`.
    pub triangle: u32,
}

/// All light sources of a scene, ready to be sampled.
#[derive(Debug)]
pub struct Lights {
    areas: AreaLights,
    /// Point and spot lights.
    finite: Vec<PunctualLight>,
    directional: Vec<PunctualLight>,
    /// Decides between directional lights, by band shares of irradiance.
    directional_power: Vec<f64>,
    /// Over the area lights, then the finite ones.
    tree: LightTree,
    emission: FluxTable,
    dropped: usize,
}

impl Lights {
    /// Collects emitting triangles and punctual lights of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let areas = AreaLights::new(scene);
        let shines = |l: &&PunctualLight| l.intensity.is_finite() && l.intensity.max_element() > 0.0;
        let (directional, finite): (Vec<PunctualLight>, Vec<PunctualLight>) =
            scene.lights.iter().filter(shines).cloned().partition(|l| matches!(l.kind, LightKind::Directional { .. }));
        let dropped = areas.dropped + scene.lights.len() - directional.len() - finite.len();
        let of = |v: Vec3| v.as_dvec3().to_array();
        let directional_power = shares_of_total(directional.iter().map(|l| of(l.intensity)).collect());
        let tree = LightTree::new(&leaves(&areas.lights, &finite));
        let mut lights =
            Lights { areas, finite, directional, directional_power, tree, emission: FluxTable::default(), dropped };
        lights.emission = FluxTable::new(&lights, &scene.mesh.bounds);
        lights
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty() && self.directional.is_empty()
    }

    /// How many triangles and lights were left out because they have no area or emit nothing.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Samples a light for a surface point with shading normal `normal` (on the side that is lit).
    /// `u[0]` chooses the light, `u[1..3]` the point on it. `None` when nothing can arrive from the chosen light.
    ///
    /// A zero `normal` asks for light from all directions; otherwise samples from below the surface are `None`.
    pub fn sample(&self, scene: &Scene, position: Vec3, normal: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let mut choice = refined(u[0], [u[1], u[2]]);
        let to_finite = self.probability_of_finite(position, normal)?;
        if choice >= to_finite {
            choice = (choice - to_finite) / (1.0 - to_finite);
            return self.sample_directional(normal, choice, 1.0 - to_finite);
        }
        choice = (choice / to_finite).min(1.0 - f64::EPSILON);
        let (light, probability) = self.tree.sample(position, normal, choice)?;
        let probability = probability * to_finite;
        let light = light as usize;
        let Some(area) = self.areas.lights.get(light) else {
            let light = &self.finite[light - self.areas.lights.len()];
            let (direction, distance, irradiance) = punctual::incident(light, position)?;
            let weight = irradiance / probability as f32;
            return above(normal, direction).then_some(LightSample {
                direction,
                distance,
                weight,
                pdf: None,
                triangle: Hit::NONE,
            });
        };
        let from = position.as_dvec3();
        let Seen { point, direction, distance, density } = area.sample(from, normal, [u[1], u[2]])?;
        let pdf = density * probability;
        let weight = area.radiance_at(scene, &point) * (1.0 / pdf) as f32;
        let usable = above(normal, direction) && weight.is_finite() && weight.max_element() > 0.0;
        usable.then_some(LightSample { direction, distance, weight, pdf: Some(pdf as f32), triangle: point.triangle })
    }

    /// Density per solid angle with which [`Lights::sample`] would have chosen `direction` towards `triangle`, which a ray
    /// from `position` hit at `distance`; 0 for triangles that are no light source.
    pub fn pdf(
        &self,
        scene: &Scene,
        position: Vec3,
        normal: Vec3,
        direction: Vec3,
        distance: f32,
        triangle: u32,
    ) -> f32 {
        let Some(light) = self.areas.of_triangle(scene, triangle) else {
            return 0.0;
        };
        if !above(normal, direction) {
            return 0.0;
        }
        let Some(to_finite) = self.probability_of_finite(position, normal) else {
            return 0.0;
        };
        let probability = to_finite * self.tree.probability(position, normal, light as u32);
        if probability == 0.0 {
            return 0.0;
        }
        let offset = direction.as_dvec3() * f64::from(distance);
        (probability * self.areas.lights[light].density(position.as_dvec3(), normal, offset)) as f32
    }

    /// Probability of choosing from the tree rather than a directional light: half, where both can reach the point. Which of
    /// them is occluded matters more than how strong they are (the sun seldom reaches a room).
    fn probability_of_finite(&self, position: Vec3, normal: Vec3) -> Option<f64> {
        if self.directional.is_empty() {
            return (!self.tree.is_empty()).then_some(1.0);
        }
        let directional = self.directional.iter().any(|l| above(normal, towards(l)));
        match (self.tree.reaches(position, normal), directional) {
            (true, true) => Some(0.5),
            (true, false) => Some(1.0),
            (false, true) => Some(0.0),
            (false, false) => None,
        }
    }

    fn sample_directional(&self, normal: Vec3, u: f64, factor: f64) -> Option<LightSample> {
        let share = |i: usize| {
            let direction = towards(&self.directional[i]);
            let cos = if normal == Vec3::ZERO { 1.0 } else { f64::from(normal.dot(direction)).max(0.0) };
            self.directional_power[i] * cos
        };
        let sum: f64 = (0..self.directional.len()).map(share).sum();
        let mut rest = u * sum;
        let mut chosen = None;
        for i in 0..self.directional.len() {
            let share = share(i);
            if share > 0.0 {
                chosen = Some((i, share));
                if rest < share {
                    break;
                }
                rest -= share;
            }
        }
        let (i, share) = chosen?;
        let light = &self.directional[i];
        let probability = factor * share / sum;
        Some(LightSample {
            direction: towards(light),
            distance: f32::INFINITY,
            weight: light.intensity / probability as f32,
            pdf: None,
            triangle: Hit::NONE,
        })
    }
}

/// Unit direction to a directional light; zero for others.
fn towards(light: &PunctualLight) -> Vec3 {
    match light.kind {
        LightKind::Directional { direction } => -direction,
        _ => Vec3::ZERO,
    }
}

/// Whether `direction` is above the surface with `normal`, or there is no surface.
fn above(normal: Vec3, direction: Vec3) -> bool {
    normal == Vec3::ZERO || normal.dot(direction) > 0.0
}

/// `u` with the bits that f32 lacks: 2^-24 is more than the probability of one light among millions.
fn refined(u: f32, others: [f32; 2]) -> f64 {
    let below = unit(hash_all(&others.map(f32::to_bits)));
    (f64::from(u) + f64::from(below) / 16_777_216.0).min(1.0 - f64::EPSILON)
}

/// Sum over bands of a light's part in the total: lets each band be lit by the lights that matter for it.
fn band_shares(value: [f64; 3], total: [f64; 3]) -> f64 {
    value.iter().zip(total).filter(|&(_, t)| t > 0.0).map(|(v, t)| v / t).sum()
}

fn shares_of_total(values: Vec<[f64; 3]>) -> Vec<f64> {
    let mut total = [0.0; 3];
    for value in &values {
        for (sum, v) in total.iter_mut().zip(value) {
            *sum += v;
        }
    }
    values.into_iter().map(|v| band_shares(v, total)).collect()
}

/// Area lights, then finite punctual ones, as the tree sees them.
fn leaves(areas: &[AreaLight], finite: &[PunctualLight]) -> Vec<Leaf> {
    let of_areas = areas.iter().map(|l| (l.radiance.as_dvec3() * l.area()).to_array());
    let of_finite = finite.iter().map(|l| l.intensity.as_dvec3().to_array());
    let powers = shares_of_total(of_areas.chain(of_finite).collect());
    let area_bounds = areas.iter().map(|light| {
        let axis = light.normal().as_vec3();
        let cone = Cone { axis, cos_o: 1.0, cos_e: 0.0, both: light.both_faces };
        (Aabb::of(light.corners()), cone, light.sphere())
    });
    let finite_bounds = finite.iter().map(|light| match light.kind {
        LightKind::Point { position } => (Aabb::of([position]), Cone::SPHERE, (position, 0.0)),
        LightKind::Spot { position, direction, cos_outer, .. } => {
            // Emits as much anywhere in the cone as on the axis, for all the estimate knows
            let cone = Cone { axis: direction, cos_o: cos_outer, cos_e: 1.0, both: false };
            (Aabb::of([position]), cone, (position, 0.0))
        }
        LightKind::Directional { direction } => (Aabb::EMPTY, Cone::SPHERE, (direction, 0.0)),
    });
    area_bounds
        .chain(finite_bounds)
        .zip(powers)
        .enumerate()
        .map(|(i, ((aabb, cone, (centre, radius)), power))| {
            let power = power as f32;
            Leaf {
                bounds: Bounds { aabb, cone, power },
                emitter: Emitter { centre, radius, cone, power, flat: i < areas.len() },
            }
        })
        .collect()
}
