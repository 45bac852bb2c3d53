//! Writing OpenEXR: one part, scan lines, 32-bit float, ZIP in blocks of 16 lines. Undone by `exr_read`.
//!
//! The same image gives the same bytes, because lines are in increasing order and neither date nor path is stored.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use exr::meta::attribute::{AttributeValue, Chromaticities};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SmallVec, Text, Vec2, WritableImage,
};
use glam::Vec3;

use super::error::ImageError;
use super::layered::{LayeredImage, STATE, TEXTS};
use super::picture::Picture;
use crate::system::output::write_atomically;

/// EXR limits a channel's name to 255 bytes. This limit leaves room for endings such as ".R".
const MAX_NAME_BYTES: usize = 200;

/// Layer name of the plain channels R, G, B.
const PLAIN: &str = "";

/// Primaries and white point D65 of Rec. 709 (ITU-R BT.709-6, items 1.3 and 1.4), CIE xy.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

impl LayeredImage {
    /// Writes all layers, sorted by channel name as EXR demands. The layer `beauty` is also written as plain R, G, B,
    /// which other programs show; without a layer of that name the first layer is.
    ///
    /// # Errors
    /// Those of [`write_atomically`], no pixels, no layers, and names that are not plain identifiers.
    pub fn write_exr(&self, path: &Path) -> Result<(), ImageError> {
        let words = || self.all_words().iter();
        if let Some(name) = self.names().chain(words().map(|(name, _)| name.as_str())).find(|name| !is_identifier(name))
        {
            return Err(ImageError::LayerName { path: path.to_owned(), name: name.to_owned() });
        }
        let plain = self.plain_layer().map(|pixels| (PLAIN, pixels));
        let mut channels: Vec<_> =
            self.layers().chain(plain).flat_map(|(name, pixels)| rgb_channels(name, pixels)).collect();
        channels
            .extend(words().map(|(name, words)| channel(&format!("{STATE}{name}"), FlatSamples::U32(words.clone()))));
        write_channels(path, self.width, self.height, channels, &self.texts)
    }
}

impl Picture {
    /// Writes the plain channels R, G, B.
    ///
    /// # Errors
    /// Those of [`write_atomically`], and a picture without pixels.
    pub fn write_exr(&self, path: &Path) -> Result<(), ImageError> {
        write_channels(path, self.width, self.height, rgb_channels(PLAIN, &self.pixels).into(), &BTreeMap::new())
    }
}

/// A file of these plain channels, sorted by name as EXR demands, each `width · height` numbers, row 0 at the top.
///
/// # Errors
/// No pixels or channels, and what the encoder says.
pub fn exr_bytes(width: u32, height: u32, channels: &[(&str, Vec<f32>)]) -> io::Result<Vec<u8>> {
    if width == 0 || height == 0 || channels.is_empty() {
        return Err(io::Error::other("there is nothing in it"));
    }
    let channels = channels.iter().map(|(name, samples)| channel(name, FlatSamples::F32(samples.clone()))).collect();
    let mut file = io::Cursor::new(Vec::new());
    image(width, height, channels, LayerAttributes::default()).write().to_buffered(&mut file).map_err(io_error)?;
    Ok(file.into_inner())
}

/// Whether a layer may have this name. Layer names become parts of channel names, in which a dot is the separator.
fn is_identifier(name: &str) -> bool {
    (1..=MAX_NAME_BYTES).contains(&name.len()) && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

/// The channels `name.R`, `name.G`, `name.B`; plain `R`, `G`, `B` for the name [`PLAIN`].
fn rgb_channels(name: &str, pixels: &[Vec3]) -> [AnyChannel<FlatSamples>; 3] {
    [("R", 0), ("G", 1), ("B", 2)].map(|(letter, component)| {
        let full_name = if name == PLAIN { letter.to_owned() } else { format!("{name}.{letter}") };
        channel(&full_name, FlatSamples::F32(pixels.iter().map(|pixel| pixel[component]).collect()))
    })
}

/// `name` is ASCII.
fn channel(name: &str, samples: FlatSamples) -> AnyChannel<FlatSamples> {
    AnyChannel { name: Text::from(name), sample_data: samples, quantize_linearly: false, sampling: Vec2(1, 1) }
}

fn write_channels(
    path: &Path,
    width: u32,
    height: u32,
    channels: Vec<AnyChannel<FlatSamples>>,
    texts: &BTreeMap<String, String>,
) -> Result<(), ImageError> {
    if width == 0 || height == 0 || channels.is_empty() {
        return Err(ImageError::Empty { path: path.to_owned(), width, height });
    }
    let mut attributes =
        LayerAttributes { software_name: Some(Text::from("lightprobe")), ..LayerAttributes::default() };
    if !texts.is_empty() {
        // All texts share one attribute, because the crate writes several in random order. The attribute's bytes are
        // UTF-8. Serialising a map of strings cannot fail.
        let json = serde_json::to_vec(texts).unwrap_or_default();
        attributes.other.insert(Text::from(TEXTS), AttributeValue::Text(Text::from_slice_unchecked(&json)));
    }
    let image = image(width, height, channels, attributes);
    Ok(write_atomically(path, |file| image.write().to_buffered(file).map_err(io_error))?)
}

/// One part of these channels.
fn image(
    width: u32,
    height: u32,
    channels: Vec<AnyChannel<FlatSamples>>,
    attributes: LayerAttributes,
) -> Image<Layer<AnyChannels<FlatSamples>>> {
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = Vec2(width as usize, height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(SmallVec::from_vec(channels)));
    let mut image = Image::from_layer(layer);
    image.attributes.chromaticities = Some(REC_709);
    image
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}
