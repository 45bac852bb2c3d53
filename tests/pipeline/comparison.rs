//! `render` against a reference picture: what it reports, what it draws, what it refuses.

use std::path::PathBuf;

use glam::Vec3;
use lightprobe::image::LayeredImage;
use serde_json::{Value, json};

use crate::common::Folder;
use crate::program::{Bake, bake_physical, names_in, refuse, render, scene, succeed, text};

const SIZE: &str = "64x36";

/// A baked scene and a picture with exact visibility, of which references are made.
struct Rooms {
    folder: Folder,
    baked: Bake,
    exact: LayeredImage,
}

impl Rooms {
    /// With probes that hold the light where they stand: what leaked into them can be told.
    fn new() -> Rooms {
        let folder = Folder::new();
        let baked =
            bake_physical(&folder, &scene("two_rooms_open"), "--set grid.spacing_m=1.5 --set solver.max_bounces=4");
        render(&folder, &scene("two_rooms_open"), &baked.path, "plain", &format!("--size {SIZE}"));
        let exact = LayeredImage::read_exr(&folder.path().join("plain/visibility_ray.exr")).expect("a picture");
        Rooms { folder, baked, exact }
    }

    /// A reference of this brightness against the exact picture, with this relative standard error.
    fn reference(&self, name: &str, factor: f32, error: Option<f32>) -> PathBuf {
        let mut image = LayeredImage::new(self.exact.width, self.exact.height);
        for layer in ["beauty", "irradiance_indirect"] {
            let pixels: Vec<Vec3> = self.exact.layer(layer).expect("a layer").iter().map(|p| *p * factor).collect();
            if let Some(error) = error {
                let variance = pixels.iter().map(|p| (*p * error).powf(2.0)).collect();
                image.push(&format!("{layer}_variance"), variance);
            }
            image.push(layer, pixels);
        }
        let path = self.folder.path().join(name);
        image.write_exr(&path).expect("a reference");
        path
    }

    fn render(&self, name: &str, reference: &std::path::Path) -> Value {
        let words = format!("--size {SIZE} --reference-image {}", text(reference));
        render(&self.folder, &scene("two_rooms_open"), &self.baked.path, name, &words)
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

const FIGURES: [&str; 9] = ["mae", "rmse", "nrmse", "relmse", "bias", "over", "under", "psnr_db", "flip"];

#[test]
fn a_reference_gives_every_figure_its_standard_error() {
    let rooms = Rooms::new();
    // A tenth darker than the exact picture: its own errors are known.
    let reference = rooms.reference("darker.exr", 0.9, Some(0.01));
    let report = rooms.render("run", &reference);
    let methods = report["methods"].as_array().expect("methods");
    for method in methods {
        let error = &method["error"];
        for part in [error, &error["by_region"]["corner"], &error["by_region"]["flat"]] {
            assert!(part["verdict"].is_null(), "{part}");
            assert!(number(&part["pixels"]) > 0.0 && number(&part["noise_rms"]) > 0.0);
            for figure in FIGURES {
                number(&part[figure]);
                assert!(number(&part["standard_error"][figure]) >= 0.0, "{figure}: {part}");
            }
        }
        let pixels = |part: &str| number(&error["by_region"][part]["pixels"]);
        assert_eq!(pixels("corner") + pixels("flat"), number(&error["pixels"]));
        assert!(number(&error["relmse_epsilon"]) > 0.0 && number(&error["psnr_peak"]) > 0.0);
    }
    let error = &methods[2]["error"];
    let irradiance = rooms.exact.layer("irradiance_indirect").expect("irradiance");
    let mean = irradiance.iter().map(|e| f64::from(e.element_sum()) / 3.0).sum::<f64>() / irradiance.len() as f64;
    // Noise is said to be there and is not: the square loses 0.01² of 0.1², the mean absolute nothing at ten deviations.
    assert!((number(&error["bias"]) / (0.1 * mean) - 1.0).abs() < 1e-4, "{error}");
    assert!((number(&error["mae"]) / (0.1 * mean) - 1.0).abs() < 1e-4, "{error}");
    assert_eq!(number(&error["under"]), 0.0);
    let of_mean = number(&error["rmse"]) / number(&report["reference"]["irradiance_indirect_mean"]);
    assert!((number(&error["nrmse"]) / of_mean - 1.0).abs() < 1e-9, "{error}");
    let known = &report["reference"];
    assert_eq!((&known["file"], &known["spp"]), (&json!(text(&reference)), &Value::Null));
    assert!(number(&known["standard_error_mean"]) > 0.0 && number(&known["irradiance_indirect_mean"]) > 0.0);

    let run = rooms.folder.path().join("run");
    assert_eq!(std::fs::read(run.join("reference.exr")).unwrap(), std::fs::read(&reference).unwrap());
    for name in ["error_off", "error_on", "reference"] {
        assert!(run.join(format!("{name}.png")).is_file() && run.join(format!("{name}.exr")).is_file(), "{name}");
    }
    let map = LayeredImage::read_exr(&run.join("error_on.exr")).unwrap();
    assert_eq!(map.names().collect::<Vec<_>>(), ["error"]);
    // One exposure, the reference's own.
    let beauty = LayeredImage::read_exr(&reference).unwrap().picture("beauty").unwrap();
    assert!((number(&report["exposure_ev"]) - f64::from(beauty.auto_exposure_ev())).abs() < 1e-6);
}

#[test]
fn a_reference_that_is_the_picture_itself_has_no_error() {
    let rooms = Rooms::new();
    let report = rooms.render("run", &rooms.reference("same.exr", 1.0, Some(0.0)));
    let error = &report["methods"][2]["error"];
    for figure in ["mae", "rmse", "nrmse", "relmse", "bias", "over", "under", "flip"] {
        assert_eq!(number(&error[figure]), 0.0, "{figure}");
    }
    assert!(error["psnr_db"].is_null() && error["verdict"].is_null(), "{error}");
    // The figures of leaks are against the same picture: what came through walls is what is over.
    let off = &report["methods"][0];
    assert!(number(&off["error"]["over"]) > 0.0);
}

#[test]
fn a_reference_without_variance_is_told_from_one_with() {
    let rooms = Rooms::new();
    let report = rooms.render("run", &rooms.reference("unknown.exr", 0.9, None));
    let error = &report["methods"][1]["error"];
    for figure in FIGURES {
        number(&error[figure]);
        assert!(error["standard_error"][figure].is_null(), "{figure}");
    }
    assert!(error["verdict"].as_str().is_some_and(|v| v.contains("no error estimate")), "{error}");
    let noisy = rooms.render("noisy", &rooms.reference("noisy.exr", 1.0, Some(0.5)));
    assert_eq!(noisy["methods"][2]["error"]["verdict"], "reference too noisy");
    // In words too, and once.
    let reference = rooms.folder.path().join("unknown.exr");
    let (rooms_scene, output) = (scene("two_rooms_open"), rooms.folder.path().join("words"));
    let words = ["render", text(&rooms_scene), text(&rooms.baked.path), "-o", text(&output), "--size", SIZE];
    let shown = succeed(&[&words[..], &["--reference-image", text(&reference)]].concat()).stdout;
    assert_eq!(shown.matches("no error estimate").count(), 1, "{shown}");
    assert!(shown.contains("error (nrmse)") && shown.contains("in corners") && shown.contains("elsewhere"), "{shown}");
}

#[test]
fn references_that_do_not_fit_are_refused() {
    let rooms = Rooms::new();
    let reference = rooms.reference("good.exr", 1.0, None);
    let leak = rooms.folder.path().join("plain/leak.exr");
    let (rooms_scene, output) = (scene("two_rooms_open"), rooms.folder.path().join("refused"));
    let start = ["render", text(&rooms_scene), text(&rooms.baked.path), "-o", text(&output)];
    for (arguments, words) in [
        (vec!["--reference-image", text(&reference), "--size", "32x18"], vec!["good.exr", "--size 64x36"]),
        (vec!["--reference-image", text(&leak), "--size", SIZE], vec!["leak.exr", "irradiance_indirect"]),
        (vec!["--reference-image", "/nowhere/a.exr"], vec!["/nowhere/a.exr"]),
        (vec!["--reference-image", text(&reference), "--size", SIZE, "--camera", "all"], vec!["--camera all"]),
    ] {
        let message = refuse(&[&start[..], &arguments].concat());
        for word in words {
            assert!(message.contains(word), "no '{word}' in: {message}");
        }
    }
    assert!(!output.exists());
}

#[test]
fn a_reference_in_the_folder_of_the_run_stays_as_it_is() {
    let rooms = Rooms::new();
    let path = rooms.folder.path().join("plain/reference.exr");
    std::fs::copy(rooms.reference("good.exr", 1.0, None), &path).unwrap();
    let before = std::fs::read(&path).unwrap();
    rooms.render("plain", &path);
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert!(names_in(&rooms.folder.path().join("plain")).contains(&"reference.png".to_owned()));
}

#[test]
fn a_traced_reference_is_as_good_as_its_file() {
    let rooms = Rooms::new();
    let run = |name: &str, words: &str| {
        let words = format!("--size 32x18 {words}");
        render(&rooms.folder, &scene("two_rooms_open"), &rooms.baked.path, name, &words)
    };
    let traced = run("traced", "--reference 50 --bake-error --threads 1");
    // Rounded up to whole blocks of 16.
    assert_eq!((&traced["reference"]["spp"], &traced["reference"]["file"]), (&json!(64), &Value::Null));
    assert!(number(&traced["reference"]["time_s"]) > 0.0);
    let file = rooms.folder.path().join("traced/reference.exr");
    let read = run("read", &format!("--reference-image {} --threads 2", text(&file)));
    assert_eq!(read["reference"]["spp"], 64);
    assert!(read["reference"]["time_s"].is_null());
    for (a, b) in traced["methods"].as_array().unwrap().iter().zip(read["methods"].as_array().unwrap()) {
        assert_eq!(a["error"], b["error"]);
        let mut leak = a["leak"].clone();
        assert!(number(&leak["baked"]) >= 0.0);
        leak["baked"] = Value::Null;
        assert_eq!(leak, b["leak"], "only paths tell what leaked into the probes");
        assert!(a.get("error_gltf").is_none());
        // Interpolation errs by percents, and not by more than the light that there is.
        let mean = number(&traced["reference"]["irradiance_indirect_mean"]);
        assert!((0.01..1.0).contains(&(number(&a["error"]["rmse"]) / mean)), "{}", a["error"]);
    }
    let names = |report: &Value| -> Vec<String> {
        report["methods"]
            .as_array()
            .unwrap()
            .iter()
            .map(|m| text(m["name"].as_str().unwrap().as_ref()).to_owned())
            .collect()
    };
    let stored = ["visibility_off", "visibility_on", "visibility_ray"].map(str::to_owned);
    assert_eq!(names(&read), stored);
    assert_eq!(names(&traced), [&stored[..], &["path_ray".to_owned()]].concat());
    assert!(read["baked"].is_null());
    let baked = &traced["baked"];
    let balance = number(&baked["light"]) - number(&baked["dark"]) - number(&baked["bias"]);
    let errors = &baked["standard_error"];
    // What noise alone makes is taken off either, but neither falls below 0.
    let clipped = if number(&baked["light"]) > 0.0 { 0.0 } else { 3.0 * number(&errors["dark"]) };
    assert!(balance.abs() < 1e-6 + clipped && number(&errors["bias"]) > 0.0, "{baked}");
    // The other camera of the same scene, and other light.
    let (rooms_scene, output) = (scene("two_rooms_open"), rooms.folder.path().join("refused"));
    let start = ["render", text(&rooms_scene), text(&rooms.baked.path), "-o", text(&output), "--size", "32x18"];
    let message = refuse(&[&start[..], &["--reference-image", text(&file), "--camera", "dark"]].concat());
    assert!(message.contains("reference.exr") && message.contains("camera"), "{message}");
    let changed = ["--reference-image", text(&file), "--env", "1,1,1", "--allow-scene-change"];
    let shown = succeed(&[&start[..], &changed].concat());
    assert!(shown.stderr.contains("of another scene"), "{}", shown.stderr);
}

#[test]
fn every_camera_has_a_reference_of_its_own() {
    let rooms = Rooms::new();
    let words = "--size 16x9 --camera all --reference 8";
    let reports = render(&rooms.folder, &scene("two_rooms_open"), &rooms.baked.path, "all", words);
    for report in reports.as_array().unwrap() {
        assert_eq!(report["reference"]["spp"], 8);
        let error = &report["methods"][0]["error"];
        assert!(error["verdict"].as_str().is_some_and(|v| v.contains("no error estimate")), "{error}");
        assert!(report["methods"][0]["leak"]["dark_region"].is_null());
    }
    for camera in ["lit", "dark"] {
        assert!(rooms.folder.path().join("all").join(camera).join("reference.exr").is_file());
    }
    let usage = crate::program::run(&[
        "render",
        "a.glb",
        "a.probes",
        "-o",
        "x",
        "--reference",
        "16",
        "--reference-image",
        "a.exr",
    ]);
    assert_eq!(usage.code, Some(2));
    assert!(usage.stderr.contains("--reference-image"), "{}", usage.stderr);
}

#[test]
fn figures_against_glossy_transport_stand_apart() {
    let rooms = Rooms::new();
    let (rooms_scene, path) = (scene("two_rooms_open"), rooms.folder.path().join("glossy.exr"));
    let traced = ["reference", text(&rooms_scene), "-o", text(&path), "--spp", "32", "--size", SIZE, "-q"];
    succeed(&[&traced[..], &["--transport", "gltf"]].concat());
    let report = rooms.render("run", &path);
    for method in report["methods"].as_array().unwrap() {
        assert!(method["error"].is_null(), "{method}");
        assert!(number(&method["error_gltf"]["rmse"]) > 0.0);
    }
}
