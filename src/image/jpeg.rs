//! JPEG, for small previews in HTML pages. No figure is measured from one.

use std::io::{self, Write};

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::picture::Picture8;

/// JPEG quality, 1 to 100. At this value edges stay clean and files small.
const QUALITY: u8 = 85;

impl Picture8 {
    /// Writes the picture as JPEG, which is lossy.
    ///
    /// # Errors
    /// Those of `writer`, a picture without pixels, and a side above 65,535.
    pub fn encode_jpeg(&self, writer: impl Write) -> io::Result<()> {
        let encoder = JpegEncoder::new_with_quality(writer, QUALITY);
        let bytes = self.pixels.as_flattened();
        encoder.write_image(bytes, self.width, self.height, ExtendedColorType::Rgb8).map_err(|error| match error {
            image::ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })
    }
}
