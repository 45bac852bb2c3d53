//! Leak figures: light that passes through walls, and light that the visibility test removes by mistake.
//!
//! All figures except [`dark_region`] compare the irradiance E with Ê, the irradiance from the same weights with exact
//! ray visibility. So they contain no interpolation error and need no reference. Sums are over the luminance at image
//! points, weighted by the share of the pixel. Points that see none of their probes are left out and counted.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::reference_layers::ReferenceLayers;
use crate::math::color::luminance;
use crate::math::statistics::Moments;
use crate::probe::fit::rows::BLACK_SHARE;
use crate::probe::query::Answers;
use crate::shade::points::ImagePoint;
use crate::shade::visibility_modes::VisibilityMode;

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Leak {
    /// Σ max(0, E − Ê) ÷ ΣÊ. `null` if ΣÊ is 0.
    pub light: Option<f64>,
    /// Σ max(0, Ê − E) ÷ ΣÊ. `null` if ΣÊ is 0.
    pub dark: Option<f64>,
    /// Share of the irradiance that comes from hidden probes. `null` if the irradiance is 0.
    pub fraction: Option<f64>,
    /// Mean share of the weights that hidden probes have. `null` without points.
    pub weight: Option<f64>,
    /// Share of the points with |E − Ê| > ¼·max(Ê, mean(Ê)/100): blotches that everyone sees, however little light they
    /// hold. `null` without points.
    #[serde(default)]
    pub blocks: Option<f64>,
    /// Share of the image's points that see none of their probes.
    pub unseen: f64,
    /// Mean irradiance where the reference is dark, as a share of the reference's mean; see [`dark_region`]. `null`
    /// without a reference.
    pub dark_region: Option<f64>,
    /// Share of the pixels with light in the reference that get hardly any; see [`false_black`]. `null` without a reference.
    #[serde(default)]
    pub black: Option<f64>,
    /// Σ max(0, E_p − E_path) ÷ ΣE_path over active probes: the light that leaked into the probes themselves
    /// ([`super::baked`]). `null` without a traced reference.
    pub baked: Option<f64>,
}

/// A point counts to `blocks` if its difference exceeds this share of its light, and of this share of the mean light where
/// it has less.
const BLOCK_SHARE: f64 = 0.25;
const BLOCK_FLOOR: f64 = 0.01;

/// A pixel is dark if its irradiance is below this share of the reference's mean over the picture.
const DARK_SHARE: f64 = 1.0e-3;

/// Chance that noise alone makes a pixel of just this share look dark, if noise is normal: that of 3 standard errors on
/// one side.
const DARK_CHANCE: f64 = 1.349_898e-3;

/// Pixels to each side over which the variance is averaged. A pixel's own variance is far too small by chance if few
/// blocks found the light that reaches it.
const DARK_WINDOW: usize = 2;

/// Mean luminance of the indirect `irradiance` over dark pixels ÷ mean(E_ref). Dark pixels are those with
/// E_ref + t·σ < 10⁻³·mean(E_ref).
///
/// σ² is the larger of the pixel's variance and the mean variance of the 5×5 pixels around it. t is the quantile of
/// Student's distribution for [`DARK_CHANCE`]; its degrees of freedom are one less than the blocks, times the pixels
/// of the window.
///
/// `shown` tells for each pixel whether it shows a surface. The result is `None` if no pixel is dark, if the whole
/// reference is black, or if σ is not known.
///
/// # Panics
/// If `irradiance` or `shown` have fewer pixels than the reference, or `irradiance` has more.
pub fn dark_region(irradiance: &[Vec3], reference: &ReferenceLayers, shown: &[bool]) -> Option<f64> {
    assert_eq!(irradiance.len(), reference.irradiance.len(), "pixels of the picture");
    let noise = reference.noise.as_ref()?;
    let used = |i: usize| shown[i] && reference.is_finite(i) && irradiance[i].is_finite();
    let mean = reference.means(used).0.filter(|mean| *mean > 0.0)?;
    let least = |i: usize| f64::from(luminance(reference.irradiance[i]));
    let variances: Vec<f64> = (0..irradiance.len()).map(|i| noise.luminance_variance(i)).collect();
    let quantiles = quantiles(noise.blocks);
    let most = |i: usize| {
        let around: Moments = window(i, reference).filter(|&j| used(j)).map(|j| variances[j]).collect();
        let quantile = quantiles[(around.weight() as usize).min(WINDOW_PIXELS) - 1];
        least(i) + quantile * around.mean().max(variances[i]).sqrt()
    };
    let is_dark = |i: &usize| used(*i) && least(*i) < DARK_SHARE * mean && most(*i) < DARK_SHARE * mean;
    let dark: Moments = (0..irradiance.len()).filter(is_dark).map(|i| f64::from(luminance(irradiance[i]))).collect();
    (dark.weight() > 0.0).then(|| dark.mean() / mean)
}

/// Share of the pixels that are falsely black: E < [`BLACK_SHARE`]·E_ref, of those with E_ref above
/// [`DARK_SHARE`]·mean(E_ref). `shown` tells for each pixel whether it shows a surface. `None` where none is lit.
pub fn false_black(irradiance: &[Vec3], reference: &ReferenceLayers, shown: &[bool]) -> Option<f64> {
    let used = |i: usize| shown[i] && reference.is_finite(i) && irradiance[i].is_finite();
    let mean = reference.means(used).0.filter(|mean| *mean > 0.0)?;
    let light = |e: Vec3| f64::from(luminance(e));
    let is_lit = |i: &usize| used(*i) && light(reference.irradiance[*i]) > DARK_SHARE * mean;
    let lit: Vec<usize> = (0..irradiance.len()).filter(is_lit).collect();
    let is_black = |i: &&usize| light(irradiance[**i]) < BLACK_SHARE * light(reference.irradiance[**i]);
    Some(lit.iter().filter(is_black).count() as f64 / lit.len() as f64)
}

const WINDOW_PIXELS: usize = (2 * DARK_WINDOW + 1) * (2 * DARK_WINDOW + 1);

/// The pixels of the window around a pixel, as far as the picture reaches.
fn window(pixel: usize, reference: &ReferenceLayers) -> impl Iterator<Item = usize> {
    let (width, height) = (reference.width as usize, reference.height as usize);
    let along = |at: usize, size: usize| at.saturating_sub(DARK_WINDOW)..(at + DARK_WINDOW + 1).min(size);
    let columns = along(pixel % width, width);
    along(pixel / width, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
}

/// Quantile for [`DARK_CHANCE`] of a variance from `blocks` blocks of each of 1, 2, … pixels.
fn quantiles(blocks: Option<u32>) -> Vec<f64> {
    // Where the number of blocks is not known, it is taken for large.
    let freedom = |pixels: usize| blocks.map_or(1e6, |b| f64::from(b.max(2) - 1) * pixels as f64);
    let quantile =
        |pixels| StudentsT::new(0.0, 1.0, freedom(pixels)).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - DARK_CHANCE));
    (1..=WINDOW_PIXELS).map(quantile).collect()
}

/// The leak figures of one visibility mode, except `dark_region` and `baked`. `irradiance` is that of the mode and
/// `exact` that of [`VisibilityMode::Ray`], both per point.
pub fn measure(
    query: &impl Answers,
    points: &[ImagePoint],
    masks: &[u8],
    mode: VisibilityMode,
    irradiance: &[Vec3],
    exact: &[Vec3],
) -> Leak {
    let (mut light, mut dark, mut total) = (0.0f64, 0.0f64, 0.0f64);
    let (mut from_hidden, mut from_all) = (0.0f64, 0.0f64);
    let (mut hidden_weight, mut seen, mut unseen) = (0.0f64, 0.0f64, 0.0f64);
    // Of points that see a probe: share, |E − Ê|, Ê.
    let mut differences = Vec::with_capacity(points.len());
    for (i, point) in points.iter().enumerate() {
        let share = f64::from(point.weight);
        if query.weights(&point.query, VisibilityMode::Ray.visibility(masks[i])).total() <= 0.0 {
            unseen += share;
            continue;
        }
        seen += share;
        let (e, e_exact) = (f64::from(luminance(irradiance[i])), f64::from(luminance(exact[i])));
        light += (e - e_exact).max(0.0) * share;
        dark += (e_exact - e).max(0.0) * share;
        total += e_exact * share;
        differences.push((share, (e - e_exact).abs(), e_exact));

        let corners = query.weights(&point.query, mode.visibility(masks[i]));
        let sum = f64::from(corners.total());
        for k in (0..8).filter(|&k| corners.weights[k] > 0.0) {
            let weight = f64::from(corners.weights[k]) / sum;
            let contribution = luminance(query.probe_irradiance(corners.probes[k], point.query.normal));
            let contribution = f64::from(contribution) * weight * share;
            from_all += contribution;
            if masks[i] >> k & 1 == 0 {
                from_hidden += contribution;
                hidden_weight += weight * share;
            }
        }
    }
    let ratio = |a: f64, b: f64| (b > 0.0).then(|| a / b);
    let least = BLOCK_FLOOR * ratio(total, seen).unwrap_or(0.0);
    let is_block = |(_, difference, exact): &&(f64, f64, f64)| *difference > BLOCK_SHARE * exact.max(least);
    let blocks = differences.iter().filter(is_block).fold(0.0, |sum, (share, ..)| sum + share);
    Leak {
        light: ratio(light, total),
        dark: ratio(dark, total),
        fraction: ratio(from_hidden, from_all),
        weight: ratio(hidden_weight, seen),
        blocks: ratio(blocks, seen),
        unseen: ratio(unseen, seen + unseen).unwrap_or(0.0),
        ..Leak::default()
    }
}
