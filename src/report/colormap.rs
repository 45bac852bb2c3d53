//! From signed values to colours: blue below, near white at 0, red above (ColorBrewer's "RdBu", reversed).

use colorous::RED_BLUE;

/// Colour of values that are no numbers. The scale has no middle grey.
pub const MISSING: [u8; 3] = [128, 128, 128];

/// The colour of a value where the scale ends at ±`end` > 0; beyond it that of its end, [`MISSING`] for NaN and infinities.
pub fn color(value: f32, end: f32) -> [u8; 3] {
    // In f64: the range may span all of f32.
    if value.is_finite() { color_at(0.5 * (f64::from(value) / f64::from(end) + 1.0)) } else { MISSING }
}

/// The colour at a share of the range from its low end, clamped to [0,1]: what a legend's bar shows.
pub fn color_at(share: f64) -> [u8; 3] {
    RED_BLUE.eval_continuous(1.0 - share.clamp(0.0, 1.0)).into_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_have_their_colours() {
        let [red, _, blue] = color(2.0, 2.0);
        assert!(red > blue);
        let [red, _, blue] = color(-2.0, 2.0);
        assert!(red < blue);
        assert_eq!((color(9.0, 2.0), color(-9.0, 2.0)), (color(2.0, 2.0), color(-2.0, 2.0)));
        assert!(color(0.0, 2.0).iter().all(|&channel| channel > 230));
        assert_eq!(color(f32::MAX, f32::MAX), color_at(1.0));
        assert_eq!((color(f32::NAN, 1.0), color(f32::INFINITY, 1.0)), (MISSING, MISSING));
    }
}
