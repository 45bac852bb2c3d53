//! Error figures: the differences between a picture and its reference, and their uncertainty.
//!
//! All figures except `flip` compare the indirect irradiance. Every channel of every pixel that shows a surface has the
//! same weight. `flip` compares the tone-mapped pictures.
//!
//! The reference has noise, which would raise most figures. The third column gives the figure without this effect. Here
//! e is the value of the picture, r that of the reference, d = e − r, v the variance of r, and M the number of pixels ×
//! channels.
//!
//! | figure | definition | estimate without the reference's noise |
//! |---|---|---|
//! | `bias` | Σd/M | the same |
//! | `rmse` | √(Σd²/M) | √(max(0, Σ(d² − v)/M)) |
//! | `nrmse` | `rmse` ÷ mean luminance of r | through `rmse`; the standard error contains the mean's noise |
//! | `relmse` | Σ(d²/(r² + ε))/M, ε = 10⁻²·mean(r)² | [`terms::relative_square`]; d² − v where noise is small |
//! | `mae` | Σ\|d\|/M | Σ(\|d\| − b)/M with the folded normal's b, [`terms::fold`] |
//! | `over`, `under` | Σmax(0, ±d)/M | Σ(max(0, ±d) − b/2)/M |
//! | `psnr_db` | 20·log₁₀(peak/rmse) | through `rmse`; the standard error contains the peak's noise |
//! | `flip` | mean of LDR-FLIP's map | [`flip`] |
//!
//! The peak is the largest value of the reference. This is usual for pictures whose values have no upper limit.
//!
//! Standard errors follow from v by the delta method ([`pooled::Pooled`]) for independent pixels. They also contain the
//! uncertainty of the corrections: a share of b, and a share of the correction of relative squares, or the whole term
//! where the noise is as large as the denominator.
//!
//! The verdict of a part of the picture is "reference too noisy" if Σv > Σ(d² − v) there, that is, if the noise exceeds
//! the difference. Figures pooled over many pixels can still be well determined; their standard errors tell.

pub mod at_points;
pub mod flip;
pub mod pooled;
pub mod sampled;
pub mod terms;
mod window;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::reference_layers::{ReferenceLayers, ReferenceNoise};
use crate::math::color::luminance;
use crate::shade::regions::Region;
use pooled::Pooled;
use terms::{FOLD_UNCERTAINTY, fold, is_continued, relative_square};
use window::window_means;

/// ε of `relmse`, as a share of the squared mean of the reference.
const RELATIVE_FLOOR: f64 = 1.0e-2;

/// Uncertainty of the correction of `relmse`, as a share of the correction. The correction assumes normal noise, but
/// the noise of paths that rarely find light is skewed. In a measurement at 256 samples per pixel, in the dark one of
/// two open rooms, the correction left a quarter of the noise's effect.
const RELATIVE_UNCERTAINTY: f64 = 0.3;

/// Verdict if the noise of the reference exceeds the difference: more samples help.
pub const TOO_NOISY: &str = "reference too noisy";

/// Verdict if the noise of the reference is not known.
const NOISE_UNKNOWN: &str =
    "no error estimate: the reference does not say how noisy it is (below 32 samples per pixel it cannot)";

/// The error figures, or their standard errors. Undefined figures are `null`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Figures {
    /// W·m⁻², as are `rmse`, `bias`, `over`, `under`.
    pub mae: Option<f64>,
    pub rmse: Option<f64>,
    /// `rmse` ÷ the mean luminance of the reference over the whole picture's surfaces: often called relative RMSE. `null`
    /// if that mean is 0.
    #[serde(default)]
    pub nrmse: Option<f64>,
    pub relmse: Option<f64>,
    /// Positive if the picture is too bright.
    pub bias: Option<f64>,
    pub over: Option<f64>,
    pub under: Option<f64>,
    pub psnr_db: Option<f64>,
    pub flip: Option<f64>,
}

/// The figures of one part of the picture: all of it or one region.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ErrorEstimate {
    pub pixels: usize,
    #[serde(flatten)]
    pub figures: Figures,
    /// From the noise of the reference. `null` if the noise is not known.
    pub standard_error: Figures,
    /// Root of the mean variance of the reference, W·m⁻². `null` if the noise is not known.
    pub noise_rms: Option<f64>,
    /// The reason not to rely on these figures, for example "reference too noisy" if `noise_rms` exceeds `rmse`. `null`
    /// if there is no such reason.
    pub verdict: Option<&'static str>,
}

/// The figures of a picture and of its two regions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorReport {
    #[serde(flatten)]
    pub all: ErrorEstimate,
    pub by_region: ByRegion,
    /// ε of `relmse`, W²·m⁻⁴. It is the same for the whole picture and its regions.
    pub relmse_epsilon: f64,
    /// Peak of `psnr_db`, W·m⁻². It is the same for the whole picture and its regions.
    pub psnr_peak: f64,
    /// Mean luminance of the reference that `nrmse` is relative to, W·m⁻². It is the same for the whole picture and its
    /// regions.
    pub nrmse_mean: f64,
    /// Number of pixels that are left out because the picture or the reference is not finite there.
    pub pixels_not_finite: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByRegion {
    pub corner: ErrorEstimate,
    pub flat: ErrorEstimate,
}

/// Sums over the pixels of one part of the picture.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    pixels: usize,
    /// `bias`, `mae`, `over`, `under`, squared errors, `relmse`; the last is not finite where ε is 0.
    pooled: [Pooled; 6],
    /// Sum of the covariances of a pixel's squared errors with its luminance in the reference.
    square_with_mean: f64,
    /// Sum of the corrections [`fold`].
    fold: f64,
    /// Sum of the uncertainties of relative squares: a share of the correction, or the whole term where the noise is as
    /// large as the denominator.
    doubtful: f64,
    /// Sum of the variances v.
    noise: f64,
}

/// Compares a picture's indirect `irradiance` with the reference's. `regions` holds the region of every pixel, or
/// `None` for pixels without a surface. `flips` holds the figures of FLIP, if they were measured.
///
/// # Panics
/// If `irradiance` or `regions` have not as many pixels as the reference.
pub fn measure(
    reference: &ReferenceLayers,
    irradiance: &[Vec3],
    regions: &[Option<Region>],
    flips: Option<&flip::Flips>,
) -> ErrorReport {
    assert_eq!(irradiance.len(), reference.irradiance.len(), "pixels of the picture");
    assert_eq!(regions.len(), reference.irradiance.len(), "pixels of the regions");
    let usable = |i: usize| regions[i].is_some() && irradiance[i].is_finite() && reference.is_finite(i);
    let mask: Vec<bool> = (0..irradiance.len()).map(usable).collect();
    let scale = Scale::of(reference, &mask);
    let around = look_around(reference, irradiance, &mask);

    // The whole picture, corners, flat parts.
    let mut sums = [Sums::default(); 3];
    for i in (0..irradiance.len()).filter(|&i| mask[i]) {
        let part = if regions[i] == Some(Region::Corner) { 1 } else { 2 };
        for s in [0, part] {
            sums[s].add(reference, i, irradiance[i], around.as_ref().map(|a| &a[i]), scale.epsilon);
        }
    }
    let finish = |part: usize| {
        let flip = flips.map(|f| f[part]).unwrap_or_default();
        sums[part].finish(reference.noise.is_some(), &scale, flip)
    };
    ErrorReport {
        all: finish(0),
        by_region: ByRegion { corner: finish(1), flat: finish(2) },
        relmse_epsilon: scale.epsilon,
        psnr_peak: scale.peak,
        nrmse_mean: scale.mean,
        pixels_not_finite: (0..mask.len()).filter(|&i| regions[i].is_some() && !mask[i]).count(),
    }
}

/// Uncertainty of the peak in standard errors of its pixel. The largest of many noisy values is too large: among 10⁴
/// equal values by 3.7 standard errors. Few pixels compete for the peak, so the excess is smaller.
const PEAK_SIGMAS: f64 = 3.0;

/// What the figures of all parts refer to.
#[derive(Debug, Clone, Copy)]
struct Scale {
    /// ε of `relmse`. It is taken as exact, because the noise of a mean over all pixels is negligible.
    epsilon: f64,
    /// Of `psnr_db`, W·m⁻².
    peak: f64,
    /// Uncertainty of the peak, W·m⁻², from the noise of the pixel and channel in which it was found.
    peak_error: f64,
    /// Mean luminance, W·m⁻², and the variance of that mean.
    mean: f64,
    mean_variance: f64,
    /// Pixels in that mean, at least 1.
    pixels: f64,
}

impl Scale {
    fn of(reference: &ReferenceLayers, mask: &[bool]) -> Scale {
        let (mut sum, mut count, mut peak, mut peak_error) = (0.0, 0.0f64, 0.0, 0.0);
        for (i, c) in (0..mask.len()).filter(|&i| mask[i]).flat_map(|i| [0, 1, 2].map(|c| (i, c))) {
            let channel = f64::from(reference.irradiance[i][c]);
            sum += channel;
            count += 1.0;
            if channel > peak {
                peak = channel;
                peak_error = reference.noise.as_ref().map_or(0.0, |n| PEAK_SIGMAS * n.between(i, c, c).sqrt());
            }
        }
        let all_channels = sum / count.max(1.0);
        let shown = || (0..mask.len()).filter(|&i| mask[i]);
        let pixels = (count / 3.0).max(1.0);
        let mean = shown().map(|i| f64::from(luminance(reference.irradiance[i]))).sum::<f64>() / pixels;
        let variance = |noise: &ReferenceNoise| shown().map(|i| noise.luminance_variance(i)).sum::<f64>();
        let mean_variance = reference.noise.as_ref().map_or(0.0, variance) / (pixels * pixels);
        let epsilon = RELATIVE_FLOOR * all_channels * all_channels;
        Scale { epsilon, peak, peak_error, mean, mean_variance, pixels }
    }
}

/// Means over the neighbourhood of a pixel, a row of three channels each: of d; of v, because the v of one pixel is
/// itself an estimate, and a poor one if it comes from few blocks; of r² − v, an estimate of t².
type Around = [f64; 9];

/// The neighbourhood means of every pixel. `None` if the noise is not known.
fn look_around(reference: &ReferenceLayers, irradiance: &[Vec3], mask: &[bool]) -> Option<Vec<Around>> {
    let noise = reference.noise.as_ref()?;
    let values = |i: usize| {
        let (r, e) = (reference.irradiance[i].as_dvec3(), irradiance[i].as_dvec3());
        let v = [0, 1, 2].map(|c| noise.between(i, c, c));
        let (d, t) = (e - r, [0, 1, 2].map(|c| r[c] * r[c] - v[c]));
        [d.x, d.y, d.z, v[0], v[1], v[2], t[0], t[1], t[2]]
    };
    Some(window_means(reference.width, reference.height, |i| mask[i], values))
}

impl Sums {
    fn add(&mut self, reference: &ReferenceLayers, pixel: usize, value: Vec3, around: Option<&Around>, epsilon: f64) {
        let noise = reference.noise.as_ref().map(|n| (n, pixel));
        let r = reference.irradiance[pixel].to_array().map(f64::from);
        let d = [0, 1, 2].map(|c| f64::from(value[c]) - r[c]);
        let v = [0, 1, 2].map(|c| noise.map_or(0.0, |(n, i)| n.between(i, c, c)));
        let b = [0, 1, 2].map(|c| around.map_or(0.0, |a| fold(d[c], a[c], a[3 + c])));
        // The derivative of max(0, ±d) is ±1 for one sign of d and 0 for the other.
        let is = |yes: bool| if yes { 1.0 } else { 0.0 };
        let terms = [0, 1, 2].map(|c| {
            [
                (d[c], -1.0, 0.0),
                (d[c].abs() - b[c], -d[c].signum(), 0.0),
                (d[c].max(0.0) - b[c] / 2.0, -is(d[c] > 0.0), 0.0),
                ((-d[c]).max(0.0) - b[c] / 2.0, is(d[c] < 0.0), 0.0),
                (d[c] * d[c] - v[c], -2.0 * d[c], 2.0),
                relative_square(d[c], r[c], v[c], epsilon),
            ]
        });
        for (k, pooled) in self.pooled.iter_mut().enumerate() {
            pooled.add(terms.map(|of_channel| of_channel[k]), noise);
        }
        if let Some((noise, i)) = noise {
            // Covariance with the luminance, as far as the squared error is a linear function of the reference.
            let with_luminance = |c: usize| {
                let weight = |other: usize| f64::from(luminance(Vec3::AXES[other]));
                (0..3).map(|other| weight(other) * noise.between(i, c, other)).sum::<f64>()
            };
            self.square_with_mean += (0..3).map(|c| -2.0 * d[c] * with_luminance(c)).sum::<f64>();
        }
        for c in (0..3).filter(|&c| v[c] != 0.0) {
            let w = r[c] * r[c] + epsilon;
            self.doubtful += if around.is_none_or(|a| is_continued(a[3 + c], a[6 + c], epsilon)) {
                RELATIVE_UNCERTAINTY * (d[c] * d[c] / w - terms[c][5].0).abs()
            } else {
                (d[c] * d[c]).max(v[c]) / w
            };
        }
        self.pixels += 1;
        self.fold += b.iter().sum::<f64>();
        self.noise += v.iter().sum::<f64>();
    }

    fn finish(&self, noise_known: bool, scale: &Scale, flip: flip::Flip) -> ErrorEstimate {
        if self.pixels == 0 {
            return ErrorEstimate::default();
        }
        let Scale { epsilon, peak, peak_error, mean, mean_variance, pixels } = *scale;
        let samples = 3.0 * self.pixels as f64;
        let [bias, mae, over, under, square, relmse] = &self.pooled;
        let square_error = square.variance(samples).sqrt();
        let square = square.mean(samples).max(0.0);
        let rmse = square.sqrt();
        let relative = |value: f64| (epsilon > 0.0).then_some(value);
        let normalised = |value: f64| (mean > 0.0).then(|| value / mean);
        let psnr = |value: f64| (square > 0.0 && peak > 0.0).then_some(value);
        let figures = Figures {
            mae: Some(mae.mean(samples).max(0.0)),
            rmse: Some(rmse),
            nrmse: normalised(rmse),
            relmse: relative(relmse.mean(samples).max(0.0)),
            bias: Some(bias.mean(samples)),
            over: Some(over.mean(samples).max(0.0)),
            under: Some(under.mean(samples).max(0.0)),
            psnr_db: psnr(10.0 * (peak * peak / square).log10()),
            flip: flip.mean,
        };
        let known = |error: f64| noise_known.then_some(error);
        // The uncertainty of the correction by `fold` is systematic: it does not fall with the number of pixels.
        let folded = FOLD_UNCERTAINTY * self.fold / samples;
        let error = |pooled: &Pooled, systematic: f64| known(pooled.variance(samples).sqrt().hypot(systematic));
        let rmse_error = root_error(rmse, square_error);
        // Of a quotient: var(a/m)·m² = var(a) + (a/m)²·var(m) − 2(a/m)·cov(a, m), with cov(rmse, m) = cov(rmse², m)/(2·rmse).
        let covariance = self.square_with_mean / (samples * pixels);
        let of_mean = if mean > 0.0 { (rmse / mean).powi(2) * mean_variance - covariance / mean } else { 0.0 };
        // Near a difference of 0 the covariance is noise itself: it must not shorten the bar.
        let quotient_error = rmse_error * rmse_error + of_mean.max(0.0);
        let standard_error = Figures {
            mae: error(mae, folded),
            rmse: known(rmse_error),
            nrmse: normalised(quotient_error.sqrt()).and_then(known),
            relmse: relative(0.0).and(error(relmse, self.doubtful / samples)),
            bias: error(bias, 0.0),
            over: error(over, folded / 2.0),
            under: error(under, folded / 2.0),
            psnr_db: psnr(0.0)
                .and(known(10.0 / std::f64::consts::LN_10 * (square_error / square).hypot(2.0 * peak_error / peak))),
            flip: flip.standard_error,
        };
        let noise = self.noise / samples;
        let verdict = match noise_known {
            false => Some(NOISE_UNKNOWN),
            true => (noise > square).then_some(TOO_NOISY),
        };
        ErrorEstimate { pixels: self.pixels, figures, standard_error, noise_rms: known(noise.sqrt()), verdict }
    }
}

/// Standard error of a root x from the standard error s of its square. It is half the larger of the distances from x to
/// √(x² + 2s) and to √(max(0, x² − 2s)). For small s this equals s/(2x), the result of the delta method, which grows
/// without bound near x = 0.
pub(super) fn root_error(root: f64, square_error: f64) -> f64 {
    let at = |sigmas: f64| (root * root + sigmas * square_error).max(0.0).sqrt();
    ((at(2.0) - root) / 2.0).max((root - at(-2.0)) / 2.0)
}
