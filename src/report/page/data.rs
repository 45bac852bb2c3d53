//! What a page shows, as those who fill it give it. Templates read the fields by their names.

use std::borrow::Cow;
use std::io;

use glam::Vec3;
use serde::Serialize;
use thiserror::Error;

use super::histogram::{Counts, count};
use super::shrink::PixelExtent;
use crate::report::heatmap::range_of;

/// One of the two results.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Side {
    pub path: String,
    /// Such as "render folder".
    pub kind: String,
    pub seed: Option<u64>,
    pub scene_blake3: Option<String>,
}

/// A pair of pictures of one size.
#[derive(Debug, Clone, Serialize)]
pub struct PageImage<'a> {
    /// Such as "lit/visibility_on".
    pub name: String,
    /// Such as "radiance" or "indirect irradiance".
    pub quantity: String,
    /// Of the pixels; empty for pure numbers.
    pub unit: String,
    pub width: u32,
    pub height: u32,
    /// Linear RGB, row 0 at the top, `width · height` of them; display-referred: sRGB codes in [0,1].
    #[serde(skip)]
    pub base: Cow<'a, [Vec3]>,
    #[serde(skip)]
    pub candidate: Cow<'a, [Vec3]>,
    /// At which both are shown at first: the base's.
    pub exposure_ev: f32,
    /// A PNG: it is shown as it is, without exposure.
    pub is_display_referred: bool,
    /// Whether it decides.
    pub is_judged: bool,
    /// Which pixels are compared; `None`: all.
    #[serde(skip)]
    pub is_compared: Option<&'a [bool]>,
    pub figures: Vec<Figure>,
    /// Column, row.
    pub worst_pixel: Option<[u32; 2]>,
}

impl PageImage<'_> {
    pub fn size(&self) -> PixelExtent {
        PixelExtent { width: self.width, height: self.height }
    }
}

/// A figure of both sides.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Figure {
    pub name: String,
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    /// Candidate against base: a difference, a ratio − 1, or a figure of the pair.
    pub value: Option<f64>,
    pub standard_error: Option<f64>,
    /// "s" and "bytes" are written as times and sizes; empty for pure numbers.
    pub unit: String,
}

/// Figures under one heading, such as those of a report.
#[derive(Debug, Clone, Serialize)]
pub struct FigureTable {
    pub title: String,
    pub figures: Vec<Figure>,
}

/// Two probe files.
#[derive(Debug, Clone, Serialize)]
pub struct ProbeComparison {
    pub name: String,
    pub figures: Vec<Figure>,
    /// The worst probes, worst first.
    pub worst: Vec<ProbeRow>,
    pub histograms: Vec<Histogram>,
}

/// One probe of both files.
#[derive(Debug, Clone, Serialize)]
pub struct ProbeRow {
    pub index: u64,
    /// World space, m.
    pub position_m: [f64; 3],
    /// Difference of irradiance ÷ its own, a share.
    pub irradiance: Option<f64>,
    /// Root mean square difference of the stored distances, m.
    pub distance_m: Option<f64>,
    /// "active", "inside geometry" and so on.
    pub base_state: String,
    pub candidate_state: String,
    pub moved_m: Option<f64>,
}

/// Differences to count.
#[derive(Debug, Clone, Serialize)]
#[serde(into = "Counts")]
pub struct Histogram {
    pub title: String,
    pub unit: String,
    /// What each value belongs to, such as "probes".
    pub what: String,
    pub values: Vec<f32>,
}

/// A line for a shell, and what it is for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Command {
    /// Such as "bake, base".
    pub purpose: String,
    pub line: String,
}

/// A key of the effective configurations that differs; `None` where a side lacks it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigChange {
    pub key: String,
    pub base: Option<String>,
    pub candidate: Option<String>,
}

/// A drawing, shown as a picture: whatever it holds, it cannot run or load anything.
#[derive(Debug, Clone, Serialize)]
pub struct Plot {
    pub title: String,
    pub svg: String,
}

/// The page could not be made.
#[derive(Debug, Error)]
pub enum PageError {
    #[error("the page of the comparison cannot show {name}: {width} × {height} pixels given as {base} and {candidate}")]
    Size { name: String, width: u32, height: u32, base: usize, candidate: usize },
    #[error("the page of the comparison cannot be packed: {0}; report this")]
    Pack(#[from] io::Error),
    #[error("the page of the comparison cannot be written: {0}; report this")]
    Template(#[from] minijinja::Error),
}

impl From<Histogram> for Counts {
    fn from(Histogram { title, unit, what, values }: Histogram) -> Counts {
        count(&title, &values, f64::from(range_of(&values)), &unit, &what)
    }
}
