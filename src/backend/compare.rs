//! Two ray-tracing libraries against each other, ray by ray, every difference explained or counted as a failure.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::triangle::{PlaneHit, meet_plane};
use super::{Coherence, Hit, PartKind, Ray, RayScene, TriangleSet, Visible};

/// Unit roundoff of f32.
const U: f64 = f32::EPSILON as f64 / 2.0;
/// Rays per batch.
const BATCH: usize = 4096;
/// Points along each axis of the rounding bound at which a filter is asked whether it would refuse a hit. Many, since what
/// is present with a probability (blended surfaces) is decided for each point by itself.
const PROBES: u32 = 64;
/// Differences kept to be shown.
const EXAMPLES: usize = 16;

/// How the answers of two scenes to the same rays compare.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Number of rays.
    pub rays: u64,
    /// Rays that missed in both.
    pub misses: u64,
    /// Rays that hit the same triangle in both, at distances and weights within the rounding bound.
    pub identical: u64,
    /// Different triangles at the same distance within the rounding bound: shared edges, coplanar surfaces.
    pub tied: u64,
    /// One scene has a hit that the other has not, where rounding decides: on a triangle's outline, at an end of the
    /// ray, at grazing incidence, where a filter changes its mind.
    pub borderline: u64,
    /// Differences that rounding does not explain: failures.
    pub unexplained: u64,
    /// The first unexplained differences.
    pub examples: Vec<Difference>,
}

/// A ray that two scenes answer differently.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The ray.
    pub ray: Ray,
    /// Answer of the first scene.
    pub a: Hit,
    /// Answer of the second scene.
    pub b: Hit,
    /// Whether they are occluded, which may contradict the hits.
    pub occluded: [bool; 2],
}

impl Comparison {
    /// Both together.
    pub fn merge(mut self, other: Comparison) -> Comparison {
        self.rays += other.rays;
        self.misses += other.misses;
        self.identical += other.identical;
        self.tied += other.tied;
        self.borderline += other.borderline;
        self.unexplained += other.unexplained;
        let room = EXAMPLES - self.examples.len();
        self.examples.extend(other.examples.into_iter().take(room));
        self
    }
}

/// Traces `rays` (nearest hit and occlusion) through `a` and `b`, both built from `set`, and explains each difference
/// by the bound of the rounding errors of a ray-triangle test in f32, measured against the same test in f64.
pub fn compare(
    rays: &[Ray],
    visible: Visible,
    coherence: Coherence,
    a: &dyn RayScene,
    b: &dyn RayScene,
    set: &TriangleSet<'_>,
) -> Comparison {
    let judge = Judge::new(set);
    let batches: Vec<_> = rays
        .par_chunks(BATCH)
        .map(|rays| {
            let mut hits = [vec![Hit::MISS; rays.len()], vec![Hit::MISS; rays.len()]];
            let mut occluded = [vec![false; rays.len()], vec![false; rays.len()]];
            for (scene, (hits, occluded)) in [a, b].into_iter().zip(hits.iter_mut().zip(&mut occluded)) {
                scene.closest(rays, visible, coherence, hits);
                scene.occluded(rays, visible, coherence, occluded);
            }
            let mut result = Comparison { rays: rays.len() as u64, ..Comparison::default() };
            for (i, &ray) in rays.iter().enumerate() {
                let (a, b, occluded) = (hits[0][i], hits[1][i], [occluded[0][i], occluded[1][i]]);
                match judge.verdict(&ray, a, b, occluded) {
                    Verdict::Miss => result.misses += 1,
                    Verdict::Identical => result.identical += 1,
                    Verdict::Tied => result.tied += 1,
                    Verdict::Borderline => result.borderline += 1,
                    Verdict::Unexplained => {
                        result.unexplained += 1;
                        if result.examples.len() < EXAMPLES {
                            result.examples.push(Difference { ray, a, b, occluded });
                        }
                    }
                }
            }
            result
        })
        .collect();
    batches.into_iter().fold(Comparison::default(), Comparison::merge)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Miss,
    Identical,
    Tied,
    Borderline,
    Unexplained,
}

/// A hit seen in f64, and how far an f32 library may be off.
struct Exact {
    met: PlaneHit,
    /// Bound of the error of `t`.
    dt: f64,
    /// Bound of the error of each weight.
    dw: f64,
    /// Bound of the error of `facing`.
    dfacing: f64,
}

impl Exact {
    /// First-order error bounds of the test that starts with corners relative to the ray's origin (Plücker; Embree's
    /// robust mode), in units of the roundoff `U`. The difference corner - origin is off by its length, which is the
    /// same as if the corner had been moved by that; what follows works with lengths of the triangle's own size: a
    /// cross product is off by five roundings (two of its factors, three of its own), a dot product by three.
    fn new(ray: &Ray, corners: [Vec3; 3]) -> Option<Exact> {
        let met = meet_plane(ray, corners)?;
        let origin = ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3();
        let speed = direction.length();
        let [a, b, c] = corners.map(|corner| corner.as_dvec3() - origin);
        let largest = |lengths: [f64; 3]| lengths.into_iter().fold(0.0, f64::max);
        let reach = largest([a, b, c].map(DVec3::length));
        let edge = largest([b - a, c - b, a - c].map(DVec3::length));
        let normal = (b - a).cross(c - a).length();
        // A corner moved by d changes d . (other corner x direction), i.e. by the other's distance from the ray.
        let from_ray = largest([a, b, c].map(|corner| corner.cross(direction).length() / speed));
        let volume_off = U * speed * reach * (2.0 * from_ray + 8.0 * edge);
        let facing_off = U * speed * (3.0 * reach * edge + 5.0 * edge * edge + 3.0 * normal);
        let facing = met.facing.abs();
        // A divisor that may be zero makes every quotient possible.
        let quotient = |off: f64| if off < facing { 1.0 / (facing - off) } else { f64::INFINITY };

        // Embree does not divide by less than this (twice the facing), it answers u = v = 0.
        let undivided = if 2.0 * facing < 1.01e-18 { 1.0 } else { 0.0 };

        let weight = largest(met.weights.map(f64::abs)).max(1.0);
        let from_hit = largest([a, b, c].map(|corner| (corner - met.t * direction).length()));
        // Moved corners move the plane at the hit by their weighted mean; a normal that is off turns it around a corner.
        let height_off =
            U * (3.0 * weight * reach * normal + 5.0 * edge * edge * from_hit + 6.0 * normal * (reach + from_hit));
        Some(Exact {
            met,
            dt: height_off * quotient(facing_off) + 4.0 * U * met.t.abs(),
            dw: (1.0 + 3.0 * weight) * volume_off * quotient(3.0 * volume_off) + 4.0 * U * weight + undivided,
            dfacing: facing_off,
        })
    }
}

struct Judge<'a> {
    set: &'a TriangleSet<'a>,
    /// Parts by the first of their triangles.
    kinds: Vec<(u32, PartKind)>,
}

impl<'a> Judge<'a> {
    fn new(set: &'a TriangleSet<'a>) -> Self {
        let mut kinds: Vec<_> = set
            .parts
            .iter()
            .filter(|part| !part.triangles.is_empty())
            .map(|part| (part.triangles.start, part.kind))
            .collect();
        kinds.sort_by_key(|&(start, _)| start);
        Judge { set, kinds }
    }

    fn verdict(&self, ray: &Ray, a: Hit, b: Hit, occluded: [bool; 2]) -> Verdict {
        let exact = |hit: Hit| hit.is_hit().then(|| self.exact(ray, hit.triangle)).flatten();
        let (exact_a, exact_b) = (exact(a), exact(b));
        let same = match (&exact_a, &exact_b) {
            (None, None) if !a.is_hit() && !b.is_hit() => Verdict::Miss,
            (Some(ea), Some(eb)) if self.possible(ray, a, ea) && self.possible(ray, b, eb) => {
                if a.triangle == b.triangle {
                    Verdict::Identical
                } else if (ea.met.t - eb.met.t).abs() <= ea.dt + eb.dt {
                    Verdict::Tied
                } else {
                    let (nearer, exact) = if ea.met.t < eb.met.t { (a, ea) } else { (b, eb) };
                    self.may_be_missed(ray, nearer, exact)
                }
            }
            (Some(exact), None) if !b.is_hit() && self.possible(ray, a, exact) => self.may_be_missed(ray, a, exact),
            (None, Some(exact)) if !a.is_hit() && self.possible(ray, b, exact) => self.may_be_missed(ray, b, exact),
            _ => Verdict::Unexplained,
        };
        // Whether anything is hit must not depend on how it is asked for.
        if occluded == [a.is_hit(), b.is_hit()] { same } else { Verdict::Unexplained }
    }

    fn exact(&self, ray: &Ray, triangle: u32) -> Option<Exact> {
        let corners = self.set.triangles.get(triangle as usize)?;
        Exact::new(ray, corners.map(|vertex| self.set.positions[vertex as usize]))
    }

    fn kind(&self, triangle: u32) -> PartKind {
        // The first part starts at 0: `TriangleSet::check` has seen to it when the scenes were built.
        self.kinds[self.kinds.partition_point(|&(start, _)| start <= triangle) - 1].1
    }

    /// Whether a library that rounds may report `hit`.
    fn possible(&self, ray: &Ray, hit: Hit, exact: &Exact) -> bool {
        let Exact { met, dt, dw, dfacing } = exact;
        let in_place = (f64::from(hit.t) - met.t).abs() <= *dt
            && (f64::from(hit.u) - met.weights[1]).abs() <= *dw
            && (f64::from(hit.v) - met.weights[2]).abs() <= *dw;
        let in_triangle = met.weights.iter().all(|weight| *weight >= -dw);
        let in_range = hit.t >= ray.t_near && hit.t <= ray.t_far;
        let faces = self.kind(hit.triangle) != PartKind::OneSided || met.facing <= *dfacing;
        let accepted = match (self.kind(hit.triangle), &self.set.filter) {
            (PartKind::Filtered, Some(filter)) => filter.accepts(hit.triangle, hit.u, hit.v),
            _ => true,
        };
        in_place && in_triangle && in_range && faces && accepted
    }

    /// Whether a library that rounds may overlook this possible `hit`.
    fn may_be_missed(&self, ray: &Ray, hit: Hit, exact: &Exact) -> Verdict {
        let Exact { met, dt, dw, dfacing } = exact;
        let outline = met.weights.iter().any(|weight| *weight <= *dw);
        let end = met.t - dt <= f64::from(ray.t_near).max(0.0) || met.t + dt >= f64::from(ray.t_far);
        let kind = self.kind(hit.triangle);
        let grazing = kind == PartKind::OneSided && met.facing >= -dfacing;
        let doubtful = match (kind, &self.set.filter) {
            (PartKind::Filtered, Some(filter)) => {
                let offset = |i: u32| (2.0 * f64::from(i) / f64::from(PROBES - 1) - 1.0) * dw;
                (0..PROBES * PROBES)
                    .map(|i| (met.weights[1] + offset(i % PROBES), met.weights[2] + offset(i / PROBES)))
                    .any(|(u, v)| !filter.accepts(hit.triangle, u as f32, v as f32))
            }
            _ => false,
        };
        if outline || end || grazing || doubtful { Verdict::Borderline } else { Verdict::Unexplained }
    }
}
