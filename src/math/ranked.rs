//! Items in order of a weight, for heaps.

use std::cmp::Ordering;

/// An item that comes before others of less weight; of equal weight, the one of lower `number` comes first.
#[derive(Debug, Clone, Copy)]
pub struct Ranked<T> {
    pub weight: f32,
    pub number: u32,
    pub item: T,
}

impl<T> PartialEq for Ranked<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T> Eq for Ranked<T> {}

impl<T> PartialOrd for Ranked<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Ranked<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.weight.total_cmp(&other.weight).then(other.number.cmp(&self.number))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BinaryHeap;

    use super::*;

    #[test]
    fn the_heaviest_comes_first_and_of_equals_the_first() {
        let ranked = |(number, weight)| Ranked { weight, number, item: () };
        let mut heap: BinaryHeap<_> = [(0, 1.0), (1, 3.0), (2, -1.0), (3, 3.0)].map(ranked).into();
        let order: Vec<u32> = std::iter::from_fn(|| heap.pop()).map(|r| r.number).collect();
        assert_eq!(order, [1, 3, 0, 2]);
    }
}
