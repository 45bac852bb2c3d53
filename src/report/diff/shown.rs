//! What the page gets of a comparison.

use std::borrow::Cow;

use serde_json::Value;

use super::figures::{self, Facts};
use super::images::Layer;
use super::probes::{self, ProbesReport};
use super::report::{DiffReport, SideReport};
use crate::report::page::{
    Figure, FigureTable, Histogram, PackedImage, Page, PageError, PageImage, Plot, ProbeComparison, ProbeRow, Side,
};

/// Name, place and unit of figures that the page lists. `{}` stands for the unit of the pixels, for which there is no room in every
/// column.
const OF_IMAGES: &[[&str; 3]] = &[
    ["mean luminance{}", "mean", ""],
    ["mae{}", "mae", ""],
    ["rmse{}", "rmse", ""],
    ["relmse", "relmse", ""],
    ["psnr_db, peak 1", "psnr_db", "dB"],
    ["FLIP, mean", "flip.mean", ""],
    ["FLIP, median", "flip.median", ""],
    ["FLIP, 95 %", "flip.p95", ""],
    ["FLIP, 99 %", "flip.p99", ""],
    ["FLIP, largest", "flip.max", ""],
    ["pixels not finite", "non_finite", ""],
    ["pixels compared", "pixels", ""],
];
const OF_PROBES: &[[&str; 3]] = &[
    ["mean irradiance", "irradiance", "W·m⁻²"],
    ["rms of single probes' changes", "irradiance_rms_percent", "%"],
    ["probes", "probes", ""],
    ["added", "added", ""],
    ["removed", "removed", ""],
    ["moved", "moved", ""],
    ["flipped between active and not", "flipped", ""],
    ["compared: active on both sides", "compared", ""],
];

/// A comparison's parts that only the page shows.
#[derive(Debug, Default)]
pub struct Shown {
    /// In the order of the report's images.
    pub images: Vec<PackedImage>,
    pub plots: Vec<Plot>,
}

/// The page of a comparison.
pub fn page(report: &DiffReport, shown: Shown) -> Page<'_> {
    Page {
        title: format!("{} against {}", report.candidate.path, report.base.path),
        sides: [side(&report.base), side(&report.candidate)],
        gates: &report.gates,
        images: shown.images,
        probes: report.probes.iter().map(probe_comparison).collect(),
        figures: tables(&report.figures),
        plots: shown.plots,
        added: report.added.clone(),
        missing: report.missing.clone(),
        commands: &report.commands,
        config_changes: report
            .base
            .config
            .as_ref()
            .and(report.candidate.config.as_ref())
            .map(|_| &report.config_changes),
        notes: report.notes.clone(),
    }
}

fn side(side: &SideReport) -> Side {
    let SideReport { path, kind, seed, scene_blake3, .. } = side.clone();
    Side { path, kind, seed, scene_blake3 }
}

/// One pair of pictures of at most `pairs`.
pub fn image(layer: &Layer, pairs: usize) -> Result<PackedImage, PageError> {
    let (report, [quantity, unit]) = (&layer.report, layer.quantity);
    let image = PageImage {
        name: if report.item.is_empty() { report.layer.clone() } else { report.item.clone() },
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
        width: report.width,
        height: report.height,
        base: Cow::Borrowed(&layer.base.pixels),
        candidate: Cow::Borrowed(&layer.candidate.pixels),
        exposure_ev: report.exposure_ev.unwrap_or(0.0),
        is_display_referred: report.is_display,
        is_judged: report.judged,
        is_compared: Some(&layer.used),
        figures: listed(&report.figures, OF_IMAGES, unit),
        worst_pixel: layer.worst,
    };
    PackedImage::new(&image, pairs)
}

/// The figures of a comparison that a table names, as far as it has them.
fn listed(figures: &Value, table: &[[&str; 3]], unit_of_pixels: &str) -> Vec<Figure> {
    let facts = Facts::of(figures);
    let unit_of_pixels = if unit_of_pixels.is_empty() { String::new() } else { format!(", {unit_of_pixels}") };
    let figure = |[name, place, unit]: &[&str; 3]| {
        let [base, candidate] = ["base", "candidate"].map(|side| facts.number(&format!("{place}_{side}")));
        let difference = base.zip(candidate).map(|(base, candidate)| candidate - base);
        let name = name.replace("{}", &unit_of_pixels);
        let value = facts.number(place).or(difference);
        Figure { name, base, candidate, value, standard_error: None, unit: (*unit).to_owned() }
    };
    let is_there = |[_, place, _]: &&[&str; 3]| !place.starts_with("flip.") || facts.get(place).is_some();
    table.iter().filter(is_there).map(figure).collect()
}

fn probe_comparison(report: &ProbesReport) -> ProbeComparison {
    let histogram = |title: &str, unit: &str, values: &[f32]| Histogram {
        title: title.to_owned(),
        unit: unit.to_owned(),
        what: "probes".to_owned(),
        values: values.to_vec(),
    };
    let mut histograms = vec![
        histogram("Change of mean irradiance, lit probes", "%", &report.changes_percent),
        histogram("Difference of stored distances, root mean square", "m", &report.distance_differences_m),
    ];
    histograms.retain(|histogram| !histogram.values.is_empty());
    ProbeComparison {
        name: if report.item.is_empty() { "Probe file".to_owned() } else { report.item.clone() },
        figures: listed(&report.figures, OF_PROBES, ""),
        worst: report.worst.iter().map(probe).collect(),
        histograms,
    }
}

fn probe(row: &probes::ProbeRow) -> ProbeRow {
    // The states have their names in reports.
    let state = |state| match serde_json::to_value(state) {
        Ok(Value::String(name)) => name.replace('_', " "),
        _ => String::new(),
    };
    ProbeRow {
        index: row.index as u64,
        position_m: row.position_m,
        irradiance: Some(row.irradiance_difference_relative),
        distance_m: row.distance_difference_m,
        base_state: state(row.state_base),
        candidate_state: state(row.state_candidate),
        moved_m: Some(row.moved_m),
    }
}

/// Figures of reports, a table for each item.
fn tables(all: &[figures::Figure]) -> Vec<FigureTable> {
    let row = |figure: &figures::Figure| {
        let figures::Figure { name, base, candidate, difference: value, .. } = figure.clone();
        Figure { name, base, candidate, value, ..Figure::default() }
    };
    let table = |figures: &[figures::Figure]| {
        let title = if figures[0].item.is_empty() { "Report".to_owned() } else { figures[0].item.clone() };
        FigureTable { title, figures: figures.iter().map(row).collect() }
    };
    all.chunk_by(|a, b| a.item == b.item).map(table).collect()
}
