//! What the page gets of a comparison.

use std::borrow::Cow;

use super::figures;
use super::images::{ImageReport, LIGHT};
use super::probes::{self, ProbesReport};
use super::{DiffReport, SideReport};
use crate::image::Picture;
use crate::probe::lattice::ProbeState;
use crate::report::page::{
    Figure, FigureTable, Histogram, PackedImage, Page, PageError, PageImage, Plot, ProbeComparison, ProbeRow, Side,
};

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
        config_changes: [&report.base, &report.candidate]
            .iter()
            .all(|side| side.config.is_some())
            .then_some(&report.config_changes),
        notes: report.notes.clone(),
    }
}

fn side(side: &SideReport) -> Side {
    Side { path: side.path.clone(), kind: side.kind.clone(), seed: side.seed, scene_blake3: side.scene_blake3.clone() }
}

/// One pair of pictures of about `pairs`.
pub(super) fn image(
    report: &ImageReport,
    unit: &str,
    used: &[bool],
    [base, candidate]: [&Picture; 2],
    pairs: usize,
) -> Result<PackedImage, PageError> {
    let quantity = match report.layer.as_str() {
        _ if report.is_display => "colours of a screen",
        "beauty" => "radiance",
        layer if layer == LIGHT[1] => "indirect irradiance",
        _ => "light",
    };
    PackedImage::new(
        &PageImage {
            name: if report.item.is_empty() { report.layer.clone() } else { report.item.clone() },
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
            width: report.width,
            height: report.height,
            base: Cow::Borrowed(&base.pixels),
            candidate: Cow::Borrowed(&candidate.pixels),
            exposure_ev: report.exposure_ev.unwrap_or(0.0),
            is_display_referred: report.is_display,
            is_judged: report.judged,
            is_compared: Some(used),
            figures: image_figures(report, unit),
            worst_pixel: report.worst.map(|worst| [worst.x, worst.y]),
        },
        pairs,
    )
}

fn image_figures(report: &ImageReport, unit: &str) -> Vec<Figure> {
    let of_pair = |name: &str, value: Option<f64>, unit: &str| Figure {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ..Figure::default()
    };
    // Beside the histogram there is no room for the unit in every column.
    let with_unit = |name: &str| if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") };
    let means = [report.mean_base, report.mean_candidate];
    let finite = [report.non_finite_base, report.non_finite_candidate].map(|count| Some(count as f64));
    let mut figures = vec![
        of_both(&with_unit("mean luminance"), means, ""),
        of_pair(&with_unit("mae"), report.mae, ""),
        of_pair(&with_unit("rmse"), report.rmse, ""),
        of_pair("relmse", report.relmse, ""),
        of_pair("psnr_db, peak 1", report.psnr_db, "dB"),
    ];
    if let Some(flip) = report.flip {
        let of_flip = [
            ("FLIP, mean", flip.mean),
            ("FLIP, median", flip.median),
            ("FLIP, 95 %", flip.p95),
            ("FLIP, 99 %", flip.p99),
            ("FLIP, largest", flip.max),
        ];
        figures.extend(of_flip.map(|(name, value)| of_pair(name, Some(value), "")));
    }
    figures.push(of_both("pixels not finite", finite, ""));
    figures.push(of_pair("pixels compared", Some(report.pixels as f64), ""));
    figures
}

fn of_both(name: &str, [base, candidate]: [Option<f64>; 2], unit: &str) -> Figure {
    let value = base.zip(candidate).map(|(base, candidate)| candidate - base);
    Figure { name: name.to_owned(), base, candidate, value, standard_error: None, unit: unit.to_owned() }
}

fn probe_comparison(report: &ProbesReport) -> ProbeComparison {
    let count =
        |name: &str, value: usize| Figure { name: name.to_owned(), value: Some(value as f64), ..Figure::default() };
    let change = Figure {
        name: "change of mean irradiance".to_owned(),
        value: report.irradiance_change_percent,
        standard_error: report.irradiance_change_standard_error_percent,
        unit: "%".to_owned(),
        ..Figure::default()
    };
    let rms = Figure {
        name: "rms of single probes' changes".to_owned(),
        value: Some(report.irradiance_rms_percent),
        unit: "%".to_owned(),
        ..Figure::default()
    };
    let means = [report.irradiance_base, report.irradiance_candidate].map(Some);
    let histogram = |title: &str, unit: &str, values: &[f32]| {
        (!values.is_empty()).then(|| Histogram {
            title: title.to_owned(),
            unit: unit.to_owned(),
            what: "probes".to_owned(),
            values: values.to_vec(),
        })
    };
    let histograms = [
        histogram("Change of mean irradiance, lit probes", "%", &report.changes_percent),
        histogram("Difference of stored distances, root mean square", "m", &report.distance_differences_m),
    ];
    ProbeComparison {
        name: if report.item.is_empty() { "Probe file".to_owned() } else { report.item.clone() },
        figures: vec![
            of_both("mean irradiance", means, "W·m⁻²"),
            change,
            rms,
            of_both("probes", [report.probes_base, report.probes_candidate].map(|n| Some(n as f64)), ""),
            count("added", report.added),
            count("removed", report.removed),
            count("moved", report.moved),
            count("flipped between active and not", report.flipped),
            count("compared: active on both sides", report.compared),
        ],
        worst: report.worst.iter().map(probe).collect(),
        histograms: histograms.into_iter().flatten().collect(),
    }
}

fn probe(row: &probes::ProbeRow) -> ProbeRow {
    let state = |state| match state {
        ProbeState::Active => "active",
        ProbeState::InsideGeometry => "inside geometry",
        ProbeState::NeverSampled => "never sampled",
    };
    ProbeRow {
        index: row.index as u64,
        position_m: row.position_m,
        irradiance: Some(row.irradiance_difference_relative),
        distance_m: row.distance_difference_m,
        base_state: state(row.state_base).to_owned(),
        candidate_state: state(row.state_candidate).to_owned(),
        moved_m: Some(row.moved_m),
    }
}

/// Figures of reports, a table for each item.
fn tables(all: &[figures::Figure]) -> Vec<FigureTable> {
    let mut tables: Vec<FigureTable> = Vec::new();
    for figure in all {
        let title = if figure.item.is_empty() { "Report" } else { &figure.item };
        let row = of_both(&figure.name, [figure.base, figure.candidate], "");
        match tables.iter_mut().find(|table| table.title == title) {
            Some(table) => table.figures.push(row),
            None => tables.push(FigureTable { title: title.to_owned(), figures: vec![row] }),
        }
    }
    tables
}
