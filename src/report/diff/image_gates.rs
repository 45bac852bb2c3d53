//! What is judged of two pictures.

use std::path::Path;

use glam::Vec3;

use super::DiffError;
use super::gate::{Direction, Finding};
use super::images::{ImageReport, Pair, Sums};
use super::noise::Noise;
use super::ratio::{OF_UNEVENNESS, Part, change};
use crate::image::{LayeredImage, Picture};

/// Light below this share of the mean does not count as a pixel's own.
const DARK_SHARE: f64 = 0.05;

/// A pixel has changed when it has by more than this share of its own light.
const CHANGED_SHARE: f64 = 0.5;

/// What the probes that many pixels share do to the noise of a picture's mean, beyond what its blocks show. Enough where probes
/// stand close; where few light the picture, [`OF_UNEVENNESS`] is.
const SHARED_PROBES: f64 = 2.0;

/// By how much albedo may differ, and the components of a normal, and depth as a share of itself, before a pixel shows
/// another surface. Far above rounding, far below a percent of albedo.
const SAME_ALBEDO: f32 = 1.0e-3;
const SAME_NORMAL: f32 = 1.0e-2;
const SAME_DEPTH: f32 = 1.0e-3;

/// Layers that say which surface a pixel shows.
pub(super) const SURFACE: [&str; 3] = ["albedo", "normal", "depth"];

/// Of one layer of light.
pub(super) fn findings(
    item: &str,
    report: &ImageReport,
    sums: &Sums,
    blocks: &[Part],
    used: &[bool],
    [base, candidate]: [&Picture; 2],
    noise: Noise,
) -> Vec<Finding> {
    let whole = change(blocks).filter(|_| sums.pixels > 0);
    let means = [report.mean_base, report.mean_candidate];
    let mean = Finding {
        value: whole.map(|w| w.percent),
        ..Finding::ratio("image.mean", item, means, Direction::Both, "Mean luminance over all pixels.")
    };
    let base_mean = sums.base / (3.0 * sums.pixels as f64);
    let rmse = match report.rmse {
        Some(0.0) => Some(0.0),
        Some(rmse) if base_mean > 0.0 => Some(100.0 * rmse / base_mean),
        _ => None,
    };
    let floor = DARK_SHARE * base_mean.abs();
    let is_changed = |i: &usize| {
        let (b, c) = (base.pixels[*i].as_dvec3(), candidate.pixels[*i].as_dvec3());
        (c - b).abs().element_sum() > CHANGED_SHARE * (0.5 * (b.abs() + c.abs()).element_sum() + 3.0 * floor)
    };
    let changed = (0..used.len()).filter(|i| used[*i]).filter(is_changed).count();
    let share = (sums.pixels > 0).then(|| 100.0 * changed as f64 / sums.pixels as f64);
    let of_blocks = whole.and_then(|w| w.standard_error).map(|error| SHARED_PROBES * error);
    let of_unevenness = sums.unevenness.filter(|_| noise == Noise::Other).map(|share| 100.0 * OF_UNEVENNESS * share);
    let mean_error = of_blocks.into_iter().chain(of_unevenness).reduce(f64::max).map(|error| noise.at_most(error));
    let non_finite = [sums.non_finite[0] as f64, sums.non_finite[1] as f64].map(Some);
    let mut findings = vec![
        Finding::difference(
            "image.non_finite",
            item,
            non_finite,
            "",
            Direction::Increase,
            "Pixels that are NaN or infinite.",
        ),
        mean.with_error(mean_error),
        Finding::percentage(
            "image.rmse",
            item,
            rmse,
            "Root mean square difference of all channels, as a share of the base's mean.",
        ),
        Finding::percentage(
            "image.changed",
            item,
            share,
            "Share of pixels that changed by more than half of their own light.",
        ),
    ];
    if let Some(flip) = report.flip {
        let found = Finding::percentage("image.flip", item, Some(flip.mean), "Mean of FLIP: what an observer sees.");
        findings.push(Finding { unit: "", scale: 1.0, ..found });
        let found =
            Finding::percentage("image.flip_p99", item, Some(flip.p99), "FLIP that a hundredth of the pixels exceed.");
        findings.push(Finding { unit: "", scale: 1.0, ..found });
    }
    findings
}

/// Share of pixels that show another surface: no light and no noise in it.
pub(super) fn surfaces(pair: &Pair) -> Result<Finding, DiffError> {
    let read = |path: &Path| LayeredImage::read_exr_layers(path, |name| SURFACE.contains(&name));
    let (base, candidate) = rayon::join(|| read(&pair.base), || read(&pair.candidate));
    let (base, candidate) = (base?, candidate?);
    let mut differs = vec![false; base.width as usize * base.height as usize];
    for layer in SURFACE {
        let [Some(base), Some(candidate)] = [&base, &candidate].map(|image| image.layer(layer)) else { continue };
        let differ = |b: Vec3, c: Vec3| match layer {
            "albedo" => (b - c).abs().max_element() > SAME_ALBEDO,
            "normal" => (b - c).abs().max_element() > SAME_NORMAL,
            _ => (b.x - c.x).abs() > SAME_DEPTH * b.x.abs(),
        };
        let pixels = base.iter().zip(candidate);
        differs.iter_mut().zip(pixels).for_each(|(d, (b, c))| *d |= differ(*b, *c));
    }
    let counts = |i: &usize| pair.mask.is_none_or(|mask| mask.counts[*i]);
    let counted: Vec<usize> = (0..differs.len()).filter(counts).collect();
    let share = counted.iter().filter(|i| differs[**i]).count() as f64 / counted.len().max(1) as f64;
    Ok(Finding::percentage(
        "image.surface",
        &pair.item,
        Some(100.0 * share),
        "Share of pixels whose albedo, normal or depth differ: they show another surface.",
    ))
}
