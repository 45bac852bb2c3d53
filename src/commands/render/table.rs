//! A render's report for people.

use crate::evaluate::PATH_RAY;
use crate::report::baked::BakedReport;
use crate::report::error::{ErrorEstimate, ErrorReport, TOO_NOISY};
use crate::report::render::{MethodReport, RenderReport, Timing};
use crate::report::table::{Column, Table};
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::format;

/// What the first column and the lines below call the methods.
const PROBES_BY_PATHS: &str = "path-traced probes";

/// One row of the table: its name, and what it says of a method.
type Row = (&'static str, fn(&MethodReport) -> String);

/// Figures of every run.
const ROWS: &[Row] = &[
    ("shade", |m| format::seconds(m.shade_ms.median / 1e3)),
    ("rays", |m| format::seconds(m.ray_ms / 1e3)),
    ("look-up", |m| format::or_undefined(m.lookup_ns, |ns| format::seconds(ns / 1e9))),
    ("look-up, of runs", |m| m.lookup_spread_ns.as_ref().map_or(format::UNDEFINED.to_owned(), spread)),
    ("memory per probe", |m| format::bytes(m.bytes_per_probe.round() as u64)),
    ("leak light", |m| percent(m.leak.light)),
    ("leak dark", |m| percent(m.leak.dark)),
    ("blocks", |m| percent(m.leak.blocks)),
    ("hidden share", |m| percent(m.leak.fraction)),
    ("outside the hull", |m| percent(m.outside_hull)),
    ("irradiance", |m| {
        format::or_undefined(m.irradiance_indirect_mean, |e| format!("{} W·m⁻²", format::significant(e, 4)))
    }),
    ("in the air: leak light", |m| percent(m.air.leak_light)),
    ("in the air: leak dark", |m| percent(m.air.leak_dark)),
    ("in the air: black", |m| percent(m.air.black)),
];

/// Figures that want a reference.
const OF_REFERENCE: &[Row] = &[
    ("error (nrmse)", |m| errors_of(m).map_or(format::UNDEFINED.to_owned(), |e| relative_rmse(&e.all))),
    ("error in corners", |m| errors_of(m).map_or(format::UNDEFINED.to_owned(), |e| relative_rmse(&e.by_region.corner))),
    ("error elsewhere", |m| errors_of(m).map_or(format::UNDEFINED.to_owned(), |e| relative_rmse(&e.by_region.flat))),
    ("falsely black", |m| percent(m.leak.black)),
    ("in the air: error", |m| with_error(m.air.error, m.air.standard_error.error)),
    ("bent normals: error", |m| with_error(m.bent.error, m.bent.standard_error.error)),
];

fn percent(share: Option<f64>) -> String {
    format::or_undefined(share, format::percent)
}

fn with_error(share: Option<f64>, standard_error: Option<f64>) -> String {
    let error = standard_error.map(|e| 100.0 * e);
    format::or_undefined(share, |share| format!("{} %", format::with_error(100.0 * share, error)))
}

/// From the least to the most of the runs, ns.
fn spread(timing: &Timing) -> String {
    format!("{} to {} ns", format::significant(timing.min, 3), format::significant(timing.max, 3))
}

/// One camera's table, a row for each figure, and in words where the errors lie.
pub fn table(report: &RenderReport) -> String {
    let labels: Vec<&str> = report.methods.iter().map(|method| column(report, method)).collect();
    let columns: Vec<(&str, Column)> =
        [("visibility", Column::Text)].into_iter().chain(labels.iter().map(|l| (*l, Column::Number))).collect();
    let mut table = Table::new(&columns);
    let of_reference = OF_REFERENCE.iter().filter(|_| report.reference.is_some());
    for (name, figure) in ROWS.iter().chain(of_reference) {
        table.push([(*name).to_owned()].into_iter().chain(report.methods.iter().map(figure)));
    }
    let unseen = report.methods.first().map_or(0.0, |m| m.leak.unseen);
    let mut text = format!(
        "camera {}, {}×{}, exposure {:+.2} EV, {} of the points see no probe\n{table}",
        report.camera,
        report.width,
        report.height,
        report.exposure_ev,
        format::percent(unseen),
    );
    let mean = report.reference.as_ref().and_then(|r| r.irradiance_indirect_mean);
    let points = report.methods.first().map(|m| {
        let (air, bent) = (m.air.points, m.bent.points);
        format!("in the air: at {air} points of free air; bent normals: at {bent} points of the picture")
    });
    let baked = report.baked.as_ref().filter(|b| b.figures.bias.is_some()).map(baked_line);
    let fitted = report.fitted.then(|| unfit_line(report));
    let reason = report.baked_reason.map(|reason| format!("no figure of the bake itself: {reason}"));
    let gloss: Vec<String> = report.methods.iter().filter_map(glossy_line).collect();
    let lines =
        points.into_iter().chain(fitted).chain(gloss).chain(error_lines(report, mean)).chain(baked).chain(reason);
    for line in lines {
        text.push('\n');
        text.push_str(&line);
    }
    text
}

/// Against whichever transport the reference has: a run has only one.
fn errors_of(method: &MethodReport) -> Option<&ErrorReport> {
    method.error.as_ref().or(method.error_gltf.as_ref())
}

/// What the table says of the visibility of fitted probes where it is not that of the fit.
const UNFIT: &str = "off (not fitted)";

fn unfit_line(report: &RenderReport) -> String {
    match report.export {
        None => format!(
            "{UNFIT}: fitted values are right with the visibility of their fit only; bake with --preset physical to see what \
             visibility does"
        ),
        Some(_) => {
            "fitted to the engine's look-up: exact visibility, and leaks against it, say nothing of it".to_owned()
        }
    }
}

/// A method's visibility as the head of its column.
fn column(report: &RenderReport, method: &MethodReport) -> &'static str {
    let is_unfit = report.fitted && method.name == VisibilityMode::Off.name();
    if is_unfit { UNFIT } else { label(method) }
}

/// A method in a sentence.
fn label(method: &MethodReport) -> &'static str {
    if method.name == PATH_RAY { PROBES_BY_PATHS } else { method.name.trim_start_matches("visibility_") }
}

/// Root mean square error ÷ mean irradiance of the reference, with the standard error that its noise gives it. Where the reference is
/// black, in W·m⁻².
fn relative_rmse(measured: &ErrorEstimate) -> String {
    let (figures, errors) = (&measured.figures, &measured.standard_error);
    match (figures.nrmse, figures.rmse) {
        (Some(nrmse), _) => format!("{} %", format::with_error(100.0 * nrmse, errors.nrmse.map(|e| 100.0 * e))),
        (None, Some(rmse)) => format!("{} W·m⁻²", format::with_error(rmse, errors.rmse)),
        (None, None) => format::UNDEFINED.to_owned(),
    }
}

/// What the error is relative to, how large the regions are, and what speaks against relying on it.
fn error_lines(report: &RenderReport, mean: Option<f64>) -> Vec<String> {
    let Some(reference) = &report.reference else { return Vec::new() };
    let errors: Vec<(&str, &ErrorReport)> =
        report.methods.iter().filter_map(|m| Some((label(m), errors_of(m)?))).collect();
    let Some((_, first)) = errors.first() else { return Vec::new() };
    let glossy = report.methods.iter().any(|m| m.error_gltf.is_some());
    let transport = if glossy { " (glossy, as probes are not)" } else { "" };
    let difference = format!("error: root mean square difference from the reference{transport}");
    let mut lines = vec![match mean.filter(|mean| *mean > 0.0) {
        Some(mean) => format!("{difference} ÷ its mean, {} W·m⁻²", format::significant(mean, 4)),
        None => format!("{difference}, which is black: no light reaches what this camera sees"),
    }];
    if let (Some(mean), Some(error)) = (mean.filter(|mean| *mean > 0.0), reference.standard_error_mean) {
        lines.push(format!("a pixel of the reference is known to {} on average", format::percent(error / mean)));
    }
    let share = first.by_region.corner.pixels as f64 / first.all.pixels.max(1) as f64;
    lines.push(format!("corners are {} of the picture's surfaces", format::percent(share)));
    lines.extend(verdicts(&errors));
    lines
}

/// What a method's gloss costs and how far it is off; `None` where it has none.
fn glossy_line(method: &MethodReport) -> Option<String> {
    let glossy = method.glossy.as_ref()?;
    // Mirrored lamps rule the one, all pixels alike the other.
    let both = |error: &ErrorReport| {
        let relmse = error.all.figures.relmse.map(|relmse| format!(", relmse {}", format::significant(relmse, 3)));
        format!("{}{}", relative_rmse(&error.all), relmse.unwrap_or_default())
    };
    let error = glossy.error_gltf.as_ref().map_or_else(String::new, |error| {
        let parts: Vec<String> = glossy
            .parts
            .iter()
            .map(|part| format!("{} {}", part.name.replace('_', " "), both(&part.error_gltf)))
            .collect();
        let parts = if parts.is_empty() { String::new() } else { format!(" ({})", parts.join("; ")) };
        format!(", error_gltf {}{parts}", both(error))
    });
    let traced = glossy.traced.map_or_else(String::new, |traced| {
        format!(
            ", {} probes and {} map reads a ray, {} of the rays lost",
            format::significant(traced.probes, 3),
            format::significant(traced.reads, 3),
            format::percent(traced.lost)
        )
    });
    Some(format!(
        "{} glossy: {} in {}, {} a probe{traced}{error}",
        label(method),
        glossy
            .radiance_mean
            .map_or(format::UNDEFINED.to_owned(), |l| format!("{} W·m⁻²·sr⁻¹", format::significant(l, 4))),
        format::seconds(glossy.shade_ms.median / 1e3),
        format::bytes(glossy.bytes_per_probe.round() as u64),
    ))
}

/// What is wrong with the probes themselves.
fn baked_line(baked: &BakedReport) -> String {
    let BakedReport { figures, standard_error, .. } = baked;
    let percent = |value: Option<f64>, error: Option<f64>| match value {
        Some(value) => format!("{} %", format::with_error(100.0 * value, error.map(|e| 100.0 * e))),
        None => format::UNDEFINED.to_owned(),
    };
    format!(
        "probes against path-traced ones: bias {}, excess {}, loss {} of their irradiance; the rest of the error is interpolation",
        percent(figures.bias, standard_error.bias),
        percent(figures.light, standard_error.light),
        percent(figures.dark, standard_error.dark),
    )
}
/// Each verdict once, with the methods and regions that it is about.
fn verdicts(errors: &[(&str, &ErrorReport)]) -> Vec<String> {
    let mut found: Vec<(&str, Vec<String>)> = Vec::new();
    for (visibility, error) in errors {
        let regions = [(" in corners", &error.by_region.corner), (" elsewhere", &error.by_region.flat)];
        // What holds of the whole picture need not be said of its parts.
        let of_parts = regions.into_iter().filter(|(_, part)| part.verdict != error.all.verdict);
        for (place, measured) in [("", &error.all)].into_iter().chain(of_parts) {
            let Some(verdict) = measured.verdict else { continue };
            let about = format!("{visibility}{place}");
            match found.iter_mut().find(|(known, _)| *known == verdict) {
                Some((_, list)) => list.push(about),
                None => found.push((verdict, vec![about])),
            }
        }
    }
    let remedy = |verdict: &str| {
        if verdict == TOO_NOISY { ": its noise exceeds the difference; give it more samples" } else { "" }
    };
    found.into_iter().map(|(verdict, about)| format!("{verdict} ({}){}", about.join(", "), remedy(verdict))).collect()
}
