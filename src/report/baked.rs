//! The error of the probes themselves, without the error of interpolation: the stored irradiance of each probe against
//! the irradiance that full paths give at the same probe.

use glam::Vec3A;
use serde::{Deserialize, Serialize};

use super::error::terms::fold;
use crate::math::color::luminance;
use crate::math::statistics::Moments;
use crate::probe::Volume;
use crate::probe::transport::truth::Truth;

/// Errors of the stored irradiance E as shares of ΣE_path. Sums are over the luminance of all texels of active probes,
/// weighted by solid angle. `null` if ΣE_path is 0.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BakedFigures {
    /// Σ(E − E_path). Positive if the bake is too bright.
    pub bias: Option<f64>,
    /// Σ max(0, E − E_path): light that leaked into probes, and any other excess.
    pub light: Option<f64>,
    /// Σ max(0, E_path − E): light that is missing from the bake.
    pub dark: Option<f64>,
}

/// The errors of the probes of a file, with their uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakedReport {
    #[serde(flatten)]
    pub figures: BakedFigures,
    /// From the spread between independent runs of the path-traced truth (jackknife).
    pub standard_error: BakedFigures,
    /// Paths from every captured hit, summed over the runs.
    pub paths_per_hit: u64,
    pub time_s: f64,
}

/// Why there are no figures of probes whose values were fitted.
pub const FITTED: &str = "the probes hold fitted values, which are not the light where they stand; bake with --set fit=none to \
                          measure it";

/// Compares `volume` with the path-traced truth at its probes. Returns the figures and their standard errors. Noise of
/// the truth would raise `light` and `dark`; this is corrected to first order ([`fold`]).
pub fn measure(volume: &Volume, truth: &Truth) -> (BakedFigures, BakedFigures) {
    let runs = truth.runs.len();
    let all = figures(volume, truth, None);
    let left_out: Vec<BakedFigures> = (0..runs).map(|run| figures(volume, truth, Some(run))).collect();
    // Efron's jackknife: (n − 1)/n · Σ(θ₋ᵢ − mean)².
    let error = |of: fn(&BakedFigures) -> Option<f64>| {
        let moments: Moments = left_out.iter().map(of).collect::<Option<_>>()?;
        Some((moments.variance() * (runs - 1) as f64).sqrt())
    };
    (all, BakedFigures { bias: error(|f| f.bias), light: error(|f| f.light), dark: error(|f| f.dark) })
}

/// The figures against the mean of all runs of the truth except the run `without`.
fn figures(volume: &Volume, truth: &Truth, without: Option<usize>) -> BakedFigures {
    let axes = volume.irradiance.axes();
    let used: Vec<usize> = (0..truth.runs.len()).filter(|&run| Some(run) != without).collect();
    let n = used.len() as f64;
    let (mut difference, mut over, mut under, mut total) = (0.0, 0.0f64, 0.0f64, 0.0);
    for p in 0..volume.states.len() {
        let seen = |unknowns: &[Vec3A]| volume.irradiance.along_axes(unknowns).into_owned();
        let of_runs: Vec<Vec<Vec3A>> = used.iter().map(|&run| seen(&truth.runs[run][p])).collect();
        let texels = of_runs.first().map_or(0, Vec::len);
        let of_volume: Vec<Vec3A> = volume.irradiance.probe(p).map(Vec3A::from).collect();
        // Per texel: solid angle, difference, variance of the truth's mean.
        let mut found = Vec::with_capacity(texels);
        for (o, &stored) in seen(&of_volume).iter().take(texels).enumerate() {
            let weight = f64::from(axes[o].1);
            let of = |e: Vec3A| f64::from(luminance(e.into()));
            let mean = of_runs.iter().map(|run| of(run[o])).sum::<f64>() / n;
            let spread = of_runs.iter().map(|run| (of(run[o]) - mean).powi(2)).sum::<f64>();
            found.push((weight, of(stored) - mean, spread / (n * (n - 1.0))));
            total += weight * mean;
        }
        // Mean squared difference without noise, from all texels of the probe. A single texel would be too noisy.
        let size = found.iter().map(|(_, d, v)| d * d - v).sum::<f64>() / texels.max(1) as f64;
        for (weight, d, v) in found {
            let folded = fold(d, size.max(0.0).sqrt(), v) / 2.0;
            difference += weight * d;
            over += weight * (d.max(0.0) - folded);
            under += weight * ((-d).max(0.0) - folded);
        }
    }
    let share = |sum: f64| (total > 0.0).then(|| sum / total);
    BakedFigures { bias: share(difference), light: share(over.max(0.0)), dark: share(under.max(0.0)) }
}
