//! Direct light: choosing a light source and a point on it (next-event estimation).
//!
//! Emitting triangles, and rectangles made of two, are sampled uniformly in solid angle (`spherical`); which light is
//! decided by a tree over lights (`tree`) in proportion to what each may contribute.

mod area;
mod bilinear;
mod bounds;
mod emission;
mod environment;
pub mod guide;
mod openings;
pub(crate) mod punctual;
pub mod shadow;
mod spherical;
mod tree;

#[cfg(test)]
mod tests;

use glam::Vec3;

use crate::backend::{Hit, RayScene};
use crate::sampling::{hash_all, unit};
use crate::scene::{Aabb, LightKind, PunctualLight, Scene};
use area::{AreaLight, AreaLights, Seen, View};
use bilinear::Rectangles;
use bounds::{Bounds, Cone, Emitter, Importance};
use emission::FluxTable;
pub use emission::{EmittedRay, EmittingTriangle};
use environment::EnvironmentLight;
use tree::{Leaf, LightTree};

/// Points whose choice of a light begins together.
const WEIGHED_AT_ONCE: usize = 64;

/// A sampled light source, seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// Distance to the light; infinite for directional lights and the environment.
    pub distance: f32,
    /// Radiance divided by the density of the sample (per solid angle), or for lights without area the irradiance on a
    /// facing surface divided by the probability of the light: multiply with `f cos` for an unbiased estimate.
    pub weight: Vec3,
    /// Density per solid angle; `None` for lights without area, which no ray can hit.
    pub pdf: Option<f32>,
    /// The emitting triangle, or `Hit::NONE`.
    pub triangle: u32,
}

impl LightSample {
    /// Share in the light of its direction where rays with density `other` may meet it too (balance heuristic); all of what no ray can hit.
    pub fn share(&self, other: f32) -> f32 {
        self.pdf.map_or(1.0, |pdf| pdf / (pdf + other))
    }
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
    environment: Option<EnvironmentLight>,
    emission: FluxTable,
    dropped: usize,
}

/// A surface point that asks for light.
#[derive(Clone, Copy, Debug)]
pub struct Lit {
    /// Where it is.
    pub position: Vec3,
    /// Unit shading normal on the side that is lit: samples from below are `None`. Zero asks for light from all directions.
    pub normal: Vec3,
    /// Random numbers in 0..1: the first chooses the light, the others the point on it.
    pub u: [f32; 3],
}

/// What a point asks for light.
enum Choice<'a> {
    /// A light without area, and what arrives from there.
    Sampled(LightSample),
    /// A light with area, and how points on it are chosen.
    Area { light: &'a AreaLight, probability: f64, view: View },
}

/// Probability of each kind of light at a point.
#[derive(Clone, Copy, Debug)]
struct Kinds {
    finite: f64,
    directional: f64,
    environment: f64,
}

impl Lights {
    /// Collects emitting triangles, punctual lights and the environment of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let areas = AreaLights::new(scene);
        let shines = |l: &&PunctualLight| l.intensity.is_finite() && l.intensity.max_element() > 0.0;
        let (directional, finite): (Vec<PunctualLight>, Vec<PunctualLight>) =
            scene.lights.iter().filter(shines).cloned().partition(|l| matches!(l.kind, LightKind::Directional { .. }));
        let dropped = areas.dropped + scene.lights.len() - directional.len() - finite.len();
        let of = |v: Vec3| v.as_dvec3().to_array();
        let directional_power = shares_of_total(directional.iter().map(|l| of(l.intensity)).collect());
        let tree = LightTree::new(&leaves(&areas.lights, &finite));
        let environment = scene.environment.as_ref().and_then(EnvironmentLight::new);
        let emission = FluxTable::default();
        let mut lights = Lights { areas, finite, directional, directional_power, tree, environment, emission, dropped };
        lights.emission = FluxTable::new(&lights, &scene.mesh.bounds);
        lights
    }

    /// Finds out what of the environment is seen from where, so that samples go to the openings. `rays` is built from `scene`.
    /// Changes variances, not means.
    pub fn look_out(&mut self, scene: &Scene, rays: &dyn RayScene, seed: u32) {
        if let Some(light) = &mut self.environment {
            light.look_out(scene, rays, seed);
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty() && self.directional.is_empty() && self.environment.is_none()
    }

    /// How many triangles and lights were left out because they have no area or emit nothing.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Samples a light for one point. `None` when nothing can arrive from the chosen light.
    pub fn sample(&self, scene: &Scene, lit: &Lit) -> Option<LightSample> {
        match self.choose(lit, &self.weigh(lit))? {
            Choice::Sampled(sample) => Some(sample),
            Choice::Area { light, probability, view } => {
                let seen = light.sample(lit.position.as_dvec3(), &view, [lit.u[1], lit.u[2]])?;
                area_sample(scene, light, &seen, probability, lit.normal)
            }
        }
    }

    /// Samples a light for each of many points: the same samples as one by one, sooner.
    pub fn sample_all(&self, scene: &Scene, lit: &[Lit], samples: &mut Vec<Option<LightSample>>) {
        samples.clear();
        samples.resize(lit.len(), None);
        let mut rectangles = Rectangles::default();
        let mut waiting: Vec<(usize, &AreaLight, f64)> = Vec::with_capacity(bilinear::LANES);
        let mut at_root = [Importance::default(); WEIGHED_AT_ONCE];
        for (i, point) in lit.iter().enumerate() {
            let place = i % WEIGHED_AT_ONCE;
            if place == 0 {
                self.tree.weigh(&lit[i..], &mut at_root);
            }
            let u = [point.u[1], point.u[2]];
            match self.choose(point, &at_root[place]) {
                None => {}
                Some(Choice::Sampled(sample)) => samples[i] = Some(sample),
                Some(Choice::Area { light, probability, view: View::Bilinear(seen) }) => {
                    rectangles.push(&seen, u);
                    waiting.push((i, light, probability));
                }
                Some(Choice::Area { light, probability, view }) => {
                    let seen = light.sample(point.position.as_dvec3(), &view, u);
                    samples[i] = seen.and_then(|seen| area_sample(scene, light, &seen, probability, point.normal));
                }
            }
            if waiting.len() == bilinear::LANES || i + 1 == lit.len() {
                for ((i, light, probability), point) in waiting.drain(..).zip(rectangles.sample()) {
                    let seen = light.seen_bilinear(&point);
                    samples[i] = seen.and_then(|seen| area_sample(scene, light, &seen, probability, lit[i].normal));
                }
            }
        }
    }

    fn weigh(&self, lit: &Lit) -> Importance {
        let mut at_root = [Importance::default()];
        self.tree.weigh(std::slice::from_ref(lit), &mut at_root);
        at_root[0]
    }

    /// Which light a point asks whose importance is `at_root` of the tree, and for lights without area what arrives from there.
    #[inline(always)]
    fn choose(&self, lit: &Lit, at_root: &Importance) -> Option<Choice<'_>> {
        let &Lit { position, normal, u } = lit;
        let choice = if self.tree.is_small() { f64::from(u[0]) } else { refined(u[0], [u[1], u[2]]) };
        let kinds = self.kinds(at_root, normal)?;
        let within = |below: f64, share: f64| ((choice - below) / share).clamp(0.0, 1.0 - f64::EPSILON);
        if choice >= kinds.finite + kinds.directional {
            let choice = within(kinds.finite + kinds.directional, kinds.environment);
            let sample = self.sample_environment(position, normal, choice, [u[1], u[2]], kinds.environment);
            return sample.map(Choice::Sampled);
        }
        if choice >= kinds.finite {
            let sample = self.sample_directional(normal, within(kinds.finite, kinds.directional), kinds.directional);
            return sample.map(Choice::Sampled);
        }
        let (light, probability) = self.tree.sample(at_root, position, normal, within(0.0, kinds.finite))?;
        let probability = probability * kinds.finite;
        let light = light as usize;
        if let Some(light) = self.areas.lights.get(light) {
            let view = light.view(position, normal)?;
            return Some(Choice::Area { light, probability, view });
        }
        let light = &self.finite[light - self.areas.lights.len()];
        let (direction, distance, irradiance) = punctual::incident(light, position)?;
        let weight = irradiance / probability as f32;
        let sample = LightSample { direction, distance, weight, pdf: None, triangle: Hit::NONE };
        above(normal, direction).then_some(Choice::Sampled(sample))
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
        let at_root = self.weigh(&Lit { position, normal, u: [0.0; 3] });
        let Some(kinds) = self.kinds(&at_root, normal) else {
            return 0.0;
        };
        let probability = kinds.finite * self.tree.probability(&at_root, position, normal, light as u32);
        if probability == 0.0 {
            return 0.0;
        }
        let offset = direction.as_dvec3() * f64::from(distance);
        (probability * self.areas.lights[light].density(position, normal, offset)) as f32
    }

    /// Radiance that a ray meets which leaves the scene into `direction`.
    pub fn outside(&self, direction: Vec3) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |light| light.radiance(direction))
    }

    /// Density per solid angle with which [`Lights::sample`] would have chosen the unit `direction` into the environment.
    pub fn pdf_outside(&self, position: Vec3, normal: Vec3, direction: Vec3) -> f32 {
        let Some(light) = self.environment.as_ref().filter(|_| above(normal, direction)) else {
            return 0.0;
        };
        let kinds = self.kinds(&self.weigh(&Lit { position, normal, u: [0.0; 3] }), normal);
        kinds.map_or(0.0, |kinds| (kinds.environment * light.pdf(position, normal, direction)) as f32)
    }

    /// How probable the kinds of lights are: equally, where they can reach the point. Which of them is occluded matters more than
    /// how strong they are (the sun seldom reaches a room).
    #[inline(always)]
    fn kinds(&self, at_root: &Importance, normal: Vec3) -> Option<Kinds> {
        if self.directional.is_empty() && self.environment.is_none() {
            return (!self.tree.is_empty()).then_some(Kinds { finite: 1.0, directional: 0.0, environment: 0.0 });
        }
        self.several_kinds(at_root, normal)
    }

    fn several_kinds(&self, at_root: &Importance, normal: Vec3) -> Option<Kinds> {
        let share = |reaches: bool| if reaches { 1.0 } else { 0.0 };
        let directional = self.directional.iter().any(|l| above(normal, towards(l)));
        let (directional, environment) = (share(directional), share(self.environment.is_some()));
        let alone = directional + environment == 0.0;
        let finite = if alone { !self.tree.is_empty() } else { self.tree.reaches(at_root) };
        let sum = share(finite) + directional + environment;
        let kinds =
            || Kinds { finite: share(finite) / sum, directional: directional / sum, environment: environment / sum };
        (sum > 0.0).then(kinds)
    }

    fn sample_environment(
        &self,
        position: Vec3,
        normal: Vec3,
        choice: f64,
        u: [f32; 2],
        probability: f64,
    ) -> Option<LightSample> {
        let sample = self.environment.as_ref()?.sample(position, normal, choice, u)?;
        let pdf = sample.pdf * probability;
        let weight = (sample.radiance.as_dvec3() / pdf).as_vec3();
        let usable = above(normal, sample.direction) && weight.is_finite() && weight.max_element() > 0.0;
        usable.then_some(LightSample {
            direction: sample.direction,
            distance: f32::INFINITY,
            weight,
            pdf: Some(pdf as f32),
            triangle: Hit::NONE,
        })
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

/// What arrives from a point on a light that was chosen with `probability`. `None` from below the surface.
fn area_sample(scene: &Scene, light: &AreaLight, seen: &Seen, probability: f64, normal: Vec3) -> Option<LightSample> {
    let &Seen { triangle, uv, direction, distance, density } = seen;
    let pdf = density * probability;
    let weight = light.radiance_at(scene, triangle, uv) * (1.0 / pdf) as f32;
    let usable = above(normal, direction) && weight.is_finite() && weight.max_element() > 0.0;
    usable.then_some(LightSample { direction, distance, weight, pdf: Some(pdf as f32), triangle })
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

/// `u` with the bits that f32 lacks: 2^-24 is more than the probability of one light among millions. Where there are few, nobody needs them.
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
