//! PNG, 8 bits per channel.

use std::io::{self, BufReader, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageFormat, ImageReader};

use super::error::ImageError;
use super::picture::Picture8;
use crate::system::input::open_file;
use crate::system::output::write_atomically;

const FORMAT: &str = "PNG";

impl Picture8 {
    /// Writes an RGB PNG. The same picture gives the same bytes.
    ///
    /// # Errors
    /// Those of [`write_atomically`], and a picture without pixels.
    pub fn write_png(&self, path: &Path) -> Result<(), ImageError> {
        if self.pixels.is_empty() {
            return Err(ImageError::Empty { path: path.to_owned(), width: self.width, height: self.height });
        }
        Ok(write_atomically(path, |file| self.encode_png(file))?)
    }

    /// Writes the PNG into any writer, for HTML pages that embed their pictures. Undone by [`Picture8::read_png`].
    ///
    /// # Errors
    /// Those of `writer`.
    pub fn encode_png(&self, writer: impl Write) -> io::Result<()> {
        let encoder = PngEncoder::new_with_quality(writer, CompressionType::Default, FilterType::Adaptive);
        let bytes = self.pixels.as_flattened();
        encoder.write_image(bytes, self.width, self.height, ExtendedColorType::Rgb8).map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })
    }

    /// Reads a PNG of any kind: grey becomes RGB, 16 bits become 8, transparency is dropped.
    ///
    /// # Errors
    /// The file cannot be opened, is damaged, or exceeds the decoder's limit of 512 MiB.
    pub fn read_png(path: &Path) -> Result<Picture8, ImageError> {
        let file = open_file(path).map_err(|cause| ImageError::Open { path: path.to_owned(), cause })?;
        let decoded = ImageReader::with_format(BufReader::new(file), ImageFormat::Png).decode().map_err(|error| {
            ImageError::Damaged { path: path.to_owned(), format: FORMAT, reason: error.to_string() }
        })?;
        let rgb = decoded.into_rgb8();
        let (width, height) = rgb.dimensions();
        Ok(Picture8 { width, height, pixels: rgb.pixels().map(|pixel| pixel.0).collect() })
    }
}
