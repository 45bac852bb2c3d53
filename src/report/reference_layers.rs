//! A reference picture as the figures need it: what light there is, and how well the reference itself knows it.

use glam::Vec3;
use thiserror::Error;

use crate::image::{LayeredImage, Picture};
use crate::math::color::luminance;

/// The layers that a picture must have to serve as a reference.
const IRRADIANCE: &str = "irradiance_indirect";
const BEAUTY: &str = "beauty";

/// What surfaces reflect as gloss, where a reference is of glossy transport, and its variance.
const GLOSSY: &str = "glossy";
const GLOSSY_VARIANCE: &str = "glossy_variance";

/// Layers with the variance of the pixel's mean, per channel; absent where it is not known.
const IRRADIANCE_VARIANCE: &str = "irradiance_indirect_variance";
const BEAUTY_VARIANCE: &str = "beauty_variance";

/// Covariances of the channels' means: red and green, green and blue, blue and red. Absent where they are not known.
const IRRADIANCE_COVARIANCE: &str = "irradiance_indirect_covariance";

#[derive(Debug, Error, PartialEq, Eq)]
pub enum ReferenceError {
    #[error(
        "it has {0} × {1} pixels, the pictures have {2} × {3}; give --size {0}x{1} or another file",
        found.0, found.1, wanted.0, wanted.1
    )]
    Size { found: (u32, u32), wanted: (u32, u32) },
    #[error("it has no layer '{layer}', only {found}; make it with `lightprobe reference`")]
    MissingLayer { layer: &'static str, found: String },
    #[error("no pixel of its layer '{IRRADIANCE}' is finite and not negative; make it with `lightprobe reference`")]
    NoIrradiance,
}

/// What the reference says about its own noise.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceNoise {
    /// Variance of the pixel's mean, per channel, W²·m⁻⁴.
    pub variance: Vec<Vec3>,
    /// Between red and green, green and blue, blue and red, W²·m⁻⁴. Where it is not known the channels are taken as fully
    /// correlated, because a path carries all three: error bars are then too long rather than too short.
    pub covariance: Option<Vec<Vec3>>,
    /// Number of independent sums that the variance was estimated from; where not known, as if it were large.
    pub blocks: Option<u32>,
}

/// A reference of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceLayers {
    pub width: u32,
    pub height: u32,
    /// Indirect irradiance, W·m⁻².
    pub irradiance: Vec<Vec3>,
    /// Of the irradiance; `None` where it is not known.
    pub noise: Option<ReferenceNoise>,
    pub beauty: Picture,
    /// Of the pixel's mean, per channel; `None` where it is not known.
    pub beauty_variance: Option<Vec<Vec3>>,
}

impl ReferenceLayers {
    /// Takes the layers from a picture that must have this size. `blocks`: see [`ReferenceNoise::blocks`].
    pub fn new(
        image: &LayeredImage,
        wanted: (u32, u32),
        blocks: Option<u32>,
    ) -> Result<ReferenceLayers, ReferenceError> {
        let found = (image.width, image.height);
        if found != wanted {
            return Err(ReferenceError::Size { found, wanted });
        }
        let missing = |layer| {
            let found = image.names().collect::<Vec<_>>().join(", ");
            ReferenceError::MissingLayer { layer, found }
        };
        let layer = |name: &str| image.layer(name).map(<[Vec3]>::to_vec);
        let usable = |e: &Vec3| e.is_finite() && e.cmpge(Vec3::ZERO).all();
        if image.layer(IRRADIANCE).is_some_and(|irradiance| !irradiance.iter().any(usable)) {
            return Err(ReferenceError::NoIrradiance);
        }
        let noise = layer(IRRADIANCE_VARIANCE).map(|variance| ReferenceNoise {
            variance,
            covariance: layer(IRRADIANCE_COVARIANCE),
            blocks,
        });
        Ok(ReferenceLayers {
            width: image.width,
            height: image.height,
            irradiance: layer(IRRADIANCE).ok_or_else(|| missing(IRRADIANCE))?,
            noise,
            beauty: image.picture(BEAUTY).ok_or_else(|| missing(BEAUTY))?,
            beauty_variance: layer(BEAUTY_VARIANCE),
        })
    }

    /// The same of the radiance that surfaces reflect as gloss, W·m⁻²·sr⁻¹, in place of irradiance; `None` where the picture
    /// does not hold it.
    pub fn of_glossy(image: &LayeredImage, blocks: Option<u32>) -> Option<ReferenceLayers> {
        let layer = |name: &str| image.layer(name).map(<[Vec3]>::to_vec);
        Some(ReferenceLayers {
            width: image.width,
            height: image.height,
            irradiance: layer(GLOSSY)?,
            noise: layer(GLOSSY_VARIANCE).map(|variance| ReferenceNoise { variance, covariance: None, blocks }),
            beauty: image.picture(BEAUTY)?,
            beauty_variance: None,
        })
    }

    /// Mean over these pixels of the luminance of the irradiance, W·m⁻², and of its standard error; `None` without
    /// pixels, the second also where the noise is not known.
    pub fn means(&self, shown: impl Fn(usize) -> bool) -> (Option<f64>, Option<f64>) {
        let pixels: Vec<usize> = (0..self.irradiance.len()).filter(|&i| shown(i)).collect();
        let mean = |value: &dyn Fn(usize) -> f64| {
            (!pixels.is_empty()).then(|| pixels.iter().map(|&i| value(i)).sum::<f64>() / pixels.len() as f64)
        };
        let light = mean(&|i| f64::from(luminance(self.irradiance[i])));
        let error = self.noise.as_ref().and_then(|noise| mean(&|i| noise.luminance_variance(i).sqrt()));
        (light, error)
    }

    /// Whether the reference says something usable about a pixel.
    pub fn is_finite(&self, pixel: usize) -> bool {
        self.irradiance[pixel].is_finite() && self.noise.as_ref().is_none_or(|n| n.is_finite(pixel))
    }
}

impl ReferenceNoise {
    /// Covariance of two channels of a pixel.
    #[inline]
    pub fn between(&self, pixel: usize, a: usize, b: usize) -> f64 {
        let variance = |c: usize| f64::from(self.variance[pixel][c]).max(0.0);
        if a == b {
            return variance(a);
        }
        // At most what full correlation gives: files may say anything.
        let most = (variance(a) * variance(b)).sqrt();
        // Red–green, green–blue, blue–red by the channel that the pair starts with.
        let first = if (a + 1) % 3 == b { a } else { b };
        self.covariance.as_ref().map_or(most, |covariance| f64::from(covariance[pixel][first]).clamp(-most, most))
    }

    /// Variance of the pixel's luminance.
    pub fn luminance_variance(&self, pixel: usize) -> f64 {
        let weights = [0, 1, 2].map(|c| f64::from(luminance(Vec3::AXES[c])));
        let pairs = (0..9).map(|k| (k / 3, k % 3));
        pairs.map(|(a, b)| weights[a] * weights[b] * self.between(pixel, a, b)).sum::<f64>().max(0.0)
    }

    fn is_finite(&self, pixel: usize) -> bool {
        let known = self.covariance.as_ref().is_none_or(|c| c[pixel].is_finite());
        known && self.variance[pixel].is_finite()
    }
}
