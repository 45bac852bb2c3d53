//! What reports and comparisons say, figure by figure. Reports grow, so they are read as plain JSON: a figure that only one side has
//! is a finding and no mistake.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use serde_json::{Value, json};

use crate::config::Config;
use crate::report::page::ConfigChange;

/// Keys of a report that are not figures of the result.
const NOT_FIGURES: [&str; 6] = ["seed", "bake_seed", "threads", "exposure_ev", "bounces", "plan"];

/// Every value of a JSON document by its place, such as "methods.visibility_on.leak.light". Members of lists have the place of their
/// name; a list without names is one value.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Facts(BTreeMap<String, Value>);

/// One number of a report on both sides.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    pub item: String,
    pub name: String,
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    pub difference: Option<f64>,
}

impl Facts {
    /// Of a report, with what follows from its lists and its configuration.
    pub fn of_report(report: &Value) -> Facts {
        let mut facts = Facts::of(report);
        let mut put = |place: String, value: Value| facts.0.insert(place, value);
        if let Some(last) = report["bounces"].as_array().and_then(|bounces| bounces.last()) {
            put("energy".to_owned(), last["energy"].clone());
        }
        if let Some(config) = report["config"].as_str().and_then(|text| Config::parse(text, "").ok()) {
            let fineness = config.store.irradiance.fineness();
            put("stored.precision".to_owned(), json!(fineness.rounding));
            put("stored.border".to_owned(), json!(config.store.border));
            put("stored.resolution".to_owned(), json!(fineness.resolution));
        }
        for configuration in report["configurations"].as_array().into_iter().flatten() {
            let (Some(label), Some(runs)) = (configuration["label"].as_str(), configuration["runs"].as_array()) else {
                continue;
            };
            let converged = runs.iter().filter(|run| run["converged"] == true).count();
            put(format!("configurations.{label}.seeds"), json!(runs.len()));
            put(format!("configurations.{label}.converged"), json!(converged as f64 / runs.len() as f64));
        }
        facts
    }

    pub fn of(value: &Value) -> Facts {
        let mut facts = Facts::default();
        facts.collect(value, "");
        facts
    }

    fn collect(&mut self, value: &Value, place: &str) {
        let below = |key: &str| join_by(place, key, '.');
        let name = |member: &Value| {
            ["name", "label", "method"].iter().find_map(|key| Some(member.get(key)?.as_str()?.to_owned()))
        };
        match value {
            Value::Object(members) => members.iter().for_each(|(key, member)| self.collect(member, &below(key))),
            Value::Array(members) if members.iter().any(|member| name(member).is_some()) => {
                members.iter().filter_map(|m| Some((m, name(m)?))).for_each(|(m, name)| self.collect(m, &below(&name)));
            }
            leaf => {
                self.0.insert(place.to_owned(), leaf.clone());
            }
        }
    }

    pub fn get(&self, place: &str) -> Option<&Value> {
        self.0.get(place).filter(|value| !value.is_null())
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a report of this layout says anything about a figure, be it that it is undefined. Reports of older programs
    /// lack what was not thought of.
    pub fn knows(&self, place: &str) -> bool {
        let above = place.match_indices('.').map(|(dot, _)| &place[..dot]);
        above.chain([place]).any(|place| self.0.contains_key(place))
    }

    /// A number, or 1 for yes and 0 for no.
    pub fn number(&self, place: &str) -> Option<f64> {
        let value = self.get(place)?;
        value.as_f64().or_else(|| value.as_bool().map(|yes| f64::from(u8::from(yes))))
    }

    pub fn text(&self, place: &str) -> Option<&str> {
        self.get(place)?.as_str()
    }

    /// Names of the configurations of a sweep.
    pub fn configurations(&self) -> BTreeSet<&str> {
        self.0.keys().filter_map(|place| place.strip_prefix("configurations.")?.strip_suffix(".label")).collect()
    }

    /// Names of the engines whose look-ups a render has beside a method's own.
    pub fn engines(&self) -> BTreeSet<&str> {
        self.0.keys().filter_map(|place| place.strip_prefix("methods.as_")?.strip_suffix(".name")).collect()
    }
}

/// What the random numbers of both sides have to do with each other.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Seeds {
    /// Nothing tells, as of pictures alone. They are taken for equal.
    #[default]
    Unknown,
    Equal,
    Other,
}

impl Seeds {
    /// All seeds that went into both sides count: a render's own is that of its lamps' samples, its probes have that of their bake; a
    /// sweep has several.
    pub fn of(sides: [&Facts; 2]) -> Seeds {
        let is_told = |key: &&str| sides.iter().any(|side| side.0.contains_key(*key));
        let equal = |key: &str| sides[0].get(key).zip(sides[1].get(key)).map(|(base, candidate)| base == candidate);
        let equal: Vec<Option<bool>> = ["seed", "bake_seed", "seeds"].into_iter().filter(is_told).map(equal).collect();
        match equal {
            _ if equal.contains(&Some(false)) => Seeds::Other,
            _ if equal.is_empty() || equal.contains(&None) => Seeds::Unknown,
            _ => Seeds::Equal,
        }
    }
}

/// Name of a part of an item.
pub fn join(item: &str, part: &str) -> String {
    join_by(item, part, '/')
}

fn join_by(item: &str, part: &str, by: char) -> String {
    if item.is_empty() || part.is_empty() { format!("{item}{part}") } else { format!("{item}{by}{part}") }
}

/// All figures of two reports.
pub fn side_by_side(item: &str, sides: [&Facts; 2]) -> Vec<Figure> {
    let names: BTreeSet<&String> = sides.iter().flat_map(|side| side.0.keys()).collect();
    let is_figure = |name: &&String| !name.split('.').any(|key| NOT_FIGURES.contains(&key));
    let figure = |name: &String| {
        let [base, candidate] = sides.map(|side| side.0.get(name)?.as_f64());
        base.or(candidate)?;
        let difference = base.zip(candidate).map(|(base, candidate)| candidate - base);
        Some(Figure { item: item.to_owned(), name: name.clone(), base, candidate, difference })
    };
    names.into_iter().filter(is_figure).filter_map(figure).collect()
}

/// Keys of two effective configurations that differ. `None`: a side has none, or both differ and this program cannot read one.
pub fn config_changes([base, candidate]: [Option<&str>; 2]) -> Option<Vec<ConfigChange>> {
    if base? == candidate? {
        return Some(Vec::new());
    }
    let facts = |text: &str| Some(Facts::of(&serde_json::to_value(Config::parse(text, "").ok()?).ok()?));
    let (base, candidate) = (facts(base?)?, facts(candidate?)?);
    let keys: BTreeSet<&String> = base.0.keys().chain(candidate.0.keys()).collect();
    let value = |facts: &Facts, key: &String| facts.0.get(key).map(|v| v.to_string().trim_matches('"').to_owned());
    let change =
        |key: &String| ConfigChange { key: key.clone(), base: value(&base, key), candidate: value(&candidate, key) };
    Some(keys.into_iter().map(change).filter(|change| change.base != change.candidate).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configurations_are_compared_by_key() {
        let with = |assignments: &[&str]| {
            let assignments: Vec<String> = assignments.iter().map(|a| (*a).to_owned()).collect();
            Config::default().with_overrides(&assignments).unwrap().to_ron()
        };
        let base = with(&[]);
        assert_eq!(config_changes([Some(&base), Some(&base)]), Some(Vec::new()));
        let changes =
            config_changes([Some(&base), Some(&with(&["query.visibility=none", "encoding.border=0"]))]).unwrap();
        let names: Vec<&str> = changes.iter().map(|c| c.key.as_str()).collect();
        assert_eq!(
            names,
            [
                "query.test",
                "query.test.table.reach_voxels",
                "query.test.table.strip",
                "store.border",
                "store.occlusion",
                "store.occlusion.surface.voxels_per_cell"
            ]
        );
        assert_eq!(changes[3].candidate.as_deref(), Some("0"));
        // Of another version, and not told.
        assert_eq!(config_changes([Some(&base), Some("(of_later: 1)")]), None);
        assert_eq!(config_changes([Some("(of_later: 1)"); 2]), Some(Vec::new()));
        assert_eq!(config_changes([Some(&base), None]), None);
    }

    #[test]
    fn members_of_lists_have_their_name() {
        let report = json!({"methods": [{"name": "a", "leak": {"light": 0.5}}], "bounces": [{"energy": 2.0}], "seed": 3,
                            "configurations": [{"label": "x.y=1", "runs": [{"converged": true}, {"converged": false}]}]});
        let facts = Facts::of_report(&report);
        assert_eq!((facts.number("methods.a.leak.light"), facts.number("energy")), (Some(0.5), Some(2.0)));
        assert_eq!(facts.number("configurations.x.y=1.converged"), Some(0.5));
        assert_eq!(facts.configurations(), BTreeSet::from(["x.y=1"]));
        let render = Facts::of_report(&json!({"methods": [{"name": "visibility_on"}, {"name": "as_bevy"}]}));
        assert_eq!(render.engines(), BTreeSet::from(["bevy"]));
        let names: Vec<String> = side_by_side("", [&facts, &facts]).into_iter().map(|figure| figure.name).collect();
        assert_eq!(
            names,
            ["configurations.x.y=1.converged", "configurations.x.y=1.seeds", "energy", "methods.a.leak.light"]
        );
    }

    #[test]
    fn every_seed_of_a_side_counts() {
        let render = |seed: u64, bake: Value| json!({"command": "render", "seed": seed, "bake_seed": bake});
        for (a, b, expected) in [
            (render(0, json!(1)), render(0, json!(1)), Seeds::Equal),
            (render(0, json!(1)), render(0, json!(2)), Seeds::Other),
            (render(0, json!(1)), render(3, json!(1)), Seeds::Other),
            (render(0, json!(null)), render(0, json!(1)), Seeds::Unknown),
            (json!({"command": "bake", "seed": 4}), json!({"command": "bake", "seed": 4}), Seeds::Equal),
            (json!({"seed": 0, "seeds": [0, 1]}), json!({"seed": 0, "seeds": [0, 1]}), Seeds::Equal),
            (json!({"seed": 0, "seeds": [0, 1]}), json!({"seed": 0, "seeds": [0, 1, 2]}), Seeds::Other),
            (json!({}), json!({}), Seeds::Unknown),
        ] {
            assert_eq!(Seeds::of([&Facts::of(&a), &Facts::of(&b)]), expected, "{a} {b}");
        }
    }
}
