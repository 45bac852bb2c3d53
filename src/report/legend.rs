//! The strip below a false-colour picture: title, colour bar, ticks, and the colour of missing values.
//!
//! Layout, top to bottom, in units of 1 px times `zoom`: a hairline; the title's line (with "no data" at its right end); the bar,
//! with a triangle at an end that values go beyond; ticks; their labels.

use plotters::element::{PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::colormap::{MISSING, color_at};
use super::draw::{INK, PALE_INK, fill, fitted, font, picture, text_width, units};
use super::ticks::signed_labels;
use crate::image::Picture8;

/// Height of the whole strip, px at zoom 1.
pub const HEIGHT: u32 = 82;
/// Least width that leaves room for a title and the ticks, px at zoom 1.
pub const MIN_WIDTH: u32 = 480;

const HAIRLINE: RGBColor = RGBColor(208, 208, 208);

// Positions and sizes in px at zoom 1, from the strip's top-left corner.
const MARGIN: f64 = 26.0;
const TITLE_TOP: f64 = 13.0;
const TITLE_EM: f64 = 14.0;
const TITLE_MIN_EM: f64 = 10.5;
const LABEL_EM: f64 = 12.0;
const GAP: f64 = 8.0;
const SWATCH: f64 = 11.0;
const BAR: [f64; 2] = [36.0, 50.0];
const BEYOND: f64 = 9.0;
const TICK: f64 = 5.0;

/// What the strip says.
#[derive(Debug, Clone, Copy)]
pub struct Legend<'a> {
    pub title: &'a str,
    /// Empty for a pure number.
    pub unit: &'a str,
    /// The colours go from −`end` to `end`, in that unit.
    pub end: f32,
    /// What missing values are called.
    pub missing: &'a str,
    /// What the picture shows: whether any is missing, and whether any lies beyond the range.
    pub values: &'a [f32],
}

impl Legend<'_> {
    /// Draws a strip of this width, px; `zoom` ≥ 1 enlarges everything.
    pub fn draw(&self, width: u32, zoom: u32) -> Picture8 {
        let z = f64::from(zoom);
        let (wide, at) = (f64::from(width) / z, |x: f64, y: f64| (units(x * z), units(y * z)));
        let write = |text: &str, place: (i32, i32), em: f64, color: RGBColor, h: HPos| {
            Text::new(text.to_owned(), place, font(em * z, color).pos(Pos::new(h, VPos::Top)))
        };
        let right = (wide - MARGIN).max(MARGIN + 1.0);
        picture(width, HEIGHT * zoom, |area| {
            area.draw(&Rectangle::new([at(0.0, 0.0), at(wide, 1.0)], HAIRLINE.filled()))?;

            let mut room = right - MARGIN;
            if self.values.iter().any(|value| !value.is_finite()) {
                area.draw(&write(self.missing, at(right, TITLE_TOP), LABEL_EM, PALE_INK, HPos::Right))?;
                let x = right - text_width(self.missing, LABEL_EM) - GAP;
                let swatch = [at(x - SWATCH, TITLE_TOP), at(x, TITLE_TOP + SWATCH)];
                area.draw(&Rectangle::new(swatch, fill(MISSING)))?;
                room = x - SWATCH - 2.0 * GAP - MARGIN;
            }
            // A title that is a little too long is set smaller; a much longer one is cut.
            let whole = text_width(&format!("{}  {}", self.title, self.unit), TITLE_EM);
            let em = (TITLE_EM * room / whole).clamp(TITLE_MIN_EM, TITLE_EM);
            let title = fitted(self.title, em, room - GAP - text_width(self.unit, em));
            area.draw(&write(&title, at(MARGIN, TITLE_TOP), em, INK, HPos::Left))?;
            let after = MARGIN + text_width(&title, em) + GAP;
            area.draw(&write(self.unit, at(after, TITLE_TOP), em, PALE_INK, HPos::Left))?;

            let [top, bottom] = BAR;
            let is_beyond = |value: &f32, sign: f32| value.is_finite() && sign * value > self.end;
            for (edge, sign, share) in [(MARGIN, -1.0, 0.0), (right, 1.0, 1.0)] {
                if self.values.iter().any(|value| is_beyond(value, sign)) {
                    let tip = edge + BEYOND * f64::from(sign);
                    let corners = vec![at(edge, top - 1.0), at(tip, 0.5 * (top + bottom)), at(edge, bottom + 1.0)];
                    area.draw(&Polygon::new(corners.clone(), fill(color_at(share))))?;
                    area.draw(&PathElement::new(corners, PALE_INK.stroke_width(units(z) as u32)))?;
                }
            }
            area.draw(&Rectangle::new(
                [at(MARGIN - 1.0, top - 1.0), at(right + 1.0, bottom + 1.0)],
                PALE_INK.filled(),
            ))?;
            let columns = ((right - MARGIN) * z).round();
            for column in 0..columns as u32 {
                let x = |column: u32| MARGIN + f64::from(column) / z;
                let share = f64::from(column) / (columns - 1.0).max(1.0);
                area.draw(&Rectangle::new([at(x(column), top), at(x(column + 1), bottom)], fill(color_at(share))))?;
            }
            for (i, text) in signed_labels(f64::from(self.end)).into_iter().enumerate() {
                let x = MARGIN + i as f64 / 4.0 * (right - MARGIN);
                area.draw(&Rectangle::new([at(x - 0.5, bottom), at(x + 0.5, bottom + TICK)], PALE_INK.filled()))?;
                // Labels stay within the strip.
                let half = 0.5 * text_width(&text, LABEL_EM);
                let x = x.min(wide - half - 0.5 * GAP).max(half + 0.5 * GAP);
                area.draw(&write(&text, at(x, bottom + TICK + 3.0), LABEL_EM, INK, HPos::Center))?;
            }
            Ok(())
        })
    }
}
