//! Colour: luminance, and the sRGB transfer function with its inverse.

use glam::Vec3;

/// Luminance of linear RGB with Rec. 709 primaries, in the unit of its argument (ITU-R BT.709-6, item 3.2).
///
/// The weights add up to one, so that grey keeps its value.
pub fn luminance(linear: Vec3) -> f32 {
    linear.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The sRGB code in [0,1] of one linear channel in [0,1] (IEC 61966-2-1). Values outside are clamped; NaN gives 0.
///
/// Undone by [`linear_from_srgb`].
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = clamp_unit(linear);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear channel in [0,1] of one sRGB code in [0,1] (IEC 61966-2-1). Values outside are clamped; NaN gives 0.
///
/// Undone by [`srgb_from_linear`].
pub fn linear_from_srgb(code: f32) -> f32 {
    let code = clamp_unit(code);
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The nearest 8-bit value of a code in [0,1]. Values outside are clamped; NaN gives 0.
///
/// Undone by `value / 255`.
pub fn byte_from_unit(code: f32) -> u8 {
    // The cast saturates and turns NaN into 0.
    (code * 255.0).round() as u8
}

/// Clamps to [0,1] and replaces NaN by 0. `f32::clamp` would keep NaN, which has no colour.
fn clamp_unit(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luminance_keeps_grey() {
        assert!((luminance(Vec3::splat(3.0)) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn srgb_pair_inverts() {
        for i in 0..=4096 {
            let linear = i as f32 / 4096.0;
            // Two powers in f32, each good to a few units in the last place.
            assert!((linear_from_srgb(srgb_from_linear(linear)) - linear).abs() < 1e-6, "{linear}");
        }
        for byte in 0..=255_u8 {
            let code = f32::from(byte) / 255.0;
            assert_eq!(byte_from_unit(srgb_from_linear(linear_from_srgb(code))), byte);
        }
    }

    #[test]
    fn srgb_has_its_known_values() {
        // Mid grey of photography, 18 %, is code 118 (IEC 61966-2-1 evaluated by hand: 0.4613).
        assert_eq!(byte_from_unit(srgb_from_linear(0.18)), 118);
        assert_eq!(srgb_from_linear(0.0), 0.0);
        assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn nan_infinite_and_negative_values_get_a_colour() {
        assert_eq!(srgb_from_linear(f32::NAN), 0.0);
        assert!((srgb_from_linear(f32::INFINITY) - 1.0).abs() < 1e-6);
        assert_eq!(srgb_from_linear(-1.0), 0.0);
        assert_eq!(byte_from_unit(f32::NAN), 0);
        assert_eq!(byte_from_unit(7.0), 255);
    }
}
