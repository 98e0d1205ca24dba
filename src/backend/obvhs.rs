//! Pure Rust: the trees are built by `obvhs`, traversal and intersection are here. Validates Embree, slowly.
//!
//! The traversal is not that of `obvhs`: its box test clamps reciprocals of small direction components and allows for
//! no rounding, so it loses hits on rays nearly parallel to an axis.

use std::sync::Arc;
use std::time::Duration;

use ::obvhs::BvhBuildParams;
use ::obvhs::aabb::Aabb;
use ::obvhs::bvh2::Bvh2;
use ::obvhs::bvh2::builder::build_bvh2;
use glam::{Vec3, Vec3A};

use super::triangle::meet_plane;
use super::{Coherence, Hit, HitFilter, PartKind, Ray, RayBackend, RayScene, TriangleSet, Visible};
use crate::error::{Error, Result};

/// Bounding-volume hierarchies of the crate `obvhs` as [`RayBackend`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ObvhsBackend;

impl RayBackend for ObvhsBackend {
    fn name(&self) -> String {
        "obvhs".to_owned()
    }

    fn build(&self, set: &TriangleSet<'_>) -> Result<Box<dyn RayScene>> {
        set.check().map_err(|reason| Error::Backend { backend: "obvhs", reason })?;
        Ok(Box::new(ObvhsScene::build(set)))
    }
}

/// A triangle as leaves hold it.
struct Primitive {
    corners: [Vec3; 3],
    /// Index in [`TriangleSet::triangles`].
    index: u32,
    kind: PartKind,
}

struct ObvhsScene {
    tree: Bvh2,
    /// In the order of the leaves.
    primitives: Vec<Primitive>,
    filter: Option<Arc<dyn HitFilter>>,
}

impl ObvhsScene {
    fn build(set: &TriangleSet<'_>) -> Self {
        let mut primitives: Vec<Primitive> = set
            .parts
            .iter()
            .flat_map(|part| part.triangles.clone().map(|index| (index, part.kind)))
            .map(|(index, kind)| Primitive {
                corners: set.triangles[index as usize].map(|vertex| set.positions[vertex as usize]),
                index,
                kind,
            })
            // As in Embree, what is not finite cannot be hit.
            .filter(|primitive| primitive.corners.iter().all(|corner| corner.is_finite()))
            .collect();
        let boxes: Vec<Aabb> =
            primitives.iter().map(|primitive| Aabb::from_points(&primitive.corners.map(Vec3A::from))).collect();
        // Without spatial splits: each primitive is in one leaf.
        let tree = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let mut rank = vec![0; primitives.len()];
        for (position, &primitive) in (0u32..).zip(&tree.primitive_indices) {
            rank[primitive as usize] = position;
        }
        let mut order: Vec<_> = rank.into_iter().zip(primitives).collect();
        order.sort_unstable_by_key(|&(rank, _)| rank);
        primitives = order.into_iter().map(|(_, primitive)| primitive).collect();
        ObvhsScene { tree, primitives, filter: set.filter.clone() }
    }

    /// Nearest hit of one ray, or any hit when `any`.
    fn trace(&self, ray: &Ray, visible: Visible, any: bool, stack: &mut Vec<(f32, u32)>) -> Hit {
        let mut best = Hit::MISS;
        if self.tree.nodes.is_empty() || !ray.is_usable() {
            return best;
        }
        let slabs = Slabs::new(ray);
        let mut t_far = ray.t_far;
        stack.clear();
        if let Some(t) = slabs.enter(self.tree.nodes[0].aabb(), t_far) {
            stack.push((t, 0));
        }
        while let Some((t, node)) = stack.pop() {
            if t > t_far {
                continue;
            }
            let node = &self.tree.nodes[node as usize];
            let first = node.first_index;
            if node.is_leaf() {
                for primitive in &self.primitives[first as usize..][..node.prim_count as usize] {
                    let Some(hit) = self.hit(ray, primitive, visible) else { continue };
                    // Of equal distances the smallest index counts, whatever the shape of the tree.
                    if (hit.t, hit.triangle) < (best.t, best.triangle) {
                        best = hit;
                        t_far = hit.t;
                        if any {
                            return best;
                        }
                    }
                }
            } else {
                let enter = |child: u32| slabs.enter(self.tree.nodes[child as usize].aabb(), t_far).map(|t| (t, child));
                match (enter(first), enter(first + 1)) {
                    (Some(a), Some(b)) => {
                        let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
                        stack.push(far);
                        stack.push(near);
                    }
                    (one, other) => stack.extend(one.or(other)),
                }
            }
        }
        best
    }

    fn hit(&self, ray: &Ray, primitive: &Primitive, visible: Visible) -> Option<Hit> {
        let seen = match visible {
            Visible::All => true,
            Visible::WithoutPanes => primitive.kind != PartKind::Pane,
            Visible::OnlyPanes => primitive.kind == PartKind::Pane,
        };
        let met = seen.then(|| meet_plane(ray, primitive.corners)).flatten().filter(|met| met.inside())?;
        if met.t < f64::from(ray.t_near).max(0.0) || met.t > f64::from(ray.t_far) {
            return None;
        }
        let [_, u, v] = met.weights.map(|weight| weight as f32);
        let counts = match (primitive.kind, &self.filter) {
            (PartKind::OneSided, _) => met.facing <= 0.0,
            (PartKind::Filtered, Some(filter)) => filter.accepts(primitive.index, u, v),
            _ => true,
        };
        counts.then_some(Hit { t: met.t as f32, u, v, triangle: primitive.index })
    }
}

/// A ray made ready for tests against boxes.
struct Slabs {
    origin: Vec3,
    inverse: Vec3,
    t_near: f32,
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        Slabs { origin: ray.origin, inverse: ray.direction.recip(), t_near: ray.t_near.max(0.0) }
    }

    /// Where the ray enters the box; `None` when it misses it between `t_near` and `t_far`. Never loses a box that
    /// the exact ray meets: the interval is enlarged by its rounding error, three operations for each end (Ize,
    /// Robust BVH Ray Traversal, 2013).
    /// A ray along a side of the box gives 0 * inf = NaN, which `max` and `min` ignore, as they should.
    fn enter(&self, bounds: &Aabb, t_far: f32) -> Option<f32> {
        const ENLARGE: f32 = 1.0 + 4.0 * f32::EPSILON;
        let (low, high) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
        let (mut enter, mut leave) = (self.t_near, t_far);
        for axis in 0..3 {
            let backwards = self.inverse[axis].is_sign_negative();
            let (near, far) = if backwards { (high[axis], low[axis]) } else { (low[axis], high[axis]) };
            enter = enter.max((near - self.origin[axis]) * self.inverse[axis]);
            leave = leave.min((far - self.origin[axis]) * self.inverse[axis]);
        }
        (enter <= leave * ENLARGE).then_some(enter / ENLARGE)
    }
}

impl RayScene for ObvhsScene {
    fn closest(&self, rays: &[Ray], visible: Visible, _coherence: Coherence, hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let mut stack = Vec::with_capacity(self.tree.max_depth + 1);
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.trace(ray, visible, false, &mut stack);
        }
    }

    fn occluded(&self, rays: &[Ray], visible: Visible, _coherence: Coherence, occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let mut stack = Vec::with_capacity(self.tree.max_depth + 1);
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.trace(ray, visible, true, &mut stack).is_hit();
        }
    }

    fn memory_bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice())
            + size_of_val(self.tree.primitive_indices.as_slice())
            + size_of_val(self.primitives.as_slice())
    }
}
