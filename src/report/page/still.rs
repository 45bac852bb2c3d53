//! Small pictures that need no script: for print, for browsers without one, and until the real ones are decoded.

use std::io;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;

use super::shrink::{PixelExtent, mean_of_blocks, peak_of_blocks};
use crate::image::{Picture, Picture8, tonemap};
use crate::math::color::byte_from_unit;
use crate::report::colormap::color;
use crate::report::legend::Legend;

/// Marks pixels that are no light: a colour that light seldom has.
pub const MARK: [u8; 3] = [255, 0, 255];

/// Widths of small pictures for up to so many pairs, px: many pairs would else fill the page by these alone.
const WIDTHS: [(usize, u32); 2] = [(8, 800), (24, 480)];
const LEAST_WIDTH: u32 = 320;

/// Pictures of up to so many pixels are kept without loss.
const MOST_PNG_PIXELS: usize = 128 * 128;

/// Width of the legend at zoom 1, px: that of a telephone.
const LEGEND_WIDTH: u32 = 372;
/// Pixels of the legend's picture for one of the page, for screens that have several.
const LEGEND_ZOOM: u32 = 2;

/// The width of small pictures in a page of so many pairs, px.
pub fn width_for(pairs: usize) -> u32 {
    WIDTHS.iter().find(|(most, _)| pairs <= *most).map_or(LEAST_WIDTH, |(_, width)| *width)
}

/// One side, at an exposure or as it is, at most `width` wide, as a data URI.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn side(picture: &Picture, exposure_ev: Option<f32>, width: u32) -> io::Result<String> {
    let factor = picture.width.div_ceil(width).max(1);
    let color = |pixel: Vec3| {
        let shown = exposure_ev.map_or(pixel, |ev| tonemap(pixel, ev));
        if pixel.is_finite() { shown.to_array().map(byte_from_unit) } else { MARK }
    };
    let size = PixelExtent { width: picture.width, height: picture.height };
    data_uri(size.shrunk(factor), mean_of_blocks(&picture.pixels, size, factor).into_iter().map(color).collect())
}

/// The differences in the colours of a heat map that ends at ±`range`, as a data URI.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn heatmap(values: &[f32], size: PixelExtent, range: f32, width: u32) -> io::Result<String> {
    let factor = size.width.div_ceil(width).max(1);
    let values = peak_of_blocks(values, size, factor);
    data_uri(size.shrunk(factor), values.into_iter().map(|value| color(value, range)).collect())
}

/// The strip that explains the heat map's colours, as a data URI.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn legend(values: &[f32], range: f32, unit: &str) -> io::Result<String> {
    let legend = Legend { title: "candidate − base", unit, end: range, missing: "not compared", values };
    png_uri(&legend.draw(LEGEND_WIDTH * LEGEND_ZOOM, LEGEND_ZOOM))
}

/// A picture as a data URI: as JPEG, unless it is so small that single pixels are seen.
fn data_uri(size: PixelExtent, pixels: Vec<[u8; 3]>) -> io::Result<String> {
    let picture = Picture8 { width: size.width, height: size.height, pixels };
    if size.pixels() <= MOST_PNG_PIXELS {
        return png_uri(&picture);
    }
    let mut bytes = Vec::new();
    picture.encode_jpeg(&mut bytes)?;
    Ok(format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes)))
}

fn png_uri(picture: &Picture8) -> io::Result<String> {
    let mut bytes = Vec::new();
    picture.encode_png(&mut bytes)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}
