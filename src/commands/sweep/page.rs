//! The pictures of the sweep's page, and the page.

use std::path::Path;

use anyhow::{Context, Result};
use glam::Vec3;

use crate::evaluate::Scenery;
use crate::image::Picture;
use crate::math::color::luminance;
use crate::report::heatmap::range_of;
use crate::report::page::{PixelExtent, still};
use crate::report::reference_layers::ReferenceLayers;
use crate::report::sweep::SweepReport;
use crate::report::sweep_page::{self, Shown};
use crate::shade::layers::{compose, lit};
use crate::shade::regions::Region;
use crate::system::output::write_atomically;

/// Its name in the sweep's folder.
pub const FILE: &str = "index.html";

/// Widths of its pictures, pixels at most, by how many there are: the page stays below some megabytes.
const WIDTHS: [(usize, u32); 2] = [(16, 480), (64, 240)];
const LEAST_WIDTH: u32 = 120;

/// What the pictures are made with.
pub struct Seen<'a, 's> {
    pub scenery: &'a Scenery<'a, 's>,
    pub reference: &'a ReferenceLayers,
    pub regions: &'a [Option<Region>],
    pub exposure_ev: f32,
}

/// Writes the page. `irradiance` is what each configuration shows with its own visibility, in the report's order.
pub fn write(report: &SweepReport, seen: &Seen, irradiance: &[Vec<Vec3>], folder: &Path) -> Result<()> {
    let view = seen.scenery.view;
    let size = PixelExtent { width: view.width, height: view.height };
    let most = WIDTHS.iter().find(|(most, _)| irradiance.len() <= *most);
    let width = most.map_or(LEAST_WIDTH, |(_, width)| *width);
    let dark = compose(view, &vec![Vec3::ZERO; view.points.len()]);
    let difference = |shown: &Vec<Vec3>| -> Vec<f32> {
        let pairs = shown.iter().zip(&seen.reference.irradiance).zip(seen.regions);
        pairs.map(|((e, r), region)| region.map_or(f32::NAN, |_| luminance(*e) - luminance(*r))).collect()
    };
    let differences: Vec<Vec<f32>> = irradiance.iter().map(difference).collect();
    let range = range_of(&differences.concat());
    let picture = |(shown, difference): (&Vec<Vec3>, &Vec<f32>)| -> std::io::Result<Shown> {
        let picture = Picture::from_pixels(view.width, view.height, lit(&dark, shown));
        Ok(Shown {
            picture: still::side(&picture, Some(seen.exposure_ev), width)?,
            difference: still::heatmap(difference, size, range, width)?,
        })
    };
    let shown: Vec<Shown> =
        irradiance.iter().zip(&differences).map(picture).collect::<Result<_, _>>().context("cannot draw the page")?;
    let reference =
        still::side(&seen.reference.beauty, Some(seen.exposure_ev), width).context("cannot draw the page")?;
    let page = sweep_page::render(report, &shown, &reference).context("cannot write the page")?;
    write_atomically(&folder.join(FILE), |file| std::io::Write::write_all(file, page.as_bytes()))?;
    Ok(())
}
