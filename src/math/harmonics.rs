//! Real spherical harmonics of the bands 0 to 2, and what a clamped cosine makes of each.
//!
//! Order: 1, y, z, x, xy, yz, 3z²−1, xz, x²−y²; orthonormal on the sphere, all signs positive. Source: Ramamoorthi and
//! Hanrahan, *An Efficient Representation for Irradiance Environment Maps*, 2001; Sloan, *Stupid Spherical Harmonics
//! Tricks*, 2008.

use std::f32::consts::PI;

use glam::Vec3;

/// Functions of the bands 0 to 2.
pub const COUNT: usize = 9;

/// √(1/4π): the function of band 0.
pub const Y0: f32 = 0.282_094_8;

/// By function: the factor between radiance and irradiance, π, 2π/3 and π/4 by band.
pub const COSINE: [f32; COUNT] = {
    let (one, two) = (2.0 * PI / 3.0, PI / 4.0);
    [PI, one, one, one, two, two, two, two, two]
};

/// The functions at a unit direction.
#[inline]
pub fn basis(d: Vec3) -> [f32; COUNT] {
    // √(3/4π), √(15/4π), √(5/16π), √(15/16π).
    const B1: f32 = 0.488_602_5;
    const B2: f32 = 1.092_548_4;
    const B20: f32 = 0.315_391_57;
    const B22: f32 = 0.546_274_2;
    [
        Y0,
        B1 * d.y,
        B1 * d.z,
        B1 * d.x,
        B2 * d.x * d.y,
        B2 * d.y * d.z,
        B20 * (3.0 * d.z * d.z - 1.0),
        B2 * d.x * d.z,
        B22 * (d.x * d.x - d.y * d.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::fibonacci;

    #[test]
    fn functions_are_orthonormal() {
        let n = 20_000;
        let mut products = [[0.0f64; COUNT]; COUNT];
        for i in 0..n {
            let y = basis(fibonacci::direction(i, n)).map(f64::from);
            (0..COUNT).for_each(|a| (0..COUNT).for_each(|b| products[a][b] += y[a] * y[b]));
        }
        for (a, row) in products.iter().enumerate() {
            for (b, sum) in row.iter().enumerate() {
                let mean = sum * 4.0 * std::f64::consts::PI / n as f64;
                let expected = if a == b { 1.0 } else { 0.0 };
                // The lattice integrates polynomials of degree 4 with an error of about 1/n.
                assert!((mean - expected).abs() < 1e-3, "{a} {b}: {mean}");
            }
        }
    }

    #[test]
    fn the_cosine_has_these_factors() {
        // Around +z, A_l = 2π ∫ P_l(x)·x dx from 0 to 1: π, 2π/3, π/4 (x from P₀, x² from P₁, (3x³ − x)/2 from P₂).
        let exact = [2.0 * PI / 2.0, 2.0 * PI / 3.0, 2.0 * PI * (3.0 / 4.0 - 1.0 / 2.0) / 2.0];
        for (function, band) in [(0, 0), (2, 1), (6, 2)] {
            assert!((COSINE[function] - exact[band]).abs() < 1e-6);
        }
    }
}
