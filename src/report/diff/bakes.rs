//! Two reports of `bake`.

use serde_json::Value;

use super::figures::{Compared, How, Rule, apply_all, number, rule, scenes, side_by_side, storage};
use super::gate::{Direction, Finding};

const RULES: &[Rule] = &[
    rule("bytes_per_probe.runtime_kept", "memory.bytes_per_probe", How::Growth, "%", "Bytes per probe at run time."),
    rule("bytes_per_probe.file", "memory.file_bytes", How::Growth, "%", "Bytes of the file per probe."),
    rule("peak_memory_bytes", "memory.peak", How::Increase, "B", "Largest memory of the bake."),
    rule("time_s.total", "time.bake", How::Growth, "%", "Time of the whole bake."),
    rule("numerics.non_finite", "numerics.non_finite", How::Increase, "", "Values that were not finite."),
    rule("numerics.clamped.irradiance", "numerics.clamped", How::Increase, "", "Values beyond what the format holds."),
    rule(
        "numerics.hits_outside_volume",
        "numerics.hits_outside",
        How::Increase,
        "",
        "Hits outside the hull of the probes.",
    ),
];

fn energy(item: &str, reports: [&Value; 2]) -> Finding {
    let energy = reports.map(|v| v["bounces"].as_array().and_then(|b| number(b.last()?, "energy")));
    Finding::ratio("irradiance.energy", item, energy, Direction::Both, "Energy in the probes after the last bounce.")
}

/// Two reports of `bake`.
pub fn bakes(item: &str, base: &Value, candidate: &Value) -> Compared {
    let mut findings = apply_all(RULES, item, [base, candidate]);
    findings.extend(scenes(item, base, candidate));
    let converged = [base, candidate].map(|v| v["converged"].as_bool().map(|yes| f64::from(u8::from(yes))));
    let explanation = "Whether the bounces settled (1) before there were too many (0).";
    let found = Finding::difference("convergence", item, converged, "", Direction::Increase, explanation);
    findings.push(Finding { value: found.value.map(|v| -v), ..found });
    findings.push(energy(item, [base, candidate]));
    findings.extend(storage(item, [base, candidate]));
    let active = [base, candidate].map(|v| number(v, "probes_active"));
    let explanation = "Probes that hold light.";
    findings.push(Finding::ratio("probes.active", item, active, Direction::Both, explanation));
    Compared { figures: side_by_side(item, base, candidate), findings }
}
