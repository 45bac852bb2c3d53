//! The film of the reference. For each pixel it accumulates the mean of every quantity over blocks of samples. For two
//! quantities it also accumulates the scatter of the blocks' means, which gives the error.
//!
//! Blocks are independent of each other ([`crate::math::blocks`]). So the variance of the mean of n blocks is Σ(x −
//! mean)²/(n(n − 1)). Welford's update computes the sum without cancellation. All values are f64, and each pixel adds
//! its blocks in order. So a run that was interrupted and continued ends with the same bits as an uninterrupted run.
//!
//! Layout: the record of pixel p starts at p × stride. It holds the quantities in order. Each has three channels of the
//! mean, followed by three channels of the scatter Σ(x − mean)² if the quantity has one.

use glam::{DVec3, Vec3};

use crate::image::LayeredImage;

/// A quantity of a pixel.
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
    /// Name in the layers and channels of the file.
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

    /// Whether the scatter of the blocks is accumulated.
    fn has_scatter(self) -> bool {
        matches!(self, Quantity::IrradianceIndirect | Quantity::Beauty | Quantity::Glossy)
    }

    /// Numbers in a record.
    fn width(self) -> usize {
        if self.has_scatter() { 6 } else { 3 }
    }
}

/// The accumulated quantities of all pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    quantities: &'static [Quantity],
    values: Vec<f64>,
    /// Number of blocks in the means.
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

    /// Length of a pixel's record.
    pub fn stride(&self) -> usize {
        self.quantities.iter().map(|q| q.width()).sum()
    }

    /// The records of all pixels, which [`add_block`] changes.
    pub fn records(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Three numbers of each pixel's record, from `offset` on.
    fn column(&self, offset: usize) -> impl Iterator<Item = DVec3> {
        let stride = self.stride();
        self.values.chunks_exact(stride).map(move |record| DVec3::from_slice(&record[offset..]))
    }

    /// Position of a quantity in a record.
    fn offset(&self, quantity: Quantity) -> Option<usize> {
        let place = self.quantities.iter().position(|q| *q == quantity)?;
        Some(self.quantities[..place].iter().map(|q| q.width()).sum())
    }

    /// The mean of a quantity in every pixel. `None` if the film does not hold this quantity.
    pub fn mean(&self, quantity: Quantity) -> Option<Vec<Vec3>> {
        let offset = self.offset(quantity)?;
        Some(self.column(offset).map(|mean| mean.as_vec3()).collect())
    }

    /// The variance of each pixel's mean, per channel. `None` for fewer than two blocks and for quantities without
    /// scatter.
    pub fn variance(&self, quantity: Quantity) -> Option<Vec<Vec3>> {
        let offset = self.offset(quantity).filter(|_| quantity.has_scatter() && self.blocks >= 2)?;
        let n = f64::from(self.blocks);
        Some(self.column(offset + 3).map(|scatter| (scatter / (n * (n - 1.0))).as_vec3()).collect())
    }

    /// The noise of a quantity, averaged over pixels and channels. `None` as for [`Film::variance`].
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

    /// Stores the exact state as words. The bits of each number become two words, for example `beauty_mean_r_high` and
    /// `beauty_mean_r_low`.
    pub fn store(&self, image: &mut LayeredImage) {
        let stride = self.stride();
        for (place, name) in self.names().enumerate() {
            let bits = || self.values.chunks_exact(stride).map(|record| record[place].to_bits());
            image.push_words(&format!("{name}_high"), bits().map(|b| (b >> 32) as u32).collect());
            image.push_words(&format!("{name}_low"), bits().map(|b| b as u32).collect());
        }
    }

    /// Undoes [`Film::store`]. `None` if words are missing or numbers are not finite.
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

    /// The names of the numbers in a record, in order.
    fn names(&self) -> impl Iterator<Item = String> + use<> {
        let moments = |q: Quantity| if q.has_scatter() { &["mean", "scatter"][..] } else { &["mean"] };
        let channels = move |q: Quantity| {
            moments(q).iter().flat_map(move |m| ["r", "g", "b"].map(|c| format!("{}_{m}_{c}", q.name())))
        };
        self.quantities.iter().flat_map(move |q| channels(*q))
    }
}

/// The noise of a whole picture, in the unit of the quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLevel {
    /// Mean of the quantity over pixels and channels.
    pub mean: f64,
    /// Mean of the standard error over pixels and channels.
    pub mean_standard_error: f64,
    /// Root of the mean variance. This is the RMSE that noise alone causes.
    pub rms_standard_error: f64,
}

/// Adds a block to a pixel's record. `means` holds the block's mean of each of `quantities`; `blocks` is the number of
/// blocks that the record contains before.
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

    const QUANTITIES: &[Quantity] = &[Quantity::IrradianceIndirect, Quantity::Indirect];

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
        assert_eq!(film.mean(Quantity::Indirect).unwrap()[0].x, 6.0);
        assert_eq!(film.variance(Quantity::Indirect), None);
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
