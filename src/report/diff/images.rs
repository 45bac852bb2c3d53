//! Two pictures, pixel by pixel.
//!
//! `mae`, `rmse` and `psnr_db` are of the stored numbers as they stand, all channels pooled, peak 1: those of OpenImageIO's
//! `idiff`. FLIP is of what a screen shows: PNG as they are, light at the base's exposure.

use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use super::error::DiffError;
use super::figures::{Seeds, join};
use super::mask::Mask;
use crate::image::{AnyImage, ImageHeader, LayeredImage, Picture, Picture8};
use crate::math::color::{byte_from_unit, luminance};
use crate::report::error::flip::flip_map;
use crate::report::heatmap::{Heatmap, range_of};
use crate::report::page::MOST_PIXELS;
use crate::system::memory::{TooLittleMemory, available_bytes};

/// ε of `relmse`, as a share of the base's squared mean: as in the errors of `render`.
const RELATIVE_FLOOR: f64 = 1.0e-2;

/// Light below this share of the mean does not count as a pixel's own.
const DARK_SHARE: f64 = 0.05;

/// A pixel has changed when it has by more than this share of its own light.
const CHANGED_SHARE: f64 = 0.5;

/// Layers that are light, in the order of their reports.
pub const LIGHT: [&str; 2] = ["beauty", "irradiance_indirect"];

/// Layers that say which surface a pixel shows, and by how much they may differ: components of albedo and normal, depth as a share of
/// itself. Far above rounding, far below a percent of albedo.
const SURFACE: [(&str, f32); 3] = [("albedo", 1.0e-3), ("normal", 1.0e-2), ("depth", 1.0e-3)];

/// Memory at the peak, per pixel, FLIP's own pictures included: 105 B were measured on 7680 × 4320, rounded up.
const PIXEL_BYTES: f64 = 130.0;

/// Memory, per pixel that the page shows, while it packs a pair: two pictures, planes of both as they are and as differences, bytes
/// before and after deflation.
const PACKING_BYTES: f64 = 60.0;

/// What is kept of a pair until the files are written: its difference map per pixel, and per pixel that the page shows its text at
/// all resolutions, 1 B where light is smooth and up to 10 B where every channel has noise of its own.
const MAP_BYTES: f64 = 3.0;
const PACKED_BYTES: f64 = 10.0;

/// The comparison of two pictures, or of one layer of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageReport {
    pub item: String,
    pub layer: String,
    pub width: u32,
    pub height: u32,
    /// Whether its gates count; others are shown.
    pub judged: bool,
    /// Codes for a screen, and not light.
    pub is_display: bool,
    /// What the pixels are, and their unit; empty for codes of a screen.
    pub quantity: &'static str,
    pub unit: &'static str,
    /// Of the base, for both.
    pub exposure_ev: Option<f32>,
    #[serde(flatten)]
    pub figures: Value,
    pub path_base: String,
    pub path_candidate: String,
    /// Signed differences of luminance, as a picture in the report's folder.
    pub difference_map: Option<String>,
}

/// Two pictures to compare.
#[derive(Debug, Clone)]
pub struct Pair<'a> {
    pub item: String,
    pub base: PathBuf,
    pub candidate: PathBuf,
    /// Whether it decides.
    pub judged: bool,
    /// That of a report; else the base's own.
    pub exposure_ev: Option<f32>,
    pub seeds: Seeds,
    /// White counts.
    pub mask: Option<&'a Mask>,
}

/// One layer of two pictures: what was found, and what it was found in.
#[derive(Debug)]
pub struct Layer {
    pub report: ImageReport,
    pub base: Picture,
    pub candidate: Picture,
    /// Of every pixel, luminance of candidate − base; not a number where none is compared.
    pub difference: Vec<f32>,
}

/// Refuses pictures that cannot be compared, by their headers. `kept`: bytes that pairs before this one leave in memory; returned
/// with this one's added.
///
/// # Errors
/// Other sizes, kinds or layers, and too little memory.
pub fn check(pair: &Pair, kept: f64) -> Result<f64, DiffError> {
    let [base, candidate] = [ImageHeader::read(&pair.base)?, ImageHeader::read(&pair.candidate)?];
    let words = |header: &ImageHeader| {
        let kind = if header.is_display { "codes for a screen" } else { "light" };
        format!("{} × {} pixels of {kind} ({})", header.width, header.height, lights(&header.layers).join(", "))
    };
    let [of_base, of_candidate] = [words(&base), words(&candidate)];
    if of_base != of_candidate {
        let what = format!("one has {of_base}, the other {of_candidate}; make both of one size and kind");
        return Err(DiffError::incomparable([&pair.base, &pair.candidate], what));
    }
    if let Some(mask) = pair.mask.filter(|mask| (mask.width, mask.height) != (base.width, base.height)) {
        let what = format!("the mask has {} × {} pixels and the picture {of_base}", mask.width, mask.height);
        return Err(DiffError::file(&mask.path, format!("{what}; make them of one size")));
    }
    let layers = lights(&base.layers);
    let pixels = f64::from(base.width) * f64::from(base.height);
    let shown = pixels.min(MOST_PIXELS as f64);
    let kept = kept + layers.len() as f64 * (MAP_BYTES * pixels + PACKED_BYTES * shown);
    let needed = (kept + PIXEL_BYTES * pixels + PACKING_BYTES * shown) as u64;
    let (key, remedy) = (pair.base.display().to_string(), "compare smaller pictures");
    match available_bytes() {
        Some(available) if needed > available => {
            Err(TooLittleMemory { key, what: "comparing it", needed, available, remedy }.into())
        }
        _ => Ok(kept),
    }
}

/// Layers that are compared: those of light, or the first.
fn lights(layers: &[String]) -> Vec<&str> {
    let lights: Vec<&str> = LIGHT.into_iter().filter(|l| layers.iter().any(|n| n == l)).collect();
    if lights.is_empty() { layers.iter().take(1).map(String::as_str).collect() } else { lights }
}

/// Compares two files, layer by layer: one layer of both is in memory at a time, for `on_layer`.
///
/// # Errors
/// Files that cannot be read, and pictures without a pixel to compare.
pub fn compare(pair: &Pair, mut on_layer: impl FnMut(Layer) -> Result<(), DiffError>) -> Result<(), DiffError> {
    let layers = ImageHeader::read(&pair.base)?.layers;
    lights(&layers).into_iter().try_for_each(|layer| on_layer(compare_layer(pair, layer, layers.len() > 1)?))
}

/// One layer of one file.
fn read(path: &Path, layer: &str) -> Result<(Picture, bool), DiffError> {
    let AnyImage { image, is_display } = AnyImage::read(path, |name| name == layer)?;
    Ok((image.picture(layer).unwrap_or_else(|| Picture::new(image.width, image.height)), is_display))
}

fn compare_layer(pair: &Pair, layer: &str, is_named: bool) -> Result<Layer, DiffError> {
    let (base, candidate) = rayon::join(|| read(&pair.base, layer), || read(&pair.candidate, layer));
    let ((base, is_display), (candidate, _)) = (base?, candidate?);
    let all = || (0..base.pixels.len()).filter(|i| pair.mask.is_none_or(|mask| mask.counts[*i]));
    let non_finite = |picture: &Picture| all().filter(|i| !picture.pixels[*i].is_finite()).count();
    let [non_finite_base, non_finite_candidate] = [non_finite(&base), non_finite(&candidate)];
    let mut used = vec![false; base.pixels.len()];
    all().for_each(|i| used[i] = base.pixels[i].is_finite() && candidate.pixels[i].is_finite());
    let compared = || (0..used.len()).filter(|i| used[*i]).map(|i| (i, base.pixels[i], candidate.pixels[i]));
    let pixels = compared().count();
    if pixels == 0 && non_finite_candidate <= non_finite_base {
        let what = "no pixel is finite on both sides and counts; there is nothing to judge";
        return Err(DiffError::incomparable([&pair.base, &pair.candidate], what));
    }
    // Of every compared pixel.
    let mean = |of: &dyn Fn(Vec3, Vec3) -> f64| {
        (pixels > 0).then(|| compared().map(|(_, b, c)| of(b, c)).sum::<f64>() / pixels as f64)
    };
    let of_channels = |of: &dyn Fn(f64, f64) -> f64| {
        mean(&|b, c| (0..3).map(|k| of(f64::from(b[k]), f64::from(c[k]))).sum::<f64>() / 3.0)
    };
    let level = of_channels(&|b, _| b).unwrap_or(0.0);
    let epsilon = RELATIVE_FLOOR * level * level;
    let rmse = of_channels(&|b, c| (c - b) * (c - b)).map(f64::sqrt);
    let own = |b: Vec3, c: Vec3| f64::from(0.5 * (b.abs() + c.abs()).element_sum()) + 3.0 * DARK_SHARE * level.abs();
    let has_changed = |b: Vec3, c: Vec3| f64::from((c - b).abs().element_sum()) > CHANGED_SHARE * own(b, c);
    let distance = |(_, b, c): &(usize, Vec3, Vec3)| (*c - *b).as_dvec3().length_squared();
    let worst = compared().max_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|pixel| distance(pixel) > 0.0);
    let exposure_ev = (!is_display).then(|| pair.exposure_ev.unwrap_or_else(|| base.auto_exposure_ev()));
    let figures = json!({
        // Those that are finite on both sides and not masked.
        "pixels": pixels,
        "non_finite_base": non_finite_base,
        "non_finite_candidate": non_finite_candidate,
        // Luminance.
        "mean_base": mean(&|b, _| f64::from(luminance(b))),
        "mean_candidate": mean(&|_, c| f64::from(luminance(c))),
        "mae": of_channels(&|b, c| (c - b).abs()),
        "rmse": rmse,
        // Of the base's mean.
        "rmse_percent": rmse.map(|rmse| if rmse > 0.0 { 100.0 * rmse / level.max(0.0) } else { 0.0 }),
        // ε = 10⁻² · mean(base)².
        "relmse": of_channels(&|b, c| (c - b) * (c - b) / (b * b + epsilon)).filter(|_| epsilon > 0.0),
        // Peak 1, as `idiff`; `null` where the pictures are equal.
        "psnr_db": rmse.filter(|rmse| *rmse > 0.0).map(|rmse| -20.0 * rmse.log10()),
        "changed_percent": mean(&|b, c| if has_changed(b, c) { 100.0 } else { 0.0 }),
        // What is no light has no look: irradiance is compared in numbers alone.
        "flip": if layer == LIGHT[1] { None } else { flip(&base, &candidate, exposure_ev, &used) },
        // The pixel that differs most, from the left and from the top.
        "worst": worst.map(|(i, b, c)| {
            let (x, y) = (i as u32 % base.width, i as u32 / base.width);
            json!({"x": x, "y": y, "base": b.to_array(), "candidate": c.to_array()})
        }),
    });
    let (quantity, unit) = match layer {
        _ if is_display => ("colours of a screen", ""),
        "beauty" => ("radiance", "W·m⁻²·sr⁻¹"),
        "irradiance_indirect" => ("indirect irradiance", "W·m⁻²"),
        _ => ("light", "W·m⁻²"),
    };
    let report = ImageReport {
        item: if is_named { join(&pair.item, layer) } else { pair.item.clone() },
        layer: layer.to_owned(),
        width: base.width,
        height: base.height,
        judged: pair.judged,
        is_display,
        quantity,
        unit,
        exposure_ev,
        figures,
        path_base: pair.base.display().to_string(),
        path_candidate: pair.candidate.display().to_string(),
        difference_map: None,
    };
    let mut difference = vec![f32::NAN; used.len()];
    compared().for_each(|(i, b, c)| difference[i] = luminance(c) - luminance(b));
    Ok(Layer { report, base, candidate, difference })
}

fn flip(base: &Picture, candidate: &Picture, exposure_ev: Option<f32>, used: &[bool]) -> Option<Value> {
    let shown = |picture: &Picture| match exposure_ev {
        Some(ev) => picture.tonemapped(ev),
        None => Picture8 {
            width: picture.width,
            height: picture.height,
            pixels: picture.pixels.par_iter().map(|p| p.to_array().map(byte_from_unit)).collect(),
        },
    };
    let map = flip_map(&shown(base), &shown(candidate));
    let mut values: Vec<f32> = map.into_iter().zip(used).filter(|(_, used)| **used).map(|(v, _)| v).collect();
    let last = values.len().checked_sub(1)?;
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
    values.par_sort_unstable_by(f32::total_cmp);
    let at = |share: f64| f64::from(values[(share * last as f64).round() as usize]);
    Some(json!({"mean": mean, "median": at(0.5), "p95": at(0.95), "p99": at(0.99), "max": at(1.0)}))
}

impl Layer {
    /// The differences as a picture.
    pub fn difference_map(&self) -> Picture8 {
        Heatmap {
            values: &self.difference,
            width: self.base.width,
            height: self.base.height,
            range: range_of(&self.difference),
            title: &format!("candidate minus base {}", self.report.item),
            unit: self.report.unit,
            missing: "not compared",
        }
        .draw()
    }
}

/// Share of pixels that show another surface, percent: no light and no noise in it. `None` where a file does not say which.
///
/// # Errors
/// Files that cannot be read.
pub fn surfaces(pair: &Pair) -> Result<Option<f64>, DiffError> {
    let read =
        |path: &Path| LayeredImage::read_exr_layers(path, |name| SURFACE.iter().any(|(layer, _)| *layer == name));
    for path in [&pair.base, &pair.candidate] {
        let layers = ImageHeader::read(path)?.layers;
        if !pair.judged || !SURFACE.iter().all(|(surface, _)| layers.iter().any(|layer| layer == surface)) {
            return Ok(None);
        }
    }
    let (base, candidate) = rayon::join(|| read(&pair.base), || read(&pair.candidate));
    let (base, candidate) = (base?, candidate?);
    let differs = |i: usize| {
        SURFACE.iter().any(|(layer, most)| {
            let [Some(b), Some(c)] = [&base, &candidate].map(|image| image.layer(layer)) else { return false };
            let scale = if *layer == "depth" { b[i].x.abs() } else { 1.0 };
            (b[i] - c[i]).abs().max_element() > most * scale
        })
    };
    let counted: Vec<usize> = (0..base.width as usize * base.height as usize)
        .filter(|i| pair.mask.is_none_or(|mask| mask.counts[*i]))
        .collect();
    let different = counted.par_iter().filter(|i| differs(**i)).count();
    Ok(Some(100.0 * different as f64 / counted.len().max(1) as f64))
}
