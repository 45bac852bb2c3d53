//! The bytes of buffers and buffer views.

use std::borrow::Cow;
use std::path::Path;

use gltf::json::{Buffer, Index, buffer::View};

use super::document::Document;
use super::extensions::{COMPRESSED_GEOMETRY, remedy};
use super::inputs::{Inputs, Resource, resolve};
use super::text::label;
use crate::scene::error::{RE_EXPORT, SceneError};

/// The content of all buffers of the file.
pub(super) struct Buffers<'a> {
    /// One entry per buffer. `None` for placeholders of compressed geometry, which have no content.
    contents: Vec<Option<Cow<'a, [u8]>>>,
    /// Bytes of all inputs together. It bounds the number of elements of any list.
    pub input_bytes: u64,
}

impl<'a> Buffers<'a> {
    /// Reads all buffers. `bin` is the binary chunk of the GLB file.
    pub fn load(document: &Document, bin: Option<&'a [u8]>, inputs: &mut Inputs) -> Result<Buffers<'a>, SceneError> {
        let folder = document.file.parent().unwrap_or(Path::new(""));
        let mut contents = Vec::with_capacity(document.buffers.len());
        for (index, buffer) in document.buffers.iter().enumerate() {
            let content = match &buffer.uri {
                Some(uri) => Some(Cow::Owned(external(document, index, buffer, uri, folder, inputs)?)),
                None if index == 0 => bin.map(Cow::Borrowed),
                None => None,
            };
            contents.push(content);
        }
        Ok(Buffers { contents, input_bytes: inputs.bytes })
    }

    /// The bytes of a buffer view and its `byteStride`.
    pub fn view(
        &self,
        document: &Document,
        index: Index<View>,
        place: &dyn std::fmt::Display,
    ) -> Result<(&[u8], Option<usize>), SceneError> {
        let view = document.get(&document.views, "buffer view", index, place)?;
        let buffer = document.get(&document.buffers, "buffer", view.buffer, &format_args!("{place}: view {index}"))?;
        let Some(content) = self.contents.get(view.buffer.value()).and_then(Option::as_deref) else {
            let compression = COMPRESSED_GEOMETRY.iter().find(|&&extension| {
                view.extensions.as_ref().is_some_and(|e| e.others.contains_key(extension))
                    || buffer.extensions.as_ref().is_some_and(|e| e.others.contains_key(extension))
            });
            return Err(match compression {
                Some(extension) => SceneError::Unsupported {
                    file: document.file.clone(),
                    place: place.to_string(),
                    extension: (*extension).to_owned(),
                    remedy: remedy(extension),
                },
                None => document.invalid(
                    place.to_string(),
                    format!("buffer {} has neither a uri nor a binary chunk", view.buffer),
                    RE_EXPORT,
                ),
            });
        };
        // Bytes beyond the buffer's byteLength are padding and do not count.
        let available = (content.len() as u64).min(buffer.byte_length.0);
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        match start.checked_add(view.byte_length.0) {
            Some(end) if end <= available => {
                Ok((&content[start as usize..end as usize], view.byte_stride.map(|stride| stride.0)))
            }
            _ => Err(document.invalid(
                place.to_string(),
                format!(
                    "buffer view {index} spans {} bytes from {start}, but buffer {} has {available}",
                    view.byte_length.0, view.buffer
                ),
                "the buffer is cut off or the file damaged: export it again",
            )),
        }
    }
}

fn external(
    document: &Document,
    index: usize,
    buffer: &Buffer,
    uri: &str,
    folder: &Path,
    inputs: &mut Inputs,
) -> Result<Vec<u8>, SceneError> {
    let place = label("buffer", index, buffer.name.as_deref());
    match resolve(uri, folder) {
        Ok(Resource::Data(bytes)) => Ok(bytes),
        Ok(Resource::File(path)) => inputs.read(&path).map_err(|cause| SceneError::Read {
            file: document.file.clone(),
            place: format!("{place} ({})", path.display()),
            cause,
            remedy: "put the file beside the scene or export a single .glb",
        }),
        Err(what) => Err(document.invalid(place, what, "put the data beside the scene or export a single .glb")),
    }
}
