//! Directional albedo of the glossy lobe: the share of the light from one direction that [`Ggx`] reflects in all
//! directions. Schlick's Fresnel makes it linear in F0, E(n·v, roughness) = F0·scale + bias, so a table of two values
//! holds it for all materials (Karis, *Real Shading in Unreal Engine 4*, 2013).
//!
//! Row i belongs to roughness r₀ + (1 − r₀)·(i/(ROWS − 1))². The albedo of smooth lobes changes within cosines c ≈ α.
//! So columns divide the octaves of 1 + s·c into equal parts, where s = 2ᵏ − 1 ≥ 2/α with integer k. The first octave
//! holds c ≤ 1/s, and c = 1 ends the last. The table is computed at the first use, in about 0.1 s of one core.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::ggx::{Ggx, MIN_ALPHA, schlick_weight};

const ROWS: usize = 32;

/// Columns of an octave: a power of 2, so that the bounds of octaves are columns.
const PER_OCTAVE: usize = 8;

/// Octaves of the smoothest row: 2¹¹ − 1 ≥ 2/[`MIN_ALPHA`].
const OCTAVES: usize = 11;

/// Columns of a row, with one for c = 1 and one after it, because c = 1 may be rounded up.
const COLUMNS: usize = OCTAVES * PER_OCTAVE + 2;

/// Bound on the error of the table with its interpolation, for any F0. Against a lattice of 28,657 points at 4,500 random
/// roughnesses and cosines the error was between −1.5·10⁻³ and 1.8·10⁻³. The test repeats a part of that.
pub const TABLE_ERROR: f32 = 2e-3;

/// The quadrature is a Fibonacci lattice on the unit square of [`Ggx::sample`]: this many points, and the Fibonacci
/// number before it. A grid would put many points at one distance from the border, which belongs to the steepest facets,
/// where G₁(l) falls to 0 within a small distance.
const LATTICE: [u32; 2] = [1597, 987];

/// Least cosine of the table. At a cosine of 0 the visible normals have no density.
const LEAST_COSINE: f32 = 1e-5;

/// One row: scale and bias for each column.
#[derive(Debug)]
struct Row {
    /// s.
    stretch: f32,
    values: [Vec2; COLUMNS],
}

static TABLE: LazyLock<Vec<Row>> =
    LazyLock::new(|| (0..ROWS).into_par_iter().map(|i| Row::of(roughness_of(i as f32))).collect());

/// Smallest roughness with an α of its own.
fn least_roughness() -> f32 {
    MIN_ALPHA.sqrt()
}

/// Roughness of a row; inverse of [`row_of`].
fn roughness_of(row: f32) -> f32 {
    let t = row / (ROWS - 1) as f32;
    least_roughness() + (1.0 - least_roughness()) * t * t
}

/// Fractional row of a roughness in [0,1].
fn row_of(roughness: f32) -> f32 {
    let t = (roughness - least_roughness()) / (1.0 - least_roughness());
    t.max(0.0).sqrt() * (ROWS - 1) as f32
}

/// Scale and bias by quadrature over visible normals: the mean of F·G₁(l) for F0 = 0, where F is Schlick's weight, is
/// the bias, and for F0 = 1, where F is 1, the sum of both.
fn scale_and_bias(roughness: f32, cosine: f32, lattice: [u32; 2]) -> Vec2 {
    let white = Ggx::new(roughness, Vec3::ONE);
    let view = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let (mut bias, mut sum) = (0.0, 0.0);
    let [points, step] = lattice;
    for i in 0..points {
        let turn = u64::from(i) * u64::from(step) % u64::from(points);
        let u = Vec2::new(i as f32 + 0.5, turn as f32 + 0.5) / points as f32;
        let light = white.sample(view, u);
        if light.z > 0.0 {
            let shadowing = white.brdf(view, light).x * light.z / white.density(view, light);
            // v·h, from v·l = 2·(v·h)² − 1.
            let facet_cosine = (0.5 + 0.5 * view.dot(light)).max(0.0).sqrt();
            bias += f64::from(schlick_weight(facet_cosine) * shadowing);
            sum += f64::from(shadowing);
        }
    }
    Vec2::new((sum - bias) as f32, bias as f32) / points as f32
}

/// Fractional column of 1 + s·c, at least 1. The exponent of a float counts octaves, and its mantissa divides them
/// equally, so this is the float's bits as a fixed-point number.
#[inline]
fn column_of(stretched: f32) -> f32 {
    (stretched.to_bits() - 1f32.to_bits()) as f32 * (PER_OCTAVE as f32 / (1 << 23) as f32)
}

/// 1 + s·c of a column; inverse of [`column_of`].
fn stretched_of(column: usize) -> f32 {
    f32::from_bits(1f32.to_bits() + column as u32 * ((1 << 23) / PER_OCTAVE as u32))
}

impl Row {
    fn of(roughness: f32) -> Row {
        let octaves = (1.0 + 2.0 / (roughness * roughness).max(MIN_ALPHA)).log2().ceil();
        let stretch = octaves.exp2() - 1.0;
        let cosine = |column| (stretched_of(column) - 1.0) / stretch;
        let values = std::array::from_fn(|j| match cosine(j) {
            // Never looked up.
            beyond if beyond > 1.5 => Vec2::ZERO,
            cosine => scale_and_bias(roughness, cosine.clamp(LEAST_COSINE, 1.0), LATTICE),
        });
        Row { stretch, values }
    }

    #[inline]
    fn at(&self, cosine: f32) -> Vec2 {
        let x = column_of(1.0 + self.stretch * cosine);
        let j = (x as usize).min(COLUMNS - 2);
        self.values[j].lerp(self.values[j + 1], x - j as f32)
    }
}

/// The albedo at one roughness.
#[derive(Debug, Clone, Copy)]
pub struct LobeAlbedo {
    rows: [&'static Row; 2],
    /// Weight of the second row.
    weight: f32,
}

impl LobeAlbedo {
    /// `roughness` is the perceptual roughness in [0,1].
    #[inline]
    pub fn new(roughness: f32) -> LobeAlbedo {
        let row = row_of(roughness);
        let i = (row as usize).min(ROWS - 2);
        LobeAlbedo { rows: [&TABLE[i], &TABLE[i + 1]], weight: (row - i as f32).min(1.0) }
    }

    /// Albedo in [0,1] for reflectance `f0` along the normal and a direction at this cosine in [0,1] to the normal. The
    /// error is at most [`TABLE_ERROR`].
    #[inline]
    pub fn at(&self, f0: Vec3, cosine: f32) -> Vec3 {
        let value = self.rows[0].at(cosine).lerp(self.rows[1].at(cosine), self.weight);
        f0 * value.x + value.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::blocks::Block;
    use crate::math::random::{Numbers, Purpose};

    #[test]
    fn the_table_knows_the_albedo() {
        let (mut worst, mut least) = (0.0f32, 0.0f32);
        for i in 0..200 {
            let u = Block::new(5, Purpose::Path, 0, i).sample(0).pair();
            let roughness = u.x * u.x;
            let alpha = (roughness * roughness).max(MIN_ALPHA);
            // Cosines over the whole range, and near α.
            for cosine in [u.y, u.y.powi(3), (alpha * 3.0 * u.y).min(1.0)] {
                let exact = scale_and_bias(roughness, cosine.max(1e-3), [28_657, 17_711]);
                for f0 in [0.0, 0.04, 0.5, 1.0] {
                    let found = LobeAlbedo::new(roughness).at(Vec3::splat(f0), cosine.max(1e-3)).x;
                    let error = found - (f0 * exact.x + exact.y);
                    (worst, least) = (worst.max(error), least.min(error));
                    assert!(error.abs() < TABLE_ERROR, "roughness {roughness}, cosine {cosine}, F0 {f0}: {error}");
                }
            }
        }
        println!("errors from {least} to {worst}");
    }
}
