//! How two probe files store light, and what tells which of it arrives.

use super::gate::{Direction, Finding};
use crate::probe::file::ProbeFile;
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::surface::SurfaceVisibility;

/// Less is worse.
fn loss(name: &'static str, item: &str, values: [Option<f64>; 2], explanation: &str) -> Finding {
    let found = Finding::difference(name, item, values, "", Direction::Increase, explanation);
    Finding { value: found.value.map(|v| -v), ..found }
}

/// Findings about how irradiance is stored: format, border, texels along a side of the interior.
pub fn storage(item: &str, sides: [(ColorFormat, usize, usize); 2]) -> Vec<Finding> {
    let borders = sides.map(|(_, border, _)| Some(border as f64));
    let resolutions = sides.map(|(_, _, resolution)| Some(resolution as f64));
    vec![
        Finding::ratio(
            "probes.precision",
            item,
            sides.map(|(format, _, _)| Some(step(format))),
            Direction::Increase,
            "Largest relative rounding error of stored irradiance: 2⁻²⁴ of f32, 2⁻¹¹ of f16, 2⁻⁶ of the blue of R11G11B10F.",
        ),
        loss("probes.border", item, borders, "Border texels of the maps; without them octahedral maps show seams."),
        loss("probes.resolution", item, resolutions, "Texels along a side of the irradiance maps."),
    ]
}

/// Findings about how light is stored, and what tells which of it arrives.
pub fn structure(item: &str, base: &ProbeFile, candidate: &ProbeFile) -> Vec<Finding> {
    let files = [base, candidate];
    let volumes = files.map(ProbeFile::volume_in_grid);
    let tests = volumes.map(|v| {
        let rank = |is_there: bool, rank: f64| if is_there { rank } else { 0.0 };
        Some(rank(v.distance.is_some(), 1.0) + rank(v.surface_visibility.is_some(), 2.0))
    });
    let bytes = files.map(|f| Some(f.file_bytes as f64 / f.volume_in_grid().states.len() as f64));
    let bits = volumes.map(|v| v.surface_visibility.as_ref().map(mean_bits));
    let stored = files.map(|f| {
        let maps = &f.volume_in_grid().irradiance;
        (f.irradiance_format, maps.border, maps.resolution)
    });
    let mut findings = storage(item, stored);
    findings.extend([
        loss(
            "probes.visibility",
            item,
            tests,
            "What tells which probes a surface sees: 0 nothing, 1 distances, 2 surface visibility.",
        ),
        Finding::ratio("memory.file_bytes", item, bytes, Direction::Increase, "Bytes of the file per probe."),
    ]);
    if bits.iter().all(Option::is_some) {
        findings.push(Finding::ratio(
            "probes.visible",
            item,
            bits,
            Direction::Both,
            "Mean number of probes that a surface sees, of the eight around it.",
        ));
    }
    findings
}

fn mean_bits(surface: &SurfaceVisibility) -> f64 {
    let bits: u64 = surface.masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
    bits as f64 / surface.masks.len().max(1) as f64
}

/// Half a unit in the last place, relative: the worst channel's.
fn step(format: ColorFormat) -> f64 {
    match format {
        ColorFormat::F32 => 2.0_f64.powi(-24),
        ColorFormat::F16 => 2.0_f64.powi(-11),
        ColorFormat::R11G11B10F => 2.0_f64.powi(-6),
    }
}
