//! The files of a sweep: report, table of numbers, plots.

use std::path::Path;

use anyhow::{Context, Result};

use crate::commands::write_json;
use crate::report::plot::{Chart, Guide, Mark, Series};
use crate::report::sweep::{ConfigurationReport, LadderReport, PerFront, SweepReport};
use crate::system::format;
use crate::system::output::write_atomically;

/// All that a sweep's folder gets besides its runs.
pub const FILES: &[&str] = &[
    super::reference::FILE,
    super::reference::GLTF_FILE,
    super::sheet::FILE,
    super::page::FILE,
    "sweep.json",
    "sweep.csv",
    "error_time.svg",
    "error_time.png",
    "error_bytes.svg",
    "error_bytes.png",
    "error_shading.svg",
    "error_shading.png",
    "leak_bytes.svg",
    "leak_bytes.png",
];

pub fn write(report: &SweepReport, folder: &Path) -> Result<()> {
    write_json(&folder.join("sweep.json"), report)?;
    let table = csv(report).context("cannot write the table of numbers")?;
    write_atomically(&folder.join("sweep.csv"), |file| std::io::Write::write_all(file, &table))?;
    for (name, chart) in charts(report) {
        chart.write(&folder.join(name))?;
    }
    Ok(())
}

/// One line for every run and method.
fn csv(report: &SweepReport) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut has_head = false;
    for configuration in &report.configurations {
        let ladder = &report.ladders[configuration.ladder];
        for (run, m) in configuration.runs.iter().flat_map(|run| run.methods.iter().map(move |method| (run, method))) {
            let (t, rays, e) = (&run.time_s, &run.rays, &m.error);
            let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
            let cells = [
                ("ladder", ladder.name.clone()),
                ("method", ladder.method.clone()),
                ("label", configuration.label.clone()),
                ("seed", run.seed.to_string()),
                ("offset", run.offset.map_or_else(String::new, |shift| shift.map(|x| format!("{x:.6}")).join(" "))),
                ("probes", run.probes.to_string()),
                ("probes_active", run.probes_active.to_string()),
                ("bytes", run.bytes.to_string()),
                ("file_bytes", run.file_bytes.to_string()),
                ("bake_s", run.bake_s.to_string()),
                ("survey_s", t.survey.to_string()),
                ("capture_s", t.capture.to_string()),
                ("bounces_s", t.bounces.to_string()),
                ("filter_s", t.filter.to_string()),
                ("encode_s", t.encode.to_string()),
                ("rays_primary", rays.primary.to_string()),
                ("rays_shadow", rays.shadow.to_string()),
                ("rays_survey", rays.survey.to_string()),
                ("bounces", run.bounces.to_string()),
                ("converged", run.converged.to_string()),
                ("visibility", m.name.clone()),
                ("shade_ms", m.shade_ms.to_string()),
                ("lookup_ns", number(m.lookup_ns)),
                ("leak_light", number(m.leak.light)),
                ("leak_dark", number(m.leak.dark)),
                ("leak_fraction", number(m.leak.fraction)),
                ("leak_unseen", m.leak.unseen.to_string()),
                ("leak_blocks", number(m.leak.blocks)),
                ("leak_dark_region", number(m.leak.dark_region)),
                ("outside_hull", number(m.outside_hull)),
                ("air_error", number(m.air.error)),
                ("air_leak_light", number(m.air.leak_light)),
                ("air_leak_dark", number(m.air.leak_dark)),
                ("air_black", number(m.air.black)),
                ("error_relative", number(m.error_relative)),
                ("error_corner", number(m.error_corner)),
                ("error_flat", number(m.error_flat)),
                ("error_bent", number(m.bent.error)),
                ("error_rmse", number(e.rmse)),
                ("error_nrmse", number(e.nrmse)),
                ("error_relmse", number(e.relmse)),
                ("error_mae", number(e.mae)),
                ("error_bias", number(e.bias)),
                ("error_flip", number(e.flip)),
                ("error_gltf", number(m.glossy.and_then(|glossy| glossy.error_gltf))),
                ("relmse_gltf", number(m.glossy.and_then(|glossy| glossy.relmse_gltf))),
                ("glossy_shade_ms", number(m.glossy.map(|glossy| glossy.shade_ms))),
                ("glossy_bytes_per_probe", number(m.glossy.map(|glossy| glossy.bytes_per_probe))),
            ];
            if !std::mem::replace(&mut has_head, true) {
                writer.write_record(cells.each_ref().map(|(name, _)| *name))?;
            }
            writer.write_record(cells.map(|(_, value)| value))?;
        }
    }
    Ok(writer.into_inner()?)
}

/// Which figure of a configuration stands along an axis.
struct Along {
    figure: &'static str,
    label: &'static str,
    factor: f64,
}

const BAKE: Along = Along { figure: "bake_s", label: "bake time (s)", factor: 1.0 };
const BYTES: Along = Along { figure: "bytes", label: "memory at run time (KiB)", factor: 1.0 / 1024.0 };
const SHADING: Along = Along { figure: "shade_ms", label: "shading of the picture, all threads (ms)", factor: 1.0 };
const ERROR: Along =
    Along { figure: "error_relative", label: "rmse of indirect irradiance ÷ mean (%)", factor: 100.0 };
const LEAK: Along = Along { figure: "leak_light", label: "leaked light ÷ light (%)", factor: 100.0 };

fn charts(report: &SweepReport) -> [(&'static str, Chart); 4] {
    let chart = |title: &str, x: Along, y: Along, front: fn(&PerFront<Vec<usize>>) -> &Vec<usize>| {
        let series =
            report.ladders.iter().map(|ladder| series(report, ladder, &x, &y, front(&ladder.fronts))).collect();
        let seeds = match (report.seeds.len(), report.offsets.len()) {
            (1, 0) => "one seed".to_owned(),
            (n, 0) => format!("mean of {n} seeds, bars from least to most"),
            (_, 1) => "one offset of the grid".to_owned(),
            (_, n) => format!("geometric mean of {n} offsets of the grid, bars from least to most"),
        };
        Chart {
            title: title.to_owned(),
            note: format!(
                "camera {}, {}×{}, reference {} samples per pixel; {seeds}; filled: on the front of its ladder",
                report.camera,
                report.width,
                report.height,
                report.reference.spp.unwrap_or(0)
            ),
            x_label: x.label.to_owned(),
            y_label: y.label.to_owned(),
            series,
            guides: Vec::new(),
        }
    };
    let mut time = chart("Error against bake time", BAKE, ERROR, |f| &f.bake_s);
    time.guides = report
        .ladders
        .iter()
        .enumerate()
        .filter_map(|(i, ladder)| noise_guide(&ruled_by_noise(report, ladder), &ladder.name, i))
        .collect();
    let mut all = [
        ("error_time", time),
        ("error_bytes", chart("Error against memory", BYTES, ERROR, |f| &f.bytes)),
        ("error_shading", chart("Error against shading time", SHADING, ERROR, |f| &f.shade_ms)),
        ("leak_bytes", chart("Leaked light against memory", BYTES, LEAK, |f| &f.leak_light)),
    ];
    for (_, chart) in &mut all[..3] {
        let floors = floors(report, chart);
        chart.guides.extend(floors);
    }
    all
}

fn figure(configuration: &ConfigurationReport, along: &Along) -> Option<[f64; 3]> {
    let all = configuration.figures.get(along.figure)?;
    Some([all.typical()?, all.min?, all.max?].map(|v| v * along.factor))
}

fn series(report: &SweepReport, ladder: &LadderReport, x: &Along, y: &Along, front: &[usize]) -> Series {
    let mark = |&i: &usize| {
        let configuration = report.configurations.get(i)?;
        let ([x, x_min, x_max], [y, y_min, y_max]) = (figure(configuration, x)?, figure(configuration, y)?);
        Some(Mark { x, y, x_bar: [x_min, x_max], y_bar: [y_min, y_max], on_front: front.contains(&i) })
    };
    Series { name: ladder.name.clone(), marks: ladder.configurations.iter().filter_map(mark).collect() }
}

/// Bake time and error of a ladder's configurations that noise rules.
fn ruled_by_noise(report: &SweepReport, ladder: &LadderReport) -> Vec<(f64, f64)> {
    let of_ladder = ladder.configurations.iter().filter_map(|&i| report.configurations.get(i));
    let ruled = of_ladder.filter(|c| c.ruled_by == Some("noise"));
    ruled
        .filter_map(|c| Some((figure(c, &BAKE)?[0], figure(c, &ERROR)?[0])))
        .filter(|p| p.0 > 0.0 && p.1 > 0.0)
        .collect()
}

/// The slope of noise, error ∝ 1/√time, through the middle of these points.
fn noise_guide(points: &[(f64, f64)], ladder: &str, series: usize) -> Option<Guide> {
    /// How far it reaches beyond them, as a factor.
    const REACH: f64 = 1.5;
    if points.is_empty() {
        return None;
    }
    // Mean of log(error·√time).
    let offset = points.iter().map(|p| p.1.ln() + 0.5 * p.0.ln()).sum::<f64>() / points.len() as f64;
    let low = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min) / REACH;
    let high = points.iter().map(|p| p.0).fold(0.0, f64::max) * REACH;
    let at = |time: f64| (time, (offset - 0.5 * time.ln()).exp());
    let name = format!("noise of {ladder}: 1/√time");
    Some(Guide { name, series, ends: [at(low), at(high)], dotted: true })
}

/// Horizontal lines at what bias leaves.
fn floors(report: &SweepReport, chart: &Chart) -> Vec<Guide> {
    let floor = |(i, ladder): (usize, &LadderReport)| {
        let level = ladder.floor_relative.filter(|level| *level > 0.0)?;
        let xs = || chart.series[i].marks.iter().map(|m| m.x).filter(|x| *x > 0.0);
        let (low, high) = (xs().fold(f64::INFINITY, f64::min), xs().fold(0.0, f64::max));
        let y = level * ERROR.factor;
        let name = format!("bias of {}: {}", ladder.name, format::percent(level));
        (low < high).then_some(Guide { name, series: i, ends: [(low, y), (high, y)], dotted: false })
    };
    report.ladders.iter().enumerate().filter_map(floor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on 3/√time lie on their guide, which reaches beyond them.
    #[test]
    fn the_guide_of_noise_goes_through_it() {
        let law = |time: f64| 3.0 / time.sqrt();
        let guide = noise_guide(&[1.0, 4.0, 16.0].map(|t| (t, law(t))), "a", 2).unwrap();
        for (time, error) in guide.ends {
            assert!((error / law(time) - 1.0).abs() < 1e-12);
        }
        assert!(guide.ends[0].0 < 1.0 && guide.ends[1].0 > 16.0 && guide.dotted && guide.series == 2);
        assert_eq!(noise_guide(&[], "a", 0), None);
    }
}
