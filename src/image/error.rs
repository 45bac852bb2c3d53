//! Errors of reading and writing pictures.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::system::output::OutputError;

/// A picture could not be read or written. Each message names the file and what to do about it.
#[derive(Debug, Error)]
pub enum ImageError {
    #[error("cannot open {path}: {cause}; check the path")]
    Open { path: PathBuf, cause: io::Error },
    #[error("cannot read {path}: {reason}; is it a whole {format} file? Export or copy it again")]
    Damaged { path: PathBuf, format: &'static str, reason: String },
    #[error("cannot read {path}: {reason}; save it as a plain {format} file")]
    Unsupported { path: PathBuf, format: &'static str, reason: String },
    #[error(
        "cannot read {path}: its header claims {width} × {height} pixels, too many for a file of {file_bytes} bytes; \
         the file is damaged: export or copy it again"
    )]
    ImplausibleSize { path: PathBuf, width: usize, height: usize, file_bytes: u64 },
    #[error("cannot read {path}: it has no channels R, G and B and no grey Y, only {channels}; export it with colour")]
    NoColor { path: PathBuf, channels: String },
    #[error("cannot read {path}: {fault}; name one of its layers as {path}:LAYER: {layers}", path = path.display())]
    NoLayer { path: PathBuf, fault: String, layers: String },
    /// The header says that the numbers are not light in R, G and B, or not laid out as a picture.
    #[error("cannot read {path}: {reason}; {remedy}")]
    NotLight { path: PathBuf, reason: String, remedy: &'static str },
    #[error(
        "cannot read {path}: it has {width}×{height} pixels, more than the {most_pixels} that are read from a file of \
         {file_bytes} bytes; reduce the picture"
    )]
    TooLarge { path: PathBuf, width: usize, height: usize, most_pixels: u64, file_bytes: u64 },
    #[error(
        "cannot write {path}: the layer name {name:?} is not 1 to 200 ASCII letters, digits or underscores; rename it"
    )]
    LayerName { path: PathBuf, name: String },
    #[error("cannot write {path}: the picture has no pixels ({width} × {height}); give it a size")]
    Empty { path: PathBuf, width: u32, height: u32 },
    #[error(transparent)]
    Output(#[from] OutputError),
}
