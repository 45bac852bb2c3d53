//! The page that a comparison leaves.

use std::fs;

use glam::Vec3;
use lightprobe::image::LayeredImage;
use serde_json::{Value, json};

use crate::common::Folder;
use crate::made::{diff, report};

/// What the project promises of a run of 1920 × 1080 pixels, bytes.
const MOST_BYTES: usize = 8_000_000;

/// Two walls in smooth light with tiles on them.
fn light(x: u32, y: u32, strength: f32) -> Vec3 {
    let (u, v) = (x as f32 / 1920.0, y as f32 / 1080.0);
    let tile = if ((x / 60) ^ (y / 60)) & 1 == 0 { 1.0 } else { 0.7 };
    strength * tile * Vec3::new(0.9, 0.75, 0.6) / (0.3 + (u - 0.4).powi(2) + (v - 0.6).powi(2))
}

fn exr(folder: &Folder, name: &str, strength: f32) -> std::path::PathBuf {
    let mut image = LayeredImage::new(1920, 1080);
    for layer in ["beauty", "irradiance_indirect"] {
        image.push(layer, (0..1920 * 1080).map(|i| light(i % 1920, i / 1920, strength)).collect());
    }
    let path = folder.path().join(name);
    image.write_exr(&path).unwrap();
    path
}

#[test]
fn a_comparison_leaves_its_page() {
    let folder = Folder::new();
    let (base, candidate) = (exr(&folder, "base.exr", 1.0), exr(&folder, "candidate.exr", 1.2));
    let (code, found) = report(&diff(&folder, &base, &candidate, &[]));
    assert_eq!(code, Some(1));
    let page = fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.len() < MOST_BYTES, "{}", page.len());
    let gates = found["gates"].as_array().unwrap();
    let failed = found["verdict"]["failed"].as_u64().unwrap();
    assert!(page.contains(&format!("Fail: {failed} of {} gates", found["verdict"]["gates"])));
    assert!(!gates.is_empty());
    for gate in gates {
        let name = gate["name"].as_str().unwrap();
        assert!(page.contains(&format!("<bdi>{name}</bdi>")), "{name}");
    }
    // Both layers, at full resolution, and their worst pixel.
    for (i, image) in found["images"].as_array().unwrap().iter().enumerate() {
        let worst = format!("data-worst=\"{},{}\"", image["worst"]["x"], image["worst"]["y"]);
        assert!(page.contains(&worst) && page.contains(&format!("id=\"image-{}-difference\"", i + 1)), "{image}");
    }
    assert!(!page.contains("Shown at 1/") && !page.contains("id=\"image-3\""));
    for load in ["src=\"http", "href=\"http", "url(http", "src=\"//", "href=\"//", "@import"] {
        assert!(!page.contains(load), "{load}");
    }
    // A fifth brighter: percents stay percents.
    let mean = gates.iter().find(|g| g["name"] == "image.mean").unwrap();
    assert!((mean["value"].as_f64().unwrap() - 20.0).abs() < 0.01, "{mean}");
    let row = page.split("<bdi>image.mean</bdi>").nth(1).and_then(|rest| rest.split("</tr>").next()).unwrap();
    assert!(
        row.contains("20") && row.contains('%') && !row.contains("2000"),
        "the change is not told in percent: {row}"
    );
}

#[test]
fn sides_that_agree_give_a_page_that_says_so() {
    let folder = Folder::new();
    let figures = |time: f64| {
        json!({"bake_s": {"mean": time, "min": time, "max": time},
               "error_relative": {"mean": 0.1 / time, "min": 0.1 / time, "max": 0.1 / time}})
    };
    let configurations: Vec<Value> =
        [1.0, 2.0].iter().map(|time| json!({"label": format!("{time} s"), "figures": figures(*time)})).collect();
    let sweep = json!({"schema": "lightprobe-sweep/1", "configurations": configurations,
        "ladders": [{"name": "moments", "configurations": [0, 1], "fronts": {"bake_s": [0, 1]}}]});
    let sweep = folder.write("sweep.json", sweep.to_string());
    let (code, found) = report(&diff(&folder, &sweep, &sweep, &[]));
    assert_eq!(code, Some(0));
    let page = fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.contains(&format!("Pass: all {} gates hold", found["verdict"]["gates"])));
    assert!(page.contains("error against bake time") && page.contains("data:image/svg+xml"));
}

#[test]
fn what_cannot_be_compared_is_told_in_words() {
    let folder = Folder::new();
    let side = |name: &str, config: &str, energy: f64| {
        let report = json!({"schema": "lightprobe-bake/1", "config": config, "bounces": [{"energy": energy}]});
        folder.write(name, report.to_string())
    };
    let base = side("base.json", "(of_a_later_version: 1)", 0.0);
    let page = |candidate: std::path::PathBuf| {
        report(&diff(&folder, &base, &candidate, &[]));
        fs::read_to_string(folder.path().join("out/index.html")).unwrap()
    };
    let differs = page(side("other.json", "(of_a_later_version: 2)", 1.0));
    assert!(differs.contains("<strong>from 0</strong>"), "a change from 0 is no number");
    assert!(differs.contains("The configurations differ") && !differs.contains("The same on both sides"));
    assert!(page(side("same.json", "(of_a_later_version: 1)", 0.0)).contains("The same on both sides"));
}
