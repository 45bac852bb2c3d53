//! Finished runs on disk, each under the hash of all that it depends on: an interrupted sweep goes on where it stopped, and a changed
//! input makes only what depends on it anew.
//!
//! `runs/KEY.json`: `{key, blake3, picture_blake3, run}`; `blake3` is that of the compact JSON of `run`. `runs/KEY.exr`: indirect
//! irradiance of the run's picture, at most 12 bytes a pixel. The picture is written first: a JSON file means that the run is whole.

use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::SweepError;
use crate::image::Picture;
use crate::system::input::read_file;
use crate::system::output::{create_folder, write_atomically};

/// Version of what a run computes; raised whenever the same inputs give other results. The program's own version counts besides.
const RESULTS: &str = concat!("lightprobe-sweep-run/2, ", env!("CARGO_PKG_VERSION"));

/// Folder of runs in a sweep's folder.
pub const FOLDER: &str = "runs";

/// Name of a run: the hash of its inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key(String);

impl Key {
    /// Of these inputs, in their order, and of the program's version.
    pub fn of(inputs: &[&str]) -> Key {
        let mut hasher = blake3::Hasher::new();
        for input in [RESULTS].iter().chain(inputs) {
            // With its length, so that no two lists of inputs have the same bytes.
            hasher.update(&(input.len() as u64).to_le_bytes()).update(input.as_bytes());
        }
        Key(hasher.finalize().to_hex().to_string())
    }
}

/// What there is of a run.
#[derive(Debug, PartialEq)]
pub enum Stored<R> {
    Missing,
    /// Something is there that cannot be used.
    Damaged(String),
    Found(R, Option<Vec<Vec3>>),
}

#[derive(Serialize, Deserialize)]
struct Envelope {
    key: String,
    blake3: String,
    picture_blake3: Option<String>,
    run: Value,
}

/// The runs of a sweep's folder.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

impl Store {
    /// In the folder of a sweep; made where missing.
    pub fn new(sweep: &Path) -> Result<Store, SweepError> {
        let folder = sweep.join(FOLDER);
        create_folder(&folder)?;
        Ok(Store { folder })
    }

    fn file(&self, key: &Key, extension: &str) -> PathBuf {
        self.folder.join(format!("{}.{extension}", key.0))
    }

    /// Where a probe file may lie for a moment.
    pub fn scratch(&self) -> PathBuf {
        self.folder.join("current.probes")
    }

    /// Keeps a finished run; `irradiance`: width and pixels of its picture.
    pub fn save(&self, key: &Key, run: &impl Serialize, picture: Option<Picture>) -> Result<(), SweepError> {
        let mut picture_blake3 = None;
        if let Some(picture) = picture {
            let path = self.file(key, "exr");
            picture.write_exr(&path)?;
            let unreadable = |cause| SweepError::Unreadable { path: path.clone(), cause };
            picture_blake3 = Some(hash(&read_file(&path).map_err(unreadable)?));
        }
        // Plain records of numbers and texts: nothing in them can fail to serialise.
        let run = serde_json::to_value(run).unwrap_or_default();
        let envelope = Envelope { key: key.0.clone(), blake3: hash(run.to_string().as_bytes()), picture_blake3, run };
        let text = serde_json::to_string_pretty(&envelope).unwrap_or_default();
        write_atomically(&self.file(key, "json"), |file| std::io::Write::write_all(file, text.as_bytes()))?;
        Ok(())
    }

    /// What is kept of a run; `pixels`: how many its picture must have, where it has one.
    pub fn load<R: DeserializeOwned>(&self, key: &Key, pixels: Option<usize>) -> Stored<R> {
        let path = self.file(key, "json");
        if fs::symlink_metadata(&path).is_err() {
            return Stored::Missing;
        }
        match self.try_load(key, &path, pixels) {
            Ok((run, picture)) => Stored::Found(run, picture),
            Err(what) => Stored::Damaged(format!("{}: {what}", path.display())),
        }
    }

    fn try_load<R: DeserializeOwned>(
        &self,
        key: &Key,
        path: &Path,
        pixels: Option<usize>,
    ) -> Result<(R, Option<Vec<Vec3>>), String> {
        let bytes = read_file(path).map_err(|e| e.to_string())?;
        let envelope: Envelope = serde_json::from_slice(&bytes).map_err(|e| format!("it is no run ({e})"))?;
        if envelope.key != key.0 || envelope.blake3 != hash(envelope.run.to_string().as_bytes()) {
            return Err("it does not match its hash".to_owned());
        }
        let run = serde_json::from_value(envelope.run).map_err(|e| format!("it is no run ({e})"))?;
        let Some(pixels) = pixels else { return Ok((run, None)) };
        let path = self.file(key, "exr");
        let bytes = read_file(&path).map_err(|e| format!("its picture cannot be read ({e})"))?;
        if envelope.picture_blake3 != Some(hash(&bytes)) {
            return Err("its picture does not match its hash".to_owned());
        }
        let picture = Picture::read_exr(&path).map_err(|e| e.to_string())?;
        if picture.pixels.len() != pixels {
            return Err("its picture has another size".to_owned());
        }
        Ok((run, Some(picture.pixels)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stored() -> (tempfile::TempDir, Store, Key) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path()).unwrap();
        let key = Key::of(&["scene", "config"]);
        let pixels = vec![Vec3::new(0.1, 1e-20, 3e20), Vec3::ONE];
        store.save(&key, &vec![0.1, 1.0 / 3.0], Some(Picture::from_pixels(2, 1, pixels))).unwrap();
        (folder, store, key)
    }

    #[test]
    fn runs_come_back_to_the_bit() {
        let (_folder, store, key) = stored();
        let pixels = vec![Vec3::new(0.1, 1e-20, 3e20), Vec3::ONE];
        assert_eq!(store.load(&key, Some(2)), Stored::Found(vec![0.1, 1.0 / 3.0], Some(pixels)));
        assert_eq!(store.load::<Vec<f64>>(&Key::of(&["scene", "other"]), Some(2)), Stored::Missing);
    }

    #[test]
    fn no_two_lists_of_inputs_have_one_key() {
        assert_ne!(Key::of(&["ab", "c"]), Key::of(&["a", "bc"]));
        assert_ne!(Key::of(&["a"]), Key::of(&["a", ""]));
        assert_eq!(Key::of(&["a", "b"]), Key::of(&["a", "b"]));
    }

    #[test]
    fn damage_is_noticed() {
        let (_folder, store, key) = stored();
        let (json, exr) = (store.file(&key, "json"), store.file(&key, "exr"));
        let damaged = || matches!(store.load::<Vec<f64>>(&key, Some(2)), Stored::Damaged(_));
        assert!(!damaged());
        let text = fs::read_to_string(&json).unwrap();
        for broken in [text.replace("0.1", "0.2"), text[..text.len() / 2].to_owned(), String::new()] {
            fs::write(&json, broken).unwrap();
            assert!(damaged());
        }
        fs::write(&json, &text).unwrap();
        assert!(!damaged());
        let mut bytes = fs::read(&exr).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        fs::write(&exr, bytes).unwrap();
        assert!(damaged());
        fs::remove_file(&exr).unwrap();
        assert!(damaged());
    }
}
