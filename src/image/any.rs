//! Any picture on disk as its numbers: layers of OpenEXR, Radiance HDR, PNG of 8 and 16 bits.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::error::ImageError;
use super::exr_read::read_exr_header;
use super::layered::{BEAUTY, LayeredImage};
use crate::system::input::open_file;

/// First bytes of an OpenEXR file.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// First bytes of a Radiance file, whatever program wrote it.
const HDR_MAGIC: [u8; 2] = *b"#?";

/// What a picture says about itself before its pixels are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageHeader {
    pub width: u32,
    pub height: u32,
    /// One named `beauty` where there are no names.
    pub layers: Vec<String>,
    /// Whether the numbers are codes for a screen (PNG: code ÷ largest code, sRGB as it stands) and not light.
    pub is_display: bool,
}

/// A picture's numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct AnyImage {
    pub image: LayeredImage,
    pub is_display: bool,
}

enum Format {
    Exr,
    Hdr,
    Png,
}

impl ImageHeader {
    /// # Errors
    /// A file that cannot be opened, is damaged, or is of another format.
    pub fn read(path: &Path) -> Result<ImageHeader, ImageError> {
        let plain =
            |(width, height), is_display| ImageHeader { width, height, layers: vec![BEAUTY.to_owned()], is_display };
        match format_of(path)? {
            Format::Exr => {
                let (width, height, layers) = read_exr_header(path)?;
                Ok(ImageHeader { width, height, layers, is_display: false })
            }
            Format::Hdr => {
                let decoder = HdrDecoder::new(open(path)?).map_err(|e| damaged(path, "Radiance HDR", &e))?;
                Ok(plain(decoder.dimensions(), false))
            }
            Format::Png => {
                let reader = ImageReader::with_format(open(path)?, ImageFormat::Png);
                Ok(plain(reader.into_dimensions().map_err(|e| damaged(path, "PNG", &e))?, true))
            }
        }
    }
}

impl AnyImage {
    /// Reads the layers that are wanted. Transparency is dropped; grey becomes RGB.
    ///
    /// # Errors
    /// A file that cannot be opened, is damaged, or is of another format.
    pub fn read(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<AnyImage, ImageError> {
        match format_of(path)? {
            Format::Exr => Ok(AnyImage { image: LayeredImage::read_exr_layers(path, is_wanted)?, is_display: false }),
            Format::Hdr => {
                let decoded = HdrDecoder::new(open(path)?).and_then(DynamicImage::from_decoder);
                Ok(AnyImage {
                    image: layered(decoded.map_err(|e| damaged(path, "Radiance HDR", &e))?),
                    is_display: false,
                })
            }
            Format::Png => {
                let decoded = ImageReader::with_format(open(path)?, ImageFormat::Png).decode();
                Ok(AnyImage { image: layered(decoded.map_err(|e| damaged(path, "PNG", &e))?), is_display: true })
            }
        }
    }
}

fn layered(decoded: DynamicImage) -> LayeredImage {
    let floats = decoded.into_rgb32f();
    let mut image = LayeredImage::new(floats.width(), floats.height());
    image.push(BEAUTY, floats.pixels().map(|pixel| Vec3::from(pixel.0)).collect());
    image
}

fn open(path: &Path) -> Result<BufReader<File>, ImageError> {
    let file = open_file(path).map_err(|cause| ImageError::Open { path: path.to_owned(), cause })?;
    Ok(BufReader::new(file))
}

/// By the first bytes: names lie.
fn format_of(path: &Path) -> Result<Format, ImageError> {
    let mut start = Vec::new();
    let read = open(path)?.take(4).read_to_end(&mut start);
    read.map_err(|cause| ImageError::Open { path: path.to_owned(), cause })?;
    Ok(match &start[..] {
        start if *start == EXR_MAGIC => Format::Exr,
        start if start.starts_with(&HDR_MAGIC) => Format::Hdr,
        // What is none of the three fails as a PNG, with the reason.
        _ => Format::Png,
    })
}

fn damaged(path: &Path, format: &'static str, error: &image::ImageError) -> ImageError {
    ImageError::Damaged { path: path.to_owned(), format, reason: error.to_string() }
}
