//! A hierarchy of axis-aligned boxes that finds those which meet another box.

use glam::Vec3;

/// Most boxes in a leaf. Between 2 and 8 the time of a query hardly changes.
const LEAF: usize = 4;

/// Lower and upper corner.
pub type Bounds = (Vec3, Vec3);

/// A binary tree, built by splitting at the median of the boxes' middles along the longest axis.
pub struct BoxTree {
    nodes: Vec<Node>,
    /// The boxes of all leaves with their indices in the list that the tree was built from.
    leaves: Vec<(Bounds, u32)>,
}

struct Node {
    bounds: Bounds,
    /// Of a leaf, its part of [`BoxTree::leaves`]. Of an inner node, an empty range.
    leaves: std::ops::Range<u32>,
    /// First node after this one and all nodes below it.
    end: u32,
}

impl BoxTree {
    pub fn new(boxes: impl IntoIterator<Item = Bounds>) -> BoxTree {
        let leaves: Vec<(Bounds, u32)> = boxes.into_iter().zip(0..).collect();
        let mut tree = BoxTree { nodes: Vec::new(), leaves };
        if !tree.leaves.is_empty() {
            tree.split(0, tree.leaves.len());
        }
        tree
    }

    /// Appends the node of `leaves[first..end]` and all nodes below it.
    fn split(&mut self, first: usize, end: usize) {
        let part = &mut self.leaves[first..end];
        let bounds = part.iter().map(|leaf| leaf.0).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default();
        let node = self.nodes.len();
        let is_leaf = end - first <= LEAF;
        let leaves = if is_leaf { first as u32..end as u32 } else { 0..0 };
        self.nodes.push(Node { bounds, leaves, end: 0 });
        if !is_leaf {
            let axis = (bounds.1 - bounds.0).max_position();
            let middle = |leaf: &(Bounds, u32)| leaf.0.0[axis] + leaf.0.1[axis];
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
            self.split(first, first + half);
            self.split(first + half, end);
        }
        self.nodes[node].end = self.nodes.len() as u32;
    }

    /// Calls `found` with the index of every box that meets the box from `low` to `high`, in no particular order.
    pub fn meeting(&self, (low, high): Bounds, mut found: impl FnMut(u32)) {
        let meets = |bounds: &Bounds| bounds.0.cmple(high).all() && bounds.1.cmpge(low).all();
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            if !meets(&node.bounds) {
                i = node.end as usize;
                continue;
            }
            for (bounds, index) in &self.leaves[node.leaves.start as usize..node.leaves.end as usize] {
                if meets(bounds) {
                    found(*index);
                }
            }
            i += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Purpose, Random};

    #[test]
    fn finds_what_a_search_of_all_boxes_finds() {
        let mut random = Random::new(1, Purpose::Pixel, 0, 0);
        let mut draw = |size: f32| {
            let mut at = || Vec3::new(random.uniform(), random.uniform(), random.uniform());
            let low = at();
            (low, low + at() * size)
        };
        for count in [0, 1, 4, 5, 300] {
            let boxes: Vec<Bounds> = (0..count).map(|_| draw(0.2)).collect();
            let tree = BoxTree::new(boxes.iter().copied());
            let mut met = 0;
            for _ in 0..100 {
                let (low, high) = draw(0.3);
                let mut found = Vec::new();
                tree.meeting((low, high), |i| found.push(i));
                found.sort_unstable();
                let meets = |i: &u32| {
                    let (other_low, other_high) = boxes[*i as usize];
                    other_low.cmple(high).all() && other_high.cmpge(low).all()
                };
                let all: Vec<u32> = (0..count).filter(meets).collect();
                assert_eq!(found, all);
                met += all.len();
            }
            assert_eq!(met > 0, count > 1 || met > 0);
        }
    }

    #[test]
    fn equal_boxes_end_in_leaves() {
        let tree = BoxTree::new(std::iter::repeat_n((Vec3::ONE, Vec3::ONE), 1000));
        let mut count = 0;
        tree.meeting((Vec3::ZERO, Vec3::ONE), |_| count += 1);
        assert_eq!(count, 1000);
    }
}
