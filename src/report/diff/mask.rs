//! Which pixels of images count.

use std::path::{Path, PathBuf};

use super::DiffError;
use crate::image::AnyImage;
use crate::math::color::luminance;

/// Which pixels count.
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
    pub fn read(path: &Path) -> Result<Mask, DiffError> {
        let image = AnyImage::read(path, |_| true)?.image;
        let counts: Vec<bool> = image
            .layers()
            .next()
            .map(|(_, pixels)| pixels.iter().map(|p| luminance(*p) >= 0.5).collect())
            .unwrap_or_default();
        if !counts.contains(&true) {
            return Err(DiffError::Mask {
                path: path.to_owned(),
                what: "it has no white pixel; paint white what counts".into(),
            });
        }
        Ok(Mask { path: path.to_owned(), width: image.width, height: image.height, counts })
    }
}
