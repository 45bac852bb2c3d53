//! Numbers as text for people. All text is ASCII apart from "µ" and the dash for undefined figures.

/// Text of an undefined figure.
pub const UNDEFINED: &str = "–";

/// Significant digits of a figure in a table. Timings and errors are not known to more.
const TABLE_DIGITS: usize = 3;

/// A byte count in B, KiB, MiB, GiB or TiB.
pub fn bytes(count: u64) -> String {
    if count < 1024 {
        return format!("{count} B");
    }
    let mut value = count as f64;
    for unit in ["KiB", "MiB", "GiB"] {
        value /= 1024.0;
        // Rounding must not give "1024 KiB".
        if value < 1023.5 {
            return format!("{} {unit}", significant(value, TABLE_DIGITS.max(digits_before_point(value))));
        }
    }
    format!("{:.2} TiB", value / 1024.0)
}

/// A time in ns, µs, ms or s, from seconds.
pub fn seconds(seconds: f64) -> String {
    if !seconds.is_finite() {
        return UNDEFINED.to_owned();
    }
    let units = [(1.0e-9, "ns"), (1.0e-6, "µs"), (1.0e-3, "ms")];
    for (scale, unit) in units {
        let value = seconds / scale;
        // Rounding must not give "1000 ns".
        if value.abs() < 999.5 {
            return format!("{} {unit}", significant(value, TABLE_DIGITS));
        }
    }
    format!("{} s", significant(seconds, TABLE_DIGITS.max(digits_before_point(seconds))))
}

/// A share as a percentage: 0.0123 gives "1.23 %".
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", significant(100.0 * share, TABLE_DIGITS)) } else { UNDEFINED.to_owned() }
}

/// A number with `digits` significant digits (at least 1). Values from 10⁶ up and below 10⁻⁴ are written with an
/// exponent, such as 1.23e-7.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return UNDEFINED.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    // The exponent is read after rounding, because rounding can change it: 9.996 with three digits is 10.0.
    let rounded = format!("{value:.*e}", digits - 1);
    let exponent: i32 = rounded.rsplit_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        let shown: f64 = rounded.parse().unwrap_or(value);
        format!("{shown:.decimals$}")
    } else {
        rounded
    }
}

/// A value and its standard error, both with as many decimals as give the error two digits: "12.34 ± 0.12". Without a
/// finite error above 0 the value alone, with the digits of a table.
pub fn with_error(value: f64, error: Option<f64>) -> String {
    // A very small error would otherwise give the value a long row of digits.
    const MAX_DIGITS: i32 = 5;
    let plain = significant(value, TABLE_DIGITS);
    let Some(error) = error.filter(|e| e.is_finite() && *e > 0.0).filter(|_| value.is_finite()) else { return plain };
    let exponent = |x: f64| x.abs().log10().floor() as i32;
    let decimals = 1 - exponent(error);
    let most = if value == 0.0 { decimals } else { MAX_DIGITS - 1 - exponent(value).max(exponent(error)) };
    if !(-6..=6).contains(&decimals) {
        return format!("{plain} ± {}", significant(error, 2));
    }
    let decimals = decimals.min(most).max(0) as usize;
    // An error below the last digit is rounded up to that digit, because "± 0" would claim that the value is exact.
    let error = error.max(10_f64.powi(-(decimals as i32)));
    let value = format!("{value:.decimals$}");
    // "-0.00" loses its sign.
    let is_zero = value.bytes().all(|c| matches!(c, b'-' | b'0' | b'.'));
    format!("{} ± {error:.decimals$}", if is_zero { value.trim_start_matches('-') } else { &value })
}

/// A count with spaces between its thousands: 1234567 gives "1 234 567".
pub fn count(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
}

/// A count with what is counted: "1 seed", "2 seeds".
pub fn counted(number: u64, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// The formatted value, or [`UNDEFINED`] for `None`.
pub fn or_undefined<T>(value: Option<T>, format: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| UNDEFINED.to_owned(), format)
}

/// Digits before the decimal point, at least 1. Callers ask for as many digits, so that 1023 does not become 1020.
fn digits_before_point(value: f64) -> usize {
    value.abs().max(1.0).log10().floor() as usize + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_counts() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.00 KiB"),
            (1_047_500, "1023 KiB"),
            (1_048_575, "1.00 MiB"),
            (12_345_678, "11.8 MiB"),
            (u64::MAX, "16777216.00 TiB"),
        ];
        for (count, text) in cases {
            assert_eq!(bytes(count), text);
        }
    }

    #[test]
    fn times() {
        let cases = [
            (0.0, "0 ns"),
            (1.234e-8, "12.3 ns"),
            (9.996e-7, "1.00 µs"),
            (0.0123, "12.3 ms"),
            (1.5, "1.50 s"),
            (3725.4, "3725 s"),
            (f64::NAN, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(seconds(value), text);
        }
    }

    #[test]
    fn significant_digits() {
        let cases = [
            (9.996, "10.0"),
            (0.0, "0"),
            (-0.001_234_5, "-0.00123"),
            (123_456.0, "123000"),
            (1.234e-7, "1.23e-7"),
            (1.0e9, "1.00e9"),
            (f64::INFINITY, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value, 3), text);
        }
    }

    #[test]
    fn values_have_the_decimals_of_their_errors() {
        let cases = [
            (12.3456, Some(0.1234), "12.35 ± 0.12"),
            (0.0, Some(0.5), "0.00 ± 0.50"),
            (-0.001, Some(0.5), "0.00 ± 0.50"),
            (1234.5, Some(56.0), "1234 ± 56"),
            (2.34567, Some(0.000_01), "2.3457 ± 0.0001"),
            (2.0e-9, Some(1.0e-10), "2.00e-9 ± 1.0e-10"),
            (12.3456, None, "12.3"),
            (12.3456, Some(0.0), "12.3"),
        ];
        for (value, error, text) in cases {
            assert_eq!(with_error(value, error), text);
        }
    }

    #[test]
    fn shares_counts_and_undefined_figures() {
        assert_eq!(percent(0.012_34), "1.23 %");
        assert_eq!(percent(f64::NAN), "–");
        assert_eq!(count(1_234_567), "1 234 567");
        assert_eq!(count(12), "12");
        assert_eq!([0, 1, 2].map(|n| counted(n, "seed", "seeds")), ["0 seeds", "1 seed", "2 seeds"]);
        assert_eq!(or_undefined(None, seconds), "–");
        assert_eq!(or_undefined(Some(1.0), seconds), "1.00 s");
    }
}
