//! A bounding-volume hierarchy over lights, for drawing one in proportion to what it may send to a point.
//!
//! Source: Conty Estévez & Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, 2018. A node bounds
//! its lights' places, normals and power. From a node a draw goes down to one of the two children in proportion to
//! their importance: power × cosine at the light × cosine at the point ÷ distance², each bounded over the node.
//!
//! Draws begin at one of the [`LightTree::groups`]: subtrees that are disjoint and hold all lights. Which group is drawn
//! from is decided elsewhere, by what can reach the point.

use std::collections::BinaryHeap;

use glam::Vec3;

use super::bounds::{LightBounds, halve, split};
use super::receiver::Receiver;
use crate::math::ranked::Ranked;

/// Most groups. Their shares at a place take 4 bytes each.
const MOST_GROUPS: usize = 128;

/// From this depth on nodes are split in the middle of their lights, so that no path is longer than its 64 bits.
const SAFE_DEPTH: u32 = 24;

/// Cosines are computed to a few roundings. A light that just reaches a point must not be ruled out by them.
const COSINE_SLACK: f32 = 1e-3;

/// A node as draws read it.
#[derive(Debug, Clone, Copy)]
struct Node {
    centre: Vec3,
    radius_squared: f32,
    axis: Vec3,
    cos_spread: f32,
    sin_spread: f32,
    cos_reach: f32,
    power: f32,
    range_m: f32,
    two_sided: bool,
    is_light: bool,
    /// The light, or the first of two children beside each other.
    index: u32,
}

/// Where a light lies: its group, and the turns from there on, the first in the lowest bit.
#[derive(Debug, Clone, Copy, Default)]
struct Path {
    group: u16,
    turns: u64,
}

#[derive(Debug, Clone, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// Nodes at which draws begin.
    groups: Vec<u32>,
    paths: Vec<Path>,
}

impl LightTree {
    /// Every light's power is positive and finite.
    pub fn new(lights: &[LightBounds]) -> LightTree {
        let mut tree = LightTree { paths: vec![Path::default(); lights.len()], ..Default::default() };
        if lights.is_empty() {
            return tree;
        }
        let mut order: Vec<u32> = (0..lights.len() as u32).collect();
        let mut bounds = Vec::with_capacity(2 * lights.len());
        tree.nodes.reserve(2 * lights.len());
        tree.push(&mut bounds);
        tree.build(lights, &mut order, 0, 0, &mut bounds);
        tree.cut(&bounds);
        for group in 0..tree.groups.len() {
            tree.number(tree.groups[group], Path { group: group as u16, turns: 0 }, 0);
        }
        tree
    }

    fn push(&mut self, bounds: &mut Vec<Option<LightBounds>>) {
        self.nodes.push(Node::default());
        bounds.push(None);
    }

    /// Builds node `at` over the lights of `order`.
    fn build(
        &mut self,
        lights: &[LightBounds],
        order: &mut [u32],
        at: usize,
        depth: u32,
        bounds: &mut Vec<Option<LightBounds>>,
    ) -> LightBounds {
        if let [light] = order {
            let found = lights[*light as usize];
            (self.nodes[at], bounds[at]) = (Node::new(&found, true, *light), Some(found));
            return found;
        }
        let middle = if depth < SAFE_DEPTH { split(lights, order) } else { halve(lights, order) };
        let (left, right) = order.split_at_mut(middle);
        let first = self.nodes.len();
        self.push(bounds);
        self.push(bounds);
        let left = self.build(lights, left, first, depth + 1, bounds);
        let right = self.build(lights, right, first + 1, depth + 1, bounds);
        let found = left.union(right);
        (self.nodes[at], bounds[at]) = (Node::new(&found, false, first as u32), Some(found));
        found
    }

    /// Cuts the tree into groups. The next to be cut is the one with the largest extent × power^¼: groups shall be compact,
    /// so that one visibility holds for all of a group, and what is much brighter than the rest shall stand alone.
    fn cut(&mut self, bounds: &[Option<LightBounds>]) {
        let candidate = |node: u32| {
            let found = bounds[node as usize];
            let weight = found.map_or(0.0, |b| b.diagonal() * b.power.sqrt().sqrt());
            let weight = if self.nodes[node as usize].is_light { -1.0 } else { weight };
            Ranked { weight, number: node, item: () }
        };
        let mut heap = BinaryHeap::from([candidate(0)]);
        while heap.len() < MOST_GROUPS
            && let Some(Ranked { weight, number: node, .. }) = heap.peek().copied()
            && weight >= 0.0
        {
            heap.pop();
            let first = self.nodes[node as usize].index;
            heap.extend([candidate(first), candidate(first + 1)]);
        }
        self.groups = heap.into_iter().map(|c| c.number).collect();
        // Neighbours in the tree are neighbours in the list.
        self.groups.sort_unstable();
    }

    fn number(&mut self, node: u32, path: Path, depth: u32) {
        let Node { is_light, index, .. } = self.nodes[node as usize];
        if is_light {
            self.paths[index as usize] = path;
            return;
        }
        self.number(index, path, depth + 1);
        self.number(index + 1, Path { turns: path.turns | 1 << depth.min(63), ..path }, depth + 1);
    }

    /// Number of groups.
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    pub fn group_of(&self, light: usize) -> usize {
        usize::from(self.paths[light].group)
    }

    /// Luminance of the irradiance that a group may send to the receiver if nothing occludes it: an estimate, and 0 only
    /// where it sends none.
    pub fn importance(&self, group: usize, receiver: &Receiver) -> f32 {
        self.nodes[self.groups[group] as usize].importance(receiver)
    }

    /// A light of a group, and the probability within it, from a uniform number in [0,1). `None` where none of them can
    /// reach the receiver.
    #[inline]
    pub fn draw(&self, group: usize, receiver: &Receiver, mut number: f64) -> Option<(usize, f32)> {
        let mut node = &self.nodes[self.groups[group] as usize];
        let mut probability = 1.0;
        while !node.is_light {
            let first = self.share_of_first(node, receiver)?;
            let share = f64::from(first);
            if number < share {
                (number, probability) = (number / share, probability * first);
                node = &self.nodes[node.index as usize];
            } else {
                (number, probability) = ((number - share) / (1.0 - share), probability * (1.0 - first));
                node = &self.nodes[node.index as usize + 1];
            }
        }
        Some((node.index as usize, probability))
    }

    /// Probability that [`Self::draw`] gives this light of its group.
    #[inline]
    pub fn probability(&self, light: usize, receiver: &Receiver) -> f32 {
        let Path { group, mut turns } = self.paths[light];
        let mut node = &self.nodes[self.groups[usize::from(group)] as usize];
        let mut probability = 1.0;
        while !node.is_light {
            let Some(first) = self.share_of_first(node, receiver) else { return 0.0 };
            probability *= if turns & 1 == 0 { first } else { 1.0 - first };
            node = &self.nodes[node.index as usize + (turns & 1) as usize];
            turns >>= 1;
        }
        probability
    }

    /// Probability of the first child.
    #[inline]
    fn share_of_first(&self, node: &Node, receiver: &Receiver) -> Option<f32> {
        let [first, second] = [0, 1].map(|i| self.nodes[node.index as usize + i].importance(receiver));
        let share = first / (first + second);
        // 0/0 where neither can reach the receiver.
        (!share.is_nan()).then_some(share)
    }
}

impl Default for Node {
    fn default() -> Self {
        Node {
            centre: Vec3::ZERO,
            radius_squared: 0.0,
            axis: Vec3::Z,
            cos_spread: -1.0,
            sin_spread: 0.0,
            cos_reach: -1.0,
            power: 0.0,
            range_m: 0.0,
            two_sided: false,
            is_light: true,
            index: 0,
        }
    }
}

impl Node {
    fn new(bounds: &LightBounds, is_light: bool, index: u32) -> Node {
        let radius = bounds.diagonal() * 0.5;
        let (sin_spread, cos_spread) = bounds.normals.angle.sin_cos();
        Node {
            centre: bounds.centre(),
            radius_squared: radius * radius,
            axis: bounds.normals.axis,
            cos_spread,
            sin_spread: sin_spread.max(0.0),
            cos_reach: bounds.cos_reach,
            // Sums of powers may reach beyond f32, and shares of theirs must not.
            power: bounds.power.min(f32::MAX * 1e-9),
            range_m: bounds.range_m,
            two_sided: bounds.two_sided,
            is_light,
            index,
        }
    }

    /// See [`LightTree::importance`].
    #[inline]
    fn importance(&self, receiver: &Receiver) -> f32 {
        let to_centre = self.centre - receiver.position;
        let d2 = to_centre.length_squared();
        let r2 = self.radius_squared;
        if d2 <= r2 {
            return self.power / r2.max(1e-20);
        }
        let per_distance = 1.0 / d2.sqrt();
        let sin_size = r2.sqrt() * per_distance;
        if d2.sqrt() * (1.0 - sin_size) > self.range_m {
            return 0.0;
        }
        let size = ((1.0 - sin_size * sin_size).max(0.0).sqrt(), sin_size);
        let mut cosine = -self.axis.dot(to_centre) * per_distance;
        if self.two_sided {
            cosine = cosine.abs();
        }
        let from_normals = minus(with_sine(cosine), (self.cos_spread, self.sin_spread));
        let at_light = minus(from_normals, size).0;
        if at_light <= self.cos_reach - COSINE_SLACK {
            return 0.0;
        }
        let mut at_receiver = 1.0;
        if receiver.has_normal() {
            at_receiver = minus(with_sine(receiver.normal.dot(to_centre) * per_distance), size).0;
            if at_receiver <= -COSINE_SLACK {
                return 0.0;
            }
        }
        self.power * at_light.max(COSINE_SLACK) * at_receiver.max(COSINE_SLACK) / d2
    }
}

#[inline]
fn with_sine(cosine: f32) -> (f32, f32) {
    (cosine, (1.0 - cosine * cosine).max(0.0).sqrt())
}

/// Cosine and sine of the angle a − b, 0 where b is the larger.
#[inline]
fn minus((cos_a, sin_a): (f32, f32), (cos_b, sin_b): (f32, f32)) -> (f32, f32) {
    if cos_a >= cos_b {
        return (1.0, 0.0);
    }
    (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b)
}
