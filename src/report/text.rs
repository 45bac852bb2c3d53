//! Text in pictures: measured and drawn by the same layout, so that it ends where its measure says.

use ab_glyph::{Font, Glyph, ScaleFont, point};

use super::canvas::blend;
use super::font::{FONT, scale_from_em};
use crate::image::Picture8;

/// What a text's x coordinate names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Left,
    Centre,
    Right,
}

/// Size in pixels per em, and colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextStyle {
    pub em_px: f32,
    pub color: [u8; 3],
}

/// Width of one line of text, pixels.
pub fn text_width(text: &str, em_px: f32) -> f32 {
    lay_out(text, em_px).1
}

/// Draws one line of text with its baseline at `baseline_y` and its left end, middle or right end at `x`.
pub fn draw_text(picture: &mut Picture8, text: &str, style: TextStyle, x: f32, baseline_y: f32, anchor: Anchor) {
    let (glyphs, width) = lay_out(text, style.em_px);
    let left = match anchor {
        Anchor::Left => x,
        Anchor::Centre => x - 0.5 * width,
        Anchor::Right => x - width,
    };
    for mut glyph in glyphs {
        // Whole pixels vertically: a baseline between two rows would blur every stem's foot.
        glyph.position = point(glyph.position.x + left, baseline_y.round());
        if let Some(outline) = FONT.outline_glyph(glyph) {
            let bounds = outline.px_bounds();
            outline.draw(|column, row, coverage| {
                let (x, y) = (bounds.min.x as i64 + i64::from(column), bounds.min.y as i64 + i64::from(row));
                blend(picture, x, y, style.color, coverage);
            });
        }
    }
}

/// `text`, or as much of its start as fits into `width_px` with an ellipsis behind it.
pub fn fitted(text: &str, em_px: f32, width_px: f32) -> String {
    if text_width(text, em_px) <= width_px {
        return text.to_owned();
    }
    let mut kept: String = text.to_owned();
    while kept.pop().is_some() {
        let shortened = format!("{}…", kept.trim_end());
        if text_width(&shortened, em_px) <= width_px {
            return shortened;
        }
    }
    String::new()
}

/// The glyphs of one line from x = 0 on, and where the next one would stand.
fn lay_out(text: &str, em_px: f32) -> (Vec<Glyph>, f32) {
    let scale = scale_from_em(em_px);
    let font = FONT.as_scaled(scale);
    let mut x = 0.0;
    let mut previous = None;
    let mut glyphs = Vec::new();
    for character in text.chars() {
        let id = font.glyph_id(character);
        if let Some(previous) = previous {
            x += font.kern(previous, id);
        }
        glyphs.push(id.with_scale_and_position(scale, point(x, 0.0)));
        x += font.h_advance(id);
        previous = Some(id);
    }
    (glyphs, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_within_its_measure() {
        let style = TextStyle { em_px: 14.0, color: [255; 3] };
        let text = "Hamburg 0.25";
        let mut picture = Picture8::filled(200, 40, [0; 3]);
        draw_text(&mut picture, text, style, 20.0, 25.0, Anchor::Left);
        let columns = (0..200).filter(|&x| (0..40).any(|y| picture.pixel(x, y)[0] > 64));
        let (first, last) = (columns.clone().min().unwrap(), columns.max().unwrap());
        // Side bearings are about a tenth of an em.
        assert!((20..23).contains(&first), "{first}");
        let end = 20.0 + text_width(text, 14.0);
        assert!((last as f32) < end && last as f32 > end - 3.0, "{last} of {end}");
    }

    #[test]
    fn long_text_is_shortened_to_fit() {
        assert_eq!(fitted("short", 12.0, 100.0), "short");
        let shortened = fitted("a very long title that cannot fit", 12.0, 80.0);
        assert!(shortened.ends_with('…') && text_width(&shortened, 12.0) <= 80.0, "{shortened}");
        assert_eq!(fitted("W", 12.0, 1.0), "");
    }
}
