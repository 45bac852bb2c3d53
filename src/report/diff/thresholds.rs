//! What the gates are held to: `configs/diff.ron`, and a file of the user's on top of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::gate::{Direction, Finding, Gate};
use super::noise::Noise;
use crate::config::messages;
use crate::system::input::read_file;

/// The defaults, and the only place where they and the names of the gates are.
const DEFAULTS: &str = include_str!("../../../configs/diff.ron");

/// Source of thresholds that no file of the user's sets.
pub const DEFAULT: &str = "default";

/// How far a figure may go: the largest of these bounds holds. Without any the figure is only shown.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limit {
    /// In the gate's own unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absolute: Option<f64>,
    /// Share of the base's figure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
    /// Standard errors of the figure, where they are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_errors: Option<f64>,
    /// Like `relative`, where the sides drew other random numbers: what noise alone may do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other_seeds: Option<f64>,
}

/// A limit for some items only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exception {
    /// `*` stands for any letters.
    pub item: String,
    /// Likewise.
    pub gate: String,
    pub limit: Limit,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct File {
    gates: BTreeMap<String, Limit>,
    exceptions: Vec<Exception>,
}

#[derive(Debug, thiserror::Error)]
pub enum ThresholdsError {
    #[error("cannot read the thresholds {path}: {cause}; give the path of a RON file such as configs/diff.ron")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{place}: {what}")]
    Invalid { place: String, what: String },
}

/// The thresholds in effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Thresholds {
    pub gates: BTreeMap<String, Limit>,
    /// The last that fits holds.
    pub exceptions: Vec<Exception>,
    /// Where each gate's limit comes from, where that is not the default.
    sources: BTreeMap<String, String>,
    /// What exceptions come from.
    file: Option<String>,
}

impl Thresholds {
    /// The defaults, and those of a file on top of them.
    pub fn load(path: Option<&Path>) -> Result<Thresholds, ThresholdsError> {
        let defaults = parse(DEFAULTS, "configs/diff.ron")?;
        let mut thresholds =
            Thresholds { gates: defaults.gates, exceptions: Vec::new(), sources: BTreeMap::new(), file: None };
        if let Some(path) = path {
            let unreadable = |cause| ThresholdsError::Unreadable { path: path.to_owned(), cause };
            let bytes = read_file(path).map_err(unreadable)?;
            let text = String::from_utf8(bytes).map_err(|e| unreadable(std::io::Error::other(e.utf8_error())))?;
            thresholds.put(&text, &path.display().to_string())?;
        }
        Ok(thresholds)
    }

    /// Lays a file over what is there.
    fn put(&mut self, text: &str, place: &str) -> Result<(), ThresholdsError> {
        let file = parse(text, place)?;
        let invalid = |what: String| ThresholdsError::Invalid { place: place.to_owned(), what };
        for (name, limit) in file.gates {
            if !self.gates.contains_key(&name) {
                return Err(invalid(messages::unknown_key(&name, self.gates.keys().map(String::as_str))));
            }
            check(&limit).map_err(|what| invalid(format!("gates: {name}: {what}")))?;
            self.sources.insert(name.clone(), format!("{place}: gates.{name}"));
            self.gates.insert(name, limit);
        }
        for exception in file.exceptions {
            if !self.gates.keys().any(|name| fits(&exception.gate, name)) {
                let names = self.gates.keys().map(String::as_str);
                return Err(invalid(format!("exceptions: {}", messages::unknown_key(&exception.gate, names))));
            }
            check(&exception.limit).map_err(|what| invalid(format!("exceptions: {}: {what}", exception.item)))?;
            self.exceptions.push(exception);
        }
        self.file = Some(place.to_owned());
        Ok(())
    }

    /// Exceptions that are for none of these gates.
    pub fn without_effect(&self, gates: &[Gate]) -> Vec<&Exception> {
        let fits_one = |e: &Exception| gates.iter().any(|gate| fits(&e.gate, &gate.name) && fits(&e.item, &gate.item));
        self.exceptions.iter().filter(|exception| !fits_one(exception)).collect()
    }

    /// The limit of a gate for an item, and where it comes from.
    fn limit(&self, name: &str, item: &str) -> (Limit, String) {
        let exception = self.exceptions.iter().rev().find(|e| fits(&e.gate, name) && fits(&e.item, item));
        if let (Some(exception), Some(file)) = (exception, &self.file) {
            return (exception.limit, format!("{file}: exceptions, item {}, gate {}", exception.item, exception.gate));
        }
        let source = self.sources.get(name).cloned().unwrap_or_else(|| DEFAULT.to_owned());
        (self.gates.get(name).copied().unwrap_or_default(), source)
    }

    /// Holds a finding against its limit.
    pub fn judge(&self, finding: Finding) -> Gate {
        let (limit, source) = self.limit(finding.name, &finding.item);
        let Finding { name, item, base, candidate, value, unit, standard_error, noise, scale, direction, explanation } =
            finding;
        let bounds = [
            limit.absolute,
            limit.relative.map(|share| share * scale),
            limit.standard_errors.zip(standard_error).map(|(count, error)| count * error),
            limit.other_seeds.filter(|_| noise == Noise::Other).map(|share| share * scale),
        ];
        let is_judged = limit != Limit::default();
        // A limit in standard errors alone, of a figure without one, allows nothing.
        let threshold = is_judged.then(|| bounds.into_iter().flatten().fold(0.0, f64::max));
        let value = value.filter(|value| value.is_finite());
        let against = value.map(|value| match direction {
            Direction::Both => value.abs(),
            Direction::Increase => value,
        });
        let undefined_alike = base.is_none() && candidate.is_none() && value.is_none();
        let passed = match (against, threshold) {
            (_, None) => true,
            (Some(against), Some(threshold)) => against <= threshold,
            (None, Some(_)) => undefined_alike,
        };
        let margin = against.zip(threshold).map(|(against, threshold)| match threshold {
            _ if against <= 0.0 => 1.0,
            // Nothing was allowed: how far beyond is no ratio.
            0.0 => -1.0 - against,
            _ => 1.0 - against / threshold,
        });
        let (name, waived) = (name.to_owned(), false);
        Gate {
            name,
            item,
            base,
            candidate,
            value,
            unit,
            threshold,
            margin,
            standard_error,
            passed,
            waived,
            source,
            explanation,
        }
    }
}

fn parse(text: &str, place: &str) -> Result<File, ThresholdsError> {
    let text = text.trim_start_matches('\u{feff}');
    crate::config::ron_options().from_str(text).map_err(|e| ThresholdsError::Invalid {
        place: format!("{place}, line {} column {}", e.span.start.line, e.span.start.col),
        what: match e.code {
            ron::Error::ExpectedNamedStructLike("File") if !text.trim().is_empty() => {
                "the keys stand in parentheses, as in (gates: { \"leak.light\": (absolute: 0.01) })".to_owned()
            }
            _ => messages::of_file(&e, text),
        },
    })
}

fn check(limit: &Limit) -> Result<(), String> {
    for (key, value) in [
        ("absolute", limit.absolute),
        ("relative", limit.relative),
        ("standard_errors", limit.standard_errors),
        ("other_seeds", limit.other_seeds),
    ] {
        if let Some(value) = value.filter(|v| !(*v >= 0.0 && v.is_finite())) {
            return Err(format!("{key} is {value}: write a number from 0 up"));
        }
    }
    Ok(())
}

/// Whether a pattern, in which `*` stands for any letters, is that of the whole text.
fn fits(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else { return pattern == text };
    let (middle, end) = rest.rsplit_once('*').unwrap_or(("", rest));
    let inner = text.strip_prefix(start).and_then(|text| text.strip_suffix(end));
    // Each part at its first place: a later one would leave less for those after it.
    let after = |text: &str, part: &str| text.find(part).map(|at| at + part.len());
    inner.is_some_and(|inner| {
        middle.split('*').try_fold(inner, |text, part| Some(&text[after(text, part)?..])).is_some()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thresholds() -> Thresholds {
        Thresholds::load(None).unwrap()
    }

    fn finding(value: Option<f64>, error: Option<f64>) -> Finding {
        Finding::percentage("irradiance.mean", "lit/visibility_on", value, "").with_error(error)
    }

    #[test]
    fn patterns() {
        for (pattern, text, expected) in [
            ("*", "", true),
            ("a*", "abc", true),
            ("a*c", "abcc", true),
            ("*.light", "leak.light", true),
            ("leak", "leak.light", false),
            ("a*c", "ab", false),
            ("", "a", false),
            ("*", "abc", true),
            ("a*b*c", "axbxbc", true),
            ("a*b*c", "axc", false),
            ("ab*bc", "abc", false),
            ("*é*é", "xéé", true),
            (&"*a".repeat(40), &"a".repeat(39), false),
            (&"*".repeat(80), "lit/visibility_on", true),
        ] {
            assert_eq!(fits(pattern, text), expected, "{pattern} {text}");
        }
    }

    #[test]
    fn the_largest_bound_holds() {
        let mut thresholds = thresholds();
        let text = r#"(gates: {"irradiance.mean": (absolute: 0.5, relative: 0.01, standard_errors: 4)})"#;
        thresholds.put(text, "a.ron").unwrap();
        let gate = thresholds.judge(finding(Some(-0.9), None));
        assert!(gate.passed && gate.threshold == Some(1.0) && gate.source == "a.ron: gates.irradiance.mean");
        assert!((gate.margin.unwrap() - 0.1).abs() < 1e-12);
        assert!(!thresholds.judge(finding(Some(-1.1), Some(0.1))).passed);
        let gate = thresholds.judge(finding(Some(-1.1), Some(0.5)));
        assert!(gate.passed && gate.threshold == Some(2.0));
    }

    #[test]
    fn undefined_fails_unless_it_is_so_on_both_sides() {
        let gate = thresholds().judge(finding(None, None));
        assert!(gate.passed && gate.margin.is_none());
        let one = Finding { base: Some(1.0), ..finding(None, None) };
        assert!(!thresholds().judge(one).passed);
        assert!(!thresholds().judge(Finding { base: Some(1.0), ..finding(Some(f64::NAN), None) }).passed);
    }

    #[test]
    fn costs_may_fall_and_light_may_not_change() {
        let cost = |candidate| {
            let sides = [Some(100.0), Some(candidate)];
            thresholds().judge(Finding::ratio("memory.bytes_per_probe", "", sides, Direction::Increase, ""))
        };
        assert!(cost(10.0).passed && cost(10.0).margin == Some(1.0) && !cost(200.0).passed);
        assert!(!thresholds().judge(finding(Some(-50.0), None)).passed);
    }

    #[test]
    fn exceptions_are_for_their_items() {
        let mut thresholds = thresholds();
        let text = r#"(exceptions: [(item: "dark/*", gate: "irradiance.*", limit: (absolute: 70))])"#;
        thresholds.put(text, "a.ron").unwrap();
        assert!(!thresholds.judge(finding(Some(60.0), None)).passed);
        let gate = thresholds.judge(Finding { item: "dark/visibility_on".into(), ..finding(Some(60.0), None) });
        assert!(gate.passed && gate.source.starts_with("a.ron: exceptions"), "{gate:?}");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, words) in [
            (r#"(gates: {"leak.ligth": (absolute: 1)})"#, "did you mean 'leak.light'"),
            (r#"(gates: {"leak.light": (absolut: 1)})"#, "did you mean 'absolute'"),
            (r#"(gate: {})"#, "did you mean 'gates'"),
            (r#"(gates: {"leak.light": (absolute: -1)})"#, "from 0 up"),
            (r#"(exceptions: [(item: "*", gate: "lek.*", limit: ())])"#, "there is no key 'lek.*'"),
            ("", "it is empty"),
            ("{}", "parentheses"),
        ] {
            let message = thresholds().put(text, "a.ron").unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("a.ron"), "{message}");
        }
    }
}
