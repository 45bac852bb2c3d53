//! What the tests compare: bakes and renders of small scenes, and faults put into them.

use std::path::{Path, PathBuf};

use glam::Vec3;
use lightprobe::image::LayeredImage;
use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::program::{Run, run, succeed};

/// A result of bake and render: `NAME.probes`, `NAME.json`, and the folder `NAME`.
pub struct Made {
    pub probes: PathBuf,
    pub report: PathBuf,
    pub run: PathBuf,
}

/// Bakes and renders the scene's first camera. `words`: further flags of `bake`.
pub fn make(folder: &Folder, name: &str, scene: &Path, words: &str) -> Made {
    let at = |name: String| folder.path().join(name);
    let made =
        Made { probes: at(format!("{name}.probes")), report: at(format!("{name}.json")), run: at(name.to_owned()) };
    let mut bake = vec!["bake", text(scene), "-q", "-o", text(&made.probes), "--report", text(&made.report)];
    bake.extend(words.split_whitespace());
    succeed(&bake);
    succeed(&["render", text(scene), text(&made.probes), "-q", "-o", text(&made.run), "--size", "96x54"]);
    made
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// Runs the comparison; the folder of its results is `out` in `folder`.
pub fn diff(folder: &Folder, base: &Path, candidate: &Path, words: &[&str]) -> Run {
    let out = folder.path().join("out");
    let mut arguments = vec!["diff-report", text(base), text(candidate), "-o", text(&out), "--json"];
    arguments.extend(words);
    run(&arguments)
}

/// The report of a comparison that could be made, and its exit code.
pub fn report(run: &Run) -> (Option<i32>, Value) {
    assert_ne!(run.code, Some(2), "{}", run.stderr);
    (run.code, run.json())
}

/// Names of the gates that fail.
pub fn failing(report: &Value) -> Vec<String> {
    let gates = report["gates"].as_array().expect("gates");
    let fails = |g: &&Value| g["passed"] == false && g["waived"] == false;
    gates.iter().filter(fails).map(|g| g["name"].as_str().expect("a name").to_owned()).collect()
}

/// The scene with its JSON changed.
pub fn edited(folder: &Folder, scene: &Path, name: &str, edit: impl FnOnce(&mut Value)) -> PathBuf {
    let bytes = std::fs::read(scene).expect("a scene");
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
    let json_end = 20 + length(12);
    let mut json: Value = serde_json::from_slice(&bytes[20..json_end]).expect("JSON of a glb");
    edit(&mut json);
    let gltf = Gltf { json, bin: bytes[json_end + 8..].to_vec() };
    folder.write(&format!("{name}.glb"), gltf.glb())
}

/// A copy of a folder in which every picture of a method is changed.
pub fn with_pictures(folder: &Folder, made: &Path, name: &str, change: impl Fn(u32, u32, &mut [Vec3])) -> PathBuf {
    let copy = folder.path().join(name);
    std::fs::create_dir(&copy).expect("a folder");
    for file in ["report.json", "visibility_on.exr", "visibility_off.exr"] {
        std::fs::copy(made.join(file), copy.join(file)).expect("a copy");
    }
    let path = copy.join("visibility_on.exr");
    let image = LayeredImage::read_exr(&path).expect("an EXR");
    let mut changed = LayeredImage::new(image.width, image.height);
    for (name, pixels) in image.layers() {
        let mut pixels = pixels.to_vec();
        change(image.width, image.height, &mut pixels);
        changed.push(name, pixels);
    }
    changed.write_exr(&path).expect("an EXR");
    copy
}

/// All pixels one to the right, around the edge.
pub fn shift(width: u32, _height: u32, pixels: &mut [Vec3]) {
    pixels.chunks_mut(width as usize).for_each(|row| row.rotate_right(1));
}
