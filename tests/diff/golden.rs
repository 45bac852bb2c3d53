//! The project guards itself: what it bakes and renders now against baselines of its own.
//!
//! `LIGHTPROBE_UPDATE_GOLDEN=1` writes them anew. Machines differ in rounding, and a ray that so meets another surface is
//! noise, which the gates know; no time and no peak of memory is judged.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::Folder;
use crate::made::text;
use crate::program::{run, scene, succeed};

/// Set to anything: baselines are replaced by what the program makes now.
const UPDATE: &str = "LIGHTPROBE_UPDATE_GOLDEN";

/// Larger files have no place in the repository.
const MAX_BYTES: u64 = 300_000;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

/// Bakes and renders into `folder`, and keeps what decides.
fn make(name: &str, spacing_m: f32, cameras: &[&str], folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let (probes, spacing) = (folder.join(format!("{name}.probes")), format!("grid.spacing_m={spacing_m}"));
    let (scene, report) = (scene(name), folder.join("bake.json"));
    succeed(&["bake", text(&scene), "-q", "-o", text(&probes), "--report", text(&report), "--set", &spacing]);
    for camera in cameras {
        let run = folder.join(camera);
        let size = ["--size", "64x36", "--camera", camera];
        succeed(&[&["render", text(&scene), text(&probes), "-q", "-o", text(&run)][..], &size].concat());
        for entry in fs::read_dir(&run).unwrap() {
            let path = entry.unwrap().path();
            if !path.ends_with("report.json") && !path.ends_with("visibility_on.exr") {
                fs::remove_file(path).unwrap();
            }
        }
    }
}

fn check(name: &str, spacing_m: f32, cameras: &[&str]) {
    let folder = Folder::new();
    let (base, candidate, out) = (golden(name), folder.path().join(name), folder.path().join("out"));
    make(name, spacing_m, cameras, &candidate);
    if std::env::var_os(UPDATE).is_some() {
        let _ = fs::remove_dir_all(&base);
        make(name, spacing_m, cameras, &base);
    }
    assert!(base.is_dir(), "there is no baseline {}; set {UPDATE}=1 to make it", base.display());
    for entry in fs::read_dir(&base).unwrap().map(|e| e.unwrap()).filter(|e| e.path().is_file()) {
        assert!(entry.metadata().unwrap().len() < MAX_BYTES, "{} is too large", entry.path().display());
    }
    let thresholds = golden("thresholds.ron");
    let found =
        run(&["diff-report", text(&base), text(&candidate), "-o", text(&out), "--thresholds", text(&thresholds)]);
    assert_eq!(found.code, Some(0), "{}{}\nset {UPDATE}=1 to accept this", found.stdout, found.stderr);
}

#[test]
fn two_rooms_sealed() {
    check("two_rooms_sealed", 2.0, &["lit", "dark"]);
}

#[test]
fn two_rooms_open() {
    check("two_rooms_open", 2.0, &["lit", "dark"]);
}

#[test]
fn cornell() {
    check("cornell", 0.5, &["front"]);
}
