//! Reading OpenEXR: the plain R, G, B of any flat file, and all layers of files that `exr_write` wrote.

use std::collections::BTreeMap;
use std::path::Path;

use exr::block::lines::LineRef;
use exr::meta::attribute::{AttributeValue, ChannelDescription, SampleType, Text};
use exr::meta::header::Header;
use glam::Vec3;
use half::f16;

use super::error::ImageError;
use super::exr_file::ExrFile;
use super::layered::{BEAUTY, LayeredImage, STATE, TEXTS};
use super::picture::Picture;

/// Name of the plain channels R, G, B as a layer, while a file is being read.
const PLAIN: &str = "";

/// One layer while it is being read.
struct Layer {
    name: String,
    /// Indices of its R, G and B among the channels of the file.
    channels: [usize; 3],
    pixels: Vec<Vec3>,
}

impl Picture {
    /// Reads the channels R, G, B (16-bit or 32-bit) of the first part that has them.
    ///
    /// # Errors
    /// The file cannot be opened, is damaged, is deep or subsampled, or has no such channels.
    pub fn read_exr(path: &Path) -> Result<Picture, ImageError> {
        let file = ExrFile::open(path)?;
        let plain_in = |(part, header)| Some((part, layers_of(header).remove(PLAIN)?));
        let Some((part, channels)) = file.headers().iter().enumerate().find_map(plain_in) else {
            return Err(no_color(path, file.headers()));
        };
        let size = file.headers()[part].layer_size;
        let (layers, _) = read_layers(file, part, BTreeMap::from([(PLAIN.to_owned(), channels)]), BTreeMap::new())?;
        let pixels = layers.into_iter().flat_map(|layer| layer.pixels).collect();
        Ok(Picture::from_pixels(size.width() as u32, size.height() as u32, pixels))
    }
}

impl LayeredImage {
    /// Reads the first part that has colour: every layer with the three channels `layer.R`, `layer.G`, `layer.B`,
    /// sorted by name, and the words and texts that [`LayeredImage::write_exr`] wrote. If the part has only plain R, G,
    /// B, they become the layer `beauty`.
    ///
    /// # Errors
    /// The file cannot be opened, is damaged, is deep or subsampled, or has no colour.
    pub fn read_exr(path: &Path) -> Result<LayeredImage, ImageError> {
        LayeredImage::read_exr_layers(path, |_| true)
    }

    /// Like [`LayeredImage::read_exr`], but reads only the layers whose names `is_wanted` accepts. A picture of many
    /// layers is large.
    ///
    /// # Errors
    /// As those of [`LayeredImage::read_exr`].
    pub fn read_exr_layers(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<LayeredImage, ImageError> {
        let file = ExrFile::open(path)?;
        let (part, mut wanted) = colored_part(path, &file)?;
        wanted.retain(|name, _| is_wanted(if name == PLAIN { BEAUTY } else { name }));
        let size = file.headers()[part].layer_size;
        let mut image = LayeredImage::new(size.width() as u32, size.height() as u32);
        image.texts = texts_of(&file.headers()[part]);
        let words = words_of(&file.headers()[part]);
        let (layers, words) = read_layers(file, part, wanted, words)?;
        for layer in layers {
            image.push(if layer.name == PLAIN { BEAUTY } else { &layer.name }, layer.pixels);
        }
        for (name, words) in words {
            image.push_words(&name, words);
        }
        Ok(image)
    }
}

/// Width, height, and the names of the layers that [`LayeredImage::read_exr`] would read. Reads the header only.
///
/// # Errors
/// As those of [`LayeredImage::read_exr`], except damage to the pixels.
pub fn read_exr_header(path: &Path) -> Result<(u32, u32, Vec<String>), ImageError> {
    let file = ExrFile::open(path)?;
    let (part, layers) = colored_part(path, &file)?;
    let size = file.headers()[part].layer_size;
    let named = |name: String| if name == PLAIN { BEAUTY.to_owned() } else { name };
    Ok((size.width() as u32, size.height() as u32, layers.into_keys().map(named).collect()))
}

/// Index of the first part that has colour, and its layers as [`layers_of`] gives them.
fn colored_part(path: &Path, file: &ExrFile<'_>) -> Result<(usize, BTreeMap<String, [usize; 3]>), ImageError> {
    let colored = |(part, header)| Some((part, layers_of(header))).filter(|(_, layers)| !layers.is_empty());
    let Some((part, mut layers)) = file.headers().iter().enumerate().find_map(colored) else {
        return Err(no_color(path, file.headers()));
    };
    // If there are named layers, the plain channels repeat one of them.
    if layers.len() > 1 {
        layers.remove(PLAIN);
    }
    Ok((part, layers))
}

/// The layers of a part that have all three channels: from the name to the indices of R, G and B in the file.
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

/// The part's channels of words: from the name to the index in the file.
fn words_of(header: &Header) -> BTreeMap<String, usize> {
    let words = |(place, channel): (usize, &ChannelDescription)| {
        let name = channel.name.to_string().strip_prefix(STATE)?.to_owned();
        (channel.sample_type == SampleType::U32).then_some((name, place))
    };
    header.channels.list.iter().enumerate().filter_map(words).collect()
}

/// The part's texts. The result is empty if the part has none in the form that `exr_write` writes.
fn texts_of(header: &Header) -> BTreeMap<String, String> {
    match header.own_attributes.other.get(&Text::from(TEXTS)) {
        Some(AttributeValue::Text(json)) => serde_json::from_slice(json.as_slice()).unwrap_or_default(),
        _ => BTreeMap::new(),
    }
}

/// Layers and words by name.
type Read = (Vec<Layer>, BTreeMap<String, Vec<u32>>);

fn read_layers(
    file: ExrFile<'_>,
    part: usize,
    wanted: BTreeMap<String, [usize; 3]>,
    wanted_words: BTreeMap<String, usize>,
) -> Result<Read, ImageError> {
    let header = &file.headers()[part];
    let (size, channels) = (header.layer_size, header.channels.clone());
    let blank = |(name, channels)| Layer { name, channels, pixels: vec![Vec3::ZERO; size.area()] };
    let mut layers: Vec<Layer> = wanted.into_iter().map(blank).collect();
    let mut words: Vec<Vec<u32>> = wanted_words.values().map(|_| vec![0; size.area()]).collect();
    // The destination of each channel of the file.
    let mut targets = vec![None; channels.list.len()];
    for (index, layer) in layers.iter().enumerate() {
        for (component, &channel) in layer.channels.iter().enumerate() {
            targets[channel] = Some(Target::Layer { index, component });
        }
    }
    for (index, &channel) in wanted_words.values().enumerate() {
        targets[channel] = Some(Target::Words { index });
    }
    file.for_each_block(part, |block| {
        for line in block.lines(&channels) {
            let place = line.location;
            let start = place.position.y() * size.width() + place.position.x();
            let row = start..start + place.sample_count;
            match targets[place.channel] {
                None => {}
                Some(Target::Layer { index, component }) => {
                    let sample_type = channels.list[place.channel].sample_type;
                    read_line(&line, sample_type, &mut layers[index].pixels[row], component);
                }
                Some(Target::Words { index }) => {
                    let samples = line.value.as_chunks::<4>().0;
                    words[index][row].iter_mut().zip(samples).for_each(|(word, &s)| *word = u32::from_ne_bytes(s));
                }
            }
        }
    })?;
    Ok((layers, wanted_words.into_keys().zip(words).collect()))
}

/// The destination of a channel's samples.
#[derive(Debug, Clone, Copy)]
enum Target {
    Layer { index: usize, component: usize },
    Words { index: usize },
}

/// Copies one channel of a line into a row of pixels. The decoder guarantees that decompressed lines have the machine's
/// byte order and the length of the row.
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
