//! From two paths to the report: items are paired, compared and judged.

use std::path::Path;

use serde_json::json;

use super::error::DiffError;
use super::figures::{Facts, Seeds, config_changes, join, side_by_side};
use super::images;
use super::mask::Mask;
use super::noise::{self, SIGNIFICANCE};
use super::pairs::{Paired, check, pair_up, pictures};
use super::probes;
use super::report::{DiffReport, SCHEMA, SideReport, Verdict};
use super::rules::{Finding, findings};
use super::shown;
use super::sides::{Item, Kind, Side};
use super::sweep_plot;
use super::thresholds::{Exception, Thresholds};
use crate::image::Picture8;
use crate::report::gate::{self, Gate};
use crate::report::page::{Command, PackedImage};

/// Gates that a scene which is allowed to change does not fail by that alone.
const OF_THE_SCENE: &[&str] = &["scene", "image.surface"];

/// What was asked for.
#[derive(Debug)]
pub struct Request<'a> {
    pub base: &'a Path,
    pub candidate: &'a Path,
    pub thresholds: &'a Thresholds,
    pub allow_scene_change: bool,
    pub mask: Option<&'a Mask>,
    /// That asks for it.
    pub command_line: String,
}

/// A comparison and its pictures, by the names that the report gives them.
#[derive(Debug, Default)]
pub struct Compared {
    pub report: DiffReport,
    /// Of the page.
    pub images: Vec<PackedImage>,
    pub plots: Vec<minijinja::Value>,
    pub pictures: Vec<(String, Picture8)>,
    /// How many pairs of pictures the page shows, at most; `None`: nothing is shown.
    shown_pairs: Option<usize>,
}

/// Compares two sides. `on_item` is told what is being compared.
///
/// # Errors
/// Sides that cannot be read, or not be compared.
pub fn compare(request: &Request, mut on_item: impl FnMut(&str)) -> Result<Compared, DiffError> {
    let sides = [Side::open(request.base)?, Side::open(request.candidate)?];
    let pairs = pair_up(&sides)?;
    // All that headers and reports tell is said before the work.
    let shown_pairs = Some(check(&pairs, request.mask)?);
    let mut compared = Compared { shown_pairs, ..Compared::default() };
    let report = &mut compared.report;
    (report.schema, report.version) = (SCHEMA, env!("CARGO_PKG_VERSION"));
    (report.base, report.candidate) = (side_report(&sides[0]), side_report(&sides[1]));
    report.config_changes = config_changes([report.base.config.as_deref(), report.candidate.config.as_deref()]);
    (report.added, report.missing) = (pairs.added, pairs.missing);
    report.thresholds = request.thresholds.clone();
    let mut all = Vec::new();
    for Paired { name, bases, candidate } in &pairs.both {
        on_item(name);
        let mut of_item = compared.add(name, [bases[0], candidate], request.mask)?;
        let between = |other: &&Item| Compared::default().add(name, [bases[0], other], request.mask);
        noise::measure(&mut of_item, &bases[1..].iter().map(between).collect::<Result<Vec<_>, _>>()?);
        all.extend(of_item);
        compared.report.figures.extend(side_by_side(name, [&bases[0].facts, &candidate.facts]));
    }
    let report = &mut compared.report;
    let facts = Facts::of(&json!({"missing": report.missing.len(), "added": report.added.len()}));
    all.extend(findings("all", "", [&Facts::default(); 2], &facts, Seeds::Unknown));
    noise::bound(&mut all);
    report.gates = judge(request, all, report);
    report.verdict = Verdict::of(&report.gates);
    let several = pairs.both.iter().map(|paired| paired.bases.len()).max().unwrap_or(0);
    report.notes.extend(seeds_in_words([report.base.seed, report.candidate.seed], several));
    for Exception { item, gate, .. } in request.thresholds.without_effect(&report.gates) {
        report.notes.push(format!("The exception for item {item}, gate {gate} fits no gate of this comparison."));
    }
    report.commands.push(Command { purpose: "compare".to_owned(), line: request.command_line.clone() });
    for (side, name) in sides.iter().zip(["base", "candidate"]) {
        let made_by = made_by(side, name);
        if made_by.is_empty() {
            let what = format!("What made {} is not known", side.path.display());
            report.notes.push(format!("{what}: only reports hold their command, and none lies there."));
        }
        report.commands.extend(made_by);
    }
    Ok(compared)
}

fn judge(request: &Request, all: Vec<Finding>, report: &DiffReport) -> Vec<Gate> {
    let scene_changed = all.iter().any(|finding| finding.gate.name == "scene" && finding.gate.value == Some(1.0));
    let mut gates: Vec<Gate> = all.into_iter().map(|finding| request.thresholds.judge(finding)).collect();
    for gate in &mut gates {
        if request.allow_scene_change && scene_changed && OF_THE_SCENE.contains(&gate.name.as_str()) && !gate.passed {
            (gate.waived, gate.source) = (true, "--allow-scene-change".to_owned());
        }
        let list = match gate.name.as_str() {
            "missing" => &report.missing,
            "added" => &report.added,
            _ => continue,
        };
        if !list.is_empty() {
            gate.explanation = format!("{}: {}.", gate.explanation.trim_end_matches('.'), list.join(", "));
        }
    }
    gate::sort(&mut gates);
    gates
}

fn side_report(side: &Side) -> SideReport {
    let first = |key: &str| side.items.values().find_map(|item| item.facts.get(key));
    let text = |key: &str| first(key).and_then(|value| value.as_str()).map(str::to_owned);
    SideReport {
        path: side.path.display().to_string(),
        kind: side.description(),
        items: side.items.len(),
        // The noise of a render is that of its probes.
        seed: first("bake_seed").or_else(|| first("seed")).and_then(|seed| seed.as_u64()),
        config: text("config"),
        scene_blake3: text("scene_blake3"),
    }
}

fn seeds_in_words(seeds: [Option<u64>; 2], several: usize) -> Option<String> {
    let [base, candidate] = [seeds[0]?, seeds[1]?];
    Some(match several {
        2.. => {
            let chance = format!("it alone fails a comparison with a chance of {} %", 100.0 * SIGNIFICANCE);
            format!("The base has {several} seeds: what noise does is measured between them, and {chance}.")
        }
        _ if base == candidate => {
            format!("Both sides have the seed {base}: without any change their noise would be the same.")
        }
        _ => {
            let remedy = "Keep the seed, or give a folder with the base's results of five seeds or more, to find less";
            format!("The seeds are {base} and {candidate}, one a side: the wide bounds other_seeds hold. {remedy}.")
        }
    })
}

/// Commands of a side's reports, each once.
fn made_by(side: &Side, name: &str) -> Vec<Command> {
    let mut commands: Vec<Command> = Vec::new();
    for facts in side.items.values().map(|item| &item.facts) {
        // A line that is several is for no shell, and for no comment under a pull request.
        if let (Some(command), Some(line)) = (facts.text("command"), facts.text("command_line"))
            && !line.contains(char::is_control)
            && commands.iter().all(|known| known.line != line)
        {
            commands.push(Command { purpose: format!("{command}, {name}"), line: line.to_owned() });
        }
    }
    commands
}

impl Compared {
    /// Compares two items of one kind, whose name this is.
    fn add(&mut self, name: &str, [a, b]: [&Item; 2], mask: Option<&Mask>) -> Result<Vec<Finding>, DiffError> {
        let sides = [&a.facts, &b.facts];
        let seeds = Seeds::of(sides);
        let mut of_pair = Facts::default();
        if a.kind == Kind::Probes {
            let compared = probes::compare(name, &a.path, &b.path)?;
            of_pair = Facts::of(&compared.figures);
            self.report.probes.push(compared);
        }
        let mut all = findings(a.kind.names()[0], name, sides, &of_pair, seeds);
        if a.kind == Kind::Sweep {
            let [base, candidate] = sides.map(Facts::configurations);
            self.report.missing.extend(base.difference(&candidate).map(|label| join(name, label)));
            self.report.added.extend(candidate.difference(&base).map(|label| join(name, label)));
            self.plots.extend(sweep_plot::plot(name, &a.report, &b.report));
        }
        for pair in pictures(name, [a, b], mask) {
            match (pair.base.is_file(), pair.candidate.is_file()) {
                (true, true) => all.extend(self.compare_pictures(&pair)?),
                (true, false) if pair.judged => self.report.missing.push(pair.item),
                (false, true) if pair.judged => self.report.added.push(pair.item),
                // A baseline need not keep what does not decide.
                _ => {}
            }
        }
        Ok(all)
    }

    fn compare_pictures(&mut self, pair: &images::Pair) -> Result<Vec<Finding>, DiffError> {
        let (mut all, no_facts) = (Vec::new(), Facts::default());
        let none = [&no_facts; 2];
        images::compare(pair, |mut layer| {
            if pair.judged {
                all.extend(findings("image", &layer.report.item, none, &Facts::of(&layer.report.figures), pair.seeds));
            }
            if let Some(pairs) = self.shown_pairs {
                self.images.push(shown::image(&layer, pairs)?);
                let name = self.free_name(&layer.report.item);
                self.pictures.push((name.clone(), layer.difference_map()));
                layer.report.difference_map = Some(name);
                self.report.images.push(layer.report);
            }
            Ok(())
        })?;
        if let Some(share) = images::surfaces(pair)? {
            let facts = Facts::of(&json!({"surface_percent": share}));
            all.extend(findings("surface", &pair.item, none, &facts, pair.seeds));
        }
        Ok(all)
    }

    /// A name for the difference map of an item that is safe in any folder.
    fn free_name(&self, item: &str) -> String {
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        let item: String = item.chars().map(safe).collect();
        let mut name = format!("difference_{item}").trim_end_matches('_').to_owned() + ".png";
        while self.pictures.iter().any(|(taken, _)| *taken == name) {
            name.insert_str(0, "another_");
        }
        name
    }
}
