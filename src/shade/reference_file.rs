//! References on disk: an EXR of their layers that also carries what they are of and what is needed to go on.
//!
//! Beside the layers stand the texts of [`Identity`], `spp`, `non_finite`, `rays_*` and `noise_*` (the attribute
//! `lightprobe`, JSON), and the state of the film as words (channels `state.*`, whole numbers; [`Film::store`]).

use std::path::{Path, PathBuf};

use super::develop::quantities;
use super::film::{Film, NoiseLevel};
use super::reference::{Reference, ReferenceSettings, State};
use crate::image::{ImageError, LayeredImage};
use crate::light::World;
use crate::light::sampled::RayCount;
use crate::math::blocks::BLOCK;
use crate::scene::Camera;

/// Of the layout of the file and of the estimator: another version's samples cannot be continued.
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
        "cannot continue {path}: its {what} is {found}, now it is {wanted}; give the arguments that it was made with or \
         write to another file"
    )]
    Different { path: PathBuf, what: String, found: String, wanted: String },
    #[error("cannot continue {path}: its state is missing or damaged; make it anew without --resume")]
    NoState { path: PathBuf },
}

/// All that a reference's samples depend on, by name; what explains most comes first.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity(Vec<(&'static str, String)>);

impl Identity {
    pub fn new(world: &World, camera: &Camera, width: u32, height: u32, settings: &ReferenceSettings) -> Identity {
        let optional = |x: Option<String>| x.unwrap_or_else(|| "none".to_owned());
        // Shortest texts that read back to the same number: equal texts are equal numbers.
        let camera_numbers = format!("{:?} {:?} {:?}", camera.position, camera.world_from_camera, camera.projection);
        Identity(vec![
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
        ])
    }
}

impl Identity {
    /// All of it as text: equal texts are equal identities.
    pub fn to_text(&self) -> String {
        self.0.iter().map(|(name, value)| format!("{name} = {value}\n")).collect()
    }
}

/// What of an [`Identity`] says which picture it is; the rest says how it was made.
const PICTURE: &[&str] = &["scene_blake3", "punctual_scale", "albedo_max", "camera_view", "size"];

impl Identity {
    /// What makes a picture from a file another than this one, of the scene, camera and size; `None` where it is the same, or
    /// its file does not say.
    pub fn other_picture(&self, image: &LayeredImage) -> Option<String> {
        let differs = |(name, wanted): &&(&'static str, String)| {
            PICTURE.contains(name) && image.texts.get(*name).is_some_and(|found| found != wanted)
        };
        self.0.iter().find(differs).map(|(name, _)| describe(name))
    }
}

/// A part of an identity in words.
fn describe(name: &str) -> String {
    match name {
        "scene_blake3" => "scene (its files or its sky)".to_owned(),
        name => name.replace('_', " "),
    }
}

impl Reference {
    /// Writes the picture with what [`Reference::read`] and [`resume`] need.
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

    /// Reads a reference to compare with: its layers and what is known of them, without the state.
    ///
    /// # Errors
    /// Files that cannot be read or were not written by [`Reference::write`].
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

/// Reads what a run of this identity left behind, to go on from there. `None` where it is less than a block.
///
/// # Errors
/// Those of [`Reference::read`], another identity, and a damaged state.
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
