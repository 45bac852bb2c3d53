//! Errors of scenes. Every message names the file, the place in it, the fault and the remedy.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::image::ImageError;

/// The reason why a scene was not loaded. Each message is one line.
#[derive(Debug, Error)]
pub enum SceneError {
    /// A file of the scene is absent or unreadable.
    #[error("{file}: {place}: cannot be read: {cause}; {remedy}")]
    Read { file: PathBuf, place: String, cause: io::Error, remedy: &'static str },
    /// Neither a GLB container nor glTF 2.0 JSON.
    #[error("{file}: not a glTF 2.0 file: {what}; {remedy}")]
    Format { file: PathBuf, what: String, remedy: &'static str },
    /// The file needs an extension that the loader does not read.
    #[error("{file}: {place} needs the extension {extension}, which lightprobe does not read; {remedy}")]
    Unsupported { file: PathBuf, place: String, extension: String, remedy: &'static str },
    /// Something in the file breaks the rules of glTF.
    #[error("{file}: {place}: {what}; {remedy}")]
    Invalid { file: PathBuf, place: String, what: String, remedy: &'static str },
    /// An environment map cannot be decoded.
    #[error("environment map: {0}")]
    EnvironmentMap(ImageError),
    /// A texture image cannot be decoded, or the sky has no finite radiance.
    #[error("{file}: {place}: {what}; {remedy}")]
    Image { file: PathBuf, place: String, what: String, remedy: &'static str },
    /// The file asks for far more memory than its own size warrants.
    #[error("{file}: {place}: {what}; {remedy}")]
    TooLarge { file: PathBuf, place: String, what: String, remedy: &'static str },
    /// The scene has nothing to render.
    #[error(
        "{file}: {what}; export at least one triangle mesh in the default scene and check `extras.lightprobe` marks"
    )]
    Empty { file: PathBuf, what: String },
}

impl SceneError {
    /// The fault and its place in the file, for warnings, which name the file themselves.
    pub(super) fn in_file(&self) -> String {
        match self {
            SceneError::Invalid { place, what, .. } => format!("{place}: {what}"),
            other => other.to_string(),
        }
    }
}

/// The usual remedy for data that breaks the rules of glTF.
pub(super) const RE_EXPORT: &str = "export the file again or check it with gltf_validator";
