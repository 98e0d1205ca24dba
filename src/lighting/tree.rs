//! A bounding volume hierarchy over light sources, to choose one in proportion to what it may contribute.

use glam::Vec3;

use super::bounds::{Bounds, BoundsSum, Emitter};
use crate::scene::Aabb;

/// Up to so many lights are compared one by one.
const FLAT: usize = 16;
/// Lights in a leaf of a larger tree.
const LEAF: usize = 4;
/// Candidate planes an axis.
const BUCKETS: usize = 12;
/// Index of no node.
const NONE: u32 = u32::MAX;

/// A light as the tree sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub bounds: Bounds,
    /// Tighter than the bounds.
    pub emitter: Emitter,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    emitter: Emitter,
    parent: u32,
    /// Inner nodes: the first child, the second comes right after it. Leaves: the first slot.
    index: u32,
    /// Number of lights in a leaf; 0 for inner nodes.
    count: u32,
}

impl Node {
    const NEW: Node = Node { emitter: Emitter::NOTHING, parent: NONE, index: 0, count: 0 };
}

/// Chooses lights in proportion to their estimated importance.
#[derive(Debug, Default)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// Lights in the order of the leaves.
    emitters: Vec<Emitter>,
    light_of_slot: Vec<u32>,
    /// By light: its slot, and the leaf that holds it.
    slot_of_light: Vec<[u32; 2]>,
}

impl LightTree {
    /// A tree over lights numbered `0..leaves.len()`.
    pub(super) fn new(leaves: &[Leaf]) -> Self {
        let mut tree = LightTree { slot_of_light: vec![[0; 2]; leaves.len()], ..LightTree::default() };
        if !leaves.is_empty() {
            let limit = if leaves.len() <= FLAT { FLAT } else { LEAF };
            let mut order: Vec<u32> = (0..leaves.len() as u32).collect();
            tree.nodes.push(Node::NEW);
            tree.build(leaves, &mut order, 0, limit);
        }
        tree
    }

    /// Whether it holds no light.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Whether any light may reach the point.
    pub(super) fn reaches(&self, position: Vec3, normal: Vec3) -> bool {
        match self.nodes.first() {
            None => false,
            Some(root) => self.emitters.len() == 1 || root.emitter.importance(position, normal) > 0.0,
        }
    }

    fn build(&mut self, leaves: &[Leaf], order: &mut [u32], number: usize, limit: usize) {
        let bounds = Bounds::around(order.iter().map(|&i| &leaves[i as usize].bounds));
        self.nodes[number].emitter = Emitter::of(&bounds);
        if order.len() <= limit {
            self.nodes[number].index = self.emitters.len() as u32;
            self.nodes[number].count = order.len() as u32;
            for &light in order.iter() {
                self.slot_of_light[light as usize] = [self.emitters.len() as u32, number as u32];
                self.emitters.push(leaves[light as usize].emitter);
                self.light_of_slot.push(light);
            }
            return;
        }
        let child = self.nodes.len();
        self.nodes[number].index = child as u32;
        self.nodes.extend([Node { parent: number as u32, ..Node::NEW }; 2]);
        let middle = split(leaves, order);
        let (first, second) = order.split_at_mut(middle);
        self.build(leaves, first, child, limit);
        self.build(leaves, second, child + 1, limit);
    }

    /// Chooses a light with `u` in 0..1; returns it with its probability.
    pub(super) fn sample(&self, position: Vec3, normal: Vec3, mut u: f64) -> Option<(u32, f64)> {
        if self.emitters.len() == 1 {
            return Some((0, 1.0));
        }
        let mut probability = 1.0;
        let mut node = self.nodes.first()?;
        while node.count == 0 {
            let child = node.index as usize;
            let [p0, p1] = self.shares(child, position, normal)?;
            let number = if u < p0 {
                u /= p0;
                probability *= p0;
                child
            } else {
                u = ((u - p0) / p1).min(1.0 - f64::EPSILON);
                probability *= p1;
                child + 1
            };
            node = &self.nodes[number];
        }
        let mut importance = [0.0_f32; FLAT];
        let count = node.count as usize;
        let slots = &self.emitters[node.index as usize..][..count];
        let mut sum = 0.0;
        for (value, emitter) in importance.iter_mut().zip(slots) {
            *value = emitter.importance(position, normal);
            sum += f64::from(*value);
        }
        if sum <= 0.0 {
            return None;
        }
        let mut rest = u * sum;
        // The last that is not zero, should rounding let the sum run out
        let mut chosen = None;
        for (i, &value) in importance[..count].iter().enumerate() {
            if value > 0.0 {
                chosen = Some((i, f64::from(value)));
                if rest < f64::from(value) {
                    break;
                }
                rest -= f64::from(value);
            }
        }
        let (i, value) = chosen?;
        Some((self.light_of_slot[node.index as usize + i], probability * value / sum))
    }

    /// Probability with which [`LightTree::sample`] chooses `light`.
    pub(super) fn probability(&self, position: Vec3, normal: Vec3, light: u32) -> f64 {
        if self.emitters.len() == 1 {
            return 1.0;
        }
        let [slot, mut number] = self.slot_of_light[light as usize];
        let leaf = &self.nodes[number as usize];
        let sum: f64 = self.emitters[leaf.index as usize..][..leaf.count as usize]
            .iter()
            .map(|e| f64::from(e.importance(position, normal)))
            .sum();
        let mut probability = f64::from(self.emitters[slot as usize].importance(position, normal));
        if probability == 0.0 {
            return 0.0;
        }
        probability /= sum;
        while number != 0 && probability > 0.0 {
            let parent = self.nodes[number as usize].parent;
            let child = self.nodes[parent as usize].index;
            let Some(shares) = self.shares(child as usize, position, normal) else {
                return 0.0;
            };
            probability *= shares[(number - child) as usize];
            number = parent;
        }
        probability
    }

    /// How probable the two children starting at `child` are.
    fn shares(&self, child: usize, position: Vec3, normal: Vec3) -> Option<[f64; 2]> {
        let [a, b] = [child, child + 1].map(|c| f64::from(self.nodes[c].emitter.importance(position, normal)));
        let sum = a + b;
        (sum > 0.0).then(|| [a / sum, b / sum])
    }
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
