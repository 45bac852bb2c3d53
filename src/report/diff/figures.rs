//! Two reports, figure by figure. Read as plain JSON: reports grow, and a figure that only one side has is a finding and
//! no mistake.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::gate::{Direction, Finding};
use super::storage;
use crate::config::Config;

/// What is no figure of the result.
const NOT_FIGURES: &[&str] = &["seed", "bake_seed", "threads", "exposure_ev", "bounces", "plan"];

/// One number of a report on both sides.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    pub item: String,
    /// Its place in the report, such as "methods.visibility_on.leak.light".
    pub name: String,
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    pub difference: Option<f64>,
}

/// How a figure is judged.
#[derive(Clone, Copy)]
pub(super) struct Rule {
    /// Place in what is judged, such as "leak.light".
    pub(super) place: &'static str,
    pub(super) gate: &'static str,
    how: How,
    unit: &'static str,
    explanation: &'static str,
}

impl Rule {
    /// The same rule for a figure that stands elsewhere.
    pub(super) fn at(self, place: &'static str) -> Rule {
        Rule { place, ..self }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum How {
    /// By the difference: more is worse.
    Increase,
    /// By the ratio, percent: more is worse.
    Growth,
    /// By the difference of magnitudes: farther from 0 is worse.
    Magnitude,
    /// By the difference: less is worse.
    Decrease,
}

pub(super) const fn rule(
    place: &'static str,
    gate: &'static str,
    how: How,
    unit: &'static str,
    explanation: &'static str,
) -> Rule {
    Rule { place, gate, how, unit, explanation }
}

/// What two reports of a kind give.
#[derive(Debug, Default)]
pub struct Compared {
    pub figures: Vec<Figure>,
    pub findings: Vec<Finding>,
}

/// A number at a path such as "leak.light".
pub fn number(value: &Value, path: &str) -> Option<f64> {
    path.split('.').try_fold(value, |value, key| value.get(key))?.as_f64()
}

/// Every number of a report by its place; members of lists by their name, where they have one.
fn flatten(value: &Value, place: &str, out: &mut BTreeMap<String, Option<f64>>) {
    let dotted = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
    match value {
        Value::Object(members) => {
            for (key, member) in members.iter().filter(|(key, _)| !NOT_FIGURES.contains(&key.as_str())) {
                flatten(member, &dotted(key), out);
            }
        }
        Value::Array(members) => {
            for member in members {
                let name = ["name", "label", "method"].into_iter().find_map(|key| member.get(key)?.as_str());
                if let Some(name) = name {
                    flatten(member, &dotted(name), out);
                }
            }
        }
        Value::Number(number) => {
            out.insert(place.to_owned(), number.as_f64());
        }
        // Booleans and words are not figures; null is one that is not defined.
        Value::Null => {
            out.insert(place.to_owned(), None);
        }
        Value::Bool(_) | Value::String(_) => {}
    }
}

/// All figures of two reports side by side.
pub fn side_by_side(item: &str, base: &Value, candidate: &Value) -> Vec<Figure> {
    let [mut a, mut b] = [BTreeMap::new(), BTreeMap::new()];
    flatten(base, "", &mut a);
    flatten(candidate, "", &mut b);
    let names: std::collections::BTreeSet<String> = a.keys().chain(b.keys()).cloned().collect();
    let figure = |name: String| {
        let (base, candidate) = (a.get(&name).copied().flatten(), b.get(&name).copied().flatten());
        let difference = base.zip(candidate).map(|(b, c)| c - b);
        Figure { item: item.to_owned(), name, base, candidate, difference }
    };
    names.into_iter().map(figure).filter(|f| f.base.is_some() || f.candidate.is_some()).collect()
}

/// Judges one figure. `errors`: of the sides, which are independent.
pub(super) fn apply(rule: &Rule, item: &str, values: [Option<f64>; 2], errors: [Option<f64>; 2]) -> Finding {
    let [b, c] = values;
    let difference = |direction| Finding::difference(rule.gate, item, values, rule.unit, direction, rule.explanation);
    let found = match rule.how {
        How::Increase => difference(Direction::Increase),
        How::Growth => Finding::ratio(rule.gate, item, values, Direction::Increase, rule.explanation),
        How::Magnitude => {
            let value = b.zip(c).map(|(b, c)| c.abs() - b.abs());
            Finding { value, ..difference(Direction::Increase) }
        }
        How::Decrease => {
            let value = b.zip(c).map(|(b, c)| b - c);
            Finding { value, ..difference(Direction::Increase) }
        }
    };
    let error = match (rule.how, b.zip(c), errors[0].zip(errors[1])) {
        // Of c/b in percent, from the relative errors of both.
        (How::Growth, Some((b, c)), Some((of_b, of_c))) => Some(100.0 * (c / b).abs() * (of_b / b).hypot(of_c / c)),
        (_, _, Some((of_b, of_c))) => Some(of_b.hypot(of_c)),
        _ => None,
    };
    found.with_error(error.filter(|error| error.is_finite()))
}

pub(super) fn apply_all(rules: &[Rule], item: &str, [base, candidate]: [&Value; 2]) -> Vec<Finding> {
    let found = rules.iter().map(|rule| {
        let values = [base, candidate].map(|v| number(v, rule.place));
        let errors = [base, candidate].map(|v| number(v, &format!("standard_error.{}", rule.place)));
        apply(rule, item, values, errors)
    });
    // A figure that neither has says nothing.
    found.filter(|f| f.base.is_some() || f.candidate.is_some()).collect()
}

/// The scenes of two reports.
pub fn scene(item: &str, [base, candidate]: [&str; 2]) -> Finding {
    let differs = base != candidate;
    let explanation = if differs {
        "The scene's files or its sky are others than the base's: no figure of light can be relied on to be about the bake."
    } else {
        "Both sides are of the same scene and sky."
    };
    let found = Finding::difference("scene", item, [None, None], "", Direction::Increase, explanation);
    Finding { value: Some(f64::from(u8::from(differs))), ..found }
}

pub(super) fn scenes(item: &str, base: &Value, candidate: &Value) -> Option<Finding> {
    Some(scene(item, [base["scene_blake3"].as_str()?, candidate["scene_blake3"].as_str()?]))
}

/// How the configurations store irradiance; nothing where this program cannot read them.
pub(super) fn storage(item: &str, reports: [&Value; 2]) -> Vec<Finding> {
    let [a, b] = reports.map(|v| v["config"].as_str().and_then(|text| Config::parse(text, "").ok()));
    let (Some(a), Some(b)) = (a, b) else { return Vec::new() };
    storage::storage(item, [a, b].map(|c| (c.store.irradiance.fineness(), c.store.border)))
}
