//! The pictures of a run: what each method shows, and maps of leaks and errors.

use std::path::{Path, PathBuf};

use anyhow::Result;
use glam::Vec3;

use super::reference::Reference;
use crate::evaluate::Shaded;
use crate::image::{LayeredImage, Picture8};
use crate::math::color::luminance;
use crate::probe::Volume;
use crate::report::heatmap::{Heatmap, range_of};
use crate::report::probe_key::{Entry, with_key};
use crate::scene::Camera;
use crate::shade::layers::to_pixels;
use crate::shade::points::View;
use crate::shade::spheres;

/// What the colours in `probes.png` mean.
const PROBE_KEY: &[Entry] = &[
    Entry { color: [40, 40, 40], rim: spheres::RIM_COLOR, meaning: "probe, a white sphere in its own light" },
    Entry { color: spheres::INSIDE_COLOR, rim: spheres::RIM_COLOR, meaning: "inside geometry" },
    Entry { color: spheres::UNSAMPLED_COLOR, rim: spheres::RIM_COLOR, meaning: "never sampled" },
];

/// Writes all of a camera's pictures into `folder`, PNGs at one exposure.
pub fn write(
    volume: &Volume,
    (camera, view): (&Camera, &View),
    (shaded, as_engine): (&[Shaded; 3], Option<&Shaded>),
    reference: Option<&Reference>,
    exposure_ev: f32,
    folder: &Path,
) -> Result<()> {
    let file = |name: &str, extension: &str| -> PathBuf { folder.join(format!("{name}.{extension}")) };
    let tonemapped = |image: &LayeredImage| match image.picture("beauty") {
        Some(picture) => picture.tonemapped(exposure_ev),
        None => Picture8::filled(view.width, view.height, [0; 3]),
    };
    for s in shaded.iter().chain(as_engine) {
        s.image.write_exr(&file(s.report.name, "exr"))?;
        tonemapped(&s.image).write_png(&file(s.report.name, "png"))?;
    }
    if let Some(picture) = shaded[1].image.picture("beauty_gltf") {
        picture.tonemapped(exposure_ev).write_png(&file("glossy", "png"))?;
    }
    let [off, on, exact] = shaded;
    let difference = |s: &Shaded| {
        let signed = |i: usize| Vec3::splat(luminance(s.irradiance[i]) - luminance(exact.irradiance[i]));
        to_pixels(view, |i, _| signed(i))
    };
    let (off_leak, on_leak) = (difference(off), difference(on));
    let mut image = LayeredImage::new(view.width, view.height);
    image.push("leak_on", on_leak.clone());
    image.push("leak_off", off_leak.clone());
    image.write_exr(&file("leak", "exr"))?;
    leak_map(view, &off_leak, &on_leak).write_png(&file("leak", "png"))?;
    let probes = spheres::draw(&tonemapped(&exact.image), view, camera, volume, exposure_ev);
    with_key(probes, PROBE_KEY).write_png(&file("probes", "png"))?;
    if let Some(reference) = reference {
        reference.write_exr(&file("reference", "exr"))?;
        reference.layers.beauty.tonemapped(exposure_ev).write_png(&file("reference", "png"))?;
        write_errors(shaded, reference, &file)?;
    }
    Ok(())
}

/// Both signed differences side by side under one scale: without visibility on the left, with it on the right.
fn leak_map(view: &View, off: &[Vec3], on: &[Vec3]) -> Picture8 {
    let mut has_surface = vec![false; off.len()];
    view.points.iter().for_each(|p| has_surface[p.pixel as usize] = true);
    let width = view.width as usize;
    let mut values = Vec::with_capacity(2 * off.len());
    for row in 0..view.height as usize {
        for half in [off, on] {
            let pixels = row * width..(row + 1) * width;
            values.extend(pixels.map(|i| if has_surface[i] { half[i].x } else { f32::NAN }));
        }
    }
    Heatmap {
        values: &values,
        width: 2 * view.width,
        height: view.height,
        range: range_of(&values),
        title: "irradiance against exact visibility: left without, right with visibility",
        unit: "W·m⁻²",
        missing: "no surface",
    }
    .draw()
}

/// Signed differences from the reference, without and with visibility, under one scale so that the two compare.
fn write_errors(shaded: &[Shaded; 3], reference: &Reference, file: &dyn Fn(&str, &str) -> PathBuf) -> Result<()> {
    let (width, height) = (reference.layers.width, reference.layers.height);
    let difference = |s: &Shaded| -> Vec<f32> {
        let irradiance = s.image.layer("irradiance_indirect").unwrap_or_default();
        let pairs = irradiance.iter().zip(&reference.layers.irradiance).zip(&reference.regions);
        pairs.map(|((e, r), region)| region.map_or(f32::NAN, |_| luminance(*e) - luminance(*r))).collect()
    };
    let [off, on, _] = shaded;
    let maps = [
        ("error_off", "irradiance minus reference, without visibility", difference(off)),
        ("error_on", "irradiance minus reference, with visibility", difference(on)),
    ];
    let all: Vec<f32> = maps.iter().flat_map(|(_, _, values)| values.iter().copied()).collect();
    let range = range_of(&all);
    for (name, title, values) in maps {
        let mut image = LayeredImage::new(width, height);
        image.push_scalar("error", &values.iter().map(|&v| if v.is_nan() { 0.0 } else { v }).collect::<Vec<f32>>());
        image.write_exr(&file(name, "exr"))?;
        let map = Heatmap { values: &values, width, height, range, title, unit: "W·m⁻²", missing: "no surface" };
        map.draw().write_png(&file(name, "png"))?;
    }
    Ok(())
}
