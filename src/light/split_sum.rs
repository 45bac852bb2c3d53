//! The table of the split-sum approximation (Karis, *Real Shading in Unreal Engine 4*, 2013): a glossy surface reflects
//! about the mean radiance within its lobe, which is prefiltered, times F0·scale + bias, which this table holds.
//!
//! The model of the table is the published one: GGX with α = roughness², Fresnel as Schlick has it (1994), and shadowing in
//! Schlick's form with k = α/2, G₁(c) = c/(c·(1 − k) + k). It counts light that is scattered once. The share that is lost
//! at F0 = 1, [`lost`]: along cosine-distributed views 0.9, 3.6, 7.7, 20, 36 and 62 % at roughness 0.1, 0.2, 0.3, 0.5, 0.7
//! and 1; at n·v = 0.5 and roughness 1 59 %, so that 0.41 are left.
//!
//! Scale and bias are integrals over the light directions, computed here: the quadrature draws the facets that the view
//! sees ([`Ggx::sample`]), in which the integrand is smooth. Published shaders draw from all facets, on a Hammersley set;
//! at n·v = 0.001 that is off by 0.02 with 4,096 of them.
//!
//! Rows are dense towards smooth lobes and columns towards grazing views, as in [`super::lobe_albedo`], which holds the same
//! for the reference's own shadowing.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::ggx::{Ggx, MIN_ALPHA, schlick_weight};

/// Bound on the error of the table with its interpolation, of scale, of bias and of their sum. Against a lattice of 28,657
/// points at 400 random roughnesses and cosines from 0.01 on the error was below 5.3·10⁻⁴; with half as many rows 1.1·10⁻³.
pub const TABLE_ERROR: f32 = 1e-3;

const ROWS: usize = 96;

/// Columns of an octave of 1 + s·c, c the cosine: a power of 2, so that the bounds of octaves are columns.
const PER_OCTAVE: usize = 16;

/// Points of a Fibonacci lattice on the unit square of [`Ggx::sample`], and the Fibonacci number before.
const LATTICE: [u32; 2] = [2584, 1597];

/// Least cosine between view and normal.
const LEAST_COSINE: f32 = 1e-4;

/// Scale and bias in the columns of one roughness.
struct Row {
    /// s = 2ᵏ − 1 ≥ 2/α.
    stretch: f32,
    values: Vec<Vec2>,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| (0..ROWS).into_par_iter().map(row).collect());

fn alpha(roughness: f32) -> f32 {
    (roughness * roughness).max(MIN_ALPHA)
}

fn least_roughness() -> f32 {
    MIN_ALPHA.sqrt()
}

fn row(i: usize) -> Row {
    let t = i as f32 / (ROWS - 1) as f32;
    let roughness = least_roughness() + (1.0 - least_roughness()) * t * t;
    let octaves = (1.0 + 2.0 / alpha(roughness)).log2().ceil();
    let stretch = octaves.exp2() - 1.0;
    // One more column, because a cosine of 1 may be rounded up.
    let columns = octaves as usize * PER_OCTAVE + 2;
    let cosine = |j: usize| {
        let within = 1.0 + (j % PER_OCTAVE) as f32 / PER_OCTAVE as f32;
        (((j / PER_OCTAVE) as f32).exp2() * within - 1.0) / stretch
    };
    let value = |j| integral(roughness, cosine(j).clamp(LEAST_COSINE, 1.0), LATTICE);
    Row { stretch, values: (0..columns).map(value).collect() }
}

/// Scale and bias, by `points` directions of a lattice. A facet h that the view v sees is drawn with the density
/// G₁ˢ(v)·D·(v·h)/(n·v), G₁ˢ Smith's shadowing; what it reflects is D·F·G/(4·(n·v)·(n·l))·(n·l) of the light, and the
/// directions of light lie 1/(4·v·h) as dense. What remains is F·G₁(v)·G₁(l)/G₁ˢ(v).
fn integral(roughness: f32, cosine: f32, [points, step]: [u32; 2]) -> Vec2 {
    let (lobe, a) = (Ggx::new(roughness, Vec3::ONE), alpha(roughness));
    let view = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let shadowing = |c: f32| c / (c * (1.0 - a / 2.0) + a / 2.0);
    let smith = 2.0 * cosine / (cosine + (a * a + (1.0 - a * a) * cosine * cosine).sqrt());
    let (mut scale, mut bias) = (0.0f64, 0.0f64);
    for i in 0..points {
        let turn = u64::from(i) * u64::from(step) % u64::from(points);
        let light = lobe.sample(view, Vec2::new(i as f32 + 0.5, turn as f32 + 0.5) / points as f32);
        if light.z > 0.0 {
            // v·h, from v·l = 2·(v·h)² − 1.
            let fresnel = schlick_weight((0.5 + 0.5 * view.dot(light)).max(0.0).sqrt());
            let reflected = f64::from(shadowing(light.z));
            scale += reflected * f64::from(1.0 - fresnel);
            bias += reflected * f64::from(fresnel);
        }
    }
    Vec2::new(scale as f32, bias as f32) * (shadowing(cosine) / smith / points as f32)
}

impl Row {
    #[inline]
    fn at(&self, cosine: f32) -> Vec2 {
        let stretched = 1.0 + self.stretch * cosine;
        // The exponent of a float counts octaves, and its mantissa divides them equally.
        let x = (stretched.to_bits() - 1f32.to_bits()) as f32 * (PER_OCTAVE as f32 / (1 << 23) as f32);
        let j = (x as usize).min(self.values.len() - 2);
        self.values[j].lerp(self.values[j + 1], x - j as f32)
    }
}

/// Scale and bias at a perceptual roughness in [0,1] and a cosine in [0,1] between view and normal. The error is at most
/// [`TABLE_ERROR`].
#[inline]
pub fn scale_and_bias(roughness: f32, cosine: f32) -> Vec2 {
    let t = ((roughness - least_roughness()) / (1.0 - least_roughness())).clamp(0.0, 1.0);
    let x = t.sqrt() * (ROWS - 1) as f32;
    let i = (x as usize).min(ROWS - 2);
    let cosine = cosine.clamp(LEAST_COSINE, 1.0);
    TABLE[i].at(cosine).lerp(TABLE[i + 1].at(cosine), x - i as f32)
}

/// Share of the light from one direction that a surface of reflectance `f0` along its normal reflects.
#[inline]
pub fn reflected(f0: Vec3, roughness: f32, cosine: f32) -> Vec3 {
    let value = scale_and_bias(roughness, cosine);
    f0 * value.x + value.y
}

/// Share of the light that is lost where none should be, at F0 = 1, along cosine-distributed views.
pub fn lost(roughness: f32) -> f64 {
    const VIEWS: usize = 256;
    // c² is uniform.
    let kept = |i: usize| f64::from(reflected(Vec3::ONE, roughness, ((i as f32 + 0.5) / VIEWS as f32).sqrt()).x);
    1.0 - (0..VIEWS).map(kept).sum::<f64>() / VIEWS as f64
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::math::blocks::Block;
    use crate::math::random::{Numbers, Purpose};

    /// The model of the module's documentation, with nothing but its definition: BRDF × cosine on a grid over half vectors,
    /// in tan θ/α (midpoint rule), in f64. dω_l = 4·(v·h)·dω_h.
    fn by_quadrature(roughness: f32, cosine: f32) -> [f64; 2] {
        const N: usize = 800;
        let a = f64::from(alpha(roughness));
        let (k, c) = (a / 2.0, f64::from(cosine));
        let sine = (1.0 - c * c).sqrt();
        let g1 = |x: f64| x / (x * (1.0 - k) + k);
        let (mut scale, mut bias) = (0.0, 0.0);
        for i in 0..N {
            // θ = atan(α·t/(1 − t)): D·cos θ·dω is 2t(1 − t)/((1 − t)² + t²)² dt·dφ/2π.
            let t = (i as f64 + 0.5) / N as f64;
            let tangent = a * t / (1.0 - t);
            let z = 1.0 / (1.0 + tangent * tangent).sqrt();
            let x = tangent * z;
            let share = 2.0 * t * (1.0 - t) / ((1.0 - t).powi(2) + t * t).powi(2) / N as f64;
            for j in 0..N {
                let phi = PI * (j as f64 + 0.5) / N as f64;
                let v_h = sine * x * phi.cos() + c * z;
                let l_z = 2.0 * v_h * z - c;
                if v_h <= 0.0 || l_z <= 0.0 {
                    continue;
                }
                // D·F·G/(4·c·l_z)·l_z · 4·v_h over dω_h, of which D·z·dω_h is `share`.
                let value = share / N as f64 * g1(c) * g1(l_z) * v_h / (c * z);
                let fresnel = (1.0 - v_h).powi(5);
                scale += value * (1.0 - fresnel);
                bias += value * fresnel;
            }
        }
        [scale, bias]
    }

    #[test]
    fn the_table_equals_direct_quadrature() {
        let mut worst = 0.0f64;
        for i in 0..60 {
            let u = Block::new(5, Purpose::Path, 0, i).sample(0).pair();
            let roughness = if i % 2 == 0 { u.x } else { u.x * u.x };
            // Cosines over the whole range, and near α. Below 0.01 the quadrature of the test itself would need more points.
            for cosine in [u.y, u.y * u.y * u.y, 3.0 * u.y * alpha(roughness)] {
                let cosine = cosine.clamp(0.01, 1.0);
                let exact = by_quadrature(roughness, cosine);
                let found = scale_and_bias(roughness, cosine);
                let errors = [f64::from(found.x) - exact[0], f64::from(found.y) - exact[1]];
                for error in [errors[0], errors[1], errors[0] + errors[1]] {
                    worst = worst.max(error.abs());
                    let limit = f64::from(TABLE_ERROR);
                    assert!(error.abs() < limit, "roughness {roughness}, cosine {cosine}: {found} is off by {error}");
                }
            }
        }
        println!("largest error {worst:.1e}");
    }

    #[test]
    fn what_the_model_loses_is_known() {
        let energy = reflected(Vec3::ONE, 1.0, 0.5).x;
        assert!((energy - 0.41).abs() < 0.005, "{energy}");
        for (roughness, share) in [(0.1, 0.009), (0.2, 0.036), (0.3, 0.077), (0.5, 0.198), (0.7, 0.363), (1.0, 0.623)] {
            let found = lost(roughness);
            println!("roughness {roughness}: {found:.3} lost");
            // Half a unit of the last digit, and the table's bound.
            assert!((found - share).abs() < 1.5e-3, "roughness {roughness}: {found}");
        }
        // A mirror keeps all but what lies beyond its least α.
        assert!(lost(0.0) < 2e-3, "{}", lost(0.0));
    }
}
