//! Histograms of signed differences, counts on a logarithmic axis, so that one bad pixel in two million is a bar.
//! `assets/page/macros.html` draws them.

use minijinja::Value;
use minijinja::value::Serde;
use serde::Serialize;

use crate::report::ticks::signed_labels;
use crate::system::format;

/// Bars over the whole range. Odd, so that one is centred on zero.
const BARS: usize = 61;

/// Decades below a count of 1: a bar of one must show.
const FOOT: f64 = 0.3;

/// Values counted over ±a range, as the drawing needs them.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Counts {
    title: String,
    /// The same in words.
    summary: String,
    /// What the lower axis stands for.
    axis: String,
    /// Of the bars from left to right, as shares of the drawing's height; 0 for no value.
    heights: Vec<f64>,
    /// Powers of ten at the left: share of the height, number.
    grid: Vec<(f64, String)>,
    /// At equal distances below, from end to end.
    labels: [String; 5],
}

/// Counts values over ±`range` > 0, in `unit`, for the template; what lies beyond counts in the bars at the ends. `what` is counted,
/// such as "pixels".
pub fn histogram(title: &str, values: &[f32], range: f32, unit: &str, what: &str) -> Value {
    Value::from(Serde(count(title, values, f64::from(range), unit, what)))
}

fn count(title: &str, values: &[f32], range: f64, unit: &str, what: &str) -> Counts {
    let (mut bars, mut beyond, mut undefined) = ([0_u64; BARS], 0, 0);
    for value in values {
        let share = 0.5 * (f64::from(*value) / range + 1.0);
        if value.is_finite() {
            beyond += u64::from(!(0.0..=1.0).contains(&share));
            // The cast saturates below; 1 itself belongs to the last bar.
            bars[((share * BARS as f64) as usize).min(BARS - 1)] += 1;
        } else {
            undefined += 1;
        }
    }
    let within = format!("{} {unit}", format::significant(range / BARS as f64, 2));
    let all = format::count(values.len() as u64);
    let mut summary = format!("{} of {all} {what} within ±{}", format::count(bars[BARS / 2]), within.trim_end());
    for (number, words) in [(beyond, "beyond the range, in the bars at its ends"), (undefined, "undefined")] {
        if number > 0 {
            summary += &format!("; {} {words}", format::count(number));
        }
    }
    let most = bars.into_iter().max().unwrap_or_default().max(10);
    let decades = (most as f64).log10().ceil();
    let height = |log10: f64| (log10 + FOOT) / (decades + FOOT);
    let every = if decades > 4.0 { 2 } else { 1 };
    Counts {
        title: title.to_owned(),
        summary,
        axis: if unit.is_empty() { format!("difference → {what}") } else { format!("difference, {unit} → {what}") },
        heights: bars.map(|count| if count > 0 { height((count as f64).log10()) } else { 0.0 }).to_vec(),
        grid: (0..=decades as u32)
            .step_by(every)
            .map(|i| (height(f64::from(i)), format::count(10_u64.pow(i))))
            .collect(),
        labels: signed_labels(range),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_counted_once() {
        let values = [0.0, -1.0, 1.0, 0.999, 7.0, -7.0, f32::NAN, f32::INFINITY];
        let counts = count("", &values, 1.0, "m", "probes");
        // On an axis of one decade.
        let height = |count: f64| (count.log10() + FOOT) / (1.0 + FOOT);
        let mut expected = vec![0.0; BARS];
        (expected[0], expected[BARS / 2], expected[BARS - 1]) = (height(2.0), height(1.0), height(3.0));
        assert_eq!(counts.heights, expected);
        assert_eq!(
            counts.summary,
            "1 of 8 probes within ±0.016 m; 2 beyond the range, in the bars at its ends; 2 undefined"
        );
    }

    #[test]
    fn one_of_many_shows() {
        let mut values = vec![0.0_f32; 100_000];
        values[7] = 0.9;
        let counts = count("", &values, 1.0, "", "pixels");
        assert!(counts.summary.starts_with("99 999 of 100 000 pixels"), "{}", counts.summary);
        assert_eq!(counts.heights.iter().filter(|height| **height > 0.05).count(), 2);
        assert_eq!(counts.grid.last().unwrap().1, "10 000");
        assert!(count("", &[], 1.0, "", "probes").heights.iter().all(|height| *height == 0.0));
    }
}
