//! Reading the numbers of a picture in any supported format: layers of OpenEXR, Radiance HDR, PNG of 8 and 16 bits.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use glam::Vec3;
use image::{DynamicImage, ImageFormat, ImageReader};

use super::error::ImageError;
use super::exr_file::EXR_MAGIC;
use super::exr_read::read_exr_header;
use super::hdr::HdrFile;
use super::layered::{BEAUTY, LayeredImage};
use crate::system::input::open_file;

/// First bytes of a Radiance file. Programs differ in the bytes after them.
const HDR_MAGIC: [u8; 2] = *b"#?";

/// The header of a picture, which is read without its pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageHeader {
    pub width: u32,
    pub height: u32,
    /// Names of the layers. A picture without names has one layer, `beauty`.
    pub layers: Vec<String>,
    /// Whether the numbers are display codes instead of linear light. A PNG's are sRGB codes ÷ the largest code.
    pub is_display: bool,
}

/// The numbers of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct AnyImage {
    pub image: LayeredImage,
    /// As [`ImageHeader::is_display`].
    pub is_display: bool,
}

enum Format {
    Exr,
    Hdr,
    Png,
}

impl ImageHeader {
    /// Reads the header of a file.
    ///
    /// # Errors
    /// The file cannot be opened, is damaged, or has another format.
    pub fn read(path: &Path) -> Result<ImageHeader, ImageError> {
        let plain =
            |(width, height), is_display| ImageHeader { width, height, layers: vec![BEAUTY.to_owned()], is_display };
        match format_of(path)? {
            Format::Exr => {
                let (width, height, layers) = read_exr_header(path)?;
                Ok(ImageHeader { width, height, layers, is_display: false })
            }
            Format::Hdr => Ok(plain(HdrFile::open(path, open(path)?)?.size(), false)),
            Format::Png => {
                let reader = ImageReader::with_format(open(path)?, ImageFormat::Png);
                Ok(plain(reader.into_dimensions().map_err(|e| damaged(path, "PNG", &e))?, true))
            }
        }
    }
}

impl AnyImage {
    /// Reads the layers whose names `is_wanted` accepts. Transparency is dropped, and grey becomes RGB.
    ///
    /// # Errors
    /// The file cannot be opened, is damaged, or has another format.
    pub fn read(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<AnyImage, ImageError> {
        match format_of(path)? {
            Format::Exr => Ok(AnyImage { image: LayeredImage::read_exr_layers(path, is_wanted)?, is_display: false }),
            Format::Hdr => {
                let picture = HdrFile::open(path, open(path)?)?.read()?;
                let mut image = LayeredImage::new(picture.width, picture.height);
                image.push(BEAUTY, picture.pixels);
                Ok(AnyImage { image, is_display: false })
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

/// The format by the file's first bytes, because the extension of its name may be wrong.
fn format_of(path: &Path) -> Result<Format, ImageError> {
    let mut start = Vec::new();
    let read = open(path)?.take(4).read_to_end(&mut start);
    read.map_err(|cause| ImageError::Open { path: path.to_owned(), cause })?;
    Ok(match &start[..] {
        start if *start == EXR_MAGIC => Format::Exr,
        start if start.starts_with(&HDR_MAGIC) => Format::Hdr,
        // A file of any other format fails in the PNG decoder, which gives the reason.
        _ => Format::Png,
    })
}

fn damaged(path: &Path, format: &'static str, error: &image::ImageError) -> ImageError {
    ImageError::Damaged { path: path.to_owned(), format, reason: error.to_string() }
}
