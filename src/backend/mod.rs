//! Ray queries against triangles, behind one trait.
//!
//! Two implementations: [`embree`] (production) and [`obvhs`] (pure Rust, validates the first). Queries go in
//! batches, so that one dynamic call and one crossing of the FFI serve thousands of rays.

pub mod compare;
pub mod edge;
pub mod embree;
pub mod obvhs;
#[cfg(test)]
mod tests;
mod triangle;

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use crate::error::Result;

/// A ray and the part of it that counts, `t_near <= t <= t_far`, in units of the length of `direction`
/// (unit length wherever a distance is meant). A hit at `t = 0` never counts: that is where the ray starts.
/// Hits within a few units in the last place of `t_near` or `t_far` may count or not.
///
/// Rays with NaN or infinite parts (but for `t_far`), without a direction or with `t_far < t_near` hit nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start point, in scene coordinates.
    pub origin: Vec3,
    /// Smallest parameter at which a hit counts; negative is taken as 0.
    pub t_near: f32,
    /// Direction.
    pub direction: Vec3,
    /// Largest parameter at which a hit counts; may be infinite.
    pub t_far: f32,
}

impl Ray {
    /// A ray from `origin` to infinity.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Ray { origin, t_near: 0.0, direction, t_far: f32::INFINITY }
    }

    /// Whether the ray can hit anything at all; see [`Ray`].
    pub fn is_usable(&self) -> bool {
        let Ray { origin, t_near, direction, t_far } = *self;
        origin.is_finite() && direction.is_finite() && direction != Vec3::ZERO && t_near.is_finite() && t_far >= t_near
    }

    /// The point at parameter `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

/// Nearest hit of a ray; `triangle` is [`Hit::NONE`] when nothing was hit.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter of the hit.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
    /// Index of the triangle in [`TriangleSet::triangles`].
    pub triangle: u32,
}

impl Hit {
    /// Value of `triangle` when nothing was hit.
    pub const NONE: u32 = u32::MAX;
    /// A miss.
    pub const MISS: Hit = Hit { t: f32::INFINITY, u: 0.0, v: 0.0, triangle: Hit::NONE };

    /// Whether anything was hit.
    pub fn is_hit(&self) -> bool {
        self.triangle != Hit::NONE
    }
}

/// How rays treat a range of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// Stops every ray, from both sides.
    Opaque,
    /// Stops rays that arrive against the geometric normal (counter-clockwise side); others pass through.
    /// The faces of equivalent boxes.
    OneSided,
    /// Each hit is put to the [`HitFilter`]. Alpha-masked and blended surfaces.
    Filtered,
    /// Transmits without bending the ray (thin or flat glass): shadow rays look for these apart
    /// (see [`Visible`]).
    Pane,
}

/// A range of triangles with one [`PartKind`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Indices into [`TriangleSet::triangles`]; parts do not overlap and together hold every triangle.
    pub triangles: Range<u32>,
    /// How rays treat them.
    pub kind: PartKind,
}

/// Decides whether a hit on a [`PartKind::Filtered`] triangle counts.
pub trait HitFilter: Send + Sync {
    /// `u`, `v` as in [`Hit`]. Must be a pure function: the same arguments give the same answer.
    fn accepts(&self, triangle: u32, u: f32, v: f32) -> bool;
}

/// Triangles to build an acceleration structure over.
#[derive(Clone)]
pub struct TriangleSet<'a> {
    /// Vertex positions.
    pub positions: &'a [Vec3],
    /// Three indices into `positions` for each triangle, counter-clockwise seen from the front.
    pub triangles: &'a [[u32; 3]],
    /// How rays treat which triangles.
    pub parts: &'a [Part],
    /// Asked for hits on [`PartKind::Filtered`] parts; without one these are opaque.
    pub filter: Option<Arc<dyn HitFilter>>,
}

impl TriangleSet<'_> {
    /// Whether the indices stay within what they index, and the parts hold every triangle exactly once.
    ///
    /// # Errors
    /// What is wrong, in words. It is a mistake of the program, not of its input.
    pub fn check(&self) -> std::result::Result<(), String> {
        if self.triangles.len() >= Hit::NONE as usize {
            return Err(format!("{} triangles are more than an index can count", self.triangles.len()));
        }
        let beyond = |index: &u32| *index as usize >= self.positions.len();
        if let Some(triangle) = self.triangles.iter().position(|corners| corners.iter().any(beyond)) {
            return Err(format!(
                "triangle {triangle} has corners {:?}, but there are {} positions",
                self.triangles[triangle],
                self.positions.len()
            ));
        }
        let mut ranges: Vec<_> =
            self.parts.iter().map(|part| &part.triangles).filter(|range| !range.is_empty()).collect();
        ranges.sort_by_key(|range| range.start);
        let covered = ranges.iter().try_fold(0, |end, range| (range.start == end).then_some(range.end));
        if covered.map(|end| end as usize) != Some(self.triangles.len()) {
            return Err(format!("the parts do not hold each of {} triangles once", self.triangles.len()));
        }
        Ok(())
    }
}

/// Which parts a batch of rays sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visible {
    /// All parts.
    All,
    /// All but [`PartKind::Pane`].
    WithoutPanes,
    /// Only [`PartKind::Pane`].
    OnlyPanes,
}

/// A hint on how much neighbouring rays of a batch have in common. Changes the result no more than rounding does.
///
/// Embree takes coherent rays through the tree in packets of eight: 2 to 3 times as fast when the hint is right, half as
/// fast when it is wrong. Order camera rays by small blocks of pixels, not by rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Neighbours start close together and run nearly parallel (camera rays, shadow rays to one light).
    Coherent,
    /// Anything else.
    Incoherent,
}

/// A committed, immutable set of triangles that rays can be traced against from any thread.
pub trait RayScene: Send + Sync {
    /// Nearest hit of each ray. `hits` has the length of `rays`.
    fn closest(&self, rays: &[Ray], visible: Visible, coherence: Coherence, hits: &mut [Hit]);

    /// Whether anything lies between `t_near` and `t_far` of each ray. `occluded` has the length of `rays`.
    fn occluded(&self, rays: &[Ray], visible: Visible, coherence: Coherence, occluded: &mut [bool]);

    /// Bytes held by the acceleration structure, as far as the library tells.
    fn memory_bytes(&self) -> usize;
}

/// A ray-tracing library.
pub trait RayBackend: Send + Sync {
    /// `embree` or `obvhs`, with the library's version.
    fn name(&self) -> String;

    /// Builds the acceleration structure. Call outside of rayon's threads: libraries bring their own.
    ///
    /// # Errors
    /// [`Error::Backend`](crate::error::Error::Backend) when the library refuses or memory runs out.
    fn build(&self, set: &TriangleSet<'_>) -> Result<Box<dyn RayScene>>;
}
