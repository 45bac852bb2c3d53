//! A chart's shapes, on any backend.

use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{Circle, PathElement, Polygon, Rectangle};
use plotters::prelude::DrawingBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontDesc, FontFamily, FontStyle, FontTransform, RGBColor, ShapeStyle, TextStyle};

use super::axis::Span;
use super::{Chart, ChartSize, FAMILY, Mark};
use crate::report::text::{fitted, text_width};

/// Okabe and Ito's colours but for yellow, which white swallows.
const COLORS: &[RGBColor] = &[
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
const INK: RGBColor = RGBColor(40, 40, 40);
const GREY: RGBColor = RGBColor(110, 110, 110);
const GRID: RGBColor = RGBColor(226, 226, 226);
const PAPER: RGBColor = RGBColor(255, 255, 255);

/// Sizes in pixels of a chart at scale 1.
const EM: f64 = 13.0;
const TITLE_EM: f64 = 16.0;
const SMALL_EM: f64 = 11.0;
const GAP: f64 = 10.0;
const MARK: f64 = 4.5;
const SAMPLE: f64 = 26.0;
/// Legends are no wider than this share of the chart.
const LEGEND_SHARE: f64 = 0.36;

/// `plotters` counts a font's height from ascent to descent on bitmaps, DejaVu's being 1.164 em, and 1.24 em in SVG: texts are
/// measured as on bitmaps, where they are wider.
const HEIGHT_PER_EM: f64 = 1.164;

type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

struct Canvas<'a, DB: DrawingBackend> {
    area: &'a DrawingArea<DB, Shift>,
    scale: f64,
    /// Of the plot: left, top, right, bottom, pixels.
    frame: [f64; 4],
    x: Span,
    y: Span,
}

/// Draws all of a chart; `scale`: pixels per pixel of a chart of normal size.
pub fn draw<DB: DrawingBackend>(
    chart: &Chart,
    area: &DrawingArea<DB, Shift>,
    size: ChartSize,
    scale: u32,
) -> Drawn<DB> {
    area.fill(&PAPER)?;
    let s = f64::from(scale);
    let (width, height) = (f64::from(size.width), f64::from(size.height));
    let marks = || chart.series.iter().flat_map(|series| &series.marks).filter(|m| shown(chart, m));
    let guides = || chart.guides.iter().flat_map(|g| [g.from, g.to]);
    let bar = |bar: Option<[f64; 2]>| bar.into_iter().flatten();
    let x = Span::of(&chart.x, marks().flat_map(|m| bar(m.x_bar).chain([m.x])).chain(guides().map(|p| p.0)));
    let y = Span::of(&chart.y, marks().flat_map(|m| bar(m.y_bar).chain([m.y])).chain(guides().map(|p| p.1)));

    let widest = |ticks: &[(f64, String)]| ticks.iter().map(|t| measure(&t.1, EM * s)).fold(0.0, f64::max);
    let entries = legend(chart);
    let legend_width = entries.iter().map(|e| measure(&e.1, EM * s) + (SAMPLE + GAP) * s).fold(0.0, f64::max);
    let legend_width = legend_width.min(LEGEND_SHARE * width);
    let frame = [
        widest(&y.ticks()) + (EM + 3.0 * GAP) * s,
        (TITLE_EM + 2.0 * GAP + if chart.note.is_empty() { 0.0 } else { SMALL_EM + 0.5 * GAP }) * s,
        width - legend_width - 2.5 * GAP * s,
        height - (2.0 * EM + 3.0 * GAP) * s,
    ];
    let canvas = Canvas { area, scale: s, frame, x, y };
    canvas.axes(chart, width, height)?;
    for guide in &chart.guides {
        let color = guide.series.map_or(GREY, color);
        canvas.dashed(canvas.place(guide.from), canvas.place(guide.to), color, guide.dotted)?;
    }
    for (i, series) in chart.series.iter().enumerate() {
        canvas.series(i, &series.marks.iter().filter(|m| shown(chart, m)).copied().collect::<Vec<_>>())?;
    }
    canvas.legend(&entries, frame[2] + GAP * s, legend_width)
}

/// Whether a mark has a place on both axes.
fn shown(chart: &Chart, mark: &Mark) -> bool {
    chart.x.holds(mark.x) && chart.y.holds(mark.y)
}

fn color(series: usize) -> RGBColor {
    COLORS[series % COLORS.len()]
}

/// Pixels, rounded up.
fn measure(text: &str, em: f64) -> f64 {
    f64::from(text_width(text, em as f32)).ceil()
}

/// What stands before a text of the legend.
#[derive(Clone, Copy)]
enum Sample {
    Series(usize),
    Guide { series: Option<usize>, dotted: bool },
    None,
}

fn legend(chart: &Chart) -> Vec<(Sample, String)> {
    let mut entries: Vec<(Sample, String)> =
        chart.series.iter().enumerate().map(|(i, s)| (Sample::Series(i), s.name.clone())).collect();
    entries.extend(chart.guides.iter().map(|g| (Sample::Guide { series: g.series, dotted: g.dotted }, g.name.clone())));
    let all = chart.series.iter().flat_map(|s| &s.marks);
    let left_out = all.filter(|m| !shown(chart, m)).count();
    if left_out > 0 {
        entries.push((Sample::None, format!("{left_out} at 0 not shown")));
    }
    entries
}

impl<DB: DrawingBackend> Canvas<'_, DB> {
    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [left, top, right, bottom] = self.frame;
        (left + self.x.share(x) * (right - left), bottom - self.y.share(y) * (bottom - top))
    }

    fn line(&self, points: &[(f64, f64)], color: RGBColor, width: f64) -> Drawn<DB> {
        let style = ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: self.stroke(width) };
        self.area.draw(&PathElement::new(points.iter().map(|&p| whole(p)).collect::<Vec<_>>(), style))
    }

    fn stroke(&self, width: f64) -> u32 {
        (width * self.scale).round().max(1.0) as u32
    }

    fn dashed(&self, from: (f64, f64), to: (f64, f64), color: RGBColor, dotted: bool) -> Drawn<DB> {
        let (dash, gap) = if dotted { (2.0, 4.0) } else { (8.0, 5.0) };
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let at = |t: f64| (from.0 + (to.0 - from.0) * t / length, from.1 + (to.1 - from.1) * t / length);
        let mut t = 0.0;
        while t < length {
            self.line(&[at(t), at((t + dash * self.scale).min(length))], color, 1.5)?;
            t += (dash + gap) * self.scale;
        }
        Ok(())
    }

    fn text(&self, text: &str, at: (f64, f64), em: f64, color: RGBColor, pos: (HPos, VPos), up: bool) -> Drawn<DB> {
        let font = FontDesc::new(FontFamily::Name(FAMILY), em * HEIGHT_PER_EM * self.scale, FontStyle::Normal);
        let font = if up { font.transform(FontTransform::Rotate270) } else { font };
        let style = TextStyle::from(font).color(&color).pos(Pos::new(pos.0, pos.1));
        self.area.draw_text(text, &style, whole(at))
    }

    /// Frame, grid, ticks, labels, title.
    fn axes(&self, chart: &Chart, width: f64, height: f64) -> Drawn<DB> {
        let [left, top, right, bottom] = self.frame;
        let s = self.scale;
        for (share, label) in self.x.ticks() {
            let x = left + share * (right - left);
            let long = !label.is_empty();
            if long {
                self.line(&[(x, top), (x, bottom)], GRID, 1.0)?;
                self.text(&label, (x, bottom + GAP * s), EM, INK, (HPos::Center, VPos::Top), false)?;
            }
            self.line(&[(x, bottom), (x, bottom + if long { 6.0 } else { 3.0 } * s)], INK, 1.0)?;
        }
        for (share, label) in self.y.ticks() {
            let y = bottom - share * (bottom - top);
            let long = !label.is_empty();
            if long {
                self.line(&[(left, y), (right, y)], GRID, 1.0)?;
                self.text(&label, (left - GAP * s, y), EM, INK, (HPos::Right, VPos::Center), false)?;
            }
            self.line(&[(left - if long { 6.0 } else { 3.0 } * s, y), (left, y)], INK, 1.0)?;
        }
        self.line(&[(left, top), (left, bottom), (right, bottom)], INK, 1.0)?;
        let title = fitted(&chart.title, (TITLE_EM * s) as f32, (width - 2.0 * GAP * s) as f32);
        self.text(&title, (left, GAP * s), TITLE_EM, INK, (HPos::Left, VPos::Top), false)?;
        if !chart.note.is_empty() {
            let note = fitted(&chart.note, (SMALL_EM * s) as f32, (width - left - GAP * s) as f32);
            let y = (1.4 * GAP + TITLE_EM) * s;
            self.text(&note, (left, y), SMALL_EM, GREY, (HPos::Left, VPos::Top), false)?;
        }
        let middle = 0.5 * (left + right);
        let below = (middle, height - (EM + 0.8 * GAP) * s);
        self.text(&chart.x.label, below, EM, INK, (HPos::Center, VPos::Top), false)?;
        let beside = (0.8 * GAP * s, 0.5 * (top + bottom));
        self.text(&chart.y.label, beside, EM, INK, (HPos::Center, VPos::Top), true)
    }

    fn series(&self, index: usize, marks: &[Mark]) -> Drawn<DB> {
        let color = color(index);
        let mut front: Vec<(f64, f64)> = marks.iter().filter(|m| m.on_front).map(|m| self.place((m.x, m.y))).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        if front.len() > 1 {
            self.line(&front, color, 1.5)?;
        }
        for mark in marks {
            let (x, y) = self.place((mark.x, mark.y));
            let positive = |span: [f64; 2]| span.iter().all(|v| v.is_finite());
            if let Some([low, high]) = mark.y_bar.filter(|b| positive(*b)) {
                let (a, b) = (self.place((mark.x, low)).1, self.place((mark.x, high)).1);
                if a.is_finite() && b.is_finite() {
                    self.line(&[(x, a), (x, b)], color, 1.0)?;
                }
            }
            if let Some([low, high]) = mark.x_bar.filter(|b| positive(*b)) {
                let (a, b) = (self.place((low, mark.y)).0, self.place((high, mark.y)).0);
                if a.is_finite() && b.is_finite() {
                    self.line(&[(a, y), (b, y)], color, 1.0)?;
                }
            }
            self.mark((x, y), index, mark.on_front)?;
        }
        Ok(())
    }

    /// A circle, square, triangle or diamond; hollow ones are not on the front.
    fn mark(&self, at: (f64, f64), series: usize, filled: bool) -> Drawn<DB> {
        let (color, r) = (color(series), MARK * self.scale);
        let corners: &[(f64, f64)] = match series % 4 {
            0 => {
                let fill = if filled { color } else { PAPER };
                self.area.draw(&Circle::new(whole(at), r.round() as i32, fill.filled()))?;
                let edge = ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: self.stroke(1.5) };
                return self.area.draw(&Circle::new(whole(at), r.round() as i32, edge));
            }
            1 => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
            2 => &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
            _ => &[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)],
        };
        let mut points: Vec<(f64, f64)> = corners.iter().map(|c| (at.0 + c.0 * r, at.1 + c.1 * r)).collect();
        let fill = if filled { color } else { PAPER };
        self.area.draw(&Polygon::new(points.iter().map(|&p| whole(p)).collect::<Vec<_>>(), fill.filled()))?;
        points.push(points[0]);
        self.line(&points, color, 1.5)
    }

    fn legend(&self, entries: &[(Sample, String)], left: f64, width: f64) -> Drawn<DB> {
        let s = self.scale;
        for (row, (sample, name)) in entries.iter().enumerate() {
            let y = self.frame[1] + (row as f64 + 0.5) * (EM + 0.7 * GAP) * s;
            let (a, b) = ((left, y), (left + SAMPLE * s, y));
            match *sample {
                Sample::Series(i) => {
                    self.line(&[a, b], color(i), 1.5)?;
                    self.mark((0.5 * (a.0 + b.0), y), i, true)?;
                }
                Sample::Guide { series, dotted } => self.dashed(a, b, series.map_or(GREY, color), dotted)?,
                Sample::None => {}
            }
            let indent = if matches!(sample, Sample::None) { 0.0 } else { (SAMPLE + 0.7 * GAP) * s };
            let name = fitted(name, (EM * s) as f32, (width - indent) as f32);
            self.text(&name, (left + indent, y), EM, INK, (HPos::Left, VPos::Center), false)?;
        }
        // A frame around nothing would be a riddle.
        if entries.is_empty() {
            return Ok(());
        }
        let bottom = self.frame[1] + entries.len() as f64 * (EM + 0.7 * GAP) * s + 0.5 * GAP * s;
        let corners = [
            whole((left - 0.4 * GAP * s, self.frame[1] - 0.3 * GAP * s)),
            whole((left + width + 0.4 * GAP * s, bottom)),
        ];
        let style = ShapeStyle { color: GRID.to_rgba(), filled: false, stroke_width: self.stroke(1.0) };
        self.area.draw(&Rectangle::new(corners, style))
    }
}

/// The nearest whole pixel; far beyond the picture stays there.
fn whole((x, y): (f64, f64)) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}
