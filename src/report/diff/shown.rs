//! The page of a comparison: its report as it is, with what only a page has.

use minijinja::value::Serde;
use minijinja::{Value, context};

use super::figures::Facts;
use super::images::Layer;
use super::probes::ProbesReport;
use super::report::DiffReport;
use crate::report::heatmap::range_of;
use crate::report::page::{self, PackedImage, PageError, PairPixels, histogram};

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

/// The page as HTML. `images` are in the order of the report's; `plots` are those of sweeps.
///
/// # Errors
/// Those of [`page::render`].
pub fn page(report: &DiffReport, images: Vec<PackedImage>, plots: Vec<Value>) -> Result<String, PageError> {
    let probes: Vec<Value> = report.probes.iter().map(probes).collect();
    let view = context! { probes, plots, ..Value::from(Serde(report)) };
    page::render(view, &report.gates, images)
}

/// One pair of pictures of at most `pairs`.
pub fn image(layer: &Layer, pairs: usize) -> Result<PackedImage, PageError> {
    let report = &layer.report;
    let pair = PairPixels {
        name: if report.item.is_empty() { &report.layer } else { &report.item },
        unit: report.unit,
        base: &layer.base,
        candidate: &layer.candidate,
        difference: &layer.difference,
        exposure_ev: report.exposure_ev,
        is_judged: report.judged,
    };
    let figures = listed(&report.figures, OF_IMAGES, report.unit);
    PackedImage::new(&pair, context! { figures, ..Value::from(Serde(report)) }, pairs)
}

/// The figures of a comparison that a table names, as far as it has them.
fn listed(figures: &serde_json::Value, table: &[[&str; 3]], unit_of_pixels: &str) -> Vec<Value> {
    let facts = Facts::of(figures);
    let unit_of_pixels = if unit_of_pixels.is_empty() { String::new() } else { format!(", {unit_of_pixels}") };
    let figure = |[name, place, unit]: &[&str; 3]| {
        let [base, candidate] = ["base", "candidate"].map(|side| facts.number(&format!("{place}_{side}")));
        let difference = base.zip(candidate).map(|(base, candidate)| candidate - base);
        let (name, difference) = (name.replace("{}", &unit_of_pixels), facts.number(place).or(difference));
        context! { name, base, candidate, difference, unit => *unit }
    };
    let is_there = |[_, place, _]: &&[&str; 3]| !place.starts_with("flip.") || facts.get(place).is_some();
    table.iter().filter(is_there).map(figure).collect()
}

fn probes(report: &ProbesReport) -> Value {
    let drawn = [
        ("Change of mean irradiance, lit probes", "%", &report.changes_percent),
        ("Difference of stored distances, root mean square", "m", &report.distance_differences_m),
    ];
    let drawn = drawn.into_iter().filter(|(.., values)| !values.is_empty());
    let histograms = drawn.map(|(title, unit, values)| histogram(title, values, range_of(values), unit, "probes"));
    context! {
        figures => listed(&report.figures, OF_PROBES, ""),
        histograms => histograms.collect::<Vec<_>>(),
        ..Value::from(Serde(report))
    }
}
