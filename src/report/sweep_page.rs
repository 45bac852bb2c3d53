//! The page of a sweep: charts whose marks tell their configuration and show its picture. One file that loads nothing.

use minijinja::value::Serde;
use minijinja::{Environment, Error, context};
use serde_json::{Value, json};

use super::sweep::{Aggregate, ConfigurationReport, PerFront, SweepReport};
use crate::system::format;

const PAGE: &str = include_str!("assets/sweep/page.html");
const STYLE: &str = include_str!("assets/sweep/page.css");
const SCRIPT: &str = include_str!("assets/sweep/page.js");

/// What stands for the nonce until it is known.
const NO_NONCE: &str = "0";

/// What a configuration shows, as data URIs.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    pub picture: String,
    /// Signed difference from the reference.
    pub difference: String,
}

/// A figure of the page's tables: its name, its key in the report, and how it is written.
type Figure = (&'static str, &'static str, fn(f64) -> String);

const FIGURES: &[Figure] = &[
    ("error", "error_relative", format::percent),
    ("in corners", "error_corner", format::percent),
    ("bent normals", "error_bent", format::percent),
    ("leak light", "leak_light", format::percent),
    ("leak dark", "leak_dark", format::percent),
    ("blocks", "leak_blocks", format::percent),
    ("error in air", "air_error", format::percent),
    ("bake", "bake_s", format::seconds),
    ("shade", "shade_ms", |ms| format::seconds(ms / 1e3)),
    ("memory", "bytes", |bytes| format::bytes(bytes.round() as u64)),
    ("memory per probe", "bytes_per_probe", |bytes| format::bytes(bytes.round() as u64)),
];

/// An axis of a chart: its figure, its name, and the factor to the unit of that name.
const AXES: &[(&str, &str, f64)] = &[
    ("bake_s", "bake time, s", 1.0),
    ("bytes", "memory at run time, KiB", 1.0 / 1024.0),
    ("shade_ms", "shading of the picture, ms", 1.0),
    ("error_relative", "error, %", 100.0),
    ("leak_light", "leaked light, %", 100.0),
    ("leak_blocks", "blocks, % of the points", 100.0),
];

/// Charts: title, the figures along and up, and the front that fills its marks.
const CHARTS: &[[&str; 4]] = &[
    ["Error against bake time", "bake_s", "error_relative", "bake_s"],
    ["Error against memory", "bytes", "error_relative", "bytes"],
    ["Error against shading time", "shade_ms", "error_relative", "shade_ms"],
    ["Leaked light against memory", "bytes", "leak_light", "leak_light"],
    ["Blocks against memory", "bytes", "leak_blocks", "bytes"],
];

/// The page as HTML. `shown` has an entry for each configuration; `reference` is its picture.
///
/// # Errors
/// None in practice: the template is part of the program.
pub fn render(report: &SweepReport, shown: &[Shown], reference: &str) -> Result<String, Error> {
    let mut environment = Environment::new();
    // The name's ending turns escaping on: labels come from outside the program.
    environment.add_template("page.html", PAGE)?;
    let template = environment.get_template("page.html")?;
    let ladders: Vec<&str> = report.ladders.iter().map(|ladder| ladder.name.as_str()).collect();
    let configurations: Vec<Value> =
        report.configurations.iter().enumerate().map(|(i, c)| configuration(report, i, c, shown.get(i))).collect();
    let figures: Vec<Value> = FIGURES.iter().map(|(name, ..)| json!({ "name": name })).collect();
    let charts: Vec<Value> =
        CHARTS.iter().map(|[title, x, y, front]| json!({ "title": title, "x": x, "y": y, "front": front })).collect();
    let axes: serde_json::Map<String, Value> =
        AXES.iter().map(|(key, name, _)| ((*key).to_owned(), json!(name))).collect();
    let data = json!({
        "ladders": ladders, "figures": figures, "charts": charts, "axes": axes, "configurations": configurations,
        "reference": reference,
    });
    // In HTML nothing ends a script but its tag.
    let text = data.to_string().replace('<', "\\u003c");
    let page = json!({
        "title": format!("Sweep: error against cost, camera {}", report.camera),
        "note": format!(
            "{}×{} pixels, {}, reference of {} samples per pixel. Error: {}.",
            report.width,
            report.height,
            format::counted(report.seeds.len() as u64, "seed", "seeds"),
            format::or_undefined(report.reference.spp, |spp| spp.to_string()),
            report.error_figure,
        ),
        "ladders": ladders, "figures": figures, "configurations": configurations,
    });
    let with_nonce = |nonce: &str| {
        template
            .render(context! { page => Serde(&page), data => &text, style => STYLE, script => SCRIPT, nonce => nonce })
    };
    // What is to pass for a script of ours would have to hold the hash of a page that holds it.
    let nonce = blake3::hash(with_nonce(NO_NONCE)?.as_bytes()).to_hex();
    with_nonce(&nonce[..32])
}

fn configuration(report: &SweepReport, index: usize, c: &ConfigurationReport, shown: Option<&Shown>) -> Value {
    let typical = |key: &str| c.figures.get(key).and_then(Aggregate::typical);
    let texts: Vec<String> = FIGURES.iter().map(|(_, key, write)| format::or_undefined(typical(key), write)).collect();
    let values: serde_json::Map<String, Value> = AXES
        .iter()
        .map(|(key, _, factor)| ((*key).to_owned(), json!(typical(key).map(|value| value * factor))))
        .collect();
    let short: Vec<&str> = c.axes.iter().map(|axis| axis.value.as_str()).collect();
    let ladder = report.ladders.get(c.ladder);
    let is_on = |of: fn(&PerFront<Vec<usize>>) -> &Vec<usize>| ladder.is_some_and(|l| of(&l.fronts).contains(&index));
    json!({
        "label": c.label,
        "short": if short.is_empty() { c.label.clone() } else { short.join(" ") },
        "ladder": c.ladder,
        "texts": texts,
        "values": values,
        "fronts": {
            "bake_s": is_on(|f| &f.bake_s),
            "bytes": is_on(|f| &f.bytes),
            "shade_ms": is_on(|f| &f.shade_ms),
            "leak_light": is_on(|f| &f.leak_light),
        },
        "config": c.config,
        "picture": shown.map_or("", |shown| shown.picture.as_str()),
        "difference": shown.map_or("", |shown| shown.difference.as_str()),
    })
}
