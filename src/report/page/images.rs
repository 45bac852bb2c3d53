//! What the template gets of the pairs of pictures.

use rayon::prelude::*;
use serde::Serialize;

use super::embed::{Embedded, differences};
use super::shrink::Size;
use super::view::{DIGITS, FigureView, figures};
use super::visible::visible;
use super::{PageError, PageImage, budget, histogram, still};
use crate::report::colormap::{Colormap, Scale};
use crate::report::format;
use crate::report::heatmap::range_of;

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

/// A picture's parts that do not depend on how much room there is.
struct Prepared {
    difference: Vec<f32>,
    colormap: Colormap,
    range: f32,
}

/// All pairs, checked and packed into the room that a page has.
///
/// # Errors
/// Pictures whose pixels do not match their size.
pub fn images(images: &[PageImage<'_>]) -> Result<Vec<ImageView>, PageError> {
    for image in images {
        let (base, candidate) = (image.base.len(), image.candidate.len());
        if base != image.size().pixels() || candidate != base || base == 0 {
            let (name, width, height) = (visible(&image.name), image.width, image.height);
            return Err(PageError::Size { name, width, height, base, candidate });
        }
    }
    let prepare = |image: &PageImage<'_>| {
        let difference = differences(image);
        let colormap = Colormap::new(Scale::Diverging, range_of(&difference, Scale::Diverging));
        let range = colormap.range()[1];
        Prepared { difference, colormap, range }
    };
    let prepared: Vec<Prepared> = images.iter().map(prepare).collect();
    let mut views = images
        .par_iter()
        .zip(&prepared)
        .map(|(image, prepared)| view(image, prepared, still::width_for(images.len())))
        .collect::<Result<Vec<_>, _>>()?;
    let stills =
        |view: &ImageView| view.base.len() + view.candidate.len() + view.difference.len() + 2 * view.legend.len();
    let room = budget::PICTURES_BYTES.saturating_sub(views.iter().map(stills).sum());
    let embedded = budget::fit(images.len(), room, |i, factor| {
        Embedded::new(&images[i], &prepared[i].difference, prepared[i].range, factor)
    })?;
    for (view, embedded) in views.iter_mut().zip(embedded) {
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
    Ok(views)
}

fn view(image: &PageImage<'_>, prepared: &Prepared, width: u32) -> Result<ImageView, PageError> {
    let Prepared { difference, colormap, range } = prepared;
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
        range: *range,
        range_text: format!("{} {unit}", format::significant(f64::from(*range), DIGITS)).trim_end().to_owned(),
        embedded: None,
        base: still::side(image, &image.base, width)?,
        candidate: still::side(image, &image.candidate, width)?,
        difference: still::heatmap(difference, image.size(), *colormap, width)?,
        legend: still::legend(difference, *colormap, &unit)?,
        histogram: histogram::draw(difference, f64::from(*range), &unit, "pixels").map_err(PageError::Draw)?,
        figures: figures(&image.figures),
        unit,
    })
}
