//! Two results compared: figures, gates, verdict.
//!
//! [`sides`] finds what there is, [`probes`], [`images`] and [`figures`] compare it and make findings, [`thresholds`] judges
//! these into [`gate`]s, and [`markdown`], [`junit`] and [`shown`] tell of them. Nothing is written here.

mod bakes;
mod conclude;
pub mod config_changes;
pub mod figures;
pub mod gate;
mod image_gates;
pub mod images;
pub mod junit;
pub mod markdown;
pub mod mask;
mod noise;
mod pairs;
pub mod probes;
pub mod ratio;
mod renders;
pub mod shown;
pub mod sides;
pub mod storage;
mod sweep_plot;
mod sweeps;
pub mod thresholds;

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use self::conclude::conclude;
use self::config_changes::ConfigChange;
use self::figures::Figure;
use self::gate::{Finding, Gate};
use self::images::ImageReport;
use self::images::Pair;
use self::mask::Mask;
use self::noise::Noise;
use self::pairs::{check, image_pair, pair_up, pictures, shown_pairs};
use self::probes::ProbesReport;
use self::shown::Shown;
use self::sides::{Item, Side};
use self::thresholds::Thresholds;
use crate::image::{ImageError, Picture8};
use crate::probe::container::FileError;
pub use crate::report::page::Command;
use crate::report::page::PageError;
use crate::system::memory::TooLittleMemory;

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
    Page(#[from] PageError),
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
    /// What gives this report again: the comparison, then what made its sides, as far as their reports tell.
    pub commands: Vec<Command>,
}

/// A comparison and its pictures, by the names that the report gives them.
#[derive(Debug)]
pub struct Compared {
    pub report: DiffReport,
    pub shown: Shown,
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
    /// That asks for it.
    pub command_line: String,
}

/// What is found while the items are gone through.
#[derive(Debug, Default)]
struct Found {
    findings: Vec<Finding>,
    images: Vec<ImageReport>,
    maps: Vec<Option<Picture8>>,
    shown: Shown,
    /// About how many pairs of pictures the page shows.
    shown_pairs: usize,
    probes: Vec<ProbesReport>,
    figures: Vec<Figure>,
    added: Vec<String>,
    missing: Vec<String>,
    about: [About; 2],
}

/// What a side says of itself.
#[derive(Debug, Clone, Default)]
struct About {
    seed: Option<u64>,
    config: Option<String>,
    scene: Option<String>,
    /// Each once, in the order of the items.
    commands: Vec<Command>,
}

/// Compares two sides. `on_item` is told what is being compared.
///
/// # Errors
/// Sides that cannot be read, or not be compared.
pub fn compare(request: &Request, mut on_item: impl FnMut(&str)) -> Result<Compared, DiffError> {
    let sides = [Side::open(request.base)?, Side::open(request.candidate)?];
    let pairs = pair_up(&sides)?;
    let has_pictures = |item: &Item| matches!(item, Item::Render { .. } | Item::Image(_));
    if let (Some(mask), false) = (request.mask, pairs.both.iter().any(|(_, base, _)| has_pictures(base))) {
        let what = "no picture is compared; leave it out, or compare renders or images".to_owned();
        return Err(DiffError::Mask { path: mask.path.clone(), what });
    }
    // All that headers and reports tell is said before the work.
    let mut kept = 0.0;
    for (_, base, candidate) in &pairs.both {
        kept = check(base, candidate, request, kept)?;
    }
    let mut found =
        Found { shown_pairs: shown_pairs(&pairs), added: pairs.added, missing: pairs.missing, ..Default::default() };
    for (name, base, candidate) in &pairs.both {
        on_item(name);
        compare_item(name, base, candidate, request, &mut found)?;
    }
    Ok(conclude(request, &sides, found))
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
            let noise = Noise::of_reports([b_report, c_report]);
            let mut unevenness = None;
            for pair in pictures(name, [a, b], b_report, request.mask) {
                match (pair.base.is_file(), pair.candidate.is_file()) {
                    (true, true) => {
                        let compared = images::compare(&Pair { noise, ..pair }, found.shown_pairs)?;
                        unevenness = unevenness.or(compared.unevenness.filter(|_| noise == Noise::Other));
                        found.take_images(compared, noise);
                    }
                    (true, false) if pair.judged => found.missing.push(pair.item),
                    (false, true) if pair.judged => found.added.push(pair.item),
                    // A baseline need not keep what does not decide.
                    _ => {}
                }
            }
            found.take_figures(renders::renders(name, b_report, c_report, unevenness), noise);
        }
        (Item::Bake(a), Item::Bake(b)) => found.take_figures(bakes::bakes(name, a, b), Noise::of_reports([a, b])),
        (Item::Sweep(a), Item::Sweep(b)) => {
            let (compared, [missing, added]) = sweeps::sweeps(name, a, b);
            found.take_figures(compared, Noise::of_reports([a, b]));
            found.missing.extend(missing);
            found.added.extend(added);
            found.shown.plots.extend(sweep_plot::plot(name, a, b));
        }
        (Item::Probes(a), Item::Probes(b)) => {
            let (report, findings, files) = probes::compare(name, a, b)?;
            found.probes.push(report);
            let noise = Noise::of([files[0].seed, files[1].seed]);
            found.take(findings, noise);
            let [base, candidate] = &files;
            found.findings.push(figures::scene(name, [&base.scene.blake3, &candidate.scene.blake3]));
            for (side, file) in files.iter().enumerate() {
                found.about[side].seed = found.about[side].seed.or(file.seed);
                found.about[side].config.get_or_insert_with(|| file.config.clone());
                found.about[side].scene.get_or_insert_with(|| file.scene.blake3.clone());
            }
        }
        (Item::Image(a), Item::Image(b)) => {
            let pair = image_pair(name, a, b, request.mask);
            found.take_images(images::compare(&pair, found.shown_pairs)?, Noise::Unknown);
        }
        // Kinds were compared when the items were paired.
        _ => {}
    }
    Ok(())
}

impl Found {
    fn note(&mut self, side: usize, report: Option<&Value>) {
        let Some(report) = report else { return };
        let about = &mut self.about[side];
        if let (Some(command), Some(line)) = (report["command"].as_str(), report["command_line"].as_str())
            && about.commands.iter().all(|known| known.line != line)
            // A line that is several is for no shell, and for no comment under a pull request.
            && !line.contains(char::is_control)
        {
            let side = ["base", "candidate"][side];
            about.commands.push(Command { purpose: format!("{command}, {side}"), line: line.to_owned() });
        }
        let text = |key: &str| report[key].as_str().map(str::to_owned);
        // The noise of a render is that of its probes.
        about.seed = about.seed.or(report["bake_seed"].as_u64()).or(report["seed"].as_u64());
        about.config = about.config.take().or_else(|| text("config"));
        about.scene = about.scene.take().or_else(|| text("scene_blake3"));
    }

    fn take(&mut self, findings: Vec<Finding>, noise: Noise) {
        self.findings.extend(findings.into_iter().map(|finding| Finding { noise, ..finding }));
    }

    fn take_figures(&mut self, compared: figures::Compared, noise: Noise) {
        self.take(compared.findings, noise);
        self.figures.extend(compared.figures);
    }

    fn take_images(&mut self, compared: images::Compared, noise: Noise) {
        self.take(compared.findings, noise);
        self.images.extend(compared.reports);
        self.maps.extend(compared.maps);
        self.shown.images.extend(compared.shown);
    }
}
