//! The pairs of pictures, packed for the page.

use glam::Vec3;
use minijinja::value::Serde;
use minijinja::{Value, context};

use super::data::{PageError, PageImage};
use super::embed::{Embedded, differences, finest_factor};
use super::visible::visible;
use super::{budget, histogram, still};
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
    /// Packs one of about `pairs` pairs.
    ///
    /// # Errors
    /// Pictures whose pixels do not match their size.
    pub fn new(image: &PageImage<'_>, pairs: usize) -> Result<PackedImage, PageError> {
        let (base, candidate) = (image.base.len(), image.candidate.len());
        let is_mask_right = image.is_compared.is_none_or(|is_compared| is_compared.len() == base);
        if base != image.size().pixels() || candidate != base || base == 0 || !is_mask_right {
            let (name, width, height) = (visible(&image.name), image.width, image.height);
            return Err(PageError::Size { name, width, height, base, candidate });
        }
        let difference = differences(image);
        let range = range_of(&difference);
        let width = still::width_for(pairs);
        let stills = [
            still::side(image, &image.base, width)?,
            still::side(image, &image.candidate, width)?,
            still::heatmap(&difference, image.size(), range, width)?,
        ];
        let legend = still::legend(&difference, range, &visible(&image.unit))?;
        let stills_bytes = stills.iter().map(String::len).sum::<usize>() + 2 * legend.len();
        let non_finite = [&image.base, &image.candidate].map(|pixels| pixels.iter().filter(is_not_finite).count());
        let histogram =
            histogram::count("Differences of luminance", &difference, f64::from(range), &image.unit, "pixels");
        let view = context! {
            range => f64::from(range),
            non_finite => Serde(non_finite),
            stills => Serde(stills),
            legend,
            histogram => Serde(histogram),
            ..Value::from(Serde(image))
        };
        let embed = |factor| Embedded::new(image, &difference, range, factor);
        let levels = budget::factors(finest_factor(image.size())).map(embed).collect::<Result<_, _>>()?;
        Ok(PackedImage { is_judged: image.is_judged, view, stills_bytes, levels })
    }
}

fn is_not_finite(pixel: &&Vec3) -> bool {
    !pixel.is_finite()
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
