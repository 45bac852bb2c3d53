//! What a run's pictures are compared with, where the user gave or asked for a reference.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};

use crate::cli::RenderArgs;
use crate::commands::session::Session;
use crate::commands::tell;
use crate::image::LayeredImage;
use crate::light::World;
use crate::math::blocks::BLOCK;
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::ReferenceSummary;
use crate::scene::Camera;
use crate::shade::points::View;
use crate::shade::reference::{self, ReferenceSettings};
use crate::shade::reference_file::Identity;
use crate::shade::regions::{Region, regions};
use crate::system::output::write_atomically;

/// Where references come from.
pub enum Source {
    /// Traced for every camera.
    Trace { settings: ReferenceSettings },
    /// One camera's, read from a file.
    File(Box<ReferenceFile>),
}

pub struct ReferenceFile {
    path: PathBuf,
    image: LayeredImage,
    layers: ReferenceLayers,
}

impl Source {
    /// What the arguments ask for, if anything. A file that is of no use is refused before anything is computed.
    pub fn of(args: &RenderArgs) -> Result<Option<Source>> {
        if let Some(spp) = args.reference {
            let settings = ReferenceSettings { spp, seed: args.trace.seed, ..Default::default() };
            return Ok(Some(Source::Trace { settings }));
        }
        let Some(path) = &args.reference_image else { return Ok(None) };
        let image = LayeredImage::read_exr(path)?;
        let size = (args.view.size.width, args.view.size.height);
        let layers = ReferenceLayers::new(&image, size, spp_of(&image).map(|spp| spp / BLOCK))
            .with_context(|| format!("--reference-image: cannot compare with {}", path.display()))?;
        Ok(Some(Source::File(Box::new(ReferenceFile { path: path.clone(), image, layers }))))
    }
}

/// Samples per pixel that a file says it has.
fn spp_of(image: &LayeredImage) -> Option<u32> {
    image.texts.get("spp")?.parse().ok()
}

/// A picture that is compared: what camera sees what of which scene.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    pub session: &'a Session<'a>,
    pub world: &'a World<'a>,
    pub camera: &'a Camera,
    pub view: &'a View,
}

/// The reference of one camera's picture.
pub struct Reference {
    pub layers: ReferenceLayers,
    /// Of every pixel, `None` where it shows no surface.
    pub regions: Vec<Option<Region>>,
    pub summary: ReferenceSummary,
    /// Whether its surfaces are glossy, as those of probes are not.
    pub glossy: bool,
    /// What these surfaces reflect as gloss, where the reference says it.
    gloss: Option<ReferenceLayers>,
    provenance: Provenance,
}

/// Where its layers come from.
enum Provenance {
    Traced(Box<reference::Reference>, Identity),
    File(PathBuf),
}

impl Reference {
    /// The camera's reference, where one is wanted.
    ///
    /// # Errors
    /// A file is of another picture; of another scene it may be where `allow_scene_change`.
    pub fn obtain(source: Option<&Source>, shot: Shot, allow_scene_change: bool) -> Result<Option<Reference>> {
        Ok(match source {
            None => None,
            Some(Source::Trace { settings }) => Some(Reference::trace(shot, settings)?),
            Some(Source::File(file)) => {
                let ReferenceFile { path, image, layers } = &**file;
                check_file(shot, path, image, allow_scene_change)?;
                let summary = ReferenceSummary { file: Some(path.display().to_string()), ..Default::default() };
                let summary = ReferenceSummary { spp: spp_of(image), ..summary };
                let glossy = image.texts.get("transport").is_some_and(|t| t == "gltf");
                let gloss = ReferenceLayers::of_glossy(image, spp_of(image).map(|spp| spp / BLOCK)).filter(|_| glossy);
                let reference = Reference::new(shot, layers.clone(), summary, glossy, Provenance::File(path.clone()));
                Some(Reference { gloss, ..reference })
            }
        })
    }

    fn trace(shot: Shot, settings: &ReferenceSettings) -> Result<Reference> {
        let Shot { session: Session { console, .. }, world, camera, view } = shot;
        let (width, height) = (view.width, view.height);
        let started = Instant::now();
        let traced = reference::trace(world, camera, width, height, settings, console.progress, None);
        let time_s = started.elapsed().as_secs_f64();
        tell::traced(console, traced.spp, traced.rays, time_s);
        tell::not_finite(console, traced.non_finite);
        let identity = Identity::new(world, camera, width, height, settings);
        let layers = ReferenceLayers::new(&traced.image, (width, height), Some(traced.spp / BLOCK))?;
        let summary = ReferenceSummary { spp: Some(traced.spp), time_s: Some(time_s), ..Default::default() };
        Ok(Reference::new(shot, layers, summary, false, Provenance::Traced(Box::new(traced), identity)))
    }

    fn new(
        shot: Shot,
        layers: ReferenceLayers,
        summary: ReferenceSummary,
        glossy: bool,
        provenance: Provenance,
    ) -> Reference {
        let regions = regions(shot.world, shot.view);
        let (irradiance_indirect_mean, standard_error_mean) = layers.means(|i| regions[i].is_some());
        let summary = ReferenceSummary { irradiance_indirect_mean, standard_error_mean, ..summary };
        Reference { layers, regions, summary, glossy, gloss: None, provenance }
    }

    /// What is reflected as gloss, the regions of the pixels, and samples a pixel; `None` where the reference does not say it.
    pub fn glossy_layers(&self) -> Option<(&ReferenceLayers, &[Option<Region>], u32)> {
        /// Where a file does not say.
        const SPP: u32 = 256;
        self.gloss.as_ref().map(|layers| (layers, self.regions.as_slice(), self.summary.spp.unwrap_or(SPP)))
    }

    /// Writes all that there is of the reference. A file is copied as it is, with what else it holds; onto itself it stays.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        let source = match &self.provenance {
            Provenance::Traced(traced, identity) => return Ok(traced.write(path, identity)?),
            Provenance::File(source) => source,
        };
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

/// Refuses a file that says it is of another picture. Files of other programs do not say.
fn check_file(shot: Shot, path: &Path, image: &LayeredImage, allow_scene_change: bool) -> Result<()> {
    let Shot { session, world, camera, view } = shot;
    let identity = Identity::new(world, camera, view.width, view.height, &ReferenceSettings::default());
    let Some(what) = identity.other_picture(image) else { return Ok(()) };
    let message = format!("--reference-image: {} is of another {what} than the pictures", path.display());
    if allow_scene_change && what.starts_with("scene") {
        session.console.warn(message);
        return Ok(());
    }
    bail!("{message}; make it anew with `lightprobe reference`, or give the arguments that it was made with")
}
