//! What a path of the command line holds: one file, or a folder of what can be compared.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::error::DiffError;
use super::figures::{Facts, join};
use crate::probe::file;
use crate::report::{bake, render};
use crate::system::input::read_file;

/// Layouts of reports that are compared.
const SCHEMAS: [(&str, Kind); 3] =
    [(render::SCHEMA, Kind::Render), (bake::SCHEMA, Kind::Bake), ("lightprobe-sweep/1", Kind::Sweep)];

/// Files that `render` and `sweep` write their figures to.
const FOLDER_REPORTS: [(&str, Kind); 2] = [("report.json", Kind::Render), ("sweep.json", Kind::Sweep)];

/// Folders deeper than this are no results, but links in a circle.
const MAX_DEPTH: usize = 8;

/// What can be compared with its like.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    pub kind: Kind,
    /// The folder of a render, and of others the file.
    pub path: PathBuf,
    /// Of a probe file what it says of itself; null for images.
    pub report: Value,
    pub facts: Facts,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Render,
    Bake,
    Sweep,
    Probes,
    Image,
}

impl Kind {
    /// Its name in `rules.csv`, and in words.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Kind::Render => ["render", "a folder of render"],
            Kind::Bake => ["bake", "a report of bake"],
            Kind::Sweep => ["sweep", "a sweep"],
            Kind::Probes => ["probes", "a probe file"],
            Kind::Image => ["", "an image"],
        }
    }
}

/// One side of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Side {
    pub path: PathBuf,
    /// By name within the folder; the one item of a side that is no folder of several has none.
    pub items: BTreeMap<String, Item>,
}

impl Side {
    /// Finds what there is, and reads the reports of it.
    ///
    /// # Errors
    /// A path that cannot be read or holds nothing to compare; reports and probe files that are damaged or of an unknown layout.
    pub fn open(path: &Path) -> Result<Side, DiffError> {
        let is_folder = fs::metadata(path).map_err(|cause| unreadable(path, &cause))?.is_dir();
        let mut items = BTreeMap::new();
        if is_folder {
            collect(path, "", 0, &mut items)?;
        } else {
            let mut item = item_of(path)?.ok_or_else(|| unknown(path))?;
            if item.kind == Kind::Render {
                item.path.pop();
            }
            items.insert(String::new(), item);
        }
        if items.is_empty() {
            let what = "holds nothing to compare: no report, no .probes, no image; give the folder of a render";
            return Err(DiffError::file(path, what));
        }
        Ok(Side { path: path.to_owned(), items })
    }

    /// What it is, in words.
    pub fn description(&self) -> String {
        let of_many = || format!("a folder of {}", self.items.len());
        self.items.get("").map_or_else(of_many, |item| item.kind.names()[1].to_owned())
    }
}

/// Adds what a folder holds. `name`: of the folder within the side.
fn collect(path: &Path, name: &str, depth: usize, items: &mut BTreeMap<String, Item>) -> Result<(), DiffError> {
    // A folder that a command wrote is one item; what else lies in it are its pictures.
    for (report, kind) in FOLDER_REPORTS.map(|(report, kind)| (path.join(report), kind)) {
        if report.is_file()
            && let Some(item) = item_of_report(&report)?.filter(|item| item.kind == kind)
        {
            items.insert(name.to_owned(), Item { path: path.to_owned(), ..item });
            return Ok(());
        }
    }
    let entries = fs::read_dir(path).map_err(|cause| unreadable(path, &cause))?;
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for entry in entries {
        let leaf = entry.file_name().unwrap_or_default().to_string_lossy();
        if leaf.starts_with('.') {
            continue;
        }
        let inner = join(name, &leaf);
        if entry.is_dir() {
            // A link that leads back to a folder it lies in holds nothing that is not there already.
            let [real, here] = [&entry, path].map(|path| fs::canonicalize(path).ok());
            let is_loop = real.zip(here).is_some_and(|(real, here)| here.starts_with(real));
            if depth < MAX_DEPTH && !is_loop {
                collect(&entry, &inner, depth + 1, items)?;
            }
        // The report of a render belongs to its folder.
        } else if let Some(item) = item_of(&entry)?.filter(|item| item.kind != Kind::Render) {
            items.insert(inner, item);
        }
    }
    Ok(())
}

/// `None`: nothing that can be compared.
fn item_of(path: &Path) -> Result<Option<Item>, DiffError> {
    let (kind, report) = match extension(path).as_str() {
        "probes" => (Kind::Probes, report_of_probes(path)?),
        "exr" | "hdr" | "png" => (Kind::Image, Value::Null),
        "json" => return item_of_report(path),
        _ => return Ok(None),
    };
    Ok(Some(Item { kind, path: path.to_owned(), facts: Facts::of(&report), report }))
}

/// What a report is; `None` for JSON that is not compared. Layouts that this program does not know are an error: a figure that has
/// moved must not pass for one that is gone.
fn item_of_report(path: &Path) -> Result<Option<Item>, DiffError> {
    let report = read_json(path)?;
    let Some(schema) = report["schema"].as_str() else { return Ok(None) };
    let is_known = |(known, _): &(&str, Kind)| known.split('/').next() == schema.split('/').next();
    let Some((known, kind)) = SCHEMAS.into_iter().find(is_known) else { return Ok(None) };
    if known != schema {
        let remedy = "update lightprobe, or make both sides with one version";
        return Err(DiffError::file(path, format!("has the layout {schema}, this program reads {known}; {remedy}")));
    }
    Ok(Some(Item { kind, path: path.to_owned(), facts: Facts::of_report(&report), report }))
}

/// Why a file that was named itself is not compared.
fn unknown(path: &Path) -> DiffError {
    let what = match extension(path).as_str() {
        "json" => "it has no 'schema' of a report that can be compared",
        _ => "it is no .probes, .json, .exr, .hdr or .png file",
    };
    let remedy = "give a folder of render or sweep, a report of bake, a probe file or an image";
    DiffError::file(path, format!("{what}; {remedy}"))
}

fn unreadable(path: &Path, cause: &std::io::Error) -> DiffError {
    DiffError::file(path, format!("cannot be read: {cause}; check the path"))
}

/// In small letters.
fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn read_json(path: &Path) -> Result<Value, DiffError> {
    let text = read_file(path).map_err(|cause| unreadable(path, &cause))?;
    let damaged = |cause| DiffError::file(path, format!("is damaged or no report: {cause}; make it again"));
    serde_json::from_slice(&text).map_err(damaged)
}

/// What a probe file says of itself, in the words of reports.
fn report_of_probes(path: &Path) -> Result<Value, DiffError> {
    let file = file::read(path)?;
    let volume = file.volume_in_grid();
    let fineness = volume.irradiance.fineness();
    let mut told = json!({
        "seed": file.seed,
        "config": file.config,
        "scene_blake3": file.scene.blake3,
        "bytes_per_probe": {"file": file.file_bytes as f64 / volume.states.len() as f64},
        "stored": {
            "precision": fineness.rounding,
            "border": file.border,
            "resolution": fineness.resolution,
            "visibility": volume.occlusion.rank(),
        },
    });
    // Tables tell of surfaces alone, trees of all places: as reports of older programs, tables do not tell the figure.
    if volume.occlusion.surface().is_none() {
        told["stored"]["visible"] = json!(volume.occlusion.mean_visible());
    }
    Ok(told)
}
