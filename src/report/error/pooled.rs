//! A figure as a mean over pixels and channels, and what the reference's noise does to it.

use crate::report::reference_layers::ReferenceNoise;

/// Pixels × channels of a figure f(r), r being the reference with its noise: Σf, and the variance of that sum.
///
/// To second order in the noise, for normal noise with the covariance C between two channels of a pixel,
/// cov(f_a, f_b) = f_a′·f_b′·C + ½·f_a″·f_b″·C² with the derivatives at the true value. Those at the measured one give on
/// average a term f_a″·f_b″·C² too much, which is taken away again: for the squared error f = d², where f′ = −2d and f″ = 2,
/// the variance 4D²σ² + 2σ⁴ becomes 4d²σ² − 2σ⁴, whose expectation it is.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pooled {
    sum: f64,
    variance: f64,
    /// What is left of the variance where the difference is 0: the estimate must not fall below it.
    floor: f64,
}

/// Value and first two derivatives of a figure in the reference, per channel of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Terms {
    pub value: [f64; 3],
    pub first: [f64; 3],
    pub second: [f64; 3],
}

impl Pooled {
    /// Adds a pixel. `noise` is that of the reference, and the pixel's place in it.
    #[inline]
    pub fn add(&mut self, terms: &Terms, noise: Option<(&ReferenceNoise, usize)>) {
        self.sum += terms.value.iter().sum::<f64>();
        let Some((noise, pixel)) = noise else { return };
        let square = square_share(noise.blocks);
        for a in 0..3 {
            for b in 0..3 {
                let covariance = noise.between(pixel, a, b);
                let second = terms.second[a] * terms.second[b] * covariance * covariance;
                self.variance += terms.first[a] * terms.first[b] * covariance - (1.0 - square) * second;
                self.floor += square * second;
            }
        }
    }

    /// The mean over so many samples.
    pub fn mean(&self, samples: f64) -> f64 {
        self.sum / samples
    }

    /// The variance of the mean over so many samples.
    pub fn variance(&self, samples: f64) -> f64 {
        self.variance.max(self.floor).max(0.0) / (samples * samples)
    }
}

/// What takes the place of ½ in the term of second order where the variance v is itself an estimate from k blocks.
///
/// Subtracting it from d² adds its own variance, 2v²/(k−1), so that var(d² − v) = 4D²v + 2v²·k/(k−1); and E[v²] is
/// (k+1)/(k−1) times the true square. The combination 4(d²−v)v + a·v² has the right expectation for a = (2k+8)/(k+1);
/// here a/4, which is ½ for many blocks.
fn square_share(blocks: Option<u32>) -> f64 {
    blocks.filter(|&k| k > 1).map_or(0.5, |k| {
        let k = f64::from(k);
        (2.0 * k + 8.0) / (k + 1.0) / 4.0
    })
}
