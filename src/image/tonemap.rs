//! From linear light to a screen: exposure, tone curve, sRGB. PNGs, FLIP and thumbnails all use this one definition.

use glam::Vec3;

use crate::math::color::srgb_from_linear;

/// The luminance to which [`auto_exposure`] scales the log-average of a picture: 18 % grey (Reinhard et al. 2002,
/// section 2, the "key").
const MID_GREY: f32 = 0.18;

/// Luminances below this share of the median count as black. They lie 13 stops below it, and no display shows them.
const BLACK_BELOW_MEDIAN: f32 = 1.0e-4;

/// Bound of an automatic exposure, ± EV. Luminances of 10⁹ and 10⁻⁹ need ±33.
const EXPOSURE_LIMIT_EV: f32 = 40.0;

/// Arguments of the tone curve are clamped to this. The curve reaches 1 at 7.25, and the squares of very large
/// arguments would overflow and give NaN.
const CURVE_SATURATED: f32 = 16.0;

/// The sRGB code in [0,1]³ of a linear `pixel` at `exposure_ev`. Each channel is multiplied by 2^EV, then passes
/// through the tone curve and the sRGB transfer function. Negative channels and NaN give 0, infinity gives 1.
pub fn tonemap(pixel: Vec3, exposure_ev: f32) -> Vec3 {
    let gain = exposure_ev.exp2();
    Vec3::from_array(pixel.to_array().map(|channel| srgb_from_linear(tone_curve(channel * gain))))
}

/// The filmic curve of K. Narkowicz, "ACES Filmic Tone Mapping Curve" (2015), as published, without the optional factor
/// 0.6. It maps [0,∞) to [0,1] and is monotone.
fn tone_curve(x: f32) -> f32 {
    // NaN is not above 0 and gives 0.
    let x = if x > 0.0 { x.min(CURVE_SATURATED) } else { 0.0 };
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0)
}

/// The exposure, EV, that brings the log-average of these luminances to 18 % grey (E. Reinhard et al., "Photographic
/// Tone Reproduction for Digital Images", 2002, equations 1 and 2). It is clamped to ±40 EV.
///
/// Black, negative and non-finite luminances do not count. Luminances more than 13 stops below the median of the others
/// do not count either; otherwise a black background or an unlit room would set the exposure. A black picture gives 0.
pub fn auto_exposure(luminances: impl IntoIterator<Item = f32>) -> f32 {
    let mut lit: Vec<f32> = luminances.into_iter().filter(|l| l.is_finite() && *l > 0.0).collect();
    if lit.is_empty() {
        return 0.0;
    }
    let middle = lit.len() / 2;
    let median = *lit.select_nth_unstable_by(middle, f32::total_cmp).1;
    let black = median * BLACK_BELOW_MEDIAN;
    let (mut sum_log2, mut count) = (0.0_f64, 0_u64);
    for luminance in lit.into_iter().filter(|&l| l >= black) {
        sum_log2 += f64::from(luminance).log2();
        count += 1;
    }
    let log2_average = (sum_log2 / count as f64) as f32;
    (MID_GREY.log2() - log2_average).clamp(-EXPOSURE_LIMIT_EV, EXPOSURE_LIMIT_EV)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_map_is_monotone_and_in_range() {
        let mut last = 0.0;
        for i in -2000..=2000 {
            let x = (i as f32 * 0.05).exp2();
            let shown = tonemap(Vec3::splat(x), 0.0);
            assert!(shown.x >= last && shown.x <= 1.0, "{x} shows as {}", shown.x);
            assert!(shown.x == shown.y && shown.y == shown.z);
            last = shown.x;
        }
        assert_eq!(tonemap(Vec3::ZERO, 0.0), Vec3::ZERO);
        assert!((last - 1.0).abs() < 1e-6);
    }

    #[test]
    fn tone_map_has_its_known_value() {
        // 0.18: (0.18·(2.51·0.18+0.03)) / (0.18·(2.43·0.18+0.59)+0.14) = 0.086724/0.324932 = 0.26690, whose sRGB code
        // is 0.5534.
        assert!((tonemap(Vec3::splat(0.18), 0.0).x - 0.5534).abs() < 2e-4);
    }

    #[test]
    fn one_ev_is_a_factor_of_two() {
        let pixel = Vec3::new(0.1, 0.4, 2.0);
        assert_eq!(tonemap(pixel, 1.0), tonemap(2.0 * pixel, 0.0));
    }

    #[test]
    fn tone_map_accepts_nan_infinite_and_negative_values() {
        let odd = tonemap(Vec3::new(f32::NAN, f32::INFINITY, -1.0), 3.0);
        assert_eq!((odd.x, odd.z), (0.0, 0.0));
        assert!((odd.y - 1.0).abs() < 1e-6);
        assert!(tonemap(Vec3::MAX, 200.0).is_finite());
    }

    #[test]
    fn exposure_brings_the_log_average_to_mid_grey() {
        assert!((auto_exposure([0.18]) - 0.0).abs() < 1e-6);
        // The log-average of 0.09 and 0.36 is 0.18; an arithmetic one would not be.
        assert!(auto_exposure([0.09, 0.36]).abs() < 1e-6);
        assert!((auto_exposure([0.18 * 8.0; 5]) + 3.0).abs() < 1e-6);
    }

    #[test]
    fn exposure_ignores_black_negative_and_non_finite_values() {
        let odd = [0.0, -1.0, f32::NAN, f32::INFINITY, 1.0e-20, 0.18, 0.18, 0.18];
        assert!(auto_exposure(odd).abs() < 1e-6);
        assert_eq!(auto_exposure([]), 0.0);
        assert_eq!(auto_exposure([0.0, f32::NAN]), 0.0);
    }

    #[test]
    fn exposure_is_clamped() {
        assert_eq!(auto_exposure([f32::MIN_POSITIVE]), EXPOSURE_LIMIT_EV);
        assert_eq!(auto_exposure([f32::MAX]), -EXPOSURE_LIMIT_EV);
    }
}
