//! The pairs of pictures, packed for the page.

use minijinja::value::Serde;
use minijinja::{Value, context};

use super::data::{PageError, PairPixels};
use super::embed::{Embedded, finest_factor};
use super::histogram::histogram;
use super::visible::visible;
use super::{budget, still};
use crate::report::heatmap::range_of;

/// A pair of pictures, ready for the page: its pixels are needed no more, so that pages of many large pictures can be made one
/// after the other.
#[derive(Debug)]
pub struct PackedImage {
    is_judged: bool,
    /// What the template gets, but for the pixels that the script shows.
    view: Value,
    /// Of the small pictures in the view.
    stills_bytes: usize,
    /// Finest resolution first.
    levels: Vec<Embedded>,
}

impl PackedImage {
    /// Packs one of about `pairs` pairs. `view`: what the template reads of it besides.
    ///
    /// # Errors
    /// Pictures of two sizes, or of none.
    pub fn new(pair: &PairPixels<'_>, view: Value, pairs: usize) -> Result<PackedImage, PageError> {
        let (size, [base, candidate]) = (pair.size(), [pair.base, pair.candidate].map(|picture| picture.pixels.len()));
        if base == 0 || candidate != base || pair.difference.len() != base {
            return Err(PageError::Size { name: visible(pair.name), base, candidate });
        }
        let range = range_of(pair.difference);
        let width = still::width_for(pairs);
        let stills = [
            still::side(pair.base, pair.exposure_ev, width)?,
            still::side(pair.candidate, pair.exposure_ev, width)?,
            still::heatmap(pair.difference, size, range, width)?,
        ];
        let legend = still::legend(pair.difference, range, &visible(pair.unit))?;
        let stills_bytes = stills.iter().map(String::len).sum::<usize>() + 2 * legend.len();
        let view = context! {
            name => pair.name,
            unit => pair.unit,
            range => f64::from(range),
            stills => Serde(stills),
            legend,
            histogram => histogram("Differences of luminance", pair.difference, range, pair.unit, "pixels"),
            ..view
        };
        let embed = |factor| Embedded::new(pair, range, factor);
        let levels = budget::factors(finest_factor(size)).map(embed).collect::<Result<_, _>>()?;
        Ok(PackedImage { is_judged: pair.is_judged, view, stills_bytes, levels })
    }
}

/// All pairs, those that decide first, in the room that a page has.
pub fn images(mut images: Vec<PackedImage>) -> Vec<Value> {
    images.sort_by_key(|image| !image.is_judged);
    let judged = images.iter().filter(|image| image.is_judged).count();
    let room = budget::PICTURES_BYTES.saturating_sub(images.iter().map(|image| image.stills_bytes).sum());
    let (views, levels): (Vec<_>, Vec<_>) = images.into_iter().map(|image| (image.view, image.levels)).unzip();
    let embedded = budget::fit(levels, judged, room).into_iter();
    views.into_iter().zip(embedded).map(|(view, embedded)| context! { embedded => Serde(embedded), ..view }).collect()
}
