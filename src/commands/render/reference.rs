//! What a run's pictures are compared with, where the user gave or asked for a reference.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::Run;
use crate::cli::RenderArgs;
use crate::image::LayeredImage;
use crate::output::write_atomically;
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::ReferenceReport;
use crate::shade::points::View;
use crate::shade::regions::{Region, regions};

/// A picture from a file.
pub struct ReferenceFile {
    path: PathBuf,
    layers: ReferenceLayers,
}

impl ReferenceFile {
    /// Reads the file that the arguments name, if they do. Said before anything is computed that it is of no use.
    pub fn read(args: &RenderArgs) -> Result<Option<ReferenceFile>> {
        let Some(path) = &args.reference_image else { return Ok(None) };
        let image = LayeredImage::read_exr(path)?;
        let size = (args.view.size.width, args.view.size.height);
        let layers = ReferenceLayers::new(&image, size, None)
            .with_context(|| format!("--reference-image: cannot compare with {}", path.display()))?;
        Ok(Some(ReferenceFile { path: path.clone(), layers }))
    }
}

/// The reference of one camera's picture.
pub struct Reference {
    pub layers: ReferenceLayers,
    /// Of every pixel, `None` where it shows no surface.
    pub regions: Vec<Option<Region>>,
    pub report: ReferenceReport,
    source: Source,
}

enum Source {
    File(PathBuf),
}

impl Reference {
    /// The camera's reference, where there is one.
    pub fn obtain(run: &Run, view: &View) -> Option<Reference> {
        let file = run.reference_file.as_ref()?;
        let layers = file.layers.clone();
        let regions = regions(run.world, view);
        let (irradiance_indirect_mean, standard_error_mean) = layers.means(|i| regions[i].is_some());
        let report = ReferenceReport {
            file: Some(file.path.display().to_string()),
            spp: None,
            time_s: None,
            irradiance_indirect_mean,
            standard_error_mean,
        };
        Some(Reference { layers, regions, report, source: Source::File(file.path.clone()) })
    }

    /// Writes the reference's layers. A file is copied as it is, with all that it holds; onto itself it stays.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        let Source::File(source) = &self.source;
        if let (Ok(from), Ok(to)) = (source.canonicalize(), path.canonicalize())
            && from == to
        {
            return Ok(());
        }
        let bytes = fs::read(source).with_context(|| format!("cannot read {} again", source.display()))?;
        write_atomically(path, |file| file.write_all(&bytes))?;
        Ok(())
    }
}
