//! Noise and bias of a configuration, from several bakes with different seeds.
//!
//! e_s: a pixel's irradiance with seed s of n, r the reference's, v its variance, m the mean of e_s. Per channel,
//!
//! * noise² = Σ(e_s − m)²/(n − 1): what one bake scatters around the mean of all;
//! * bias² = (m − r)² − noise²/n − v: what no number of seeds takes away, freed from what is left of the scatter in m and from the
//!   reference's own noise.
//!
//! Both are averaged over all channels of all pixels that show a surface, as in [`crate::report::error`], and only then their roots
//! taken: noise² + bias² is so the expectation of a run's `rmse`².

use glam::{DVec3, Vec3};

use crate::report::reference_layers::ReferenceLayers;
use crate::shade::regions::Region;

/// Pictures of one configuration, accumulated (Welford's update).
#[derive(Debug, Clone, PartialEq)]
pub struct SeedScatter {
    count: u32,
    mean: Vec<DVec3>,
    /// Σ(e − mean)².
    scatter: Vec<DVec3>,
}

/// W·m⁻².
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Split {
    /// `None` below two seeds, and without pixels.
    pub noise_rms: Option<f64>,
    /// As `noise_rms`; 0 where the estimate of its square is negative.
    pub bias_rms: Option<f64>,
}

impl Split {
    /// Of several grids: roots of the mean squares.
    pub fn pooled(splits: &[Split]) -> Split {
        let root = |of: fn(&Split) -> Option<f64>| {
            let squares: Option<Vec<f64>> = splits.iter().map(|split| of(split).map(|x| x * x)).collect();
            let squares = squares.filter(|squares| !squares.is_empty())?;
            Some((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
        };
        Split { noise_rms: root(|split| split.noise_rms), bias_rms: root(|split| split.bias_rms) }
    }

    /// Which of the two is larger.
    pub fn ruled_by(&self) -> Option<&'static str> {
        let (noise, bias) = (self.noise_rms?, self.bias_rms?);
        Some(if noise > bias { "noise" } else { "bias" })
    }
}

impl SeedScatter {
    pub fn new(pixels: usize) -> SeedScatter {
        SeedScatter { count: 0, mean: vec![DVec3::ZERO; pixels], scatter: vec![DVec3::ZERO; pixels] }
    }

    /// # Panics
    /// When the picture has another number of pixels.
    pub fn add(&mut self, irradiance: &[Vec3]) {
        assert_eq!(irradiance.len(), self.mean.len(), "pixels of the picture");
        self.count += 1;
        let n = f64::from(self.count);
        for ((mean, scatter), e) in self.mean.iter_mut().zip(&mut self.scatter).zip(irradiance) {
            let delta = e.as_dvec3() - *mean;
            *mean += delta / n;
            *scatter += delta * (e.as_dvec3() - *mean);
        }
    }

    /// # Panics
    /// When reference or regions have another number of pixels.
    pub fn split(&self, reference: &ReferenceLayers, regions: &[Option<Region>]) -> Split {
        assert_eq!(reference.irradiance.len(), self.mean.len(), "pixels of the reference");
        assert_eq!(regions.len(), self.mean.len(), "pixels of the regions");
        if self.count < 2 {
            return Split::default();
        }
        let n = f64::from(self.count);
        let (mut noise, mut bias, mut channels) = (0.0, 0.0, 0.0f64);
        let used = |i: &usize| regions[*i].is_some() && self.mean[*i].is_finite() && reference.is_finite(*i);
        for i in (0..self.mean.len()).filter(used) {
            let difference = self.mean[i] - reference.irradiance[i].as_dvec3();
            let of_reference = reference.noise.as_ref().map_or(0.0, |v| (0..3).map(|c| v.between(i, c, c)).sum());
            let of_seeds = self.scatter[i].element_sum() / (n - 1.0);
            noise += of_seeds;
            bias += difference.length_squared() - of_seeds / n - of_reference;
            channels += 3.0;
        }
        let root = |sum: f64| (channels > 0.0).then(|| (sum / channels).max(0.0).sqrt());
        Split { noise_rms: root(noise), bias_rms: root(bias) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Picture;
    use crate::math::random::{Purpose, Random};
    use crate::report::reference_layers::ReferenceNoise;

    const PIXELS: usize = 4096;

    fn reference(noise: Option<f32>) -> ReferenceLayers {
        ReferenceLayers {
            width: PIXELS as u32,
            height: 1,
            irradiance: vec![Vec3::splat(2.0); PIXELS],
            noise: noise.map(|v| ReferenceNoise {
                variance: vec![Vec3::splat(v); PIXELS],
                covariance: None,
                blocks: None,
            }),
            beauty: Picture::new(PIXELS as u32, 1),
            beauty_variance: None,
        }
    }

    #[test]
    fn several_grids_are_pooled_in_squares() {
        let split = |noise, bias| Split { noise_rms: Some(noise), bias_rms: Some(bias) };
        assert_eq!(Split::pooled(&[split(3.0, 1.0)]), split(3.0, 1.0));
        assert_eq!(Split::pooled(&[split(1.0, 0.0), split(7.0, 0.0)]), split(5.0, 0.0));
        assert_eq!(Split::pooled(&[split(1.0, 0.0), Split::default()]), Split::default());
        assert_eq!(Split::pooled(&[]), Split::default());
    }

    const REGIONS: [Option<Region>; PIXELS] = [Some(Region::Flat); PIXELS];

    /// Two pictures at 2 + b ± a: the scatter is 2a², so noise = a√2, and (m − r)² − noise²/2 = b² − a².
    #[test]
    fn two_pictures_have_the_closed_form() {
        let mut spread = SeedScatter::new(PIXELS);
        let (a, b) = (0.25f32, 0.5f32);
        spread.add(&vec![Vec3::splat(2.0 + b + a); PIXELS]);
        assert_eq!(spread.split(&reference(None), &REGIONS), Split::default());
        spread.add(&vec![Vec3::splat(2.0 + b - a); PIXELS]);
        let split = spread.split(&reference(None), &REGIONS);
        assert!((split.noise_rms.unwrap() - f64::from(a) * 2f64.sqrt()).abs() < 1e-12, "{split:?}");
        assert!((split.bias_rms.unwrap() - f64::from(b * b - a * a).sqrt()).abs() < 1e-12, "{split:?}");
        // A variance of the reference that explains the rest leaves no bias.
        assert_eq!(spread.split(&reference(Some(1.0)), &REGIONS).bias_rms, Some(0.0));
        assert_eq!(spread.split(&reference(None), &[None; PIXELS]), Split::default());
    }

    /// Uniform noise of deviation s and a bias b come back within what so many pixels leave open.
    #[test]
    fn noise_and_bias_are_told_apart() {
        for (width, b) in [(0.6f32, 0.05f32), (0.06, 0.4), (0.3, 0.0)] {
            let mut spread = SeedScatter::new(PIXELS);
            for seed in 0..4 {
                let pixel = |i: usize| {
                    let mut random = Random::new(seed, Purpose::Pixel, i as u64, 0);
                    Vec3::splat(2.0 + b) + width * (Vec3::from([(); 3].map(|()| random.uniform())) - 0.5)
                };
                spread.add(&(0..PIXELS).map(pixel).collect::<Vec<_>>());
            }
            let split = spread.split(&reference(None), &REGIONS);
            let s = f64::from(width) / 12f64.sqrt();
            // 3 · 4096 channels of 3 degrees of freedom: variances to 1 % (one deviation, less for a uniform law); five of them.
            assert!((split.noise_rms.unwrap() / s - 1.0).abs() < 0.05, "{split:?}");
            // (m − r)² has the deviation 2bs/√(4·12288) + s²/4·√(2/12288) around b²; five of them.
            let (b, c) = (f64::from(b), 12_288f64);
            let slack = 5.0 * (2.0 * b * s / (4.0 * c).sqrt() + s * s / 4.0 * (2.0 / c).sqrt()) + 1e-6;
            assert!((split.bias_rms.unwrap().powi(2) - b * b).abs() < slack, "{split:?} {b}");
            assert_eq!(split.ruled_by(), Some(if s > b { "noise" } else { "bias" }));
        }
    }
}
