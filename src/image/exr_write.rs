//! OpenEXR, written: one part, scan lines, 32-bit float, ZIP in blocks of 16 lines. Undone by `exr_read`.
//!
//! The same image gives the same bytes: lines are in increasing order, and no date and no path is stored.

use std::io;
use std::path::Path;

use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SmallVec, Text, Vec2, WritableImage,
};
use glam::Vec3;

use super::error::ImageError;
use super::layered::LayeredImage;
use super::picture::Picture;
use crate::output::write_atomically;

/// EXR limits a channel's name to 255 bytes; this leaves room for ".R".
const MAX_NAME_BYTES: usize = 200;

/// What stands for a layer's name where its channels have none.
const PLAIN: &str = "";

/// Primaries and white point D65 of Rec. 709 (ITU-R BT.709-6, items 1.3 and 1.4), CIE xy.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

impl LayeredImage {
    /// Writes all layers, sorted by channel name as EXR demands, and plain R, G, B for the layer `beauty` (the first layer where
    /// there is none of that name).
    ///
    /// # Errors
    /// Those of [`write_atomically`], no pixels, no layers, and names that are not plain identifiers.
    pub fn write_exr(&self, path: &Path) -> Result<(), ImageError> {
        if let Some(name) = self.names().find(|name| !is_identifier(name)) {
            return Err(ImageError::LayerName { path: path.to_owned(), name: name.to_owned() });
        }
        let plain = self.plain_layer().map(|pixels| (PLAIN, pixels));
        let channels = self.layers().chain(plain).flat_map(|(name, pixels)| rgb_channels(name, pixels)).collect();
        write_channels(path, self.width, self.height, channels)
    }
}

impl Picture {
    /// Writes the plain channels R, G, B.
    ///
    /// # Errors
    /// Those of [`write_atomically`], and a picture without pixels.
    pub fn write_exr(&self, path: &Path) -> Result<(), ImageError> {
        write_channels(path, self.width, self.height, rgb_channels(PLAIN, &self.pixels).into())
    }
}

/// Layer names become parts of channel names, where a dot separates.
fn is_identifier(name: &str) -> bool {
    (1..=MAX_NAME_BYTES).contains(&name.len()) && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

/// The channels `name.R`, `name.G`, `name.B`; plain `R`, `G`, `B` for the name [`PLAIN`].
fn rgb_channels(name: &str, pixels: &[Vec3]) -> [AnyChannel<FlatSamples>; 3] {
    [("R", 0), ("G", 1), ("B", 2)].map(|(letter, component)| {
        let channel = if name == PLAIN { letter.to_owned() } else { format!("{name}.{letter}") };
        AnyChannel {
            name: Text::from(channel.as_str()),
            sample_data: FlatSamples::F32(pixels.iter().map(|pixel| pixel[component]).collect()),
            quantize_linearly: false,
            sampling: Vec2(1, 1),
        }
    })
}

fn write_channels(
    path: &Path,
    width: u32,
    height: u32,
    channels: Vec<AnyChannel<FlatSamples>>,
) -> Result<(), ImageError> {
    if width == 0 || height == 0 || channels.is_empty() {
        return Err(ImageError::Empty { path: path.to_owned(), width, height });
    }
    let attributes = LayerAttributes { software_name: Some(Text::from("lightprobe")), ..LayerAttributes::default() };
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = Vec2(width as usize, height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(SmallVec::from_vec(channels)));
    let mut image = Image::from_layer(layer);
    image.attributes.chromaticities = Some(REC_709);
    Ok(write_atomically(path, |file| image.write().to_buffered(file).map_err(io_error))?)
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}
