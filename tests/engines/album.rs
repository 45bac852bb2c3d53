//! Exports that lie somewhere, in their engines, beside the pictures that `render` made of them.
//!
//! `LIGHTPROBE_ALBUM` names a JSON file: a list of `{"engine", "scene", "export", "rendered", "camera", "name"}`, `rendered` being
//! the folder that `render` of the export wrote. Pictures go where `LIGHTPROBE_PAGE_SHOTS` says.

use std::path::PathBuf;

use glam::Vec3;
use lightprobe::image::LayeredImage;
use serde_json::Value;

use crate::agree::{Differences, keep};

pub struct Entry {
    pub scene: PathBuf,
    pub export: PathBuf,
    pub camera: String,
    pub size: (u32, u32),
    name: String,
    expected: Vec<Vec3>,
}

/// The album's entries for an engine; none where there is no album.
pub fn entries(engine: &str) -> Vec<Entry> {
    let Some(file) = std::env::var_os("LIGHTPROBE_ALBUM") else { return Vec::new() };
    let text = std::fs::read_to_string(file).expect("the album");
    let list: Vec<Value> = serde_json::from_str(&text).expect("a list");
    let entry = |value: &Value| {
        let text = |key: &str| value[key].as_str().unwrap_or_else(|| panic!("{key} in {value}")).to_owned();
        let path = |key: &str| PathBuf::from(text(key)).canonicalize().expect("a path");
        let image = LayeredImage::read_exr(&path("rendered").join("visibility_on.exr")).expect("a picture");
        Entry {
            scene: path("scene"),
            export: path("export"),
            camera: text("camera"),
            size: (image.width, image.height),
            name: text("name"),
            expected: image.layer("irradiance_indirect").expect("its irradiance").to_vec(),
        }
    };
    list.iter().filter(|value| value["engine"] == engine).map(entry).collect()
}

impl Entry {
    /// Prints how far an engine's picture is off, and keeps both side by side.
    pub fn judge(&self, found: &[Vec3]) {
        let mean = self.expected.iter().map(|e| e.element_sum() / 3.0).sum::<f32>() / self.expected.len() as f32;
        // Two black pictures do not differ.
        let unit = mean.max(f32::MIN_POSITIVE);
        let Differences { median, most_of_97, most } = Differences::of(found, &self.expected, unit);
        eprintln!("album, {}: median {median:.5}, 97 % {most_of_97:.5}, most {most:.5}", self.name);
        keep(&self.name, self.size, found, &self.expected, unit);
    }
}
