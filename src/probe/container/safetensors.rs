//! Safetensors files with hashes: read with the crate, written here.
//!
//! The crate's own writer orders metadata by a random hash, makes files private and does not sync; this one sorts keys,
//! so that the same content gives the same bytes, and goes through [`crate::system::output`].
//!
//! Layout: header length (u64), header (JSON, padded with spaces to 8 bytes), tensors without gaps. The metadata key
//! `blake3` maps every tensor to the hash of its bytes, and `__header__` to that of the header as compact JSON with
//! sorted keys and without the `blake3` key itself.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};

use crate::system::input::read_file;
use crate::system::output::{OutputError, write_atomically};

const METADATA_KEY: &str = "__metadata__";
const HASH_KEY: &str = "blake3";
const HEADER_HASH_KEY: &str = "__header__";

/// Why a probe file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error("cannot read {path}: {cause}; give the path of a file that `lightprobe bake` wrote")]
    Unreadable { path: PathBuf, cause: io::Error },
    #[error("{path} is damaged or no probe file: {what}; bake it again")]
    Damaged { path: PathBuf, what: String },
    #[error(
        "{path} has the format {found:?}, this program reads {expected:?}; use the program that wrote it, or bake again"
    )]
    Version { path: PathBuf, found: String, expected: &'static str },
    #[error("{path} cannot be resumed from: {what}; delete it or leave --resume out")]
    NoCheckpoint { path: PathBuf, what: String },
    #[error(
        "{path} is from a bake of another scene, configuration or seed; resume with the same arguments, or delete it or leave --resume out"
    )]
    OtherBake { path: PathBuf },
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A tensor of little-endian numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    pub dtype: Dtype,
    pub shape: Vec<usize>,
    pub bytes: Vec<u8>,
}

/// Tensors and metadata of one file, by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Container {
    pub metadata: BTreeMap<String, String>,
    pub tensors: BTreeMap<String, Tensor>,
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

impl Container {
    /// Header without the hashes, its keys sorted (`serde_json`'s maps are).
    fn header(&self) -> Map<String, Value> {
        let mut header = Map::new();
        header.insert(METADATA_KEY.to_owned(), json!(self.metadata));
        let mut offset = 0;
        for (name, tensor) in self.in_file_order() {
            let end = offset + tensor.bytes.len();
            let entry = json!({
                "dtype": tensor.dtype.to_string(), "shape": tensor.shape, "data_offsets": [offset, end],
            });
            header.insert(name.clone(), entry);
            offset = end;
        }
        header
    }

    /// Widest numbers first, so that every tensor is aligned to its numbers; then by name.
    fn in_file_order(&self) -> Vec<(&String, &Tensor)> {
        let mut tensors: Vec<_> = self.tensors.iter().collect();
        tensors.sort_by_key(|(name, t)| (std::cmp::Reverse(t.dtype.bitsize()), *name));
        tensors
    }

    /// Writes the file; readers see the old one or the whole new one.
    pub fn write(&self, path: &Path) -> Result<u64, FileError> {
        let header = self.header_text();
        write_atomically(path, |file| self.write_to(&header, file))?;
        Ok(self.bytes_with(&header))
    }

    /// The same bytes in memory.
    pub fn to_bytes(&self) -> Vec<u8> {
        let header = self.header_text();
        let mut bytes = Vec::with_capacity(self.bytes_with(&header) as usize);
        // Memory takes all that is written.
        let _ = self.write_to(&header, &mut bytes);
        bytes
    }

    fn write_to(&self, header: &str, to: &mut impl Write) -> io::Result<()> {
        to.write_all(&(header.len() as u64).to_le_bytes())?;
        to.write_all(header.as_bytes())?;
        self.in_file_order().into_iter().try_for_each(|(_, tensor)| to.write_all(&tensor.bytes))
    }

    /// Size of the file that [`Self::write`] makes.
    pub fn file_bytes(&self) -> u64 {
        self.bytes_with(&self.header_text())
    }

    fn bytes_with(&self, header: &str) -> u64 {
        let data: usize = self.tensors.values().map(|t| t.bytes.len()).sum();
        (8 + header.len() + data) as u64
    }

    /// The header with all hashes.
    fn header_text(&self) -> String {
        let mut header = self.header();
        let mut hashes: BTreeMap<String, String> =
            self.tensors.iter().map(|(name, t)| (name.clone(), hash(&t.bytes))).collect();
        hashes.insert(HEADER_HASH_KEY.to_owned(), hash(Value::Object(header.clone()).to_string().as_bytes()));
        if let Some(Value::Object(metadata)) = header.get_mut(METADATA_KEY) {
            metadata.insert(HASH_KEY.to_owned(), Value::String(json!(hashes).to_string()));
        }
        let mut header = Value::Object(header).to_string();
        header.extend(std::iter::repeat_n(' ', header.len().next_multiple_of(8) - header.len()));
        header
    }

    /// Reads a file and checks every hash. Allocates about twice the file's size, whatever its header says.
    pub fn read(path: &Path) -> Result<Container, FileError> {
        let bytes = read_file(path).map_err(|cause| FileError::Unreadable { path: path.to_owned(), cause })?;
        Container::of_bytes(&bytes).map_err(|what| FileError::Damaged { path: path.to_owned(), what })
    }

    /// The content of a file in memory; else what is wrong with it.
    ///
    /// # Errors
    /// No safetensors, or another hash.
    pub fn of_bytes(bytes: &[u8]) -> Result<Container, String> {
        let parsed = SafeTensors::deserialize(bytes).map_err(|e| format!("not safetensors ({e})"))?;
        let (header_length, metadata) =
            SafeTensors::read_metadata(bytes).map_err(|e| format!("not safetensors ({e})"))?;
        let mut container = Container::default();
        if let Some(metadata) = metadata.metadata() {
            container.metadata = metadata.clone().into_iter().collect();
        }
        for (name, view) in parsed.iter() {
            let tensor = Tensor { dtype: view.dtype(), shape: view.shape().to_vec(), bytes: view.data().to_vec() };
            container.tensors.insert(name.to_owned(), tensor);
        }
        let header: Value =
            serde_json::from_slice(&bytes[8..8 + header_length]).map_err(|e| format!("its header is no JSON ({e})"))?;
        container.check_hashes(header)?;
        Ok(container)
    }

    fn check_hashes(&mut self, mut header: Value) -> Result<(), String> {
        let recorded = self.metadata.remove(HASH_KEY).ok_or("it carries no hashes")?;
        let recorded: BTreeMap<String, String> =
            serde_json::from_str(&recorded).map_err(|e| format!("its hashes are no JSON ({e})"))?;
        if let Some(Value::Object(metadata)) = header.get_mut(METADATA_KEY) {
            metadata.remove(HASH_KEY);
        }
        let header_hash = hash(header.to_string().as_bytes());
        if recorded.get(HEADER_HASH_KEY) != Some(&header_hash) {
            return Err("its header does not match its hash".to_owned());
        }
        for (name, tensor) in &self.tensors {
            if recorded.get(name) != Some(&hash(&tensor.bytes)) {
                return Err(format!("tensor '{name}' does not match its hash"));
            }
        }
        Ok(())
    }
}
