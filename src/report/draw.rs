//! Drawing by `plotters` with the bundled font: the same shapes as pixels and as SVG.
//!
//! `plotters` places everything on whole units, so drawings are made [`SCALE`] times as large as they are shown. The font
//! is compiled in, so that every machine draws the same pixels: `assets/DejaVuSans-subset.md` says how it was cut down,
//! `assets/DejaVuSans-LICENSE.txt` on what terms.

use std::sync::Once;

use image::{RgbImage, imageops};
use plotters::backend::{BitMapBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::prelude::DrawingBackend;
use plotters::style::{Color, FontStyle, RGBColor, ShapeStyle, TextStyle, register_font};

use crate::image::Picture8;

/// Units of a drawing for one pixel.
pub const SCALE: u32 = 4;

pub const INK: RGBColor = RGBColor(28, 28, 30);
pub const PALE_INK: RGBColor = RGBColor(102, 102, 106);

/// The font's name in SVG files, with what stands in for it where it is not installed; their widths are like DejaVu's.
const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// `plotters` takes the height from ascent to descent for a font's size; DejaVu's is 1.164 em.
const HEIGHT_PER_EM: f64 = 1.164;

pub type Area<DB> = DrawingArea<DB, Shift>;
pub type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

/// Pixels in units of a drawing.
pub fn units(pixels: f64) -> i32 {
    (pixels * f64::from(SCALE)).round() as i32
}

pub fn fill([red, green, blue]: [u8; 3]) -> ShapeStyle {
    RGBColor(red, green, blue).filled()
}

/// A white picture with what `draw` draws on it.
pub fn picture(
    width: u32,
    height: u32,
    draw: impl FnOnce(&Area<BitMapBackend>) -> Drawn<BitMapBackend<'static>>,
) -> Picture8 {
    let size = (width * SCALE, height * SCALE);
    let mut large = RgbImage::from_pixel(size.0, size.1, image::Rgb([255; 3]));
    {
        let area = BitMapBackend::with_buffer(&mut large, size).into_drawing_area();
        // A buffer takes whatever is drawn into it.
        let _ = draw(&area).and_then(|()| area.present());
    }
    let pixels = imageops::thumbnail(&large, width, height).pixels().map(|pixel| pixel.0).collect();
    Picture8 { width, height, pixels }
}

/// The text of an SVG file with what `draw` draws.
pub fn svg(width: u32, height: u32, draw: impl FnOnce(&Area<SVGBackend>) -> Drawn<SVGBackend<'static>>) -> String {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (width * SCALE, height * SCALE)).into_drawing_area();
        // A string takes whatever is written to it.
        let _ = draw(&area).and_then(|()| area.present());
    }
    let size = |scale| format!("width=\"{}\" height=\"{}\"", width * scale, height * scale);
    text.replacen(&size(SCALE), &size(1), 1)
}

/// The bundled font at `em` pixels per em.
pub fn font(em: f64, color: RGBColor) -> TextStyle<'static> {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // The font is part of the program, and a test draws with it.
        let _ = register_font(FAMILY, FontStyle::Normal, include_bytes!("assets/DejaVuSans-subset.ttf"));
    });
    let mut style = TextStyle::from((FAMILY, em * HEIGHT_PER_EM * f64::from(SCALE)));
    style.color = color.to_backend_color();
    style
}

/// Width of one line of text, pixels.
pub fn text_width(text: &str, em: f64) -> f64 {
    font(em, INK).font.box_size(text).map_or(0.0, |(width, _)| f64::from(width) / f64::from(SCALE))
}

/// `text`, or as much of its start as fits into `width` pixels with an ellipsis behind it.
pub fn fitted(text: &str, em: f64, width: f64) -> String {
    let mut fitted = text.to_owned();
    let mut kept = text.chars();
    while text_width(&fitted, em) > width && kept.next_back().is_some() {
        fitted = format!("{}…", kept.as_str().trim_end());
    }
    fitted
}

#[cfg(test)]
mod tests {
    use plotters::element::Text;

    use super::*;

    #[test]
    fn text_stays_within_its_measure() {
        let text = "Hamburg 0.25";
        let drawn = picture(200, 40, |area| area.draw(&Text::new(text, (units(20.0), units(10.0)), font(14.0, INK))));
        let columns = (0..200).filter(|&x| (0..40).any(|y| drawn.pixel(x, y)[0] < 192));
        let (first, last) = (columns.clone().min().unwrap(), columns.max().unwrap());
        // Side bearings are about a tenth of an em; plotters leaves those before a glyph out, so that two may stand at the end.
        assert!((20..23).contains(&first), "{first}");
        let end = 20.0 + text_width(text, 14.0);
        let right_edge = f64::from(last + 1);
        assert!(right_edge <= end.ceil() && right_edge > end - 3.0, "{right_edge} of {end}");
    }

    #[test]
    fn the_font_has_what_labels_need() {
        let width = |character: char| text_width(&character.to_string(), 1000.0);
        // A character that the font lacks has the width of its box for missing ones; some others have it by chance.
        let missing = width('\u{4E00}');
        for character in "aZ09 ·−×σπ²³⁻¹⁰⁴⁹→≤≥%µ–…ÊΔρ±∞".chars() {
            assert!(width(character) != missing, "no glyph for {character}");
        }
    }

    #[test]
    fn long_text_is_shortened_to_fit() {
        assert_eq!(fitted("short", 12.0, 100.0), "short");
        let shortened = fitted("a very long title that cannot fit", 12.0, 80.0);
        assert!(shortened.ends_with('…') && text_width(&shortened, 12.0) <= 80.0, "{shortened}");
    }
}
