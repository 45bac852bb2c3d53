//! Decoding of texture images (PNG and JPEG). Their size is checked before memory is allocated.

use std::io::Cursor;

use glam::Vec4;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::scene::material::Texels;

/// Most pixels of an image's width and of its height.
const MAX_SIDE: u32 = 16384;
/// The decoded textures of a scene may take this many bytes, or [`MAX_RATIO`] × the bytes of their files if that is
/// more. While an image is being converted, memory can reach twice this budget.
const MIN_BUDGET: u64 = 384 << 20;
/// Most decoded bytes per byte of a file. A JPEG with half a bit per pixel grows 64-fold; a malicious PNG can grow a
/// thousandfold.
const MAX_RATIO: u64 = 64;

/// Counts the bytes of images, to bound the memory of decoded ones.
pub(super) struct Budget {
    encoded: u64,
    decoded: u64,
}

/// A decoded image.
pub(super) struct Decoded {
    pub width: u32,
    pub height: u32,
    pub texels: Texels,
}

/// The reason why an image was not decoded.
pub(super) enum Failure {
    /// The format belongs to this extension, which is not read.
    Extension(&'static str),
    Broken(String),
    TooLarge(String),
}

impl Budget {
    pub fn new() -> Self {
        Budget { encoded: 0, decoded: 0 }
    }

    /// Decodes an image. `srgb` tells whether its RGB is sRGB-encoded; alpha is always linear.
    pub fn decode(&mut self, bytes: &[u8], srgb: bool) -> Result<Decoded, Failure> {
        let format = recognise(bytes)?;
        let broken = |e: image::ImageError| Failure::Broken(format!("it does not decode: {e}"));
        let decoder = ImageReader::with_format(Cursor::new(bytes), format).into_decoder();
        let mut decoder = decoder.map_err(broken)?;
        let (width, height) = decoder.dimensions();
        if width == 0 || height == 0 {
            return Err(Failure::Broken("it has no pixels".to_owned()));
        }
        let is_deep =
            matches!(decoder.color_type(), ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16);
        let size = u64::from(width) * u64::from(height) * if is_deep { 16 } else { 4 };
        self.encoded += bytes.len() as u64;
        let budget = MIN_BUDGET.max(self.encoded.saturating_mul(MAX_RATIO));
        if width > MAX_SIDE || height > MAX_SIDE || self.decoded.saturating_add(size) > budget {
            return Err(Failure::TooLarge(format!(
                "with its {width}×{height} pixels the decoded textures would take {} MiB; at most {} MiB and {MAX_SIDE} \
                 pixels per side are allowed",
                (self.decoded + size) >> 20,
                budget >> 20
            )));
        }
        let mut limits = Limits::default();
        (limits.max_image_width, limits.max_image_height, limits.max_alloc) =
            (Some(MAX_SIDE), Some(MAX_SIDE), Some(budget));
        decoder.set_limits(limits).map_err(broken)?;
        let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
        self.decoded += size;
        Ok(Decoded { width, height, texels: texels(image, is_deep, srgb) })
    }

    /// Gives back the bytes of texels that the caller has dropped.
    pub fn release(&mut self, texels: u64, bytes_per_texel: u64) {
        self.decoded = self.decoded.saturating_sub(texels * bytes_per_texel);
    }
}

fn recognise(bytes: &[u8]) -> Result<ImageFormat, Failure> {
    if bytes.starts_with(b"\xabKTX 20\xbb") {
        return Err(Failure::Extension("KHR_texture_basisu"));
    }
    match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => Ok(format),
        Ok(ImageFormat::WebP) => Err(Failure::Extension("EXT_texture_webp")),
        Ok(ImageFormat::Avif) => Err(Failure::Extension("EXT_texture_avif")),
        Ok(ImageFormat::Dds) => Err(Failure::Extension("MSFT_texture_dds")),
        Ok(other) => Err(Failure::Broken(format!("its format is {other:?}, but glTF allows only PNG and JPEG"))),
        Err(_) => Err(Failure::Broken("it is neither PNG nor JPEG".to_owned())),
    }
}

fn texels(image: DynamicImage, is_deep: bool, srgb: bool) -> Texels {
    if !is_deep {
        let data = image.into_rgba8().pixels().map(|p| p.0).collect();
        return Texels::Rgba8 { data, srgb };
    }
    let linear = |c: f32| if srgb { linear_from_srgb(c) } else { c };
    let channel = |c: u16| f32::from(c) / 65535.0;
    let rgba = image.into_rgba16();
    let texel =
        |[r, g, b, a]: [u16; 4]| Vec4::new(linear(channel(r)), linear(channel(g)), linear(channel(b)), channel(a));
    Texels::Rgba32F(rgba.pixels().map(|p| texel(p.0)).collect())
}

/// The linear value of an sRGB code in [0,1] (IEC 61966-2-1).
fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}
