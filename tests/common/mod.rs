//! glTF files built in code: a JSON document and its buffer, saved as `.gltf` with a data URI or as `.glb`.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use base64::Engine as _;
use serde_json::{Value, json};
use tempfile::TempDir;

pub const F32: u32 = 5126;
pub const U32: u32 = 5125;
pub const U16: u32 = 5123;
pub const I16: u32 = 5122;
pub const U8: u32 = 5121;
pub const I8: u32 = 5120;

/// A glTF document under construction.
pub struct Gltf {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Gltf {
    /// An empty document with one scene.
    pub fn new() -> Gltf {
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [], "materials": []
        });
        Gltf { json, bin: Vec::new() }
    }

    /// One triangle mesh of these positions, not indexed, on one node.
    pub fn of_triangles(positions: &[[f32; 3]]) -> Gltf {
        let mut gltf = Gltf::new();
        let positions = gltf.vec3(positions);
        let mesh = gltf.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions } }] }));
        gltf.root(json!({ "mesh": mesh }));
        gltf
    }

    /// Appends to a top-level list; its index.
    pub fn push(&mut self, list: &str, element: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().expect("a list");
        list.push(element);
        list.len() - 1
    }

    /// A node at the root of the scene.
    pub fn root(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(index));
        index
    }

    /// A buffer view of these bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// An accessor over its own buffer view.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }))
    }

    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, F32, kind, values.len() / components)
    }

    pub fn vec3(&mut self, values: &[[f32; 3]]) -> usize {
        self.floats(values.as_flattened(), "VEC3")
    }

    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, U16, "SCALAR", values.len())
    }

    /// The document as `.gltf` text with its buffer as a data URI.
    pub fn text(&self) -> String {
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        let uri = format!("data:application/octet-stream;base64,{data}");
        json["buffers"] = json!([{ "byteLength": self.bin.len(), "uri": uri }]);
        json.to_string()
    }

    /// The document as a binary container.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
        for (kind, data) in [(b"JSON", &text), (b"BIN\0", &bin)] {
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(data);
        }
        out
    }
}

/// A folder that lives as long as the test, with files written into it.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("a file in a temporary folder");
        path
    }
}
