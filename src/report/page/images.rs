//! What the template gets of the pairs of pictures.

use serde::Serialize;

use super::embed::{Embedded, differences, finest_factor};
use super::shrink::Size;
use super::view::{DIGITS, FigureView, figures};
use super::visible::visible;
use super::{PageError, PageImage, budget, histogram, still};
use crate::report::colormap::{Colormap, Scale};
use crate::report::heatmap::range_of;
use crate::system::format;

#[derive(Debug, Serialize)]
pub struct ImageView {
    name: String,
    quantity: String,
    unit: String,
    width: u32,
    height: u32,
    exposure_ev: f32,
    is_display_referred: bool,
    worst: Option<[u32; 2]>,
    non_finite: [u64; 2],
    range: f32,
    range_text: String,
    embedded: Option<EmbeddedView>,
    base: String,
    candidate: String,
    difference: String,
    legend: String,
    histogram: histogram::Drawn,
    figures: Vec<FigureView>,
}

#[derive(Debug, Serialize)]
struct EmbeddedView {
    factor: u32,
    width: u32,
    height: u32,
    scale: f64,
    is_candidate_relative: bool,
    base: String,
    candidate: String,
    difference: String,
}

/// A pair of pictures, ready for the page: its pixels are needed no more, so that pages of many large pictures can be made one
/// after the other.
#[derive(Debug)]
pub struct PackedImage {
    is_judged: bool,
    view: ImageView,
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
        let colormap = Colormap::new(Scale::Diverging, range_of(&difference, Scale::Diverging));
        let view = view(image, &difference, colormap, still::width_for(pairs))?;
        let embed = |factor| Embedded::new(image, &difference, colormap.range()[1], factor);
        let levels = budget::factors(finest_factor(image.size())).map(embed).collect::<Result<_, _>>()?;
        Ok(PackedImage { is_judged: image.is_judged, view, levels })
    }
}

/// All pairs, those that decide first, in the room that a page has.
pub fn images(mut images: Vec<PackedImage>) -> Vec<ImageView> {
    images.sort_by_key(|image| !image.is_judged);
    let judged = images.iter().filter(|image| image.is_judged).count();
    let (mut views, levels): (Vec<ImageView>, Vec<Vec<Embedded>>) =
        images.into_iter().map(|image| (image.view, image.levels)).unzip();
    let stills =
        |view: &ImageView| view.base.len() + view.candidate.len() + view.difference.len() + 2 * view.legend.len();
    let room = budget::PICTURES_BYTES.saturating_sub(views.iter().map(stills).sum());
    for (view, embedded) in views.iter_mut().zip(budget::fit(levels, judged, room)) {
        view.embedded = embedded.map(|embedded| {
            let Embedded {
                factor,
                size: Size { width, height },
                base,
                candidate,
                is_candidate_relative,
                difference,
                scale,
            } = embedded;
            EmbeddedView { factor, width, height, scale, is_candidate_relative, base, candidate, difference }
        });
    }
    views
}

fn view(image: &PageImage<'_>, difference: &[f32], colormap: Colormap, width: u32) -> Result<ImageView, PageError> {
    let range = colormap.range()[1];
    let non_finite = |pixels: &[glam::Vec3]| pixels.iter().filter(|pixel| !pixel.is_finite()).count() as u64;
    let unit = visible(&image.unit);
    Ok(ImageView {
        name: visible(&image.name),
        quantity: visible(&image.quantity),
        width: image.width,
        height: image.height,
        exposure_ev: image.exposure_ev,
        is_display_referred: image.is_display_referred,
        worst: image.worst_pixel,
        non_finite: [non_finite(&image.base), non_finite(&image.candidate)],
        range,
        range_text: format!("{} {unit}", format::significant(f64::from(range), DIGITS)).trim_end().to_owned(),
        embedded: None,
        base: still::side(image, &image.base, width)?,
        candidate: still::side(image, &image.candidate, width)?,
        difference: still::heatmap(difference, image.size(), colormap, width)?,
        legend: still::legend(difference, colormap, &unit)?,
        histogram: histogram::draw(difference, f64::from(range), &unit, "pixels").map_err(PageError::Draw)?,
        figures: figures(&image.figures),
        unit,
    })
}
