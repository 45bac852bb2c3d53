//! A contact sheet: pictures side by side with their labels, each above its map of differences.

use plotters::element::Text;

use super::draw::{INK, PALE_INK, fitted, font, picture, units};
use super::legend::{self, Legend};
use crate::image::Picture8;

/// Small pictures are enlarged by a whole number to at least this width, px: labels need it.
const WIDTH: u32 = 320;

/// Pictures in a row at most.
const COLUMNS: usize = 4;

const BACKGROUND: [u8; 3] = [255; 3];

// px.
const GAP: u32 = 12;
const TITLE_EM: f64 = 14.0;
const NOTE_EM: f64 = 11.5;
/// Of the two lines of a label, and where they start.
const LABEL: u32 = 40;
const TITLE_TOP: f64 = 4.0;
const NOTE_TOP: f64 = 22.0;

/// One picture. All of a sheet have the same size.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    pub title: String,
    /// In small letters below the title.
    pub note: String,
    pub picture: Picture8,
    /// Below the picture; nothing below the one that the others differ from.
    pub difference: Option<Picture8>,
}

/// All tiles in rows, and below them the legend of the differences.
pub fn draw(tiles: &[Tile], legend: Option<&Legend>) -> Picture8 {
    let Some(first) = tiles.first() else { return Picture8::filled(1, 1, BACKGROUND) };
    let (width, height) = (first.picture.width.max(1), first.picture.height);
    let zoom = WIDTH.div_ceil(width);
    let columns = columns(tiles.len());
    let (tile_width, picture_height) = (width * zoom, height * zoom);
    let maps = if tiles.iter().any(|tile| tile.difference.is_some()) { 2 } else { 1 };
    let row_height = LABEL + maps * picture_height + GAP;
    let sheet_width =
        (columns as u32 * (tile_width + GAP) + GAP).max(if legend.is_some() { legend::MIN_WIDTH } else { 0 });
    let rows = tiles.len().div_ceil(columns) as u32;
    let mut sheet = Picture8::filled(sheet_width, rows * row_height, BACKGROUND);
    for (i, tile) in tiles.iter().enumerate() {
        let left = GAP + (i % columns) as u32 * (tile_width + GAP);
        let top = (i / columns) as u32 * row_height;
        paste(&mut sheet, &label(tile, tile_width), left, top, 1);
        paste(&mut sheet, &tile.picture, left, top + LABEL, zoom);
        if let Some(difference) = &tile.difference {
            paste(&mut sheet, difference, left, top + LABEL + picture_height, zoom);
        }
    }
    if let Some(legend) = legend {
        let strip = legend.draw(sheet_width, 1);
        sheet.height += strip.height;
        sheet.pixels.extend(strip.pixels);
    }
    sheet
}

/// Rows of equal length where that is possible.
fn columns(tiles: usize) -> usize {
    let rows = tiles.div_ceil(COLUMNS).max(1);
    tiles.div_ceil(rows).max(1)
}

fn label(tile: &Tile, width: u32) -> Picture8 {
    picture(width, LABEL, |area| {
        let lines = [(&tile.title, TITLE_EM, TITLE_TOP, INK), (&tile.note, NOTE_EM, NOTE_TOP, PALE_INK)];
        for (text, em, top, color) in lines {
            let text = fitted(text, em, f64::from(width));
            area.draw(&Text::new(text, (0, units(top)), font(em, color)))?;
        }
        Ok(())
    })
}

/// Puts a picture, enlarged by a whole number, onto another, as far as it fits.
fn paste(onto: &mut Picture8, from: &Picture8, left: u32, top: u32, zoom: u32) {
    let width = onto.width as usize;
    let end = (from.width * zoom).min(onto.width.saturating_sub(left));
    for y in 0..(from.height * zoom).min(onto.height.saturating_sub(top)) {
        let row = &from.pixels[(y / zoom) as usize * from.width as usize..];
        let start = (top + y) as usize * width + left as usize;
        for x in 0..end {
            onto.pixels[start + x as usize] = row[(x / zoom) as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(color: [u8; 3], with_difference: bool) -> Tile {
        let picture = Picture8::filled(100, 50, color);
        let difference = with_difference.then(|| Picture8::filled(100, 50, [1, 2, 3]));
        Tile { title: "default".to_owned(), note: "error 1 %".to_owned(), picture, difference }
    }

    #[test]
    fn pictures_stand_in_rows_below_their_labels() {
        let colors = [[200, 0, 0], [0, 200, 0], [0, 0, 200], [9, 9, 9], [90, 90, 90]];
        let tiles: Vec<Tile> = colors.iter().enumerate().map(|(i, color)| tile(*color, i > 0)).collect();
        let values = [0.5, -0.5];
        let legend =
            Legend { title: "difference", unit: "W·m⁻²", end: 1.0, missing: "no surface", values: &values };
        let sheet = draw(&tiles, Some(&legend));
        // Five in rows of three and two, four times as large.
        let (width, row) = (3 * (400 + GAP) + GAP, LABEL + 400 + GAP);
        assert_eq!((sheet.width, sheet.height), (width, 2 * row + legend::HEIGHT));
        for (i, color) in colors.iter().enumerate() {
            let (left, top) = (GAP + (i as u32 % 3) * (400 + GAP), (i as u32 / 3) * row + LABEL);
            assert_eq!((sheet.pixel(left, top), sheet.pixel(left + 399, top + 199)), (*color, *color), "{i}");
            let below = if i == 0 { BACKGROUND } else { [1, 2, 3] };
            assert_eq!(sheet.pixel(left + 5, top + 205), below, "{i}");
            let ink = |x: u32, y: u32| sheet.pixel(left + x, top - LABEL + y)[0] < 128;
            assert!((0..60).any(|x| (4..20).any(|y| ink(x, y))), "no label above picture {i}");
        }
    }

    #[test]
    fn rows_are_even() {
        assert_eq!([1, 2, 4, 5, 6, 7, 8, 9].map(columns), [1, 2, 4, 3, 3, 4, 4, 3]);
        assert_eq!(draw(&[], None).pixels.len(), 1);
    }
}
