//! Why two sides cannot be compared.

use std::path::{Path, PathBuf};

use crate::image::ImageError;
use crate::probe::container::FileError;
use crate::report::page::PageError;
use crate::system::memory::TooLittleMemory;

#[derive(Debug, thiserror::Error)]
pub enum DiffError {
    #[error("{path}: {what}")]
    File { path: PathBuf, what: String },
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Probes(#[from] FileError),
    #[error(transparent)]
    Page(#[from] PageError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
}

impl DiffError {
    pub fn file(path: &Path, what: impl Into<String>) -> DiffError {
        DiffError::File { path: path.to_owned(), what: what.into() }
    }

    pub fn incomparable([base, candidate]: [&Path; 2], what: impl std::fmt::Display) -> DiffError {
        DiffError::file(candidate, format!("cannot be compared with {}: {what}", base.display()))
    }
}
