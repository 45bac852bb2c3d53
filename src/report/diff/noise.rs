//! What noise alone may do.
//!
//! Equal seeds draw the same random numbers: what did not change is equal up to rounding, and every difference is a change. Between
//! other seeds a difference is judged by the measured spread of several seeds. The base has them as results side by side, or both
//! sides as a sweep's runs. Where there is one seed only, the wide bounds `other_seeds` of the thresholds hold.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::rules::{Finding, How};
use crate::math::statistics::Moments;

/// Chance that noise alone fails any gate of a comparison that measures it. Each of N gates gets an N-th (Bonferroni).
pub const SIGNIFICANCE: f64 = 0.01;

/// Puts the spread between the base's seeds into the findings. `between`: findings of the base's first seed against each other one.
///
/// A figure of a side is compared with the mean over the seeds. A figure of a pair is compared with those of the pairs of the base, so
/// that three seeds are the least. The standard error is that of one more value beside n: s·√(1 + 1/n).
pub fn measure(findings: &mut [Finding], between: &[Vec<Finding>]) {
    for found in findings {
        let is_same = |other: &&Finding| (&other.gate.name, &other.gate.item) == (&found.gate.name, &found.gate.item);
        let others: Option<Vec<&Finding>> = between.iter().map(|all| all.iter().find(is_same)).collect();
        let Some(others) = others else { continue };
        let sample: Option<Vec<f64>> = match found.rule.how {
            How::Pair => others.iter().map(|other| other.gate.value).collect(),
            _ => std::iter::once(found.gate.base).chain(others.iter().map(|other| other.gate.candidate)).collect(),
        };
        let Some(mut sample) = sample else { continue };
        if found.rule.how != How::Pair {
            let mean = sample.iter().copied().collect::<Moments>().mean();
            let values: Option<Vec<f64>> = sample.iter().map(|value| found.rule.how.value(mean, *value)).collect();
            let Some(values) = values else { continue };
            sample = values;
            found.gate.base = Some(mean);
            found.gate.value = found.gate.candidate.and_then(|candidate| found.rule.how.value(mean, candidate));
        }
        let (moments, n) = (sample.iter().copied().collect::<Moments>(), sample.len() as f64);
        if n >= 2.0 {
            found.noise = (found.rule.how == How::Pair).then(|| moments.mean());
            found.gate.standard_error = Some((moments.variance() * n / (n - 1.0) * (1.0 + 1.0 / n)).sqrt());
            found.freedom = Some(n - 1.0);
        }
    }
}

/// Turns measured spreads into bounds at [`SIGNIFICANCE`], by Student's t.
pub fn bound(findings: &mut [Finding]) {
    let gates = findings.iter().filter(|found| found.freedom.is_some()).count();
    let level = 1.0 - 0.5 * SIGNIFICANCE / gates.max(1) as f64;
    for found in findings {
        let Some(student) = found.freedom.and_then(|freedom| StudentsT::new(0.0, 1.0, freedom).ok()) else { continue };
        let spread = found.gate.standard_error.map(|error| student.inverse_cdf(level) * error);
        found.noise = spread.map(|spread| found.noise.unwrap_or(0.0) + spread);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::figures::{Facts, Seeds};
    use super::super::rules::findings;
    use super::*;

    fn of_image(mean: f64, candidate: f64, rmse: f64) -> Vec<Finding> {
        let pair = json!({"mean_base": mean, "mean_candidate": candidate, "rmse_percent": rmse});
        findings("image", "", [&Facts::default(); 2], &Facts::of(&pair), Seeds::Other)
    }

    #[test]
    fn spread_is_measured_between_seeds() {
        let between = [of_image(1.0, 1.1, 4.0), of_image(1.0, 0.9, 6.0)];
        let mut found = of_image(1.0, 1.5, 9.0);
        measure(&mut found, &between);
        let of = |gate: &str| found.iter().find(|f| f.gate.name == gate).cloned().unwrap();
        // Three seeds with means 1, 1.1, 0.9: deviation 10 %, and that of one more beside their mean √(4/3) of it.
        let mean = of("image.mean");
        assert!((mean.gate.value.unwrap() - 50.0).abs() < 1e-9 && (mean.gate.base.unwrap() - 1.0).abs() < 1e-12);
        assert!(
            (mean.gate.standard_error.unwrap() - 10.0 * (4.0_f64 / 3.0).sqrt()).abs() < 1e-9
                && mean.freedom == Some(2.0)
        );
        // Two pairs of seeds with 4 and 6 %.
        let rmse = of("image.rmse");
        assert!((rmse.gate.standard_error.unwrap() - 3.0_f64.sqrt()).abs() < 1e-9 && rmse.freedom == Some(1.0));
        bound(&mut found);
        // Of two gates each has 0.5 %, two-sided 0.25 %. Tables: t = 14.09 with two degrees of freedom, 127.3 with one.
        let bound = |gate: &str| found.iter().find(|f| f.gate.name == gate).unwrap().noise.unwrap();
        assert!((bound("image.mean") / (14.09 * mean.gate.standard_error.unwrap()) - 1.0).abs() < 1e-3);
        assert!((bound("image.rmse") / (5.0 + 127.3 * 3.0_f64.sqrt()) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn two_seeds_do_not_tell_about_pairs() {
        let mut found = of_image(1.0, 1.5, 9.0);
        measure(&mut found, &[of_image(1.0, 1.1, 4.0)]);
        let freedom: Vec<Option<f64>> = found.iter().map(|f| f.freedom).collect();
        assert_eq!(freedom, [Some(1.0), None]);
    }
}
