//! The strip below the picture of the probes that says what their colours mean.

use plotters::element::{Rectangle, Text};

use super::draw::{INK, fill, font, picture, units};
use crate::image::Picture8;

// px.
const MARGIN: u32 = 10;
const LINE: u32 = 18;
const SWATCH: f64 = 11.0;
const EM: f64 = 12.5;

/// One line of the key: the colour of the swatch, that of its rim, and what they mean.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub color: [u8; 3],
    pub rim: [u8; 3],
    pub meaning: &'static str,
}

/// The picture with its key below it, a line for each entry.
pub fn with_key(mut picture_above: Picture8, entries: &[Entry]) -> Picture8 {
    let height = 2 * MARGIN + entries.len() as u32 * LINE;
    let key = picture(picture_above.width, height, |area| {
        let left = f64::from(MARGIN);
        for (line, entry) in entries.iter().enumerate() {
            let top = left + (line as u32 * LINE) as f64;
            for (inset, color) in [(0.0, entry.rim), (1.0, entry.color)] {
                let corner = |at: f64| (units(left + at), units(top + at));
                let corners = [corner(inset), corner(SWATCH - inset)];
                area.draw(&Rectangle::new(corners, fill(color)))?;
            }
            area.draw(&Text::new(entry.meaning, (units(left + 1.6 * SWATCH), units(top)), font(EM, INK)))?;
        }
        Ok(())
    });
    picture_above.height += height;
    picture_above.pixels.extend(key.pixels);
    picture_above
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_stays_and_the_key_stands_below() {
        let entry = |meaning| Entry { color: [200, 0, 0], rim: [0; 3], meaning };
        for width in [600, 120, 16] {
            let above = Picture8::filled(width, 40, [7; 3]);
            let with = with_key(above.clone(), &[entry("inside geometry"), entry("never sampled")]);
            assert_eq!((with.width, with.height), (width, 40 + 2 * MARGIN + 2 * LINE));
            assert_eq!(with.pixels[..above.pixels.len()], above.pixels);
            assert!(with.pixels.contains(&[200, 0, 0]));
        }
    }
}
