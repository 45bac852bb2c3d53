//! `lightprobe reference` as its users meet it.

use std::path::{Path, PathBuf};

use lightprobe::image::LayeredImage;
use serde_json::Value;

use crate::common::Folder;
use crate::program::{names_in, one_error, refuse, run, scene, succeed, text};

/// Runs it on a scene of the repository; the report.
fn reference(scene: &Path, output: &Path, words: &str) -> Value {
    let mut arguments = vec!["reference", text(scene), "-o", text(output), "-q", "--json"];
    arguments.extend(words.split_whitespace());
    succeed(&arguments).json()
}

fn made(folder: &Folder, name: &str, words: &str) -> PathBuf {
    let output = folder.path().join(name);
    reference(&scene("two_rooms_open"), &output, &format!("--size 24x16 {words}"));
    output
}

#[test]
fn resuming_gives_the_bytes_of_one_run() {
    let folder = Folder::new();
    let whole = std::fs::read(made(&folder, "whole.exr", "--spp 96 --seed 5")).unwrap();
    let path = made(&folder, "parts.exr", "--spp 20 --seed 5");
    assert_ne!(std::fs::read(&path).unwrap(), whole);
    let report = reference(&scene("two_rooms_open"), &path, "--size 24x16 --spp 64 --seed 5 --resume");
    assert_eq!((report["spp"].as_u64(), report["spp_resumed"].as_u64()), (Some(64), Some(32)));
    made(&folder, "parts.exr", "--spp 96 --seed 5 --resume");
    assert_eq!(std::fs::read(&path).unwrap(), whole);
    // Enough already: nothing changes.
    made(&folder, "parts.exr", "--spp 48 --seed 5 --resume");
    assert_eq!(std::fs::read(&path).unwrap(), whole);
    let enough = ["--size", "24x16", "--spp", "48", "--seed", "5", "--resume"];
    let enough = succeed(&[&["reference", text(&scene("two_rooms_open")), "-o", text(&path)][..], &enough].concat());
    assert!(enough.stderr.contains("has 96 samples per pixel already"), "{}", enough.stderr);
    assert!(!enough.stdout.contains("M/s") && !enough.stdout.contains("wrote"), "{}", enough.stdout);
    // Nothing to resume: begins anew.
    let anew = made(&folder, "anew.exr", "--spp 96 --seed 5 --resume");
    assert_eq!(std::fs::read(anew).unwrap(), whole);
}

#[test]
fn threads_do_not_change_the_result() {
    let folder = Folder::new();
    let [one, three] = [1, 3].map(|n| made(&folder, &format!("{n}.exr"), &format!("--spp 32 --threads {n}")));
    assert_eq!(std::fs::read(one).unwrap(), std::fs::read(three).unwrap());
}

#[test]
fn other_runs_are_not_continued() {
    let folder = Folder::new();
    let path = made(&folder, "a.exr", "--spp 32");
    let before = std::fs::read(&path).unwrap();
    let furnace = scene("furnace");
    let rooms = scene("two_rooms_open");
    for (scene, words, named) in [
        (&rooms, "--seed 1", "seed"),
        (&rooms, "--size 24x18", "size"),
        (&rooms, "--camera dark", "camera"),
        (&rooms, "--look-at 1,1,1,0,1,0", "camera"),
        (&rooms, "--max-bounces 3", "max bounces"),
        (&rooms, "--firefly-clamp 3", "firefly clamp"),
        (&rooms, "--env 1,1,1", "scene"),
        (&rooms, "--set solver.albedo_max=0.9", "albedo max"),
        (&furnace, "", "scene"),
    ] {
        let words = format!("--spp 64 --resume {words}");
        let words = if words.contains("--size") { words } else { format!("--size 24x16 {words}") };
        let mut arguments = vec!["reference", text(scene), "-o", text(&path)];
        arguments.extend(words.split_whitespace());
        let message = refuse(&arguments);
        assert!(message.contains(named) && message.contains("a.exr"), "{words}: {message}");
    }
    assert_eq!(std::fs::read(&path).unwrap(), before, "refusals leave the file alone");
    let foreign = folder.write("foreign.exr", "no picture");
    let message = refuse(&["reference", text(&rooms), "-o", text(&foreign), "--spp", "64", "--resume"]);
    assert!(message.contains("foreign.exr"), "{message}");
    // A picture of another kind, without state.
    let mut picture = LayeredImage::new(24, 16);
    picture.push("beauty", vec![glam::Vec3::ONE; 24 * 16]);
    let path = folder.path().join("picture.exr");
    picture.write_exr(&path).unwrap();
    let message = refuse(&["reference", text(&rooms), "-o", text(&path), "--spp", "64", "--resume"]);
    assert!(message.contains("picture.exr") && message.contains("not a reference"), "{message}");
}

#[test]
fn arguments_are_checked_first() {
    let folder = Folder::new();
    let output = folder.path().join("a.exr");
    let rooms = scene("two_rooms_open");
    let base = ["reference", text(&rooms), "-o", text(&output)];
    let fails = |more: &[&str]| {
        let run = run(&[&base, more].concat());
        assert_eq!(run.code, Some(2), "{more:?}");
        run
    };
    for more in [&["--spp", "0"][..], &["--spp", "-3"], &["--spp", "x"], &[], &["--spp", "16", "--transport", "x"]] {
        fails(more);
    }
    for value in ["1e39", "0", "-1", "NaN", "1e-60"] {
        let message = fails(&["--spp", "16", "--firefly-clamp", value]).stderr;
        assert!(message.contains("from 1.2e-38 to 3.4e38"), "{value}: {message}");
    }
    assert!(one_error(&fails(&["--spp", "16", "--camera", "all"])).contains("--camera all"));
    for name in ["a.png", "a"] {
        let other = folder.path().join(name);
        let message = refuse(&["reference", text(&rooms), "-o", text(&other), "--spp", "16"]);
        assert!(message.contains("the extension .exr") && message.contains("a.exr"), "{message}");
    }
    assert!(one_error(&fails(&["--spp", "16", "--camera", "nobody"])).contains("nobody"));
    let nowhere = refuse(&["reference", text(&rooms), "-o", "/nowhere/a.exr", "--spp", "16"]);
    assert!(nowhere.contains("/nowhere"), "{nowhere}");
    assert_eq!(names_in(folder.path()), [""; 0]);
}

#[test]
fn files_hold_what_was_said() {
    let folder = Folder::new();
    let path = folder.path().join("a.exr");
    let report = reference(&scene("cornell"), &path, "--size 24x16 --spp 32 --seed 9");
    assert_eq!(report["schema"], "lightprobe-reference/1");
    for key in ["version", "command", "seed", "threads", "scene_blake3", "config", "camera", "time_s", "rays"] {
        assert!(!report[key].is_null(), "{key}");
    }
    assert_eq!(report["non_finite"], 0);
    let file = lightprobe::shade::reference::Reference::read(&path).unwrap();
    assert_eq!(file.spp, 32);
    assert_eq!(report["rays"]["primary"].as_u64(), Some(file.rays.primary));
    let mean = report["noise"]["mean"].as_f64().unwrap();
    let layer = file.irradiance_indirect();
    let found = layer.iter().map(|e| f64::from(e.element_sum())).sum::<f64>() / (3 * layer.len()) as f64;
    assert!((mean / found - 1.0).abs() < 1e-6, "{mean} {found}");
    let rms = report["noise"]["rms_standard_error"].as_f64().unwrap();
    let variance = file.irradiance_indirect_variance().unwrap();
    let found = variance.iter().map(|v| f64::from(v.element_sum())).sum::<f64>() / (3 * variance.len()) as f64;
    assert!((rms / found.sqrt() - 1.0).abs() < 1e-6, "{rms} {found}");
    let layers: Vec<&str> = file.image.names().collect();
    for layer in ["albedo", "depth", "direct", "emission", "indirect", "irradiance_direct", "normal", "beauty_variance"]
    {
        assert!(layers.contains(&layer), "{layers:?}");
    }
    // The state is not among the layers.
    assert!(layers.iter().all(|l| !l.contains("state")), "{layers:?}");
}

#[test]
fn parts_of_a_block_have_no_variance_and_no_state() {
    let folder = Folder::new();
    for spp in [1, 4, 8] {
        let path = folder.path().join("part.exr");
        let report = reference(&scene("cornell"), &path, &format!("--size 24x16 --spp {spp}"));
        assert_eq!(report["spp"].as_u64(), Some(spp));
        assert!(report["noise"].is_null());
        let file = lightprobe::shade::reference::Reference::read(&path).unwrap();
        assert!(file.irradiance_indirect_variance().is_none() && file.beauty_variance().is_none());
        assert!(file.irradiance_indirect().iter().any(|e| e.x > 0.0));
        let report = reference(&scene("cornell"), &path, "--size 24x16 --spp 32 --resume");
        assert_eq!((report["spp"].as_u64(), report["spp_resumed"].as_u64()), (Some(32), Some(0)));
    }
    // One block: a state, but no variance yet.
    let path = folder.path().join("one.exr");
    let report = reference(&scene("cornell"), &path, "--size 24x16 --spp 16");
    // The mean needs no variance.
    assert!(report["noise"].is_null() && report["irradiance_indirect_mean"].as_f64().unwrap() > 0.0);
    let file = lightprobe::shade::reference::Reference::read(&path).unwrap();
    assert!(file.irradiance_indirect_variance().is_none());
    let report = reference(&scene("cornell"), &path, "--size 24x16 --spp 17 --resume");
    assert_eq!((report["spp"].as_u64(), report["spp_resumed"].as_u64()), (Some(32), Some(16)));
}

#[test]
fn damaged_states_are_refused() {
    let folder = Folder::new();
    let path = made(&folder, "a.exr", "--spp 32");
    let mut image = LayeredImage::read_exr(&path).unwrap();
    // Not a number in the state.
    image.push_words("irradiance_indirect_mean_r_high", vec![0x7FF8_0000; 24 * 16]);
    image.write_exr(&path).unwrap();
    let rooms = scene("two_rooms_open");
    let message = refuse(&["reference", text(&rooms), "-o", text(&path), "--size", "24x16", "--spp", "64", "--resume"]);
    assert!(message.contains("state"), "{message}");
}
