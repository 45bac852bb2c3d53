//! What is judged: `rules.csv`, and the findings that it makes of two sides.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use serde::Deserialize;

use super::figures::{Facts, Seeds, join};
use crate::report::gate::Gate;
use crate::report::words::unit_of;
use crate::system::format;

static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.delimiter(b'|').trim(csv::Trim::All).comment(Some(b'#')).quoting(false);
    let rows: Result<_, csv::Error> =
        reader.from_reader(include_str!("rules.csv").as_bytes()).into_deserialize().collect();
    rows.unwrap_or_else(|error| unreachable!("the program's own table: {error}"))
});

/// A line of the table; its head says what the columns are.
#[derive(Debug, Deserialize)]
pub struct Rule {
    kinds: String,
    of: String,
    pub gate: String,
    figure: String,
    pub how: How,
    pub unit: String,
    whole: String,
    words: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    Change,
    Growth,
    Increase,
    Decrease,
    Magnitude,
    Pair,
    Same,
}

impl How {
    /// A figure of two sides; `None`: not defined, as a change from 0.
    pub fn value(self, base: f64, candidate: f64) -> Option<f64> {
        match self {
            How::Change | How::Growth if base == candidate => Some(0.0),
            How::Change | How::Growth => (base != 0.0).then(|| 100.0 * (candidate - base) / base.abs()),
            How::Decrease => Some(base - candidate),
            How::Magnitude => Some(candidate.abs() - base.abs()),
            How::Increase | How::Pair | How::Same => Some(candidate - base),
        }
    }

    /// Standard error of that to first order, from those of the sides, which are independent.
    fn error(self, [base, candidate]: [f64; 2], [of_base, of_candidate]: [f64; 2]) -> Option<f64> {
        let value = self.value(base, candidate)?;
        let [by_base, by_candidate] =
            [self.value(base + of_base, candidate)?, self.value(base, candidate + of_candidate)?];
        Some((by_base - value).hypot(by_candidate - value)).filter(|error| error.is_finite())
    }
}

/// A figure of the comparison before it is judged.
#[derive(Debug, Clone)]
pub struct Finding {
    pub rule: &'static Rule,
    /// Not judged yet. Of its value more is worse; with [`How::Change`] less is too.
    pub gate: Gate,
    /// Degrees of freedom of the standard error, where it comes of few seeds.
    pub freedom: Option<f64>,
    /// What noise may do by the measured spread of seeds; from [`super::noise::bound`].
    pub noise: Option<f64>,
    pub seeds: Seeds,
    /// What limits of 1 allow: `relative`, and `other_seeds`.
    pub scales: [f64; 2],
    /// Whether the base's report is too old to have this figure: nothing is judged then.
    pub is_new: bool,
}

/// All findings about an item of this kind. `pair`: of the comparison of the two.
pub fn findings(kind: &str, item: &str, sides: [&Facts; 2], pair: &Facts, seeds: Seeds) -> Vec<Finding> {
    let of_kind = RULES.iter().filter(|rule| rule.kinds.split(' ').any(|name| name == kind));
    let both = |of: fn(&Facts) -> BTreeSet<&str>| &of(sides[0]) & &of(sides[1]);
    let (configurations, engines) = (both(Facts::configurations), both(Facts::engines));
    let labels = |rule: &Rule| match rule.of.as_str() {
        "*" => configurations.clone(),
        "as_*" => engines.clone(),
        _ => BTreeSet::from([""]),
    };
    let all = of_kind.flat_map(|rule| labels(rule).into_iter().map(move |label| (rule, label)));
    all.filter_map(|(rule, label)| rule.find(item, label, sides, pair, seeds)).collect()
}

/// Names of all gates that there are.
pub fn gates() -> impl Iterator<Item = &'static str> {
    RULES.iter().map(|rule| rule.gate.as_str())
}

impl Rule {
    /// `None` where neither side has the figure: that says nothing.
    fn find(&'static self, item: &str, label: &str, sides: [&Facts; 2], pair: &Facts, seeds: Seeds) -> Option<Finding> {
        let place = self.figure.replace('*', label);
        let stem = place.trim_end_matches("_percent");
        let of_pair = ["base", "candidate"].map(|side| pair.number(&format!("{stem}_{side}")));
        let [base, candidate] = [0, 1].map(|side| sides[side].number(&place).or(of_pair[side]));
        let both = base.zip(candidate).map(|(base, candidate)| [base, candidate]);
        let value = match self.how {
            How::Pair => pair.number(&place),
            How::Same => {
                let [base, candidate] = sides.map(|side| side.text(&place));
                Some(f64::from(u8::from(base? != candidate?)))
            }
            how => both.and_then(|[base, candidate]| how.value(base, candidate)),
        };
        value.or(base).or(candidate)?;
        let beside = |key: &str| {
            let [base, candidate] = sides.map(|side| side.number(&beside(&place, key)));
            Some([base?, candidate?])
        };
        let [base_seeds, candidate_seeds] = sides.map(|side| side.number(&format!("configurations.{label}.seeds")));
        let freedom = base_seeds.zip(candidate_seeds).map(|(base, candidate)| base + candidate - 2.0);
        // Between equal seeds the spread of a sweep's figures is the same on both sides; times scatter all the same.
        let is_noise = freedom.is_none() || seeds == Seeds::Other || self.gate.starts_with("time.");
        let error = both.zip(beside("standard_error").filter(|_| is_noise));
        let standard_error = error.and_then(|(both, errors)| self.how.error(both, errors));
        let whole = self.whole.replace('*', label);
        let whole = whole.parse().ok().or_else(|| pair.number(&whole)).or_else(|| sides[0].number(&whole));
        let scale = match (self.unit.as_str(), self.how) {
            ("%", _) => 100.0,
            (_, How::Pair) => whole.unwrap_or(0.0),
            _ => base.unwrap_or(0.0).abs(),
        };
        let region = pair.get("region_place_m").map(ToString::to_string);
        let mut explanation = self.words.replace("{place}", &region.unwrap_or_default());
        if let (Some(least), Some(most)) = (beside("min"), beside("max")) {
            let [a, b, c, d] = [least[0], most[0], least[1], most[1]].map(|number| format::significant(number, 4));
            explanation += &format!(" Over the runs: base {a} to {b}, candidate {c} to {d}.");
        }
        let is_new = base.is_none() && self.how != How::Pair && !sides[0].is_empty() && !sides[0].knows(&place);
        if is_new {
            explanation += " The base's report does not have it: it is not judged.";
        }
        let item = join(item, &self.of.replace('*', label));
        let (name, unit) = (self.gate.clone(), self.unit.as_str());
        let side_unit = unit_of(&place);
        let gate = Gate {
            name,
            item,
            base,
            candidate,
            value,
            unit,
            side_unit,
            standard_error,
            explanation,
            ..Gate::default()
        };
        Some(Finding {
            rule: self,
            gate,
            freedom: freedom.filter(|_| standard_error.is_some()),
            noise: None,
            seeds,
            scales: [scale, whole.unwrap_or(scale)],
            is_new,
        })
    }
}

/// The place of what belongs to a figure: "a.mean" has "a.min" and "a.standard_error", "error.rmse" has "error.standard_error.rmse".
fn beside(place: &str, key: &str) -> String {
    match place.rsplit_once('.') {
        Some((stem, "mean" | "median")) => format!("{stem}.{key}"),
        Some((stem, leaf)) => format!("{stem}.{key}.{leaf}"),
        None => format!("{key}.{place}"),
    }
}
