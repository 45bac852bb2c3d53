//! Light as small whole numbers, so that it compresses: a logarithmic code for radiance, a nearly linear one for differences.
//!
//! The page decodes both with its own copy of the two inverse functions (`assets/page/codec.js`), which gets the constants from
//! here.

/// Codes per octave of a radiance. Half a step, 2^(1/72), is 0.97 %: below the 2 % or so that an 8-bit sRGB value of mid grey is
/// wide.
pub const PER_OCTAVE: f64 = 36.0;

/// Added to the code of a magnitude, so that the smallest f32, 2⁻¹⁴⁹, has code 2: zero keeps 0, and 1 is left free.
pub const OFFSET: i16 = (149.0 * PER_OCTAVE) as i16 + 2;

/// Code of an infinity; its negative that of −∞. The largest finite f32 has 128 · 36 + `OFFSET` = 9974.
pub const INFINITE: i16 = 32_766;

/// Code of what is no number.
pub const NAN: i16 = 32_767;

/// Codes of a difference per unit of its inverse hyperbolic sine: a large one is off by half a step, 1 %.
pub const PER_ASINH: f64 = 50.0;

/// Steps, near zero, of a difference that fills the heat map's range: finer than the map's 128 colours of one sign.
const STEPS_OF_RANGE: f64 = 256.0;

/// The code of a radiance, within 1 % of its magnitude. Undone by [`radiance_of_code`].
pub fn code_of_radiance(value: f32) -> i16 {
    if value.is_nan() {
        return NAN;
    }
    let magnitude = if value.is_infinite() {
        INFINITE
    } else if value == 0.0 {
        0
    } else {
        (f64::from(value.abs()).log2() * PER_OCTAVE).round() as i16 + OFFSET
    };
    if value < 0.0 { -magnitude } else { magnitude }
}

/// The radiance that a code stands for.
pub fn radiance_of_code(code: i16) -> f64 {
    let magnitude = match code.unsigned_abs() as i16 {
        0 => 0.0,
        INFINITE => f64::INFINITY,
        NAN => return f64::NAN,
        magnitude => (f64::from(magnitude - OFFSET) / PER_OCTAVE).exp2(),
    };
    if code < 0 { -magnitude } else { magnitude }
}

/// The code of a display-referred channel in [0,1]: its 8-bit value. Clamped; not a number is [`NAN`].
pub fn code_of_display(value: f32) -> i16 {
    if value.is_finite() { i16::from(crate::math::color::byte_from_unit(value)) } else { NAN }
}

/// Where the code of differences turns from linear to logarithmic, in their unit, for a heat map that ends at ±`range`.
pub fn difference_scale(range: f64) -> f64 {
    // Near zero a step is scale/PER_ASINH.
    range * PER_ASINH / STEPS_OF_RANGE
}

/// The code of a signed difference, off by at most max(1 %, 1/512 of the range) or so. Undone by [`difference_of_code`].
pub fn code_of_difference(value: f64, scale: f64) -> i16 {
    if value.is_finite() {
        // Below 710 · PER_ASINH = 35,500 for any f64; a few times the range in practice.
        ((value / scale).asinh() * PER_ASINH).round().clamp(-f64::from(INFINITE), f64::from(INFINITE)) as i16
    } else {
        NAN
    }
}

/// The difference that a code stands for.
#[cfg(test)]
pub fn difference_of_code(code: i16, scale: f64) -> f64 {
    if code == NAN { f64::NAN } else { (f64::from(code) / PER_ASINH).sinh() * scale }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn radiance_comes_back_within_a_percent(value in proptest::num::f32::ANY) {
            let back = radiance_of_code(code_of_radiance(value));
            if value.is_finite() {
                prop_assert!((back - f64::from(value)).abs() <= 0.01 * f64::from(value.abs()), "{value} gave {back}");
            } else {
                prop_assert_eq!(value.is_nan(), back.is_nan());
                prop_assert!(value.is_nan() || f64::from(value) == back);
            }
        }

        #[test]
        fn a_difference_comes_back_within_a_step(share in -50.0..50.0_f64, exponent in -30..30_i32) {
            let range = 10.0_f64.powi(exponent);
            let (value, scale) = (share * range, difference_scale(range));
            let back = difference_of_code(code_of_difference(value, scale), scale);
            // The two bounds add up: the slope of sinh is cosh ≤ 1 + |sinh|.
            let bound = range / 512.0 + 0.01 * value.abs();
            prop_assert!((back - value).abs() <= 1.001 * bound, "{value} gave {back}");
        }
    }

    #[test]
    fn codes_of_the_ends_are_apart_from_the_marks() {
        assert_eq!(code_of_radiance(0.0), 0);
        assert!(code_of_radiance(f32::from_bits(1)) > 1);
        assert!(code_of_radiance(f32::MAX) < 10_000);
        assert_eq!(code_of_radiance(-f32::MAX), -code_of_radiance(f32::MAX));
        assert_eq!(code_of_difference(f64::MAX, difference_scale(1.0e-30)), INFINITE);
        assert_eq!(code_of_difference(f64::NAN, 1.0), NAN);
        assert_eq!((code_of_display(1.0), code_of_display(f32::NAN), code_of_display(-3.0)), (255, NAN, 0));
    }
}
