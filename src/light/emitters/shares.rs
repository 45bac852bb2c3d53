//! How often a place draws from each group of emitters.

/// A distribution over groups, every one of them with a positive probability.
#[derive(Debug, Clone, PartialEq)]
pub struct Shares {
    /// Sums of the probabilities up to and with each group; the last is 1.
    cumulative: Box<[f32]>,
    /// Share of samples that had best be cosine-distributed instead, 0 to 1.
    pub cosine: f32,
    /// Whether light of any emitter was seen to arrive.
    pub lit: bool,
}

impl Shares {
    /// In proportion to these weights, finite and not negative; evenly where all are 0.
    pub fn new(weights: &[f64]) -> Shares {
        let total: f64 = weights.iter().sum();
        let even = 1.0 / weights.len().max(1) as f64;
        let mut sum = 0.0;
        let add = |weight: &f64| {
            sum += if total > 0.0 { weight / total } else { even };
            sum as f32
        };
        let mut cumulative: Box<[f32]> = weights.iter().map(add).collect();
        // Whatever the rounding of the sum.
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        Shares { cumulative, cosine: 0.0, lit: false }
    }

    /// Probability of a group.
    #[inline]
    pub fn of(&self, group: usize) -> f32 {
        let below = if group == 0 { 0.0 } else { self.cumulative[group - 1] };
        self.cumulative[group] - below
    }

    /// A group, and its probability, from a uniform number in [0,1).
    #[inline]
    pub fn draw(&self, number: f32) -> (usize, f32) {
        let group = self.cumulative.partition_point(|&sum| sum <= number).min(self.cumulative.len().saturating_sub(1));
        (group, self.of(group))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_drawn_as_often_as_their_weights_say() {
        let shares = Shares::new(&[1.0, 0.0, 5.0, 2.0]);
        let n = 1 << 16;
        let mut count = [0; 4];
        (0..n).for_each(|i| count[shares.draw(i as f32 / n as f32).0] += 1);
        // Eighths of a power of two are exact.
        assert_eq!(count, [n / 8, 0, n / 8 * 5, n / 4]);
        for (group, count) in count.into_iter().enumerate() {
            assert_eq!(shares.of(group), count as f32 / n as f32);
        }
        assert_eq!(Shares::new(&[0.0, 0.0]).of(1), 0.5);
    }
}
