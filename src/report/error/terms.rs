//! The terms of the figures: the contribution of one pixel and channel, corrected for the noise of the reference.
//!
//! Symbols: e is the irradiance of the picture and r that of the reference. r = t + n, where t is the truth and n is
//! normal noise of variance v. d = e − r is the measured difference and D = e − t the true one.

use std::f64::consts::{PI, SQRT_2};

/// Uncertainty of [`fold`] as a share of its value.
///
/// Source: simulations with D/σ constant from 0 to 3, with ramps through 0 and with steps; and noise added to pictures
/// of two real scenes at 64 and 512 samples per pixel. The bias that remained was at most a quarter of the correction.
/// Differences that change sign from pixel to pixel are not covered: for a checkerboard of ±2σ the correction is 0.6σ
/// too large.
pub const FOLD_UNCERTAINTY: f64 = 0.3;

/// A difference of more than this many standard deviations is real, even if the pixels around it have none.
const SURE_SIGMAS: f64 = 3.0;

/// Largest variance, as a share of the denominator r² + ε, for which [`relative_square`] is continued into the complex
/// plane. At 3v = r² + ε, a share of ⅓, its nodes can reach the poles; this is half of that.
const MAX_CONTINUED: f64 = 1.0 / 6.0;

/// The amount by which noise of variance `v` raises the mean of |d| above |D|. It is the mean of the folded normal
/// distribution (Leone, Nelson & Nottingham 1961) minus |D|: σ·√(2/π)·exp(−D²/2v) − |D|·erfc(|D|/(σ√2)).
///
/// The true D is not known. The measured `d` cannot replace it, because noise moves it away from 0 where D is 0.
/// `around`, the mean of d over the pixel's neighbourhood, replaces it, unless `d` is clearly larger than the noise.
pub fn fold(d: f64, around: f64, v: f64) -> f64 {
    if v <= 0.0 {
        return 0.0;
    }
    let sure = d * d > SURE_SIGMAS * SURE_SIGMAS * v;
    let (size, sigma) = (if sure { d.abs() } else { around.abs() }, v.sqrt());
    let raised =
        sigma * (2.0 / PI).sqrt() * (-size * size / (2.0 * v)).exp() - size * libm::erfc(size / (sigma * SQRT_2));
    raised.max(0.0)
}

/// Whether the noise is small enough for [`relative_square`] to correct the denominator. `v` and `t_squared` are
/// estimates from the pixel's neighbourhood.
pub fn is_continued(v: f64, t_squared: f64, epsilon: f64) -> bool {
    v <= MAX_CONTINUED * (t_squared.max(0.0) + epsilon)
}

/// d²/(r² + ε) and its first two derivatives with respect to r. The value is corrected for the noise in numerator and
/// denominator.
///
/// The correction uses this identity: if n is normal noise and z an independent standard normal variable, E[g(t + n +
/// iσz)] = g(t), provided that g can be continued that far into the complex plane (the heat equation run backwards).
/// The mean over z is computed by the Gauss–Hermite rule of three nodes, which is exact to second order in v. For g =
/// d² it gives d² − v.
///
/// If the noise is too large for this, the excess of the variance over the limit is subtracted from the numerator
/// alone.
pub fn relative_square(d: f64, r: f64, v: f64, epsilon: f64) -> (f64, f64, f64) {
    let w = r * r + epsilon;
    let g = d * d / w;
    let continued = v.min(MAX_CONTINUED * w);
    // The outer nodes ±√3 have the weight 1/6 each, and their values are complex conjugates.
    let y = (3.0 * continued).sqrt();
    let (numerator, denominator) = ((d * d - y * y, -2.0 * d * y), (w - y * y, 2.0 * r * y));
    let size = denominator.0 * denominator.0 + denominator.1 * denominator.1;
    let outer = (numerator.0 * denominator.0 + numerator.1 * denominator.1) / size;
    let value = (2.0 * g + outer) / 3.0 - (v - continued) / w;
    let first = -2.0 * d / w - 2.0 * r * g / w;
    let second = (2.0 + 8.0 * d * r / w - 2.0 * g + 8.0 * g * r * r / w) / w;
    (value, first, second)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E[f(n)] for n normal with the variance `v`, by the midpoint rule over ±8 σ.
    fn expected(v: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (steps, sigma) = (4000, v.sqrt());
        let at = |i: usize| (i as f64 + 0.5) / steps as f64 * 16.0 - 8.0;
        let density = |z: f64| (-z * z / 2.0).exp() / (2.0 * PI).sqrt();
        (0..steps).map(|i| f(sigma * at(i)) * density(at(i))).sum::<f64>() * 16.0 / steps as f64
    }

    #[test]
    fn the_fold_is_what_noise_adds() {
        for (d, v) in [(0.0, 1.0), (0.3, 0.04), (-1.0, 0.5), (2.0, 1.0), (5.0, 0.1)] {
            let raised = expected(v, |n| f64::abs(d - n)) - d.abs();
            assert!((fold(0.0, d, v) - raised).abs() < 1e-5, "{d} {v}: {} {raised}", fold(0.0, d, v));
        }
        assert_eq!(fold(1.0, 1.0, 0.0), 0.0);
        // A difference of ten deviations among zeros is real and needs no correction.
        assert!(fold(10.0, 0.0, 1.0) < 1e-20);
    }

    #[test]
    fn relative_squares_keep_their_mean_under_noise() {
        for (e, t, epsilon) in [(1.2, 1.0, 0.01), (0.5, 1.0, 0.01), (3.0, 0.2, 0.05), (1.0, 1.0, 0.01)] {
            let exact = (e - t) * (e - t) / (t * t + epsilon);
            // σ is 10 % of the denominator's root. The largest error is of third order, some tens of v³/w³ = 10⁻⁶.
            let v = 0.01 * (t * t + epsilon);
            let mean = expected(v, |n| relative_square(e - t - n, t + n, v, epsilon).0);
            assert!((mean - exact).abs() < 1e-4 * exact.max(1.0), "{e} {t}: {mean} {exact}");
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let (e, epsilon, h) = (0.7, 0.03, 1e-4);
        for r in [0.0, 0.1, 0.5, 2.0] {
            let at = |r: f64| relative_square(e - r, r, 0.0, epsilon);
            let first = (at(r + h).0 - at(r - h).0) / (2.0 * h);
            let second = (at(r + h).1 - at(r - h).1) / (2.0 * h);
            // Central differences err by h² times the third derivative, at most some 10⁴ here.
            assert!((at(r).1 - first).abs() < 1e-3 && (at(r).2 - second).abs() < 1e-2, "{r}");
        }
    }

    #[test]
    fn noise_beyond_the_denominator_gives_finite_values() {
        for r in [-1.0, 0.0, 0.1, 1.0] {
            for v in [0.0, 1e-3, 1.0, 1e6] {
                assert!(relative_square(0.5, r, v, 1e-3).0.is_finite(), "{r} {v}");
            }
        }
    }
}
