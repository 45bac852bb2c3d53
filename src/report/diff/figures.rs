//! Two reports, figure by figure. Read as plain JSON: reports grow, and a figure that only one side has is a finding and
//! no mistake.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::gate::{Direction, Finding};
use super::images::join;
use super::storage;
use crate::config::Config;

/// The method of a render that decides: the others are there to compare it with.
const JUDGED_METHOD: &str = "visibility_on";

/// What is no figure of the result.
const NOT_FIGURES: &[&str] = &["seed", "threads", "exposure_ev", "bounces", "plan"];

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
struct Rule {
    /// Place in the report, after the method's name.
    place: &'static str,
    gate: &'static str,
    how: How,
    unit: &'static str,
    explanation: &'static str,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum How {
    /// By the difference: more is worse.
    Increase,
    /// By the ratio, percent: more is worse.
    Growth,
    /// By the difference of magnitudes: farther from 0 is worse.
    Magnitude,
    /// By the difference: less is worse.
    Decrease,
}

const fn rule(
    place: &'static str,
    gate: &'static str,
    how: How,
    unit: &'static str,
    explanation: &'static str,
) -> Rule {
    Rule { place, gate, how, unit, explanation }
}

/// Of each method of a render.
const METHOD_RULES: &[Rule] = &[
    rule("leak.light", "leak.light", How::Increase, "", "Light that came through walls, as a share of all."),
    rule(
        "leak.dark",
        "leak.dark",
        How::Increase,
        "",
        "Light that the visibility test took away by mistake, as a share of all.",
    ),
    rule(
        "leak.fraction",
        "leak.fraction",
        How::Increase,
        "",
        "Share of the irradiance that came from probes not visible.",
    ),
    rule(
        "leak.dark_region",
        "leak.dark_region",
        How::Increase,
        "",
        "Light where the reference has none, as a share of its mean.",
    ),
    rule("leak.unseen", "leak.unseen", How::Increase, "", "Share of points that see none of their probes."),
    rule(
        "leak.baked",
        "leak.baked",
        How::Increase,
        "",
        "Light that leaked into the probes themselves, as a share of all.",
    ),
    rule("bytes_per_probe", "memory.bytes_per_probe", How::Growth, "%", "Bytes per probe at run time."),
    rule("shade_ms.median", "time.shade", How::Growth, "%", "Time of queries and shading."),
    rule("lookup_ns", "time.lookup", How::Growth, "%", "Time of one query on one thread."),
];

/// Of each method of a render, where there is a reference.
const ERROR_RULES: &[Rule] = &[
    rule("mae", "error.mae", How::Increase, "W/m²", "Mean absolute difference from the reference."),
    rule("rmse", "error.rmse", How::Increase, "W/m²", "Root mean square difference from the reference."),
    rule("relmse", "error.relmse", How::Increase, "", "Mean relative squared difference from the reference."),
    rule("bias", "error.bias", How::Magnitude, "W/m²", "Mean difference from the reference, by size."),
    rule("psnr_db", "error.psnr", How::Decrease, "dB", "Peak signal-to-noise ratio: less is worse."),
    rule("flip", "error.flip", How::Increase, "", "FLIP against the reference."),
];

/// Of a bake.
const BAKE_RULES: &[Rule] = &[
    rule("bytes_per_probe.runtime_kept", "memory.bytes_per_probe", How::Growth, "%", "Bytes per probe at run time."),
    rule("bytes_per_probe.file", "memory.file_bytes", How::Growth, "%", "Bytes of the file per probe."),
    rule("peak_memory_bytes", "memory.peak", How::Increase, "B", "Largest memory of the bake."),
    rule("time_s.total", "time.bake", How::Growth, "%", "Time of the whole bake."),
    rule("numerics.non_finite", "numerics.non_finite", How::Increase, "", "Values that were not finite."),
    rule("numerics.clamped.irradiance", "numerics.clamped", How::Increase, "", "Values beyond what the format holds."),
    rule(
        "numerics.hits_outside_volume",
        "numerics.hits_outside",
        How::Increase,
        "",
        "Hits outside the hull of the probes.",
    ),
];

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

fn apply(rule: &Rule, item: &str, values: [Option<f64>; 2], errors: [Option<f64>; 2]) -> Finding {
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
    // The sides' errors are independent.
    let error = errors[0].zip(errors[1]).map(|(b, c)| b.hypot(c));
    found.with_error(error)
}

fn apply_all(rules: &[Rule], item: &str, [base, candidate]: [&Value; 2]) -> Vec<Finding> {
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

fn scenes(item: &str, base: &Value, candidate: &Value) -> Option<Finding> {
    Some(scene(item, [base["scene_blake3"].as_str()?, candidate["scene_blake3"].as_str()?]))
}

/// Standard error of the change of energy between bakes of different seeds, percent: a report does not know its own. The
/// spread was 0.03 to 0.5 % in three scenes of 300 to 430 probes; more probes have less.
const ENERGY_NOISE_PERCENT: f64 = 0.5;

fn energy(item: &str, reports: [&Value; 2]) -> Finding {
    let energy = reports.map(|v| v["bounces"].as_array().and_then(|b| number(b.last()?, "energy")));
    let explanation = "Energy in the probes after the last bounce.";
    let [a, b] = reports.map(|v| v["seed"].as_u64());
    // The same numbers are drawn: without a change there is no difference.
    let noise = if a.is_some() && a == b { 0.0 } else { ENERGY_NOISE_PERCENT };
    Finding::ratio("irradiance.energy", item, energy, Direction::Both, explanation).with_error(Some(noise))
}

/// How the configurations store irradiance; nothing where this program cannot read them.
fn storage(item: &str, reports: [&Value; 2]) -> Vec<Finding> {
    let [a, b] = reports.map(|v| v["config"].as_str().and_then(|text| Config::parse(text, "").ok()));
    let (Some(a), Some(b)) = (a, b) else { return Vec::new() };
    storage::storage(item, [a, b].map(|c| (c.encoding.irradiance, c.encoding.border, c.filter.irradiance_resolution)))
}

pub fn bakes(item: &str, base: &Value, candidate: &Value) -> Compared {
    let mut findings = apply_all(BAKE_RULES, item, [base, candidate]);
    findings.extend(scenes(item, base, candidate));
    let converged = [base, candidate].map(|v| v["converged"].as_bool().map(|yes| f64::from(u8::from(yes))));
    let explanation = "Whether the bounces settled (1) before there were too many (0).";
    let found = Finding::difference("convergence", item, converged, "", Direction::Increase, explanation);
    findings.push(Finding { value: found.value.map(|v| -v), ..found });
    findings.push(energy(item, [base, candidate]));
    findings.extend(storage(item, [base, candidate]));
    let active = [base, candidate].map(|v| number(v, "probes_active"));
    let explanation = "Probes that hold light.";
    findings.push(Finding::ratio("probes.active", item, active, Direction::Both, explanation));
    Compared { figures: side_by_side(item, base, candidate), findings }
}

pub fn renders(item: &str, base: &Value, candidate: &Value) -> Compared {
    let mut findings: Vec<Finding> = scenes(item, base, candidate).into_iter().collect();
    let method = |report: &Value| {
        let methods = report["methods"].as_array()?;
        methods.iter().find(|m| m["name"].as_str() == Some(JUDGED_METHOD)).cloned()
    };
    let methods = [base, candidate].map(|r| method(r).unwrap_or_default());
    let [b, c] = &methods;
    let name = join(item, JUDGED_METHOD);
    findings.extend(apply_all(METHOD_RULES, &name, [b, c]).into_iter().map(|found| spread(found, [b, c])));
    for (key, suffix) in [("error", ""), ("error_gltf", "/gltf")] {
        findings.extend(apply_all(ERROR_RULES, &format!("{name}{suffix}"), [&b[key], &c[key]]));
    }
    let peak = rule("peak_memory_bytes", "memory.peak", How::Increase, "B", "Largest memory of the render.");
    findings.extend(apply_all(&[peak], item, [base, candidate]));
    findings.extend(storage(item, [base, candidate]));
    Compared { figures: side_by_side(item, base, candidate), findings }
}

/// Says how far repeated runs of a time lie apart.
fn spread(found: Finding, methods: [&Value; 2]) -> Finding {
    if found.name != "time.shade" {
        return found;
    }
    let range = |v: &Value| {
        let number = |key| number(v, &format!("shade_ms.{key}"));
        Some(format!("{:.3} to {:.3} ms", number("min")?, number("max")?))
    };
    let [Some(base), Some(candidate)] = methods.map(range) else { return found };
    let explanation = format!("{} Repeated runs: base {base}, candidate {candidate}.", found.explanation);
    Finding { explanation, ..found }
}

/// Sweeps hold several configurations; each is judged as a render's method is, as far as it has such figures.
pub fn sweeps(item: &str, base: &Value, candidate: &Value) -> (Compared, [Vec<String>; 2]) {
    let by_label = |report: &Value| -> BTreeMap<String, Value> {
        let configurations = report["configurations"].as_array().into_iter().flatten();
        let label = |c: &Value| c["label"].as_str().or(c["name"].as_str()).map(str::to_owned);
        configurations.filter_map(|c| Some((label(c)?, c.clone()))).collect()
    };
    let [a, b] = [by_label(base), by_label(candidate)];
    let mut findings: Vec<Finding> = scenes(item, base, candidate).into_iter().collect();
    for (label, base) in &a {
        let Some(candidate) = b.get(label) else { continue };
        let name = join(item, label);
        // Figures stand in the configuration or in its `figures`.
        let pick = |v: &Value| v.get("figures").filter(|f| f.is_object()).unwrap_or(v).clone();
        let [base, candidate] = [pick(base), pick(candidate)];
        findings.extend(apply_all(METHOD_RULES, &name, [&base, &candidate]));
        let errors = [&base, &candidate].map(|v| v.get("error").unwrap_or(v).clone());
        findings.extend(apply_all(ERROR_RULES, &name, [&errors[0], &errors[1]]));
    }
    let only = |x: &BTreeMap<String, Value>, y: &BTreeMap<String, Value>| {
        x.keys().filter(|label| !y.contains_key(*label)).map(|label| join(item, label)).collect()
    };
    let apart = [only(&a, &b), only(&b, &a)];
    (Compared { figures: side_by_side(item, base, candidate), findings }, apart)
}
