//! A picture in several layers: beauty, irradiance, albedo, depth and so on.

use std::collections::BTreeMap;

use glam::Vec3;

use super::picture::Picture;

/// Name of the layer that viewers without support for layers show.
pub(super) const BEAUTY: &str = "beauty";

/// Prefix of the channel names of words.
pub(super) const STATE: &str = "state.";

/// Name of the attribute that holds the texts, as JSON.
pub(super) const TEXTS: &str = "lightprobe";

/// Layers of one size, in the order in which they were added. Each is linear RGB with row 0 at the top.
///
/// On disk this is one EXR part. A layer has the channels `layer.R`, `layer.G`, `layer.B`; the layer `beauty` is also
/// stored as plain `R`, `G`, `B`. Words have the channel `state.name`. All texts share one attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct LayeredImage {
    pub width: u32,
    pub height: u32,
    /// Metadata of the picture, by name.
    pub texts: BTreeMap<String, String>,
    layers: Vec<(String, Vec<Vec3>)>,
    /// See [`LayeredImage::push_words`].
    words: BTreeMap<String, Vec<u32>>,
}

impl LayeredImage {
    pub fn new(width: u32, height: u32) -> LayeredImage {
        LayeredImage { width, height, texts: BTreeMap::new(), layers: Vec::new(), words: BTreeMap::new() }
    }

    /// Adds a layer of colours. A layer of the same name is replaced and keeps its position.
    ///
    /// # Panics
    /// If the number of `pixels` is not `width · height`.
    pub fn push(&mut self, name: &str, pixels: Vec<Vec3>) {
        assert_eq!(pixels.len(), self.width as usize * self.height as usize, "pixels of the layer {name}");
        match self.layers.iter_mut().find(|(existing, _)| existing == name) {
            Some((_, replaced)) => *replaced = pixels,
            None => self.layers.push((name.to_owned(), pixels)),
        }
    }

    /// Adds a layer of single values, such as depth in metres. R, G and B are equal. Undone by
    /// [`LayeredImage::scalar`].
    ///
    /// # Panics
    /// If the number of `values` is not `width · height`.
    pub fn push_scalar(&mut self, name: &str, values: &[f32]) {
        self.push(name, values.iter().map(|&value| Vec3::splat(value)).collect());
    }

    /// Adds one 32-bit word per pixel. Words are data for a later run that continues this one, not colours.
    ///
    /// # Panics
    /// If the number of `words` is not `width · height`.
    pub fn push_words(&mut self, name: &str, words: Vec<u32>) {
        assert_eq!(words.len(), self.width as usize * self.height as usize, "words of {name}");
        self.words.insert(name.to_owned(), words);
    }

    /// The words that [`LayeredImage::push_words`] stored under this name.
    pub fn words(&self, name: &str) -> Option<&[u32]> {
        self.words.get(name).map(Vec::as_slice)
    }

    /// All words, sorted by name.
    pub(super) fn all_words(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.words
    }

    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// The layers' names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layers.iter().map(|(name, _)| name.as_str())
    }

    /// The layers, in order.
    pub fn layers(&self) -> impl Iterator<Item = (&str, &[Vec3])> {
        self.layers.iter().map(|(name, pixels)| (name.as_str(), pixels.as_slice()))
    }

    /// One layer's pixels, row 0 at the top.
    pub fn layer(&self, name: &str) -> Option<&[Vec3]> {
        self.layers.iter().find(|(existing, _)| existing == name).map(|(_, pixels)| pixels.as_slice())
    }

    /// The first channel of a layer: the values that [`LayeredImage::push_scalar`] stored.
    pub fn scalar(&self, name: &str) -> Option<Vec<f32>> {
        self.layer(name).map(|pixels| pixels.iter().map(|pixel| pixel.x).collect())
    }

    /// A copy of one layer as a picture.
    pub fn picture(&self, name: &str) -> Option<Picture> {
        self.layer(name).map(|pixels| Picture::from_pixels(self.width, self.height, pixels.to_vec()))
    }

    /// The layer that is also written as plain R, G, B: `beauty`, or the first layer if there is no `beauty`.
    pub(super) fn plain_layer(&self) -> Option<&[Vec3]> {
        self.layer(BEAUTY).or_else(|| self.layers.first().map(|(_, pixels)| pixels.as_slice()))
    }
}
