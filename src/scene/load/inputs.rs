//! Reading the files of a scene. All bytes that light depends on enter the scene's hash. Images that only pictures show,
//! as normal maps, have a hash of their own: a bake does not read them, and its hash must be that of a later render.

use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;

use crate::system::input::read_file;

/// The files read so far, and the hash over them in the order of reading.
pub(super) struct Inputs {
    hasher: blake3::Hasher,
    /// Of the files that only pictures show, if there are any.
    pictures: Option<blake3::Hasher>,
    /// Bytes of all files read. Counts in a damaged header are checked against it.
    pub bytes: u64,
    /// Paths of the files read.
    pub files: Vec<PathBuf>,
}

/// The target of a glTF `uri`.
pub(super) enum Resource {
    /// The content of a data URI. The hash contains it already as part of the scene file.
    Data(Vec<u8>),
    File(PathBuf),
}

impl Inputs {
    pub fn new() -> Self {
        Inputs { hasher: blake3::Hasher::new(), pictures: None, bytes: 0, files: Vec::new() }
    }

    /// Reads a regular file.
    pub fn read(&mut self, path: &Path) -> io::Result<Vec<u8>> {
        let bytes = read_file(path)?;
        self.add(&bytes);
        self.files.push(path.to_owned());
        Ok(bytes)
    }

    /// Reads a regular file that no light depends on.
    pub fn read_for_pictures(&mut self, path: &Path) -> io::Result<Vec<u8>> {
        let bytes = read_file(path)?;
        update(self.pictures.get_or_insert_default(), &bytes);
        self.bytes += bytes.len() as u64;
        self.files.push(path.to_owned());
        Ok(bytes)
    }

    /// Adds bytes to the hash.
    pub fn add(&mut self, bytes: &[u8]) {
        update(&mut self.hasher, bytes);
        self.bytes += bytes.len() as u64;
    }

    /// The BLAKE3 hash in hexadecimal.
    pub fn finish(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }

    /// The same of the files that only pictures show. `None` without such files.
    pub fn finish_pictures(&self) -> Option<String> {
        self.pictures.as_ref().map(|hasher| hasher.finalize().to_hex().to_string())
    }
}

/// Adds bytes with their length before them, so that inputs cut at another place give another hash.
fn update(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

/// Base64 that accepts missing padding and stray low bits. Exporters differ in both, and neither changes the data.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Resolves a glTF `uri` relative to the folder of the scene file. The error describes the fault of the URI.
pub(super) fn resolve(uri: &str, folder: &Path) -> Result<Resource, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let Some((kind, content)) = rest.split_once(',') else {
            return Err("its data URI has no comma".to_owned());
        };
        let plain: Cow<[u8]> = percent_decode_str(content).into();
        return match kind.ends_with(";base64") {
            true => {
                BASE64.decode(&plain).map(Resource::Data).map_err(|e| format!("its data URI is not valid base64 ({e})"))
            }
            false => Ok(Resource::Data(plain.into_owned())),
        };
    }
    if let Some((scheme, _)) = uri.split_once("://") {
        return Err(format!("its URI has the scheme '{}'; only relative paths are read", scheme.escape_debug()));
    }
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| "its URI is not UTF-8".to_owned())?;
    if decoded.is_empty() || decoded.contains('\0') {
        return Err("its URI is empty or malformed".to_owned());
    }
    // Some exporters do not percent-encode, so a '%' may be part of the file's name.
    let (encoded, decoded) = (folder.join(uri), folder.join(&*decoded));
    Ok(Resource::File(if !decoded.exists() && encoded.exists() { encoded } else { decoded }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(uri: &str) -> Option<Vec<u8>> {
        match resolve(uri, Path::new(".")) {
            Ok(Resource::Data(bytes)) => Some(bytes),
            _ => None,
        }
    }

    #[test]
    fn data_uris() {
        assert_eq!(data("data:application/octet-stream;base64,AQID"), Some(vec![1, 2, 3]));
        assert_eq!(data("data:;base64,AQ"), Some(vec![1]));
        assert_eq!(data("data:;base64,AQ=="), Some(vec![1]));
        assert_eq!(data("data:,a%20b"), Some(b"a b".to_vec()));
        assert_eq!(data("data:;base64,*"), None);
        assert_eq!(data("data:nothing"), None);
    }

    #[test]
    fn paths_are_percent_decoded() {
        assert!(matches!(resolve("a%20b.bin", Path::new("/d")), Ok(Resource::File(p)) if p == Path::new("/d/a b.bin")));
        assert!(resolve("https://example.com/a.bin", Path::new("/d")).is_err());
        assert!(resolve("", Path::new("/d")).is_err());
    }

    #[test]
    fn the_hash_keeps_inputs_apart() {
        let hash = |parts: &[&[u8]]| {
            let mut inputs = Inputs::new();
            parts.iter().for_each(|p| inputs.add(p));
            inputs.finish()
        };
        assert_ne!(hash(&[b"ab", b"c"]), hash(&[b"a", b"bc"]));
    }
}
