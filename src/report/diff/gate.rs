//! One judged figure, and what becomes of all of them.

use super::noise::Noise;
pub use crate::report::gate::{Gate, sort};

/// Which differences count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Light that changed, up or down.
    Both,
    /// Costs and errors: less is never worse.
    Increase,
}

/// A figure of the comparison before it is judged.
#[derive(Debug, Clone)]
pub struct Finding {
    pub name: &'static str,
    pub item: String,
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    /// In `unit`; with [`Direction::Increase`] positive where the candidate is worse.
    pub value: Option<f64>,
    pub unit: &'static str,
    pub standard_error: Option<f64>,
    /// Of both sides.
    pub noise: Noise,
    /// What a relative limit of 1 allows, in `unit`: the base's figure for differences, 100 for percentages.
    pub scale: f64,
    pub direction: Direction,
    pub explanation: String,
}

impl Finding {
    /// candidate − base in a unit of its own.
    pub fn difference(
        name: &'static str,
        item: &str,
        [base, candidate]: [Option<f64>; 2],
        unit: &'static str,
        direction: Direction,
        explanation: impl Into<String>,
    ) -> Finding {
        let value = base.zip(candidate).map(|(b, c)| c - b);
        let (item, explanation) = (item.to_owned(), explanation.into());
        let scale = base.unwrap_or(0.0).abs();
        let (standard_error, noise) = (None, Noise::default());
        Finding { name, item, base, candidate, value, unit, standard_error, noise, scale, direction, explanation }
    }

    /// candidate ÷ base − 1, in percent.
    pub fn ratio(
        name: &'static str,
        item: &str,
        [base, candidate]: [Option<f64>; 2],
        direction: Direction,
        explanation: impl Into<String>,
    ) -> Finding {
        let value = base.zip(candidate).and_then(|(b, c)| match b {
            _ if b == c => Some(0.0),
            0.0 => None,
            _ => Some(100.0 * (c - b) / b.abs()),
        });
        let found = Finding::difference(name, item, [base, candidate], PERCENT, direction, explanation);
        Finding { value, scale: 100.0, ..found }
    }

    /// A percentage that the comparison itself makes; the sides have no such figure.
    pub fn percentage(name: &'static str, item: &str, value: Option<f64>, explanation: impl Into<String>) -> Finding {
        let found = Finding::difference(name, item, [None, None], PERCENT, Direction::Both, explanation);
        Finding { value, scale: 100.0, ..found }
    }

    /// A number of things that the comparison counts.
    pub fn count(name: &'static str, item: &str, count: usize, of: usize, explanation: impl Into<String>) -> Finding {
        let found = Finding::difference(name, item, [None, None], "", Direction::Increase, explanation);
        Finding { value: Some(count as f64), scale: of as f64, ..found }
    }

    pub fn with_error(self, standard_error: Option<f64>) -> Finding {
        Finding { standard_error, ..self }
    }
}

/// Unit of relative figures.
pub const PERCENT: &str = "%";

#[cfg(test)]
mod tests {
    use super::super::thresholds::Thresholds;
    use super::*;

    #[test]
    fn what_is_worst_comes_first() {
        let thresholds = Thresholds::load(None).unwrap();
        let gate = |item: &str, value: Option<f64>, base: Option<f64>| {
            let found = Finding::percentage("image.rmse", item, value, "");
            thresholds.judge(Finding { base, ..found })
        };
        let mut gates = vec![
            gate("nothing to judge", None, None),
            gate("untouched", Some(0.0), None),
            gate("close", Some(11.0), None),
            gate("beyond", Some(50.0), None),
            gate("undefined on one side", None, Some(1.0)),
        ];
        sort(&mut gates);
        let items: Vec<&str> = gates.iter().map(|gate| gate.item.as_str()).collect();
        assert_eq!(items, ["undefined on one side", "beyond", "close", "untouched", "nothing to judge"]);
    }
}
