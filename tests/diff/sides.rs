//! What can be compared, what cannot, and that nothing is left half-written.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use glam::Vec3;
use image::{ImageBuffer, Rgb};
use lightprobe::image::{LayeredImage, Picture};
use serde_json::{Value, json};

use crate::common::Folder;
use crate::made::{diff, failing, report, text};
use crate::program::{command, finish, one_error, scene, succeed};

/// A picture with some structure.
fn picture(width: u32, height: u32, scale: f32) -> Picture {
    let pixel = |i: u32| scale * Vec3::new((i % width) as f32 / width as f32, 0.5, (i / width) as f32 / height as f32);
    Picture::from_pixels(width, height, (0..width * height).map(pixel).collect())
}

fn exr(folder: &Folder, name: &str, picture: &Picture) -> std::path::PathBuf {
    let mut image = LayeredImage::new(picture.width, picture.height);
    image.push("beauty", picture.pixels.clone());
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image.write_exr(&path).unwrap();
    path
}

fn bake_report(schema: &str) -> String {
    json!({"schema": schema, "seed": 0, "converged": true, "peak_memory_bytes": null}).to_string()
}

/// Refused with this in its one line of error, and nothing written.
fn refused(folder: &Folder, base: &Path, candidate: &Path, words: &[&str]) {
    let message = one_error(&diff(folder, base, candidate, &[]));
    for word in words {
        assert!(message.contains(word), "{word} is not in: {message}");
    }
    assert!(!folder.path().join("out").exists(), "something was written");
}

#[test]
fn half_broken_inputs() {
    let folder = Folder::new();
    let good = exr(&folder, "good.exr", &picture(32, 18, 1.0));
    let bytes = fs::read(&good).unwrap();
    let cut = folder.write("cut.exr", &bytes[..bytes.len() / 2]);
    refused(&folder, &good, &cut, &["cut.exr", "copy it again"]);
    refused(&folder, &cut, &good, &["cut.exr"]);
    let old = folder.write("old.json", bake_report("lightprobe-bake/1"));
    let new = folder.write("new.json", bake_report("lightprobe-bake/2"));
    refused(&folder, &old, &new, &["new.json", "lightprobe-bake/2", "update lightprobe"]);
    let foreign = folder.write("foreign.json", "{}");
    refused(&folder, &foreign, &foreign, &["foreign.json", "no 'schema'"]);
    refused(&folder, &old, &folder.write("broken.json", "{"), &["broken.json", "damaged"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    refused(&folder, &folder.path().join("empty"), &folder.path().join("empty"), &["empty", "nothing"]);
    refused(&folder, &good, &folder.path().join("missing.exr"), &["missing.exr", "check the path"]);
    refused(&folder, &good, &old, &["an image", "a report of bake"]);
    let inner = exr(&folder, "several/a.exr", &picture(8, 8, 1.0));
    refused(&folder, &good, inner.parent().unwrap(), &["an image", "a folder of 1"]);
    let small = exr(&folder, "small.exr", &picture(16, 18, 1.0));
    refused(&folder, &good, &small, &["32 × 18", "16 × 18"]);
    let png = folder.path().join("good.png");
    picture(32, 18, 1.0).tonemapped(0.0).write_png(&png).unwrap();
    refused(&folder, &good, &png, &["codes", "light"]);
}

#[test]
fn a_report_of_a_newer_render_in_a_folder_is_refused() {
    let folder = Folder::new();
    let run = folder.path().join("run");
    fs::create_dir(&run).unwrap();
    fs::write(run.join("report.json"), r#"{"schema": "lightprobe-render/2"}"#).unwrap();
    refused(&folder, &run, &run, &["report.json", "lightprobe-render/2", "update lightprobe"]);
}

#[test]
fn outputs_stay_out_of_the_sides() {
    let folder = Folder::new();
    let image = exr(&folder, "side/a.exr", &picture(8, 8, 1.0));
    let inside = folder.path().join("side/out");
    let side = image.parent().unwrap();
    let run = crate::program::run(&["diff-report", text(side), text(side), "-o", text(&inside)]);
    assert!(one_error(&run).contains("BASE"), "{}", run.stderr);
    assert!(!inside.exists());
}

#[test]
fn identical_pictures_have_no_psnr() {
    let folder = Folder::new();
    let image = exr(&folder, "a.exr", &picture(32, 18, 1.0));
    let (code, found) = report(&diff(&folder, &image, &image, &[]));
    assert_eq!(code, Some(0));
    assert_eq!((&found["images"][0]["psnr_db"], &found["images"][0]["rmse"]), (&Value::Null, &json!(0.0)));
    assert!(found["images"][0]["worst"].is_null());
    assert!(folder.path().join("out/difference.png").is_file());
}

#[test]
fn figures_are_those_of_their_definitions() {
    // Every channel 0.1 up: rmse and mae 0.1, psnr 20 dB at peak 1.
    let folder = Folder::new();
    let base = picture(32, 18, 1.0);
    let mut up = base.clone();
    up.pixels.iter_mut().for_each(|p| *p += Vec3::splat(0.1));
    up.pixels[5] += Vec3::splat(0.01);
    let (a, b) = (exr(&folder, "a.exr", &base), exr(&folder, "b.exr", &up));
    let (code, found) = report(&diff(&folder, &a, &b, &[]));
    assert_eq!(code, Some(1));
    let figure = |name: &str| found["images"][0][name].as_f64().unwrap();
    // One of 576 pixels is a tenth farther off: less than 2e-5.
    assert!((figure("rmse") - 0.1).abs() < 5e-5 && (figure("mae") - 0.1).abs() < 5e-5, "{}", found["images"]);
    assert!((figure("psnr_db") - 20.0).abs() < 5e-3);
    assert_eq!((&found["images"][0]["worst"]["x"], &found["images"][0]["worst"]["y"]), (&json!(5), &json!(0)));
}

#[test]
fn sixteen_bits_count() {
    let folder = Folder::new();
    let png = |name: &str, code: u16| {
        let path = folder.path().join(name);
        ImageBuffer::<Rgb<u16>, _>::from_pixel(16, 16, Rgb([code, 30_000, 40_000])).save(&path).unwrap();
        path
    };
    let (a, b) = (png("a.png", 20_000), png("b.png", 20_100));
    let (_, found) = report(&diff(&folder, &a, &b, &[]));
    let expected = 100.0 / 65_535.0 / 3.0_f64.sqrt();
    assert!((found["images"][0]["rmse"].as_f64().unwrap() / expected - 1.0).abs() < 1e-3);
}

#[test]
fn folders_are_matched_by_name() {
    let folder = Folder::new();
    for name in ["base/x/a.exr", "base/gone.exr", "candidate/x/a.exr", "candidate/new.exr"] {
        exr(&folder, name, &picture(16, 9, 1.0));
    }
    let at = |name: &str| folder.path().join(name);
    let (code, found) = report(&diff(&folder, &at("base"), &at("candidate"), &[]));
    assert_eq!(code, Some(1));
    let mut names = failing(&found);
    names.sort();
    assert_eq!(names, ["added", "missing"]);
    assert_eq!((&found["added"], &found["missing"]), (&json!(["new.exr"]), &json!(["gone.exr"])));
    assert_eq!(found["images"][0]["item"], "x/a.exr");
    // A link back to where it lies adds nothing.
    std::os::unix::fs::symlink(".", at("base/x/loop")).unwrap();
    assert_eq!(report(&diff(&folder, &at("base"), &at("candidate"), &[])).1["missing"], json!(["gone.exr"]));
    refused_alone(&at("base/x"), &at("candidate"));
}

/// Folders without a common name.
fn refused_alone(base: &Path, candidate: &Path) {
    let folder = Folder::new();
    refused(&folder, base, candidate, &["no name is in both"]);
}

#[test]
fn masks_choose_pixels() {
    let folder = Folder::new();
    let base = picture(16, 8, 1.0);
    let mut changed = base.clone();
    changed.pixels[3] = Vec3::splat(50.0);
    let (a, b) = (exr(&folder, "a.exr", &base), exr(&folder, "b.exr", &changed));
    let mask = |name: &str, color: &dyn Fn(u32) -> u8, width: u32| {
        let path = folder.path().join(name);
        ImageBuffer::from_fn(width, 8, |x, _| Rgb([color(x); 3])).save(&path).unwrap();
        path
    };
    assert_eq!(diff(&folder, &a, &b, &[]).code, Some(1));
    let right = mask("right.png", &|x| if x < 8 { 0 } else { 255 }, 16);
    let (code, found) = report(&diff(&folder, &a, &b, &["--mask", text(&right)]));
    assert_eq!((code, &found["images"][0]["pixels"]), (Some(0), &json!(64)));
    let side = folder.write("a.json", bake_report("lightprobe-bake/1"));
    let message = one_error(&diff(&folder, &side, &side, &["--mask", text(&right)]));
    assert!(message.contains("no picture is compared"), "{message}");
    for (path, word) in [(mask("small.png", &|_| 255, 8), "one size"), (mask("black.png", &|_| 0, 16), "no white")] {
        let message = one_error(&diff(&folder, &a, &b, &["--mask", text(&path)]));
        assert!(message.contains(word) && message.contains(text(&path)), "{message}");
    }
}

#[test]
fn the_verdict_does_not_depend_on_readers() {
    let folder = Folder::new();
    let up = |scale: f32| exr(&folder, &format!("{scale}.exr"), &picture(32, 18, scale));
    let (base, candidate, out) = (up(1.0), up(2.0), folder.path().join("out"));
    let unread = |more: &[&str]| {
        let arguments = ["diff-report", text(&base), text(&candidate), "-o", text(&out)];
        let mut command = command();
        let command = command.args(arguments).args(more).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        child.wait().unwrap().code()
    };
    assert_eq!(unread(&[]), Some(1));
    assert_eq!(unread(&["--update-baseline"]), Some(0));
    assert_eq!(fs::read(&base).unwrap(), fs::read(&candidate).unwrap());
    assert_eq!(unread(&["--thresholds", "missing.ron"]), Some(2));
}

#[test]
fn nothing_to_judge_is_no_pass() {
    let folder = Folder::new();
    let light = exr(&folder, "light.exr", &picture(8, 8, 1.0));
    let dark = exr(&folder, "nan.exr", &picture(8, 8, f32::NAN));
    refused(&folder, &dark, &dark, &["nan.exr", "nothing to judge"]);
    assert!(failing(&report(&diff(&folder, &light, &dark, &[])).1).contains(&"image.non_finite".to_owned()));
}

#[test]
fn figures_of_one_side_only_are_undefined_and_fail() {
    let folder = Folder::new();
    let with = folder.write("a.json", bake_report("lightprobe-bake/1").replace("null", "100"));
    let without = folder.write("b.json", bake_report("lightprobe-bake/1"));
    let (code, found) = report(&diff(&folder, &with, &without, &[]));
    assert_eq!((code, failing(&found)), (Some(1), vec!["memory.peak".to_owned()]));
    assert_eq!(diff(&folder, &without, &without, &[]).code, Some(0));
}

#[test]
fn commands_give_the_sides_again() {
    let folder = Folder::new();
    fs::copy(scene("cornell"), folder.path().join("a room.glb")).unwrap();
    let call = |words: &[&str]| finish(command().current_dir(folder.path()).args(words));
    let coarse = ["--set", "grid.spacing_m=1", "-q"];
    for seed in ["3", "4"] {
        let (probes, report, run) = (format!("{seed}.probes"), format!("{seed}/bake.json"), format!("{seed}/it's"));
        fs::create_dir(folder.path().join(seed)).unwrap();
        let bake = ["bake", "a room.glb", "-o", &probes, "--report", &report, "--seed", seed];
        assert_eq!(call(&[&bake[..], &coarse].concat()).code, Some(0));
        let render = ["render", "a room.glb", &probes, "-o", &run, "--size", "32x18", "-q"];
        assert_eq!(call(&render).code, Some(0));
    }
    let (_, found) = report(&call(&["diff-report", "3", "4", "-o", "out", "--json"]));
    let commands: Vec<[String; 2]> = found["commands"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| ["purpose", "line"].map(|key| c[key].as_str().unwrap().to_owned()))
        .collect();
    let purposes: Vec<&str> = commands.iter().map(|c| c[0].as_str()).collect();
    assert_eq!(purposes, ["compare", "bake, base", "render, base", "bake, candidate", "render, candidate"]);
    assert_eq!(commands[0][1], "lightprobe diff-report 3 4 -o out --json");

    // A shell that is told where the program lies makes the same again.
    fs::rename(folder.path().join("3"), folder.path().join("before")).unwrap();
    fs::create_dir(folder.path().join("3")).unwrap();
    for [_, line] in &commands[1..3] {
        let script = format!("lightprobe() {{ \"$LIGHTPROBE\" \"$@\"; }}; {line}");
        let mut shell = std::process::Command::new("sh");
        let shell = shell.args(["-c", &script]).current_dir(folder.path());
        let run = finish(shell.env("LIGHTPROBE", env!("CARGO_BIN_EXE_lightprobe")));
        assert_eq!(run.code, Some(0), "{line}: {}", run.stderr);
    }
    let (code, found) = report(&call(&["diff-report", "before", "3", "-o", "again", "--json"]));
    assert_eq!(code, Some(0));
    assert!(found["images"].as_array().unwrap().iter().all(|image| image["rmse"] == 0.0), "{}", found["images"]);
}

#[test]
fn where_nothing_holds_a_command_a_note_says_so() {
    let folder = Folder::new();
    let image = exr(&folder, "a.exr", &picture(16, 9, 1.0));
    let (_, found) = report(&diff(&folder, &image, &image, &[]));
    assert_eq!(found["commands"].as_array().unwrap().len(), 1);
    assert!(found["notes"].to_string().contains("only reports hold their command"), "{}", found["notes"]);
    // Two lines would be two commands, and could end a comment's block of code.
    let report_of = |line: &str| {
        json!({"schema": "lightprobe-bake/1", "command": "bake", "command_line": line, "converged": true}).to_string()
    };
    let hostile = folder.write("hostile.json", report_of("lightprobe bake\nrm x"));
    let (_, found) = report(&diff(&folder, &hostile, &hostile, &[]));
    assert_eq!(found["commands"].as_array().unwrap().len(), 1, "{}", found["commands"]);
}

#[test]
fn real_sweeps_are_judged() {
    let folder = Folder::new();
    let ladder = folder.write(
        "ladder.ron",
        "(ladders: [(name: \"tiny\", set: [\"placement.rays=32\"], axes: [(key: \"grid.spacing_m\", values: [2.0, 1.5])])])",
    );
    let sweep = |name: &str, words: &str| {
        let (scene, out) = (scene("two_rooms_open"), folder.path().join(name));
        let common = "--reference 32 --seeds 2 --no-progress --json";
        let arguments = ["sweep", text(&scene), "-o", text(&out), "--ladder", text(&ladder)];
        let arguments = arguments.into_iter().chain(common.split_whitespace()).chain(words.split_whitespace());
        succeed(&arguments.collect::<Vec<_>>());
        out
    };
    let base = sweep("base", "--size 32x18");
    let (code, found) = report(&diff(&folder, &base, &base, &[]));
    assert_eq!((code, failing(&found)), (Some(0), vec![]));
    let gates = found["gates"].as_array().unwrap();
    for (name, is_judged) in [
        ("leak.light", true),
        ("error.rmse", true),
        ("error.flip", true),
        ("memory.bytes_per_probe", true),
        ("convergence", true),
        ("time.bake", false),
    ] {
        let of = |g: &&Value| g["name"] == name && g["item"].as_str().unwrap().starts_with("tiny spacing_m=");
        let found: Vec<&Value> = gates.iter().filter(of).collect();
        assert_eq!(found.len(), 2, "{name}");
        assert!(found.iter().all(|g| g["base"].is_number() && g["threshold"].is_number() == is_judged), "{found:?}");
    }
    let leaky = sweep("leaky", "--size 32x18 --set query.visibility=none");
    let (code, found) = report(&diff(&folder, &base, &leaky, &[]));
    assert!(code == Some(1) && failing(&found).contains(&"leak.fraction".to_owned()), "{:?}", failing(&found));
    // Other seeds are noise.
    let (code, found) = report(&diff(&folder, &base, &sweep("seeds", "--size 32x18 --seed 7"), &[]));
    assert_eq!((code, failing(&found)), (Some(0), vec![]));
    let other = Folder::new();
    refused(&other, &base, &sweep("size", "--size 16x9"), &["width", "--size"]);
}

#[test]
fn sweeps_are_compared_by_configuration() {
    let folder = Folder::new();
    let sweep = |name: &str, leak: f64, labels: &[&str]| {
        let figure = |mean: f64| json!({"mean": mean, "min": mean, "max": mean, "standard_error": null});
        let figures = json!({"leak_light": figure(leak), "error_rmse": figure(0.5)});
        let one = |label: &&str| json!({"label": label, "figures": figures});
        let configurations: Vec<Value> = labels.iter().map(one).collect();
        let sweep = json!({"schema": "lightprobe-sweep/1", "configurations": configurations});
        folder.write(name, sweep.to_string())
    };
    let base = sweep("a.json", 0.01, &["default", "gone"]);
    assert_eq!(diff(&folder, &base, &base, &[]).code, Some(0));
    let (code, found) = report(&diff(&folder, &base, &sweep("b.json", 0.2, &["default"]), &[]));
    let mut names = failing(&found);
    names.sort();
    assert_eq!((code, &names[..]), (Some(1), &["leak.light".to_owned(), "missing".to_owned()][..]));
}
