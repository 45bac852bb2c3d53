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

/// The figure of one side in its own unit.
pub fn of_side(value: Option<f64>, unit: &str) -> String {
    if unit == BYTES {
        return in_unit(value, unit);
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format::or_undefined(value, |v| format!("{}{unit}", format::significant(v, 4)))
}

/// The unit of a figure by its place in a report: keys end in it.
pub fn unit_of(place: &str) -> &'static str {
    let has = |part: &str| place.split('.').any(|key| key == part);
    let ends = |unit: &str| place.split('.').any(|key| key.ends_with(unit));
    match () {
        () if ends("_bytes") || ends("bytes_per_probe") || has("bytes") => BYTES,
        () if ends("_ns") => "ns",
        () if ends("_ms") => "ms",
        () if ends("_s") => "s",
        () if has("irradiance") || has("energy") || has("region_percent") || ends("irradiance_indirect_mean") => {
            "W·m⁻²"
        }
        () => "",
    }
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

/// The judged figure with its unit. A change from 0 is no number.
pub fn value(gate: &Gate) -> String {
    match (gate.value, gate.base, gate.candidate) {
        (None, Some(0.0), Some(_)) => "from 0".to_owned(),
        (value, ..) => in_unit(value, gate.unit),
    }
}

/// The margin as a share; beyond the threshold how many times that is the figure.
pub fn margin(gate: &Gate) -> String {
    match (gate.margin, gate.threshold) {
        // Nothing was allowed: a share of nothing says nothing.
        (Some(margin), Some(0.0)) if margin < 0.0 => "beyond".to_owned(),
        (Some(margin), _) if margin < 0.0 => format!("{} ×", format::significant(1.0 - margin, 3)),
        (margin, _) => format::or_undefined(margin, format::percent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_sizes() {
        assert_eq!(in_unit(Some(-2048.0), BYTES), "-2.00 KiB");
        assert_eq!(of_side(Some(2048.0), BYTES), "2.00 KiB");
        assert_eq!((in_unit(Some(2.5), "%"), of_side(Some(2.5), "%")), ("2.50 %".to_owned(), "2.500 %".to_owned()));
        assert_eq!(of_side(None, BYTES), format::UNDEFINED);
        for (place, unit) in [
            ("time_s.total", "s"),
            ("methods.visibility_on.shade_ms.median", "ms"),
            ("methods.visibility_on.lookup_ns", "ns"),
            ("configurations.a.figures.bake_s.mean", "s"),
            ("bytes_per_probe.file", BYTES),
            ("peak_memory_bytes", BYTES),
            ("irradiance", "W·m⁻²"),
            ("methods.visibility_on.leak.light", ""),
        ] {
            assert_eq!(unit_of(place), unit, "{place}");
        }
    }

    #[test]
    fn margins_are_shares_and_multiples() {
        let gate = |base, value, threshold, margin| Gate {
            name: String::new(),
            item: String::new(),
            base: Some(base),
            candidate: Some(1.0),
            value,
            unit: "%",
            side_unit: "",
            threshold: Some(threshold),
            margin,
            standard_error: None,
            passed: false,
            waived: false,
            source: String::new(),
            explanation: String::new(),
        };
        assert_eq!(margin(&gate(1.0, Some(1.0), 0.0, Some(-2.0))), "beyond");
        assert_eq!(margin(&gate(1.0, Some(1.0), 2.0, Some(0.5))), "50.0 %");
        assert_eq!(margin(&gate(1.0, Some(232.0), 1.0, Some(-231.0))), "232 ×");
        assert_eq!(
            (value(&gate(0.0, None, 1.0, None)), value(&gate(1.0, None, 1.0, None))),
            ("from 0".into(), "–".into())
        );
    }
}
