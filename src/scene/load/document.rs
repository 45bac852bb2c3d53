//! The glTF JSON, parsed element by element, so that an error message can name the faulty element.
//!
//! The types come from the `gltf` crate. Its validation is not used: it panics on a POSITION accessor that does not
//! exist, and it refuses files that only lack `min`/`max`. Its readers are not used either, because they trust the
//! counts in the file. Instead every index is checked when it is followed.
//!
//! Elements that many commands never look at are parsed only when something refers to them ([`Unparsed`]), so that a
//! fault in a material, texture or camera that nobody uses stops nothing.

use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use gltf::json::extensions::scene::khr_lights_punctual::Light;
use gltf::json::{
    Accessor, Buffer, Camera, Image, Index, Material, Mesh, Node, Skin, Texture, buffer::View, texture::Sampler,
};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::extensions;
use super::text::sentence;
use crate::scene::error::{RE_EXPORT, SceneError};

/// Most elements of a JSON list. Real scenes stay far below. The limit is needed because a list of `{}` takes a hundred
/// times its size when it is parsed into typed elements.
const MAX_ELEMENTS: usize = 1 << 20;

pub(super) struct Document {
    /// The scene file, for messages.
    pub file: PathBuf,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub accessors: Vec<Accessor>,
    pub views: Vec<View>,
    pub buffers: Vec<Buffer>,
    pub materials: Unparsed<Material>,
    pub textures: Unparsed<Texture>,
    pub images: Unparsed<Image>,
    pub samplers: Unparsed<Sampler>,
    pub cameras: Unparsed<Camera>,
    pub skins: Unparsed<Skin>,
    pub lights: Vec<Light>,
    /// Root nodes of each scene.
    pub scenes: Vec<Vec<usize>>,
    pub default_scene: Option<usize>,
}

/// A list of elements that are parsed one by one, when they are asked for.
pub(super) struct Unparsed<T> {
    /// Its key in the document.
    key: &'static str,
    elements: Vec<Value>,
    parsed: PhantomData<T>,
}

impl Document {
    /// Parses the JSON. Refuses versions and required extensions that the loader does not read.
    pub fn parse(file: &Path, json: &[u8], warnings: &mut Vec<String>) -> Result<Document, SceneError> {
        let format = |what: String, remedy| SceneError::Format { file: file.to_owned(), what, remedy };
        let root: Value = serde_json::from_slice(json)
            .map_err(|e| format(format!("its JSON does not parse: {e}"), "give a .gltf or .glb file"))?;
        let Value::Object(mut root) = root else {
            return Err(format("its JSON is not an object".to_owned(), "give a .gltf or .glb file"));
        };
        let version = root.get("asset").and_then(|asset| asset.get("version")).and_then(Value::as_str);
        match version {
            Some(version) if version.starts_with("2.") => {}
            Some(version) => {
                let version = version.escape_debug();
                return Err(format(
                    format!("asset.version is '{version}', but only 2.x is read"),
                    "convert it with `gltf-pipeline -i IN.gltf -o OUT.glb`",
                ));
            }
            None => return Err(format("asset.version is missing".to_owned(), RE_EXPORT)),
        }
        extensions::check_required(file, &root, warnings)?;

        let mut sections = Sections { file, root: &mut root };
        let scenes = sections.take::<SceneRoots>("scenes")?;
        Ok(Document {
            file: file.to_owned(),
            nodes: sections.take("nodes")?,
            meshes: sections.take("meshes")?,
            accessors: sections.take("accessors")?,
            views: sections.take("bufferViews")?,
            buffers: sections.take("buffers")?,
            materials: sections.unparsed("materials")?,
            textures: sections.unparsed("textures")?,
            images: sections.unparsed("images")?,
            samplers: sections.unparsed("samplers")?,
            cameras: sections.unparsed("cameras")?,
            skins: sections.unparsed("skins")?,
            lights: sections.take_lights()?,
            scenes: scenes.into_iter().map(|s| s.nodes.into_iter().map(|n| n as usize).collect()).collect(),
            default_scene: sections.default_scene()?,
        })
    }

    /// The error for the fault `what` at `place`.
    pub fn invalid(&self, place: impl Into<String>, what: impl Into<String>, remedy: &'static str) -> SceneError {
        SceneError::Invalid { file: self.file.clone(), place: place.into(), what: what.into(), remedy }
    }

    /// The element `index` of `list`, to which `place` refers. The error says that it does not exist.
    pub fn get<'a, T>(
        &self,
        list: &'a [T],
        kind: &str,
        index: Index<T>,
        place: &dyn std::fmt::Display,
    ) -> Result<&'a T, SceneError> {
        list.get(index.value()).ok_or_else(|| self.missing(kind, index.value(), list.len(), place))
    }

    /// The JSON of the element `index` of `list`, to which `place` refers. The error says that it does not exist.
    pub fn json<'l, T>(
        &self,
        list: &'l Unparsed<T>,
        kind: &str,
        index: usize,
        place: &dyn std::fmt::Display,
    ) -> Result<&'l Value, SceneError> {
        list.elements.get(index).ok_or_else(|| self.missing(kind, index, list.elements.len(), place))
    }

    /// The element `index` of `list`, to which `place` refers. The error says that it does not exist, or which of its
    /// JSON is wrong.
    pub fn parse_at<T: DeserializeOwned>(
        &self,
        list: &Unparsed<T>,
        kind: &str,
        index: Index<T>,
        place: &dyn std::fmt::Display,
    ) -> Result<T, SceneError> {
        let value = self.json(list, kind, index.value(), place)?;
        self.parse_element(list, index.value(), value)
    }

    /// Parses `value` as the element `index` of `list`.
    pub fn parse_element<T: DeserializeOwned>(
        &self,
        list: &Unparsed<T>,
        index: usize,
        value: &Value,
    ) -> Result<T, SceneError> {
        T::deserialize(value).map_err(|e| self.invalid(format!("{}[{index}]", list.key), one_line(&e), RE_EXPORT))
    }

    fn missing(&self, kind: &str, index: usize, count: usize, place: &dyn std::fmt::Display) -> SceneError {
        self.invalid(place.to_string(), format!("refers to {kind} {index}, but the file has {count}"), RE_EXPORT)
    }
}

#[derive(serde::Deserialize)]
struct SceneRoots {
    /// Some exporters omit this list. The type in `gltf::json` requires it, so it is not used.
    #[serde(default)]
    nodes: Vec<u32>,
}

/// The root object, from which the lists are taken one after the other.
struct Sections<'a> {
    file: &'a Path,
    root: &'a mut Map<String, Value>,
}

impl Sections<'_> {
    fn take<T: DeserializeOwned>(&mut self, key: &str) -> Result<Vec<T>, SceneError> {
        match self.root.remove(key) {
            None => Ok(Vec::new()),
            Some(value) => self.elements(key, value),
        }
    }

    fn take_lights(&mut self) -> Result<Vec<Light>, SceneError> {
        const PLACE: &str = "extensions.KHR_lights_punctual.lights";
        let lights = self.root.get_mut("extensions").and_then(|e| e.get_mut("KHR_lights_punctual"));
        match lights.and_then(|l| l.get_mut("lights")).map(Value::take) {
            None => Ok(Vec::new()),
            Some(value) => self.elements(PLACE, value),
        }
    }

    fn default_scene(&self) -> Result<Option<usize>, SceneError> {
        match self.root.get("scene") {
            None => Ok(None),
            Some(value) => match value.as_u64().and_then(|index| usize::try_from(index).ok()) {
                Some(index) => Ok(Some(index)),
                None => Err(self.invalid("scene".to_owned(), "is not an index".to_owned())),
            },
        }
    }

    fn unparsed<T>(&mut self, key: &'static str) -> Result<Unparsed<T>, SceneError> {
        let elements = match self.root.remove(key) {
            None => Vec::new(),
            Some(value) => self.list(key, value)?,
        };
        Ok(Unparsed { key, elements, parsed: PhantomData })
    }

    fn elements<T: DeserializeOwned>(&self, key: &str, value: Value) -> Result<Vec<T>, SceneError> {
        let parse = |(index, value)| {
            serde_json::from_value(value).map_err(|e| self.invalid(format!("{key}[{index}]"), one_line(&e)))
        };
        self.list(key, value)?.into_iter().enumerate().map(parse).collect()
    }

    fn list(&self, key: &str, value: Value) -> Result<Vec<Value>, SceneError> {
        let Value::Array(list) = value else {
            return Err(self.invalid(key.to_owned(), "is not a list".to_owned()));
        };
        if list.len() > MAX_ELEMENTS {
            return Err(SceneError::TooLarge {
                file: self.file.to_owned(),
                place: key.to_owned(),
                what: format!("{} elements, more than the {MAX_ELEMENTS} that are read", list.len()),
                remedy: "merge or instance them",
            });
        }
        Ok(list)
    }

    fn invalid(&self, place: String, what: String) -> SceneError {
        SceneError::Invalid { file: self.file.to_owned(), place, what, remedy: RE_EXPORT }
    }
}

fn one_line(error: &serde_json::Error) -> String {
    sentence(&error.to_string()).replace("\\\"", "\"").replace("\\'", "'")
}
