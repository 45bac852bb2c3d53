//! Running mean and variance without cancellation.

/// Weighted mean and central second moment (Welford's update in West's weighted form, 1979).
///
/// Raw sums would give the variance as `E[x²] − E[x]²`. That difference loses all digits when the spread is small
/// against the mean. The update used here keeps them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    weight: f64,
    mean: f64,
    /// Σ w·(x − mean)².
    scatter: f64,
}

impl Moments {
    /// Adds `x` with `weight` ≥ 0.
    pub fn add(&mut self, x: f64, weight: f64) {
        self.merge(&Moments { weight, mean: x, scatter: 0.0 });
    }

    /// Adds a set of values of this mean and variance, whose weights sum to `weight` ≥ 0.
    pub fn add_set(&mut self, mean: f64, variance: f64, weight: f64) {
        self.merge(&Moments { weight, mean, scatter: variance * weight });
    }

    pub fn merge(&mut self, other: &Moments) {
        if other.weight <= 0.0 {
            return;
        }
        let weight = self.weight + other.weight;
        let delta = other.mean - self.mean;
        let share = other.weight / weight;
        self.mean += delta * share;
        self.scatter += other.scatter + delta * delta * self.weight * share;
        self.weight = weight;
    }

    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// 0 for an empty set.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Variance of the weighted set itself, not an estimate for a larger population. Never negative; 0 for an empty
    /// set.
    pub fn variance(&self) -> f64 {
        if self.weight > 0.0 { self.scatter / self.weight } else { 0.0 }
    }
}

/// Of values of weight 1.
impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Moments {
        let mut moments = Moments::default();
        values.into_iter().for_each(|value| moments.add(value, 1.0));
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn small_spread_on_a_large_mean_survives() {
        let mut m = Moments::default();
        for x in [1e8, 1e8 + 1.0, 1e8 + 2.0] {
            m.add(x, 1.0);
        }
        assert!((m.mean() - (1e8 + 1.0)).abs() < 1e-6);
        assert!((m.variance() - 2.0 / 3.0).abs() < 1e-6, "{}", m.variance());
    }

    proptest! {
        #[test]
        fn merging_equals_adding(xs in prop::collection::vec((0.0f64..10.0, 0.0f64..2.0), 1..40), cut in 0usize..40) {
            let cut = cut.min(xs.len());
            let mut whole = Moments::default();
            let mut parts = [Moments::default(), Moments::default()];
            for (i, &(x, w)) in xs.iter().enumerate() {
                whole.add(x, w);
                parts[usize::from(i >= cut)].add(x, w);
            }
            let mut merged = parts[0];
            merged.merge(&parts[1]);
            prop_assert!((merged.mean() - whole.mean()).abs() < 1e-9);
            prop_assert!((merged.variance() - whole.variance()).abs() < 1e-9);
            prop_assert!(merged.variance() >= 0.0);
        }
    }
}
