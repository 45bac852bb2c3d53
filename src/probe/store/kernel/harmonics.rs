//! The filter from captured radiance to nine coefficients of irradiance.

use std::f32::consts::PI;

use super::{Directions, Kernel};
use crate::math::harmonics::{self, COSINE, COUNT, Y0};

impl Kernel {
    /// Spherical harmonics of irradiance ÷ π, each coefficient times Y₀ so that the first is the mean.
    ///
    /// Solid angles are normalised to 4π and the higher rows to a sum of 0: constant radiance L gives π·L and nothing else,
    /// exactly.
    pub fn harmonics(captured: &Directions) -> Kernel {
        let texels = captured.texels();
        // Per texel: its solid angle, then the integral of every function.
        let mut integrals = vec![[0.0f64; COUNT]; texels];
        let mut areas = vec![0.0f64; texels];
        for (t, texel) in captured.all.chunks(captured.per_texel).enumerate() {
            for (direction, weight) in texel {
                let y = harmonics::basis(*direction);
                areas[t] += f64::from(*weight);
                (0..COUNT).for_each(|j| integrals[t][j] += f64::from(y[j]) * f64::from(*weight));
            }
        }
        let total: f64 = areas.iter().sum();
        let mut kernel = Kernel { row_start: vec![0], entries: Vec::with_capacity(texels * COUNT), dense: None };
        for j in 0..COUNT {
            let factor =
                f64::from(Y0) * f64::from(COSINE[j]) / std::f64::consts::PI * 4.0 * std::f64::consts::PI / total;
            let row_sum: f64 = integrals.iter().map(|y| y[j] * factor).sum();
            let surplus = if j == 0 { row_sum - 1.0 } else { row_sum };
            let weight = |t: usize| (integrals[t][j] * factor - surplus * areas[t] / total) as f32;
            kernel.entries.extend((0..texels).map(|t| (t as u32, weight(t))));
            kernel.row_start.push(kernel.entries.len());
        }
        kernel
    }

    /// Of every captured texel what radiance 1 in it adds to the coefficients, in their order, W·m⁻²; empty where these are
    /// not harmonics.
    pub fn harmonic_columns(&self) -> Vec<[f32; COUNT]> {
        if self.dense.is_some() || self.rows() != COUNT {
            return Vec::new();
        }
        let mut columns = vec![[0.0; COUNT]; self.row(0).len()];
        for j in 0..COUNT {
            for &(t, weight) in self.row(j) {
                if let Some(column) = columns.get_mut(t as usize) {
                    column[j] = PI * weight;
                }
            }
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::{Vec3, Vec3A};

    use super::*;
    use crate::math::octahedral::texel_direction;

    fn coefficients(resolution: usize, radiance: impl Fn(Vec3) -> f32) -> Vec<f32> {
        let captured = Directions::octahedral(resolution);
        let direction = |t: usize| texel_direction(t % resolution, t / resolution, resolution);
        let radiance: Vec<Vec3A> = (0..resolution * resolution).map(|t| Vec3A::splat(radiance(direction(t)))).collect();
        let mut out = vec![Vec3A::ZERO; COUNT];
        Kernel::harmonics(&captured).irradiance(&radiance, &mut out);
        out.iter().map(|e| e.x / Y0).collect()
    }

    fn irradiance(coefficients: &[f32], normal: Vec3) -> f32 {
        harmonics::basis(normal).iter().zip(coefficients).map(|(y, c)| y * c).sum()
    }

    #[test]
    fn constant_radiance_gives_pi_times_it_whatever_the_resolution() {
        for resolution in [1, 5, 16, 32] {
            let c = coefficients(resolution, |_| 1.0);
            for normal in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.48, 0.64)] {
                // Rounding of sums of a thousand f32, in four lanes.
                assert!((irradiance(&c, normal) / PI - 1.0).abs() < 5e-6, "{resolution} {normal}: {c:?}");
            }
        }
    }

    #[test]
    fn bands_up_to_two_come_back_exactly() {
        // L = 1 + y + xz: E = π + (2π/3)·y + (π/4)·xz.
        let c = coefficients(64, |d| 1.0 + d.y + d.x * d.z);
        for normal in [Vec3::Y, Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.48, 0.6, 0.64)] {
            let exact = PI + 2.0 * PI / 3.0 * normal.y + PI / 4.0 * normal.x * normal.z;
            // Radiance at texel centres of 0.05 rad: relative error about 0.05²/24 of the varying part.
            assert!((irradiance(&c, normal) - exact).abs() < 1e-3, "{normal}: {}, {exact}", irradiance(&c, normal));
        }
    }
}
