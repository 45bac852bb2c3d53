//! A pair of pictures as text in the page: radiance within 1 % a channel, differences as fine as the heat map shows them.
//!
//! Planes of a picture's codes: G, R − G, B − G (the logarithm of chroma is the same over a lit surface); the candidate's may be
//! stored as differences from the base's, where that is smaller.

use std::io;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::codes::{code_of_difference, code_of_display, code_of_radiance, difference_scale};
use super::data::PairPixels;
use super::pack::{cost, pack};
use super::shrink::{PixelExtent, mean_of_blocks, peak_of_blocks};
use crate::image::Picture;

/// Most pixels that a browser is asked to hold of one picture: 2560 × 1440 fits.
pub const MOST_PIXELS: usize = 1 << 22;

/// A pair of pictures, packed.
#[derive(Debug, Clone, Serialize)]
pub struct Embedded {
    /// How many pixels, along each side, became one.
    pub factor: u32,
    #[serde(flatten)]
    pub size: PixelExtent,
    pub base: String,
    pub candidate: String,
    /// Whether `candidate` holds differences from `base`.
    pub is_candidate_relative: bool,
    pub difference: String,
    /// [`difference_scale`] of the heat map's range.
    pub scale: f64,
}

impl Embedded {
    /// Packs a pair with blocks of `factor` × `factor` pixels as one.
    ///
    /// # Errors
    /// Those of [`pack`].
    pub fn new(pair: &PairPixels<'_>, range: f32, factor: u32) -> io::Result<Embedded> {
        let whole = pair.size();
        let size = whole.shrunk(factor);
        let scale = difference_scale(f64::from(range));
        let code = if pair.exposure_ev.is_some() { code_of_radiance } else { code_of_display };
        let planes = |picture: &Picture| planes_of(&mean_of_blocks(&picture.pixels, whole, factor), code);
        let [base, candidate] = [planes(pair.base), planes(pair.candidate)];
        let difference = || {
            let values = peak_of_blocks(pair.difference, whole, factor);
            vec![values.into_par_iter().map(|value| code_of_difference(f64::from(value), scale)).collect()]
        };
        let width = size.width as usize;
        let relative: Vec<Vec<i16>> = candidate.iter().zip(&base).map(|(plane, from)| minus(plane, from)).collect();
        let (of_relative, of_absolute) = rayon::join(|| cost(&relative, width), || cost(&candidate, width));
        let is_candidate_relative = of_relative < of_absolute;
        let candidate = if is_candidate_relative { relative } else { candidate };
        let (base, (candidate, difference)) = rayon::join(
            || pack(&base, width),
            || rayon::join(|| pack(&candidate, width), || pack(&difference(), width)),
        );
        let (base, candidate, difference) = (base?, candidate?, difference?);
        Ok(Embedded { factor, size, base, candidate, is_candidate_relative, difference, scale })
    }

    /// What it takes of the page, in bytes.
    pub fn size_bytes(&self) -> usize {
        self.base.len() + self.candidate.len() + self.difference.len()
    }
}

/// The codes of a picture in three planes.
fn planes_of(pixels: &[Vec3], code: fn(f32) -> i16) -> Vec<Vec<i16>> {
    let channel = |c: usize| -> Vec<i16> { pixels.par_iter().map(|pixel| code(pixel[c])).collect() };
    let [red, green, blue] = [0, 1, 2].map(channel);
    let (red, blue) = (minus(&red, &green), minus(&blue, &green));
    vec![green, red, blue]
}

/// A plane as differences from another one.
fn minus(plane: &[i16], from: &[i16]) -> Vec<i16> {
    plane.iter().zip(from).map(|(a, b)| a.wrapping_sub(*b)).collect()
}

/// The smallest power of two that leaves few enough pixels for a browser.
pub fn finest_factor(size: PixelExtent) -> u32 {
    let mut factors = (0..31).map(|power| 1 << power);
    factors.find(|factor| size.shrunk(*factor).pixels() <= MOST_PIXELS).unwrap_or(1 << 31)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::math::color::luminance;
    use crate::report::page::codes::{difference_of_code, radiance_of_code};
    use crate::report::page::pack::unpack;

    /// Planes of one picture.
    const CHANNELS: usize = 3;

    /// What the page's script makes of the texts: base and candidate, and the differences.
    pub fn decode(embedded: &Embedded) -> ([Vec<[i16; 3]>; 2], Vec<f64>) {
        let PixelExtent { width, height } = embedded.size;
        let open = |text: &str, count| unpack(text, count, width as usize, height as usize).unwrap();
        let base = open(&embedded.base, CHANNELS);
        let mut candidate = open(&embedded.candidate, CHANNELS);
        if embedded.is_candidate_relative {
            for (plane, base) in candidate.iter_mut().zip(&base) {
                plane.iter_mut().zip(base).for_each(|(code, base)| *code = code.wrapping_add(*base));
            }
        }
        let pixels = |planes: &[Vec<i16>]| {
            let pixel = |i: usize| {
                let green = planes[0][i];
                [planes[1][i].wrapping_add(green), green, planes[2][i].wrapping_add(green)]
            };
            (0..embedded.size.pixels()).map(pixel).collect::<Vec<_>>()
        };
        let difference =
            open(&embedded.difference, 1)[0].iter().map(|&code| difference_of_code(code, embedded.scale)).collect();
        ([pixels(&base), pixels(&candidate)], difference)
    }

    /// Base and candidate with many magnitudes, zeros, negatives and what is no light.
    pub fn pictures(width: u32, height: u32) -> [Picture; 2] {
        let side = |turn: f32| {
            let pixel = |i: u32| {
                let (x, y) = ((i % width) as f32, (i / width) as f32);
                let magnitude = ((0.31 * x + turn).sin() * 9.0 - 0.2 * y).exp2();
                Vec3::new(magnitude, 0.7 * magnitude + 0.01, if i.is_multiple_of(11) { 0.0 } else { 0.2 * magnitude })
            };
            Picture::from_pixels(width, height, (0..width * height).map(pixel).collect())
        };
        let (base, mut candidate) = (side(0.0), side(0.05));
        candidate.pixels[5] = Vec3::new(f32::NAN, f32::INFINITY, -3.0);
        [base, candidate]
    }

    pub fn differences([base, candidate]: &[Picture; 2]) -> Vec<f32> {
        base.pixels.iter().zip(&candidate.pixels).map(|(b, c)| luminance(*c - *b)).collect()
    }

    pub fn pair<'a>([base, candidate]: &'a [Picture; 2], difference: &'a [f32]) -> PairPixels<'a> {
        let (name, unit, exposure_ev) = ("lit/visibility_on", "W·m⁻²·sr⁻¹", Some(0.5));
        PairPixels { name, unit, base, candidate, difference, exposure_ev, is_judged: true }
    }

    #[test]
    fn every_channel_comes_back_within_a_percent() {
        let pictures = pictures(37, 23);
        let difference = differences(&pictures);
        let embedded = Embedded::new(&pair(&pictures, &difference), 2.0, 1).unwrap();
        let ([base, candidate], shown) = decode(&embedded);
        for (picture, codes) in pictures.iter().zip([base, candidate]) {
            for (pixel, codes) in picture.pixels.iter().zip(codes) {
                for c in 0..3 {
                    let (value, back) = (f64::from(pixel[c]), radiance_of_code(codes[c]));
                    let same = value == back || (value.is_nan() && back.is_nan());
                    assert!(same || (back - value).abs() <= 0.01 * value.abs(), "{value} gave {back}");
                }
            }
        }
        for (value, back) in difference.iter().map(|&d| f64::from(d)).zip(shown) {
            if value.is_finite() {
                assert!((back - value).abs() <= 2.0 / 512.0 + 0.01 * value.abs(), "{value} gave {back}");
            } else {
                assert!(back.is_nan());
            }
        }
    }

    #[test]
    fn what_is_equal_costs_next_to_nothing() {
        let [base, _] = pictures(64, 64);
        let pictures = [base.clone(), base];
        let embedded = Embedded::new(&pair(&pictures, &differences(&pictures)), 1.0, 1).unwrap();
        assert!(embedded.is_candidate_relative);
        assert!(embedded.candidate.len() + embedded.difference.len() < embedded.base.len() / 20);
    }

    #[test]
    fn display_values_come_back_exactly() {
        let base = Picture::from_pixels(8, 8, (0..64).map(|i| Vec3::splat(i as f32 * 4.0 / 255.0)).collect());
        let pictures = [base.clone(), base];
        let difference = differences(&pictures);
        let shown = PairPixels { exposure_ev: None, ..pair(&pictures, &difference) };
        let ([base, _], _) = decode(&Embedded::new(&shown, 1.0, 1).unwrap());
        assert!(base.iter().enumerate().all(|(i, code)| *code == [i as i16 * 4; 3]));
    }

    #[test]
    fn too_large_a_picture_is_shrunk() {
        assert_eq!(finest_factor(PixelExtent { width: 1920, height: 1080 }), 1);
        assert_eq!(finest_factor(PixelExtent { width: 7680, height: 4320 }), 4);
        let pictures = pictures(9, 7);
        let embedded = Embedded::new(&pair(&pictures, &differences(&pictures)), 1.0, 2).unwrap();
        assert_eq!((embedded.factor, embedded.size), (2, PixelExtent { width: 5, height: 4 }));
        assert_eq!(decode(&embedded).1.len(), 20);
    }
}
