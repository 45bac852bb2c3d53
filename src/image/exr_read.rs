//! OpenEXR, read: the plain R, G, B of any flat file, and all layers of the files that `exr_write` wrote.

use std::collections::BTreeMap;
use std::path::Path;

use exr::block::lines::LineRef;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use glam::Vec3;
use half::f16;

use super::error::ImageError;
use super::exr_file::ExrFile;
use super::layered::{BEAUTY, LayeredImage};
use super::picture::Picture;

/// Name of the layer of the plain channels, while a file is being read.
const PLAIN: &str = "";

/// One layer while it is being read: which channels of the file it consists of, and its pixels.
struct Layer {
    name: String,
    channels: [usize; 3],
    pixels: Vec<Vec3>,
}

impl Picture {
    /// Reads the channels R, G, B (16-bit or 32-bit) of the first part that has them.
    ///
    /// # Errors
    /// A file that cannot be opened, is damaged, is deep or subsampled, or has no such channels.
    pub fn read_exr(path: &Path) -> Result<Picture, ImageError> {
        let file = ExrFile::open(path)?;
        let plain_in = |(part, header)| Some((part, layers_of(header).remove(PLAIN)?));
        let Some((part, channels)) = file.headers().iter().enumerate().find_map(plain_in) else {
            return Err(no_color(path, file.headers()));
        };
        let size = file.headers()[part].layer_size;
        let layers = read_layers(file, part, BTreeMap::from([(PLAIN.to_owned(), channels)]))?;
        let pixels = layers.into_iter().flat_map(|layer| layer.pixels).collect();
        Ok(Picture::from_pixels(size.width() as u32, size.height() as u32, pixels))
    }
}

impl LayeredImage {
    /// Reads every layer that has the three channels `layer.R`, `layer.G`, `layer.B`, sorted by name, from the first part that has
    /// any colour. A part with plain R, G, B only gives the one layer `beauty`.
    ///
    /// # Errors
    /// A file that cannot be opened, is damaged, is deep or subsampled, or has no colour at all.
    pub fn read_exr(path: &Path) -> Result<LayeredImage, ImageError> {
        let file = ExrFile::open(path)?;
        let colored = |(part, header)| Some((part, layers_of(header))).filter(|(_, layers)| !layers.is_empty());
        let Some((part, mut wanted)) = file.headers().iter().enumerate().find_map(colored) else {
            return Err(no_color(path, file.headers()));
        };
        // Beside named layers the plain channels are a second copy of one of them.
        if wanted.len() > 1 {
            wanted.remove(PLAIN);
        }
        let size = file.headers()[part].layer_size;
        let mut image = LayeredImage::new(size.width() as u32, size.height() as u32);
        for layer in read_layers(file, part, wanted)? {
            image.push(if layer.name == PLAIN { BEAUTY } else { &layer.name }, layer.pixels);
        }
        Ok(image)
    }
}

/// The layers of a part that have all three channels, by name: the channels' places in the file.
fn layers_of(header: &Header) -> BTreeMap<String, [usize; 3]> {
    let mut found: BTreeMap<String, [Option<usize>; 3]> = BTreeMap::new();
    for (place, channel) in header.channels.list.iter().enumerate() {
        let name = channel.name.to_string();
        let (layer, letter) = name.rsplit_once('.').unwrap_or((PLAIN, &name));
        if let Some(component) = ["R", "G", "B"].iter().position(|&l| l == letter) {
            found.entry(layer.to_owned()).or_default()[component] = Some(place);
        }
    }
    let whole = |(name, [r, g, b]): (String, [Option<usize>; 3])| Some((name, [r?, g?, b?]));
    found.into_iter().filter_map(whole).collect()
}

fn read_layers(file: ExrFile<'_>, part: usize, wanted: BTreeMap<String, [usize; 3]>) -> Result<Vec<Layer>, ImageError> {
    let header = &file.headers()[part];
    let (size, channels) = (header.layer_size, header.channels.clone());
    let blank = |(name, channels)| Layer { name, channels, pixels: vec![Vec3::ZERO; size.area()] };
    let mut layers: Vec<Layer> = wanted.into_iter().map(blank).collect();
    // Which layer and component each channel of the file goes to.
    let mut targets = vec![None; channels.list.len()];
    for (index, layer) in layers.iter().enumerate() {
        for (component, &channel) in layer.channels.iter().enumerate() {
            targets[channel] = Some((index, component));
        }
    }
    file.for_each_block(part, |block| {
        for line in block.lines(&channels) {
            let place = line.location;
            if let Some((layer, component)) = targets[place.channel] {
                let start = place.position.y() * size.width() + place.position.x();
                let row = &mut layers[layer].pixels[start..start + place.sample_count];
                read_line(&line, channels.list[place.channel].sample_type, row, component);
            }
        }
    })?;
    Ok(layers)
}

/// Decompressed lines are in the machine's own byte order and as long as their pixels: the decoder has made sure.
fn read_line(line: &LineRef<'_>, sample_type: SampleType, row: &mut [Vec3], component: usize) {
    fn fill<const N: usize>(bytes: &[u8], row: &mut [Vec3], component: usize, value: impl Fn([u8; N]) -> f32) {
        for (pixel, &sample) in row.iter_mut().zip(bytes.as_chunks::<N>().0) {
            pixel[component] = value(sample);
        }
    }
    match sample_type {
        SampleType::F16 => fill(line.value, row, component, |bytes| f16::from_ne_bytes(bytes).to_f32()),
        SampleType::F32 => fill(line.value, row, component, f32::from_ne_bytes),
        SampleType::U32 => fill(line.value, row, component, |bytes| u32::from_ne_bytes(bytes) as f32),
    }
}

fn no_color(path: &Path, headers: &[Header]) -> ImageError {
    let channels = headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    ImageError::NoColor { path: path.to_owned(), channels: channels.collect::<Vec<_>>().join(", ") }
}
