//! What the template gets: everything as text, sorted and formatted.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::images::{ImageView, images};
use super::lines::{Line, differing_lines};
use super::visible::visible;
use super::{Figure, FigureTable, Page, PageError, ProbeComparison, Side, codes, histogram};
use crate::report::colormap::{Colormap, Scale};
use crate::report::diff::gate::Gate;
use crate::report::diff::words;
use crate::report::heatmap::range_of;
use crate::system::format;

/// Colours of the heat map that the page looks up: one for each of 8 bits.
const COLORS: usize = 256;

/// Digits of figures: one more than tables of the terminal, as small differences are what the page is about.
pub(super) const DIGITS: usize = 4;

/// Larger whole numbers are not counts but bytes and the like.
const MOST_COUNTED: f64 = 1.0e9;

#[derive(Debug, Serialize)]
pub struct View {
    title: String,
    version: &'static str,
    passed: bool,
    failing: usize,
    judged: usize,
    waived: usize,
    first: Option<GateView>,
    gates: Vec<GateView>,
    sides: Vec<SideView>,
    /// `None`: not told on both sides, or too long.
    config_lines: Option<Vec<Line>>,
    images: Vec<ImageView>,
    probes: Vec<ProbesView>,
    figures: Vec<TableView>,
    plots: Vec<PlotView>,
    added: Vec<String>,
    missing: Vec<String>,
    commands: Vec<CommandView>,
    notes: Vec<String>,
    colors: String,
    codes: Codes,
}

/// Constants that the page's script decodes with.
#[derive(Debug, Serialize)]
struct Codes {
    per_octave: f64,
    offset: i16,
    per_asinh: f64,
    infinite: i16,
    nan: i16,
}

#[derive(Debug, Clone, Serialize)]
struct GateView {
    name: String,
    item: String,
    state: &'static str,
    /// For sorting: failing first.
    rank: u8,
    base: Cell,
    candidate: Cell,
    value: Cell,
    threshold: Cell,
    margin: Cell,
    /// Width of the margin's bar, 0 to 100, and whether it reaches to the bad side.
    bar: f64,
    is_beyond: bool,
    source: String,
    explanation: String,
}

/// A number for people, and for sorting.
#[derive(Debug, Clone, Serialize)]
struct Cell {
    text: String,
    raw: Option<f64>,
}

#[derive(Debug, Serialize)]
struct SideView {
    label: &'static str,
    path: String,
    kind: String,
    seed: String,
    scene: String,
}

#[derive(Debug, Serialize)]
pub struct FigureView {
    name: String,
    base: String,
    candidate: String,
    value: String,
}

#[derive(Debug, Serialize)]
struct TableView {
    title: String,
    figures: Vec<FigureView>,
}

#[derive(Debug, Serialize)]
struct ProbesView {
    name: String,
    figures: Vec<FigureView>,
    worst: Vec<ProbeView>,
    histograms: Vec<TitledHistogram>,
}

#[derive(Debug, Serialize)]
struct ProbeView {
    index: u64,
    position: [String; 3],
    irradiance: String,
    distance: String,
    moved: String,
    base_state: String,
    candidate_state: String,
}

#[derive(Debug, Serialize)]
struct TitledHistogram {
    title: String,
    drawn: histogram::Drawn,
}

#[derive(Debug, Serialize)]
struct PlotView {
    title: String,
    data: String,
}

#[derive(Debug, Serialize)]
struct CommandView {
    purpose: String,
    shown: String,
    line: String,
}

impl View {
    pub fn new(page: Page<'_>) -> Result<View, PageError> {
        let mut gates: Vec<GateView> = page.gates.iter().map(gate).collect();
        gates.sort_by(|a, b| a.rank.cmp(&b.rank).then_with(|| margin_of(a).total_cmp(&margin_of(b))));
        let failing = gates.iter().filter(|gate| gate.state == "fail").count();
        Ok(View {
            title: visible(&page.title),
            version: env!("CARGO_PKG_VERSION"),
            passed: failing == 0,
            failing,
            judged: page.gates.iter().filter(|gate| gate.threshold.is_some() || !gate.passed).count(),
            waived: gates.iter().filter(|gate| gate.state == "waived").count(),
            first: gates.first().filter(|gate| gate.state == "fail").cloned(),
            gates,
            sides: page.sides.iter().zip(["base", "candidate"]).map(|(side, label)| side_view(side, label)).collect(),
            config_lines: config_lines(&page.sides),
            images: images(page.images),
            probes: page.probes.iter().map(probes).collect::<Result<_, _>>()?,
            figures: page.figures.iter().map(table).collect(),
            plots: page.plots.iter().map(plot).collect(),
            added: page.added.iter().map(|item| visible(item)).collect(),
            missing: page.missing.iter().map(|item| visible(item)).collect(),
            commands: page.commands.iter().map(command).collect(),
            notes: page.notes.iter().map(|note| visible(note)).collect(),
            colors: colors(),
            codes: Codes {
                per_octave: codes::PER_OCTAVE,
                offset: codes::OFFSET,
                per_asinh: codes::PER_ASINH,
                infinite: codes::INFINITE,
                nan: codes::NAN,
            },
        })
    }
}

/// What fails without a margin is undefined, and first; undefined on both sides is no failure, and last.
fn margin_of(gate: &GateView) -> f64 {
    gate.margin.raw.unwrap_or(if gate.state == "fail" { f64::NEG_INFINITY } else { f64::INFINITY })
}

fn gate(gate: &Gate) -> GateView {
    let (state, rank) = match (gate.passed, gate.waived) {
        (_, true) => ("waived", 1),
        (false, false) => ("fail", 0),
        (true, false) if gate.threshold.is_none() => ("shown", 3),
        (true, false) => ("pass", 2),
    };
    let side = |value: Option<f64>| match gate.unit {
        words::BYTES => Cell { text: words::of_side(value, gate.unit), raw: finite(value) },
        _ => cell(value, number),
    };
    let margin = gate.margin.filter(|margin| margin.is_finite());
    GateView {
        name: visible(&gate.name),
        item: visible(&gate.item),
        state,
        rank,
        base: side(gate.base),
        candidate: side(gate.candidate),
        value: Cell { text: with_unit(gate.value, gate.standard_error, gate.unit), raw: finite(gate.value) },
        threshold: Cell { text: threshold(gate), raw: finite(gate.threshold) },
        margin: Cell { text: words::margin(gate), raw: margin },
        bar: 100.0 * margin.unwrap_or(0.0).abs().min(1.0),
        is_beyond: margin.is_some_and(|margin| margin < 0.0),
        source: visible(&gate.source),
        explanation: visible(&gate.explanation),
    }
}

/// A threshold as somebody wrote it: without the zeros that make figures as long as each other.
fn threshold(gate: &Gate) -> String {
    let text = with_unit(gate.threshold, None, gate.unit);
    match text.split_once(' ') {
        Some((number, unit)) => format!("{} {unit}", trimmed(number)),
        None => trimmed(&text).to_owned(),
    }
}

fn trimmed(number: &str) -> &str {
    let is_fraction = number.contains('.') && !number.contains('e');
    if is_fraction { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// A pure number: what is whole is most likely counted, and shown without a fraction.
fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < MOST_COUNTED {
        format!("{}{}", if value < 0.0 { "-" } else { "" }, format::count(value.abs() as u64))
    } else {
        format::significant(value, DIGITS)
    }
}

fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

fn cell(value: Option<f64>, text: impl FnOnce(f64) -> String) -> Cell {
    Cell { text: format::or_undefined(value, text), raw: finite(value) }
}

/// A figure with its unit, as people write it.
fn with_unit(value: Option<f64>, standard_error: Option<f64>, unit: &str) -> String {
    let Some(value) = value else { return format::UNDEFINED.to_owned() };
    match unit {
        "s" => format::seconds(value),
        "bytes" | words::BYTES => words::in_unit(Some(value), words::BYTES),
        _ => {
            let number = match standard_error {
                Some(_) => format::with_error(value, standard_error),
                None if unit.is_empty() => number(value),
                None => format::significant(value, DIGITS),
            };
            visible(format!("{number} {unit}").trim_end())
        }
    }
}

fn side_view(side: &Side, label: &'static str) -> SideView {
    SideView {
        label,
        path: visible(&side.path),
        kind: visible(&side.kind),
        seed: format::or_undefined(side.seed, |seed| seed.to_string()),
        scene: format::or_undefined(side.scene_blake3.as_deref(), visible),
    }
}

fn config_lines(sides: &[Side; 2]) -> Option<Vec<Line>> {
    let [base, candidate] = sides;
    let lines = differing_lines(base.config.as_deref()?, candidate.config.as_deref()?)?;
    Some(lines.into_iter().map(|line| Line { text: visible(&line.text), ..line }).collect())
}

fn table(table: &FigureTable) -> TableView {
    TableView { title: visible(&table.title), figures: figures(&table.figures) }
}

pub(super) fn figures(figures: &[Figure]) -> Vec<FigureView> {
    let view = |figure: &Figure| FigureView {
        name: visible(&figure.name),
        base: with_unit(figure.base, None, &figure.unit),
        candidate: with_unit(figure.candidate, None, &figure.unit),
        value: with_unit(figure.value, figure.standard_error, &figure.unit),
    };
    figures.iter().map(view).collect()
}

fn plot(plot: &super::Plot) -> PlotView {
    let data = format!("data:image/svg+xml;base64,{}", STANDARD.encode(&plot.svg));
    PlotView { title: visible(&plot.title), data }
}

fn command(command: &super::Command) -> CommandView {
    CommandView { purpose: visible(&command.purpose), shown: visible(&command.line), line: command.line.clone() }
}

/// The heat map's colours from its low to its high end, RGB bytes.
fn colors() -> String {
    let map = Colormap::new(Scale::Diverging, [-1.0, 1.0]);
    let bytes: Vec<u8> = (0..COLORS).flat_map(|i| map.color_at(i as f64 / (COLORS - 1) as f64)).collect();
    STANDARD.encode(bytes)
}

fn probes(probes: &ProbeComparison) -> Result<ProbesView, PageError> {
    let length =
        |value: Option<f64>| format::or_undefined(value, |value| format!("{} m", format::significant(value, 3)));
    let row = |probe: &super::ProbeRow| ProbeView {
        index: probe.index,
        position: probe.position_m.map(|coordinate| format::significant(coordinate, DIGITS)),
        irradiance: format::or_undefined(probe.irradiance, format::percent),
        distance: length(probe.distance_m),
        moved: length(probe.moved_m),
        base_state: visible(&probe.base_state),
        candidate_state: visible(&probe.candidate_state),
    };
    let histogram = |histogram: &super::Histogram| {
        let range =
            f64::from(Colormap::new(Scale::Diverging, range_of(&histogram.values, Scale::Diverging)).range()[1]);
        let drawn = histogram::draw(&histogram.values, range, &visible(&histogram.unit), &visible(&histogram.what))
            .map_err(PageError::Draw)?;
        Ok(TitledHistogram { title: visible(&histogram.title), drawn })
    };
    Ok(ProbesView {
        name: visible(&probes.name),
        figures: figures(&probes.figures),
        worst: probes.worst.iter().map(row).collect(),
        histograms: probes.histograms.iter().map(histogram).collect::<Result<_, PageError>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_their_unit() {
        let cases = [
            (Some(0.0123), "s", "12.3 ms"),
            (Some(2048.0), "bytes", "2.00 KiB"),
            (Some(-2048.0), "bytes", "-2.00 KiB"),
            (Some(0.5), "%", "0.5000 %"),
            (Some(300.0), "", "300"),
            (Some(-2.0), "", "-2"),
            (Some(0.25), "", "0.2500"),
            (Some(f64::NAN), "", "–"),
            (None, "m", "–"),
        ];
        for (value, unit, text) in cases {
            assert_eq!(with_unit(value, None, unit), text);
        }
        assert_eq!(with_unit(Some(0.031), Some(0.0031), "m"), "0.0310 ± 0.0031 m");
    }

    #[test]
    fn thresholds_are_short() {
        for (long, short) in [("0.02000", "0.02"), ("20.00", "20"), ("100", "100"), ("1.00e-7", "1.00e-7"), ("–", "–")]
        {
            assert_eq!(trimmed(long), short);
        }
    }
}
