//! A bounding volume hierarchy over light sources, to choose one in proportion to what it may contribute.

use glam::Vec3;

use super::Lit;
use super::bounds::{Bounds, BoundsSum, Emitter, Emitters, Importance, LANES};
use crate::scene::Aabb;

/// Lights of a small tree.
const SMALL: usize = 1024;

/// Candidate planes an axis.
const BUCKETS: usize = 12;

/// A light as the tree sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub bounds: Bounds,
    /// Tighter than the bounds.
    pub emitter: Emitter,
}

/// What is in a lane of a node.
#[derive(Clone, Copy, Debug)]
enum Child {
    Nothing,
    Light(u32),
    Node(u32),
}

/// Up to eight lights or groups of lights.
#[derive(Clone, Debug)]
struct Node {
    emitters: Emitters,
    children: [Child; LANES],
    /// Node and lane that this node is in; of the root without meaning.
    parent: [u32; 2],
}

/// Chooses lights in proportion to their estimated importance.
#[derive(Debug, Default)]
pub(super) struct LightTree {
    /// The root comes first.
    nodes: Vec<Node>,
    /// By light: the node and lane that it is in.
    place: Vec<[u32; 2]>,
}

impl LightTree {
    /// A tree over lights numbered `0..leaves.len()`.
    pub(super) fn new(leaves: &[Leaf]) -> Self {
        let mut tree = LightTree { place: vec![[0; 2]; leaves.len()], ..LightTree::default() };
        if !leaves.is_empty() {
            let mut order: Vec<u32> = (0..leaves.len() as u32).collect();
            tree.build(leaves, &mut order, [0; 2]);
        }
        tree
    }

    /// Whether it holds no light.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Whether 24 random bits are enough to choose between its lights.
    pub(super) fn is_small(&self) -> bool {
        self.place.len() <= SMALL
    }

    /// The first step of a choice at each of some points: the importance of what is in the root. Zero where there is no choice.
    pub(super) fn weigh(&self, lit: &[Lit], at_root: &mut [Importance]) {
        if let (Some(root), 2..) = (self.nodes.first(), self.place.len()) {
            root.emitters.importance_at(lit, at_root);
        }
    }

    /// Whether any light may reach a point with this importance `at_root`.
    pub(super) fn reaches(&self, at_root: &Importance) -> bool {
        self.place.len() == 1 || running_sums(at_root)[LANES - 1] > 0.0
    }

    /// Appends the node over `order` and all nodes below; returns its number.
    fn build(&mut self, leaves: &[Leaf], order: &mut [u32], parent: [u32; 2]) -> u32 {
        let number = self.nodes.len() as u32;
        self.nodes.push(Node { emitters: Emitters::NOTHING, children: [Child::Nothing; LANES], parent });
        for (lane, group) in groups(leaves, order).into_iter().enumerate() {
            let (emitter, child) = if let [light] = *group {
                self.place[light as usize] = [number, lane as u32];
                (leaves[light as usize].emitter, Child::Light(light))
            } else {
                let emitter = Emitter::of(&bounds(leaves, group));
                (emitter, Child::Node(self.build(leaves, group, [number, lane as u32])))
            };
            let node = &mut self.nodes[number as usize];
            node.emitters.set(lane, &emitter);
            node.children[lane] = child;
        }
        number
    }

    /// Chooses a light with `u` in 0..1, where importance is `at_root`; returns it with its probability.
    pub(super) fn sample(&self, at_root: &Importance, position: Vec3, normal: Vec3, mut u: f64) -> Option<(u32, f64)> {
        if self.place.len() == 1 {
            return Some((0, 1.0));
        }
        let mut probability = 1.0;
        let mut node = self.nodes.first()?;
        let mut importance = *at_root;
        loop {
            let sums = running_sums(&importance);
            let total = sums[LANES - 1];
            if total <= 0.0 {
                return None;
            }
            let target = u * f64::from(total);
            // Divides while the lane is still looked for
            let inverse = 1.0 / f64::from(total);
            // Counted without a branch. Lanes without importance end where the one before ends, and are never chosen; nor is
            // what comes after the total, should the target be rounded to it
            let rounded = target as f32;
            let lane = sums.iter().map(|&sum| u32::from((sum <= rounded) & (sum < total))).sum::<u32>() as usize;
            let value = f64::from(importance[lane]);
            probability *= value * inverse;
            match node.children[lane] {
                Child::Nothing => return None,
                Child::Light(light) => return Some((light, probability)),
                Child::Node(number) => {
                    let before = if lane == 0 { 0.0 } else { f64::from(sums[lane - 1]) };
                    node = &self.nodes[number as usize];
                    importance = node.emitters.importance(position, normal);
                    u = ((target - before) / value).clamp(0.0, 1.0 - f64::EPSILON);
                }
            }
        }
    }

    /// Probability with which [`LightTree::sample`] chooses `light`.
    pub(super) fn probability(&self, at_root: &Importance, position: Vec3, normal: Vec3, light: u32) -> f64 {
        if self.place.len() == 1 {
            return 1.0;
        }
        let [mut number, mut lane] = self.place[light as usize];
        let mut probability = 1.0;
        loop {
            let node = &self.nodes[number as usize];
            let importance = if number == 0 { *at_root } else { node.emitters.importance(position, normal) };
            let value = f64::from(importance[lane as usize]);
            if value <= 0.0 {
                return 0.0;
            }
            probability *= value * (1.0 / f64::from(running_sums(&importance)[LANES - 1]));
            if number == 0 {
                return probability;
            }
            [number, lane] = node.parent;
        }
    }
}

/// Sums of the first one, two, .. eight values. Added up so that no sum waits for more than three others; each is at least as large as the
/// one before, and the same where nothing was added.
fn running_sums(&[a, b, c, d, e, f, g, h]: &[f32; LANES]) -> [f32; LANES] {
    let ab = a + b;
    let abcd = ab + (c + d);
    let ef = e + f;
    [a, ab, ab + c, abcd, abcd + e, abcd + ef, abcd + (ef + g), abcd + (ef + (g + h))]
}

fn bounds(leaves: &[Leaf], group: &[u32]) -> Bounds {
    Bounds::around(group.iter().map(|&i| &leaves[i as usize].bounds))
}

/// At most [`LANES`] groups: the most costly is cut in two until there are as many, or each is one light.
fn groups<'a>(leaves: &[Leaf], order: &'a mut [u32]) -> Vec<&'a mut [u32]> {
    let cost = |group: &[u32]| if group.len() > 1 { bounds(leaves, group).cost() } else { 0.0 };
    let mut groups = vec![(cost(order), order)];
    while groups.len() < LANES {
        let many = groups.iter().enumerate().filter(|(_, (_, group))| group.len() > 1);
        let Some((costliest, _)) = many.max_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b)) else { break };
        let (_, group) = groups.remove(costliest);
        let middle = split(leaves, group);
        let (first, second) = group.split_at_mut(middle);
        groups.insert(costliest, (cost(second), second));
        groups.insert(costliest, (cost(first), first));
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// Sorts the lights into two groups and returns the size of the first: the cheapest of the planes between buckets, or halves
/// where all lights are in one place.
fn split(leaves: &[Leaf], order: &mut [u32]) -> usize {
    let bounds = |i: u32| &leaves[i as usize].bounds;
    let centres = Aabb::of(order.iter().map(|&i| bounds(i).aabb.centre()));
    let size = centres.size();
    let longest = size.max_element();
    let bucket = |i: u32, axis: usize| {
        let share = (bounds(i).aabb.centre()[axis] - centres.min[axis]) / size[axis];
        ((share * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&a| size[a] > 0.0) {
        let mut sums = [BoundsSum::default(); BUCKETS];
        for &i in order.iter() {
            sums[bucket(i, axis)].add(bounds(i));
        }
        let mut buckets = sums.map(|s| s.start());
        for &i in order.iter() {
            buckets[bucket(i, axis)].cone.widen(&bounds(i).cone);
        }
        let full = || (0..BUCKETS).filter(|&i| !buckets[i].is_empty());
        for plane in full().skip(1) {
            let [below, above] = [0..plane, plane..BUCKETS]
                .map(|part| Bounds::around(buckets[part].iter().filter(|b| !b.is_empty())).cost());
            // Thin boxes are to be cut across (Conty and Kulla's regularity factor)
            let cost = (longest / size[axis]) * (below + above);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, plane));
            }
        }
    }
    let Some((_, axis, plane)) = best else {
        return order.len() / 2;
    };
    let (first, second): (Vec<u32>, Vec<u32>) = order.iter().partition(|&&i| bucket(i, axis) < plane);
    order[..first.len()].copy_from_slice(&first);
    order[first.len()..].copy_from_slice(&second);
    first.len()
}
