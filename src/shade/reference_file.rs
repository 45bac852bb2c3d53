//! References on disk. A reference is an EXR file with the layers of the picture, a description of what it shows, and
//! the state that a later run needs to continue it.
//!
//! The description is the JSON attribute `lightprobe`. It holds the texts of [`Identity`], `spp`, `non_finite`,
//! `rays_*` and `noise_*`. The state is stored as words in the channels `state.*` ([`Film::store`]).

use std::path::{Path, PathBuf};

use super::develop::quantities;
use super::film::{Film, NoiseLevel};
use super::reference::{Reference, ReferenceSettings, State};
use crate::image::{ImageError, LayeredImage};
use crate::light::World;
use crate::light::sampled::RayCount;
use crate::math::blocks::BLOCK;
use crate::scene::Camera;

/// Version of the file's layout and of the estimator. Samples of another version cannot be continued.
const FORMAT: &str = "lightprobe-reference/1";

#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(
        "{path} is not a reference of this program's version (it lacks {what}); make it with `lightprobe reference`"
    )]
    NotAReference { path: PathBuf, what: String },
    #[error(
        "cannot continue {path}: it was made with the {what} {found}, but this run has {wanted}; give the same arguments or \
         write to another file"
    )]
    Different { path: PathBuf, what: String, found: String, wanted: String },
    #[error("cannot continue {path}: its state is missing or damaged; make it anew without --resume")]
    NoState { path: PathBuf },
}

/// Everything that the samples of a reference depend on, as pairs of name and text. If two identities differ, the first
/// difference is reported, so the entries that explain most come first.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity(Vec<(&'static str, String)>);

impl Identity {
    pub fn new(world: &World, camera: &Camera, width: u32, height: u32, settings: &ReferenceSettings) -> Identity {
        let optional = |x: Option<String>| x.unwrap_or_else(|| "none".to_owned());
        // Rust prints the shortest text that reads back to the same number, so equal texts mean equal numbers.
        let camera_numbers = format!("{:?} {:?} {:?}", camera.position, camera.world_from_camera, camera.projection);
        let scene = &world.scene;
        // Scenes without such meshes or files have no such entry.
        let unassigned = scene.unassigned.map(|unassigned| ("unassigned", unassigned.to_string()));
        let pictures = scene.pictures_blake3.clone().map(|hash| ("pictures_blake3", hash));
        let entries = [
            ("format", FORMAT.to_owned()),
            ("scene_blake3", world.scene.blake3.clone()),
            ("punctual_scale", world.punctual_scale.to_string()),
            ("albedo_max", world.albedo_max.to_string()),
            ("camera", camera.name.clone()),
            ("camera_view", camera_numbers),
            ("size", format!("{width}x{height}")),
            ("seed", settings.seed.to_string()),
            ("transport", format!("{:?}", settings.transport).to_lowercase()),
            ("strategy", format!("{:?}", settings.strategy).to_lowercase()),
            ("max_bounces", optional(settings.max_bounces.map(|b| b.to_string()))),
            ("firefly_clamp", optional(settings.firefly_clamp.map(|c| c.to_string()))),
        ];
        Identity(entries.into_iter().chain(unassigned).chain(pictures).collect())
    }
}

impl Identity {
    /// The identity as one text. Equal texts mean equal identities.
    pub fn to_text(&self) -> String {
        self.0.iter().map(|(name, value)| format!("{name} = {value}\n")).collect()
    }
}

/// The entries of an [`Identity`] that say which picture it is. The other entries say how it was made.
const PICTURE: &[&str] = &["scene_blake3", "punctual_scale", "albedo_max", "unassigned", "camera_view", "size"];

impl Identity {
    /// Compares with a picture from a file. Returns in words the first difference of scene, camera or size, or `None`
    /// if they agree. Entries that the file lacks are not compared.
    pub fn other_picture(&self, image: &LayeredImage) -> Option<String> {
        let differs = |(name, wanted): &&(&'static str, String)| {
            PICTURE.contains(name) && image.texts.get(*name).is_some_and(|found| found != wanted)
        };
        self.0.iter().find(differs).map(|(name, _)| describe(name))
    }
}

/// The name of an identity's entry in words.
fn describe(name: &str) -> String {
    match name {
        "scene_blake3" => "scene (its files or its sky)".to_owned(),
        "unassigned" => "material of meshes without one (materials.unassigned)".to_owned(),
        "pictures_blake3" => "images (normal maps or roughness)".to_owned(),
        name => name.replace('_', " "),
    }
}

impl Reference {
    /// Writes the picture with all that [`Reference::read`] and [`resume`] need.
    ///
    /// # Errors
    /// Those of [`LayeredImage::write_exr`].
    pub fn write(&self, path: &Path, identity: &Identity) -> Result<(), ReferenceError> {
        let mut image = self.image.clone();
        for (name, text) in &identity.0 {
            image.texts.insert((*name).to_owned(), text.clone());
        }
        let mut number = |name: &str, text: String| image.texts.insert(name.to_owned(), text);
        number("spp", self.spp.to_string());
        number("non_finite", self.non_finite.to_string());
        number("rays_primary", self.rays.primary.to_string());
        number("rays_shadow", self.rays.shadow.to_string());
        if let Some(noise) = &self.noise {
            number("noise_mean", noise.mean.to_string());
            number("noise_mean_standard_error", noise.mean_standard_error.to_string());
            number("noise_rms_standard_error", noise.rms_standard_error.to_string());
        }
        if let Some(state) = &self.state {
            state.film.store(&mut image);
        }
        Ok(image.write_exr(path)?)
    }

    /// Reads a reference for comparison: its layers and its description, without the state.
    ///
    /// # Errors
    /// The file cannot be read, or [`Reference::write`] did not write it.
    pub fn read(path: &Path) -> Result<Reference, ReferenceError> {
        let image = LayeredImage::read_exr(path)?;
        let lacks = |what: &str| ReferenceError::NotAReference { path: path.to_owned(), what: what.to_owned() };
        if image.texts.get("format").is_none_or(|format| format != FORMAT) {
            return Err(lacks("the format text"));
        }
        for layer in ["beauty", "irradiance_indirect"] {
            if image.layer(layer).is_none() {
                return Err(lacks(&format!("the layer '{layer}'")));
            }
        }
        let number = |name: &str| -> Option<u64> { image.texts.get(name)?.parse().ok() };
        let required = |name: &str| number(name).ok_or_else(|| lacks(&format!("the text '{name}'")));
        let real = |name: &str| -> Option<f64> { image.texts.get(name)?.parse().ok().filter(|x: &f64| x.is_finite()) };
        let noise = || {
            Some(NoiseLevel {
                mean: real("noise_mean")?,
                mean_standard_error: real("noise_mean_standard_error")?,
                rms_standard_error: real("noise_rms_standard_error")?,
            })
        };
        Ok(Reference {
            spp: u32::try_from(required("spp")?).map_err(|_| lacks("a plausible 'spp'"))?,
            non_finite: required("non_finite")?,
            rays: RayCount { primary: required("rays_primary")?, shadow: required("rays_shadow")? },
            noise: noise(),
            state: None,
            image,
        })
    }
}

/// Reads the state of an earlier run with this identity. `None` if that run has less than one block.
///
/// # Errors
/// Those of [`Reference::read`]; the file has another identity, or its state is damaged.
pub fn resume(
    path: &Path,
    identity: &Identity,
    world: &World,
    settings: &ReferenceSettings,
) -> Result<Option<State>, ReferenceError> {
    let found = Reference::read(path)?;
    for (name, wanted) in &identity.0 {
        let found = found.image.texts.get(*name).map_or("missing", String::as_str);
        if found != wanted {
            return Err(ReferenceError::Different {
                path: path.to_owned(),
                what: describe(name),
                found: found.to_owned(),
                wanted: wanted.clone(),
            });
        }
    }
    let blocks = found.spp / BLOCK;
    if blocks == 0 {
        return Ok(None);
    }
    let film = Film::restore(quantities(world, settings.transport), &found.image, blocks);
    let film = film.ok_or_else(|| ReferenceError::NoState { path: path.to_owned() })?;
    Ok(Some(State { film, non_finite: found.non_finite, rays: found.rays }))
}
