//! Presets under scenes' files, files from before the metadata `query`, and what is done on request only.

use std::path::{Path, PathBuf};

use glam::Vec3;
use lightprobe::image::LayeredImage;

use crate::common::Folder;
use crate::program::{bake, bake_physical, render, scene, succeed, text};

fn of_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[test]
fn a_preset_says_how_and_a_scenes_file_where() {
    let folder = Folder::new();
    let config = of_project("configs/scenes/cornell.ron");
    // Small enough for a test: the layers are what is asked about.
    let words = format!(
        "--preset path --config {} --set transport.paths.paths=1 --set grid.spacing_m=0.5 --set capture.resolution=8",
        text(&config)
    );
    let baked = bake(&folder, &scene("cornell"), &words);
    let printed = succeed(&["bake", "--preset", "path", "--config", text(&config), "--print-config"]).stdout;
    assert!(printed.contains("paths: 64") && printed.contains("spacing_m: 0.25"), "{printed}");
    let effective = baked.report["config"].as_str().unwrap();
    assert!(effective.contains("paths: 1") && effective.contains("spacing_m: 0.5"), "{effective}");
    assert_eq!(baked.report["converged"], true);
    // Full paths leave nothing to bounce, and the preset stores in single precision.
    assert_eq!(baked.report["bounces"].as_array().unwrap().len(), 1);
    assert_eq!(baked.report["bytes_per_probe"]["tensors"]["irradiance"], 1200.0);
}

/// Written by the version before: their bytes say only what was configured, and still show what they showed then.
#[test]
fn files_of_before_show_the_same_picture() {
    let folder = Folder::new();
    for name in ["surface", "moments"] {
        let before = of_project(&format!("tests/golden/before_query/{name}.exr"));
        let probes = of_project(&format!("tests/golden/before_query/{name}.probes"));
        render(&folder, &scene("two_rooms_open"), &probes, name, "--camera lit --size 48x27");
        let layer = |path: &Path| -> Vec<Vec3> {
            LayeredImage::read_exr(path).unwrap().layer("irradiance_indirect").unwrap().to_vec()
        };
        let (old, new) = (layer(&before), layer(&folder.path().join(name).join("visibility_on.exr")));
        let largest = old.iter().map(|e| e.max_element()).fold(0.0, f32::max);
        assert!(largest > 0.1 && old.len() == new.len());
        let worst = old.iter().zip(&new).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
        // Processors round sums and products alike; what a build fuses may differ by some roundings.
        assert!(worst <= 1e-5 * largest, "{name}: {worst} of {largest}");
    }
}

#[test]
fn probes_are_lit_by_paths_on_request_only() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake_physical(&folder, &rooms, "--set grid.spacing_m=3 --set capture.resolution=8");
    let names = |report: &serde_json::Value| -> Vec<String> {
        let methods = report["methods"].as_array().unwrap();
        methods.iter().map(|m| m["name"].as_str().unwrap().to_owned()).collect()
    };
    let plain = render(&folder, &rooms, &baked.path, "plain", "--size 32x18 --reference 32");
    assert!(plain["baked"].is_null() && !names(&plain).contains(&"path_ray".to_owned()));
    let asked = render(&folder, &rooms, &baked.path, "asked", "--size 32x18 --reference 32 --bake-error");
    assert!(asked["baked"]["bias"].is_number() && asked["baked"]["standard_error"]["bias"].is_number());
    assert!(names(&asked).contains(&"path_ray".to_owned()));
    // Also without a reference: the probes need none.
    let alone = render(&folder, &rooms, &baked.path, "alone", "--size 32x18 --bake-error");
    assert!(alone["baked"]["bias"].is_number() && alone["methods"][1]["leak"]["baked"].is_number());
}
