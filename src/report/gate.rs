//! One judged figure, and the order of all of them.

use serde::Serialize;

/// A figure of the comparison, the bound that it is held to, and whether it holds.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
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
    /// Unit of `base` and `candidate`, which differs where `value` is a share of them.
    pub side_unit: &'static str,
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

/// The worst first: what fails, by how far; then what comes closest; last what is only shown. Another scene comes before all else: it
/// explains the rest.
pub fn sort(gates: &mut [Gate]) {
    let rank = |gate: &Gate| match gate {
        _ if gate.fails() => u8::from(gate.name != "scene"),
        _ if gate.waived => 2,
        _ if gate.is_judged() => 3,
        _ => 4,
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
    use super::*;

    #[test]
    fn what_is_worst_comes_first() {
        let gate = |name: &str, passed: bool, margin: Option<f64>| Gate {
            name: name.to_owned(),
            item: String::new(),
            base: None,
            candidate: None,
            value: None,
            unit: "",
            side_unit: "",
            threshold: Some(1.0),
            margin,
            standard_error: None,
            passed,
            waived: false,
            source: String::new(),
            explanation: String::new(),
        };
        let mut gates = vec![
            gate("nothing to judge", true, None),
            gate("untouched", true, Some(1.0)),
            gate("close", true, Some(0.1)),
            gate("beyond", false, Some(-3.0)),
            gate("undefined on one side", false, None),
            gate("scene", false, Some(-1.0)),
        ];
        sort(&mut gates);
        let names: Vec<&str> = gates.iter().map(|gate| gate.name.as_str()).collect();
        assert_eq!(names, ["scene", "undefined on one side", "beyond", "close", "untouched", "nothing to judge"]);
    }
}
