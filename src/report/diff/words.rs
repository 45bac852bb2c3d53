//! How gates are put into words, in tables, comments and commands alike.

use super::gate::Gate;
use crate::report::format;

/// A gate's figure with its unit; the dash where it is not defined.
pub fn in_unit(value: Option<f64>, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format::or_undefined(value, |v| format!("{}{unit}", format::significant(v, 3)))
}

/// What a list says of a gate.
pub fn outcome(gate: &Gate) -> &'static str {
    match gate {
        _ if gate.waived => "waived",
        _ if gate.fails() => "FAIL",
        _ if !gate.is_judged() => "shown",
        _ => "pass",
    }
}

/// The margin, as a share.
pub fn margin(gate: &Gate) -> String {
    match (gate.margin, gate.threshold) {
        // Nothing was allowed: a share of nothing says nothing.
        (Some(margin), Some(0.0)) => {
            if margin < 0.0 {
                "beyond".to_owned()
            } else {
                format::percent(1.0)
            }
        }
        (margin, _) => format::or_undefined(margin, format::percent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::diff::gate::{Direction, Finding};
    use crate::report::diff::thresholds::Thresholds;

    #[test]
    fn a_gate_at_zero_shows_no_share() {
        let thresholds = Thresholds::load(None).unwrap();
        let gate = thresholds.judge(Finding::difference(
            "image.non_finite",
            "",
            [Some(0.0), Some(1.0)],
            "",
            Direction::Increase,
            "",
        ));
        assert!(gate.fails() && margin(&gate) == "beyond" && outcome(&gate) == "FAIL");
    }
}
