//! Histograms as SVG for the page: counts on a logarithmic axis, so that one bad pixel in two million is a bar.

use std::error::Error;
use std::fmt::Display;
use std::sync::Once;

use plotters::prelude::*;
use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;

use crate::report::font;
use crate::report::ticks::ticks;
use crate::system::format;

/// Bars over the whole range. Odd, so that one is centred on zero.
const BARS: usize = 61;

/// Of the drawing, in its own units; the page scales it to its column.
const SIZE: (u32, u32) = (440, 200);

// What is not drawn over, in units of the drawing.
const LEFT: i32 = 68;
const RIGHT: i32 = 20;
const TOP: i32 = 12;
const BOTTOM: i32 = 44;

const LABEL_SIZE: i32 = 12;
const FAMILY: &str = "sans-serif";

/// Colours that stand for those of the page's style sheet, which turns them dark or light.
const ROLES: [(RGBColor, &str); 4] = [
    (RGBColor(1, 1, 1), "currentColor"),
    (RGBColor(2, 2, 2), "var(--rule)"),
    (RGBColor(3, 3, 3), "var(--less)"),
    (RGBColor(4, 4, 4), "var(--more)"),
];
const INK: RGBColor = ROLES[0].0;
const RULE: RGBColor = ROLES[1].0;
const LESS: RGBColor = ROLES[2].0;
const MORE: RGBColor = ROLES[3].0;

/// A histogram of signed values, ready for the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drawn {
    pub svg: String,
    /// The same in words.
    pub summary: String,
}

/// Values counted over ±`range`; what lies beyond counts in the bars at the ends.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Counts {
    bars: Vec<u64>,
    beyond: u64,
    undefined: u64,
}

/// Draws a histogram of signed differences over ±`range` > 0. `unit` stands at the axis; `what` is counted, such as "pixels".
///
/// # Errors
/// None in practice: the writer is memory and the font is bundled.
pub fn draw(values: &[f32], range: f64, unit: &str, what: &str) -> Result<Drawn, String> {
    let counts = count(values, range);
    let svg = svg(&counts, range, unit, what).map_err(|error| error.to_string())?;
    let zero = counts.bars[BARS / 2];
    let mut summary = format!(
        "{} of {} {what} within ±{}",
        format::count(zero),
        format::count(values.len() as u64),
        with_unit(range / BARS as f64, unit)
    );
    for (number, words) in
        [(counts.beyond, "beyond the range, in the bars at its ends"), (counts.undefined, "undefined")]
    {
        if number > 0 {
            summary += &format!("; {} {words}", format::count(number));
        }
    }
    Ok(Drawn { svg, summary })
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", format::significant(value, 2)).trim_end().to_owned()
}

fn count(values: &[f32], range: f64) -> Counts {
    let mut counts = Counts { bars: vec![0; BARS], beyond: 0, undefined: 0 };
    for value in values.iter().copied().map(f64::from) {
        if !value.is_finite() {
            counts.undefined += 1;
            continue;
        }
        let share = 0.5 * (value / range + 1.0);
        counts.beyond += u64::from(!(0.0..=1.0).contains(&share));
        // The cast saturates below; 1 itself belongs to the last bar.
        counts.bars[((share * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    counts
}

fn svg(counts: &Counts, range: f64, unit: &str, what: &str) -> Result<String, Box<dyn Error>> {
    register_font();
    let most = counts.bars.iter().copied().max().unwrap_or(0).max(1) as f64;
    // A bar of one must show, and the highest must not touch the top.
    let decades = most.log10().ceil().max(1.0) as i32;
    let low = -0.3;
    let (width, height) = (SIZE.0 as i32 - LEFT - RIGHT, SIZE.1 as i32 - TOP - BOTTOM);
    let x = |value: f64| LEFT + (0.5 * (value / range + 1.0) * f64::from(width)).round() as i32;
    let y = |log10: f64| TOP + height - ((log10 - low) / (f64::from(decades) - low) * f64::from(height)).round() as i32;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let text = |text: &dyn Display, at: (i32, i32), h: HPos, v: VPos| {
            let style = (FAMILY, LABEL_SIZE).into_font().color(&INK).pos(Pos::new(h, v));
            root.draw(&Text::new(text.to_string(), at, style))
        };
        let bottom = TOP + height;
        for decade in 0..=decades {
            let at = y(f64::from(decade));
            root.draw(&PathElement::new(vec![(LEFT, at), (LEFT + width, at)], RULE))?;
            if decades <= 4 || decade % 2 == 0 {
                text(&format::count(10_u64.pow(decade as u32)), (LEFT - 6, at), HPos::Right, VPos::Center)?;
            }
        }
        for (i, &count) in counts.bars.iter().enumerate().filter(|(_, count)| **count > 0) {
            let edge = |i: usize| x(range * (2.0 * i as f64 / BARS as f64 - 1.0));
            let color = match i.cmp(&(BARS / 2)) {
                std::cmp::Ordering::Less => LESS,
                std::cmp::Ordering::Equal => INK,
                std::cmp::Ordering::Greater => MORE,
            };
            let bar = [(edge(i), y((count as f64).log10())), (edge(i + 1) - 1, bottom)];
            root.draw(&Rectangle::new(bar, color.filled()))?;
        }
        root.draw(&PathElement::new(vec![(LEFT, bottom), (LEFT + width, bottom)], INK))?;
        for (value, label) in ticks(-range, range, 4, true) {
            root.draw(&PathElement::new(vec![(x(value), bottom), (x(value), bottom + 4)], INK))?;
            text(&label, (x(value), bottom + 7), HPos::Center, VPos::Top)?;
        }
        let axis =
            if unit.is_empty() { format!("difference → {what}") } else { format!("difference, {unit} → {what}") };
        text(&axis, (LEFT + width / 2, SIZE.1 as i32 - 2), HPos::Center, VPos::Bottom)?;
        root.present()?;
    }
    Ok(themed(&svg))
}

/// The drawing in the page's own colours, without a size of its own.
fn themed(svg: &str) -> String {
    let mut themed = svg.replacen(&format!("width=\"{}\" height=\"{}\" ", SIZE.0, SIZE.1), "class=\"histogram\" ", 1);
    for (RGBColor(red, green, blue), role) in ROLES {
        themed = themed.replace(&format!("\"#{red:02X}{green:02X}{blue:02X}\""), &format!("\"{role}\""));
    }
    themed
}

/// The plotting crate measures text by a font that it must be given.
fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Of the program itself; without it the crate would report an error on drawing text, which is passed on.
        let _ = plotters::style::register_font(FAMILY, FontStyle::Normal, font::BYTES);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_counted_once() {
        let values = [0.0, -1.0, 1.0, 0.999, 7.0, -7.0, f32::NAN, f32::INFINITY];
        let counts = count(&values, 1.0);
        assert_eq!(counts.bars.iter().sum::<u64>(), 6);
        assert_eq!((counts.bars[0], counts.bars[BARS / 2], counts.bars[BARS - 1]), (2, 1, 3));
        assert_eq!((counts.beyond, counts.undefined), (2, 2));
    }

    #[test]
    fn the_drawing_follows_the_page_and_hides_nothing_in_it() {
        let mut values = vec![0.0_f32; 100_000];
        values[7] = 0.9;
        let drawn = draw(&values, 1.0, "</svg><script>", "pixels").unwrap();
        assert!(drawn.svg.contains("currentColor") && drawn.svg.contains("var(--more)"));
        assert!(!drawn.svg.contains("var(--less)") && !drawn.svg.contains("#010101"), "{}", drawn.svg);
        assert!(!drawn.svg.contains("<script") && drawn.svg.matches("</svg>").count() == 1, "{}", drawn.svg);
        assert!(drawn.summary.starts_with("99 999 of 100 000 pixels"), "{}", drawn.summary);
    }

    #[test]
    fn nothing_to_count_still_draws() {
        assert!(draw(&[], 1.0, "", "probes").unwrap().svg.starts_with("<svg class="));
    }
}
