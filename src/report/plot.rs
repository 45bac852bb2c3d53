//! Charts with logarithmic axes as SVG and PNG: points with bars from least to most, lines between those that nothing beats,
//! guides, a legend.
//!
//! Colours are those of M. Okabe & K. Ito ("Color Universal Design", 2008), which people with any colour vision tell apart; shapes
//! of marks differ besides.

use std::f64::consts::TAU;
use std::path::Path;

use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::draw::{self, Area, Drawn, INK, PALE_INK, SCALE, fitted, font, text_width, units};
use super::ticks::{label, log_ticks};
use crate::image::ImageError;
use crate::system::output::write_atomically;

/// Of a chart, px.
const WIDTH: u32 = 900;
const HEIGHT: u32 = 540;

/// Okabe and Ito's colours but for yellow, which white swallows.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
/// Corners of a series' mark, turn of the first one and its distance from the middle, px: circle, square, triangle, diamond.
const SHAPES: [(u32, f64, f64); 4] = [(24, 0.0, 4.5), (4, 0.125, 5.7), (3, -0.25, 5.8), (4, 0.0, 5.7)];
const GRID: RGBColor = RGBColor(222, 222, 222);
const FINE_GRID: RGBColor = RGBColor(242, 242, 242);

// px.
const EM: f64 = 13.0;
const TITLE_EM: f64 = 16.0;
const SMALL_EM: f64 = 11.0;
const GAP: f64 = 10.0;
const SAMPLE: f64 = 26.0;
/// Widest text of the legend.
const LEGEND: f64 = 0.36 * WIDTH as f64;

/// Share of the range that stays free on both sides.
const PADDING: f64 = 0.05;
/// Ranges are widened by at least this factor: tiny differences should look tiny.
const LEAST_FACTOR: f64 = 1.1;

/// In units of a drawing.
type Point = (i32, i32);

/// One mark and the bars around it; axes have no place for what is not positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    pub x: f64,
    pub y: f64,
    /// From, to; both the mark's own for no bar.
    pub x_bar: [f64; 2],
    pub y_bar: [f64; 2],
    /// Whether nothing beats it: filled, and joined to the others of its series.
    pub on_front: bool,
}

/// Marks of one colour and shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    pub name: String,
    pub marks: Vec<Mark>,
}

/// A dashed line from point to point, in the colour of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    pub name: String,
    pub series: usize,
    pub ends: [(f64, f64); 2],
    /// Dots instead of dashes.
    pub dotted: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    pub title: String,
    /// In small letters below the title.
    pub note: String,
    /// With their units.
    pub x_label: String,
    pub y_label: String,
    pub series: Vec<Series>,
    pub guides: Vec<Guide>,
}

impl Chart {
    /// The chart as the text of an SVG file.
    pub fn svg(&self) -> String {
        draw::svg(WIDTH, HEIGHT, |area| self.draw(area))
    }

    /// Writes `path` with `.svg` and with `.png` behind it.
    ///
    /// # Errors
    /// Those of [`write_atomically`].
    pub fn write(&self, path: &Path) -> Result<(), ImageError> {
        write_atomically(&path.with_extension("svg"), |file| std::io::Write::write_all(file, self.svg().as_bytes()))?;
        draw::picture(WIDTH, HEIGHT, |area| self.draw(area)).write_png(&path.with_extension("png"))
    }

    fn draw<DB: DrawingBackend>(&self, area: &Area<DB>) -> Drawn<DB> {
        let has_place = |mark: &&Mark| [mark.x, mark.y].iter().all(|v| v.is_finite() && *v >= f64::MIN_POSITIVE);
        let marks = || self.series.iter().flat_map(|series| series.marks.iter().filter(has_place));
        let ends = || self.guides.iter().flat_map(|guide| guide.ends);
        let x = range(marks().flat_map(|m| [m.x, m.x_bar[0], m.x_bar[1]]).chain(ends().map(|end| end.0)));
        let y = range(marks().flat_map(|m| [m.y, m.y_bar[0], m.y_bar[1]]).chain(ends().map(|end| end.1)));
        let [[x_ticks, x_between], [y_ticks, y_between]] = [&x, &y].map(|range| log_ticks(range.start, range.end));

        let of_series = self.series.iter().enumerate().map(|(i, series)| (&series.name, i, None));
        let entries = of_series.chain(self.guides.iter().map(|guide| (&guide.name, guide.series, Some(guide.dotted))));
        let legend = entries.clone().map(|(name, ..)| text_width(name, EM)).fold(0.0, f64::max).min(LEGEND);
        let labels = y_ticks.iter().map(|tick| text_width(&label(*tick), EM)).fold(0.0, f64::max);
        let left_out = self.series.iter().map(|series| series.marks.len()).sum::<usize>() - marks().count();
        let left_out = if left_out > 0 { format!("; {left_out} at 0 not shown") } else { String::new() };

        area.fill(&WHITE)?;
        let room = f64::from(WIDTH) - 2.0 * GAP;
        let area = area.margin(units(GAP), units(GAP), units(GAP), units(GAP));
        let area = area.titled(&fitted(&self.title, TITLE_EM, room), font(TITLE_EM, INK))?;
        let note = format!("{}{left_out}", self.note);
        let area = area.titled(&fitted(&note, SMALL_EM, room), font(SMALL_EM, PALE_INK))?;
        let (plot, key) = area.split_horizontally(units(room - legend - SAMPLE - 2.0 * GAP));
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(units(GAP))
            .x_label_area_size(units(3.5 * EM))
            .y_label_area_size(units(labels + EM + 2.5 * GAP))
            .build_cartesian_2d(
                x.log_scale().with_key_points(x_ticks).with_light_points(x_between),
                y.log_scale().with_key_points(y_ticks).with_light_points(y_between),
            )?;
        chart
            .configure_mesh()
            .bold_line_style(GRID.stroke_width(SCALE))
            .light_line_style(FINE_GRID.stroke_width(SCALE))
            .axis_style(INK.stroke_width(SCALE))
            .label_style(font(EM, INK))
            .x_label_formatter(&|value| label(*value))
            .y_label_formatter(&|value| label(*value))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .set_all_tick_mark_size(units(0.5 * GAP))
            .draw()?;
        for guide in &self.guides {
            let [dash, gap] = dashes(guide.dotted);
            chart.draw_series(DashedLineSeries::new(guide.ends, dash, gap, stroke(guide.series)))?;
        }
        for (i, series) in self.series.iter().enumerate() {
            let marks: Vec<&Mark> = series.marks.iter().filter(has_place).collect();
            let mut front: Vec<(f64, f64)> = marks.iter().filter(|m| m.on_front).map(|m| (m.x, m.y)).collect();
            front.sort_by(|a, b| a.0.total_cmp(&b.0));
            let bars = marks.iter().flat_map(|m| [m.x_bar.map(|x| (x, m.y)), m.y_bar.map(|y| (m.x, y))]);
            chart.draw_series(bars.map(|bar| PathElement::new(bar, color(i).stroke_width(SCALE))))?;
            chart.draw_series([PathElement::new(front, stroke(i))])?;
            chart.draw_series(marks.iter().map(|m| {
                let (area, outline) = mark((0, 0), i, m.on_front);
                EmptyElement::at((m.x, m.y)) + area + outline
            }))?;
        }
        for (row, (name, series, dotted)) in entries.enumerate() {
            let y = units(GAP + (row as f64 + 0.5) * 1.5 * EM);
            let line = [(units(GAP), y), (units(GAP + SAMPLE), y)];
            if let Some([dash, gap]) = dotted.map(dashes) {
                key.draw(&DashedPathElement::new(line, dash, gap, stroke(series)))?;
            } else {
                let (area, outline) = mark((units(GAP + 0.5 * SAMPLE), y), series, true);
                key.draw(&PathElement::new(line, stroke(series)))?;
                key.draw(&area)?;
                key.draw(&outline)?;
            }
            let style = font(EM, INK).pos(Pos::new(HPos::Left, VPos::Center));
            key.draw(&Text::new(fitted(name, EM, legend), (units(1.7 * GAP + SAMPLE), y), style))?;
        }
        Ok(())
    }
}

fn stroke(series: usize) -> ShapeStyle {
    color(series).stroke_width(units(1.5) as u32)
}

/// Lengths of dash and gap.
fn dashes(dotted: bool) -> [i32; 2] {
    if dotted { [2.0, 4.0] } else { [8.0, 5.0] }.map(units)
}

fn color(series: usize) -> RGBColor {
    COLORS[series % COLORS.len()]
}

/// Just wider than the positive ones of these values.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let logs = values.filter(|v| v.is_finite() && *v >= f64::MIN_POSITIVE).map(f64::ln);
    let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
    let free = (PADDING * (high - low)).max(if high - low < LEAST_FACTOR.ln() { LEAST_FACTOR.ln() } else { 0.0 });
    (low - free).exp().max(f64::MIN_POSITIVE)..(high + free).exp().min(f64::MAX)
}

/// Area and outline of a series' mark; a hollow one is not on the front.
fn mark(at: Point, series: usize, filled: bool) -> (Polygon<Point>, PathElement<Point>) {
    let (corners, turn, reach) = SHAPES[series % SHAPES.len()];
    let corner = |i: u32| (TAU * (f64::from(i) / f64::from(corners) + turn)).sin_cos();
    let corners: Vec<_> =
        (0..=corners).map(corner).map(|(y, x)| (at.0 + units(reach * x), at.1 + units(reach * y))).collect();
    let color = color(series);
    let area = Polygon::new(corners.clone(), if filled { color } else { WHITE }.filled());
    (area, PathElement::new(corners, stroke(series)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(marks: &[(f64, f64)]) -> Chart {
        let mark = |&(x, y): &(f64, f64)| Mark { x, y, x_bar: [x; 2], y_bar: [y; 2], on_front: true };
        Chart {
            title: "error against time".to_owned(),
            note: String::new(),
            x_label: "bake time (s)".to_owned(),
            y_label: "error (%)".to_owned(),
            series: vec![Series { name: "a <b> & c".to_owned(), marks: marks.iter().map(mark).collect() }],
            guides: Vec::new(),
        }
    }

    #[test]
    fn names_are_escaped_and_fonts_have_a_generic_one_behind_them() {
        let svg = chart(&[(1.0, 10.0), (10.0, 1.0)]).svg();
        assert!(svg.contains("a &lt;b&gt; &amp; c") && !svg.contains("<b>"), "{svg}");
        assert!(svg.contains("sans-serif") && svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("width=\"900\" height=\"540\" viewBox=\"0 0 3600 2160\""), "{}", &svg[..200]);
    }

    /// Two marks on a slope of −1 lie on the screen as the mapping says: the left one higher.
    #[test]
    fn marks_lie_where_their_values_are() {
        let chart = chart(&[(1.0, 10.0), (10.0, 1.0)]);
        let picture = draw::picture(WIDTH, HEIGHT, |area| chart.draw(area));
        let blue = |x: u32, y: u32| {
            let [r, g, b] = picture.pixel(x, y);
            b > 130 && r < 90 && g < 160
        };
        let found: Vec<(u32, u32)> =
            (0..HEIGHT).flat_map(|y| (0..700).map(move |x| (x, y))).filter(|&(x, y)| blue(x, y)).collect();
        let left = found.iter().min_by_key(|p| p.0).expect("a blue mark");
        let right = found.iter().max_by_key(|p| p.0).expect("a blue mark");
        assert!(right.0 > left.0 + 400 && right.1 > left.1 + 300, "{left:?} {right:?}");
    }

    #[test]
    fn charts_of_nothing_and_of_odd_values_are_drawn() {
        for marks in [&[][..], &[(0.0, 1.0), (-1.0, 2.0)], &[(f64::NAN, 1.0)], &[(1e-300, 1e300)], &[(3.0, 3.0)]] {
            let chart = chart(marks);
            let picture = draw::picture(WIDTH, HEIGHT, |area| chart.draw(area));
            assert!(picture.pixels.iter().any(|p| *p != [255; 3]), "{marks:?}");
            let is_left_out = |mark: &(f64, f64)| mark.0.is_nan() || mark.0 <= 0.0;
            assert_eq!(chart.svg().contains("not shown"), marks.iter().any(is_left_out));
        }
    }
}
