//! Parts of a page that are more than the report of the comparison. Templates read the fields by their names.

use std::io;

use serde::Serialize;
use thiserror::Error;

use super::shrink::PixelExtent;
use crate::image::Picture;

/// A pair of pictures of one size.
#[derive(Debug, Clone, Copy)]
pub struct PairPixels<'a> {
    /// Such as "lit/visibility_on".
    pub name: &'a str,
    /// Of the pixels; empty for pure numbers.
    pub unit: &'a str,
    /// Linear RGB; without an exposure sRGB codes in [0,1].
    pub base: &'a Picture,
    pub candidate: &'a Picture,
    /// Luminance of candidate − base; not a number where none is compared.
    pub difference: &'a [f32],
    /// At which both are shown at first. `None`: they are shown as they are, such as a PNG.
    pub exposure_ev: Option<f32>,
    /// Whether it decides.
    pub is_judged: bool,
}

impl PairPixels<'_> {
    pub fn size(&self) -> PixelExtent {
        PixelExtent { width: self.base.width, height: self.base.height }
    }
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

/// The page could not be made.
#[derive(Debug, Error)]
pub enum PageError {
    #[error(
        "the page of the comparison cannot show {name}: {base} pixels of base, {candidate} of candidate; report this"
    )]
    Size { name: String, base: usize, candidate: usize },
    #[error("the page of the comparison cannot be packed (report this)")]
    Pack(#[from] io::Error),
    #[error("the page of the comparison cannot be written (report this)")]
    Template(#[from] minijinja::Error),
}
