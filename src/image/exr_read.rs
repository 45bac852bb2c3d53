//! Reading OpenEXR: the plain R, G, B of any flat file, and all layers of files that `exr_write` wrote.
//!
//! Pictures fill the display window. Plain R, G, B and `beauty` are converted to Rec. 709; other layers may hold what is no
//! colour, and stay as they are.

use std::collections::BTreeMap;
use std::io::{Read as ReadBytes, Seek};
use std::path::Path;

use exr::meta::attribute::{AttributeValue, ChannelDescription, SampleType, Text};
use exr::meta::header::Header;
use glam::{DMat3, Vec3};
use half::f16;

use super::error::ImageError;
use super::exr_file::ExrFile;
use super::exr_layers::{PLAIN, layers_of, no_color, rec_709_from_rgb};
use super::exr_window::Window;
use super::layered::{BEAUTY, LayeredImage, STATE, TEXTS};
use super::picture::Picture;

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
        read_part_layer(path, file, part, channels)
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
        let size = Window::of(&file.headers()[part]).size;
        let to_rec_709 = rec_709_from_rgb(path, &file.headers()[part])?;
        let mut image = LayeredImage::new(size.width() as u32, size.height() as u32);
        image.texts = texts_of(&file.headers()[part]);
        let words = words_of(&file.headers()[part]);
        let (layers, words) = read_layers(file, part, wanted, words)?;
        for mut layer in layers {
            let name = if layer.name == PLAIN { BEAUTY } else { &layer.name };
            if name == BEAUTY {
                convert(&mut layer.pixels, to_rec_709);
            }
            image.push(name, layer.pixels);
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
    let size = Window::of(&file.headers()[part]).size;
    let named = |name: String| if name == PLAIN { BEAUTY.to_owned() } else { name };
    Ok((size.width() as u32, size.height() as u32, layers.into_keys().map(named).collect()))
}

/// One layer of a part as a picture in Rec. 709.
pub(super) fn read_part_layer<R: ReadBytes + Seek>(
    path: &Path,
    file: ExrFile<'_, R>,
    part: usize,
    channels: [usize; 3],
) -> Result<Picture, ImageError> {
    let size = Window::of(&file.headers()[part]).size;
    let to_rec_709 = rec_709_from_rgb(path, &file.headers()[part])?;
    let (layers, _) = read_layers(file, part, BTreeMap::from([(PLAIN.to_owned(), channels)]), BTreeMap::new())?;
    let mut pixels: Vec<Vec3> = layers.into_iter().flat_map(|layer| layer.pixels).collect();
    convert(&mut pixels, to_rec_709);
    Ok(Picture::from_pixels(size.width() as u32, size.height() as u32, pixels))
}

/// Multiplies by a matrix, except by the identity, which keeps the bits.
fn convert(pixels: &mut [Vec3], matrix: DMat3) {
    if matrix != DMat3::IDENTITY {
        pixels.iter_mut().for_each(|pixel| *pixel = (matrix * pixel.as_dvec3()).as_vec3());
    }
}

/// Index of the first part that has colour, and its layers as [`layers_of`] gives them.
fn colored_part<R: ReadBytes + Seek>(
    path: &Path,
    file: &ExrFile<'_, R>,
) -> Result<(usize, BTreeMap<String, [usize; 3]>), ImageError> {
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

fn read_layers<R: ReadBytes + Seek>(
    file: ExrFile<'_, R>,
    part: usize,
    wanted: BTreeMap<String, [usize; 3]>,
    wanted_words: BTreeMap<String, usize>,
) -> Result<Read, ImageError> {
    let header = &file.headers()[part];
    let (window, channels) = (Window::of(header), header.channels.clone());
    let area = window.size.area();
    let blank = |(name, channels)| Layer { name, channels, pixels: vec![Vec3::ZERO; area] };
    let mut layers: Vec<Layer> = wanted.into_iter().map(blank).collect();
    let mut words: Vec<Vec<u32>> = wanted_words.values().map(|_| vec![0; area]).collect();
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
            let (x, y) = (place.position.x(), place.position.y());
            let Some((row, cut)) = window.place(x, y, place.sample_count) else { continue };
            match targets[place.channel] {
                None => {}
                Some(Target::Layer { index, component }) => {
                    let sample_type = channels.list[place.channel].sample_type;
                    let samples = &line.value[cut * sample_type.bytes_per_sample()..];
                    read_line(samples, sample_type, &mut layers[index].pixels[row], component);
                }
                Some(Target::Words { index }) => {
                    let samples = &line.value.as_chunks::<4>().0[cut..];
                    words[index][row].iter_mut().zip(samples).for_each(|(word, &s)| *word = u32::from_ne_bytes(s));
                }
            }
        }
    })?;
    for layer in layers.iter_mut().filter(|layer| layer.channels == [layer.channels[0]; 3]) {
        // The one channel of a grey layer went into the component that named it last.
        layer.pixels.iter_mut().for_each(|pixel| *pixel = Vec3::splat(pixel.z));
    }
    Ok((layers, wanted_words.into_keys().zip(words).collect()))
}

/// The destination of a channel's samples.
#[derive(Debug, Clone, Copy)]
enum Target {
    Layer { index: usize, component: usize },
    Words { index: usize },
}

/// Copies one channel of a line into a row of pixels, which may be shorter. The decoder guarantees that decompressed lines
/// have the machine's byte order and their full length.
fn read_line(samples: &[u8], sample_type: SampleType, row: &mut [Vec3], component: usize) {
    fn fill<const N: usize>(bytes: &[u8], row: &mut [Vec3], component: usize, value: impl Fn([u8; N]) -> f32) {
        for (pixel, &sample) in row.iter_mut().zip(bytes.as_chunks::<N>().0) {
            pixel[component] = value(sample);
        }
    }
    match sample_type {
        SampleType::F16 => fill(samples, row, component, |bytes| f16::from_ne_bytes(bytes).to_f32()),
        SampleType::F32 => fill(samples, row, component, f32::from_ne_bytes),
        SampleType::U32 => fill(samples, row, component, |bytes| u32::from_ne_bytes(bytes) as f32),
    }
}
