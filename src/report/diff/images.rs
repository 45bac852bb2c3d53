//! Two pictures, pixel by pixel.
//!
//! `mae`, `rmse` and `psnr_db` are of the stored numbers as they stand, all channels pooled, peak 1: those of OpenImageIO's
//! `idiff`. FLIP is of what a screen shows: PNG as they are, light at the base's exposure.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::DiffError;
use super::gate::Finding;
use super::image_gates::{SURFACE, findings, surfaces};
use super::mask::Mask;
use super::noise::Noise;
use super::ratio::{Part, unevenness};
use super::shown;
use crate::image::{AnyImage, ImageHeader, Picture, Picture8};
use crate::math::color::{byte_from_unit, luminance};
use crate::report::error::flip::flip_map;
use crate::report::heatmap::{Heatmap, range_of};
use crate::report::page::{MOST_PIXELS, PackedImage};
use crate::system::memory::{TooLittleMemory, available_bytes};

/// ε of `relmse`, as a share of the base's squared mean: as in the errors of `render`.
const RELATIVE_FLOOR: f64 = 1.0e-2;

/// The picture is divided into so many blocks along each side for the noise of its mean.
const BLOCKS: u32 = 8;

/// Layers that are light, in the order of their reports.
pub(super) const LIGHT: [&str; 2] = ["beauty", "irradiance_indirect"];

/// Memory at the peak, per pixel, FLIP's own pictures included: 105 B were measured on 7680 × 4320, rounded up.
const PIXEL_BYTES: f64 = 130.0;

/// Memory, per pixel that the page shows, while it packs a pair: two pictures, planes of both as they are and as differences, bytes
/// before and after deflation.
const PACKING_BYTES: f64 = 60.0;

/// What is kept of a pair until the files are written: its difference map per pixel, and per pixel that the page shows its text at
/// all resolutions, 1 B where light is smooth and up to 10 B where every channel has noise of its own.
const MAP_BYTES: f64 = 3.0;
const PACKED_BYTES: f64 = 10.0;

/// The pixel that differs most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorstPixel {
    /// From the left.
    pub x: u32,
    /// From the top.
    pub y: u32,
    pub base: [f32; 3],
    pub candidate: [f32; 3],
}

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
    /// Of the base, for both.
    pub exposure_ev: Option<f32>,
    /// Pixels that are compared: finite on both sides and not masked.
    pub pixels: usize,
    pub non_finite_base: usize,
    pub non_finite_candidate: usize,
    /// Luminance.
    pub mean_base: Option<f64>,
    pub mean_candidate: Option<f64>,
    pub mae: Option<f64>,
    pub rmse: Option<f64>,
    /// ε = 10⁻² · mean(base)².
    pub relmse: Option<f64>,
    /// Peak 1, as `idiff`; `null` where the pictures are equal.
    pub psnr_db: Option<f64>,
    pub flip: Option<FlipFigures>,
    pub worst: Option<WorstPixel>,
    pub path_base: PathBuf,
    pub path_candidate: PathBuf,
    /// Signed differences of luminance, as a picture in the report's folder.
    pub difference_map: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlipFigures {
    pub mean: f64,
    pub median: f64,
    pub p95: f64,
    pub p99: f64,
    pub max: f64,
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
    /// Of both sides.
    pub noise: Noise,
    /// White counts.
    pub mask: Option<&'a Mask>,
}

/// What the comparison of two files found.
#[derive(Debug, Default)]
pub struct Compared {
    pub reports: Vec<ImageReport>,
    pub findings: Vec<Finding>,
    /// In the order of `reports`, as is what the page shows.
    pub maps: Vec<Option<Picture8>>,
    pub shown: Vec<PackedImage>,
    /// Of the indirect irradiance of a judged pair that has it.
    pub unevenness: Option<Unevenness>,
}

/// How unequally the pixels' luminance changed: see [`unevenness`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unevenness {
    /// Of the base's mean.
    pub share: f64,
    /// The base's mean.
    pub mean: f64,
}

/// Refuses pictures that cannot be compared, by their headers. `kept`: bytes that pairs before this one leave in memory; returned
/// with this one's added.
pub fn check(pair: &Pair, kept: f64) -> Result<f64, DiffError> {
    let headers = [ImageHeader::read(&pair.base)?, ImageHeader::read(&pair.candidate)?];
    let [base, candidate] = &headers;
    let incomparable =
        |what: String| DiffError::Incomparable { base: pair.base.clone(), candidate: pair.candidate.clone(), what };
    if (base.width, base.height) != (candidate.width, candidate.height) {
        return Err(incomparable(format!(
            "{} × {} and {} × {} pixels; make both of one size",
            base.width, base.height, candidate.width, candidate.height
        )));
    }
    if base.is_display != candidate.is_display {
        return Err(incomparable(
            "one holds codes for a screen and the other light; compare EXR or HDR with its like".into(),
        ));
    }
    if let Some(mask) = pair.mask.filter(|m| (m.width, m.height) != (base.width, base.height)) {
        let what = format!(
            "it has {} × {} pixels and {} has {} × {}; make them of one size",
            mask.width,
            mask.height,
            pair.base.display(),
            base.width,
            base.height
        );
        return Err(DiffError::Mask { path: mask.path.clone(), what });
    }
    let pixels = f64::from(base.width) * f64::from(base.height);
    let shown = pixels.min(MOST_PIXELS as f64);
    let layers = lights(&base.layers).len() as f64;
    let kept = kept + layers * (MAP_BYTES * pixels + PACKED_BYTES * shown);
    let needed = (kept + PIXEL_BYTES * pixels + PACKING_BYTES * shown) as u64;
    match available_bytes() {
        Some(available) if needed > available => Err(TooLittleMemory {
            key: pair.base.display().to_string(),
            what: "comparing it",
            needed,
            available,
            remedy: "compare smaller pictures",
        }
        .into()),
        _ => Ok(kept),
    }
}

/// Layers that are compared: those of light, or the first.
fn lights(layers: &[String]) -> Vec<&str> {
    let lights: Vec<&str> = LIGHT.into_iter().filter(|l| layers.iter().any(|n| n == l)).collect();
    if lights.is_empty() { layers.iter().take(1).map(String::as_str).collect() } else { lights }
}

/// Compares two files, layer by layer: one layer of both is in memory at a time. `pairs`: about how many the page shows.
pub fn compare(pair: &Pair, pairs: usize) -> Result<Compared, DiffError> {
    let layers = ImageHeader::read(&pair.base)?.layers;
    let others = ImageHeader::read(&pair.candidate)?.layers;
    let mut compared = Compared::default();
    for layer in lights(&layers) {
        if !others.iter().any(|o| o == layer) {
            let what = format!("the second has no layer {layer}; render both with one version");
            return Err(DiffError::Incomparable { base: pair.base.clone(), candidate: pair.candidate.clone(), what });
        }
        compare_layer(pair, (layer, layers.len() > 1), pairs, &mut compared)?;
    }
    if SURFACE.iter().all(|s| layers.iter().any(|l| l == s) && others.iter().any(|l| l == s)) && pair.judged {
        compared.findings.push(surfaces(pair)?);
    }
    Ok(compared)
}

/// One layer of one file.
fn read(path: &Path, layer: &str) -> Result<(Picture, bool), DiffError> {
    let AnyImage { image, is_display } = AnyImage::read(path, |name| name == layer)?;
    let picture = image.picture(layer).unwrap_or_else(|| Picture::new(image.width, image.height));
    Ok((picture, is_display))
}

/// Sums of a picture's differences.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub(super) pixels: usize,
    absolute: f64,
    square: f64,
    pub(super) base: f64,
    luminance: [f64; 2],
    pub(super) non_finite: [usize; 2],
    /// Of the luminance: see [`unevenness`].
    pub(super) unevenness: Option<f64>,
    worst: Option<(f64, usize)>,
}

fn compare_layer(
    pair: &Pair,
    (layer, is_named): (&str, bool),
    pairs: usize,
    compared: &mut Compared,
) -> Result<(), DiffError> {
    let (base, candidate) = rayon::join(|| read(&pair.base, layer), || read(&pair.candidate, layer));
    let ((base, is_display), (candidate, _)) = (base?, candidate?);
    let counts = |i: usize| pair.mask.is_none_or(|mask| mask.counts[i]);
    let finite = |i: usize| base.pixels[i].is_finite() && candidate.pixels[i].is_finite();
    let used: Vec<bool> = (0..base.pixels.len()).map(|i| counts(i) && finite(i)).collect();
    let mut sums = Sums::default();
    let mut blocks = vec![Part::default(); BLOCKS.pow(2) as usize];
    for (i, (b, c)) in base.pixels.iter().zip(&candidate.pixels).enumerate() {
        if counts(i) {
            sums.non_finite[0] += usize::from(!b.is_finite());
            sums.non_finite[1] += usize::from(!c.is_finite());
        }
        if !used[i] {
            continue;
        }
        let d = (*c - *b).as_dvec3();
        sums.pixels += 1;
        sums.absolute += d.abs().element_sum();
        sums.square += d.length_squared();
        sums.base += b.as_dvec3().element_sum();
        let l = [f64::from(luminance(*b)), f64::from(luminance(*c))];
        sums.luminance = [sums.luminance[0] + l[0], sums.luminance[1] + l[1]];
        if sums.worst.is_none_or(|(worst, _)| d.length_squared() > worst) && d.length_squared() > 0.0 {
            sums.worst = Some((d.length_squared(), i));
        }
        let (x, y) = (i as u32 % base.width, i as u32 / base.width);
        let block = x * BLOCKS / base.width + BLOCKS * (y * BLOCKS / base.height);
        blocks[block as usize].add(l[0], l[1]);
    }
    let light = |picture: &Picture, i: usize| f64::from(luminance(picture.pixels[i]));
    let compared_pixels = (0..used.len()).filter(|i| used[*i]);
    sums.unevenness = unevenness(compared_pixels.map(|i| [light(&base, i), light(&candidate, i)]));
    let exposure_ev = (!is_display).then(|| pair.exposure_ev.unwrap_or_else(|| base.auto_exposure_ev()));
    if sums.pixels == 0 && sums.non_finite[1] <= sums.non_finite[0] {
        let what = "no pixel is finite on both sides and counts; there is nothing to judge".to_owned();
        return Err(DiffError::Incomparable { base: pair.base.clone(), candidate: pair.candidate.clone(), what });
    }
    let item = if is_named { join(&pair.item, layer) } else { pair.item.clone() };
    let unit = match layer {
        _ if is_display => "",
        "beauty" => "W·m⁻²·sr⁻¹",
        _ => "W·m⁻²",
    };
    let (flip, map) = rayon::join(
        // What is no light has no look: irradiance is compared in numbers alone.
        || if layer == LIGHT[1] { None } else { flip(&base, &candidate, exposure_ev, &used) },
        || difference_map((&item, unit), &base, &candidate, &used),
    );
    let report = report(pair, layer, &item, &sums, flip, (&used, [&base, &candidate]), exposure_ev);
    if pair.judged {
        compared.findings.extend(findings(&item, &report, &sums, &blocks, &used, [&base, &candidate], pair.noise));
        if layer == LIGHT[1] {
            let of_mean = |(share, mean)| Unevenness { share, mean };
            compared.unevenness = sums.unevenness.zip(report.mean_base).map(of_mean);
        }
    }
    compared.shown.push(shown::image(&report, unit, &used, [&base, &candidate], pairs)?);
    compared.maps.push(Some(map));
    compared.reports.push(report);
    Ok(())
}

/// Name of a part of an item.
pub fn join(item: &str, part: &str) -> String {
    if item.is_empty() { part.to_owned() } else { format!("{item}/{part}") }
}

fn report(
    pair: &Pair,
    layer: &str,
    item: &str,
    sums: &Sums,
    flip: Option<FlipFigures>,
    (used, [base, candidate]): (&[bool], [&Picture; 2]),
    exposure_ev: Option<f32>,
) -> ImageReport {
    let samples = 3.0 * sums.pixels as f64;
    let any = |value: f64| (sums.pixels > 0).then_some(value);
    let square = sums.square / samples;
    let epsilon = RELATIVE_FLOOR * (sums.base / samples).powi(2);
    ImageReport {
        item: item.to_owned(),
        layer: layer.to_owned(),
        width: base.width,
        height: base.height,
        judged: pair.judged,
        is_display: exposure_ev.is_none(),
        exposure_ev,
        pixels: sums.pixels,
        non_finite_base: sums.non_finite[0],
        non_finite_candidate: sums.non_finite[1],
        mean_base: any(sums.luminance[0] / sums.pixels as f64),
        mean_candidate: any(sums.luminance[1] / sums.pixels as f64),
        mae: any(sums.absolute / samples),
        rmse: any(square.sqrt()),
        relmse: relmse(used, [base, candidate], epsilon).filter(|_| sums.pixels > 0 && epsilon > 0.0),
        psnr_db: any(-10.0 * square.log10()).filter(|_| square > 0.0),
        flip,
        worst: sums.worst.map(|(_, i)| WorstPixel {
            x: i as u32 % base.width,
            y: i as u32 / base.width,
            base: base.pixels[i].to_array(),
            candidate: candidate.pixels[i].to_array(),
        }),
        path_base: pair.base.clone(),
        path_candidate: pair.candidate.clone(),
        difference_map: None,
    }
}

fn relmse(used: &[bool], [base, candidate]: [&Picture; 2], epsilon: f64) -> Option<f64> {
    let terms = base.pixels.iter().zip(&candidate.pixels).zip(used).filter(|(_, used)| **used);
    let (mut sum, mut count) = (0.0, 0.0f64);
    for ((b, c), _) in terms {
        for channel in 0..3 {
            let (b, c) = (f64::from(b[channel]), f64::from(c[channel]));
            sum += (c - b) * (c - b) / (b * b + epsilon);
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

fn flip(base: &Picture, candidate: &Picture, exposure_ev: Option<f32>, used: &[bool]) -> Option<FlipFigures> {
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
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
    values.par_sort_unstable_by(f32::total_cmp);
    let at = |share: f64| f64::from(values[(share * (values.len() - 1) as f64).round() as usize]);
    Some(FlipFigures { mean, median: at(0.5), p95: at(0.95), p99: at(0.99), max: at(1.0) })
}

/// Candidate minus base, luminance.
fn difference_map((title, unit): (&str, &str), base: &Picture, candidate: &Picture, used: &[bool]) -> Picture8 {
    let pairs = base.pixels.par_iter().zip(&candidate.pixels).zip(used);
    let values: Vec<f32> =
        pairs.map(|((b, c), used)| if *used { luminance(*c) - luminance(*b) } else { f32::NAN }).collect();
    Heatmap {
        values: &values,
        width: base.width,
        height: base.height,
        range: range_of(&values),
        title: &format!("candidate minus base {title}"),
        unit,
        missing: "not compared",
    }
    .draw()
}
