//! A bounding volume hierarchy over light sources, to choose one in proportion to what it may contribute.

use super::bounds::{Bounds, Emitter};

use glam::Vec3;

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
    /// Number of the light.
    pub light: u32,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    emitter: Emitter,
    parent: u32,
    /// Inner nodes: the second child (the first comes right after the node). Leaves: the first slot.
    index: u32,
    /// Number of lights in a leaf; 0 for inner nodes.
    count: u32,
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
    pub(super) fn new(mut leaves: Vec<Leaf>) -> Self {
        let mut tree = LightTree { slot_of_light: vec![[0; 2]; leaves.len()], ..LightTree::default() };
        if !leaves.is_empty() {
            let limit = if leaves.len() <= FLAT { FLAT } else { LEAF };
            tree.build(&mut leaves, NONE, limit);
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

    fn build(&mut self, leaves: &mut [Leaf], parent: u32, limit: usize) {
        let bounds = leaves.iter().fold(Bounds::EMPTY, |b, l| b.union(l.bounds));
        let number = self.nodes.len() as u32;
        let slot = self.emitters.len() as u32;
        let count = if leaves.len() <= limit { leaves.len() as u32 } else { 0 };
        self.nodes.push(Node { emitter: Emitter::of(&bounds), parent, index: slot, count });
        if count > 0 {
            for leaf in leaves {
                self.slot_of_light[leaf.light as usize] = [self.emitters.len() as u32, number];
                self.emitters.push(leaf.emitter);
                self.light_of_slot.push(leaf.light);
            }
            return;
        }
        let middle = split(leaves);
        let (first, second) = leaves.split_at_mut(middle);
        self.build(first, number, limit);
        self.nodes[number as usize].index = self.nodes.len() as u32;
        self.build(second, number, limit);
    }

    /// Chooses a light with `u` in 0..1; returns it with its probability.
    pub(super) fn sample(&self, position: Vec3, normal: Vec3, mut u: f64) -> Option<(u32, f64)> {
        if self.emitters.len() == 1 {
            return Some((0, 1.0));
        }
        let mut probability = 1.0;
        let mut number = 0;
        let mut node = self.nodes.first()?;
        while node.count == 0 {
            let children = [number + 1, node.index as usize];
            let [p0, p1] = self.shares(children, position, normal)?;
            number = if u < p0 {
                u /= p0;
                probability *= p0;
                children[0]
            } else {
                u = ((u - p0) / p1).min(1.0 - f64::EPSILON);
                probability *= p1;
                children[1]
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
        if !(sum > 0.0) {
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
            let children = [parent as usize + 1, self.nodes[parent as usize].index as usize];
            let Some(shares) = self.shares(children, position, normal) else {
                return 0.0;
            };
            probability *= shares[usize::from(number as usize == children[1])];
            number = parent;
        }
        probability
    }

    fn shares(&self, children: [usize; 2], position: Vec3, normal: Vec3) -> Option<[f64; 2]> {
        let [a, b] = children.map(|c| f64::from(self.nodes[c].emitter.importance(position, normal)));
        let sum = a + b;
        (sum > 0.0).then(|| [a / sum, b / sum])
    }
}

/// Sorts the lights into two groups and returns the size of the first: the cheapest of the planes between buckets, or halves
/// where all lights are in one place.
fn split(leaves: &mut [Leaf]) -> usize {
    let centre = |leaf: &Leaf| leaf.bounds.aabb.centre();
    let centres = crate::scene::Aabb::of(leaves.iter().map(centre));
    let size = centres.size();
    let longest = size.max_element();
    let bucket = |leaf: &Leaf, axis: usize| {
        let share = (centre(leaf)[axis] - centres.min[axis]) / size[axis];
        ((share * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&a| size[a] > 0.0) {
        let mut buckets = [Bounds::EMPTY; BUCKETS];
        for leaf in leaves.iter() {
            let b = &mut buckets[bucket(leaf, axis)];
            *b = b.union(leaf.bounds);
        }
        let mut above = [0.0; BUCKETS];
        let mut group = Bounds::EMPTY;
        for i in (1..BUCKETS).rev() {
            group = group.union(buckets[i]);
            above[i] = group.cost();
        }
        group = Bounds::EMPTY;
        for i in 1..BUCKETS {
            group = group.union(buckets[i - 1]);
            // Thin boxes are to be cut across (Conty and Kulla's regularity factor)
            let cost = (longest / size[axis]) * (group.cost() + above[i]);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let middle = match best {
        None => 0,
        Some((_, axis, plane)) => {
            // Stable, so that the result does not depend on the sorting algorithm
            leaves.sort_by_key(|leaf| bucket(leaf, axis) >= plane);
            leaves.partition_point(|leaf| bucket(leaf, axis) < plane)
        }
    };
    if middle == 0 || middle == leaves.len() { leaves.len() / 2 } else { middle }
}
