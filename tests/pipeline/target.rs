//! `bake --target-error`: what it promises of the file that it writes.

use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::program::{bake, method, names_in, refuse, render, run, scene, succeed, text};

/// Rough and quick.
const ROUGH: &str = "--set fit=rows(rows_per_probe:30,paths:2)";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// Reached where it is easy; the stored configuration makes the same file without a search, and pictures agree.
#[test]
fn an_error_is_reached_and_the_file_is_an_ordinary_one() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let words = format!("--set grid.spacing_m=2.5 {ROUGH} --target-error 0.3 --seed 4");
    let found = bake(&folder, &rooms, &format!("{words} --threads 1"));
    let target = &found.report["target"];
    assert_eq!((&target["met"], &target["stopped_because"]), (&Value::Bool(true), &"reached".into()), "{target}");
    let reached = number(&target["reached"]);
    assert!(reached + number(&target["standard_error"]) <= 0.3, "{target}");
    let steps = target["steps"].as_array().unwrap();
    assert!(steps.len() > 1 && number(&steps[0]["error"]) > 0.3, "{target}");
    let kept = steps.iter().find(|step| step["error"] == target["reached"]).expect("the step that is kept");
    assert_eq!(kept["bytes"], found.bytes.len());
    assert_eq!(kept["probes"], found.report["probes"]);
    // What the next would cost: half the spacing, with more bytes and a smaller error.
    let next = &target["next"];
    assert!(number(&next["spacing_m"]) <= 0.51 * number(&kept["spacing_m"]), "{target}");
    assert!(number(&next["predicted_bytes"]) > 2.0 * number(&kept["bytes"]), "{target}");
    assert!(number(&next["predicted_error"]) < reached, "{target}");

    let two = bake(&folder, &rooms, &format!("{words} --threads 2"));
    assert!(two.bytes == found.bytes, "threads change the file");
    assert_eq!(two.report["target"]["reached"], target["reached"]);

    let config = folder.write("found.ron", &found.file.metadata["config"]);
    let plain = bake(&folder, &rooms, &format!("--config {} --seed 4", text(&config)));
    assert!(plain.bytes == found.bytes, "the stored configuration makes another file");
    assert!(plain.report["target"].is_null(), "without the flag there is no such key");

    // What it says of cameras is what pictures have: the same pixels, other paths. With 32 of these a pixel both errors are
    // certain to a few percent.
    let seen = target["seen"].as_array().unwrap();
    for camera in ["lit", "dark"] {
        let stated = seen.iter().find(|seen| seen["camera"] == camera).expect("every camera");
        let stated = number(&stated["error"]);
        let view = format!("--camera {camera} --size 192x108 --reference 32 --seed 9");
        let report = render(&folder, &rooms, &found.path, camera, &view);
        let measured = number(&method(&report, "visibility_on")["error"]["nrmse"]);
        assert!((measured / stated - 1.0).abs() < 0.2, "{camera}: {measured} in a picture, {stated} stated");
    }
    assert_eq!(seen.len(), 2, "{target}");
}

#[test]
fn what_cannot_be_reached_stops_at_its_limit_and_says_why() {
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    let rooms = scene("two_rooms_open");
    let words = ["--set", "grid.spacing_m=3", "--set", "capture.rays.octahedral.resolution=8", "--set"];
    let words = [&words[..], &["capture.rays.octahedral.guided=0"]].concat();
    let limits = ["--target-error", "1e-6", "--max-probes", "60", "--json"];
    let run = succeed(&[&["bake", text(&rooms), "-o", text(&output)], &words[..], &limits].concat());
    let report = run.json();
    let target = &report["target"];
    assert_eq!((&target["met"], &target["stopped_because"]), (&Value::Bool(false), &"probes".into()), "{target}");
    assert!(run.stderr.contains("warning: --target-error") && run.stderr.contains("--max-probes"), "{}", run.stderr);
    let steps = target["steps"].as_array().unwrap();
    assert!(steps.iter().all(|step| number(&step["probes"]) <= 60.0), "{target}");
    // The best of them is what was written.
    let least = steps.iter().map(|step| number(&step["error"])).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&target["reached"]), least);
    assert_eq!(names_in(folder.path()), ["out.probes"]);
    let listed = succeed(&["inspect", text(&output), "--json"]).json();
    assert_eq!(listed["probes"], report["probes"]);
}

/// Nothing is relative to no light; one bake is made all the same. A lone triangle in a void looks at nothing.
#[test]
fn darkness_is_no_error() {
    let folder = Folder::new();
    let floor = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    let ceiling = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
    for (triangles, reason) in [(&[floor, ceiling].concat()[..], "dark"), (&floor[..], "no_surface")] {
        let dark = folder.write(&format!("{reason}.gltf"), Gltf::of_triangles(triangles).text());
        let found = bake(&folder, &dark, "--set grid.spacing_m=0.5 --target-error 0.1");
        let target = &found.report["target"];
        assert_eq!(target["stopped_because"], reason, "{target}");
        assert!(target["reached"].is_null() && target["met"] == false && target["next"].is_null(), "{target}");
        assert_eq!(target["steps"].as_array().unwrap().len(), 1, "{target}");
        assert_eq!(target["seen"].as_array().unwrap().len(), 0, "{target}");
    }
}

/// Two errors tell the pace, and that the third takes far more probes than there may be: no bake is spent on the way there.
#[test]
fn what_takes_far_more_than_the_limit_is_not_tried() {
    let folder = Folder::new();
    let words = format!("--set grid.spacing_m=3 {ROUGH} --target-error 0.02 --max-probes 5000");
    let found = bake(&folder, &scene("two_rooms_open"), &words);
    let target = &found.report["target"];
    assert_eq!((&target["met"], &target["stopped_because"]), (&Value::Bool(false), &"probes".into()), "{target}");
    let steps = target["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 2, "{target}");
    let message = target["message"].as_str().unwrap();
    assert!(message.contains("takes a grid of") && message.contains("5000 (--max-probes)"), "{message}");
    // The next step would fit all the same, and its cost is told.
    assert!(number(&target["next"]["predicted_time_s"]) > number(&steps[1]["time_s"]), "{target}");
}

#[test]
fn what_does_not_go_together_is_refused() {
    let folder = Folder::new();
    let (rooms, output) = (scene("two_rooms_open"), folder.path().join("out.probes"));
    let start = ["bake", text(&rooms), "-o", text(&output)];
    for value in ["0", "-1", "NaN", "1e9", "inf", "", "ten"] {
        let refused = run(&[&start[..], &["--target-error", value]].concat());
        assert_eq!(refused.code, Some(2), "{value}: {}", refused.stderr);
        assert!(
            refused.stderr.starts_with("error: ") && refused.stderr.contains("--target-error"),
            "{}",
            refused.stderr
        );
        assert!(refused.stderr.contains("1e-6 to 1") || value.is_empty(), "{value}: {}", refused.stderr);
    }
    for (words, reason) in [
        (&["--dry-run"][..], "--dry-run"),
        (&["--resume"], "--resume"),
        (&["--measure-raw"], "--measure-raw"),
        (&["--set", "grid.divisions=(2,2,2)"], "grid.divisions"),
        (&["--max-probes", "7"], "8 probes"),
    ] {
        let message = refuse(&[&start[..], &["--target-error", "0.1"], words].concat());
        assert!(message.contains(reason), "{words:?}: {message}");
    }
    let refused = run(&[&start[..], &["--max-probes", "100"]].concat());
    assert!(refused.code == Some(2) && refused.stderr.contains("--target-error"), "{}", refused.stderr);
    assert_eq!(names_in(folder.path()), [""; 0]);
}
