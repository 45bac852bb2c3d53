//! The figures' terms: what one pixel and channel contributes, freed from the reference's noise.
//!
//! e is the method's irradiance, r the reference's, d = e − r; r = t + n with the truth t and normal noise n of the
//! variance v; D = e − t.

use std::f64::consts::{PI, SQRT_2};

/// By how much [`fold`] may be wrong, as a share of itself. Simulated for D/σ constant from 0 to 3, ramps through 0 and steps, and
/// compared with what noise added to pictures of two real scenes at 64 and 512 samples per pixel: what remained of the bias was at
/// most a quarter of the correction. It does not cover differences that change their sign from pixel to pixel: a checkerboard of ±2σ
/// loses 0.6σ too much.
pub const FOLD_UNCERTAINTY: f64 = 0.3;

/// Differences of so many deviations are no noise, whatever the pixels around them say.
const SURE_SIGMAS: f64 = 3.0;

/// Largest variance, as a share of the denominator r² + ε, that [`relative_square`] is continued into the complex plane for:
/// √(3v) must stay clear of the poles, where 3v = r² + ε.
const MAX_CONTINUED: f64 = 1.0 / 6.0;

/// By how much noise of the variance `v` raises the mean of |d| above |D|: the mean of the folded normal distribution
/// (Leone, Nelson & Nottingham 1961) minus |D|, σ·√(2/π)·exp(−D²/2v) − |D|·erfc(|D|/(σ√2)).
///
/// The true D is not known, and the measured one would not do: it is far from 0 just where D is 0. `around`, the mean of d over the
/// pixel's neighbourhood, stands for it, unless `d` itself is beyond doubt.
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

/// Whether [`relative_square`] knows its denominator t² + ε, with estimates of v and t² from the pixels around.
pub fn is_continued(v: f64, t_squared: f64, epsilon: f64) -> bool {
    v <= MAX_CONTINUED * (t_squared.max(0.0) + epsilon)
}

/// d²/(r² + ε) and its first two derivatives in r, the value freed from noise in numerator and denominator.
///
/// For normal noise E[g(t + n + iσz)] over a standard normal z is g(t) wherever g can be continued so far into the complex plane
/// (the heat equation run backwards); the Gauss–Hermite rule of three nodes is exact to the second order in v. For g = d² it
/// gives d² − v. Where the noise is too large for that, what is left of it is taken from the numerator alone.
pub fn relative_square(d: f64, r: f64, v: f64, epsilon: f64) -> (f64, f64, f64) {
    let w = r * r + epsilon;
    let g = d * d / w;
    let continued = v.min(MAX_CONTINUED * w);
    // The outer nodes ±√3 have the weights 1/6 each and conjugate values.
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
        // Ten deviations among zeros are no noise.
        assert!(fold(10.0, 0.0, 1.0) < 1e-20);
    }

    #[test]
    fn relative_squares_keep_their_mean_under_noise() {
        for (e, t, epsilon) in [(1.2, 1.0, 0.01), (0.5, 1.0, 0.01), (3.0, 0.2, 0.05), (1.0, 1.0, 0.01)] {
            let exact = (e - t) * (e - t) / (t * t + epsilon);
            // Noise of 10 % of the denominator's root; the first order that is left is the third, some tens of v³/w³ = 10⁻⁶.
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
