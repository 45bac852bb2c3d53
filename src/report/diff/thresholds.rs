//! What the gates are held to: `configs/diff.ron`, and a file of the user's on top of it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use wildmatch::WildMatchPattern;

use super::error::DiffError;
use super::figures::Seeds;
use super::rules::{Finding, How};
use crate::config::messages;
use crate::report::gate::Gate;
use crate::system::input::read_text;

/// The defaults, and the only place where they and the names of the gates are.
const DEFAULTS: &str = include_str!("../../../configs/diff.ron");

/// Source of thresholds that no file of the user's sets.
pub const DEFAULT: &str = "default";

/// How far a figure may go: the largest of these bounds holds. Without any the figure is only shown.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limit {
    /// In the gate's own unit.
    pub absolute: Option<f64>,
    /// Share of the base's figure.
    pub relative: Option<f64>,
    /// Standard errors of the figure, where the reports have them.
    pub standard_errors: Option<f64>,
    /// What noise alone may do where the seeds are others and the base has one only: a share of the base's figure, of all light for
    /// leaks, of `error.rmse` for `error.bias`.
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

/// The thresholds in effect, or those of a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Thresholds {
    pub gates: BTreeMap<String, Limit>,
    /// The last that fits holds.
    pub exceptions: Vec<Exception>,
    /// Where each gate's limit comes from, where that is not the default.
    #[serde(skip_deserializing)]
    sources: BTreeMap<String, String>,
    /// What exceptions come from.
    #[serde(skip_deserializing)]
    file: Option<String>,
}

impl Thresholds {
    /// The defaults, and those of a file on top of them.
    ///
    /// # Errors
    /// A file that cannot be read, and what is no threshold in it.
    pub fn load(path: Option<&Path>) -> Result<Thresholds, DiffError> {
        let mut thresholds = parse(DEFAULTS, "configs/diff.ron")?;
        if let Some(path) = path {
            let remedy = "give the path of a RON file such as configs/diff.ron";
            let text =
                read_text(path).map_err(|cause| DiffError::file(path, format!("cannot be read: {cause}; {remedy}")))?;
            thresholds.put(&text, &path.display().to_string())?;
        }
        Ok(thresholds)
    }

    /// Lays a file over what is there.
    fn put(&mut self, text: &str, place: &str) -> Result<(), DiffError> {
        let file = parse(text, place)?;
        let known: Vec<String> = self.gates.keys().cloned().collect();
        let check = |pattern: &str, limit: &Limit, fits: fn(&str, &str) -> bool| {
            let bounds = [limit.absolute, limit.relative, limit.standard_errors, limit.other_seeds];
            let what = if !known.iter().any(|name| fits(pattern, name)) {
                messages::unknown_key(pattern, known.iter().map(String::as_str))
            } else if !bounds.into_iter().flatten().all(|bound| bound >= 0.0 && bound.is_finite()) {
                format!("{pattern}: write bounds from 0 up")
            } else {
                return Ok(());
            };
            Err(DiffError::file(Path::new(place), what))
        };
        for (name, limit) in file.gates {
            check(&name, &limit, |name, known| name == known)?;
            self.sources.insert(name.clone(), format!("{place}: gates.{name}"));
            self.gates.insert(name, limit);
        }
        file.exceptions.iter().try_for_each(|exception| check(&exception.gate, &exception.limit, fits))?;
        self.exceptions.extend(file.exceptions);
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
    pub fn judge(&self, found: Finding) -> Gate {
        let (limit, source) = self.limit(&found.gate.name, &found.gate.item);
        let is_judged = limit != Limit::default() && !found.is_new;
        // What noise may do is measured, or bounded where the seeds are others; the smaller of both.
        let of_noise = limit.other_seeds.filter(|_| found.seeds == Seeds::Other).map(|share| share * found.scales[1]);
        let known_error = found.gate.standard_error.filter(|_| found.freedom.is_none());
        let bounds = [
            limit.absolute,
            limit.relative.map(|share| share * found.scales[0]),
            limit.standard_errors.zip(known_error).map(|(count, error)| count * error),
            of_noise.into_iter().chain(found.noise).reduce(f64::min),
        ];
        let threshold = is_judged.then(|| bounds.into_iter().flatten().fold(0.0, f64::max));
        let value = found.gate.value.filter(|value| value.is_finite());
        let against = value.map(|value| if found.rule.how == How::Change { value.abs() } else { value });
        let passed = match (against, threshold) {
            (_, None) => true,
            (Some(against), Some(threshold)) => against <= threshold,
            (None, Some(_)) => found.gate.base.is_none() && found.gate.candidate.is_none(),
        };
        let margin = against.zip(threshold).map(|(against, threshold)| match threshold {
            _ if against <= 0.0 => 1.0,
            // Nothing was allowed: how far beyond is no ratio.
            0.0 => -1.0 - against,
            _ => 1.0 - against / threshold,
        });
        Gate { value, threshold, margin, passed, source, ..found.gate }
    }
}

fn parse(text: &str, place: &str) -> Result<Thresholds, DiffError> {
    let text = text.trim_start_matches('\u{feff}');
    crate::config::ron_options().from_str(text).map_err(|e| {
        let what = match e.code {
            ron::Error::ExpectedNamedStructLike("Thresholds") if !text.trim().is_empty() => {
                "the keys stand in parentheses, as in (gates: { \"leak.light\": (absolute: 0.01) })".to_owned()
            }
            _ => messages::of_file(&e, text),
        };
        DiffError::file(Path::new(place), format!("line {} column {}: {what}", e.span.start.line, e.span.start.col))
    })
}

/// Whether a pattern, in which `*` stands for any letters, is that of the whole text.
fn fits(pattern: &str, text: &str) -> bool {
    // The second sign stands for one letter, and no name holds it.
    WildMatchPattern::<'*', '\0'>::new(pattern).matches(text)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_json::json;

    use super::super::figures::Facts;
    use super::super::rules::{findings, gates};
    use super::*;

    fn thresholds() -> Thresholds {
        Thresholds::load(None).unwrap()
    }

    fn image_mean(base: f64, candidate: f64) -> Finding {
        let pair = Facts::of(&json!({"mean_base": base, "mean_candidate": candidate}));
        findings("image", "lit/visibility_on", [&Facts::default(); 2], &pair, Seeds::Equal).remove(0)
    }

    /// Of a mean that changed by so many percent.
    fn changed(percent: f64) -> Finding {
        image_mean(100.0, 100.0 + percent)
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
        let text = r#"(gates: {"image.mean": (absolute: 0.5, relative: 0.01, standard_errors: 4, other_seeds: 0.2)})"#;
        thresholds.put(text, "a.ron").unwrap();
        let gate = thresholds.judge(changed(-0.9));
        assert!(gate.passed && gate.threshold == Some(1.0) && gate.source == "a.ron: gates.image.mean");
        assert!((gate.margin.unwrap() - 0.1).abs() < 1e-9);
        let with_error = |error: f64| {
            let found = changed(-1.1);
            Finding { gate: Gate { standard_error: Some(error), ..found.gate.clone() }, ..found }
        };
        assert!(!thresholds.judge(with_error(0.1)).passed);
        assert_eq!(thresholds.judge(with_error(0.5)).threshold, Some(2.0));
        // Between other seeds the measured noise, but not more than the wide bound.
        let other = |noise| Finding { seeds: Seeds::Other, noise, ..changed(-1.1) };
        for (noise, expected) in [(None, 20.0), (Some(0.3), 1.0), (Some(5.0), 5.0), (Some(70.0), 20.0)] {
            assert_eq!(thresholds.judge(other(noise)).threshold, Some(expected), "{noise:?}");
        }
    }

    #[test]
    fn changes_from_darkness_fail() {
        let gate = thresholds().judge(image_mean(0.0, 1.0));
        assert!(!gate.passed && gate.value.is_none() && gate.margin.is_none());
        assert!(thresholds().judge(image_mean(0.0, 0.0)).passed);
        let mut undefined = changed(0.0);
        undefined.gate.value = Some(f64::NAN);
        assert!(!thresholds().judge(undefined).passed);
    }

    #[test]
    fn figures_that_the_base_is_too_old_for_are_shown() {
        let report =
            |leak: serde_json::Value| Facts::of(&json!({"methods": [{"name": "visibility_on", "leak": leak}]}));
        let judged = |base: serde_json::Value| {
            let candidate = report(json!({"light": 0.0, "blocks": 0.5}));
            let found = findings("render", "", [&report(base), &candidate], &Facts::default(), Seeds::Equal);
            found.into_iter().map(|f| thresholds().judge(f)).find(|gate| gate.name == "leak.blocks").unwrap()
        };
        let old = judged(json!({"light": 0.0}));
        assert!(old.passed && old.threshold.is_none() && old.explanation.contains("not judged"), "{old:?}");
        // One that says it is undefined, and one that says it is less, are no such reports.
        for base in [json!({"light": 0.0, "blocks": null}), json!({"light": 0.0, "blocks": 0.1}), json!(null)] {
            assert!(!judged(base.clone()).passed, "{base}");
        }
    }

    #[test]
    fn costs_may_fall_and_light_may_not_change() {
        let cost = |candidate: f64| {
            let report = |bytes: f64| Facts::of(&json!({"bytes_per_probe": {"file": bytes}}));
            let found = findings("bake", "", [&report(100.0), &report(candidate)], &Facts::default(), Seeds::Equal);
            thresholds().judge(found[0].clone())
        };
        assert!(cost(10.0).passed && cost(10.0).margin == Some(1.0) && !cost(200.0).passed);
        assert!(!thresholds().judge(changed(-50.0)).passed);
    }

    #[test]
    fn every_gate_has_its_limit() {
        let of_rules: BTreeSet<&str> = gates().collect();
        assert_eq!(of_rules, thresholds().gates.keys().map(String::as_str).collect());
    }

    #[test]
    fn exceptions_are_for_their_items() {
        let mut thresholds = thresholds();
        let text = r#"(exceptions: [(item: "dark/*", gate: "image.*", limit: (absolute: 70))])"#;
        thresholds.put(text, "a.ron").unwrap();
        assert!(!thresholds.judge(changed(60.0)).passed);
        let mut found = changed(60.0);
        found.gate.item = "dark/visibility_on".into();
        let gate = thresholds.judge(found);
        assert!(gate.passed && gate.source.starts_with("a.ron: exceptions"), "{gate:?}");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, words) in [
            (r#"(gates: {"leak.ligth": (absolute: 1)})"#, "did you mean 'leak.light'"),
            (r#"(gates: {"leak.light": (absolut: 1)})"#, "did you mean 'absolute'"),
            (r#"(gate: {})"#, "did you mean 'gates'"),
            (r#"(gates: {"leak.*": ()})"#, "there is no key 'leak.*'"),
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
