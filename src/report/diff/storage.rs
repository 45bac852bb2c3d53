//! How two probe files store light, and what tells which of it arrives.

use super::gate::{Direction, Finding};
use crate::probe::file::ProbeFile;
use crate::probe::store::irradiance::Fineness;

/// Less is worse.
fn loss(name: &'static str, item: &str, values: [Option<f64>; 2], explanation: &str) -> Finding {
    let found = Finding::difference(name, item, values, "", Direction::Increase, explanation);
    Finding { value: found.value.map(|v| -v), ..found }
}

/// Findings about how irradiance is stored: how finely, and with which border.
pub fn storage(item: &str, sides: [(Fineness, usize); 2]) -> Vec<Finding> {
    let borders = sides.map(|(_, border)| Some(border as f64));
    let resolutions = sides.map(|(fineness, _)| Some(fineness.resolution as f64));
    vec![
        Finding::ratio(
            "probes.precision",
            item,
            sides.map(|(fineness, _)| Some(fineness.rounding)),
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
    let tests = volumes.map(|v| Some(f64::from(v.occlusion.rank())));
    let bytes = files.map(|f| Some(f.file_bytes as f64 / f.volume_in_grid().states.len() as f64));
    let bits = volumes.map(|v| v.occlusion.mean_visible());
    let stored = files.map(|f| (f.volume_in_grid().irradiance.fineness(), f.border));
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
