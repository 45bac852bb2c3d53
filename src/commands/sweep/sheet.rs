//! The contact sheet: what each method shows, beside the reference, above where it errs.

use glam::Vec3;

use crate::evaluate::Scenery;
use crate::image::{Picture, Picture8};
use crate::math::color::luminance;
use crate::report::colormap::color;
use crate::report::heatmap::range_of;
use crate::report::legend::Legend;
use crate::report::reference_layers::ReferenceLayers;
use crate::report::sheet::{self, Tile};
use crate::report::sweep::{Aggregate, ConfigurationReport, SweepReport};
use crate::shade::layers::{compose, lit};
use crate::shade::regions::Region;
use crate::system::format;

/// Its name in the sweep's folder.
pub const FILE: &str = "contact.png";

/// What one configuration shows.
pub struct Shown {
    /// Place in the report's `configurations`.
    pub configuration: usize,
    /// Of its first run, with its own visibility, per pixel, W·m⁻².
    pub irradiance: Vec<Vec3>,
}

/// Draws the sheet: a tile for the reference and one for each of `shown`.
pub fn draw(
    report: &SweepReport,
    scenery: &Scenery,
    reference: &ReferenceLayers,
    regions: &[Option<Region>],
    shown: &[Shown],
) -> Picture8 {
    let view = scenery.view;
    let dark = compose(view, &vec![Vec3::ZERO; view.points.len()]);
    let difference = |shown: &Shown| -> Vec<f32> {
        let pairs = shown.irradiance.iter().zip(&reference.irradiance).zip(regions);
        pairs.map(|((e, r), region)| region.map_or(f32::NAN, |_| luminance(*e) - luminance(*r))).collect()
    };
    let differences: Vec<Vec<f32>> = shown.iter().map(difference).collect();
    let all = differences.concat();
    let range = range_of(&all);
    let samples = format::or_undefined(report.reference.spp, |spp| spp.to_string());
    let mut tiles = vec![Tile {
        title: "reference".to_owned(),
        note: format!("path-traced, {samples} samples per pixel"),
        picture: reference.beauty.tonemapped(report.exposure_ev),
        difference: None,
    }];
    for (shown, values) in shown.iter().zip(&differences) {
        let Some(configuration) = report.configurations.get(shown.configuration) else { continue };
        let pixels = values.iter().map(|value| color(*value, range)).collect();
        tiles.push(Tile {
            title: configuration.label.clone(),
            note: note(configuration),
            picture: Picture::from_pixels(view.width, view.height, lit(&dark, &shown.irradiance))
                .tonemapped(report.exposure_ev),
            difference: Some(Picture8 { width: view.width, height: view.height, pixels }),
        });
    }
    let title = "irradiance minus reference, luminance";
    let legend = Legend { title, unit: "W·m⁻²", end: range, missing: "no surface", values: &all };
    sheet::draw(&tiles, (!shown.is_empty()).then_some(&legend))
}

fn note(configuration: &ConfigurationReport) -> String {
    let typical = |figure: &str| configuration.figures.get(figure).and_then(Aggregate::typical);
    let percent = |figure: &str| format::or_undefined(typical(figure), format::percent);
    let bytes = format::or_undefined(typical("bytes_per_probe"), |bytes| format::bytes(bytes.round() as u64));
    format!("error {}, leak {}, {bytes} a probe", percent("error_relative"), percent("leak_light"))
}
