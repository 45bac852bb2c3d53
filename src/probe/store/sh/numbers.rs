//! Coefficients as textures have them.

use glam::Vec3A;

use super::{COUNT, OctahedralMaps, ShIrradiance};

impl ShIrradiance {
    /// What shading reads in place of coefficients.
    pub fn maps(&self) -> Option<&OctahedralMaps<Vec3A>> {
        self.presampled.as_ref()
    }

    /// How many numbers a probe has, each of three channels, and those of all probes: coefficients and, where there is one,
    /// behind them the gradient.
    pub fn numbers(&self) -> (usize, impl Iterator<Item = Vec3A> + '_) {
        let of = |(p, coefficients): (usize, &[Vec3A])| {
            let slopes = self.gradient.iter().flat_map(|gradient| gradient.of(p));
            coefficients.iter().copied().chain(slopes).collect::<Vec<_>>()
        };
        (self.fitted_unknowns(), self.coefficients.chunks(COUNT).enumerate().flat_map(of))
    }
}
