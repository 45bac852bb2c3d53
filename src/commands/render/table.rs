//! A render's report for people.

use crate::evaluate::PATH_RAY;
use crate::report::baked::BakedReport;
use crate::report::error::{ErrorEstimate, ErrorReport};
use crate::report::render::{MethodReport, RenderReport};
use crate::report::table::{Column, Table};
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::format;

/// One camera's table, and in words where the errors lie.
pub fn table(report: &RenderReport) -> String {
    let mut table = Table::new(&[
        ("method", Column::Text),
        ("visibility", Column::Text),
        ("shade", Column::Number),
        ("rays", Column::Number),
        ("look-up", Column::Number),
        ("memory per probe", Column::Number),
        ("leak light", Column::Number),
        ("leak dark", Column::Number),
        ("blocks", Column::Number),
        ("hidden share", Column::Number),
        ("irradiance", Column::Number),
        ("error (nrmse)", Column::Number),
    ]);
    let percent = |share: Option<f64>| share.map_or(format::UNDEFINED.to_owned(), format::percent);
    let mean = report.reference.as_ref().and_then(|r| r.irradiance_indirect_mean);
    for method in &report.methods {
        let error = errors_of(method).map(|e| relative_rmse(&e.all));
        table.push([
            if method.name == PATH_RAY { "path-traced probes" } else { "probes" }.to_owned(),
            column(report, method),
            format::seconds(method.shade_ms.median / 1e3),
            format::seconds(method.ray_ms / 1e3),
            method.lookup_ns.map_or(format::UNDEFINED.to_owned(), |ns| format::seconds(ns / 1e9)),
            format::bytes(method.bytes_per_probe.round() as u64),
            percent(method.leak.light),
            percent(method.leak.dark),
            percent(method.leak.blocks),
            percent(method.leak.fraction),
            method.irradiance_indirect_mean.map_or(format::UNDEFINED.to_owned(), |e| format::significant(e, 4)),
            error.unwrap_or_else(|| format::UNDEFINED.to_owned()),
        ]);
    }
    let mut text = format!(
        "camera {}, {}×{}, exposure {:+.2} EV, {} of the points see no probe\n{table}",
        report.camera,
        report.width,
        report.height,
        report.exposure_ev,
        format::percent(report.methods.first().map_or(0.0, |m| m.leak.unseen)),
    );
    text.extend(report.methods.iter().map(|method| format!("\n{}", air_line(method))));
    text.extend(report.methods.iter().filter_map(glossy_line).map(|line| format!("\n{line}")));
    let baked = report.baked.as_ref().filter(|b| b.figures.bias.is_some()).map(baked_line);
    if report.fitted {
        text.push_str(&match report.export {
            None => format!(
                "
{UNFIT}: fitted values are right with the visibility that they were fitted with, so this row says nothing of \
                 the method; bake with --preset physical to see what visibility does"
            ),
            Some(_) => "
fitted to the engine's look-up: exact visibility, and leaks against it, say nothing of it"
                .to_owned(),
        });
    }
    let reason = report.baked_reason.map(|reason| format!("no figure of the bake itself: {reason}"));
    for line in error_lines(report, mean).into_iter().chain(baked).chain(reason) {
        text.push('\n');
        text.push_str(&line);
    }
    text
}

/// Against whichever transport the reference has: a run has only one.
fn errors_of(method: &MethodReport) -> Option<&ErrorReport> {
    method.error.as_ref().or(method.error_gltf.as_ref())
}

fn visibility(method: &MethodReport) -> &'static str {
    if method.name == PATH_RAY { "ray" } else { method.name.trim_start_matches("visibility_") }
}

/// What the table says of the visibility of fitted probes where it is not that of the fit.
const UNFIT: &str = "off (not what was fitted)";

/// A method's visibility in the table.
fn column(report: &RenderReport, method: &MethodReport) -> String {
    let is_unfit = report.fitted && method.name == VisibilityMode::Off.name();
    if is_unfit { UNFIT } else { visibility(method) }.to_owned()
}

/// A method in a sentence.
fn label(method: &MethodReport) -> &'static str {
    if method.name == PATH_RAY { "path-traced probes" } else { visibility(method) }
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

/// Picks one region's figures.
type Part = fn(&ErrorReport) -> &ErrorEstimate;

/// What the error is relative to, each region's errors, and what speaks against relying on them.
fn error_lines(report: &RenderReport, mean: Option<f64>) -> Vec<String> {
    let Some(reference) = &report.reference else { return Vec::new() };
    let errors: Vec<(&str, &ErrorReport)> =
        report.methods.iter().filter_map(|m| Some((label(m), errors_of(m)?))).collect();
    let Some((_, first)) = errors.first() else { return Vec::new() };
    let glossy = report.methods.iter().any(|m| m.error_gltf.is_some());
    let transport = if glossy { " (glossy, as probes are not)" } else { "" };
    let difference = format!("error: root mean square difference from the reference{transport}");
    let mut lines = vec![match mean.filter(|mean| *mean > 0.0) {
        Some(mean) => {
            let noise = reference.standard_error_mean.map_or_else(String::new, |error| {
                format!("; a pixel of it is known to {} on average", format::percent(error / mean))
            });
            format!("{difference} ÷ its mean, {} W·m⁻²{noise}", format::significant(mean, 4))
        }
        None => format!("{difference}, which is black"),
    }];
    let regions: [(&str, Part); 2] = [("in corners", |e| &e.by_region.corner), ("elsewhere", |e| &e.by_region.flat)];
    for (name, region) in regions {
        let pixels = region(first).pixels;
        if pixels == 0 {
            continue;
        }
        let share = format::percent(pixels as f64 / first.all.pixels.max(1) as f64);
        let figures: Vec<String> =
            errors.iter().map(|(visibility, e)| format!("{visibility} {}", relative_rmse(region(e)))).collect();
        lines.push(format!("  {name} ({share} of the picture's surfaces): {}", figures.join(", ")));
    }
    lines.extend(verdicts(&errors));
    lines
}

/// What moving objects get.
fn air_line(method: &MethodReport) -> String {
    let air = &method.air;
    let percent = |share: Option<f64>| share.map_or(format::UNDEFINED.to_owned(), format::percent);
    let error = air.error.map_or_else(String::new, |error| {
        format!("error {} %, ", format::with_error(100.0 * error, air.standard_error.error.map(|e| 100.0 * e)))
    });
    format!(
        "{} in the air ({} points): {error}leak light {}, leak dark {}, black {}",
        label(method),
        air.points,
        percent(air.leak_light),
        percent(air.leak_dark),
        percent(air.black)
    )
}

/// What a method's gloss costs and how far it is off; `None` where it has none.
fn glossy_line(method: &MethodReport) -> Option<String> {
    let glossy = method.glossy.as_ref()?;
    let error = glossy.error_gltf.as_ref().map_or_else(String::new, |error| {
        let parts: Vec<String> = glossy
            .parts
            .iter()
            .map(|part| format!("{} {}", part.name.replace('_', " "), relative_rmse(&part.error_gltf.all)))
            .collect();
        let parts = if parts.is_empty() { String::new() } else { format!(" ({})", parts.join(", ")) };
        format!(", error_gltf {}{parts}", relative_rmse(&error.all))
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
    found.into_iter().map(|(verdict, about)| format!("  {verdict} ({})", about.join(", "))).collect()
}
