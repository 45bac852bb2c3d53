//! From values to places along an axis, and the round numbers that stand at it.

use crate::report::ticks::{superscript, ticks};

/// How values are spread along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    Linear,
    /// Positive values only; others are left out and counted.
    Log,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// With its unit.
    pub label: String,
    pub scale: Scale,
}

impl Axis {
    pub fn new(label: impl Into<String>, scale: Scale) -> Axis {
        Axis { label: label.into(), scale }
    }

    /// Whether a value has a place.
    pub fn holds(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == Scale::Linear || value >= f64::MIN_POSITIVE)
    }
}

/// Share of the range that stays free on both sides.
const PADDING: f64 = 0.05;

/// A range shorter than this factor is widened by it on both sides of a logarithmic axis: tiny differences should look tiny.
const SINGLE_FACTOR: f64 = 1.1;

/// Decades up to which all digits are labelled, up to which 2 and 5 are besides 1, and up to which all have ticks.
const DECADES_OF_ALL: f64 = 0.9;
const DECADES_OF_125: f64 = 2.5;
const DECADES_OF_MINOR: f64 = 6.0;

/// Labels at most, along a whole axis.
const MOST_LABELS: usize = 8;

/// An axis with its range.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    scale: Scale,
    /// In values, or in their decadic logarithms.
    low: f64,
    high: f64,
}

/// A tick: share of the axis, label (empty for small ones).
pub type Tick = (f64, String);

impl Span {
    /// Just wider than these values.
    pub fn of(axis: &Axis, values: impl Iterator<Item = f64>) -> Span {
        let scale = axis.scale;
        let place = |v: f64| if scale == Scale::Log { v.log10() } else { v };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|v| axis.holds(*v)).map(place) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let least = match scale {
            Scale::Log => SINGLE_FACTOR.log10(),
            Scale::Linear => 1e-3 * low.abs().max(high.abs()).max(1e-9),
        };
        if high - low < least {
            (low, high) = (low - least, high + least);
        }
        let free = PADDING * (high - low);
        Span { scale, low: low - free, high: high + free }
    }

    /// 0 at the low end, 1 at the high end.
    pub fn share(&self, value: f64) -> f64 {
        let place = if self.scale == Scale::Log { value.log10() } else { value };
        (place - self.low) / (self.high - self.low)
    }

    pub fn ticks(&self) -> Vec<Tick> {
        match self.scale {
            Scale::Linear => {
                let at = ticks(self.low, self.high, MOST_LABELS - 1, false);
                at.into_iter().map(|(value, label)| (self.share(value), label)).collect()
            }
            Scale::Log => self.log_ticks(),
        }
    }

    fn log_ticks(&self) -> Vec<Tick> {
        let decades = self.high - self.low;
        let labelled: &[u32] = match decades {
            d if d <= DECADES_OF_ALL => &[1, 2, 3, 4, 5, 6, 7, 8, 9],
            d if d <= DECADES_OF_125 => &[1, 2, 5],
            _ => &[1],
        };
        // Far ranges have a label every few decades.
        let stride = (decades / MOST_LABELS as f64).ceil().max(1.0) as i32;
        let digits = if decades <= DECADES_OF_MINOR { 1..=9 } else { 1..=1 };
        let mut found = Vec::new();
        for exponent in self.low.floor() as i32..=self.high.ceil() as i32 {
            for digit in digits.clone() {
                let place = f64::from(exponent) + f64::from(digit).log10();
                if place < self.low || place > self.high {
                    continue;
                }
                let shown = labelled.contains(&digit) && exponent.rem_euclid(stride) == 0;
                let label = if shown { power_label(digit, exponent) } else { String::new() };
                found.push(((place - self.low) / decades, label));
            }
        }
        if found.iter().filter(|tick| !tick.1.is_empty()).count() < 2 {
            // So short a range is nearly linear.
            let at = ticks(10f64.powf(self.low), 10f64.powf(self.high), MOST_LABELS - 1, false);
            found = at.into_iter().map(|(value, label)| (self.share(value), label)).collect();
        }
        found
    }
}

/// digit × 10^exponent as people read it.
fn power_label(digit: u32, exponent: i32) -> String {
    match exponent {
        -3..=-1 => format!("{:.*}", -exponent as usize, f64::from(digit) * 10f64.powi(exponent)),
        0..=4 => format!("{}", u64::from(digit) * 10u64.pow(exponent as u32)),
        _ if digit == 1 => format!("10{}", superscript(exponent)),
        _ => format!("{digit}×10{}", superscript(exponent)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(values: [f64; 2]) -> Vec<String> {
        let span = Span::of(&Axis::new("", Scale::Log), values.into_iter());
        span.ticks().into_iter().map(|t| t.1).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn logarithmic_ticks_are_round() {
        assert_eq!(labels([0.9, 21.0]), ["1", "2", "5", "10", "20"]);
        assert_eq!(labels([1e3, 1e7]), ["1000", "10000", "10⁵", "10⁶", "10⁷"]);
        assert_eq!(labels([0.019, 0.06]), ["0.02", "0.03", "0.04", "0.05", "0.06"]);
        assert_eq!(labels([31.0, 33.0]), ["28", "30", "32", "34", "36"]);
        assert!((2..=9).contains(&labels([1e-200, 1e200]).len()), "{:?}", labels([1e-200, 1e200]));
    }

    #[test]
    fn values_lie_between_the_ends_in_their_order() {
        for scale in [Scale::Log, Scale::Linear] {
            let span = Span::of(&Axis::new("", scale), [2.0, 8.0, 4.0].into_iter());
            let shares = [2.0, 4.0, 8.0].map(|v| span.share(v));
            assert!(0.0 < shares[0] && shares[0] < shares[1] && shares[1] < shares[2] && shares[2] < 1.0, "{shares:?}");
            // Equal factors are equal lengths on one scale, equal differences on the other.
            let middle = 0.5 * (shares[0] + shares[2]);
            assert_eq!((shares[1] - middle).abs() < 1e-12, scale == Scale::Log);
        }
    }
}
