//! Textures of materials. An image is decoded once as colours and once as data, if it is used as both.

use std::collections::HashMap;
use std::path::Path;

use gltf::json::texture::{MagFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Image, Index, Texture as Definition};

use super::buffers::Buffers;
use super::document::Document;
use super::extensions::{COMPRESSED_IMAGES, remedy};
use super::image::{Budget, Decoded, Failure};
use super::inputs::{Inputs, Resource, resolve};
use super::text::{label, sentence};
use crate::scene::error::{RE_EXPORT, SceneError};
use crate::scene::material::{Texels, Texture, TextureIndex, Wrap};

/// The textures loaded so far. Images that no material uses are never read.
pub(super) struct Textures<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    inputs: &'a mut Inputs,
    collapse_constant: bool,
    budget: Budget,
    /// Contents of image files by image index. A file is read once even if it is decoded twice.
    files: HashMap<usize, Vec<u8>>,
    /// Whether what is loaded now is for pictures alone: it stays out of the scene's hash.
    pub for_pictures: bool,
    loaded: HashMap<Key, TextureIndex>,
    pub textures: Vec<Texture>,
    /// Least alpha of each texture.
    pub least_alpha: Vec<f32>,
    /// Whether all texels of a texture are equal.
    pub constant: Vec<bool>,
    /// Memory that these do not take, as one texel stands for all, bytes.
    pub collapsed_bytes: u64,
}

/// Uses of an image that are equal in these four share one texture.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    image: usize,
    wrap: [Wrap; 2],
    nearest: bool,
    srgb: bool,
}

impl<'a> Textures<'a> {
    pub fn new(
        document: &'a Document,
        buffers: &'a Buffers<'a>,
        inputs: &'a mut Inputs,
        collapse_constant: bool,
    ) -> Self {
        Textures {
            document,
            buffers,
            inputs,
            collapse_constant,
            budget: Budget::new(),
            files: HashMap::new(),
            for_pictures: false,
            loaded: HashMap::new(),
            textures: Vec::new(),
            least_alpha: Vec::new(),
            constant: Vec::new(),
            collapsed_bytes: 0,
        }
    }

    /// Loads a texture as colours (`srgb`) or as data. `place` names the material slot in messages.
    pub fn load(&mut self, texture: Index<Definition>, srgb: bool, place: &str) -> Result<TextureIndex, SceneError> {
        let definition = self.document.parse_at(&self.document.textures, "texture", texture, &place)?;
        let place = format!("{place}: {}", label("texture", texture.value(), definition.name.as_deref()));
        let image = self.image_of(&definition, &place)?;
        let (wrap, nearest) = self.sampling(&definition, &place)?;
        let key = Key { image: image.value(), wrap, nearest, srgb };
        if let Some(index) = self.loaded.get(&key) {
            return Ok(*index);
        }
        let Decoded { mut width, mut height, mut texels } = self.decode(image, srgb, &place)?;
        let is_constant = is_constant(&texels);
        if self.collapse_constant && is_constant {
            let bytes = match &mut texels {
                Texels::Rgba8 { data, .. } => {
                    data.truncate(1);
                    data.shrink_to_fit();
                    4
                }
                Texels::Rgba32F(data) => {
                    data.truncate(1);
                    data.shrink_to_fit();
                    16
                }
            };
            let all = u64::from(width) * u64::from(height);
            self.budget.release(all, bytes);
            self.collapsed_bytes += (all - 1) * bytes;
            (width, height) = (1, 1);
        }
        let index = TextureIndex(self.textures.len() as u32);
        self.constant.push(is_constant);
        self.least_alpha.push(least_alpha(&texels));
        self.textures.push(Texture { width, height, wrap, nearest, texels });
        self.loaded.insert(key, index);
        Ok(index)
    }

    /// The texture's PNG or JPEG image. Images that extensions offer beside it are not used.
    fn image_of(&self, definition: &Definition, place: &str) -> Result<Index<Image>, SceneError> {
        // u32::MAX is the index that gltf::json gives to a missing source.
        if definition.source.value() != u32::MAX as usize {
            return Ok(definition.source);
        }
        let others = definition.extensions.as_ref().map(|e| &e.others);
        let found = COMPRESSED_IMAGES.iter().find(|&&e| others.is_some_and(|others| others.contains_key(e)));
        Err(match found {
            Some(extension) => self.unsupported(place, extension),
            None => self.document.invalid(place, "it has no source image", RE_EXPORT),
        })
    }

    fn unsupported(&self, place: &str, extension: &'static str) -> SceneError {
        SceneError::Unsupported {
            file: self.document.file.clone(),
            place: place.to_owned(),
            extension: extension.to_owned(),
            remedy: remedy(extension),
        }
    }

    fn sampling(&self, definition: &Definition, place: &str) -> Result<([Wrap; 2], bool), SceneError> {
        let sampler = match definition.sampler {
            Some(index) => self.document.parse_at(&self.document.samplers, "sampler", index, &place)?,
            None => Sampler::default(),
        };
        let wrap = |mode: &Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
            Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::MirroredRepeat),
            Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::ClampToEdge),
            Checked::Invalid => {
                Err(self.document.invalid(place, "glTF does not define its sampler's wrap mode", RE_EXPORT))
            }
        };
        let nearest = sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest));
        Ok(([wrap(&sampler.wrap_s)?, wrap(&sampler.wrap_t)?], nearest))
    }

    fn decode(&mut self, index: Index<Image>, srgb: bool, place: &str) -> Result<Decoded, SceneError> {
        const REMEDY: &str = "give a PNG or JPEG image";
        let document = self.document;
        let image = document.parse_at(&document.images, "image", index, &place)?;
        let uri = image.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let name = image.name.as_deref().or(uri);
        let place = format!("{place}: {}", label("image", index.value(), name));
        let inline;
        let bytes: &[u8] = match (&image.uri, image.buffer_view) {
            (_, Some(view)) => self.buffers.view(document, view, &place)?.0,
            (None, None) => return Err(document.invalid(place, "it has neither a uri nor a buffer view", RE_EXPORT)),
            (Some(uri), None) => match resolve(uri, document.file.parent().unwrap_or(Path::new(""))) {
                Ok(Resource::Data(bytes)) => {
                    inline = bytes;
                    &inline
                }
                Ok(Resource::File(path)) => {
                    if !self.files.contains_key(&index.value()) {
                        let read = if self.for_pictures { Inputs::read_for_pictures } else { Inputs::read };
                        let bytes = read(self.inputs, &path).map_err(|cause| SceneError::Read {
                            file: document.file.clone(),
                            place: format!("{place} ({})", path.display()),
                            cause,
                            remedy: "put the image beside the scene or export a single .glb",
                        })?;
                        self.files.insert(index.value(), bytes);
                    }
                    &self.files[&index.value()]
                }
                Err(what) => return Err(document.invalid(place, what, REMEDY)),
            },
        };
        let file = document.file.clone();
        self.budget.decode(bytes, srgb).map_err(|failure| match failure {
            Failure::Extension(extension) => self.unsupported(&place, extension),
            Failure::Broken(what) => SceneError::Image { file, place, what: sentence(&what), remedy: REMEDY },
            Failure::TooLarge(what) => SceneError::TooLarge { file, place, what, remedy: "give smaller images" },
        })
    }
}

fn is_constant(texels: &Texels) -> bool {
    match texels {
        Texels::Rgba8 { data, .. } => data.iter().all(|t| *t == data[0]),
        Texels::Rgba32F(data) => data.iter().all(|t| *t == data[0]),
    }
}

fn least_alpha(texels: &Texels) -> f32 {
    match texels {
        Texels::Rgba8 { data, .. } => data.iter().map(|t| t[3]).min().map_or(1.0, |a| f32::from(a) / 255.0),
        Texels::Rgba32F(data) => data.iter().map(|t| t.w).fold(1.0, f32::min),
    }
}
