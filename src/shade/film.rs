//! What the reference accumulates: per pixel the mean of every quantity over blocks of samples, and for those whose
//! error is wanted the spread of the blocks' means.
//!
//! Blocks are independent of each other ([`crate::math::blocks`]), so the variance of a mean over n of them is
//! Σ(x − mean)²/(n(n − 1)); Welford's update keeps it from cancelling. Everything is f64 and every pixel adds its blocks
//! in their order: a run that is continued ends with the bits of a run that was not.
//!
//! Layout: pixel p's record starts at p × stride; it is the quantities in order, three channels of the mean each, and
//! three of the scatter Σ(x − mean)² where the quantity has one.

use glam::{DVec3, Vec3};

use crate::image::LayeredImage;

/// What is measured of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    IrradianceIndirect,
    Beauty,
    Indirect,
    Glossy,
    Emission,
    Direct,
    IrradianceDirect,
    Albedo,
    Normal,
    Depth,
}

impl Quantity {
    /// As in layers and channels of the file.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::IrradianceIndirect => "irradiance_indirect",
            Quantity::Beauty => "beauty",
            Quantity::Indirect => "indirect",
            Quantity::Glossy => "glossy",
            Quantity::Emission => "emission",
            Quantity::Direct => "direct",
            Quantity::IrradianceDirect => "irradiance_direct",
            Quantity::Albedo => "albedo",
            Quantity::Normal => "normal",
            Quantity::Depth => "depth",
        }
    }

    /// Whether the spread of its blocks is kept.
    fn has_scatter(self) -> bool {
        matches!(self, Quantity::IrradianceIndirect | Quantity::Beauty)
    }

    fn width(self) -> usize {
        if self.has_scatter() { 6 } else { 3 }
    }
}

/// Accumulated quantities of all pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    quantities: &'static [Quantity],
    values: Vec<f64>,
    /// Blocks in the means.
    pub blocks: u32,
}

impl Film {
    pub fn new(quantities: &'static [Quantity], pixels: usize) -> Film {
        let stride: usize = quantities.iter().map(|q| q.width()).sum();
        Film { quantities, values: vec![0.0; stride * pixels], blocks: 0 }
    }

    pub fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    /// Numbers in a pixel's record.
    pub fn stride(&self) -> usize {
        self.quantities.iter().map(|q| q.width()).sum()
    }

    /// The records of all pixels, for [`add_block`].
    pub fn records(&mut self) -> &mut [f64] {
        &mut self.values
    }

    fn column(&self, offset: usize) -> impl Iterator<Item = DVec3> {
        let stride = self.stride();
        self.values.chunks_exact(stride).map(move |record| DVec3::from_slice(&record[offset..]))
    }

    fn offset(&self, quantity: Quantity) -> Option<usize> {
        let place = self.quantities.iter().position(|q| *q == quantity)?;
        Some(self.quantities[..place].iter().map(|q| q.width()).sum())
    }

    /// Mean of a quantity in every pixel; `None` where it is not measured.
    pub fn mean(&self, quantity: Quantity) -> Option<Vec<Vec3>> {
        let offset = self.offset(quantity)?;
        Some(self.column(offset).map(|mean| mean.as_vec3()).collect())
    }

    /// Variance of the pixels' means, per channel; `None` without two blocks.
    pub fn variance(&self, quantity: Quantity) -> Option<Vec<Vec3>> {
        let offset = self.offset(quantity).filter(|_| quantity.has_scatter() && self.blocks >= 2)?;
        let n = f64::from(self.blocks);
        Some(self.column(offset + 3).map(|scatter| (scatter / (n * (n - 1.0))).as_vec3()).collect())
    }

    /// How noisy a quantity is, over pixels and channels; `None` without two blocks.
    pub fn noise(&self, quantity: Quantity) -> Option<NoiseLevel> {
        let offset = self.offset(quantity).filter(|_| quantity.has_scatter() && self.blocks >= 2)?;
        let n = f64::from(self.blocks);
        let channels = (3 * self.values.len() / self.stride()) as f64;
        let (mut mean, mut error, mut squared) = (0.0, 0.0, 0.0);
        for (value, scatter) in self.column(offset).zip(self.column(offset + 3)) {
            let variance = scatter / (n * (n - 1.0));
            mean += value.element_sum();
            error += variance.to_array().map(f64::sqrt).iter().sum::<f64>();
            squared += variance.element_sum();
        }
        Some(NoiseLevel {
            mean: mean / channels,
            mean_standard_error: error / channels,
            rms_standard_error: (squared / channels).sqrt(),
        })
    }

    /// Stores the exact state as words: `quantity_mean_r_high` and so on, the two halves of each number's bits.
    pub fn store(&self, image: &mut LayeredImage) {
        let stride = self.stride();
        for (place, name) in self.names().enumerate() {
            let bits = || self.values.chunks_exact(stride).map(|record| record[place].to_bits());
            image.push_words(&format!("{name}_high"), bits().map(|b| (b >> 32) as u32).collect());
            image.push_words(&format!("{name}_low"), bits().map(|b| b as u32).collect());
        }
    }

    /// Undoes [`Film::store`]; `None` where words are missing or numbers are not finite.
    pub fn restore(quantities: &'static [Quantity], image: &LayeredImage, blocks: u32) -> Option<Film> {
        let mut film = Film::new(quantities, image.width as usize * image.height as usize);
        let stride = film.stride();
        let names: Vec<String> = film.names().collect();
        for (place, name) in names.iter().enumerate() {
            let high = image.words(&format!("{name}_high"))?;
            let low = image.words(&format!("{name}_low"))?;
            for ((record, &high), &low) in film.values.chunks_exact_mut(stride).zip(high).zip(low) {
                record[place] = f64::from_bits((u64::from(high) << 32) | u64::from(low));
            }
        }
        film.blocks = blocks;
        film.values.iter().all(|v| v.is_finite()).then_some(film)
    }

    /// One name for every number of a record.
    fn names(&self) -> impl Iterator<Item = String> + use<> {
        let moments = |q: Quantity| if q.has_scatter() { &["mean", "scatter"][..] } else { &["mean"] };
        let channels = move |q: Quantity| {
            moments(q).iter().flat_map(move |m| ["r", "g", "b"].map(|c| format!("{}_{m}_{c}", q.name())))
        };
        self.quantities.iter().flat_map(move |q| channels(*q))
    }
}

/// How noisy a picture is, in the unit of what it shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLevel {
    /// Mean over pixels and channels of the quantity itself.
    pub mean: f64,
    /// Mean over pixels and channels of the standard error.
    pub mean_standard_error: f64,
    /// Root of the mean variance: the RMSE that the noise alone makes.
    pub rms_standard_error: f64,
}

/// Adds a block's means, one for each of `quantities`, to a pixel's record that holds `blocks` of them.
#[inline]
pub fn add_block(record: &mut [f64], quantities: &[Quantity], means: &[DVec3], blocks: u32) {
    let n = f64::from(blocks + 1);
    let mut offset = 0;
    for (quantity, block) in quantities.iter().zip(means) {
        for channel in 0..3 {
            let mean = record[offset + channel];
            let delta = block[channel] - mean;
            let new_mean = mean + delta / n;
            record[offset + channel] = new_mean;
            if quantity.has_scatter() {
                record[offset + 3 + channel] += delta * (block[channel] - new_mean);
            }
        }
        offset += quantity.width();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUANTITIES: &[Quantity] = &[Quantity::IrradianceIndirect, Quantity::Glossy];

    fn film(blocks: &[[f64; 2]]) -> Film {
        let mut film = Film::new(QUANTITIES, 2);
        for (b, values) in blocks.iter().enumerate() {
            let stride = film.stride();
            for (p, record) in film.records().chunks_exact_mut(stride).enumerate() {
                let value = DVec3::new(values[p], 1e6 + values[p], 0.0);
                add_block(record, QUANTITIES, &[value, value * 2.0], b as u32);
            }
            film.blocks += 1;
        }
        film
    }

    #[test]
    fn means_and_variances_are_those_of_the_blocks() {
        let film = film(&[[1.0, 4.0], [3.0, 4.0], [5.0, 4.0]]);
        let mean = film.mean(Quantity::IrradianceIndirect).unwrap();
        assert_eq!(mean, [Vec3::new(3.0, 1e6 + 3.0, 0.0), Vec3::new(4.0, 1e6 + 4.0, 0.0)]);
        // Sample variance 4 of three blocks, ÷ 3; a large offset does not disturb it.
        let variance = film.variance(Quantity::IrradianceIndirect).unwrap();
        assert!((variance[0] - Vec3::new(4.0 / 3.0, 4.0 / 3.0, 0.0)).length() < 1e-6, "{variance:?}");
        assert_eq!(variance[1], Vec3::ZERO);
        assert_eq!(film.mean(Quantity::Glossy).unwrap()[0].x, 6.0);
        assert_eq!(film.variance(Quantity::Glossy), None);
        let noise = film.noise(Quantity::IrradianceIndirect).unwrap();
        assert!((noise.rms_standard_error - (8.0f64 / 3.0 / 6.0).sqrt()).abs() < 1e-9);
        assert!((noise.mean_standard_error - 2.0 * (4.0f64 / 3.0).sqrt() / 6.0).abs() < 1e-9);
    }

    #[test]
    fn one_block_has_no_variance() {
        let film = film(&[[1.0, 2.0]]);
        assert_eq!(film.variance(Quantity::IrradianceIndirect), None);
        assert_eq!(film.noise(Quantity::IrradianceIndirect), None);
    }

    #[test]
    fn states_come_back_to_the_bit() {
        let film = film(&[[0.1, 1e-30], [0.7, 3e20]]);
        let mut image = LayeredImage::new(2, 1);
        film.store(&mut image);
        assert_eq!(Film::restore(QUANTITIES, &image, 2), Some(film));
        assert_eq!(Film::restore(&[Quantity::Depth], &image, 2), None);
    }
}
