//! Two results compared: figures, gates, verdict.
//!
//! [`sides`] finds what there is, [`probes`], [`images`] and [`figures`] compare it and make findings, [`thresholds`] judges
//! these into [`gate`]s, and [`markdown`] and [`junit`] tell of them. Nothing is written here.

pub mod figures;
pub mod gate;
pub mod images;
pub mod junit;
pub mod markdown;
pub mod probes;
pub mod ratio;
pub mod sides;
pub mod thresholds;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use self::figures::Figure;
use self::gate::{Finding, Gate};
use self::images::{ImageReport, Mask, Pair, join};
use self::probes::ProbesReport;
use self::sides::{Item, RENDER_PICTURES, Side};
use self::thresholds::Thresholds;
use crate::image::{ImageError, Picture8};
use crate::memory::TooLittleMemory;
use crate::probe::container::FileError;
use crate::report::format;

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-diff/1";

/// Why two sides cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum DiffError {
    #[error("cannot read {path}: {cause}; check the path")]
    Unreadable { path: PathBuf, cause: String },
    #[error("{path} is damaged or no report: {what}; make it again")]
    Damaged { path: PathBuf, what: String },
    #[error("{path} holds nothing that can be compared: no report, no .probes, no image; give the folder of a render")]
    Empty { path: PathBuf },
    #[error("cannot compare {path}: {what}")]
    Unknown { path: PathBuf, what: String },
    #[error(
        "{path} has the layout {found}, this program reads {known}; update lightprobe, or make both sides with one version"
    )]
    Schema { path: PathBuf, found: String, known: String },
    #[error("cannot compare {base} with {candidate}: {what}")]
    Incomparable { base: PathBuf, candidate: PathBuf, what: String },
    #[error("--mask {path}: {what}")]
    Mask { path: PathBuf, what: String },
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Probes(#[from] FileError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
}

/// What a side is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideReport {
    pub path: String,
    pub kind: String,
    pub items: usize,
    /// Of the first report or probe file that has one.
    pub seed: Option<u64>,
    pub config: Option<String>,
    pub scene_blake3: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    pub passed: bool,
    pub gates: usize,
    pub failed: usize,
    pub waived: usize,
    /// The gate that is farthest beyond its threshold.
    pub first: Option<String>,
    pub sentence: String,
}

/// All of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiffReport {
    pub schema: &'static str,
    pub version: &'static str,
    pub base: SideReport,
    pub candidate: SideReport,
    pub verdict: Verdict,
    /// What fails first, then by margin.
    pub gates: Vec<Gate>,
    pub images: Vec<ImageReport>,
    pub probes: Vec<ProbesReport>,
    pub figures: Vec<Figure>,
    /// Items that only the candidate, or only the base has.
    pub added: Vec<String>,
    pub missing: Vec<String>,
    /// Lines of the configuration that differ.
    pub config_changes: Vec<ConfigChange>,
    pub thresholds: Thresholds,
    pub notes: Vec<String>,
    /// What gives this report again, and its sides as far as their reports tell.
    pub commands: Vec<String>,
}

/// A line of the effective configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigChange {
    pub key: String,
    pub base: Option<String>,
    pub candidate: Option<String>,
}

/// A comparison and its pictures, by the names that the report gives them.
#[derive(Debug)]
pub struct Compared {
    pub report: DiffReport,
    pub pictures: Vec<(String, Picture8)>,
}

/// What was asked for.
#[derive(Debug)]
pub struct Request<'a> {
    pub base: &'a Path,
    pub candidate: &'a Path,
    pub thresholds: &'a Thresholds,
    pub allow_scene_change: bool,
    pub mask: Option<&'a Mask>,
    /// The command line that asks for it.
    pub command: String,
}

/// What is found while the items are gone through.
#[derive(Debug, Default)]
struct Found {
    findings: Vec<Finding>,
    images: Vec<ImageReport>,
    maps: Vec<Option<Picture8>>,
    probes: Vec<ProbesReport>,
    figures: Vec<Figure>,
    added: Vec<String>,
    missing: Vec<String>,
    about: [About; 2],
    commands: Vec<String>,
}

/// What a side says of itself.
#[derive(Debug, Clone, Default)]
struct About {
    seed: Option<u64>,
    config: Option<String>,
    scene: Option<String>,
}

/// Compares two sides. `on_item` is told what is being compared.
///
/// # Errors
/// Sides that cannot be read, or not be compared.
pub fn compare(request: &Request, mut on_item: impl FnMut(&str)) -> Result<Compared, DiffError> {
    let sides = [Side::open(request.base)?, Side::open(request.candidate)?];
    let pairs = pair_up(&sides)?;
    // All that headers and reports tell is said before the work.
    for (_, base, candidate) in &pairs.both {
        check(base, candidate, request)?;
    }
    let mut found = Found { added: pairs.added, missing: pairs.missing, ..Default::default() };
    for (name, base, candidate) in &pairs.both {
        on_item(name);
        compare_item(name, base, candidate, request, &mut found)?;
    }
    Ok(conclude(request, &sides, found))
}

/// Items by name: of both, and of one side only.
struct Pairs<'a> {
    both: Vec<(&'a str, &'a Item, &'a Item)>,
    added: Vec<String>,
    missing: Vec<String>,
}

fn pair_up(sides: &[Side; 2]) -> Result<Pairs<'_>, DiffError> {
    let [base, candidate] = sides;
    let incomparable =
        |what: String| DiffError::Incomparable { base: base.path.clone(), candidate: candidate.path.clone(), what };
    if let (Some((_, a)), Some((_, b))) = (base.single(), candidate.single()) {
        if a.kind() != b.kind() {
            return Err(incomparable(format!("one is {}, the other {}", a.kind().name(), b.kind().name())));
        }
        if base.items.contains_key("") && candidate.items.contains_key("") {
            return Ok(Pairs { both: vec![("", a, b)], added: Vec::new(), missing: Vec::new() });
        }
    }
    if base.items.contains_key("") != candidate.items.contains_key("") {
        return Err(incomparable(format!(
            "one is {}, the other {}; give two of a kind",
            base.description(),
            candidate.description()
        )));
    }
    let mut both = Vec::new();
    for (name, a) in &base.items {
        let Some(b) = candidate.items.get(name) else { continue };
        if a.kind() != b.kind() {
            let (a, b) = (a.kind().name(), b.kind().name());
            return Err(incomparable(format!("{name} is {a} in one and {b} in the other")));
        }
        both.push((name.as_str(), a, b));
    }
    if both.is_empty() {
        return Err(incomparable("no name is in both folders; name the files of both alike".to_owned()));
    }
    let only = |x: &Side, y: &Side| x.items.keys().filter(|name| !y.items.contains_key(*name)).cloned().collect();
    Ok(Pairs { both, added: only(candidate, base), missing: only(base, candidate) })
}

/// The pictures of two folders of `render` that are there on both sides.
fn pictures<'m>(name: &str, [base, candidate]: [&Path; 2], report: &Value, mask: Option<&'m Mask>) -> Vec<Pair<'m>> {
    let exposure_ev = figures::number(report, "exposure_ev").map(|ev| ev as f32);
    let pair = |&(picture, judged): &(&str, bool)| {
        let [base, candidate] = [base, candidate].map(|folder| folder.join(format!("{picture}.exr")));
        Pair { item: join(name, picture), base, candidate, judged, exposure_ev, mask }
    };
    RENDER_PICTURES.iter().map(pair).collect()
}

/// Refuses what cannot be compared, before anything is.
fn check(base: &Item, candidate: &Item, request: &Request) -> Result<(), DiffError> {
    let mask = request.mask;
    match (base, candidate) {
        (Item::Render { folder: a, report: b_report }, Item::Render { folder: b, report: c_report }) => {
            for key in ["camera", "width", "height"] {
                if b_report[key] != c_report[key] {
                    let (x, y) = (&b_report[key], &c_report[key]);
                    let what = format!("{key} {x} and {key} {y}; render both with the same --camera and --size");
                    return Err(DiffError::Incomparable { base: a.clone(), candidate: b.clone(), what });
                }
            }
            let pairs = pictures("", [a, b], b_report, mask);
            pairs.iter().filter(|p| p.base.is_file() && p.candidate.is_file()).try_for_each(images::check)
        }
        (Item::Image(a), Item::Image(b)) => images::check(&image_pair("", a, b, mask)),
        _ => Ok(()),
    }
}

fn image_pair<'m>(name: &str, base: &Path, candidate: &Path, mask: Option<&'m Mask>) -> Pair<'m> {
    Pair {
        item: name.to_owned(),
        base: base.to_owned(),
        candidate: candidate.to_owned(),
        judged: true,
        exposure_ev: None,
        mask,
    }
}

fn compare_item(
    name: &str,
    base: &Item,
    candidate: &Item,
    request: &Request,
    found: &mut Found,
) -> Result<(), DiffError> {
    for (side, item) in [base, candidate].into_iter().enumerate() {
        found.note(side, item.report());
    }
    match (base, candidate) {
        (Item::Render { folder: a, report: b_report }, Item::Render { folder: b, report: c_report }) => {
            found.take_figures(figures::renders(name, b_report, c_report));
            for pair in pictures(name, [a, b], b_report, request.mask) {
                match (pair.base.is_file(), pair.candidate.is_file()) {
                    (true, true) => found.take_images(images::compare(&pair)?),
                    (true, false) if pair.judged => found.missing.push(pair.item),
                    (false, true) if pair.judged => found.added.push(pair.item),
                    // A baseline need not keep what does not decide.
                    _ => {}
                }
            }
            found.commands.extend([b_report, c_report].into_iter().filter_map(render_command));
        }
        (Item::Bake(a), Item::Bake(b)) => found.take_figures(figures::bakes(name, a, b)),
        (Item::Sweep(a), Item::Sweep(b)) => {
            let (compared, [missing, added]) = figures::sweeps(name, a, b);
            found.take_figures(compared);
            found.missing.extend(missing);
            found.added.extend(added);
        }
        (Item::Probes(a), Item::Probes(b)) => {
            let (report, findings, files) = probes::compare(name, a, b)?;
            found.probes.push(report);
            found.findings.extend(findings);
            let [base, candidate] = &files;
            found.findings.push(figures::scene(name, [&base.scene.blake3, &candidate.scene.blake3]));
            for (side, file) in files.iter().enumerate() {
                found.about[side].config.get_or_insert_with(|| file.config.clone());
                found.about[side].scene.get_or_insert_with(|| file.scene.blake3.clone());
            }
        }
        (Item::Image(a), Item::Image(b)) => found.take_images(images::compare(&image_pair(name, a, b, request.mask))?),
        // Kinds were compared when the items were paired.
        _ => {}
    }
    Ok(())
}

/// The command that made a render, but for the paths of its inputs, which its report does not hold.
fn render_command(report: &Value) -> Option<String> {
    let (camera, seed) = (report["camera"].as_str()?, report["seed"].as_u64()?);
    let (width, height) = (report["width"].as_u64()?, report["height"].as_u64()?);
    let camera = shell_word(camera);
    Some(format!("lightprobe render SCENE PROBES -o DIR --camera {camera} --size {width}x{height} --seed {seed}"))
}

/// A word as a POSIX shell reads it back.
pub fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

impl Found {
    fn note(&mut self, side: usize, report: Option<&Value>) {
        let Some(report) = report else { return };
        let about = &mut self.about[side];
        let text = |key: &str| report[key].as_str().map(str::to_owned);
        about.seed = about.seed.or(report["seed"].as_u64());
        about.config = about.config.take().or_else(|| text("config"));
        about.scene = about.scene.take().or_else(|| text("scene_blake3"));
    }

    fn take_figures(&mut self, compared: figures::Compared) {
        self.findings.extend(compared.findings);
        self.figures.extend(compared.figures);
    }

    fn take_images(&mut self, compared: images::Compared) {
        self.findings.extend(compared.findings);
        self.images.extend(compared.reports);
        self.maps.extend(compared.maps);
    }
}

/// Gates that a scene which is allowed to change does not fail by that alone.
const OF_THE_SCENE: &[&str] = &["scene", "image.surface"];

fn conclude(request: &Request, sides: &[Side; 2], mut found: Found) -> Compared {
    let count = |name, list: &[String], words: &str| {
        let explanation = if list.is_empty() { words.to_owned() } else { format!("{words}: {}.", list.join(", ")) };
        Finding { scale: 1.0, ..Finding::count(name, "", list.len(), 1, explanation) }
    };
    found.findings.push(count("missing", &found.missing, "What only the base has"));
    found.findings.push(count("added", &found.added, "What only the candidate has"));
    let scene_changed = found.findings.iter().any(|f| f.name == "scene" && f.value == Some(1.0));
    let mut gates: Vec<Gate> = found.findings.into_iter().map(|finding| request.thresholds.judge(finding)).collect();
    for gate in &mut gates {
        let of_the_scene = OF_THE_SCENE.contains(&gate.name.as_str()) && scene_changed;
        if request.allow_scene_change && of_the_scene && !gate.passed {
            gate.waived = true;
            gate.source = "--allow-scene-change".to_owned();
        }
    }
    gate::sort(&mut gates);
    let pictures = name_maps(&mut found.images, found.maps);
    let [about_base, about_candidate] = &found.about;
    let side = |side: &Side, about: &About| SideReport {
        path: side.path.display().to_string(),
        kind: side.description(),
        items: side.items.len(),
        seed: about.seed,
        config: about.config.clone(),
        scene_blake3: about.scene.clone(),
    };
    let mut notes = Vec::new();
    if let (Some(a), Some(b)) = (about_base.seed, about_candidate.seed) {
        notes.push(match a == b {
            true => format!("Both sides have the seed {a}: without any change their noise would be the same."),
            false => format!("The seeds are {a} and {b}: the sides differ by their noise at least."),
        });
    }
    let mut commands = vec![request.command.clone()];
    let mut known = BTreeSet::new();
    commands.extend(found.commands.into_iter().filter(|command| known.insert(command.clone())));
    let report = DiffReport {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        base: side(&sides[0], about_base),
        candidate: side(&sides[1], about_candidate),
        verdict: verdict(&gates),
        gates,
        images: found.images,
        probes: found.probes,
        figures: found.figures,
        added: found.added,
        missing: found.missing,
        config_changes: config_changes(about_base.config.as_deref(), about_candidate.config.as_deref()),
        thresholds: request.thresholds.clone(),
        notes,
        commands,
    };
    Compared { report, pictures }
}

/// Gives the difference maps names that are safe in any folder.
fn name_maps(images: &mut [ImageReport], maps: Vec<Option<Picture8>>) -> Vec<(String, Picture8)> {
    let mut named = Vec::new();
    let mut taken = BTreeSet::new();
    for (image, map) in images.iter_mut().zip(maps) {
        let Some(map) = map else { continue };
        let safe = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_') { c } else { '_' };
        let stem: String = image.item.chars().map(safe).collect();
        let stem = if stem.is_empty() { "difference".to_owned() } else { format!("difference_{stem}") };
        let names = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}_{n}")));
        // Endless: one of them is free.
        let name = names.map(|name| format!("{name}.png")).find(|name| !taken.contains(name)).unwrap_or_default();
        taken.insert(name.clone());
        image.difference_map = Some(name.clone());
        named.push((name, map));
    }
    named
}

fn verdict(gates: &[Gate]) -> Verdict {
    let failed: Vec<&Gate> = gates.iter().filter(|g| g.fails()).collect();
    let waived = gates.iter().filter(|g| g.waived).count();
    let judged = gates.iter().filter(|g| g.is_judged()).count();
    let first = failed.first().map(|g| g.title());
    let allowed = if waived > 0 { format!(", {waived} waived") } else { String::new() };
    let sentence = match &first {
        Some(first) => format!("Beyond thresholds: {} of {judged} gates fail{allowed}, first {first}.", failed.len()),
        None => format!("Within thresholds: all {judged} gates pass{allowed}."),
    };
    Verdict { passed: failed.is_empty(), gates: judged, failed: failed.len(), waived, first, sentence }
}

/// The keys of two effective configurations, in RON, whose lines differ.
fn config_changes(base: Option<&str>, candidate: Option<&str>) -> Vec<ConfigChange> {
    let (Some(base), Some(candidate)) = (base, candidate) else { return Vec::new() };
    let (a, b) = (keys(base), keys(candidate));
    let value = |lines: &[(String, String)], key: &str| lines.iter().find(|l| l.0 == key).map(|l| l.1.clone());
    let mut names: Vec<&String> = a.iter().map(|l| &l.0).collect();
    names.extend(b.iter().map(|l| &l.0).filter(|key| value(&a, key).is_none()));
    let change = |key: &String| ConfigChange { key: key.clone(), base: value(&a, key), candidate: value(&b, key) };
    names.into_iter().map(change).filter(|c| c.base != c.candidate).collect()
}

/// Lines of RON as `Config::to_ron` writes it: key with those of the levels above it, value.
fn keys(ron: &str) -> Vec<(String, String)> {
    let mut above: Vec<String> = Vec::new();
    let mut lines = Vec::new();
    for line in ron.lines().map(str::trim) {
        let name = |above: &[String], key: &str| {
            above.iter().map(String::as_str).filter(|part| !part.is_empty()).chain([key]).collect::<Vec<_>>().join(".")
        };
        let (key, value) = line.split_once(": ").unwrap_or(("", line));
        if let Some(opened) = value.strip_suffix('(') {
            if !opened.is_empty() {
                lines.push((name(&above, key), opened.to_owned()));
            }
            above.push(key.to_owned());
        } else if value.starts_with(')') {
            above.pop();
        } else if !key.is_empty() {
            lines.push((name(&above, key), value.trim_end_matches(',').to_owned()));
        }
    }
    lines
}

/// A gate's figure with its unit; the dash where it is not defined.
pub fn in_unit(value: Option<f64>, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format::or_undefined(value, |v| format!("{}{unit}", format::significant(v, 3)))
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
    use super::gate::Direction;
    use super::*;

    #[test]
    fn configurations_are_compared_by_key() {
        let with = |assignments: &[&str]| {
            let assignments: Vec<String> = assignments.iter().map(|a| (*a).to_owned()).collect();
            crate::config::Config::default().with_overrides(&assignments).unwrap().to_ron()
        };
        let base = with(&[]);
        assert_eq!(config_changes(Some(&base), Some(&base)), []);
        let changes = config_changes(Some(&base), Some(&with(&["query.visibility=none", "encoding.border=0"])));
        let names: Vec<&str> = changes.iter().map(|c| c.key.as_str()).collect();
        assert_eq!(names, ["query.visibility", "query.visibility.voxels_per_cell", "encoding.border"], "{changes:?}");
        assert_eq!(changes[2].candidate.as_deref(), Some("0"));
    }

    #[test]
    fn words_for_the_shell() {
        assert_eq!(shell_word("out/a_b-1.exr"), "out/a_b-1.exr");
        assert_eq!(shell_word("it's; rm"), r"'it'\''s; rm'");
        assert_eq!(shell_word(""), "''");
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
