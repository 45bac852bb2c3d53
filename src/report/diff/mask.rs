//! Which pixels of images count.

use std::path::{Path, PathBuf};

use super::error::DiffError;
use crate::image::AnyImage;
use crate::math::color::luminance;

#[derive(Debug, Clone)]
pub struct Mask {
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    /// Of every pixel, row 0 at the top.
    pub counts: Vec<bool>,
}

impl Mask {
    /// Reads a picture whose white pixels count: those of at least half the code.
    ///
    /// # Errors
    /// A picture that cannot be read, or has no white pixel.
    pub fn read(path: &Path) -> Result<Mask, DiffError> {
        let image = AnyImage::read(path, |_| true)?.image;
        let first = image.layers().next().map(|(_, pixels)| pixels).unwrap_or_default();
        let counts: Vec<bool> = first.iter().map(|pixel| luminance(*pixel) >= 0.5).collect();
        if !counts.contains(&true) {
            return Err(DiffError::file(path, "the mask has no white pixel; paint white what counts"));
        }
        Ok(Mask { path: path.to_owned(), width: image.width, height: image.height, counts })
    }
}
