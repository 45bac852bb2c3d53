//! What nothing beats: the Pareto front of cost and error, values between its points, the cheapest at each level.

/// Whether each point (cost, error) is on the front: no other is at most as large in both and smaller in one. Points that are not
/// finite are not.
pub fn pareto(points: &[(f64, f64)]) -> Vec<bool> {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let beats = |a: &(f64, f64), b: &(f64, f64)| finite(a) && a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|p| finite(p) && !points.iter().any(|other| beats(other, p))).collect()
}

/// Error at a cost, along a front: straight lines between its points on logarithmic axes, beyond its dearest point that point's error.
/// `None` below its cheapest one. A point whose cost or error is 0 has no logarithm: the step is then where the dearer point is.
pub fn interpolate(points: &[(f64, f64)], cost: f64) -> Option<f64> {
    let on_front = pareto(points);
    let mut front: Vec<(f64, f64)> = points.iter().zip(on_front).filter(|(_, on)| *on).map(|(p, _)| *p).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let next = front.partition_point(|p| p.0 <= cost);
    let before = front.get(next.checked_sub(1)?)?;
    let Some(after) = front.get(next) else { return Some(before.1) };
    if before.0 <= 0.0 || before.1 <= 0.0 || after.1 <= 0.0 {
        return Some(before.1);
    }
    let share = (cost / before.0).ln() / (after.0 / before.0).ln();
    Some(before.1 * (after.1 / before.1).powf(share))
}

/// Mantissas of error levels.
const LEVELS: [f64; 3] = [5.0, 2.0, 1.0];

/// Round levels (1, 2, 5 times powers of ten) from just above the largest of these errors down to just above the smallest.
pub fn levels(errors: &[f64]) -> Vec<f64> {
    let usable = || errors.iter().copied().filter(|e| e.is_finite() && *e > 0.0);
    let (low, high) = (usable().fold(f64::INFINITY, f64::min), usable().fold(0.0, f64::max));
    if low > high {
        return Vec::new();
    }
    let exponents = (low.log10().floor() as i32..=high.log10().ceil() as i32).rev();
    let all: Vec<f64> = exponents.flat_map(|e| LEVELS.map(|m| rounded(m, e))).collect();
    // The least that all meet, and from there on all that some do.
    let first = all.iter().rposition(|level| *level >= high).unwrap_or(0);
    all[first..].iter().copied().filter(|level| *level >= low).collect()
}

/// m × 10^e as its decimal digits are read, which a product of powers is not.
fn rounded(mantissa: f64, exponent: i32) -> f64 {
    format!("{mantissa}e{exponent}").parse().unwrap_or(mantissa * 10f64.powi(exponent))
}

/// The cheapest of these points (cost, error) with at most this error: its index. The first of equals.
pub fn cheapest(points: &[(f64, f64)], error: f64) -> Option<usize> {
    let fits = |(_, p): &(usize, &(f64, f64))| p.1 <= error && p.0.is_finite();
    points.iter().enumerate().filter(fits).min_by(|a, b| a.1.0.total_cmp(&b.1.0)).map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn beaten_points_are_not_on_the_front() {
        let points =
            [(1.0, 8.0), (2.0, 4.0), (2.0, 5.0), (3.0, 4.0), (4.0, 1.0), (f64::NAN, 0.0), (5.0, f64::INFINITY)];
        assert_eq!(pareto(&points), [true, true, false, false, true, false, false]);
        // Equals do not beat each other.
        assert_eq!(pareto(&[(1.0, 1.0), (1.0, 1.0)]), [true, true]);
        assert!(pareto(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn fronts_fall_and_beat_all_else(points in prop::collection::vec((0u8..20, 0u8..20), 1..40)) {
            let points: Vec<(f64, f64)> = points.into_iter().map(|(a, b)| (a.into(), b.into())).collect();
            let on = pareto(&points);
            for (i, p) in points.iter().enumerate() {
                let beaten = points.iter().zip(&on).any(|(q, on)| *on && q.0 <= p.0 && q.1 <= p.1 && q != p);
                prop_assert_eq!(beaten, !on[i]);
            }
        }
    }

    /// error = 12/√cost is a straight line on logarithmic axes.
    #[test]
    fn power_laws_are_met_between_the_points() {
        let law = |cost: f64| 12.0 / cost.sqrt();
        let points = [4.0, 1.0, 9.0, 100.0].map(|cost| (cost, law(cost)));
        for cost in [1.0, 1.5, 4.0, 50.0, 100.0] {
            assert!((interpolate(&points, cost).unwrap() - law(cost)).abs() < 1e-12, "{cost}");
        }
        assert_eq!(interpolate(&points, 0.9), None);
        assert_eq!(interpolate(&points, 1e6), Some(law(100.0)));
        // A beaten point plays no part.
        let with = [&points[..], &[(2.0, 12.5)]].concat();
        assert_eq!(interpolate(&with, 2.0), interpolate(&points, 2.0));
        assert_eq!(interpolate(&[(1.0, 1.0), (4.0, 0.0)], 2.0), Some(1.0));
        assert_eq!(interpolate(&[], 2.0), None);
    }

    #[test]
    fn levels_are_round_and_span_the_errors() {
        assert_eq!(levels(&[0.031, 0.26]), [0.5, 0.2, 0.1, 0.05]);
        assert_eq!(levels(&[0.02]), [0.02]);
        assert_eq!(levels(&[0.0, f64::NAN]), [0.0f64; 0]);
        let points = [(3.0, 0.1), (1.0, 0.4), (2.0, 0.1)];
        assert_eq!((cheapest(&points, 0.5), cheapest(&points, 0.1), cheapest(&points, 0.01)), (Some(1), Some(2), None));
    }
}
