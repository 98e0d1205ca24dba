//! Uniform lines through a cluster, followed until their light leaves it again.
//!
//! A line that starts uniformly on a convex surface and runs inward with a cosine distribution is one of the uniform (isotropic)
//! lines that meet that surface. The share `p` of them that hits a cluster inside is the share of isotropic flux through its
//! bounding box that the cluster intercepts (Cauchy-Crofton).

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::{MARGIN, Probe, face_axes};
use crate::backend::{Coherence, Hit, Ray, Visible};
use crate::sampling;
use crate::scene::Aabb;

/// Bounces after which weak paths are ended at random, without bias.
const ROULETTE_AFTER: u32 = 3;

/// Bounces after which the rest counts as absorbed. Only nearly closed white cavities get there.
const MOST_BOUNCES: u32 = 200;

/// A line, by where it enters the bounding box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Number of the line.
    pub(crate) index: u32,
    /// Face of the bounding box, 0..6.
    pub(crate) face: usize,
    /// Where on the face, 0..=1 along its two axes.
    pub(crate) at: Vec2,
    /// Direction, in the axes of the box.
    pub(crate) direction: Vec3,
}

/// Memory that batches share.
#[derive(Default)]
pub(crate) struct Buffers {
    lines: Vec<Line>,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
    paths: Vec<Path>,
    ends: Vec<LineEnd>,
}

struct Path {
    line: u32,
    weight: Vec3,
}

/// What became of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LineEnd {
    /// It met nothing.
    Through,
    /// It hit the cluster.
    Hit {
        /// The share of its light that leaves the cluster again; the escape albedo is its mean over hits.
        escaped: Vec3,
        /// Where its light went from the first surface.
        first: FirstBounce,
    },
}

/// Where light goes from the first surface that a line hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FirstBounce {
    /// Nowhere, the surface is black.
    Absorbed,
    /// Out of the cluster, or to where a gather ray from there would see it in the detailed scene.
    Seen,
    /// To another part of the cluster farther than the near part of a gather ray reaches: from inside the box, the simplified
    /// scene does not show it.
    Hidden,
}

impl Probe<'_> {
    /// Follows the lines with the given numbers (`0..65536`) and puts each to `visit`. Returns the number of rays traced. `stream` keeps sets of lines independent.
    pub(crate) fn follow_lines(
        &self,
        numbers: Range<u32>,
        stream: u32,
        buffers: &mut Buffers,
        mut visit: impl FnMut(&Line, LineEnd),
    ) -> u64 {
        let Buffers { lines, rays, hits, paths, ends } = buffers;
        lines.clear();
        rays.clear();
        for index in numbers {
            let (line, origin) = uniform_line(&self.bounds, index, stream);
            rays.push(self.ray(origin - MARGIN * line.direction, line.direction));
            lines.push(line);
        }
        ends.clear();
        ends.resize(lines.len(), LineEnd::Through);
        paths.clear();
        paths.extend((0..lines.len() as u32).map(|line| Path { line, weight: Vec3::ONE }));

        let mut traced = 0;
        for bounce in 0..=MOST_BOUNCES {
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            self.rays.closest(rays, Visible::All, Coherence::Incoherent, hits);
            traced += rays.len() as u64;
            let mut alive = 0;
            for i in 0..paths.len() {
                let (line, hit) = (paths[i].line as usize, hits[i]);
                if !hit.is_hit() {
                    if let LineEnd::Hit { escaped, .. } = &mut ends[line] {
                        *escaped = paths[i].weight;
                    }
                    continue;
                }
                let mut weight = paths[i].weight * self.reflectance(hit.triangle, hit.u, hit.v);
                let [u, v, survive, length] = sampling::sobol(lines[line].index, 1 + bounce.min(62), stream);
                match (bounce, &mut ends[line]) {
                    (0, end) => *end = LineEnd::Hit { escaped: Vec3::ZERO, first: FirstBounce::Absorbed },
                    // Near parts of gather rays have these lengths.
                    (1, LineEnd::Hit { first, .. }) if hit.t > self.reach * (0.5 + length) => {
                        *first = FirstBounce::Hidden;
                    }
                    _ => {}
                }
                if bounce >= ROULETTE_AFTER {
                    let chance = weight.max_element().min(1.0);
                    if survive >= chance {
                        continue;
                    }
                    weight /= chance;
                }
                if weight.max_element() > 0.0 {
                    if bounce == 0
                        && let LineEnd::Hit { first, .. } = &mut ends[line]
                    {
                        *first = FirstBounce::Seen;
                    }
                    rays[alive] = self.bounced(&rays[i], &hit, Vec2::new(u, v));
                    paths[alive] = Path { line: line as u32, weight };
                    alive += 1;
                }
            }
            rays.truncate(alive);
            paths.truncate(alive);
            if alive == 0 {
                break;
            }
        }
        for (line, end) in lines.iter().zip(ends.iter()) {
            visit(line, *end);
        }
        traced
    }

    /// The ray that a Lambertian surface reflects, on the side that was hit.
    fn bounced(&self, arriving: &Ray, hit: &Hit, u: Vec2) -> Ray {
        let [a, b, c] = self.triangle(hit.triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(arriving.direction) > 0.0 { -normal } else { normal };
        let position = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        // Rounding of the interpolation and of the plane through the corners (pbrt 4ed 6.8.4), in the normal's direction.
        let error = 8.0 * f32::EPSILON * (position.abs().max_element() + 1.0);
        self.ray(position + error * normal, sampling::basis(normal) * sampling::cosine_hemisphere(u))
    }
}

/// Line number `index` into `bounds` and the point where it enters. Four numbers suffice: the first chooses the face and,
/// stretched again, the position on it.
fn uniform_line(bounds: &Aabb, index: u32, stream: u32) -> (Line, Vec3) {
    let [mut s, t, u, v] = sampling::sobol(index, 0, stream);
    let size = bounds.size();
    let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
    let total: f32 = areas.iter().sum();
    s *= 2.0;
    let far_side = s >= 1.0;
    s = (s - f32::from(u8::from(far_side))) * total;
    let mut axis = 0;
    while axis < 2 && s >= areas[axis] {
        s -= areas[axis];
        axis += 1;
    }
    let at = Vec2::new((s / areas[axis]).clamp(0.0, 1.0), t);
    let face = 2 * axis + usize::from(far_side);
    let (normal_axis, first, second) = face_axes(face);
    let mut origin = if far_side { bounds.max } else { bounds.min };
    origin[first] = bounds.min[first] + at.x * size[first];
    origin[second] = bounds.min[second] + at.y * size[second];
    let local = sampling::cosine_hemisphere(Vec2::new(u, v));
    let mut direction = Vec3::ZERO;
    direction[normal_axis] = if far_side { -local.z } else { local.z };
    direction[first] = local.x;
    direction[second] = local.y;
    (Line { index, face, at, direction }, origin)
}
