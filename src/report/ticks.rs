//! Round numbers for axes and legends, and how they are written.

/// Ends of a range, times a power of ten: at most a third of a range stays empty.
const ENDS: [f64; 11] = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];

/// Least distance between labels, and between lines without one, as shares of an axis.
const LABEL_GAP: f64 = 0.09;
const TICK_GAP: f64 = 0.01;

/// Magnitudes below the first or from the second on are written with a power of ten.
const PLAIN_MAGNITUDES: std::ops::Range<f64> = 1.0e-3..1.0e5;

/// The smallest round number that is not below `value` > 0; infinite near the largest f32.
pub fn round_up(value: f32) -> f32 {
    let power = 10_f64.powf(f64::from(value).log10().floor());
    ENDS.into_iter().map(|end| (end * power) as f32).find(|end| *end >= value).unwrap_or(value)
}

/// Round numbers within `[low, high]`, `low` > 0, for a logarithmic axis: the densest that it has room to label, and those
/// between them that it has room to mark.
pub fn log_ticks(low: f64, high: f64) -> [Vec<f64>; 2] {
    let decades = low.log10().floor() as i32 - 1..high.log10().ceil() as i32;
    // `tenths`: mantissas times ten.
    let within = |tenths: &[u32], stride: i32| -> Vec<f64> {
        let in_decade = |decade: i32| tenths.iter().map(move |&tenths| f64::from(tenths) * 10_f64.powi(decade));
        let aligned = decades.clone().filter(|decade| (decade + 1).rem_euclid(stride) == 0);
        aligned.flat_map(in_decade).filter(|value| (low..=high).contains(value)).collect()
    };
    let has_room = |ticks: &Vec<f64>, least_gap: f64| {
        ticks.windows(2).all(|pair| (pair[1] / pair[0]).ln() >= least_gap * (high.ln() - low.ln()))
    };
    let steps = [1, 2, 5, 10].map(|step| (10..100).step_by(step).collect::<Vec<u32>>());
    let dense = steps.iter().map(|tenths| within(tenths, 1)).chain([within(&[10, 20, 50], 1)]);
    let sparse = (1..).map(|stride| within(&[10], stride));
    let labelled = dense.chain(sparse).find(|ticks| has_room(ticks, LABEL_GAP)).unwrap_or_default();
    let between = [within(&steps[3], 1), within(&[10], 1)].into_iter().find(|ticks| has_room(ticks, TICK_GAP));
    [labelled, between.unwrap_or_default()]
}

/// A tick's label: "−0.25", "2×10⁻⁵".
pub fn label(value: f64) -> String {
    // What rounding to f32 or summing left behind the fifth digit goes.
    let value: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    if value == 0.0 || PLAIN_MAGNITUDES.contains(&value.abs()) {
        return value.to_string().replace('-', "−");
    }
    let text = format!("{value:e}").replace('-', "−");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let raised = |c: char| c.to_digit(10).and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize)).unwrap_or('⁻');
    let power: String = exponent.chars().map(raised).collect();
    match mantissa {
        "1" | "−1" => format!("{}10{power}", mantissa.trim_end_matches('1')),
        _ => format!("{mantissa}×10{power}"),
    }
}

/// Equally spaced labels from −`end` to `end` > 0, all but 0 with their sign.
pub fn signed_labels(end: f64) -> [String; 5] {
    [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| format!("{}{}", if share > 0.0 { "+" } else { "" }, label(share * end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (f64::from(0.3_f32), "0.3"),
            (-0.25, "−0.25"),
            (20_000.0, "20000"),
            (1.0e5, "10⁵"),
            (-2.5e-5, "−2.5×10⁻⁵"),
            (3.0e12, "3×10¹²"),
        ] {
            assert_eq!(label(value), text);
        }
    }

    #[test]
    fn signed_labels_are_symmetric() {
        assert_eq!(signed_labels(2.0e-5), ["−2×10⁻⁵", "−10⁻⁵", "0", "+10⁻⁵", "+2×10⁻⁵"]);
        assert_eq!(signed_labels(f64::from(0.3_f32)), ["−0.3", "−0.15", "0", "+0.15", "+0.3"]);
    }

    #[test]
    fn logarithmic_ticks_are_round() {
        let labels = |low, high| log_ticks(low, high)[0].iter().copied().map(label).collect::<Vec<_>>();
        assert_eq!(labels(0.77, 24.0), ["1", "2", "5", "10", "20"]);
        assert_eq!(labels(630.0, 1.6e7), ["1000", "10000", "10⁵", "10⁶", "10⁷"]);
        assert_eq!(labels(0.018, 0.063), ["0.02", "0.03", "0.04", "0.05", "0.06"]);
        assert_eq!(labels(28.0, 41.0), ["28", "30", "32", "34", "36", "38", "40"]);
        for range in [(90.5, 111.0), (9.9, 12.0), (1e-200, 1e200), (f64::MIN_POSITIVE, f64::MAX)] {
            let count = log_ticks(range.0, range.1)[0].len();
            assert!((2..=12).contains(&count), "{count} in {range:?}");
        }
    }

    #[test]
    fn numbers_are_rounded_up() {
        for (value, rounded) in
            [(0.7, 0.8), (0.2, 0.2), (2.6e-7, 3.0e-7), (1.01, 1.2), (1000.0, 1000.0), (9.0, 10.0), (1.0e-45, 1.0e-45)]
        {
            assert_eq!(round_up(value), rounded);
        }
    }
}
