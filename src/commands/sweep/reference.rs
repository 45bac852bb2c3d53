//! The one reference of a sweep: kept in its folder, and continued or used again where it fits.

use std::time::Instant;

use anyhow::Result;

use crate::cli::SweepArgs;
use crate::commands::reference::{LAYERED_PIXEL_BYTES, PIXEL_BYTES, trace};
use crate::commands::{Console, check_picture_memory, tell};
use crate::light::World;
use crate::light::bsdf::ReflectionModel;
use crate::math::blocks::BLOCK;
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::ReferenceSummary;
use crate::scene::Camera;
use crate::shade::points::has_blend;
use crate::shade::reference::{ReferenceSettings, Tracing};
use crate::shade::reference_file::{Identity, resume};

/// Its name in the folder.
pub const FILE: &str = "reference.exr";

/// The same of glossy transport, where any configuration shades gloss.
pub const GLTF_FILE: &str = "reference_gltf.exr";

pub struct SharedReference {
    pub layers: ReferenceLayers,
    /// What its surfaces reflect as gloss, where its transport is glossy.
    pub glossy: Option<ReferenceLayers>,
    pub identity: Identity,
    /// Samples per pixel that it has.
    pub spp: u32,
    /// Spent on tracing it; `None` where it was there.
    pub time_s: Option<f64>,
}

impl SharedReference {
    pub fn summary(&self, irradiance_indirect_mean: Option<f64>, standard_error_mean: Option<f64>) -> ReferenceSummary {
        ReferenceSummary {
            file: Some(FILE.to_owned()),
            spp: Some(self.spp),
            time_s: self.time_s,
            irradiance_indirect_mean,
            standard_error_mean,
        }
    }
}

/// The reference in the sweep's folder: with as many samples as asked for, or with more that are there.
pub fn obtain(
    args: &SweepArgs,
    world: &World,
    camera: &Camera,
    settings: &ReferenceSettings,
    console: &Console,
) -> Result<SharedReference> {
    let name = if settings.transport == ReflectionModel::Gltf { GLTF_FILE } else { FILE };
    let (size, path) = (args.view.size, args.output.join(name));
    check_picture_memory(size, if has_blend(world) { LAYERED_PIXEL_BYTES } else { PIXEL_BYTES })?;
    let identity = Identity::new(world, camera, size.width, size.height, settings);
    let mut previous = None;
    if path.exists() {
        match resume(&path, &identity, world, settings) {
            Ok(state) => previous = state,
            Err(other) => console.warn(format!("{other}; tracing the reference anew")),
        }
    }
    let is_resumed = previous.is_some();
    let started = Instant::now();
    let mut tracing = Tracing::new(world, camera, size.width, size.height, settings, previous);
    let new = tracing.remaining() > 0;
    if new {
        trace(&mut tracing, (&path, &identity), ("the same command goes on from there", is_resumed), console)?;
    }
    let reference = tracing.develop();
    tell::not_finite(console, reference.non_finite);
    if new {
        reference.write(&path, &identity)?;
    }
    let layers = ReferenceLayers::new(&reference.image, (size.width, size.height), Some(reference.spp / BLOCK))?;
    let glossy = ReferenceLayers::of_glossy(&reference.image, Some(reference.spp / BLOCK));
    let time_s = new.then(|| started.elapsed().as_secs_f64());
    Ok(SharedReference { layers, glossy, identity, spp: reference.spp, time_s })
}
