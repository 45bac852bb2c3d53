//! One judged figure, and what becomes of all of them.

use serde::Serialize;

use super::noise::Noise;

/// A figure of the comparison, the bound that it is held to, and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gate {
    /// Such as "irradiance.mean", "leak.light", "scene", "image.flip", "probes.worst".
    pub name: String,
    /// What of the sides: "lit/visibility_on", "bake", "two_rooms.probes"; empty for the whole.
    pub item: String,
    /// The sides' own figures, where they have one.
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    /// The judged figure: a difference, a ratio − 1, and so on. `None`: undefined, which fails unless it is so on both sides.
    pub value: Option<f64>,
    /// Unit of `value` and `threshold`, such as "W/m²" or "%"; empty for pure numbers.
    pub unit: &'static str,
    /// What the value must not exceed. `None`: only shown.
    pub threshold: Option<f64>,
    /// 1 − value/threshold: 1 untouched, 0 at the limit, negative beyond.
    pub margin: Option<f64>,
    /// Of `value`, where known.
    pub standard_error: Option<f64>,
    pub passed: bool,
    /// Would fail, but a flag allows it.
    pub waived: bool,
    /// Where the threshold came from: "default", "FILE.ron: images.flip", "--allow-scene-change".
    pub source: String,
    /// One plain sentence.
    pub explanation: String,
}

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

impl Gate {
    /// Whether it counts against the candidate.
    pub fn fails(&self) -> bool {
        !self.passed && !self.waived
    }

    /// Whether it can fail at all.
    pub fn is_judged(&self) -> bool {
        self.threshold.is_some() || !self.passed
    }

    /// Name and item, for lists.
    pub fn title(&self) -> String {
        if self.item.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.item) }
    }
}

/// The worst first: what fails, by how far; then what comes closest; last what is only shown.
pub fn sort(gates: &mut [Gate]) {
    let rank = |gate: &Gate| match gate {
        _ if gate.fails() => 0,
        _ if gate.waived => 1,
        _ if gate.is_judged() => 2,
        _ => 3,
    };
    // Without a margin a gate is undefined: first where it fails by that, last where there was nothing to judge.
    let undefined = |gate: &Gate| if gate.fails() { f64::NEG_INFINITY } else { f64::INFINITY };
    let margin = |gate: &Gate| gate.margin.unwrap_or(undefined(gate));
    gates.sort_by(|a, b| {
        let by_name = || (&a.name, &a.item).cmp(&(&b.name, &b.item));
        rank(a).cmp(&rank(b)).then(margin(a).total_cmp(&margin(b))).then_with(by_name)
    });
}

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
