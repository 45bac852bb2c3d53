//! The strip below the picture of the probes that says what their colours mean.

use super::canvas::{Rect, fill, paste};
use super::text::{Anchor, TextStyle, draw_text, text_width};
use crate::image::Picture8;

const BACKGROUND: [u8; 3] = [255, 255, 255];
const INK: [u8; 3] = [28, 28, 30];

// px.
const MARGIN: u32 = 10;
const LINE: u32 = 22;
const SWATCH: u32 = 11;
const SWATCH_GAP: u32 = 6;
const ENTRY_GAP: u32 = 22;
const EM: f32 = 12.5;

/// One line of the key: the colour of the swatch, that of its rim, and what they mean.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub color: [u8; 3],
    pub rim: [u8; 3],
    pub meaning: &'static str,
}

/// The picture with its key below it, in as many lines as its width asks for.
pub fn with_key(picture: &Picture8, entries: &[Entry]) -> Picture8 {
    let width_of = |entry: &Entry| SWATCH + SWATCH_GAP + text_width(entry.meaning, EM).ceil() as u32;
    let (mut x, mut line) = (MARGIN, 0);
    let mut places = Vec::new();
    for entry in entries {
        let width = width_of(entry);
        if x > MARGIN && x + width + MARGIN > picture.width {
            (x, line) = (MARGIN, line + 1);
        }
        places.push((x, line));
        x += width + ENTRY_GAP;
    }
    let height = picture.height + MARGIN + (line + 1) * LINE;
    let mut out = Picture8::filled(picture.width, height, BACKGROUND);
    paste(&mut out, picture, 0, 0, 1);
    for (entry, (x, line)) in entries.iter().zip(places) {
        let baseline = picture.height + MARGIN + line * LINE + SWATCH;
        let swatch = Rect { x, y: baseline - SWATCH, width: SWATCH, height: SWATCH };
        fill(&mut out, swatch, entry.rim);
        fill(&mut out, Rect { x: x + 1, y: swatch.y + 1, width: SWATCH - 2, height: SWATCH - 2 }, entry.color);
        let style = TextStyle { em_px: EM, color: INK };
        draw_text(&mut out, entry.meaning, style, (x + SWATCH + SWATCH_GAP) as f32, baseline as f32, Anchor::Left);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_stays_and_the_key_stands_below() {
        let entry = |meaning| Entry { color: [200, 0, 0], rim: [0; 3], meaning };
        for (width, lines) in [(600, 1), (120, 2), (16, 2)] {
            let picture = Picture8::filled(width, 40, [7; 3]);
            let with = with_key(&picture, &[entry("inside geometry"), entry("never sampled")]);
            assert_eq!((with.width, with.height), (width, 40 + MARGIN + lines * LINE));
            assert_eq!(with.pixels[..picture.pixels.len()], picture.pixels);
            assert!(with.pixels.contains(&[200, 0, 0]));
        }
    }
}
