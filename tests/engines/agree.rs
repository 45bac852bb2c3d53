//! How far an engine's picture is from ours, and when both are the same.

use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;
use lightprobe::image::{LayeredImage, Picture8};
use serde_json::Value;

pub const SIZE: (u32, u32) = (96, 54);

/// Cameras of the two rooms.
pub const CAMERAS: [&str; 2] = ["lit", "dark"];

/// Differences of irradiance, largest channel of each pixel, ÷ the mean of the lit room: the probes of the dark one are
/// blended with its probes.
#[derive(Debug, Clone, Copy)]
pub struct Differences {
    pub median: f32,
    pub most_of_97: f32,
    pub most: f32,
}

impl Differences {
    pub fn of(found: &[Vec3], expected: &[Vec3], unit: f32) -> Differences {
        assert_eq!(found.len(), expected.len(), "pixels");
        let pairs = found.iter().zip(expected);
        // What is not finite is as wrong as can be.
        let difference = |(a, b): (&Vec3, &Vec3)| (*a - *b).abs().max_element() / unit;
        let mut all: Vec<f32> = pairs.map(difference).map(|d| if d.is_nan() { f32::INFINITY } else { d }).collect();
        all.sort_by(f32::total_cmp);
        let at = |share: f64| all[(share * (all.len() - 1) as f64) as usize];
        Differences { median: at(0.5), most_of_97: at(0.97), most: at(1.0) }
    }

    /// Textures are filtered with fractions of eight bits: 1/256 of the difference between neighbours, which is as large as the
    /// light. Pixels on edges may show the other surface, as both draw through nearly the same points: few do.
    pub fn agree(&self) -> bool {
        self.median < 0.002 && self.most_of_97 < 0.01
    }
}

/// Runs the program; words that name a path stand for it.
pub fn run(words: &str, paths: &[(&str, &Path)]) -> Value {
    let word = |word: &str| match paths.iter().find(|(name, _)| *name == word) {
        Some((_, path)) => path.to_str().expect("UTF-8").to_owned(),
        None => word.to_owned(),
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightprobe"));
    let output = command.args(words.split_whitespace().map(word)).args(["-q", "--json"]).output().expect("the program");
    assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

pub fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"))
}

/// Probes of a scene in a folder.
pub fn baked(name: &str, folder: &Path) -> PathBuf {
    let (scene, probes) = (scene(name), folder.join(format!("{name}.probes")));
    let paths = [("SCENE", &*scene), ("PROBES", &*probes)];
    run("bake SCENE -o PROBES --set grid.spacing_m=1 --set capture.rays.octahedral.resolution=16", &paths);
    probes
}

/// An export of probes, in a folder beside them.
pub fn exported(name: &str, probes: &Path, to: &str, flags: &str) -> PathBuf {
    let scene = scene(name);
    let export = probes.with_file_name(format!("{name}.{to}{}", flags.replace(' ', "")));
    let words = format!("export PROBES --to {to} -o EXPORT --scene SCENE {flags} --set fit.rows.rows_per_probe=50");
    run(&words, &[("SCENE", &*scene), ("PROBES", probes), ("EXPORT", &*export)]);
    export
}

/// Irradiance of an export as `render` shows it to each camera, and the mean of the lit room.
pub fn shaded(name: &str, export: &Path) -> (Vec<Vec<Vec3>>, f32) {
    let (width, height) = SIZE;
    let scene = scene(name);
    let shown = |camera: &str| {
        let shaded = export.with_extension(format!("shaded.{camera}"));
        let paths = [("SCENE", &*scene), ("EXPORT", export), ("SHADED", &*shaded)];
        run(&format!("render SCENE EXPORT -o SHADED --camera {camera} --size {width}x{height}"), &paths);
        let image = LayeredImage::read_exr(&shaded.join("visibility_on.exr")).expect("a picture");
        image.layer("irradiance_indirect").expect("its irradiance").to_vec()
    };
    let all: Vec<Vec<Vec3>> = CAMERAS.iter().map(|camera| shown(camera)).collect();
    let mean = |image: &Vec<Vec3>| image.iter().map(|e| e.element_sum() / 3.0).sum::<f32>() / image.len() as f32;
    let unit = all.iter().map(mean).fold(0.0, f32::max);
    assert!(unit > 0.0, "a room is lit");
    (all, unit)
}

/// The engine's picture left, ours right, where `LIGHTPROBE_PAGE_SHOTS` names a folder.
pub fn keep(name: &str, (width, height): (u32, u32), found: &[Vec3], expected: &[Vec3], unit: f32) {
    let Some(folder) = std::env::var_os("LIGHTPROBE_PAGE_SHOTS").map(PathBuf::from) else { return };
    let rows = found.chunks(width as usize).zip(expected.chunks(width as usize));
    let code = |e: f32| (255.0 * (e / (4.0 * unit)).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8;
    let pixels = rows.flat_map(|(a, b)| a.iter().chain(b)).map(|e| e.to_array().map(code));
    let mut picture = Picture8::filled(2 * width, height, [0; 3]);
    picture.pixels = pixels.collect();
    picture.write_png(&folder.join(format!("{name}.png"))).expect("a picture is written");
}

/// Whether a picture agrees for every camera; prints how far it is off.
pub fn all_agree(name: &str, found: &[Vec<Vec3>], expected: &[Vec<Vec3>], unit: f32) -> bool {
    let mut agree = true;
    for ((camera, found), expected) in CAMERAS.iter().zip(found).zip(expected) {
        let differences = Differences::of(found, expected, unit);
        let Differences { median, most_of_97, most } = differences;
        eprintln!("{name}, {camera}: median {median:.5}, 97 % {most_of_97:.5}, most {most:.5}");
        agree &= differences.agree();
        keep(&format!("{}.{camera}", name.replace([' ', ',', '/'], "_")), SIZE, found, expected, unit);
    }
    agree
}
