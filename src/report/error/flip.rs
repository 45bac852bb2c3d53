//! FLIP, the difference that an observer sees when flipping between two pictures (P. Andersson et al., "FLIP: A
//! Difference Evaluator for Alternating Images", HPG 2020). It is computed by its authors' code.
//!
//! The noise of the reference raises FLIP. FLIP is not smooth enough for a correction by derivatives, so a parametric
//! bootstrap finds the effect. A stand-in for the true picture gets noise like that of the reference: normal, with the
//! variance of each pixel. The mean shift of FLIP that this causes is subtracted from the figure.
//!
//! The reference itself cannot be the stand-in. Noise has the largest effect where there is no difference, and a noisy
//! reference differs from the picture everywhere. So the stand-in is the reference with its difference from the picture
//! shrunk, around each pixel, to the size that it has without noise ([`shrunk`]).
//!
//! The correction is not exact. In simulations (no difference, constants, ramps, steps, voxels; four references each)
//! the effect that remained was mostly smaller than the shift. The shift is therefore added to the standard error. An
//! exception are smooth differences under little noise: there the remaining effect was up to five times the shift,
//! which is 0.002 of FLIP.

use std::f32::consts::TAU;

use glam::Vec3;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};
use rayon::prelude::*;

use super::window::window_means;
use crate::image::{Picture, Picture8};
use crate::math::random::{Purpose, Random};
use crate::report::reference_layers::ReferenceLayers;
use crate::shade::regions::Region;

/// Number of replicates of the bootstrap. Eight determine their spread to about a quarter.
const REPLICATES: u64 = 8;

/// Mean of FLIP's map over one part of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flip {
    /// From 0 (no difference) to 1. `None` without pixels.
    pub mean: Option<f64>,
    /// `None` if the noise of the reference is not known.
    pub standard_error: Option<f64>,
}

/// FLIP of the three parts of a picture: all pixels (also those without a surface), the corners, and the flat parts.
pub type Flips = [Flip; 3];

/// FLIP between the beauty of the reference and `beauty`, both tone-mapped at this exposure.
///
/// # Panics
/// If `beauty` or `regions` have not the size of the reference.
pub fn measure(
    reference: &ReferenceLayers,
    beauty: &Picture,
    exposure_ev: f32,
    regions: &[Option<Region>],
    seed: u64,
) -> Flips {
    let shown = beauty.tonemapped(exposure_ev);
    let means = |other: &Picture| part_means(&flip_map(&other.tonemapped(exposure_ev), &shown), regions);
    let measured = means(&reference.beauty);
    let Some(variance) = &reference.beauty_variance else {
        return measured.map(|mean| Flip { mean, standard_error: None });
    };
    let stand_in = shrunk(&reference.beauty, beauty, variance);
    let without = means(&stand_in);
    let replicates = (0..REPLICATES).into_par_iter();
    let with: Vec<_> = replicates.map(|k| means(&noisier(&stand_in, variance, seed, k))).collect();
    let part = |part: usize| {
        let shifts = |without: f64| with.iter().filter_map(|m| m[part]).map(|m| m - without).collect::<Vec<f64>>();
        Some(corrected(measured[part]?, &shifts(without[part]?)))
    };
    [0, 1, 2].map(|i| part(i).unwrap_or_default())
}

/// The measured mean minus the mean shift. `shifts` holds the shift of each replicate.
fn corrected(measured: f64, shifts: &[f64]) -> Flip {
    let count = shifts.len() as f64;
    let shift = shifts.iter().sum::<f64>() / count;
    let scatter: f64 = shifts.iter().map(|s| (s - shift) * (s - shift)).sum();
    Flip {
        mean: Some((measured - shift).clamp(0.0, 1.0)),
        standard_error: Some((scatter / (count - 1.0)).sqrt().hypot(shift)),
    }
}

/// The reference with its difference d from `beauty` multiplied by √((Σd² − Σv)/Σd²), where v is the variance. Sums are
/// over the neighbourhood of each pixel.
fn shrunk(reference: &Picture, beauty: &Picture, variance: &[Vec3]) -> Picture {
    let difference = |i: usize| (beauty.pixels[i] - reference.pixels[i]).as_dvec3();
    let usable = |i: usize| difference(i).is_finite() && variance[i].is_finite();
    let powers = window_means(reference.width, reference.height, usable, |i| {
        let (d, v) = (difference(i), variance[i].as_dvec3());
        [d.x * d.x, d.y * d.y, d.z * d.z, v.x, v.y, v.z]
    });
    let pixel = |i: usize| {
        let kept = Vec3::from_array([0, 1, 2].map(|c| {
            let (all, noise) = (powers[i][c], powers[i][c + 3].max(0.0));
            if all > noise { ((all - noise) / all).sqrt() as f32 } else { 0.0 }
        }));
        if usable(i) { beauty.pixels[i] - kept * difference(i).as_vec3() } else { reference.pixels[i] }
    };
    Picture::from_pixels(reference.width, reference.height, (0..reference.pixels.len()).map(pixel).collect())
}

/// FLIP of every pixel, row 0 at the top.
///
/// # Panics
/// If the pictures differ in size.
pub fn flip_map(reference: &Picture8, shown: &Picture8) -> Vec<f32> {
    let image = |p: &Picture8| FlipImageRgb8::with_data(p.width, p.height, p.pixels.as_flattened());
    nv_flip::flip(image(reference), image(shown), DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

/// Means of a map over the parts of [`Flips`].
fn part_means(map: &[f32], regions: &[Option<Region>]) -> [Option<f64>; 3] {
    assert_eq!(map.len(), regions.len(), "pixels of the regions");
    let mut sums = [(0.0, 0.0f64); 3];
    for (value, region) in map.iter().zip(regions) {
        let part = region.map(|region| if region == Region::Corner { 1 } else { 2 });
        for part in std::iter::once(0).chain(part) {
            sums[part].0 += f64::from(*value);
            sums[part].1 += 1.0;
        }
    }
    sums.map(|(sum, count)| (count > 0.0).then(|| sum / count))
}

/// The picture plus normal noise of this variance. All channels of a pixel deviate by the same number of standard
/// deviations, because the same paths give all three.
fn noisier(picture: &Picture, variance: &[Vec3], seed: u64, replicate: u64) -> Picture {
    let disturbed = |(i, pixel): (usize, &Vec3)| {
        let mut random = Random::new(seed, Purpose::FlipReplicate, i as u64, replicate);
        let deviation = variance[i].max(Vec3::ZERO).map(f32::sqrt);
        // A pixel whose variance is not finite stays unchanged.
        let noise = deviation * standard_normal(&mut random);
        if noise.is_finite() { *pixel + noise } else { *pixel }
    };
    let pixels = picture.pixels.iter().enumerate().map(disturbed).collect();
    Picture::from_pixels(picture.width, picture.height, pixels)
}

/// A standard normal number (G. E. P. Box & M. E. Muller 1958).
fn standard_normal(random: &mut Random) -> f32 {
    // In (0, 1]: the logarithm of 0 would be infinite.
    let radius = (-2.0 * (1.0 - random.uniform()).ln()).sqrt();
    radius * (TAU * random.uniform()).cos()
}
