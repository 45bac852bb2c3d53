//! Drawing an index by weight in constant time.
//!
//! Source: Vose, *A Linear Algorithm for Generating Random Numbers with a Given Distribution*, 1991. The capture draws
//! one emitter per shadow ray, so a draw must cost far less than a ray. It takes 64 random bits and reads one entry of
//! 8 bytes.

/// A discrete distribution.
#[derive(Debug, Clone)]
pub struct AliasTable {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    /// Probability of the entry's own index, × 2³²: a 32-bit random word below this draws it.
    own: u32,
    /// The index that all other words draw.
    alias: u32,
}

impl AliasTable {
    /// `None` if a weight is negative or not finite, if all are 0, or if there are more than a `u32` can count.
    pub fn new(weights: &[f64]) -> Option<AliasTable> {
        let n = u32::try_from(weights.len()).ok()?;
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) || weights.iter().any(|w| *w < 0.0) {
            return None;
        }
        // Heights of the columns in units of the mean. Columns above 1 give to those below 1 until all are full.
        let mut height: Vec<f64> = weights.iter().map(|w| w / total * f64::from(n)).collect();
        let (mut low, mut high): (Vec<u32>, Vec<u32>) = (0..n).partition(|&i| height[i as usize] < 1.0);
        // Columns that remain when one of the lists is empty have the height 1 up to rounding.
        let mut entries: Vec<Entry> = (0..n).map(|i| Entry { own: u32::MAX, alias: i }).collect();
        while let (Some(&donor), Some(receiver)) = (high.last(), low.pop()) {
            let share = height[receiver as usize];
            entries[receiver as usize] = Entry { own: (share * 2f64.powi(32)) as u32, alias: donor };
            height[donor as usize] -= 1.0 - share;
            if height[donor as usize] < 1.0 {
                high.pop();
                low.push(donor);
            }
        }
        // Rounding may leave a column of weight 0 in `low`. Such a column must never be drawn.
        let heaviest = (0..n).max_by(|&a, &b| weights[a as usize].total_cmp(&weights[b as usize]))?;
        for (entry, _) in entries.iter_mut().zip(weights).filter(|(e, w)| **w == 0.0 && e.own != 0) {
            *entry = Entry { own: 0, alias: heaviest };
        }
        Some(AliasTable { entries })
    }

    /// Turns uniform random bits into an index. Each index has the probability weight ÷ sum of weights.
    #[inline]
    pub fn draw(&self, bits: [u32; 2]) -> usize {
        // The high word of bits × n is the column, uniform up to n/2³². The second word chooses between the column's
        // own index and its alias.
        let column = ((u64::from(bits[0]) * self.entries.len() as u64) >> 32) as usize;
        let entry = self.entries[column];
        if bits[1] < entry.own { column } else { entry.alias as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Purpose, Random};

    #[test]
    fn indices_come_as_often_as_their_weights_say() {
        let weights = [0.0, 1.0, 7.0, 2.0, 0.0, 0.5];
        let table = AliasTable::new(&weights).unwrap();
        let n = 200_000;
        let mut random = Random::new(5, Purpose::Capture, 0, 0);
        let mut count = [0u32; 6];
        (0..n).for_each(|_| count[table.draw([random.bits(), random.bits()])] += 1);
        let total: f64 = weights.iter().sum();
        for (count, weight) in count.into_iter().zip(weights) {
            let p = weight / total;
            // Five standard deviations of a binomial count; none at all without weight.
            let tolerance = 5.0 * (p * (1.0 - p) * f64::from(n)).sqrt();
            assert!((f64::from(count) - p * f64::from(n)).abs() <= tolerance, "{count} for weight {weight}");
        }
    }

    #[test]
    fn only_distributions_have_tables() {
        for weights in [&[] as &[f64], &[0.0], &[-1.0, 2.0], &[f64::NAN], &[f64::INFINITY, 1.0]] {
            assert!(AliasTable::new(weights).is_none(), "{weights:?}");
        }
        assert_eq!(AliasTable::new(&[3.0]).unwrap().draw([u32::MAX, u32::MAX]), 0);
    }
}
