//! A sweep's report for people.

use crate::report::sweep::{
    Aggregate, AxisValue, CheapestAt, ConfigurationReport, EqualReport, FloorCause, FloorReport, SweepReport,
};
use crate::report::table::{Column, Table};
use crate::system::format;

/// Shares of an error that are smaller are of no account, whatever their sign.
const HIDES: f64 = 0.01;

/// All tables.
pub fn text(report: &SweepReport) -> String {
    let mut parts = vec![
        format!(
            "camera {}, {}×{}, {}{}, reference of {} samples per pixel; error: {}",
            report.camera,
            report.width,
            report.height,
            format::counted(report.seeds.len() as u64, "seed", "seeds"),
            match report.offsets.len() {
                0 => String::new(),
                n => format!(", geometric means over {} of the grid", format::counted(n as u64, "offset", "offsets")),
            },
            format::or_undefined(report.reference.spp, |spp| spp.to_string()),
            report.error_figure,
        ),
        if is_comparison(report) { comparison(report) } else { configurations(report) },
    ];
    if !is_comparison(report) && !report.cheapest.bake_s.is_empty() {
        parts.push("the cheapest configuration for each error level".to_owned());
        parts.push(cheapest(report));
    }
    if !report.floor.is_empty() {
        parts.push("what limits the best of each ladder: its error with one cause at a time switched off".to_owned());
        parts.push(floors(&report.floor));
    }
    parts.extend(report.equal.as_ref().map(equal));
    parts.join("\n")
}

fn percent(value: Option<f64>) -> String {
    format::or_undefined(value, format::percent)
}

/// The share of the squared error that goes with a cause. Below zero the error grows without it: it hid another.
fn share_of(cause: &FloorCause) -> String {
    match cause.share {
        Some(share) if share < -HIDES => "hides another".to_owned(),
        Some(share) if share < 0.0 => format::percent(0.0),
        share => percent(share),
    }
}

/// Whether every ladder is one point: methods side by side.
fn is_comparison(report: &SweepReport) -> bool {
    report.ladders.iter().all(|ladder| ladder.configurations.len() == 1)
}

fn typical(configuration: &ConfigurationReport, figure: &str) -> Option<f64> {
    configuration.figures.get(figure).and_then(Aggregate::typical)
}

/// A row for each method.
fn comparison(report: &SweepReport) -> String {
    let has_gloss = report.configurations.iter().any(|c| typical(c, "glossy_shade_ms").is_some());
    let gloss = ["error_gltf", "relmse_gltf", "gloss shade", "gloss per probe"].map(|name| (name, Column::Number));
    let columns = [
        ("method", Column::Text),
        ("probes", Column::Number),
        ("error", Column::Number),
        ("in corners", Column::Number),
        ("elsewhere", Column::Number),
        ("bent normals", Column::Number),
        ("leak light", Column::Number),
        ("leak dark", Column::Number),
        ("blocks", Column::Number),
        ("dark region", Column::Number),
        ("error in air", Column::Number),
        ("black in air", Column::Number),
        ("bake", Column::Number),
        ("shade", Column::Number),
        ("memory per probe", Column::Number),
    ];
    let shown = if has_gloss { &gloss[..] } else { &[] };
    let mut table = Table::new(&[&columns[..], shown].concat());
    for c in &report.configurations {
        let typical = |figure: &str| typical(c, figure);
        let share = |figure: &str| percent(typical(figure));
        let mut cells = vec![
            c.label.clone(),
            c.probes.to_string(),
            error(c),
            share("error_corner"),
            share("error_flat"),
            share("error_bent"),
            share("leak_light"),
            share("leak_dark"),
            share("leak_blocks"),
            share("leak_dark_region"),
            share("air_error"),
            share("air_black"),
            format::or_undefined(typical("bake_s"), format::seconds),
            format::or_undefined(typical("shade_ms"), |ms| format::seconds(ms / 1e3)),
            format::or_undefined(typical("bytes_per_probe"), |b| format::bytes(b.round() as u64)),
        ];
        if has_gloss {
            cells.push(share("error_gltf"));
            cells.push(format::or_undefined(typical("relmse_gltf"), |relmse| format::significant(relmse, 3)));
            cells.push(format::or_undefined(typical("glossy_shade_ms"), |ms| format::seconds(ms / 1e3)));
            cells.push(format::or_undefined(typical("glossy_bytes_per_probe"), |b| format::bytes(b.round() as u64)));
        }
        table.push(cells);
    }
    table.to_string()
}

fn configurations(report: &SweepReport) -> String {
    let mut table = Table::new(&[
        ("configuration", Column::Text),
        ("probes", Column::Number),
        ("memory", Column::Number),
        ("bake", Column::Number),
        ("shade", Column::Number),
        ("error", Column::Number),
        ("noise", Column::Number),
        ("bias", Column::Number),
        ("leak light", Column::Number),
        ("on the front of", Column::Text),
    ]);
    for c in &report.configurations {
        let mean = |figure: &str| c.figures.get(figure).and_then(Aggregate::typical);
        table.push([
            c.label.clone(),
            c.probes.to_string(),
            format::or_undefined(mean("bytes"), |b| format::bytes(b.round() as u64)),
            format::or_undefined(mean("bake_s"), format::seconds),
            format::or_undefined(mean("shade_ms"), |ms| format::seconds(ms / 1e3)),
            error(c),
            percent(c.noise_relative),
            percent(c.bias_relative),
            percent(mean("leak_light")),
            fronts(c),
        ]);
    }
    table.to_string()
}

/// With half of what lies between the least and the most of the runs.
fn error(configuration: &ConfigurationReport) -> String {
    let Some(error) = configuration.figures.get("error_relative") else { return format::UNDEFINED.to_owned() };
    let spread = error.max.zip(error.min).map(|(max, min)| 50.0 * (max - min));
    format::or_undefined(error.typical(), |mean| format!("{} %", format::with_error(100.0 * mean, spread)))
}

fn fronts(configuration: &ConfigurationReport) -> String {
    let on = configuration.on_front;
    let names = [(on.bake_s, "time"), (on.bytes, "bytes"), (on.shade_ms, "shading"), (on.leak_light, "leak")];
    names.into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect::<Vec<_>>().join(", ")
}

fn cheapest(report: &SweepReport) -> String {
    let mut table = Table::new(&[
        ("error at most", Column::Number),
        ("by bake time", Column::Text),
        ("", Column::Number),
        ("by memory", Column::Text),
        ("", Column::Number),
    ]);
    let at = |list: &[CheapestAt], level: f64, cost: fn(f64) -> String| {
        let found = list.iter().find(|c| c.error_relative == level);
        found.map_or_else(|| [String::new(), String::new()], |c| [c.label.clone(), cost(c.cost)])
    };
    for entry in &report.cheapest.bake_s {
        let level = entry.error_relative;
        let [time_label, time] = at(&report.cheapest.bake_s, level, format::seconds);
        let [bytes_label, bytes] = at(&report.cheapest.bytes, level, |b| format::bytes(b.round() as u64));
        table.push([format::percent(level), time_label, time, bytes_label, bytes]);
    }
    table.to_string()
}

fn floors(floors: &[FloorReport]) -> String {
    let mut table = Table::new(&[
        ("configuration", Column::Text),
        ("without the error of", Column::Text),
        ("error", Column::Number),
        ("share", Column::Number),
        ("how", Column::Text),
    ]);
    for floor in floors {
        table.push([
            floor.label.clone(),
            "nothing".to_owned(),
            percent(floor.error_relative),
            String::new(),
            format!("as it is, seed {}", floor.seed),
        ]);
        for cause in &floor.causes {
            table.push([
                String::new(),
                cause.cause.replace('_', " "),
                percent(cause.error_relative),
                share_of(cause),
                cause.how.clone(),
            ]);
        }
    }
    table.to_string()
}

fn equal(equal: &EqualReport) -> String {
    match equal {
        EqualReport::Positions { sets } => {
            let mut table = Table::new(&[
                ("at equal positions", Column::Text),
                ("method", Column::Text),
                ("same probes", Column::Text),
                ("error", Column::Number),
                ("leak light", Column::Number),
                ("memory", Column::Number),
                ("bake", Column::Number),
            ]);
            for set in sets {
                for (row, entry) in set.entries.iter().enumerate() {
                    table.push([
                        if row == 0 { axes(&set.axes) } else { String::new() },
                        entry.method.clone(),
                        if entry.same_probes { "yes" } else { "no" }.to_owned(),
                        percent(entry.error_relative),
                        percent(entry.leak_light),
                        format::or_undefined(entry.bytes, |b| format::bytes(b.round() as u64)),
                        format::or_undefined(entry.bake_s, format::seconds),
                    ]);
                }
            }
            table.to_string()
        }
        EqualReport::Bytes { budgets } => {
            let mut columns = vec![("at equal bytes", Column::Number)];
            let methods = budgets.first().map_or(&[][..], |budget| &budget.entries);
            columns.extend(methods.iter().map(|entry| (entry.method.as_str(), Column::Number)));
            let mut table = Table::new(&columns);
            for budget in budgets {
                let cell =
                    |error: Option<f64>, fits: bool| if fits { percent(error) } else { "does not fit".to_owned() };
                let cells = budget.entries.iter().map(|entry| cell(entry.error_relative, entry.fits));
                table.push([format::bytes(budget.bytes as u64)].into_iter().chain(cells));
            }
            table.to_string()
        }
    }
}

fn axes(axes: &[AxisValue]) -> String {
    let parts: Vec<String> = axes.iter().map(|axis| format!("{}={}", axis.key, axis.value)).collect();
    if parts.is_empty() { "as configured".to_owned() } else { parts.join(" ") }
}
