//! Two reports of `sweep`, configuration by configuration.

use std::collections::BTreeMap;

use serde_json::Value;

use super::figures::{Compared, How, Rule, apply, number, rule, scenes, side_by_side};
use super::gate::{Direction, Finding};
use super::images::join;
use super::noise::Noise;
use super::ratio::widening;
use super::renders::{ERROR_RULES, METHOD_RULES};
use crate::system::format;

/// Of each configuration's `figures`, which are over its seeds: those that a render has too, and its gates.
const OF_RENDERS: &[(&str, &str)] = &[
    ("leak_light", "leak.light"),
    ("leak_dark", "leak.dark"),
    ("leak_fraction", "leak.fraction"),
    ("leak_unseen", "leak.unseen"),
    ("error_mae", "error.mae"),
    ("error_rmse", "error.rmse"),
    ("error_relmse", "error.relmse"),
    ("error_bias", "error.bias"),
    ("error_flip", "error.flip"),
    ("bytes_per_probe", "memory.bytes_per_probe"),
    ("shade_ms", "time.shade"),
    ("lookup_ns", "time.lookup"),
];

/// Those that a render has not.
const RULES: &[Rule] = &[
    rule("file_bytes", "memory.file_bytes", How::Growth, "%", "Bytes of the file."),
    rule("bake_s", "time.bake", How::Growth, "%", "Time of the bake, without loading and writing."),
];

fn rules() -> impl Iterator<Item = Rule> {
    let of_render = |gate: &str| METHOD_RULES.iter().chain(ERROR_RULES).find(|rule| rule.gate == gate);
    let shared = OF_RENDERS.iter().filter_map(move |&(place, gate)| Some(of_render(gate)?.at(place)));
    shared.chain(RULES.iter().copied())
}

/// Two sweeps, and the configurations that only the base or only the candidate has. The sides' errors are those of their seeds, where
/// these are others: with the same seeds a difference is a change.
pub fn sweeps(item: &str, base: &Value, candidate: &Value) -> (Compared, [Vec<String>; 2]) {
    let sides = [base, candidate].map(by_label);
    let [a, b] = &sides;
    let noise = Noise::of_reports([base, candidate]);
    let mut findings: Vec<Finding> = scenes(item, base, candidate).into_iter().collect();
    for (label, base) in a {
        let Some(candidate) = b.get(label) else { continue };
        findings.extend(configuration(&join(item, label), [base, candidate], noise));
    }
    let only = |x: &BTreeMap<&str, &Value>, y: &BTreeMap<&str, &Value>| {
        x.keys().filter(|label| !y.contains_key(*label)).map(|label| join(item, label)).collect()
    };
    (Compared { figures: side_by_side(item, base, candidate), findings }, [only(a, b), only(b, a)])
}

fn by_label(report: &Value) -> BTreeMap<&str, &Value> {
    let configurations = report["configurations"].as_array().into_iter().flatten();
    configurations.filter_map(|c| Some((c["label"].as_str()?, c))).collect()
}

fn configuration(item: &str, sides: [&Value; 2], noise: Noise) -> Vec<Finding> {
    let runs = sides.map(|side| side["runs"].as_array().map_or(0, Vec::len));
    // With few seeds the errors themselves are hardly known.
    let freedom = runs[0].saturating_sub(1) + runs[1].saturating_sub(1);
    let factor = widening(freedom as f64);
    let judged = rules().map(|rule| {
        let of = |part: &str| sides.map(|side| number(side, &format!("figures.{}.{part}", rule.place)));
        let (means, [low, high]) = (of("mean"), [of("min"), of("max")]);
        let errors =
            of("standard_error").map(|e| e.map(|e| factor * e).filter(|_| noise == Noise::Other || is_time(&rule)));
        let found = apply(&rule, item, means, errors);
        if runs == [1, 1] {
            return found;
        }
        let range = |side: usize| Some(format!("{} to {}", short(low[side]?), short(high[side]?)));
        let (Some(base), Some(candidate)) = (range(0), range(1)) else { return found };
        let explanation = format!("{} Over the seeds: base {base}, candidate {candidate}.", found.explanation);
        Finding { explanation, ..found }
    });
    // A figure that neither has says nothing.
    let mut findings: Vec<Finding> = judged.filter(|f| f.base.is_some() || f.candidate.is_some()).collect();
    let converged = sides.map(|side| {
        let runs = side["runs"].as_array().filter(|runs| !runs.is_empty())?;
        Some(runs.iter().filter(|run| run["converged"] == true).count() as f64 / runs.len() as f64)
    });
    let explanation = "Share of the bakes whose bounces settled before there were too many.";
    let found = Finding::difference("convergence", item, converged, "", Direction::Increase, explanation);
    findings.push(Finding { value: found.value.map(|v| -v), ..found });
    findings
}

/// Times scatter with equal seeds too.
fn is_time(rule: &Rule) -> bool {
    rule.gate.starts_with("time.")
}

fn short(value: f64) -> String {
    format::significant(value, 4)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn sweep(seeds: &[u64], error: f64, spread: f64) -> Value {
        let figure =
            |mean: f64| json!({"mean": mean, "min": mean - spread, "max": mean + spread, "standard_error": spread});
        let runs: Vec<Value> = seeds.iter().map(|seed| json!({"seed": seed, "converged": true})).collect();
        let figures = json!({"error_rmse": figure(error), "bake_s": figure(1.0)});
        json!({"seeds": seeds, "configurations": [{"label": "a", "figures": figures, "runs": runs}]})
    }

    fn error(base: &Value, candidate: &Value) -> Finding {
        let (compared, apart) = sweeps("", base, candidate);
        assert!(apart.iter().all(Vec::is_empty));
        compared.findings.into_iter().find(|f| f.name == "error.rmse").unwrap()
    }

    #[test]
    fn every_figure_has_its_rule() {
        assert_eq!(rules().count(), OF_RENDERS.len() + RULES.len());
    }

    #[test]
    fn errors_are_those_of_other_seeds() {
        let found = error(&sweep(&[0, 1], 0.5, 0.01), &sweep(&[0, 1], 0.6, 0.01));
        assert!((found.value.unwrap() - 0.1).abs() < 1e-12 && found.standard_error.is_none());
        // Two degrees of freedom: 19.2 standard errors are as rare as 3 of known ones (tables: t = 19.2 at 0.0027).
        let found = error(&sweep(&[0, 1], 0.5, 0.01), &sweep(&[2, 3], 0.6, 0.01));
        let expected = 0.01 * 2.0_f64.sqrt() * 19.21 / 3.0;
        assert!((found.standard_error.unwrap() / expected - 1.0).abs() < 2e-3, "{found:?}");
        assert!(
            found.explanation.ends_with("Over the seeds: base 0.4900 to 0.5100, candidate 0.5900 to 0.6100."),
            "{}",
            found.explanation
        );
    }

    #[test]
    fn bakes_that_do_not_settle_count() {
        let mut candidate = sweep(&[0, 1], 0.5, 0.01);
        candidate["configurations"][0]["runs"][0]["converged"] = json!(false);
        let (compared, _) = sweeps("", &sweep(&[0, 1], 0.5, 0.01), &candidate);
        let found = compared.findings.iter().find(|f| f.name == "convergence").unwrap();
        assert_eq!((found.base, found.candidate, found.value), (Some(1.0), Some(0.5), Some(0.5)));
    }
}
