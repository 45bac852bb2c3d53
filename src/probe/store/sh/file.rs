//! Coefficients in the probe file.

use glam::{Vec3, Vec3A};
use safetensors::Dtype;

use super::gradient::{self, Gradient};
use super::{COUNT, PRESAMPLED, ShIrradiance, ShStore, TENSOR};
use crate::probe::container::{Container, EncodingLosses};
use crate::probe::store::encode::{ColorFormat, decode_colors, encode_colors, encode_signed, scale_for};

/// Names in the file.
const PRESAMPLED_KEY: &str = "sh.presampled";
const SCALE_KEY: &str = "scale.irradiance";

impl ShIrradiance {
    /// Writes its tensor.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        let slopes = || self.gradient.iter().flat_map(Gradient::numbers);
        let largest = self.coefficients.iter().chain(slopes()).map(|c| c.abs().max_element()).fold(0.0, f32::max);
        let scale = scale_for(largest, self.format);
        let probes = self.coefficients.len() / COUNT;
        let mut put = |name: &str, per_probe: usize, numbers: &mut dyn Iterator<Item = &Vec3A>| {
            let encoded = encode_signed(numbers.flat_map(|c| c.to_array()), self.format, scale);
            container.put_bytes(name, self.format.dtype(), &[probes, per_probe, 3], encoded.bytes);
            losses.clamped.insert(name.to_owned(), encoded.clamped);
            losses.underflowed.insert(name.to_owned(), encoded.underflowed);
        };
        put(TENSOR, COUNT, &mut self.coefficients.iter());
        if self.gradient.is_some() {
            put(gradient::TENSOR, gradient::AXES, &mut slopes());
        }
        container.put_json(PRESAMPLED_KEY, &self.store().presampled);
        container.put_json(SCALE_KEY, &scale);
    }

    /// Reads its tensor; inverse of [`Self::write`] up to rounding. What shading reads has the rounding of its own format.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, probes: usize) -> Result<ShIrradiance, String> {
        let tensor = container.tensor(TENSOR, &[Dtype::F16, Dtype::F32], &[Some(probes), Some(COUNT), Some(3)])?;
        let scale: f32 = container.json(SCALE_KEY)?;
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(format!("metadata '{SCALE_KEY}' is {scale}"));
        }
        let presampled: Option<usize> = container.json(PRESAMPLED_KEY)?;
        // Largest of any map, texels per side: nothing larger can be asked for.
        const MOST: usize = 1024;
        if presampled.is_some_and(|n| !(1..=MOST).contains(&n)) {
            return Err(format!("metadata '{PRESAMPLED_KEY}' is {presampled:?}"));
        }
        let format = ColorFormat::of(tensor.dtype).ok_or_else(|| format!("tensor '{TENSOR}' has no colour format"))?;
        let coefficients: Vec<Vec3> = decode_colors(&tensor.bytes, format, scale);
        if coefficients.iter().any(|c| !c.is_finite()) {
            return Err(format!("tensor '{TENSOR}' holds numbers that are not finite"));
        }
        let gradient = match container.has(gradient::TENSOR) {
            true if presampled.is_some() => {
                return Err(format!(
                    "metadata '{PRESAMPLED_KEY}' is {presampled:?} beside tensor '{}'",
                    gradient::TENSOR
                ));
            }
            true => Some(Gradient::read(container, probes, tensor.dtype, scale)?),
            false => None,
        };
        let mut read = ShIrradiance::zeros(&ShStore { format, presampled, gradient: false }, probes);
        read.restore(&coefficients);
        read.round();
        read.gradient = gradient;
        Ok(read)
    }

    /// Gives the maps that shading reads the values of their format.
    fn round(&mut self) {
        let Some(maps) = &mut self.presampled else { return };
        let texels: Vec<Vec3> = maps.texels.iter().map(|&t| t.into()).collect();
        let encoded = encode_colors(&texels, PRESAMPLED);
        let decoded = decode_colors(&encoded.bytes, PRESAMPLED, encoded.scale);
        maps.texels = decoded.into_iter().map(Vec3A::from).collect();
    }
}
