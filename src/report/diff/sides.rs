//! What a path of the command line holds: one file, or a folder of what can be compared.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use super::DiffError;
use crate::report::{bake, render};
use crate::system::input::read_file;

/// The layout of sweeps.
const SWEEP_SCHEMA: &str = "lightprobe-sweep/1";

/// Files that `render` and `sweep` write their figures to.
const RENDER_REPORT: &str = "report.json";
const SWEEP_REPORT: &str = "sweep.json";

/// Folders deeper than this are no results, but links in a circle.
const MAX_DEPTH: usize = 8;

/// Reports are some kilobytes; sweeps of many configurations a megabyte.
const MAX_REPORT_BYTES: u64 = 64 << 20;

/// A pictures' layers of `render` that are compared, with whether they decide.
pub const RENDER_PICTURES: &[(&str, bool)] = &[("visibility_on", true), ("visibility_off", false)];

/// What can be compared with its like.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A folder that `render` wrote, and its report.
    Render {
        folder: PathBuf,
        report: Value,
    },
    Bake(Value),
    Sweep(Value),
    Probes(PathBuf),
    Image(PathBuf),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    Render,
    Bake,
    Sweep,
    Probes,
    Image,
}

impl Item {
    pub fn kind(&self) -> Kind {
        match self {
            Item::Render { .. } => Kind::Render,
            Item::Bake(_) => Kind::Bake,
            Item::Sweep(_) => Kind::Sweep,
            Item::Probes(_) => Kind::Probes,
            Item::Image(_) => Kind::Image,
        }
    }

    /// The report, where it is or has one.
    pub fn report(&self) -> Option<&Value> {
        match self {
            Item::Render { report, .. } | Item::Bake(report) | Item::Sweep(report) => Some(report),
            Item::Probes(_) | Item::Image(_) => None,
        }
    }
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Kind::Render => "a folder of render",
            Kind::Bake => "a report of bake",
            Kind::Sweep => "a sweep",
            Kind::Probes => "a probe file",
            Kind::Image => "an image",
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
    /// Looks what there is.
    pub fn open(path: &Path) -> Result<Side, DiffError> {
        let metadata = fs::metadata(path)
            .map_err(|cause| DiffError::Unreadable { path: path.to_owned(), cause: cause.to_string() })?;
        let items = match metadata.is_dir() {
            true => folder(path)?,
            false => BTreeMap::from([(String::new(), file(path)?)]),
        };
        Ok(Side { path: path.to_owned(), items })
    }

    /// The kind, where there is only one item.
    pub fn single(&self) -> Option<(&str, &Item)> {
        self.items.iter().next().filter(|_| self.items.len() == 1).map(|(name, item)| (name.as_str(), item))
    }

    /// What it is, in words.
    pub fn description(&self) -> String {
        match self.items.get("") {
            Some(item) => item.kind().name().to_owned(),
            None => format!("a folder of {}", self.items.len()),
        }
    }
}

fn folder(path: &Path) -> Result<BTreeMap<String, Item>, DiffError> {
    let mut items = BTreeMap::new();
    collect(path, "", 0, &mut items)?;
    if items.is_empty() {
        return Err(DiffError::Empty { path: path.to_owned() });
    }
    Ok(items)
}

/// Adds what a folder holds. `name`: of the folder within the side.
fn collect(path: &Path, name: &str, depth: usize, items: &mut BTreeMap<String, Item>) -> Result<(), DiffError> {
    let unreadable = |cause: std::io::Error| DiffError::Unreadable { path: path.to_owned(), cause: cause.to_string() };
    // A folder that a command wrote is one item; what else lies in it are its pictures.
    for report in [RENDER_REPORT, SWEEP_REPORT] {
        let report = path.join(report);
        if !report.is_file() {
            continue;
        }
        let value = read_json(&report)?;
        match (schema_of(&report, &value)?, value) {
            (Some(Kind::Render), value) => {
                items.insert(name.to_owned(), Item::Render { folder: path.to_owned(), report: value });
                return Ok(());
            }
            (Some(Kind::Sweep), value) => {
                items.insert(name.to_owned(), Item::Sweep(value));
                return Ok(());
            }
            _ => {}
        }
    }
    let mut entries: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(path).map_err(unreadable)? {
        entries.push(entry.map_err(unreadable)?.path());
    }
    entries.sort();
    for entry in entries {
        let Some(leaf) = entry.file_name().map(|n| n.to_string_lossy()).filter(|n| !n.starts_with('.')) else {
            continue;
        };
        let inner = if name.is_empty() { leaf.into_owned() } else { format!("{name}/{leaf}") };
        if entry.is_dir() {
            // A link that leads back to a folder it lies in holds nothing that is not there already.
            let is_loop = fs::canonicalize(&entry)
                .is_ok_and(|real| fs::canonicalize(path).is_ok_and(|here| here.starts_with(real)));
            if depth < MAX_DEPTH && !is_loop {
                collect(&entry, &inner, depth + 1, items)?;
            }
        } else if let Some(item) = known_file(&entry)? {
            items.insert(inner, item);
        }
    }
    Ok(())
}

/// A file of a folder; `None` where it is nothing to compare.
fn known_file(path: &Path) -> Result<Option<Item>, DiffError> {
    Ok(match extension(path).as_str() {
        "probes" => Some(Item::Probes(path.to_owned())),
        "exr" | "hdr" | "png" => Some(Item::Image(path.to_owned())),
        "json" => {
            let value = read_json(path)?;
            match schema_of(path, &value)? {
                Some(Kind::Bake) => Some(Item::Bake(value)),
                Some(Kind::Sweep) => Some(Item::Sweep(value)),
                _ => None,
            }
        }
        _ => None,
    })
}

/// A file that was named itself.
fn file(path: &Path) -> Result<Item, DiffError> {
    if let Some(item) = known_file(path)? {
        return Ok(item);
    }
    let what = match extension(path).as_str() {
        "json" => match read_json(path)?["schema"].as_str() {
            Some(schema) if schema == render::SCHEMA => {
                let folder = path.parent().unwrap_or(Path::new("."));
                return Err(DiffError::Unknown {
                    path: path.to_owned(),
                    what: format!("it is the report of a render; give its folder, {}", folder.display()),
                });
            }
            Some(schema) => format!("reports of layout {schema} are not compared"),
            None => "it has no 'schema' and is no report of lightprobe".to_owned(),
        },
        _ => "it is no .probes, .json, .exr, .hdr or .png file".to_owned(),
    };
    let what = format!("{what}; give a folder of render or sweep, a report of bake, a probe file or an image");
    Err(DiffError::Unknown { path: path.to_owned(), what })
}

/// In small letters.
pub fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn read_json(path: &Path) -> Result<Value, DiffError> {
    let unreadable = |cause: String| DiffError::Unreadable { path: path.to_owned(), cause };
    let bytes = fs::metadata(path).map_err(|e| unreadable(e.to_string()))?.len();
    if bytes > MAX_REPORT_BYTES {
        return Err(DiffError::Damaged { path: path.to_owned(), what: format!("{bytes} bytes are no report") });
    }
    let text = read_file(path).map_err(|e| unreadable(e.to_string()))?;
    serde_json::from_slice(&text).map_err(|e| DiffError::Damaged { path: path.to_owned(), what: e.to_string() })
}

/// What a report is; `None` for JSON that is none, or one that is not compared. Layouts that this program does not know
/// are an error: a figure that has moved must not pass for one that is gone.
fn schema_of(path: &Path, report: &Value) -> Result<Option<Kind>, DiffError> {
    let Some(schema) = report["schema"].as_str() else { return Ok(None) };
    for (known, kind) in [(render::SCHEMA, Kind::Render), (bake::SCHEMA, Kind::Bake), (SWEEP_SCHEMA, Kind::Sweep)] {
        if schema == known {
            return Ok(Some(kind));
        }
        let stem = |s: &str| s.rsplit_once('/').map(|(stem, _)| stem.to_owned());
        if stem(schema).is_some() && stem(schema) == stem(known) {
            return Err(DiffError::Schema { path: path.to_owned(), found: schema.to_owned(), known: known.to_owned() });
        }
    }
    Ok(None)
}
