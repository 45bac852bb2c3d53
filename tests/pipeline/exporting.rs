//! Exports as users meet them: files, figures, refusals.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::Folder;
use crate::program::{bake, method, names_in, refuse, render, scene, succeed, text};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// Exports into a folder of its own; the folder and the report.
fn export(folder: &Folder, probes: &Path, name: &str, words: &str) -> (PathBuf, Value) {
    let output = folder.path().join(name);
    let mut arguments = vec!["export", text(probes), "-o", text(&output), "-q", "--json"];
    arguments.extend(words.split_whitespace());
    let report = succeed(&arguments).json();
    (output, report)
}

fn record(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("probes.json")).unwrap()).unwrap()
}

const COARSE: &str = "--set grid.spacing_m=1.5 --set capture.rays.octahedral.resolution=8";
const FIT: &str = "--fit --set fit.rows.rows_per_probe=40 --set fit.rows.paths=4";

#[test]
fn what_render_says_of_an_engine_is_what_the_exported_folder_gives() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let probes = bake(&folder, &rooms, COARSE);
    for engine in ["three", "bevy", "ddgi"] {
        let view = "--camera lit --size 32x18 --reference 32";
        let own = render(&folder, &rooms, &probes.path, engine, &format!("{view} --as {engine}"));
        let as_engine = method(&own, &format!("as_{engine}"));
        assert!(folder.path().join(format!("{engine}/as_{engine}.png")).is_file());
        let words = format!("--to {engine} --scene {}", text(&rooms));
        let (exported, report) = export(&folder, &probes.path, &format!("{engine}.export"), &words);
        assert_eq!(number(&report["bytes_per_probe"]), number(&as_engine["bytes_per_probe"]));
        let shaded = render(&folder, &rooms, &exported, &format!("{engine}.shaded"), view);
        assert_eq!(shaded["export"], engine);
        let of_folder = method(&shaded, "visibility_on");
        for figure in ["leak", "error"] {
            assert_eq!(as_engine[figure], of_folder[figure], "{engine}");
        }
        assert!(number(&of_folder["error"]["nrmse"]) > 0.0 && own["export"].is_null());
    }
}

#[test]
fn a_fit_brings_an_engines_look_up_nearer_to_the_truth_for_any_number_of_threads() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let probes = bake(&folder, &rooms, COARSE);
    for engine in ["three", "bevy"] {
        let of = |name: &str, words: &str| {
            let words = format!("--to {engine} --scene {} {words}", text(&rooms));
            export(&folder, &probes.path, &format!("{engine}.{name}"), &words)
        };
        let (plain, _) = of("plain", "");
        let (one, report) = of("one", &format!("{FIT} --threads 1"));
        let (two, _) = of("two", &format!("{FIT} --threads 2"));
        let fit = &report["fit"];
        assert!(number(&fit["held_out_after"]) < 0.6 * number(&fit["held_out_before"]), "{engine}: {fit}");
        for name in names_in(&one) {
            let bytes = |folder: &Path| std::fs::read(folder.join(&name)).unwrap();
            assert!(bytes(&one) == bytes(&two), "threads change {name}");
        }
        // At points and by paths that the fit has not seen, through the files.
        let error = |exported: &Path, name: &str| {
            let view = "--camera lit --size 48x27 --reference 64 --seed 9";
            let report = render(&folder, &rooms, exported, &format!("{engine}.{name}.shaded"), view);
            number(&method(&report, "visibility_on")["error"]["nrmse"])
        };
        let (before, after) = (error(&plain, "plain"), error(&one, "one"));
        assert!(after < 0.6 * before, "{engine}: {before} became {after}");
        let recorded = &record(&one)["fit"];
        assert_eq!(recorded["held_out_after"], fit["held_out_after"]);
        assert!(recorded["time_s"].is_null() && record(&plain)["fit"].is_null());
    }
}

#[test]
fn a_volume_for_each_room_keeps_a_sealed_room_dark() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_sealed");
    let probes = bake(&folder, &rooms, "--set grid.spacing_m=1 --set capture.rays.octahedral.resolution=8");
    for engine in ["three", "bevy"] {
        let leak = |name: &str, words: &str| {
            let words = format!("--to {engine} --scene {} {words}", text(&rooms));
            let (exported, report) = export(&folder, &probes.path, &format!("{engine}.{name}"), &words);
            let mean = |camera: &str| {
                let view = format!("--camera {camera} --size 32x18");
                let report = render(&folder, &rooms, &exported, &format!("{engine}.{name}.{camera}"), &view);
                number(&method(&report, "visibility_on")["irradiance_indirect_mean"])
            };
            (mean("dark") / mean("lit"), report)
        };
        let (one, report) = leak("one", "");
        assert!(report["warnings"][0].as_str().unwrap().contains("--volumes auto"), "{report}");
        let (auto, report) = leak("auto", "--volumes auto");
        assert!(number(&report["volumes"]) >= 2.0, "{report}");
        // With one volume the dark room glows; with two nothing of the lit one is ever asked.
        assert!(one > 0.01 && auto < 1e-4, "{engine}: {one} {auto}");
    }
}

#[test]
fn files_are_those_that_engines_load() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let probes = bake(&folder, &rooms, COARSE);
    let (three, report) = export(&folder, &probes.path, "three", "--to three");
    assert_eq!(names_in(&three), ["index.html", "loadProbes.js", "probes.0.bin", "probes.json"]);
    let volume = &record(&three)["volumes"][0];
    let [x, y, z] = [0, 1, 2].map(|i| number(&volume["resolution"][i]) as u64);
    let bytes = std::fs::metadata(three.join("probes.0.bin")).unwrap().len();
    assert_eq!((bytes, number(&report["bytes"]) as u64), (8 * x * y * 7 * (z + 2), bytes));
    // The box reaches half a spacing beyond the outermost probes.
    let spacing = (number(&volume["max"][0]) - number(&volume["min"][0])) / x as f64;
    assert!((spacing - 1.5).abs() < 1e-6, "{volume}");
    let (with_scene, _) = export(&folder, &probes.path, "page", &format!("--to three --scene {}", text(&rooms)));
    assert_eq!(std::fs::read(with_scene.join("scene.glb")).unwrap(), std::fs::read(&rooms).unwrap());
    let (bevy, _) = export(&folder, &probes.path, "bevy", "--to bevy");
    assert_eq!(names_in(&bevy), ["probes.0.vxgi.ktx2", "probes.json"]);
    let engine = record(&bevy)["volumes"][0]["engine"].clone();
    assert_eq!(number(&engine["intensity"]), 1.0);
    let (exr, _) = export(&folder, &probes.path, "exr", "--to exr");
    assert_eq!(names_in(&exr), ["probes.0.exr", "probes.json"]);
    let words = format!("--to ddgi --scene {}", text(&rooms));
    let (ddgi, _) = export(&folder, &probes.path, "ddgi", &words);
    assert_eq!(names_in(&ddgi).iter().filter(|name| name.ends_with(".dds")).count(), 3);
}

#[test]
fn what_cannot_be_exported_is_refused() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let probes = bake(&folder, &rooms, COARSE);
    let output = folder.path().join("out");
    let refused = |words: &str| {
        let mut arguments = vec!["export", text(&probes.path), "-o", text(&output)];
        arguments.extend(words.split_whitespace());
        refuse(&arguments)
    };
    let with_scene = format!("--scene {}", text(&rooms));
    for (words, said) in [
        ("--to ddgi".to_owned(), "--scene"),
        (format!("--to ddgi --fit {with_scene}"), "--fit"),
        (format!("--to exr --volumes auto {with_scene}"), "--volumes"),
        ("--to three --volumes auto".to_owned(), "--scene"),
        (format!("--to three --fit {with_scene} --set grid.spacing_m=1"), "grid.spacing_m"),
        (format!("--to three --fit {with_scene} --set fit.rows.paths=0"), "fit.rows.paths"),
    ] {
        let message = refused(&words);
        assert!(message.contains(said), "{words}: {message}");
    }
    let shaded = folder.path().join("shaded");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let message = refuse(&["render", text(&rooms), text(&empty), "-o", text(&shaded)]);
    assert!(message.contains("probes.json") && message.contains("export"), "{message}");
    let (exr, _) = export(&folder, &probes.path, "exr", "--to exr");
    let message = refuse(&["render", text(&rooms), text(&exr), "-o", text(&shaded)]);
    assert!(message.contains("no engine"), "{message}");
    let (three, _) = export(&folder, &probes.path, "three", "--to three");
    let message = refuse(&["render", text(&rooms), text(&three), "-o", text(&shaded), "--as", "three"]);
    assert!(message.contains("--as"), "{message}");
    let bytes = std::fs::read(three.join("probes.0.bin")).unwrap();
    std::fs::write(three.join("probes.0.bin"), &bytes[..bytes.len() - 2]).unwrap();
    let message = refuse(&["render", text(&rooms), text(&three), "-o", text(&shaded)]);
    assert!(message.contains("probes.0.bin") && message.contains("export it again"), "{message}");
    // A device, which has no end, and no volume at all.
    std::fs::remove_file(three.join("probes.0.bin")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", three.join("probes.0.bin")).unwrap();
    let message = refuse(&["render", text(&rooms), text(&three), "-o", text(&shaded)]);
    assert!(message.contains("probes.0.bin") && message.contains("not a regular file"), "{message}");
    let mut record = record(&three);
    record["volumes"] = Value::Array(Vec::new());
    std::fs::write(three.join("probes.json"), record.to_string()).unwrap();
    let message = refuse(&["render", text(&rooms), text(&three), "-o", text(&shaded)]);
    assert!(message.contains("no volume") && message.contains("export it again"), "{message}");
}
