//! What was typed: mistakes are named with their place and remedy, and leave nothing behind.

use std::path::Path;
use std::process::Stdio;

use crate::common::{Folder, Gltf};
use crate::program::{bake, command, names_in, refuse, render, run, scene, succeed, text};
use crate::shapes::{edited, save};

/// Runs a bake that must fail, checks that nothing was written and that the message holds all these words.
fn bad_bake(scene: &Path, arguments: &[&str], words: &[&str]) {
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    let message = refuse(&[&["bake", text(scene), "-o", text(&output)], arguments].concat());
    for word in words {
        assert!(message.contains(word), "no '{word}' in: {message}");
    }
    assert_eq!(names_in(folder.path()), [""; 0]);
}

#[test]
fn wrong_keys_and_values_of_the_configuration() {
    let furnace = scene("furnace");
    for (set, words) in [
        ("grid.spacing=1", &["grid.spacing=1", "'spacing_m'"][..]),
        ("gird.spacing_m=1", &["'grid'"]),
        ("encoding.irradiance=f64", &["encoding.irradiance=f64", "f32"]),
        ("solver.albedo_max=1", &["solver.albedo_max", "not including 1"]),
        ("capture.resolution=0", &["capture.resolution", "1 to 1024"]),
        ("capture.resolution=-1", &["capture.resolution"]),
        ("capture.samples_per_texel=1e9", &["capture.samples_per_texel"]),
        ("grid.spacing_m=-1", &["grid.spacing_m", "positive"]),
        ("grid.spacing_m=1e-9", &["grid.spacing_m", "probes"]),
        ("grid.divisions=(0,1,1)", &["grid.divisions"]),
        ("grid.divisions=(100000,100000,100000)", &["probes"]),
        ("grid.padding=2", &["grid.padding"]),
        ("grid.bounds={\"min\":[1,1,1],\"max\":[0,0,0]}", &["grid.bounds"]),
        ("encoding.border=2", &["encoding.border"]),
        ("lights.sky=(1,-1,1)", &["lights.sky"]),
        ("query.visibility.surface.voxels_per_cell=23", &["voxels_per_cell", "22"]),
        ("solver", &["key=value"]),
    ] {
        bad_bake(&furnace, &["--preset", "physical", "--set", set], words);
    }
    bad_bake(&furnace, &["--set", "grid.spacing_m=1", "--set", "grid.divisions=(2,2,2)"], &["remove one"]);
    bad_bake(&furnace, &["--preset", "defualt"], &["defualt", "default"]);
}

#[test]
fn configuration_files() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    let file = folder.write("bad.ron", "(\n  grid: (\n    spacing: 1.0,\n  ),\n)");
    bad_bake(&furnace, &["--config", text(&file)], &["bad.ron", "line 3", "'spacing_m'"]);
    let file = folder.write("broken.ron", "(grid: (spacing_m: 1.0)");
    bad_bake(&furnace, &["--config", text(&file)], &["broken.ron", "line 1"]);
    let file = folder.write("binary.ron", [0xFF, 0xFE, 0x00]);
    bad_bake(&furnace, &["--config", text(&file)], &["binary.ron"]);
    bad_bake(&furnace, &["--config", "/nowhere/at/all.ron"], &["/nowhere/at/all.ron"]);
    let good = folder.write("good.ron", "(grid: (spacing_m: 0.9))");
    let baked = bake(&folder, &furnace, &format!("--config {}", text(&good)));
    assert!(baked.report["config"].as_str().unwrap().contains("spacing_m: 0.9"));
}

#[test]
fn scenes_and_skies_that_cannot_be_read() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    bad_bake(Path::new("/nowhere/scene.glb"), &[], &["/nowhere/scene.glb"]);
    bad_bake(folder.path(), &[], &[text(folder.path())]);
    bad_bake(&folder.write("text.glb", "no scene"), &[], &["text.glb"]);
    bad_bake(&folder.write("empty.gltf", ""), &[], &["empty.gltf"]);
    bad_bake(&furnace, &["--env", "/nowhere/sky.hdr"], &["/nowhere/sky.hdr"]);
    bad_bake(&furnace, &["--env", text(&folder.write("sky.exr", "no picture"))], &["sky.exr"]);
    bad_bake(&furnace, &["--threads", "1000000"], &["--threads", "1024"]);
}

/// Mistakes that the parser of arguments finds: it explains on several lines.
#[test]
fn arguments_that_do_not_parse() {
    let furnace = scene("furnace");
    let folder = Folder::new();
    let output = folder.path().join("out");
    for (arguments, word) in [
        (&["bake"][..], "SCENE"),
        (&["bake", text(&furnace)], "--output"),
        (&["bake", text(&furnace), "-o", text(&output), "--env", "1,2"], "1,2"),
        (&["bake", text(&furnace), "-o", text(&output), "--env", "1,-2,3"], "-2"),
        (&["bake", text(&furnace), "-o", text(&output), "--env", "sky.png"], "sky.png"),
        (&["bake", text(&furnace), "-o", text(&output), "--seed", "x"], "--seed"),
        (&["bake", text(&furnace), "-o", text(&output), "--memory-budget", "lots"], "512MiB"),
        (&["bake", text(&furnace), "-o", text(&output), "--memory-budget", "512"], "512MiB"),
        (&["bake", text(&furnace), "-o", text(&output), "--wrong"], "--wrong"),
        (&["render", text(&furnace), "p", "-o", text(&output), "--size", "0x5"], "640x360"),
        (&["render", text(&furnace), "p", "-o", text(&output), "--size", "99999x5"], "16384"),
        (&["render", text(&furnace), "p", "-o", text(&output), "--look-at", "1,2,3"], "ox,oy,oz"),
        (&["render", text(&furnace), "p", "-o", text(&output), "--exposure", "1e9"], "100"),
        (&["frobnicate"], "frobnicate"),
    ] {
        let run = run(arguments);
        assert_eq!(run.code, Some(2), "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.starts_with("error: ") && run.stderr.contains(word), "{arguments:?}: {}", run.stderr);
        assert_eq!(names_in(folder.path()), [""; 0]);
    }
    for (arguments, word) in
        [(&["--help"][..], "bake"), (&["bake", "--help"], "--memory-budget"), (&["--version"], "0.")]
    {
        assert!(succeed(arguments).stdout.contains(word), "{arguments:?}");
    }
}

#[test]
fn render_checks_its_arguments() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_open"), "--set grid.spacing_m=2 --set solver.max_bounces=2");
    let output = folder.path().join("out");
    let bad = |scene: &Path, probes: &Path, arguments: &[&str], words: &[&str]| {
        let start = ["render", text(scene), text(probes), "-o", text(&output)];
        let message = refuse(&[&start, arguments].concat());
        for word in words {
            assert!(message.contains(word), "no '{word}' in: {message}");
        }
        assert!(!output.exists(), "{message}");
    };
    let rooms = scene("two_rooms_open");
    bad(&rooms, &baked.path, &["--camera", "drak"], &["drak", "dark", "lit"]);
    bad(&rooms, &baked.path, &["--camera", "2"], &["--camera 2", "0 to 1"]);
    bad(&rooms, Path::new("/nowhere/a.probes"), &[], &["/nowhere/a.probes"]);
    bad(Path::new("/nowhere/a.glb"), &baked.path, &[], &["/nowhere/a.glb"]);
    bad(&scene("two_rooms_sealed"), &baked.path, &[], &["two_rooms_sealed.glb", "--allow-scene-change"]);
    bad(&rooms, &baked.path, &["--env", "1,1,1"], &["--env", "--allow-scene-change"]);
    let message = refuse(&["inspect", text(&baked.path), "--probe", "100000"]);
    assert!(message.contains("--probe 100000"), "{message}");
    // A file where the folder should be.
    let file = folder.write("file", "mine");
    let message = refuse(&["render", text(&rooms), text(&baked.path), "-o", text(&file), "--size", "16x9"]);
    assert!(message.contains(text(&file)), "{message}");
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
}

#[test]
fn a_changed_scene_is_allowed_on_request() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("furnace"), "--set grid.spacing_m=1");
    let bytes = std::fs::read(scene("furnace")).unwrap();
    let changed = folder.write("furnace.glb", edited(&bytes, |json| json["asset"]["copyright"] = "changed".into()));
    let arguments = ["render", text(&changed), text(&baked.path), "-o", text(folder.path()), "--size", "16x9"];
    refuse(&arguments);
    let run = succeed(&[&arguments[..], &["--allow-scene-change", "--json"]].concat());
    assert_eq!(run.json()["scene_changed"], true);
    assert!(run.stderr.contains("warning: "), "{}", run.stderr);
}

#[test]
fn presets_and_configurations_are_printed_and_read_back() {
    let list = succeed(&["bake", "--preset", "list"]).stdout;
    assert!(list.lines().any(|l| l.starts_with("default ")), "{list}");
    for name in list.lines().map(|l| l.split_whitespace().next().unwrap()) {
        let printed = succeed(&["bake", "--preset", name, "--print-config"]).stdout;
        let folder = Folder::new();
        let file = folder.write("printed.ron", &printed);
        assert_eq!(succeed(&["bake", "--config", text(&file), "--print-config"]).stdout, printed, "{name}");
    }
    assert_eq!(
        succeed(&["bake", "--print-config"]).stdout,
        succeed(&["bake", "--preset", "default", "--print-config"]).stdout
    );
    let set = ["bake", "--print-config", "--set", "grid.spacing_m=0.125", "--set", "grid.padding=0.5"];
    let printed = succeed(&set).stdout;
    assert!(printed.contains("spacing_m: 0.125") && printed.contains("padding: 0.5"), "{printed}");
}

#[test]
fn a_dry_run_writes_nothing() {
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    let report = folder.path().join("report.json");
    let furnace = scene("furnace");
    let arguments = ["bake", text(&furnace), "-o", text(&output), "--report", text(&report), "--dry-run"];
    let shown = succeed(&arguments).stdout;
    assert!(shown.contains("left out") && shown.contains("kept"), "{shown}");
    let json = succeed(&[&arguments[..], &["--json"]].concat()).json();
    assert!(json["predicted_time_s"].as_f64().unwrap() >= 0.0);
    assert!(json["predicted_memory_bytes"].as_u64().unwrap() > 0);
    assert!(!json["plan"].as_array().unwrap().is_empty());
    assert_eq!(names_in(folder.path()), [""; 0]);
}

#[test]
fn foreign_files_stay_and_own_ones_are_replaced() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("furnace"), "--set grid.spacing_m=1");
    let run = folder.path().join("run");
    std::fs::create_dir(&run).unwrap();
    for name in ["notes.txt", "visibility_on.tiff", ".hidden"] {
        std::fs::write(run.join(name), "mine").unwrap();
    }
    std::fs::write(run.join("report.json"), "old").unwrap();
    for _ in 0..2 {
        render(&folder, &scene("furnace"), &baked.path, "run", "--size 16x9");
    }
    for name in ["notes.txt", "visibility_on.tiff", ".hidden"] {
        assert_eq!(std::fs::read(run.join(name)).unwrap(), b"mine", "{name}");
    }
    assert_ne!(std::fs::read(run.join("report.json")).unwrap(), b"old");
    let expected = [
        ".hidden",
        "leak.exr",
        "leak.png",
        "notes.txt",
        "probes.png",
        "report.json",
        "visibility_off.exr",
        "visibility_off.png",
        "visibility_on.exr",
        "visibility_on.png",
        "visibility_on.tiff",
        "visibility_ray.exr",
        "visibility_ray.png",
    ];
    assert_eq!(names_in(&run), expected, "temporary files were left");
    assert_eq!(names_in(folder.path()).len(), 2);
}

#[test]
fn outputs_to_missing_folders() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    let deep = folder.path().join("not/there/out.probes");
    let message = refuse(&["bake", text(&furnace), "-o", text(&deep), "--set", "grid.spacing_m=1"]);
    assert!(message.contains("not/there") && message.contains("create it"), "{message}");
    assert_eq!(names_in(folder.path()), [""; 0]);
    // Render creates its folder, as its help says.
    let baked = bake(&folder, &furnace, "--set grid.spacing_m=1");
    render(&folder, &furnace, &baked.path, "deep/er", "--size 16x9");
    assert!(folder.path().join("deep/er/report.json").is_file());
}

#[test]
fn all_cameras_and_free_ones() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=2 --set solver.max_bounces=2");
    let reports = render(&folder, &rooms, &baked.path, "all", "--camera all --size 16x9");
    let names: Vec<&str> = reports.as_array().unwrap().iter().map(|r| r["camera"].as_str().unwrap()).collect();
    assert_eq!(names, ["lit", "dark"]);
    assert_eq!(names_in(&folder.path().join("all")), ["dark", "lit"]);
    let by_name = render(&folder, &rooms, &baked.path, "name", "--camera dark --size 16x9");
    let by_index = render(&folder, &rooms, &baked.path, "index", "--camera 1 --size 16x9");
    let first = render(&folder, &rooms, &baked.path, "first", "--size 16x9");
    assert_eq!(
        (&by_name["camera"], &by_index["camera"], &first["camera"]),
        (&"dark".into(), &"dark".into(), &"lit".into())
    );
    let free = render(&folder, &rooms, &baked.path, "free", "--look-at -3,1.5,1,-1,1,0,50 --size 16x9");
    assert_eq!(free["points"], 16 * 9);
}

#[test]
fn quiet_is_quiet_and_dark_scenes_warn() {
    let folder = Folder::new();
    let dark = save(Gltf::of_triangles(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), &folder, "dark");
    let output = folder.path().join("dark.probes");
    let arguments = ["bake", text(&dark), "-o", text(&output)];
    let loud = succeed(&arguments);
    assert!(loud.stderr.contains("dark.glb") && loud.stderr.contains("--env"), "{}", loud.stderr);
    assert!(!loud.stderr.contains('\r') && !loud.stderr.contains('\u{1b}'), "progress bars off a terminal");
    assert_eq!(succeed(&[&arguments[..], &["-q"]].concat()).stderr, "");
    let lit = succeed(&[&arguments[..], &["--env", "1,1,1"]].concat());
    assert!(!lit.stderr.contains("--env"), "{}", lit.stderr);
}

#[test]
fn a_closed_stdout_ends_quietly() {
    let mut child =
        command().args(["bake", "--print-config"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}

#[test]
fn grids_of_one_probe_and_of_one_layer_can_be_read_back() {
    let folder = Folder::new();
    for words in ["--set grid.divisions=(1,1,1)", "--set grid.divisions=(1,1,6)", "--set grid.divisions=(2,1,1)"] {
        let baked = bake(&folder, &scene("furnace"), words);
        succeed(&["inspect", text(&baked.path)]);
        render(&folder, &scene("furnace"), &baked.path, "run", "--size 16x9");
    }
}

/// A box without extent leaves no spacing to derive from it; the file must be readable all the same, or not be written.
#[test]
fn a_grid_of_one_point_can_be_read_back() {
    let folder = Folder::new();
    let point = "--set grid.divisions=(1,1,1) --set grid.bounds={\"min\":[0,1,0],\"max\":[0,1,0]}";
    let baked = bake(&folder, &scene("furnace"), point);
    succeed(&["inspect", text(&baked.path)]);
    render(&folder, &scene("furnace"), &baked.path, "run", "--size 16x9");
}
