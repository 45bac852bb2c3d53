//! JPEG, for small stand-ins of pictures in pages: never for what is measured.

use std::io::{self, Write};

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::picture::Picture8;

/// 1 to 100: edges stay clean and files small.
const QUALITY: u8 = 85;

impl Picture8 {
    /// The bytes of a JPEG, lossy.
    ///
    /// # Errors
    /// Those of `writer`, and a picture without pixels or with a side beyond 65,535.
    pub fn encode_jpeg(&self, writer: impl Write) -> io::Result<()> {
        let encoder = JpegEncoder::new_with_quality(writer, QUALITY);
        let bytes = self.pixels.as_flattened();
        encoder.write_image(bytes, self.width, self.height, ExtendedColorType::Rgb8).map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })
    }
}
