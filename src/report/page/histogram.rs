//! Histograms of signed differences, counts on a logarithmic axis, so that one bad pixel in two million is a bar.
//! `assets/page/macros.html` draws them.

use minijinja::{Value, context};

use crate::report::ticks::signed_labels;
use crate::system::format;

/// Bars over the whole range. Odd, so that one is centred on zero.
const BARS: usize = 61;

/// Decades below a count of 1: a bar of one must show.
const FOOT: f64 = 0.3;

/// Counts values over ±`range` > 0, in `unit`; what lies beyond counts in the bars at the ends. `what` is counted, such as "pixels".
pub fn histogram(title: &str, values: &[f32], range: f32, unit: &str, what: &str) -> Value {
    let range = f64::from(range);
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
    let powers = (0..=decades as u32).step_by(if decades > 4.0 { 2 } else { 1 });
    context! {
        title,
        // The same in words.
        summary,
        // What the lower axis stands for.
        axis => if unit.is_empty() { format!("difference → {what}") } else { format!("difference, {unit} → {what}") },
        // Of the bars from left to right, as shares of the drawing's height; 0 for no value.
        heights => bars.map(|count| if count > 0 { height((count as f64).log10()) } else { 0.0 }).to_vec(),
        // Powers of ten at the left: share of the height, number.
        grid => powers.map(|i| vec![Value::from(height(f64::from(i))), format::count(10_u64.pow(i)).into()]).collect::<Vec<_>>(),
        // At equal distances below, from end to end.
        labels => signed_labels(range).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The heights of the bars and the summary.
    fn counted(values: &[f32], unit: &str, what: &str) -> (Vec<f64>, String) {
        let drawn = histogram("", values, 1.0, unit, what);
        let heights = drawn.get_attr("heights").unwrap().try_iter().unwrap();
        (heights.map(|height| height.try_into().unwrap()).collect(), drawn.get_attr("summary").unwrap().to_string())
    }

    #[test]
    fn every_value_is_counted_once() {
        let values = [0.0, -1.0, 1.0, 0.999, 7.0, -7.0, f32::NAN, f32::INFINITY];
        let (heights, summary) = counted(&values, "m", "probes");
        // On an axis of one decade.
        let height = |count: f64| (count.log10() + FOOT) / (1.0 + FOOT);
        let mut expected = vec![0.0; BARS];
        (expected[0], expected[BARS / 2], expected[BARS - 1]) = (height(2.0), height(1.0), height(3.0));
        assert_eq!(heights, expected);
        assert_eq!(summary, "1 of 8 probes within ±0.016 m; 2 beyond the range, in the bars at its ends; 2 undefined");
    }

    #[test]
    fn one_of_many_shows() {
        let mut values = vec![0.0_f32; 100_000];
        values[7] = 0.9;
        let (heights, summary) = counted(&values, "", "pixels");
        assert!(summary.starts_with("99 999 of 100 000 pixels"), "{summary}");
        assert_eq!(heights.iter().filter(|height| **height > 0.05).count(), 2);
        let grid = histogram("", &values, 1.0, "", "pixels").get_attr("grid").unwrap();
        assert_eq!(grid.try_iter().unwrap().last().unwrap().get_item_by_index(1).unwrap().as_str(), Some("10 000"));
        assert!(counted(&[], "", "probes").0.iter().all(|height| *height == 0.0));
    }
}
