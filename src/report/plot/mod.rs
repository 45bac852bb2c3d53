//! Charts as SVG and PNG: points with bars of spread, lines between those that nothing beats, guides, a legend.
//!
//! One picture for all: `plotters` draws the same shapes on its SVG and its bitmap backend. Layout, ticks and mapping are our own,
//! because labels are measured with the bundled font and nothing may be cut off.
//!
//! Colours are those of M. Okabe & K. Ito ("Color Universal Design", 2008), which people with any colour vision tell apart; shapes
//! of marks differ besides.

mod axis;
mod draw;

use std::path::Path;
use std::sync::Once;

use plotters::backend::{BitMapBackend, SVGBackend};
use plotters::drawing::IntoDrawingArea;
use plotters::style::{FontStyle, register_font};

use super::font;
use crate::image::{ImageError, Picture8};
use crate::system::output::{OutputError, write_atomically};
pub use axis::{Axis, Scale};

/// The font's name in SVG files, with what stands in for it where it is not installed; its widths are like DejaVu's.
const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// Side of the square of samples that a bitmap's pixel is averaged over.
const SUPERSAMPLING: u32 = 2;

/// One mark and the spread around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    pub x: f64,
    pub y: f64,
    /// From, to.
    pub x_bar: Option<[f64; 2]>,
    pub y_bar: Option<[f64; 2]>,
    /// Whether nothing beats it: filled, and joined to the others of its series.
    pub on_front: bool,
}

impl Mark {
    pub fn new(x: f64, y: f64) -> Mark {
        Mark { x, y, x_bar: None, y_bar: None, on_front: false }
    }
}

/// Marks of one colour and shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    pub name: String,
    pub marks: Vec<Mark>,
}

/// A dashed line from point to point, in the colour of a series or in grey.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    pub name: String,
    pub series: Option<usize>,
    pub from: (f64, f64),
    pub to: (f64, f64),
    /// Dots instead of dashes.
    pub dotted: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    pub title: String,
    /// In small letters above the legend; empty for none.
    pub note: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    pub guides: Vec<Guide>,
}

/// Size of a chart, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartSize {
    pub width: u32,
    pub height: u32,
}

impl Default for ChartSize {
    fn default() -> Self {
        ChartSize { width: 900, height: 540 }
    }
}

impl Chart {
    /// The chart as the text of an SVG file.
    pub fn svg(&self, size: ChartSize) -> String {
        use_font();
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, (size.width, size.height)).into_drawing_area();
            // A string takes whatever is written to it.
            let _ = draw::draw(self, &area, size, 1).and_then(|()| area.present());
        }
        text
    }

    /// The chart as pixels.
    pub fn picture(&self, size: ChartSize) -> Picture8 {
        use_font();
        let large = ChartSize { width: size.width * SUPERSAMPLING, height: size.height * SUPERSAMPLING };
        let mut bytes = vec![255u8; large.width as usize * large.height as usize * 3];
        {
            let area = BitMapBackend::with_buffer(&mut bytes, (large.width, large.height)).into_drawing_area();
            // A buffer takes whatever is drawn into it.
            let _ = draw::draw(self, &area, large, SUPERSAMPLING).and_then(|()| area.present());
        }
        averaged(&bytes, large)
    }

    /// Writes `path` with `.svg` and with `.png` behind it.
    ///
    /// # Errors
    /// Those of [`write_atomically`].
    pub fn write(&self, path: &Path, size: ChartSize) -> Result<(), ChartError> {
        let svg = self.svg(size);
        write_atomically(&path.with_extension("svg"), |file| std::io::Write::write_all(file, svg.as_bytes()))?;
        Ok(self.picture(size).write_png(&path.with_extension("png"))?)
    }
}

/// A chart could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ChartError {
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// Means over squares of pixels.
fn averaged(bytes: &[u8], large: ChartSize) -> Picture8 {
    let n = SUPERSAMPLING as usize;
    let (width, height) = (large.width / SUPERSAMPLING, large.height / SUPERSAMPLING);
    let mut picture = Picture8::filled(width, height, [255; 3]);
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        let (x, y) = (i % width as usize * n, i / width as usize * n);
        for (channel, out) in pixel.iter_mut().enumerate() {
            let at = |k: usize| u32::from(bytes[((y + k / n) * large.width as usize + x + k % n) * 3 + channel]);
            *out = ((0..n * n).map(at).sum::<u32>() / (n * n) as u32) as u8;
        }
    }
    picture
}

/// Makes the bundled font known to `plotters`.
fn use_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // The font is part of the program and parses, see `font`.
        let _ = register_font(FAMILY, FontStyle::Normal, font::BYTES);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ChartSize = ChartSize { width: 640, height: 400 };

    fn chart(marks: &[(f64, f64)]) -> Chart {
        let marks = marks.iter().map(|&(x, y)| Mark { on_front: true, ..Mark::new(x, y) }).collect();
        Chart {
            title: "error against time".to_owned(),
            note: String::new(),
            x: Axis::new("bake time (s)", Scale::Log),
            y: Axis::new("error (%)", Scale::Log),
            series: vec![Series { name: "a <b> & c".to_owned(), marks }],
            guides: Vec::new(),
        }
    }

    #[test]
    fn names_are_escaped_and_fonts_have_a_generic_one_behind_them() {
        let svg = chart(&[(1.0, 10.0), (10.0, 1.0)]).svg(SIZE);
        assert!(svg.contains("a &lt;b&gt; &amp; c") && !svg.contains("<b>"), "{svg}");
        assert!(svg.contains("sans-serif") && svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }

    /// Two marks on a slope of −1 lie on the screen as the mapping says: the left one higher.
    #[test]
    fn marks_lie_where_their_values_are() {
        let chart = chart(&[(1.0, 10.0), (10.0, 1.0)]);
        let picture = chart.picture(SIZE);
        let blue = |x: u32, y: u32| {
            let [r, g, b] = picture.pixel(x, y);
            b > 130 && r < 90 && g < 160
        };
        let found: Vec<(u32, u32)> =
            (0..400).flat_map(|y| (0..440).map(move |x| (x, y))).filter(|&(x, y)| blue(x, y)).collect();
        let left = found.iter().min_by_key(|p| p.0).expect("a blue mark");
        let right = found.iter().max_by_key(|p| p.0).expect("a blue mark");
        assert!(right.0 > left.0 + 200 && right.1 > left.1 + 150, "{left:?} {right:?}");
    }

    #[test]
    fn charts_of_nothing_and_of_odd_values_are_drawn() {
        for marks in [&[][..], &[(0.0, 1.0), (-1.0, 2.0)], &[(f64::NAN, 1.0)], &[(1e-300, 1e300)], &[(3.0, 3.0)]] {
            for scale in [Scale::Log, Scale::Linear] {
                let mut chart = chart(marks);
                (chart.x.scale, chart.y.scale) = (scale, scale);
                let picture = chart.picture(SIZE);
                assert!(picture.pixels.iter().any(|p| *p != [255; 3]), "{marks:?}");
            }
        }
    }
}
