//! Leak figures: light that came through walls, and light that the visibility test took away by mistake.
//!
//! All but [`dark_region`] compare against Ê, the same weights with exact ray visibility, so they are free of interpolation
//! error and need no reference. Sums run over image points by their share of a pixel, in luminance; points that see no probe at all
//! are left out and counted.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::reference_layers::ReferenceLayers;
use crate::math::color::luminance;
use crate::probe::query::Query;
use crate::shade::points::ImagePoint;
use crate::shade::visibility_modes::VisibilityMode;

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Leak {
    /// Σ max(0, E − Ê) ÷ ΣÊ; `null` where no light is to be seen.
    pub light: Option<f64>,
    /// Σ max(0, Ê − E) ÷ ΣÊ; `null` where no light is to be seen.
    pub dark: Option<f64>,
    /// Share of the irradiance that came from probes not visible; `null` where there is no irradiance.
    pub fraction: Option<f64>,
    /// Mean share of the weight that probes not visible have; `null` without points.
    pub weight: Option<f64>,
    /// Share of the image's points that see none of their probes.
    pub unseen: f64,
    /// Mean irradiance where the reference has none, as a share of the reference's mean: see [`dark_region`]; `null` without a
    /// reference.
    pub dark_region: Option<f64>,
    /// Σ max(0, E_p − E_path) ÷ ΣE_path over active probes: what leaked into the probes themselves
    /// ([`super::baked`]); `null` without a traced reference.
    pub baked: Option<f64>,
}

/// Irradiance that counts as none, as a share of the reference's mean over the picture.
const DARK_SHARE: f64 = 1.0e-3;

/// How sure the reference must be that a pixel is dark: standard errors of its luminance.
const DARK_SIGMAS: f64 = 3.0;

/// Mean luminance of a method's indirect irradiance over the pixels with E_ref + 3σ < 10⁻³·mean(E_ref), ÷ mean(E_ref).
///
/// `shown`: whether a pixel shows a surface. `None` where no pixel is dark, where all are, and where the reference does not know
/// its σ.
///
/// # Panics
/// When the pixels of the two or of `shown` differ in number.
pub fn dark_region(irradiance: &[Vec3], reference: &ReferenceLayers, shown: &[bool]) -> Option<f64> {
    assert_eq!(irradiance.len(), reference.irradiance.len(), "pixels of the picture");
    let noise = reference.noise.as_ref()?;
    let used = |i: usize| shown[i] && reference.is_finite(i) && irradiance[i].is_finite();
    let mean = reference.means(used).0.filter(|mean| *mean > 0.0)?;
    let (mut sum, mut count) = (0.0, 0.0f64);
    for i in (0..irradiance.len()).filter(|&i| used(i)) {
        let surely_below =
            f64::from(luminance(reference.irradiance[i])) + DARK_SIGMAS * noise.luminance_variance(i).sqrt();
        if surely_below < DARK_SHARE * mean {
            sum += f64::from(luminance(irradiance[i]));
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count / mean)
}

/// Figures of one method from its irradiance and that with exact visibility.
pub fn measure(
    query: &Query,
    points: &[ImagePoint],
    masks: &[u8],
    mode: VisibilityMode,
    irradiance: &[Vec3],
    exact: &[Vec3],
) -> Leak {
    let (mut light, mut dark, mut total) = (0.0f64, 0.0f64, 0.0f64);
    let (mut from_hidden, mut from_all) = (0.0f64, 0.0f64);
    let (mut hidden_weight, mut seen, mut unseen) = (0.0f64, 0.0f64, 0.0f64);
    for (i, point) in points.iter().enumerate() {
        let share = f64::from(point.weight);
        if query.weights(&point.query(), VisibilityMode::Ray.visibility(masks[i])).total() <= 0.0 {
            unseen += share;
            continue;
        }
        seen += share;
        let (e, e_exact) = (f64::from(luminance(irradiance[i])), f64::from(luminance(exact[i])));
        light += (e - e_exact).max(0.0) * share;
        dark += (e_exact - e).max(0.0) * share;
        total += e_exact * share;

        let corners = query.weights(&point.query(), mode.visibility(masks[i]));
        let sum = f64::from(corners.total());
        for k in 0..8 {
            let weight = f64::from(corners.weights[k]) / sum;
            if corners.weights[k] <= 0.0 {
                continue;
            }
            let contribution = luminance(query.volume.probe_irradiance(corners.probes[k], point.normal));
            let contribution = f64::from(contribution) * weight * share;
            from_all += contribution;
            if masks[i] >> k & 1 == 0 {
                from_hidden += contribution;
                hidden_weight += weight * share;
            }
        }
    }
    let ratio = |a: f64, b: f64| (b > 0.0).then(|| a / b);
    Leak {
        light: ratio(light, total),
        dark: ratio(dark, total),
        fraction: ratio(from_hidden, from_all),
        weight: ratio(hidden_weight, seen),
        unseen: ratio(unseen, seen + unseen).unwrap_or(0.0),
        dark_region: None,
        baked: None,
    }
}
