//! Round numbers for axes and legends.

/// Steps between ticks, times a power of ten: what people count in.
const STEPS: &[f64] = &[1.0, 2.0, 2.5, 5.0];

/// Ends of a range, times a power of ten: closer together than steps, so that at most a third of a range stays empty.
const ENDS: &[f64] = &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0];

/// Magnitudes below the first or from the second on are written with a power of ten.
const PLAIN_MAGNITUDES: std::ops::Range<f64> = 1.0e-3..1.0e5;

/// Values at round numbers within `[low, high]`, and the label of each.
pub fn ticks(low: f64, high: f64, at_most: usize, signed: bool) -> Vec<(f64, String)> {
    let step = round_magnitude((high - low) / at_most.max(1) as f64, STEPS);
    if !(step.is_normal() && high > low) {
        return Vec::new();
    }
    // A tick at the very end must not fall victim to rounding.
    let slack = 1.0e-6 * step;
    let first = ((low - slack) / step).ceil() as i64;
    let last = ((high + slack) / step).floor() as i64;
    let exponent = common_exponent(low.abs().max(high.abs()));
    (first..=last).map(|i| (i as f64 * step, label(i as f64 * step, step, exponent, signed))).collect()
}

/// The smallest round number whose magnitude is not below that of `value`; 0 and what is no number stay.
pub fn round_up(value: f64) -> f64 {
    if value.is_normal() { value.signum() * round_magnitude(value.abs(), ENDS) } else { value }
}

/// The smallest of `mantissas` times a power of ten that is not below `raw` > 0.
fn round_magnitude(raw: f64, mantissas: &[f64]) -> f64 {
    let power = 10_f64.powi(raw.log10().floor() as i32);
    // Room for the rounding of f32: 0.4 as f32 lies above 0.4.
    let fits = |mantissa: &&f64| **mantissa * power >= raw * (1.0 - 1.0e-6);
    mantissas.iter().find(fits).unwrap_or(&10.0) * power
}

/// The power of ten that all labels of an axis share; 0 where plain numbers read well.
fn common_exponent(magnitude: f64) -> i32 {
    if PLAIN_MAGNITUDES.contains(&magnitude) { 0 } else { magnitude.log10().floor() as i32 }
}

/// A tick's label with as many decimals as its step needs, "−" for minus and "+" where `signed`.
fn label(value: f64, step: f64, exponent: i32, signed: bool) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let scale = 10_f64.powi(exponent);
    let (mantissa, step) = (value.abs() / scale, step / scale);
    let decimals = (0..12).find(|&d| is_whole(step * 10_f64.powi(d))).unwrap_or(12);
    let sign = match (value < 0.0, signed) {
        (true, _) => "−",
        (false, true) => "+",
        (false, false) => "",
    };
    let power = if exponent == 0 { String::new() } else { format!("×10{}", superscript(exponent)) };
    format!("{sign}{mantissa:.*}{power}", decimals as usize)
}

fn is_whole(value: f64) -> bool {
    (value - value.round()).abs() < 1.0e-6 && value > 0.5
}

/// An exponent in raised digits: −5 gives "⁻⁵".
pub fn superscript(exponent: i32) -> String {
    let raised = |character| match character {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        // The raised digits other than 1, 2, 3 stand together in Unicode, from U+2070 on.
        digit => char::from_u32(0x2070 + (digit as u32 - '0' as u32)).unwrap_or(digit),
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, at_most: usize, signed: bool) -> Vec<String> {
        ticks(low, high, at_most, signed).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_and_reach_both_ends() {
        assert_eq!(labels(0.0, 1.0, 5, false), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(-0.5, 0.5, 4, true), ["−0.50", "−0.25", "0", "+0.25", "+0.50"]);
        assert_eq!(labels(0.0, 0.3, 3, false), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(0.0, 2.0e-5, 4, false), ["0", "0.5×10⁻⁵", "1.0×10⁻⁵", "1.5×10⁻⁵", "2.0×10⁻⁵"]);
        assert_eq!(labels(0.0, 3.0e12, 3, false), ["0", "1×10¹²", "2×10¹²", "3×10¹²"]);
        assert_eq!(labels(3.0, 47.0, 5, false), ["10", "20", "30", "40"]);
    }

    #[test]
    fn ticks_of_no_range_are_none() {
        for (low, high) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert!(ticks(low, high, 5, false).is_empty(), "{low} to {high}");
        }
    }

    #[test]
    fn numbers_are_rounded_up() {
        for (value, rounded) in
            [(0.0, 0.0), (0.7, 0.8), (0.2, 0.2), (2.6e-7, 3.0e-7), (1.01, 1.2), (1000.0, 1000.0), (9.0, 10.0)]
        {
            assert!((round_up(value) - rounded).abs() <= 1.0e-12 * rounded, "{value} gave {}", round_up(value));
        }
    }
}
