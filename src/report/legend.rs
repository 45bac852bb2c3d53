//! The strip below a false-colour picture: title, colour bar, ticks, and the colour of missing values.
//!
//! Layout, top to bottom, in units of 1 px times `zoom`: a hairline; the title's line (with "no data" at its right end); the bar,
//! with a triangle at an end that values go beyond; ticks; their labels.

use super::canvas::{Rect, blend, fill, fill_triangle, frame};
use super::colormap::{Colormap, MISSING, Scale};
use super::text::{Anchor, TextStyle, draw_text, fitted, text_width};
use super::ticks::ticks;
use crate::image::Picture8;

/// Height of the whole strip, px at zoom 1.
pub const HEIGHT: u32 = 82;
/// Least width that leaves room for a title and some ticks, px at zoom 1.
pub const MIN_WIDTH: u32 = 480;

const BACKGROUND: [u8; 3] = [255, 255, 255];
const HAIRLINE: [u8; 3] = [208, 208, 208];
const INK: [u8; 3] = [28, 28, 30];
const PALE_INK: [u8; 3] = [102, 102, 106];

// Positions and sizes in px at zoom 1, from the strip's top-left corner.
const MARGIN: u32 = 26;
const TITLE_BASELINE: u32 = 24;
const TITLE_EM: f32 = 14.5;
const TITLE_MIN_EM: f32 = 11.5;
const BAR_TOP: u32 = 36;
const BAR_HEIGHT: u32 = 14;
const BAR_END_WIDTH: u32 = 9;
const TICK_LENGTH: u32 = 4;
const LABEL_BASELINE: u32 = 69;
const LABEL_EM: f32 = 12.0;
const LABEL_GAP: f32 = 14.0;
/// Room that is kept between a label and the picture's edge.
const LABEL_EDGE: f32 = 6.0;
const SWATCH: u32 = 11;
/// Most ticks that a bar gets, however wide: more are not read.
const MAX_TICKS: usize = 9;
/// Ticks that are enough to give up a finer step for one that hits both ends of the bar.
const ENOUGH_TICKS: usize = 4;

/// What the strip says.
#[derive(Debug, Clone, Copy)]
pub struct Legend<'a> {
    pub title: &'a str,
    /// Empty for a pure number.
    pub unit: &'a str,
    pub colormap: Colormap,
    /// What missing values are called; `None` where there are none.
    pub missing: Option<&'a str>,
    /// Whether values lie below and above the range.
    pub beyond: [bool; 2],
}

impl Legend<'_> {
    /// Draws the strip across the whole width of `picture` from row `top` down, and returns where the bar lies.
    /// `zoom` ≥ 1 enlarges everything.
    pub fn draw(&self, picture: &mut Picture8, top: u32, zoom: u32) -> Rect {
        let width = picture.width;
        fill(picture, Rect { x: 0, y: top, width, height: HEIGHT * zoom }, BACKGROUND);
        fill(picture, Rect { x: 0, y: top, width, height: zoom }, HAIRLINE);

        let title_right = self.draw_missing(picture, top, zoom);
        self.draw_title(picture, top, title_right, zoom);

        // The triangles hang over into the margin, so that the bars of two pictures line up.
        let x = MARGIN * zoom;
        let bar =
            Rect { x, y: top + BAR_TOP * zoom, width: width.saturating_sub(2 * x).max(1), height: BAR_HEIGHT * zoom };
        self.draw_bar(picture, bar, zoom);
        self.draw_ticks(picture, bar, top, zoom);
        bar
    }

    /// Draws the swatch of missing values at the right end of the title's line, and returns how far the title may reach.
    fn draw_missing(&self, picture: &mut Picture8, top: u32, zoom: u32) -> f32 {
        let right = picture.width.saturating_sub(MARGIN * zoom) as f32;
        let Some(name) = self.missing else {
            return right;
        };
        let em_px = LABEL_EM * zoom as f32;
        let baseline = top + TITLE_BASELINE * zoom;
        draw_text(picture, name, TextStyle { em_px, color: PALE_INK }, right, baseline as f32, Anchor::Right);
        let size = SWATCH * zoom;
        let left = right - text_width(name, em_px) - (SWATCH + 6) as f32 * zoom as f32;
        let swatch = Rect { x: left.max(0.0) as u32, y: baseline + zoom - size, width: size, height: size };
        fill(picture, swatch, MISSING);
        left - LABEL_GAP * zoom as f32
    }

    fn draw_title(&self, picture: &mut Picture8, top: u32, right: f32, zoom: u32) {
        let left = (MARGIN * zoom) as f32;
        let baseline = (top + TITLE_BASELINE * zoom) as f32;
        let unit = if self.unit.is_empty() { String::new() } else { format!("  {}", self.unit) };
        let whole = format!("{}{unit}", self.title);
        let room = (right - left).max(0.0);
        let wanted = TITLE_EM * zoom as f32;
        // A little too long is set smaller; much too long is cut.
        let em_px = (wanted * room / text_width(&whole, wanted).max(1.0)).clamp(TITLE_MIN_EM * zoom as f32, wanted);
        let title = fitted(self.title, em_px, room - text_width(&unit, em_px));
        draw_text(picture, &title, TextStyle { em_px, color: INK }, left, baseline, Anchor::Left);
        let after = left + text_width(&title, em_px);
        draw_text(picture, &unit, TextStyle { em_px, color: PALE_INK }, after, baseline, Anchor::Left);
    }

    fn draw_bar(&self, picture: &mut Picture8, bar: Rect, zoom: u32) {
        frame(picture, bar, zoom, PALE_INK);
        for column in 0..bar.width {
            let share = f64::from(column) / f64::from((bar.width - 1).max(1));
            let rect = Rect { x: bar.x + column, width: 1, ..bar };
            fill(picture, rect, self.colormap.color_at(share));
        }
        let (top, bottom) = (bar.y as f32, (bar.y + bar.height) as f32);
        let middle = 0.5 * (top + bottom);
        let reach = (BAR_END_WIDTH * zoom) as f32;
        // One zoomed pixel of frame lies between the bar and its triangle.
        let (left, right) = ((bar.x - zoom) as f32, (bar.x + bar.width + zoom) as f32);
        let ends = [(left, left - reach, 0.0), (right, right + reach, 1.0)];
        for ((base, tip, share), beyond) in ends.into_iter().zip(self.beyond) {
            if beyond {
                let outset = 1.6 * zoom as f32;
                let outer = [
                    (base, top - zoom as f32),
                    (tip + outset * (tip - base).signum(), middle),
                    (base, bottom + zoom as f32),
                ];
                fill_triangle(picture, outer, PALE_INK);
                fill_triangle(picture, [(base, top), (tip, middle), (base, bottom)], self.colormap.color_at(share));
            }
        }
    }

    fn draw_ticks(&self, picture: &mut Picture8, bar: Rect, top: u32, zoom: u32) {
        let em_px = LABEL_EM * zoom as f32;
        let baseline = (top + LABEL_BASELINE * zoom) as f32;
        let [low, high] = self.colormap.range().map(f64::from);
        let position = |value: f64| bar.x as f64 + (value - low) / (high - low) * f64::from(bar.width - 1);
        let tick_top = bar.y + bar.height + zoom;
        for (value, label) in self.ticks_that_fit(bar, em_px, zoom) {
            let centre = position(value) + 0.5;
            let left = centre.round() as i64 - i64::from(zoom.div_ceil(2));
            for y in tick_top..tick_top + TICK_LENGTH * zoom {
                for x in left..left + i64::from(zoom) {
                    blend(picture, x, i64::from(y), PALE_INK, 1.0);
                }
            }
            // Centred on the number: a sign would else push it off its tick.
            let sign = label.chars().next().filter(|first| "+−".contains(*first)).map(String::from).unwrap_or_default();
            let half_width = 0.5 * text_width(&label, em_px);
            let reach = half_width + LABEL_EDGE * zoom as f32;
            let x = (centre as f32 - 0.5 * text_width(&sign, em_px)).min(picture.width as f32 - reach).max(reach);
            draw_text(picture, &label, TextStyle { em_px, color: INK }, x, baseline, Anchor::Centre);
        }
    }

    /// As many ticks as leave a gap between their labels; sooner fewer ones than none at the ends.
    fn ticks_that_fit(&self, bar: Rect, em_px: f32, zoom: u32) -> Vec<(f64, String)> {
        let [low, high] = self.colormap.range().map(f64::from);
        let signed = self.colormap.scale() == Scale::Diverging;
        let fits = |ticks: &Vec<(f64, String)>| {
            let widest = ticks.iter().map(|(_, label)| text_width(label, em_px)).fold(0.0, f32::max);
            let spacing = bar.width as f32 / (ticks.len().max(2) - 1) as f32;
            widest + LABEL_GAP * zoom as f32 <= spacing
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1.0e-6 * (high - low);
        let hits_both_ends = |ticks: &Vec<(f64, String)>| {
            ticks.first().is_some_and(|tick| near(tick.0, low)) && ticks.last().is_some_and(|tick| near(tick.0, high))
        };
        let mut fitting: Vec<_> =
            (1..=MAX_TICKS).rev().map(|at_most| ticks(low, high, at_most, signed)).filter(fits).collect();
        let best = fitting.iter().position(|ticks| ticks.len() >= ENOUGH_TICKS && hits_both_ends(ticks)).unwrap_or(0);
        if fitting.is_empty() { Vec::new() } else { fitting.swap_remove(best) }
    }
}
