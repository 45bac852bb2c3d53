//! Bakes and renders, and what must hold of every one of them: every value of files, pictures and reports is finite,
//! none negative, and no report lacks a number that it should have.

use std::path::{Path, PathBuf};

use glam::Vec3;
use lightprobe::image::LayeredImage;
use lightprobe::probe::file;
use lightprobe::probe::query::{Query, QueryPoint, QuerySettings, Visibility};
use lightprobe::probe::store::surface::Facing;
use lightprobe::scene::{self, LoadOptions, Scene};
use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::probe_file::{ProbeFile, Tensor};
use crate::program::{self, method};
use crate::shapes::save;

/// A scene baked, with the folder that it lives in.
pub struct Baked {
    pub folder: Folder,
    pub scene: PathBuf,
    pub path: PathBuf,
    pub file: ProbeFile,
    pub report: Value,
}

/// Keys that are `null` where nobody asked for the figure, and the solver's that have no meaning where nothing bounces or
/// the curve is not linear.
const UNASKED: [&str; 15] = [
    "error_bound",
    "error_bound_relative",
    "nrmse_mean",
    "operator_norm",
    "published",
    "raw_embree_rays_per_s",
    "saved_bytes",
    "saved_s",
    "spectral_radius_estimate",
    "standard_error",
    "stopped",
    "reference",
    "baked",
    "error",
    "dark_region",
];

/// Ratios to the light seen: `null` where there is none.
const OF_LIGHT: [&str; 11] = [
    "light",
    "dark",
    "blocks",
    "fraction",
    "weight",
    "lookup_ns",
    "lookup_spread_ns",
    "irradiance_indirect_mean",
    "outside_hull",
    "leak_light",
    "leak_dark",
];

/// Figures of points in the air: `null` where there are none, which is expected in two cases. All of a flat volume, a plane, a
/// line or a point of probes, may lie within a wall; and a dark room that shows only backs counts as solid. Any other volume
/// has free air in it.
const OF_AIR: [&str; 2] = ["black", "unseen"];

/// Leaks of such points: `null` also where a flat volume has points but none sees a probe. A single probe's points lie at its
/// grid point, and it may have moved out of sight of it.
const OF_SEEN_AIR: [&str; 2] = ["leak_light", "leak_dark"];

/// What a report is of.
#[derive(Clone, Copy)]
struct Of {
    /// Whether there is light.
    lit: bool,
    /// Whether the volume has but one layer of probes along an axis.
    flat: bool,
}

/// Everything that could go wrong in a report, whatever the scene.
fn check_report(report: &Value, of: Of) {
    fn walk(value: &Value, key: &str, of: Of, (airless, unseen, without_truth): (bool, bool, bool)) {
        match value {
            Value::Null => {
                let expected = UNASKED.contains(&key)
                    || (key == "black" && without_truth)
                    || (airless && OF_AIR.contains(&key))
                    || ((airless || unseen) && OF_SEEN_AIR.contains(&key))
                    || (!of.lit && (OF_LIGHT.contains(&key) || key == "rays_per_s"));
                assert!(expected, "the report's {key} is null");
            }
            Value::Array(list) => list.iter().for_each(|v| walk(v, key, of, (airless, unseen, without_truth))),
            Value::Object(map) => {
                let is = |key: &str, number: f64| map.get(key).is_some_and(|v| v.as_f64() == Some(number));
                // False black of pictures, beside the dark region, is known against a reference alone.
                let truth = map.get("dark_region").is_some_and(Value::is_null);
                let air = ((of.flat || !of.lit) && is("points", 0.0), of.flat && is("unseen", 1.0), truth);
                map.iter().for_each(|(k, v)| walk(v, k, of, air));
            }
            _ => {}
        }
    }
    walk(report, "", of, (false, false, false));
    if let Some(numerics) = report.get("numerics") {
        assert_eq!(numerics["non_finite"], 0, "{numerics}");
    }
}

fn floats(tensor: &Tensor) -> impl Iterator<Item = f32> {
    tensor.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b))
}

/// Whether the volume has but one layer of probes along an axis.
fn is_flat(file: &ProbeFile) -> bool {
    let divisions = file.grid()["divisions"].clone();
    divisions.as_array().expect("numbers of points").iter().any(|n| *n == 1)
}

/// Every tensor's values: finite, and not negative where light and distances are.
fn check_file(file: &ProbeFile) {
    let within = |what: &str, v: f64| assert!(v.is_finite() && v >= 0.0, "{what} {v}");
    for probe in 0..file.states().len() {
        assert!(file.position(probe).iter().all(|x| x.is_finite()), "position of probe {probe}");
        if file.tensors.contains_key("irradiance") {
            let side = file.resolution() + 2 * file.border();
            (0..side * side).flat_map(|t| file.stored(probe, t / side, t % side)).for_each(|v| within("irradiance", v));
        }
        if file.tensors.contains_key("distance_scale") {
            for (_, mean, deviation) in file.distances(probe) {
                within("distance", mean);
                within("deviation", deviation);
            }
        }
    }
    // Whatever else a method stores.
    for (name, tensor) in &file.tensors {
        match tensor.dtype.as_str() {
            "F32" => assert!(floats(tensor).all(f32::is_finite), "tensor {name}"),
            // All bits of the exponent are set in infinities and NaN only.
            "F16" => assert!(tensor.bytes.as_chunks::<2>().0.iter().all(|b| b[1] & 0x7C != 0x7C), "tensor {name}"),
            // The others are indices.
            "U32" if file.metadata.contains_key(&format!("scale.{name}")) => {
                let side = tensor.shape[1];
                let texels = (0..tensor.shape[0]).flat_map(|p| (0..side * side).map(move |t| (p, t)));
                let colors = texels.flat_map(|(p, t)| file.color(name, p, t / side, t % side));
                colors.for_each(|v| within(name, v));
            }
            _ => {}
        }
    }
}

/// Every picture of a run, every layer of it.
fn check_pictures(folder: &Path) {
    for name in ["visibility_off", "visibility_on", "visibility_ray", "leak"] {
        let image = LayeredImage::read_exr(&folder.join(name).with_extension("exr")).unwrap_or_else(|e| panic!("{e}"));
        for (layer, pixels) in image.layers() {
            let signed = layer.contains("leak") || layer == "normal";
            let sane = |p: &glam::Vec3| p.is_finite() && (signed || p.min_element() >= 0.0);
            // A pixel without a surface is infinitely far.
            assert!(layer == "depth" || pixels.iter().all(sane), "{name}, layer {layer}");
        }
    }
}

/// Saves the scene and bakes it, by the preset physical where the words name none; `words` are separated by blanks.
pub fn bake(gltf: Gltf, words: &str) -> Baked {
    let folder = Folder::new();
    let scene = save(gltf, &folder, "scene");
    bake_file(folder, scene, words, true)
}

/// As [`bake`], of a scene in which no light meets a surface.
pub fn bake_dark(gltf: Gltf, words: &str) -> Baked {
    let folder = Folder::new();
    let scene = save(gltf, &folder, "scene");
    bake_file(folder, scene, words, false)
}

/// Bakes a scene that lies in a folder.
pub fn bake_file(folder: Folder, scene: PathBuf, words: &str, lit: bool) -> Baked {
    let bake = if words.contains("--preset") { program::bake } else { program::bake_physical };
    let program::Bake { path, file, report, .. } = bake(&folder, &scene, words);
    let flat = is_flat(&file);
    check_report(&report, Of { lit, flat });
    check_file(&file);
    Baked { folder, scene, path, file, report }
}

/// What a camera sees.
pub struct Seen {
    pub report: Value,
    pictures: PathBuf,
}

impl Baked {
    /// A small picture of a lit scene.
    pub fn look(&self, words: &str) -> Seen {
        self.see(words, true)
    }

    /// A picture in which there may be nothing, or nothing but darkness.
    pub fn look_dark(&self, words: &str) -> Seen {
        self.see(words, false)
    }

    fn see(&self, words: &str, lit: bool) -> Seen {
        let name = blake3::hash(words.as_bytes()).to_hex()[..16].to_owned();
        let report = program::render(&self.folder, &self.scene, &self.path, &name, &format!("--size 64x36 {words}"));
        let pictures = self.folder.path().join(name);
        check_report(&report, Of { lit, flat: is_flat(&self.file) });
        check_pictures(&pictures);
        Seen { report, pictures }
    }

    /// Calls `ask` with the scene and the file's probes, ready for look-ups.
    pub fn with_query<R>(&self, ask: impl FnOnce(&Scene, &Query) -> R) -> R {
        let scene = scene::load(&self.scene, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let volume = file::read(&self.path).unwrap_or_else(|e| panic!("{e}")).volume(scene.origin_world);
        ask(&scene, &Query { volume: &volume, settings: &QuerySettings::default() })
    }

    /// Red irradiance of every interior texel of every active probe.
    pub fn texels(&self) -> Vec<f64> {
        let file = &self.file;
        file.active().into_iter().flat_map(|p| file.texels(p)).map(|t| t.2[0]).collect()
    }

    /// Largest relative deviation of any active probe's mean irradiance from what it must be.
    pub fn worst_mean(&self, expected: f64) -> f64 {
        let active = self.file.active();
        assert!(!active.is_empty(), "no active probe");
        active
            .into_iter()
            .flat_map(|p| self.file.mean_irradiance(p))
            .map(|e| (e / expected - 1.0).abs())
            .fold(0.0, worse)
    }
}

impl Seen {
    pub fn leak(&self, key: &str) -> f64 {
        method(&self.report, "visibility_on")["leak"][key].as_f64().unwrap_or(f64::NAN)
    }

    /// Mean red irradiance from probes over the picture.
    pub fn mean(&self, method: &str) -> f64 {
        let pixels = self.irradiance(method, "irradiance_indirect");
        pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() / pixels.len() as f64
    }

    pub fn irradiance(&self, method: &str, layer: &str) -> Vec<glam::Vec3> {
        let image = LayeredImage::read_exr(&self.pictures.join(method).with_extension("exr"));
        image.unwrap_or_else(|e| panic!("{e}")).layer(layer).expect("the layer").to_vec()
    }
}

/// Red irradiance that a query gives at a point of a surface, relative to the scene's origin.
pub fn irradiance_at(query: &Query, position: Vec3, normal: Vec3) -> f64 {
    let point = QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal };
    f64::from(query.irradiance(&point, Visibility::Stored).x)
}

/// A `--look-at` with its places scaled.
pub fn scaled(look_at: &str, scale: f64) -> String {
    let numbers = look_at.trim_start_matches("--look-at=").split(',').map(|n| n.parse::<f64>().expect("a number"));
    let place = |(i, n): (usize, f64)| format!("{:e}", if i < 6 { n * scale } else { n });
    format!("--look-at={}", numbers.enumerate().map(place).collect::<Vec<_>>().join(","))
}

/// The larger one; a NaN stays, unlike with `f64::max`.
pub fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Largest difference of two lists ÷ the largest value of the first.
pub fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "as many values");
    let largest = a.iter().copied().fold(0.0, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest).fold(0.0, worse)
}
