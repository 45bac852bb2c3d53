//! Two reports of `render`.

use serde_json::Value;

use super::figures::{Compared, How, Rule, apply_all, number, rule, scenes, side_by_side, storage};
use super::gate::Finding;
use super::images::{Unevenness, join};
use super::noise::Noise;
use super::ratio::OF_UNEVENNESS;

/// The method that decides: the others are there to compare it with.
const JUDGED_METHOD: &str = "visibility_on";

/// Standard error of a leak's change between seeds, over the unevenness of the picture's light: the largest change was 0.25 of it, and
/// three standard errors are 0.3. A leak makes light uneven too, so that there is a most: three are 6 % of the light, where the largest
/// change between seeds was 4 %.
const LEAK: f64 = 0.1;
const MOST_LEAK: f64 = 0.02;

/// Of each method.
pub(super) const METHOD_RULES: &[Rule] = &[
    rule("leak.light", "leak.light", How::Increase, "", "Light that came through walls, as a share of all."),
    rule(
        "leak.dark",
        "leak.dark",
        How::Increase,
        "",
        "Light that the visibility test took away by mistake, as a share of all.",
    ),
    rule(
        "leak.fraction",
        "leak.fraction",
        How::Increase,
        "",
        "Share of the irradiance that came from probes not visible.",
    ),
    rule(
        "leak.dark_region",
        "leak.dark_region",
        How::Increase,
        "",
        "Light where the reference has none, as a share of its mean.",
    ),
    rule("leak.unseen", "leak.unseen", How::Increase, "", "Share of points that see none of their probes."),
    rule(
        "leak.baked",
        "leak.baked",
        How::Increase,
        "",
        "Light that leaked into the probes themselves, as a share of all.",
    ),
    rule("bytes_per_probe", "memory.bytes_per_probe", How::Growth, "%", "Bytes per probe at run time."),
    rule("shade_ms.median", "time.shade", How::Growth, "%", "Time of queries and shading."),
    rule("lookup_ns", "time.lookup", How::Growth, "%", "Time of one query on one thread."),
];

/// Of each method, where there is a reference.
pub(super) const ERROR_RULES: &[Rule] = &[
    rule("mae", "error.mae", How::Increase, "W/m²", "Mean absolute difference from the reference."),
    rule("rmse", "error.rmse", How::Increase, "W/m²", "Root mean square difference from the reference."),
    rule("relmse", "error.relmse", How::Increase, "", "Mean relative squared difference from the reference."),
    rule("bias", "error.bias", How::Magnitude, "W/m²", "Mean difference from the reference, by size."),
    rule("psnr_db", "error.psnr", How::Decrease, "dB", "Peak signal-to-noise ratio: less is worse."),
    rule("flip", "error.flip", How::Increase, "", "FLIP against the reference."),
];

/// Two reports of `render`. `unevenness`: of the pictures, where these differ by their noise at least.
pub fn renders(item: &str, base: &Value, candidate: &Value, unevenness: Option<Unevenness>) -> Compared {
    let mut findings: Vec<Finding> = scenes(item, base, candidate).into_iter().collect();
    let method = |report: &Value| {
        let methods = report["methods"].as_array()?;
        methods.iter().find(|m| m["name"].as_str() == Some(JUDGED_METHOD)).cloned()
    };
    let methods = [base, candidate].map(|r| method(r).unwrap_or_default());
    let [b, c] = &methods;
    let name = join(item, JUDGED_METHOD);
    findings.extend(apply_all(METHOD_RULES, &name, [b, c]).into_iter().map(|found| spread(found, [b, c])));
    for (key, suffix) in [("error", ""), ("error_gltf", "/gltf")] {
        findings.extend(apply_all(ERROR_RULES, &format!("{name}{suffix}"), [&b[key], &c[key]]));
    }
    if let Some(unevenness) = unevenness {
        findings = findings.into_iter().map(|found| with_noise(found, unevenness)).collect();
    }
    let peak = rule("peak_memory_bytes", "memory.peak", How::Increase, "B", "Largest memory of the render.");
    findings.extend(apply_all(&[peak], item, [base, candidate]));
    findings.extend(storage(item, [base, candidate]));
    Compared { figures: side_by_side(item, base, candidate), findings }
}

/// Adds what the probes' noise does to a figure of all of a picture.
fn with_noise(found: Finding, unevenness: Unevenness) -> Finding {
    let noise = match found.name {
        "leak.light" | "leak.dark" | "leak.fraction" | "leak.dark_region" | "leak.baked" => {
            (LEAK * unevenness.share).min(MOST_LEAK)
        }
        // It changes as the mean does.
        "error.bias" => Noise::Other.at_most(100.0 * OF_UNEVENNESS * unevenness.share) / 100.0 * unevenness.mean,
        _ => return found,
    };
    let error = found.standard_error.unwrap_or(0.0).hypot(noise);
    found.with_error(Some(error))
}

/// Says how far repeated runs of a time lie apart.
fn spread(found: Finding, methods: [&Value; 2]) -> Finding {
    if found.name != "time.shade" {
        return found;
    }
    let range = |v: &Value| {
        let number = |key| number(v, &format!("shade_ms.{key}"));
        Some(format!("{:.3} to {:.3} ms", number("min")?, number("max")?))
    };
    let [Some(base), Some(candidate)] = methods.map(range) else { return found };
    let explanation = format!("{} Repeated runs: base {base}, candidate {candidate}.", found.explanation);
    Finding { explanation, ..found }
}
