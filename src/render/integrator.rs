//! Both passes as one wavefront of paths: batches of rays are traced, shaded, and traced on.
//!
//! Which term of the paper's decomposition is computed where, each exactly once (E: eye, S: highly directional, D: weakly
//! directional, L: light source):
//!
//! | term | path | computed by |
//! |---|---|---|
//! | emitted, `L_h` of light sources | `E S* L` | HIRES: emission at the end of the view chain |
//! | `L_{l,s}` | `E S* D L` | HIRES: next-event estimation; a glossy lobe shares it with its own rays (balance heuristic) |
//! | `L_{l,l}` beyond `r_thresh` | `E S* D .. D` | LORES: radiosity less emission of the patch that is hit, Eq. (3) first part; of a patch on which direct light varies only what reflected light brings, and direct light at the point; rough reflection there goes on in the simplified scene |
//! | `L_{l,l}` within `r_thresh` | `E S* D D ..` | LORES: direct light at the near point and the same gather again, Eq. (3) second part |
//! | `L_{l,h}` | `E S* D S+ D ..` | LORES: the gather ray goes on through mirrors and glass |
//! | `L_{l,c}` from small light sources | `E S* D S+ L` | HIRES: photons; LORES where gather rays meet the `D` (see [`caustics`](super::caustics)) |
//! | `L_{l,c}` from large ones | `E S* D S+ L` | LORES: emission met after at least one highly directional event |
//!
//! L is a light source or the environment. Light that passes straight through panes counts as direct (`L_{l,s}`): shadow rays
//! take the panes' transmittance.

use std::time::Instant;

use glam::Vec3;

use super::film::{Feature, Tile};
use super::look_up::{LookUp, rough_probability};
use super::path::{Arrival, Met, Passes, Path, Shadow};
use super::view::ViewRays;
use super::workspace::Workspace;
use super::world::{Batch, Captured, FarField, World};
use crate::backend::edge::settle_edges;
use crate::backend::{Coherence, Hit, Ray, Visible};
use crate::lighting::guide::Guided;
use crate::lighting::shadow::{ShadowRay, light_visibility};
use crate::lighting::{LightSample, Lit};
use crate::scene::Camera;
use crate::shading::{Bsdf, Lobes, SurfacePoint};
use crate::simplify::TriangleSource;

/// A far ray starts this much (relative) before the near one ended, so that nothing falls between the two.
const SEAM: f32 = 4.0 * f32::EPSILON;

/// Scattering events after which paths play Russian roulette ...
const ROULETTE_DEPTH: u32 = 2;

/// ... when they bring less than this. Path tracing to a given error takes 11 to 23 % less time (cornell, clutter, bathroom, kitchen,
/// white-room) than where each path ends with the probability of its loss: that saves time, but makes more noise.
const ROULETTE_BELOW: f32 = 0.4;

/// Scattering events after which even a path that lost nothing may end: light can be trapped in glass for ever.
const CERTAIN_DEPTH: u32 = 32;

/// Largest probability of going on after that. Variance stays finite where it is above the square of the reflectance that keeps a
/// path alive: between walls of 0.99, a smaller one makes rare paths arbitrarily bright.
const CERTAIN_SURVIVAL: f32 = 0.999;

/// Share of a pixel over which textures are averaged: its trials average the rest.
const PIXEL_FOOTPRINT: f32 = 0.5;

/// Width of what a gather ray stands for per distance, for textures: those of a hemisphere are a tenth apart. Path tracing, which
/// is to be exact, reads them at the point.
const GATHER_FOOTPRINT: f32 = 0.05;

/// Points that are shaded together: as many as stay close to the processor.
const MET_AT_ONCE: usize = 128;

/// From this trial on a tile remembers where it finds light: images of fewer trials have no use for that.
pub(super) const LEARN_FROM: u32 = 16;

impl World<'_> {
    /// Adds a batch of trials to a tile.
    pub fn render_tile(
        &self,
        ws: &mut Workspace,
        camera: &Camera,
        image_size: [u32; 2],
        batch: Batch<'_>,
        tile: &mut Tile,
    ) {
        let trials = batch.pixels.len() * batch.trials as usize;
        ws.start(trials);
        let view = ViewRays::new(camera, image_size, batch.seed);
        ws.guide = (batch.first >= LEARN_FROM).then(|| std::mem::take(&mut tile.guide));
        ws.cone = view.cone();
        for (place, &pixel) in (0..).zip(batch.pixels) {
            view.append(tile.pixel(pixel), batch.first, batch.trials, place * batch.trials, &mut ws.paths);
        }
        ws.features.clear();
        if batch.features {
            ws.features.resize(trials, Feature::default());
        }
        self.run(ws, batch.passes, None);
        tile.guide = ws.guide.take().unwrap_or_default();
        for (place, &pixel) in batch.pixels.iter().enumerate() {
            let pixel = &mut tile.pixels[pixel as usize];
            for t in 0..batch.trials {
                let trial = place * batch.trials as usize + t as usize;
                let (h, l) = (ws.hires[trial], ws.lores[trial]);
                if !(h.is_finite() && l.is_finite()) {
                    tile.dropped += 1;
                    continue;
                }
                let even = (batch.first + t) & 1 == 0;
                if let Some(feature) = ws.features.get(trial) {
                    pixel.feature += *feature;
                }
                if batch.passes.hires {
                    pixel.hires.add(h, even);
                }
                if batch.passes.lores {
                    pixel.lores.add(l, even);
                    if self.cache.is_some() {
                        pixel.brightest.offer(l, even);
                    }
                }
            }
        }
    }

    /// Follows view chains to their first weakly directional bounce and returns the gather paths that start there.
    /// Sums of the trials are left in the workspace.
    pub(super) fn first_gathers(&self, ws: &mut Workspace, paths: &[Path]) -> Vec<Captured> {
        ws.start(paths.len());
        ws.paths.extend_from_slice(paths);
        let mut captured = Vec::with_capacity(paths.len());
        self.run(ws, Passes::LORES, Some(&mut captured));
        captured
    }

    /// Runs gather paths to their end and returns the LORES radiance of each trial.
    pub(super) fn gather<'w>(&self, ws: &'w mut Workspace, paths: &[Path], trials: usize) -> &'w [Vec3] {
        ws.start(trials);
        ws.paths.extend_from_slice(paths);
        self.run(ws, Passes::LORES, None);
        &ws.lores
    }

    /// The same, with the distance of what each trial's first ray met.
    pub(super) fn gather_with_distances<'w>(
        &self,
        ws: &'w mut Workspace,
        paths: &[Path],
        trials: usize,
    ) -> (&'w [Vec3], &'w [f32]) {
        ws.start(trials);
        ws.distances.resize(trials, f32::INFINITY);
        ws.paths.extend_from_slice(paths);
        self.run(ws, Passes::LORES, None);
        (&ws.lores, &ws.distances)
    }

    /// Traces and shades until all paths have ended. With `capture`, paths end when they start to gather.
    fn run(&self, ws: &mut Workspace, passes: Passes, mut capture: Option<&mut Vec<Captured>>) {
        let mut coherence = Coherence::Coherent;
        while !ws.paths.is_empty() {
            let start = Instant::now();
            ws.next.clear();
            ws.shadows.clear();
            ws.shadow_rays.clear();
            self.trace_detailed(ws, passes, coherence, &mut capture);
            self.trace_far(ws, passes, coherence, &mut capture);
            self.trace_shadows(ws, coherence);
            std::mem::swap(&mut ws.paths, &mut ws.next);
            let view = coherence == Coherence::Coherent && passes.hires;
            *(if view { &mut ws.times.hires } else { &mut ws.times.lores }) += start.elapsed();
            coherence = Coherence::Incoherent;
        }
    }

    /// Traces all rays that must meet the detailed scene first; what misses there goes on the list for the far field.
    fn trace_detailed(
        &self,
        ws: &mut Workspace,
        passes: Passes,
        coherence: Coherence,
        capture: &mut Option<&mut Vec<Captured>>,
    ) {
        ws.traced.clear();
        ws.rays.clear();
        ws.far.clear();
        for (i, path) in ws.paths.iter().enumerate() {
            let same = |far: &FarField| far.nearness.is_none_or(|n| !n.differs(path.ray.origin));
            if path.near.is_finite() && self.far.as_ref().is_some_and(|far| path.near <= 0.0 || same(far)) {
                ws.far.push(i as u32);
            } else {
                ws.traced.push(i as u32);
                ws.rays.push(Ray { t_far: path.near, ..path.ray });
                if path.gathers {
                    ws.counts.near += 1;
                } else {
                    ws.counts.view += 1;
                }
            }
        }
        ws.hits.resize(ws.rays.len(), Hit::MISS);
        self.detailed.closest(&ws.rays, Visible::All, coherence, &mut ws.hits);
        settle_edges(self.detailed, &mut ws.rays, &mut ws.hits);
        for k in 0..ws.traced.len() {
            let (index, hit) = (ws.traced[k], ws.hits[k]);
            if hit.is_hit() {
                ws.note_distance(index, hit.t);
                ws.note_near(index);
                self.meet(ws, index, &hit, None, passes, capture);
            } else if ws.paths[index as usize].near.is_finite() {
                // The rest of the ray meets the simplified scene.
                let path = &mut ws.paths[index as usize];
                path.ray.t_near = path.near * (1.0 - SEAM);
                ws.far.push(index);
            } else {
                self.escape(ws, index);
            }
        }
        self.shade_all(ws, passes, capture);
    }

    /// Traces the far list in the simplified scene and looks radiosities up.
    fn trace_far(
        &self,
        ws: &mut Workspace,
        passes: Passes,
        coherence: Coherence,
        capture: &mut Option<&mut Vec<Captured>>,
    ) {
        let Some(far) = self.far else { return };
        if ws.far.is_empty() {
            return;
        }
        ws.rays.clear();
        ws.rays.extend(ws.far.iter().map(|&i| ws.paths[i as usize].ray));
        ws.hits.resize(ws.rays.len(), Hit::MISS);
        far.rays.closest(&ws.rays, Visible::All, coherence, &mut ws.hits);
        settle_edges(far.rays, &mut ws.rays, &mut ws.hits);
        ws.counts.far += ws.rays.len() as u64;
        for k in 0..ws.far.len() {
            let (index, hit) = (ws.far[k], ws.hits[k]);
            if hit.is_hit() {
                self.meet_far(ws, &far, index, &hit, passes, capture);
            } else {
                self.escape(ws, index);
            }
        }
        self.shade_all(ws, passes, capture);
    }

    /// A ray left the scene. What it sees of the environment counts as emission that it meets.
    fn escape(&self, ws: &mut Workspace, index: u32) {
        let path = &ws.paths[index as usize];
        let direction = path.ray.direction;
        let share = match path.arrival {
            Arrival::Sharp => 1.0,
            Arrival::Soft => return,
            Arrival::Glossy { pdf, position, normal } => {
                pdf / (pdf + self.lights.pdf_outside(position, normal, direction))
            }
        };
        let radiance = path.throughput * self.lights.outside(direction) * share;
        let sum = if path.gathers { &mut ws.lores } else { &mut ws.hires };
        sum[path.trial as usize] += radiance;
    }

    /// A gather ray met the simplified scene.
    fn meet_far(
        &self,
        ws: &mut Workspace,
        far: &FarField,
        index: u32,
        hit: &Hit,
        passes: Passes,
        capture: &mut Option<&mut Vec<Captured>>,
    ) {
        let path = ws.paths[index as usize];
        ws.note_distance(index, hit.t);
        // Within reach, and where the patch is large against the ray, the surface's own light is worked out.
        let near =
            hit.t <= path.near || (far.r_thresh > 0.0 && far.solution.is_larger(hit.t, hit.triangle, hit.u, hit.v));
        let source = far.geometry.sources[hit.triangle as usize];
        if near && matches!(source, TriangleSource::Scene { .. }) {
            ws.note_near(index);
        } else {
            ws.note_lookup(index, hit.t);
        }
        let TriangleSource::Scene { triangle } = source else {
            ws.lores[path.trial as usize] += path.throughput * far.reflected(hit, path.ray.direction);
            return;
        };
        let look_up = (!near).then(|| far.look_up(hit, path.ray.direction, self.scene.material(triangle)));
        if let Some(LookUp { radiance, unlit: false, probability, .. }) = look_up {
            let chosen = || probability >= 1.0 || path.random(0)[3] < probability;
            if far.plain[hit.triangle as usize] || !chosen() {
                ws.lores[path.trial as usize] += path.throughput * radiance;
                return;
            }
        }
        // The triangle is the same one in the detailed scene.
        self.meet(ws, index, &Hit { triangle, ..*hit }, look_up, passes, capture);
    }

    /// A ray met a surface of the scene. `look_up`: what is weakly directional there comes from the radiosity solution.
    fn meet(
        &self,
        ws: &mut Workspace,
        index: u32,
        hit: &Hit,
        look_up: Option<LookUp>,
        passes: Passes,
        capture: &mut Option<&mut Vec<Captured>>,
    ) {
        let path = &ws.paths[index as usize];
        let mut point = SurfacePoint::new(self.scene, hit);
        point.footprint = match (path.gathers, self.far) {
            (false, _) => PIXEL_FOOTPRINT * (ws.cone[0] + ws.cone[1] * hit.t),
            (true, Some(_)) => GATHER_FOOTPRINT * hit.t,
            (true, None) => 0.0,
        };
        let wanted = if path.gathers { passes.lores } else { passes.hires };
        let glossy = || !self.scene.material(point.triangle).is_lambertian();
        let lit = look_up.is_none_or(|l| l.unlit || glossy())
            && wanted
            && path.depth < self.max_depth
            && !self.lights.is_empty();
        let lit = lit.then(|| {
            let [choice, u, v, _] = path.random(0);
            let normal = point.shading_normal_towards(-path.ray.direction);
            let guided = match &mut ws.guide {
                Some(guide) if !path.gathers => guide.draw([choice, u, v]),
                _ => Guided::plain([choice, u, v]),
            };
            ws.lit.push(Lit { position: point.position, normal, u: guided.u });
            guided
        });
        ws.met.push(Met { path: index, hit: *hit, look_up, point, lit });
        if ws.met.len() == MET_AT_ONCE {
            self.shade_all(ws, passes, capture);
        }
    }

    /// Samples light for what was met, and shades it.
    fn shade_all(&self, ws: &mut Workspace, passes: Passes, capture: &mut Option<&mut Vec<Captured>>) {
        self.lights.sample_all(self.scene, &ws.lit, &mut ws.lights);
        let (mut met, mut lights) = (std::mem::take(&mut ws.met), std::mem::take(&mut ws.lights));
        let mut sampled = lights.drain(..);
        for met in &met {
            let light = if met.lit.is_some() { sampled.next().flatten() } else { None };
            self.shade(ws, met, light.as_ref(), passes, capture);
        }
        drop(sampled);
        met.clear();
        (ws.met, ws.lights) = (met, lights);
        ws.lit.clear();
    }

    /// Emission, light from a sampled light source, and how the path goes on.
    fn shade(
        &self,
        ws: &mut Workspace,
        met: &Met,
        light: Option<&LightSample>,
        passes: Passes,
        capture: &mut Option<&mut Vec<Captured>>,
    ) {
        let &Met { ref hit, look_up, ref point, .. } = met;
        let mut path = ws.paths[met.path as usize];
        let trial = path.trial as usize;
        let outgoing = -path.ray.direction;
        path.throughput *= point.absorption(self.scene, outgoing, hit.t);
        if let Some(LookUp { probability, radiance, .. }) = look_up {
            // What comes of this one counts for those that are taken for diffuse altogether, less what these have.
            path.throughput /= probability;
            ws.lores[trial] -= path.throughput * radiance * (1.0 - probability);
        }
        let facing = point.shading_normal_towards(outgoing);
        let lobes = match look_up {
            // To the radiosity solution everything is diffuse that is no perfect mirror.
            Some(_) => Lobes { threshold: 0.0, mirrors: true, ..self.gather_lobes },
            None if path.gathers => self.gather_lobes,
            None => Lobes { least_roughness: 0.0, ..self.gather_lobes },
        };
        let bsdf = Bsdf::new(self.scene, point, outgoing, lobes);

        let emission = bsdf.emission();
        if emission != Vec3::ZERO {
            let radiance = path.throughput * emission * self.emission_share(&path, hit);
            let sum = if path.gathers { &mut ws.lores[trial] } else { &mut ws.hires[trial] };
            *sum += radiance;
        }
        let (low, high) = (bsdf.albedo_low(), bsdf.albedo_high());
        if path.depth == 0
            && let Some(feature) = ws.features.get_mut(trial)
        {
            *feature = Feature { albedo: low + high, normal: facing, depth: hit.t, hits: 1, ..Feature::default() };
            if let Some(simplified) = self.simplified {
                feature.classify(simplified, hit.triangle);
            }
        }
        if path.depth >= self.max_depth {
            if let Some(look_up) = look_up {
                ws.lores[trial] += path.throughput * look_up.radiance;
            }
            return;
        }

        // What remains of the point where photons bring the light that the rest of it bends.
        let unbending = match self.caustics {
            Some(caustics) if path.gathers => caustics.unbending(self.scene, point, outgoing),
            _ => None,
        };
        // Paths from rough reflection have a share in light sources where nothing is interpolated.
        let shares = path.gathers && unbending.is_none();
        if let (Some(light), Some(guided)) = (light, met.lit) {
            let scattered = match look_up {
                None => self.scattered(&bsdf, unbending.as_ref(), shares, light),
                Some(look_up) => {
                    let carried = unbending.is_some() && self.caustics.is_some_and(|caustics| caustics.carry(light));
                    look_up.scattered(&bsdf, carried, &path, light)
                }
            };
            shine(ws, &path, point, scattered, light, guided);
        }
        let wanted = if path.gathers { passes.lores } else { passes.hires || capture.is_some() };
        if let Some(caustics) = self.caustics.filter(|_| wanted && look_up.is_none()) {
            let radiance = path.throughput * caustics.at(point, outgoing, &bsdf, unbending.as_ref(), path.gathers);
            // To those who take paths over, what photons bring is indirect light like what paths will bring.
            let sum = if path.gathers || capture.is_some() { &mut ws.lores[trial] } else { &mut ws.hires[trial] };
            *sum += radiance;
        }

        // Share of paths that gather the rest when the diffuse part came from the cache.
        let mut rough_share = None;
        let mut low = low;
        if !path.gathers
            && passes.lores
            && capture.is_none()
            && let Some(cache) = self.cache
            && let diffuse = bsdf.albedo_diffuse()
            && diffuse != Vec3::ZERO
            && let Some(light) = cache.look_up(&mut ws.nearby, ws.cone[0] + ws.cone[1] * hit.t, point.position, facing)
        {
            ws.lores[trial] += path.throughput * diffuse * light;
            low = bsdf.albedo_rough();
            rough_share = Some(rough_probability(low.max_element()));
        }

        let choose_high = choose_high(low, high);
        if let Some(look_up) = look_up {
            // Both ways of going on from here are taken by chance, this one is not.
            ws.lores[trial] += path.throughput * look_up.radiance * look_up.diffuse_share(&bsdf);
            low = if look_up.rough { bsdf.albedo_rough() } else { Vec3::ZERO };
            rough_share = Some((rough_probability(low.max_element()) / look_up.probability).min(1.0));
        }
        let goes_on = passes.lores && low != Vec3::ZERO;
        let u = if choose_high > 0.0 || goes_on { path.random(1) } else { [0.0; 4] };
        if u[3] < choose_high {
            let Some(sample) = bsdf.sample_high([u[0], u[1], u[2]]) else { return };
            let arrival = match (sample.straight, sample.pdf) {
                (true, _) => path.arrival,
                (false, None) => Arrival::Sharp,
                (false, Some(pdf)) => Arrival::Glossy { pdf, position: point.position, normal: facing },
            };
            let next = Path {
                ray: Ray::new(point.ray_origin(sample.direction), sample.direction),
                throughput: path.throughput * sample.weight / choose_high,
                near: if path.near.is_finite() { (path.near - hit.t).max(0.0) } else { path.near },
                arrival,
                bent: if sample.straight { path.bent } else { unbending.is_some() },
                depth: path.depth + 1,
                ..path
            };
            ws.next.extend(roulette(next, u[3] / choose_high).map(|(path, _)| path));
            return;
        }
        let throughput = path.throughput / (1.0 - choose_high);
        if !goes_on {
            return;
        }
        let mut rest = (u[3] - choose_high) / (1.0 - choose_high);
        let (sample, share) = match rough_share {
            None => (bsdf.sample_low([u[0], u[1], u[2]]), 1.0),
            Some(share) if rest >= share => return,
            Some(share) => (bsdf.sample_rough([u[0], u[1]]), share),
        };
        let Some(sample) = sample else { return };
        rest /= share;
        let pdf = sample.pdf.filter(|_| look_up.is_some() || shares && bsdf.is_rough());
        let arrival = match pdf {
            Some(pdf) => Arrival::Glossy { pdf, position: point.position, normal: facing },
            None => Arrival::Soft,
        };
        let next = Path {
            ray: Ray::new(point.ray_origin(sample.direction), sample.direction),
            throughput: throughput * sample.weight / share,
            near: f32::INFINITY,
            arrival,
            gathers: true,
            bent: false,
            depth: path.depth + 1,
            ..path
        };
        let Some((mut next, rest)) = roulette(next, rest) else { return };
        if let Some(far) = &self.far {
            // What the far field reflects is in the far field.
            next.near = if look_up.is_some() { 0.0 } else { far.r_thresh * (0.5 + rest) };
        }
        match (path.gathers, capture) {
            (false, Some(captured)) => {
                let diffuse = bsdf.albedo_diffuse() != Vec3::ZERO;
                captured.push(Captured { path: next, point: *point, normal: facing, diffuse });
            }
            _ => ws.next.push(next),
        }
    }

    /// `f cos` for a sampled light source. What bends light is left to photons where they carry the light; rays from glossy lobes, and with
    /// `shares` from rough ones, have a share in their light (balance heuristic).
    fn scattered(&self, bsdf: &Bsdf, unbending: Option<&Bsdf>, shares: bool, light: &LightSample) -> Vec3 {
        if let (Some(unbending), Some(caustics)) = (unbending, self.caustics)
            && caustics.carry(light)
        {
            return unbending.eval_low(light.direction);
        }
        let (high, high_pdf) = bsdf.eval_high(light.direction);
        let (low, low_pdf) = bsdf.eval_low_with_pdf(light.direction);
        let rough_pdf = if shares && bsdf.is_rough() { low_pdf } else { 0.0 };
        low * light.share(rough_pdf) + high * light.share(high_pdf)
    }

    /// Share of met emission that counts: the rest is next-event estimation's at the start of the ray.
    fn emission_share(&self, path: &Path, hit: &Hit) -> f32 {
        if path.bent && self.caustics.is_some_and(|c| c.carry_from(hit.triangle)) {
            return 0.0;
        }
        match path.arrival {
            Arrival::Sharp => 1.0,
            Arrival::Soft => 0.0,
            Arrival::Glossy { pdf, position, normal } => {
                let distance = position.distance(path.ray.at(hit.t));
                let direction = path.ray.direction;
                let light = self.lights.pdf(self.scene, position, normal, direction, distance, hit.triangle);
                pdf / (pdf + light)
            }
        }
    }

    /// Traces all shadow rays of the round and adds what arrives.
    fn trace_shadows(&self, ws: &mut Workspace, coherence: Coherence) {
        ws.transmittance.resize(ws.shadow_rays.len(), Vec3::ZERO);
        let (rays, buffers) = (&ws.shadow_rays, &mut ws.shadow_buffers);
        light_visibility(self.detailed, self.scene, None, rays, coherence, buffers, &mut ws.transmittance);
        for (s, share) in ws.shadows.iter().zip(&ws.transmittance) {
            let sum = if s.gathers { &mut ws.lores } else { &mut ws.hires };
            let radiance = s.radiance * *share;
            sum[s.trial as usize] += radiance * s.guided.factor;
            if let Some(guide) = &mut ws.guide {
                guide.found(&s.guided, radiance);
            }
            if s.gathers {
                ws.counts.shadow_lores += 1;
            } else {
                ws.counts.shadow_hires += 1;
            }
        }
    }
}

/// Next-event estimation: a shadow ray to a sampled light source, whose light is `scattered` (`f cos`).
fn shine(ws: &mut Workspace, path: &Path, point: &SurfacePoint, scattered: Vec3, light: &LightSample, guided: Guided) {
    let radiance = path.throughput * scattered * light.weight;
    if radiance == Vec3::ZERO {
        return;
    }
    ws.shadow_rays.push(ShadowRay::towards(light, point));
    ws.shadows.push(Shadow { radiance, trial: path.trial, gathers: path.gathers, guided });
}

/// Ends a path that brings little, or strengthens it by as much as others end; `u` in 0..1. Nothing is lost on average.
/// With the path comes what is left of `u`: again a number in 0..1.
fn roulette(path: Path, u: f32) -> Option<(Path, f32)> {
    let most = if path.depth < CERTAIN_DEPTH { 1.0 } else { CERTAIN_SURVIVAL };
    let brings = path.throughput.max_element() / ROULETTE_BELOW;
    let survival = if path.depth < ROULETTE_DEPTH { 1.0 } else { brings.min(most) };
    (u < survival).then(|| (Path { throughput: path.throughput / survival, ..path }, u / survival))
}

/// Probability of going on along the highly directional part. Square roots keep weak but sharp reflections of light sources
/// from being rare and bright.
fn choose_high(low: Vec3, high: Vec3) -> f32 {
    if high == Vec3::ZERO {
        return 0.0;
    }
    let (l, h) = (low.element_sum().sqrt(), high.element_sum().sqrt());
    h / (l + h)
}
