//! Care for what is there: inputs are never overwritten, memory is not asked for in vain, and what is done is told.

use serde_json::Value;

use crate::common::{Folder, Gltf, U16};
use crate::program::{
    Run, bake, bake_physical, command, finish, names_in, one_error, refuse, render, run, scene, succeed, text,
};
use crate::shapes::diffuse;

/// A scene in several files: a `.gltf`, its buffer, and a folder for outputs.
fn external_scene(folder: &Folder) -> std::path::PathBuf {
    let mut gltf = Gltf::of_triangles(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    gltf.json["buffers"] = serde_json::json!([{ "byteLength": gltf.bin.len(), "uri": "scene.bin" }]);
    folder.write("scene.bin", &gltf.bin);
    folder.write("scene.gltf", gltf.json.to_string())
}

#[test]
fn outputs_that_are_inputs() {
    let folder = Folder::new();
    let scene_file = external_scene(&folder);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let config = folder.write("config.ron", "(grid: (divisions: (2, 2, 2)))");
    let sky = folder.write("sky.hdr", "no picture");
    std::os::unix::fs::symlink(&scene_file, folder.path().join("link.gltf")).unwrap();
    let baked = bake(&folder, &scene_file, "--env 1,1,1 --set grid.divisions=(2,2,2)");
    let before: Vec<(String, Vec<u8>)> =
        names_in(folder.path()).into_iter().map(|n| (n.clone(), std::fs::read(at(&n)).unwrap())).collect();
    let bake = |words: &[&str]| {
        refuse(&[&["bake", text(&scene_file), "--config", text(&config), "--env"][..], words].concat())
    };
    let constant = "1,1,1";
    for (words, expected) in [
        (&[constant, "-o", &at("scene.gltf")][..], "the scene"),
        (&[constant, "-o", &at("./scene.gltf")], "the scene"),
        (&[constant, "-o", &at("link.gltf")], "the scene"),
        (&[constant, "-o", &at("config.ron")], "the configuration"),
        (&[text(&sky), "-o", text(&sky)], "the environment map"),
        (&[constant, "-o", &at("scene.bin")], "a file of the scene"),
        (&[constant, "-o", &at("a.probes"), "--report", &at("scene.gltf")], "the scene"),
        (&[constant, "-o", &at("a.probes"), "--report", &at("./a.probes")], "the same file"),
        (&[constant, "-o", &at("a.probes"), "--report", &at("a.probes.resume")], "the same file"),
    ] {
        let message = bake(words);
        assert!(message.contains(expected), "{words:?}: {message}");
    }
    // The probe file where a picture would go.
    let probes = at("visibility_on.exr");
    std::fs::rename(&baked.path, &probes).unwrap();
    let message = refuse(&["render", text(&scene_file), &probes, "-o", text(folder.path()), "--env", "1,1,1"]);
    assert!(message.contains("the probe file"), "{message}");
    std::fs::rename(&probes, &baked.path).unwrap();
    for (name, bytes) in before {
        assert!(std::fs::read(at(&name)).unwrap() == bytes, "{name} has changed");
    }
}

#[test]
fn outputs_that_cannot_be() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    let baked = bake(&folder, &furnace, "--set grid.spacing_m=1");
    let output = folder.path().join("out");
    std::fs::create_dir_all(output.join("leak.png")).unwrap();
    let render = |output: &str| refuse(&["render", text(&furnace), text(&baked.path), "-o", output, "--size", "16x9"]);
    assert!(render(text(&output)).contains("leak.png"));
    assert_eq!(names_in(&output), ["leak.png"]);
    assert!(render("/dev/full").contains("/dev/full is not a folder"));
    let below_a_file = baked.path.join("x");
    let message = refuse(&["bake", text(&furnace), "-o", text(&below_a_file)]);
    assert!(message.contains("is not a folder"), "{message}");
    // Through a link to where nothing is yet.
    let link = folder.path().join("link.json");
    std::os::unix::fs::symlink("report.json", &link).unwrap();
    let probes = folder.path().join("a.probes");
    succeed(&["bake", text(&furnace), "-o", text(&probes), "-q", "--set", "grid.spacing_m=1", "--report", text(&link)]);
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(folder.path().join("report.json").is_file());
}

/// Runs the program with so much address space.
fn in_memory(kib: u64, arguments: &[&str]) -> Run {
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "ulimit -v $0; exec \"$@\"", &kib.to_string()]).arg(command().get_program()).args(arguments);
    finish(&mut shell)
}

#[test]
fn more_memory_than_there_is() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    let output = folder.path().join("out.probes");
    // 3 GiB: the program takes a few hundred MiB of address space.
    let limited = |arguments: &[&str]| in_memory(3 << 20, &[arguments, &["--threads", "1"]].concat());
    for (set, word) in [
        ("filter.irradiance_resolution=1024", "store.irradiance.octahedral.resolution"),
        ("capture.rays.octahedral.resolution=1024", "capture.rays.octahedral.resolution"),
        ("grid.divisions=(400,400,400)", "grid.divisions"),
        ("grid.spacing_m=0.02", "grid.spacing_m"),
    ] {
        let preset = ["--preset", "physical", "--set"];
        let many = ["capture.samples_per_texel=16", "--set", "grid.spacing_m=0.5", "--set"];
        let sets = [&preset[..], if word.starts_with("capture") { &many[..] } else { &[] }].concat();
        let run = limited(&[&["bake", text(&furnace), "-o", text(&output)][..], &sets, &[set]].concat());
        let message = one_error(&run);
        for part in [word, "GiB", "available"] {
            assert!(message.contains(part), "{set}: {message}");
        }
        assert_eq!(names_in(folder.path()), [""; 0]);
    }
    let baked = bake(&folder, &furnace, "--set grid.spacing_m=1");
    let pictures = folder.path().join("out");
    let arguments = ["render", text(&furnace), text(&baked.path), "-o", text(&pictures)];
    let message = one_error(&limited(&[&arguments[..], &["--size", "8192x8192"]].concat()));
    assert!(message.contains("--size 8192x8192") && message.contains("smaller"), "{message}");
    assert!(!pictures.exists());
    let fits = limited(&[&arguments[..], &["--size", "320x180"]].concat());
    assert_eq!(fits.code, Some(0), "{}", fits.stderr);
}

#[test]
fn grids_that_no_one_means() {
    let furnace = scene("furnace");
    let folder = Folder::new();
    let output = folder.path().join("out.probes");
    let file = |text: &str| folder.write("config.ron", text);
    let bake = |words: &[&str]| refuse(&[&["bake", text(&furnace), "-o", text(&output)], words].concat());
    for value in ["1e39", "1e300", "NaN", "inf", "-1", "0"] {
        let message = bake(&["--set", &format!("grid.spacing_m={value}")]);
        assert!(message.contains("--set grid.spacing_m=") && message.contains("positive"), "{message}");
        let config = file(&format!("(grid: (spacing_m: {value}))"));
        let message = bake(&["--config", text(&config)]);
        assert!(message.contains("config.ron, line 1: grid.spacing_m") && message.contains("positive"), "{message}");
    }
    let config = file("(grid: (bounds: (min: (0, NaN, 0), max: (1, 1, 1))))");
    assert!(bake(&["--config", text(&config)]).contains("config.ron, line 1: grid.bounds"));
    let message = bake(&["--set", "grid.divisions=(4000000000,4000000000,4000000000)"]);
    assert!(message.contains("6e28 probes"), "{message}");
    let config = file("(grid: (spacing_m: 1))");
    let message = bake(&["--config", text(&config), "--set", "grid.divisions=(2,2,2)"]);
    assert!(message.contains("--set grid.spacing_m=None"), "{message}");
    let arguments = ["bake", text(&furnace), "--dry-run", "--config", text(&config)];
    let sets = ["--set", "grid.spacing_m=None", "--set", "grid.divisions=(2,2,2)"];
    succeed(&[&arguments[..], &sets].concat());
    let away = ["--set", "grid.spacing_m=None", "--set", "grid.bounds=(min: (90, 0, 0), max: (91, 1, 1))"];
    let warned = succeed(&[&arguments[..], &away].concat());
    assert!(warned.stderr.contains("grid.bounds lie wholly outside"), "{}", warned.stderr);
}

#[test]
fn mistyped_values() {
    let furnace = scene("furnace");
    let folder = Folder::new();
    for (set, words) in [
        ("query.visibility=moments", &["chebyshev(power: 3, floor: 0.05)"][..]),
        ("query.direction=cosine", &["cosine(floor: "]),
        ("encoding.irradiance=f61", &["did you mean 'f16'"]),
        ("grid.divisions=(0,1,1)", &["--set grid.divisions=(0,1,1)"]),
        ("placement.rays=0", &["--set placement.rays=0"]),
    ] {
        let message = refuse(&["bake", text(&furnace), "--print-config", "--preset", "physical", "--set", set]);
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
    let message = refuse(&["bake", text(&furnace), "--print-config", "--set", "colour=1"]);
    assert!(!message.contains("did you mean"), "{message}");
    let message = refuse(&["bake", text(&furnace), "--print-config", "--set", "seed=1"]);
    assert!(message.contains("did you mean the flag --seed"), "{message}");
    for flag in ["--threads", "--seed", "--memory-budget"] {
        let run = run(&["bake", text(&furnace), "--dry-run", flag, "-1"]);
        assert_eq!(run.code, Some(2));
        assert!(run.stderr.contains("invalid value '-1'") && run.stderr.contains(flag), "{}", run.stderr);
    }
    for (name, bytes, words) in
        [("empty.ron", &b""[..], "it is empty"), ("mark.ron", b"\xEF\xBB\xBF(grid: (spacing_m: 0))", "grid.spacing_m")]
    {
        let message = refuse(&["bake", "--print-config", "--config", text(&folder.write(name, bytes))]);
        assert!(message.contains(name) && message.contains(words), "{message}");
    }
}

#[test]
fn inputs_that_are_no_files() {
    let folder = Folder::new();
    let pipe = folder.path().join("pipe");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
    for path in [text(&pipe), "/dev/zero", "/dev/stdin"] {
        for arguments in [
            &["bake", "--print-config", "--config", path][..],
            &["inspect", path],
            &["render", text(&scene("furnace")), path, "-o", text(&folder.path().join("out"))],
            &[
                "render",
                text(&scene("furnace")),
                "a",
                "-o",
                text(&folder.path().join("out")),
                "--reference-image",
                path,
            ],
        ] {
            let message = one_error(&finish(command().args(arguments).stdin(std::process::Stdio::piped())));
            assert!(message.contains("not a regular file"), "{message}");
        }
    }
}

#[test]
fn skies_that_are_too_large() {
    let folder = Folder::new();
    let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 32768\n";
    let sky = folder.write("sky.hdr", header);
    let output = folder.path().join("out.probes");
    let message = refuse(&["bake", text(&scene("furnace")), "-o", text(&output), "--env", text(&sky)]);
    assert!(message.contains("32768×16384 pixels") && message.contains("reduce the picture"), "{message}");
}

#[test]
fn foreign_files_are_not_resumed_from_and_not_deleted() {
    let folder = Folder::new();
    let furnace = scene("furnace");
    let output = folder.path().join("a.probes");
    let arguments = ["bake", text(&furnace), "-o", text(&output), "-v", "--set", "grid.spacing_m=1"];
    let resume = folder.write("a.probes.resume", "");
    for content in ["", "my notes"] {
        std::fs::write(&resume, content).unwrap();
        let resumed = run(&[&arguments[..], &["--resume"]].concat());
        assert_eq!(resumed.code, Some(2));
        assert!(
            resumed.stderr.contains("a.probes.resume") && resumed.stderr.contains("leave --resume out"),
            "{}",
            resumed.stderr
        );
        assert!(!resumed.stderr.contains("placement:"), "work was done before: {}", resumed.stderr);
        succeed(&arguments);
        assert_eq!(std::fs::read_to_string(&resume).unwrap(), content);
    }
}

#[test]
fn a_full_disk_at_help() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let help = finish(command().args(["bake", "--help"]).stdout(full()).stderr(std::process::Stdio::piped()));
    assert_eq!(help.code, Some(2), "{}", help.stderr);
    assert_eq!(succeed(&["bake", "--help"]).stderr, "");
}

#[test]
fn verbose_runs_tell_what_they_do() {
    let folder = Folder::new();
    let cornell = scene("cornell");
    let output = folder.path().join("a.probes");
    let set = ["--set", "grid.divisions=(3,3,3)"];
    let baked = succeed(&[&["bake", text(&cornell), "-o", text(&output), "-v"][..], &set].concat());
    for line in [
        "configuration: preset default, --set",
        "scene: ",
        "acceleration structure: ",
        "grid: uniform, 3 × 3 × 3",
        "placement: ",
        "plan: sky left out",
        "capture: ",
        "bounces: ",
        "wrote ",
    ] {
        assert!(baked.stderr.lines().any(|l| l.starts_with(line)), "no '{line}' in {}", baked.stderr);
    }
    let pictures = folder.path().join("out");
    let arguments = ["render", text(&cornell), text(&output), "-o", text(&pictures), "--size", "32x18", "-v"];
    let rendered = succeed(&arguments);
    for line in ["scene: ", "probes: ", "camera front: ", "visibility_on: ", "wrote "] {
        assert!(rendered.stderr.lines().any(|l| l.starts_with(line)), "no '{line}' in {}", rendered.stderr);
    }
    let traced = succeed(&[&arguments[..], &["--reference", "16", "--bake-error"]].concat());
    for line in ["probes by full paths: ", "reference: 16 samples per pixel"] {
        assert!(traced.stderr.lines().any(|l| l.starts_with(line)), "no '{line}' in {}", traced.stderr);
    }
    assert!(succeed(&["inspect", text(&output), "-v"]).stderr.contains("all hashes match"));
    let truth = folder.path().join("truth.exr");
    let report = folder.path().join("truth.json");
    let reference =
        ["reference", text(&cornell), "-o", text(&truth), "--report", text(&report), "--size", "32x18", "--spp", "16"];
    let traced = succeed(&[&reference[..], &["-v"]].concat());
    for line in [
        "configuration: preset default",
        "scene: ",
        "acceleration structure: ",
        "camera front: 32×18 pixels, 16 samples each",
        "reference: 16 samples per pixel",
    ] {
        assert!(traced.stderr.lines().any(|l| l.starts_with(line)), "no '{line}' in {}", traced.stderr);
    }
    for file in [&truth, &report] {
        assert!(traced.stderr.contains(&format!("wrote {}", file.display())), "{}", traced.stderr);
    }
    assert_eq!(succeed(&reference).stderr, "");
    assert_eq!(succeed(&arguments[..arguments.len() - 1]).stderr, "");
}

#[test]
fn cameras_in_walls_and_before_nothing() {
    let folder = Folder::new();
    // A closed box seen from outside shows fronts only; from inside, backs only: its faces look outwards.
    let mut gltf = Gltf::new();
    let corner = |i: u16| [f32::from(i & 1), f32::from(i >> 1 & 1), f32::from(i >> 2)];
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let positions = gltf.vec3(&positions);
    let faces: [[u16; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices: Vec<u8> =
        faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).flat_map(u16::to_le_bytes).collect();
    let indices = gltf.accessor(&indices, U16, "SCALAR", 36);
    let material = gltf.push("materials", diffuse([0.5; 3], [0.0; 3]));
    let primitive =
        serde_json::json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": material });
    let mesh = gltf.push("meshes", serde_json::json!({ "primitives": [primitive] }));
    gltf.root(serde_json::json!({ "mesh": mesh }));
    let cube = folder.write("cube.glb", gltf.glb());
    let baked = bake(&folder, &cube, "--env 1,1,1 --set grid.divisions=(3,3,3)");
    let output = folder.path().join("out");
    let look = |view: &str| {
        let arguments = [
            "render",
            text(&cube),
            text(&baked.path),
            "-o",
            text(&output),
            "--size",
            "16x9",
            "--env",
            "1,1,1",
            "--look-at",
        ];
        succeed(&[&arguments[..], &[view]].concat()).stderr
    };
    assert!(look("0.5,0.5,0.5,0.5,0.5,0").contains("backs of surfaces"));
    assert!(look("5,5,5,9,9,9").contains("sees no surface"));
    assert_eq!(look("5,5,5,0,0,0"), "");
}

/// Mean luminance of the interior texels of all active probes, as a reader of the file finds it.
fn stored_energy(baked: &crate::program::Bake) -> f64 {
    let file = &baked.file;
    let (border, resolution) = (file.border(), file.resolution());
    let active = file.active();
    let mut sum = 0.0;
    for &probe in &active {
        for texel in 0..resolution * resolution {
            let [r, g, b] = file.stored(probe, texel / resolution + border, texel % resolution + border);
            sum += 0.2126 * r + 0.7152 * g + 0.0722 * b;
        }
    }
    sum / (active.len() * resolution * resolution) as f64
}

#[test]
fn the_last_energy_is_that_of_the_file() {
    let folder = Folder::new();
    for (name, words) in [
        ("cornell", "--set grid.divisions=(4,4,4) --set encoding.irradiance=f32"),
        ("cornell", "--set grid.divisions=(4,4,4) --set encoding.irradiance=f32 --set capture.emission=gathered"),
        (
            "courtyard",
            "--set grid.spacing_m=6 --set encoding.irradiance=f32 --env 0.5,0.7,1 --set solver.max_bounces=3",
        ),
    ] {
        let baked = bake_physical(&folder, &scene(name), words);
        let last = baked.report["bounces"].as_array().unwrap().last().unwrap()["energy"].as_f64().unwrap();
        // Sums of f32 in another order.
        assert!(
            (last / stored_energy(&baked) - 1.0).abs() < 1e-5,
            "{name} {words}: {last} of {}",
            stored_energy(&baked)
        );
    }
}

#[test]
fn a_dry_run_foretells_all_that_is_large() {
    let rooms = scene("two_rooms_open");
    let predict = |words: &[&str]| -> Value {
        succeed(
            &[
                &["bake", text(&rooms), "--dry-run", "--json", "--preset", "physical", "--set", "grid.spacing_m=1.5"],
                words,
            ]
            .concat(),
        )
        .json()
    };
    let small = predict(&[]);
    let large = predict(&["--set", "filter.irradiance_resolution=64"]);
    let number = |json: &Value, key: &str| json[key].as_f64().unwrap_or_else(|| panic!("no {key} in {json}"));
    let probes = number(&small, "probes");
    // At least the maps themselves, four floats a texel; the captures stay the same.
    let maps = |json: &Value| number(json, "predicted_map_bytes");
    assert!(maps(&large) - maps(&small) > probes * (66.0 * 66.0 - 100.0) * 16.0);
    assert_eq!(number(&large, "predicted_capture_bytes"), number(&small, "predicted_capture_bytes"));
    let parts = ["predicted_capture_bytes", "predicted_map_bytes", "predicted_scene_bytes"];
    let sum = parts.iter().map(|p| number(&small, p)).sum::<f64>();
    assert_eq!(sum.max(number(&small, "predicted_survey_bytes")), number(&small, "predicted_memory_bytes"));
    let parts = number(&small, "predicted_survey_s")
        + number(&small, "predicted_capture_s")
        + number(&small, "predicted_bounces") * number(&small, "predicted_bounce_s")
        + number(&small, "predicted_fit_s");
    assert!((parts / number(&small, "predicted_time_s") - 1.0).abs() < 1e-9);
}

#[test]
fn probes_stand_out_in_the_dark() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_sealed");
    let baked = bake(&folder, &rooms, "--set grid.spacing_m=1.5 --set solver.max_bounces=2");
    render(&folder, &rooms, &baked.path, "out", "--camera dark --size 320x180");
    let picture = image::open(folder.path().join("out/probes.png")).unwrap().into_rgb8();
    assert_eq!(picture.width(), 320);
    assert!(picture.height() > 180, "no key below the picture");
    // All light of this room has leaked: without rims all of it is black.
    let light = picture.enumerate_pixels().filter(|(_, y, pixel)| *y < 180 && pixel.0.iter().all(|&c| c > 150)).count();
    assert!(light > 50, "{light} light pixels");
}
