//! What the template gets: the report as it is, what its gates and pictures come to, and filters that write figures.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::Serde;
use minijinja::{Environment, Error, Value, context, escape_formatter};

use super::codes;
use super::images::{PackedImage, images};
use super::visible::visible;
use crate::report::colormap::color_at;
use crate::report::gate::Gate;
use crate::report::words;
use crate::system::format;

/// Colours of the heat map that the page looks up: one for each of 8 bits.
const COLORS: usize = 256;

/// Digits of figures: one more than tables of the terminal, as small differences are what the page is about.
const DIGITS: usize = 4;

/// Larger whole numbers are not counts but bytes and the like.
const MOST_COUNTED: f64 = 1.0e9;

/// The templates, and the filters that they use.
///
/// # Errors
/// None in practice: the templates are part of the program.
pub fn environment() -> Result<Environment<'static>, Error> {
    let mut environment = Environment::new();
    // Text that is not marked as safe may come from outside the program.
    environment.set_formatter(|out, state, value| match value.as_str() {
        Some(text) if !value.is_safe() => escape_formatter(out, state, &Value::from(visible(text))),
        _ => escape_formatter(out, state, value),
    });
    environment.add_filter("figure", figure);
    environment.add_filter("of_side", of_side);
    environment.add_filter("threshold", threshold);
    environment.add_filter("finite", |value: Option<f64>| value.filter(|value| value.is_finite()));
    environment.add_filter("percent", |share: Option<f64>| format::or_undefined(share, format::percent));
    environment.add_filter("base64", |text: &str| STANDARD.encode(text));
    // The names' endings turn escaping on.
    environment.add_template("macros.html", include_str!("../assets/page/macros.html"))?;
    environment.add_template("page.html", include_str!("../assets/page/page.html"))?;
    environment.add_template("look.html", include_str!("../assets/page/look/look.html"))?;
    Ok(environment)
}

/// All that the page shows: the report of a comparison and what its gates and pictures come to.
pub fn view(report: Value, gates: &[Gate], packed: Vec<PackedImage>) -> Value {
    let gate = |gate: &Gate| {
        let is_defined = gate.value.is_some();
        context! {
            state => words::outcome(gate).to_lowercase(),
            text => if is_defined { figure(gate.value, Some(gate.unit), gate.standard_error) } else { words::value(gate) },
            margin_text => words::margin(gate),
            ..Value::from(Serde(gate))
        }
    };
    let images = images(packed);
    let worst = worst(gates, &images);
    context! {
        gates => gates.iter().map(gate).collect::<Vec<_>>(),
        images,
        worst,
        colors => colors(),
        codes => context! {
            per_octave => codes::PER_OCTAVE,
            offset => codes::OFFSET,
            per_asinh => codes::PER_ASINH,
            infinite => codes::INFINITE,
            nan => codes::NAN,
        },
        ..report
    }
}

/// The place of the pair that the first gate about pictures is of: they come worst first. Without such a gate the first pair.
fn worst(gates: &[Gate], images: &[Value]) -> usize {
    let of_gate = |gate: &Gate| {
        let is_of = |image: &Value| image.get_attr("name").is_ok_and(|name| name.as_str() == Some(&gate.item));
        images.iter().position(is_of)
    };
    gates.iter().find_map(of_gate).unwrap_or(0)
}

/// The colours of heat maps from the low to the high end: RGB bytes, in base64.
pub fn colors() -> String {
    STANDARD.encode((0..COLORS).flat_map(|i| color_at(i as f64 / (COLORS - 1) as f64)).collect::<Vec<u8>>())
}

/// A threshold as somebody wrote it: without the zeros that make figures as long as each other.
fn threshold(value: Option<f64>, unit: &str) -> String {
    let text = figure(value, Some(unit), None);
    let (number, unit) = text.split_once(' ').map_or((text.as_str(), String::new()), |(n, u)| (n, format!(" {u}")));
    let is_fraction = number.contains('.') && !number.contains('e');
    let number = if is_fraction { number.trim_end_matches('0').trim_end_matches('.') } else { number };
    format!("{number}{unit}")
}

/// The figure of one side of a gate.
fn of_side(value: Option<f64>, unit: &str) -> String {
    match unit {
        "" => format::or_undefined(value, number),
        words::BYTES => words::of_side(value, unit),
        unit => format::or_undefined(value, |value| format!("{} {unit}", number(value))),
    }
}

/// A pure number: what is whole is most likely counted, and shown without a fraction.
fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < MOST_COUNTED {
        format!("{}{}", if value < 0.0 { "-" } else { "" }, format::count(value.abs() as u64))
    } else {
        format::significant(value, DIGITS)
    }
}

/// A figure with its unit, as people write it.
pub(super) fn figure(value: Option<f64>, unit: Option<&str>, standard_error: Option<f64>) -> String {
    let (Some(value), unit) = (value, unit.unwrap_or_default()) else { return format::UNDEFINED.to_owned() };
    let number = match unit {
        "s" => return format::seconds(value),
        "bytes" | words::BYTES => return words::in_unit(Some(value), words::BYTES),
        _ if standard_error.is_some() => format::with_error(value, standard_error),
        "" => number(value),
        _ => format::significant(value, DIGITS),
    };
    format!("{number} {unit}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_their_unit() {
        let cases = [
            (Some(0.0123), "s", "12.3 ms"),
            (Some(2048.0), "bytes", "2.00 KiB"),
            (Some(-2048.0), "bytes", "-2.00 KiB"),
            (Some(0.5), "%", "0.5000 %"),
            (Some(300.0), "", "300"),
            (Some(-2.0), "", "-2"),
            (Some(0.25), "", "0.2500"),
            (Some(f64::NAN), "", "–"),
            (None, "m", "–"),
        ];
        for (value, unit, text) in cases {
            assert_eq!(figure(value, Some(unit), None), text);
        }
        assert_eq!(figure(Some(0.031), Some("m"), Some(0.0031)), "0.0310 ± 0.0031 m");
    }

    #[test]
    fn thresholds_are_short() {
        let cases = [(0.02, "", "0.02"), (20.0, "%", "20 %"), (100.0, "", "100"), (1.0e-7, "", "1.000e-7")];
        for (value, unit, text) in cases {
            assert_eq!(threshold(Some(value), unit), text);
        }
        assert_eq!(threshold(None, "%"), "–");
    }
}
