//! A figure as a mean over pixels and channels, with its variance from the noise of the reference.

use crate::report::reference_layers::ReferenceNoise;

/// The sum Σf of a figure f(r) over pixels and channels, and the variance of the sum. r is the reference with its
/// noise.
///
/// Let C be the covariance between two channels of a pixel. For normal noise, to second order, cov(f_a, f_b) =
/// f_a′·f_b′·C + ½·f_a″·f_b″·C², with derivatives at the true value of r. Only the measured value is known. Derivatives
/// there give on average f_a″·f_b″·C² too much, which is subtracted.
///
/// Example: for the squared error f = d² the derivatives are f′ = −2d and f″ = 2. The variance 4D²σ² + 2σ⁴, with D the
/// true difference, is estimated by 4d²σ² − 2σ⁴, which has the same expectation.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pooled {
    sum: f64,
    variance: f64,
    /// The variance for a difference of 0. The estimate must not fall below it.
    floor: f64,
}

impl Pooled {
    /// Adds a pixel. `terms` are the figure's value and its first two derivatives with respect to the reference, per
    /// channel. `noise` is the noise of the reference and the index of the pixel.
    #[inline]
    pub fn add(&mut self, terms: [(f64, f64, f64); 3], noise: Option<(&ReferenceNoise, usize)>) {
        self.sum += terms.iter().map(|term| term.0).sum::<f64>();
        let Some((noise, pixel)) = noise else { return };
        let square = square_share(noise.blocks);
        for a in 0..3 {
            for b in 0..3 {
                let covariance = noise.between(pixel, a, b);
                let second = terms[a].2 * terms[b].2 * covariance * covariance;
                self.variance += terms[a].1 * terms[b].1 * covariance - (1.0 - square) * second;
                self.floor += square * second;
            }
        }
    }

    /// The mean, if `samples` pixels × channels were added.
    pub fn mean(&self, samples: f64) -> f64 {
        self.sum / samples
    }

    /// The variance of the mean, if `samples` pixels × channels were added.
    pub fn variance(&self, samples: f64) -> f64 {
        self.variance.max(self.floor).max(0.0) / (samples * samples)
    }
}

/// The factor that replaces ½ in the term of second order if the variance v is itself an estimate from k blocks.
///
/// The corrected square d² − v contains the variance of v, 2v²/(k−1), so var(d² − v) = 4D²v + 2v²·k/(k−1). Also, E[v²]
/// is (k+1)/(k−1) times the square of the true variance. The combination 4(d²−v)v + a·v² has the right expectation for
/// a = (2k+8)/(k+1). This function returns a/4, which tends to ½ for many blocks.
fn square_share(blocks: Option<u32>) -> f64 {
    blocks.filter(|&k| k > 1).map_or(0.5, |k| {
        let k = f64::from(k);
        (2.0 * k + 8.0) / (k + 1.0) / 4.0
    })
}
