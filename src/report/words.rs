//! How gates are put into words, in tables, comments and commands alike.

use super::gate::Gate;
use crate::system::format;

/// The unit of figures that are written as sizes.
pub const BYTES: &str = "B";

/// A gate's figure with its unit; the dash where it is not defined.
pub fn in_unit(value: Option<f64>, unit: &str) -> String {
    if unit == BYTES {
        return format::or_undefined(value, |v| {
            let sign = if v < 0.0 { "-" } else { "" };
            format!("{sign}{}", format::bytes(v.abs() as u64))
        });
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format::or_undefined(value, |v| format!("{}{unit}", format::significant(v, 3)))
}

/// The figure of one side, which a gate in percent has in a unit of its own.
pub fn of_side(value: Option<f64>, unit: &str) -> String {
    if unit == BYTES { in_unit(value, unit) } else { format::or_undefined(value, |v| format::significant(v, 4)) }
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
    fn bytes_are_sizes() {
        assert_eq!(in_unit(Some(-2048.0), BYTES), "-2.00 KiB");
        assert_eq!(of_side(Some(2048.0), BYTES), "2.00 KiB");
        assert_eq!((in_unit(Some(2.5), "%"), of_side(Some(2.5), "%")), ("2.50 %".to_owned(), "2.500".to_owned()));
        assert_eq!(of_side(None, BYTES), format::UNDEFINED);
    }

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
