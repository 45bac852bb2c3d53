//! Error figures: how far a picture is from its reference, and how well the reference allows to know.
//!
//! All are of the indirect irradiance, every channel of every pixel that shows a surface counted alike; FLIP is of what a screen
//! shows. e is the method's value, r the reference's, d = e − r, v the variance of r, M the number of pixels × channels:
//!
//! | figure | definition | freed from the reference's noise |
//! |---|---|---|
//! | `bias` | Σd/M | has none |
//! | `rmse` | √(Σd²/M) | √(max(0, Σ(d² − v)/M)) |
//! | `relmse` | Σ(d²/(r² + ε))/M, ε = 10⁻²·mean(r)² | [`terms::relative_square`]; d² − v where noise is small |
//! | `mae` | Σ\|d\|/M | Σ(\|d\| − b)/M with the folded normal's b, [`terms::fold`] |
//! | `over`, `under` | Σmax(0, ±d)/M | Σ(max(0, ±d) − b/2)/M |
//! | `psnr_db` | 20·log₁₀(peak/rmse) | through `rmse`; the peak's noise is in the standard error |
//! | `flip` | mean of LDR-FLIP's map | [`flip`] |
//!
//! The peak is the largest value of the reference, as is usual for pictures without a largest possible one.
//! Standard errors follow from v by the delta method ([`pooled::Pooled`]); pixels are independent. To them comes what the
//! corrections themselves may be wrong by: a share of b, and relative squares where the noise is as large as what they are
//! relative to.
//!
//! The reference is too noisy for some part of the picture where there Σv > Σ(d² − v): the noise exceeds the difference. Figures
//! pooled over many pixels may be well determined all the same, which is what their standard errors say.

pub mod flip;
pub mod pooled;
pub mod terms;
mod window;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::reference_layers::ReferenceLayers;
use crate::shade::regions::Region;
use pooled::{Pooled, Terms};
use terms::{FOLD_UNCERTAINTY, fold, is_continued, relative_square};
use window::window_means;

/// ε of `relmse`, as a share of the squared mean of the reference.
const RELATIVE_FLOOR: f64 = 1.0e-2;

/// By how much the corrections of `relmse` may be wrong, as a share of themselves: they are those of normal noise, and that of
/// paths which rarely find light is skew. With 256 samples per pixel in the dark one of two open rooms they left a quarter.
const RELATIVE_UNCERTAINTY: f64 = 0.3;

/// Where the noise exceeds the difference.
const TOO_NOISY: &str = "reference too noisy";

/// Where nothing is known about the noise.
const NOISE_UNKNOWN: &str =
    "no error estimate: the reference does not say how noisy it is (below 32 samples per pixel it cannot)";

/// Figures, or their standard errors. Undefined ones are `null`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Figures {
    /// W·m⁻², as are `rmse`, `bias`, `over`, `under`.
    pub mae: Option<f64>,
    pub rmse: Option<f64>,
    pub relmse: Option<f64>,
    /// Positive where the method is too bright.
    pub bias: Option<f64>,
    pub over: Option<f64>,
    pub under: Option<f64>,
    pub psnr_db: Option<f64>,
    pub flip: Option<f64>,
}

/// The figures of some part of the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorEstimate {
    pub pixels: usize,
    #[serde(flatten)]
    pub figures: Figures,
    /// From the reference's own noise. `null` where that is not known.
    pub standard_error: Figures,
    /// Root of the mean variance of the reference, W·m⁻².
    pub noise_rms: Option<f64>,
    /// Why not to rely on these figures; `null` where nothing speaks against them. "reference too noisy" where `noise_rms`
    /// exceeds `rmse`.
    pub verdict: Option<&'static str>,
}

/// The figures of a picture and of its regions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorReport {
    #[serde(flatten)]
    pub all: ErrorEstimate,
    pub by_region: ByRegion,
    /// ε of `relmse`, of the whole picture and its regions alike, W²·m⁻⁴.
    pub relmse_epsilon: f64,
    /// Peak of `psnr_db`, of the whole picture and its regions alike, W·m⁻².
    pub psnr_peak: f64,
    /// Pixels left out because picture or reference is not finite there.
    pub pixels_not_finite: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByRegion {
    pub corner: ErrorEstimate,
    pub flat: ErrorEstimate,
}

/// Sums over the pixels of a part.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    pixels: usize,
    bias: Pooled,
    absolute: Pooled,
    over: Pooled,
    under: Pooled,
    square: Pooled,
    relative: Pooled,
    fold: f64,
    /// What the corrections of relative squares may be wrong by; all of them where the noise is as large as what they are
    /// relative to.
    doubtful: f64,
    noise: f64,
}

/// Compares a picture's indirect irradiance with the reference's. `regions`: of every pixel, `None` where it shows no surface.
/// `flips`: figures of FLIP, where there are any.
///
/// # Panics
/// When `irradiance` or `regions` are not of the reference's size.
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
    let (epsilon, peak) = scale(reference, &mask);
    let peak_error = peak_error(reference, &mask, peak);
    let around = look_around(reference, irradiance, &mask);

    // The whole picture, corners, flat parts.
    let mut sums = [Sums::default(); 3];
    for i in (0..irradiance.len()).filter(|&i| mask[i]) {
        let part = if regions[i] == Some(Region::Corner) { 1 } else { 2 };
        for s in [0, part] {
            sums[s].add(reference, i, irradiance[i], around.as_ref().map(|a| &a[i]), epsilon);
        }
    }
    let finish = |part: usize| {
        let flip = flips.map(|f| f.parts[part]).unwrap_or_default();
        sums[part].finish(reference.noise.is_some(), epsilon, (peak, peak_error), flip)
    };
    ErrorReport {
        all: finish(0),
        by_region: ByRegion { corner: finish(1), flat: finish(2) },
        relmse_epsilon: epsilon,
        psnr_peak: peak,
        pixels_not_finite: (0..mask.len()).filter(|&i| regions[i].is_some() && !mask[i]).count(),
    }
}

/// The largest of many noisy values is so partly by chance: of 10⁴ equal ones by 3.7 deviations, of fewer candidates by
/// less.
const PEAK_SIGMAS: f64 = 3.0;

/// By how much the peak may be wrong: as many deviations of the pixel and channel that it was found in.
fn peak_error(reference: &ReferenceLayers, mask: &[bool], peak: f64) -> f64 {
    let Some(noise) = &reference.noise else { return 0.0 };
    let channels = (0..mask.len()).filter(|&i| mask[i]).flat_map(|i| [0, 1, 2].map(|c| (i, c)));
    let mut at_peak = channels.filter(|&(i, c)| f64::from(reference.irradiance[i][c]) == peak);
    at_peak.next().map_or(0.0, |(i, c)| PEAK_SIGMAS * noise.between(i, c, c).sqrt())
}

/// ε of `relmse` and the peak of `psnr_db`. The former is taken as exact: the noise of a mean over all pixels does not show
/// beside that of the figures.
fn scale(reference: &ReferenceLayers, mask: &[bool]) -> (f64, f64) {
    let (mut sum, mut count, mut peak) = (0.0, 0.0f64, 0.0f64);
    for (pixel, _) in reference.irradiance.iter().zip(mask).filter(|(_, used)| **used) {
        for channel in pixel.to_array().map(f64::from) {
            sum += channel;
            count += 1.0;
            peak = peak.max(channel);
        }
    }
    let mean = sum / count.max(1.0);
    (RELATIVE_FLOOR * mean * mean, peak)
}

/// What the pixels around one say, per channel.
#[derive(Debug, Clone, Copy)]
struct Around {
    /// Mean of d.
    difference: [f64; 3],
    /// Mean of v: that of a pixel is itself an estimate, from few blocks a poor one.
    variance: [f64; 3],
    /// Mean of r² − v, an estimate of t².
    square: [f64; 3],
}

/// Of every pixel; `None` where the noise is not known.
fn look_around(reference: &ReferenceLayers, irradiance: &[Vec3], mask: &[bool]) -> Option<Vec<Around>> {
    let noise = reference.noise.as_ref()?;
    let values = |i: usize| {
        let (r, e) = (reference.irradiance[i].as_dvec3(), irradiance[i].as_dvec3());
        let v = [0, 1, 2].map(|c| noise.between(i, c, c));
        let (d, t) = (e - r, [0, 1, 2].map(|c| r[c] * r[c] - v[c]));
        [d.x, d.y, d.z, v[0], v[1], v[2], t[0], t[1], t[2]]
    };
    let means = window_means(reference.width, reference.height, |i| mask[i], values);
    let three = |m: &[f64; 9], from: usize| [m[from], m[from + 1], m[from + 2]];
    Some(means.iter().map(|m| Around { difference: three(m, 0), variance: three(m, 3), square: three(m, 6) }).collect())
}

impl Sums {
    fn add(&mut self, reference: &ReferenceLayers, pixel: usize, value: Vec3, around: Option<&Around>, epsilon: f64) {
        let noise = reference.noise.as_ref().map(|n| (n, pixel));
        let r = reference.irradiance[pixel].to_array().map(f64::from);
        let d = [0, 1, 2].map(|c| f64::from(value[c]) - r[c]);
        let v = [0, 1, 2].map(|c| noise.map_or(0.0, |(n, i)| n.between(i, c, c)));
        let b = [0, 1, 2].map(|c| around.map_or(0.0, |a| fold(d[c], a.difference[c], a.variance[c])));
        let mut add = |to: fn(&mut Sums) -> &mut Pooled, term: &dyn Fn(usize) -> (f64, f64, f64)| {
            let t = [0, 1, 2].map(term);
            let terms = Terms { value: t.map(|t| t.0), first: t.map(|t| t.1), second: t.map(|t| t.2) };
            to(self).add(&terms, noise);
        };
        // 1 where d has that sign.
        let is = |yes: bool| if yes { 1.0 } else { 0.0 };
        add(|s| &mut s.bias, &|c| (d[c], -1.0, 0.0));
        add(|s| &mut s.absolute, &|c| (d[c].abs() - b[c], -d[c].signum(), 0.0));
        add(|s| &mut s.over, &|c| (d[c].max(0.0) - b[c] / 2.0, -is(d[c] > 0.0), 0.0));
        add(|s| &mut s.under, &|c| ((-d[c]).max(0.0) - b[c] / 2.0, is(d[c] < 0.0), 0.0));
        add(|s| &mut s.square, &|c| (d[c] * d[c] - v[c], -2.0 * d[c], 2.0));
        if epsilon > 0.0 {
            add(|s| &mut s.relative, &|c| relative_square(d[c], r[c], v[c], epsilon));
            for c in 0..3 {
                let known = around.is_none_or(|a| is_continued(a.variance[c], a.square[c], epsilon));
                let w = r[c] * r[c] + epsilon;
                self.doubtful += if v[c] == 0.0 {
                    0.0
                } else if known {
                    let corrected = relative_square(d[c], r[c], v[c], epsilon).0;
                    RELATIVE_UNCERTAINTY * (d[c] * d[c] / w - corrected).abs()
                } else {
                    (d[c] * d[c]).max(v[c]) / w
                };
            }
        }
        self.pixels += 1;
        self.fold += b.iter().sum::<f64>();
        self.noise += v.iter().sum::<f64>();
    }

    fn finish(
        &self,
        noise_known: bool,
        epsilon: f64,
        (peak, peak_error): (f64, f64),
        flip: flip::Flip,
    ) -> ErrorEstimate {
        if self.pixels == 0 {
            let (figures, standard_error) = Default::default();
            return ErrorEstimate { pixels: 0, figures, standard_error, noise_rms: None, verdict: None };
        }
        let samples = 3.0 * self.pixels as f64;
        let square = self.square.mean(samples).max(0.0);
        let square_error = self.square.variance(samples).sqrt();
        let rmse = square.sqrt();
        let relative = |value: f64| (epsilon > 0.0).then_some(value);
        let psnr = |value: f64| (square > 0.0 && peak > 0.0).then_some(value);
        let figures = Figures {
            mae: Some(self.absolute.mean(samples).max(0.0)),
            rmse: Some(rmse),
            relmse: relative(self.relative.mean(samples).max(0.0)),
            bias: Some(self.bias.mean(samples)),
            over: Some(self.over.mean(samples).max(0.0)),
            under: Some(self.under.mean(samples).max(0.0)),
            psnr_db: psnr(10.0 * (peak * peak / square).log10()),
            flip: flip.mean,
        };
        let known = |error: f64| noise_known.then_some(error);
        // What the correction for the fold may be wrong by is no noise: it does not fall with the number of pixels.
        let folded = FOLD_UNCERTAINTY * self.fold / samples;
        let error = |pooled: &Pooled, systematic: f64| known(pooled.variance(samples).sqrt().hypot(systematic));
        let standard_error = Figures {
            mae: error(&self.absolute, folded),
            rmse: known(root_error(rmse, square_error)),
            relmse: relative(0.0).and(error(&self.relative, self.doubtful / samples)),
            bias: error(&self.bias, 0.0),
            over: error(&self.over, folded / 2.0),
            under: error(&self.under, folded / 2.0),
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

/// Standard error of a root from that of its square, s: half the longer side of the interval that ± 2s of the square give. Where s
/// is small that is s/(2x), as by the delta method, which knows no bounds near x = 0.
fn root_error(root: f64, square_error: f64) -> f64 {
    let at = |sigmas: f64| (root * root + sigmas * square_error).max(0.0).sqrt();
    ((at(2.0) - root) / 2.0).max((root - at(-2.0)) / 2.0)
}
