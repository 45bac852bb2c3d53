//! The project guards itself: what it bakes and renders now against baselines of its own.
//!
//! `LIGHTPROBE_UPDATE_GOLDEN=1` writes them anew. Machines differ in rounding, and a ray that so meets another surface is
//! noise, which the gates know; no time and no peak of memory is judged.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::Folder;
use crate::made::text;
use crate::program::{command, finish, run};

/// Set to anything: baselines are replaced by what the program makes now.
const UPDATE: &str = "LIGHTPROBE_UPDATE_GOLDEN";

/// Larger files have no place in the repository.
const MAX_BYTES: u64 = 300_000;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

/// Bakes and renders into `folder`/`name`, and keeps what decides. Called as from the root of the repository: reports hold their
/// command, and no path of this machine belongs into one that is kept.
fn make(name: &str, spacing_m: f32, cameras: &[&str], folder: &Path) {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    std::os::unix::fs::symlink(scenes, folder.join("scenes")).unwrap();
    fs::create_dir(folder.join(name)).unwrap();
    let call = |words: &str| {
        let run = finish(command().current_dir(folder).args(words.split_whitespace()));
        assert_eq!(run.code, Some(0), "{words}: {}", run.stderr);
    };
    let (scene, probes) = (format!("scenes/{name}.glb"), format!("{name}/{name}.probes"));
    call(&format!("bake {scene} -q -o {probes} --report {name}/bake.json --set grid.spacing_m={spacing_m}"));
    for camera in cameras {
        call(&format!("render {scene} {probes} -q -o {name}/{camera} --camera {camera} --size 64x36"));
        for entry in fs::read_dir(folder.join(name).join(camera)).unwrap() {
            let path = entry.unwrap().path();
            if !path.ends_with("report.json") && !path.ends_with("visibility_on.exr") {
                fs::remove_file(path).unwrap();
            }
        }
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, to) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
        match path.is_dir() {
            true => copy(&path, &to),
            false => assert!(fs::copy(path, to).unwrap() > 0),
        }
    }
}

fn check(name: &str, spacing_m: f32, cameras: &[&str]) {
    let folder = Folder::new();
    let (base, candidate, out) = (golden(name), folder.path().join(name), folder.path().join("out"));
    make(name, spacing_m, cameras, folder.path());
    if std::env::var_os(UPDATE).is_some() {
        let _ = fs::remove_dir_all(&base);
        copy(&candidate, &base);
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
