//! The error at points other than those of a picture.

use glam::Vec3;

use super::pooled::Pooled;
use super::root_error;
use crate::math::color::luminance;
use crate::report::reference_layers::ReferenceNoise;
use crate::shade::point_truth::PointTruth;

/// Root mean square difference, all channels, ÷ the truth's mean luminance, free of the truth's noise; and its standard error,
/// `None` where the noise is not known. Nothing in the dark. Values that are not finite are left out.
pub fn error_at_points(irradiance: &[Vec3], truth: &PointTruth) -> Option<(f64, Option<f64>)> {
    let of_truth = |variance| ReferenceNoise { variance, covariance: None, blocks: Some(truth.blocks) };
    let noise = truth.variance.clone().map(of_truth);
    let (mut squares, mut sum, mut count) = (Pooled::default(), 0.0f64, 0.0f64);
    for (i, (e, t)) in irradiance.iter().zip(&truth.irradiance).enumerate().filter(|(_, (e, _))| e.is_finite()) {
        let of_channel = |c: usize| {
            let d = f64::from(e[c]) - f64::from(t[c]);
            (d * d - noise.as_ref().map_or(0.0, |noise| noise.between(i, c, c)), -2.0 * d, 2.0)
        };
        squares.add([0, 1, 2].map(of_channel), noise.as_ref().map(|noise| (noise, i)));
        sum += f64::from(luminance(*t));
        count += 1.0;
    }
    if sum <= 0.0 {
        return None;
    }
    let (mean, samples) = (sum / count, 3.0 * count);
    let rmse = squares.mean(samples).max(0.0).sqrt();
    // The mean over the points is known far better than the squares.
    let standard_error = || root_error(rmse, squares.variance(samples).sqrt()) / mean;
    Some((rmse / mean, noise.is_some().then(standard_error)))
}
