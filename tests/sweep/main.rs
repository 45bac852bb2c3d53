//! `sweep` as its users meet it: the built program on a scene of the repository, at sizes that take seconds.

#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code)]
#[path = "../pipeline/probe_file.rs"]
mod probe_file;
#[allow(dead_code)]
#[path = "../pipeline/program.rs"]
mod program;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use common::Folder;
use program::{Run, command, names_in, refuse, run, scene, succeed, text};
use serde_json::Value;

/// Two grids, two captures: four configurations of less than a second.
const LADDER: &str = "(ladders: [(name: \"tiny\", set: [\"placement.rays=32\", \"solver.max_bounces=4\"], axes: [
    (key: \"grid.spacing_m\", values: [2.0, 1.5]), (key: \"capture.resolution\", values: [4, 8]),
])])";

const COMMON: &str = "--size 32x18 --reference 32 --seeds 2";

/// A sweep of the two open rooms into `folder`/`name`.
fn arguments(folder: &Folder, name: &str, words: &str) -> Vec<String> {
    let (scene, output) = (scene("two_rooms_open"), folder.path().join(name));
    let start = ["sweep", text(&scene), "-o", text(&output), "--no-progress"];
    start.into_iter().chain(words.split_whitespace()).map(str::to_owned).collect()
}

fn ladder(folder: &Folder, text_of_it: &str) -> PathBuf {
    folder.write("ladder.ron", text_of_it)
}

fn sweep(folder: &Folder, name: &str, words: &str) -> Run {
    succeed(&arguments(folder, name, words))
}

fn report(folder: &Folder, name: &str) -> Value {
    let path = folder.path().join(name).join("sweep.json");
    serde_json::from_slice(&std::fs::read(path).expect("a report")).expect("JSON")
}

/// A report without what depends on the clock.
fn timeless(mut value: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(map) => {
                map.retain(|key, _| {
                    !["command_line", "time_s", "bake_s", "shade_ms", "lookup_ns"].contains(&key.as_str())
                });
                map.values_mut().for_each(strip);
            }
            Value::Array(list) => list.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut value);
    value
}

/// Bytes of every finished run, by name.
fn runs(folder: &Folder, name: &str) -> BTreeMap<String, Vec<u8>> {
    let runs = folder.path().join(name).join("runs");
    let names = if runs.is_dir() { names_in(&runs) } else { Vec::new() };
    names
        .into_iter()
        .filter(|n| n.ends_with(".json"))
        .map(|n| (n.clone(), std::fs::read(runs.join(n)).unwrap()))
        .collect()
}

fn list<'v>(value: &'v Value, key: &str) -> &'v Vec<Value> {
    value[key].as_array().unwrap_or_else(|| panic!("no list '{key}'"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_sweep_writes_report_table_and_plots() {
    let folder = Folder::new();
    // The shares of bake and interpolation are known of probes that hold the light where they stand.
    let words = format!("{COMMON} --preset physical --ladder {}", text(&ladder(&folder, LADDER)));
    let shown = sweep(&folder, "out", &words);
    for part in ["tiny spacing_m=1.5 resolution=8", "cheapest configuration", "interpolation", "wrote"] {
        assert!(shown.stdout.contains(part), "no '{part}' in {}", shown.stdout);
    }
    let out = folder.path().join("out");
    let report = report(&folder, "out");
    assert_eq!((&report["schema"], &report["command"]), (&"lightprobe-sweep/1".into(), &"sweep".into()));
    assert_eq!(report["reference"]["spp"], 32);
    let configurations = list(&report, "configurations");
    assert_eq!(configurations.len(), 4);
    for configuration in configurations {
        assert_eq!(list(configuration, "runs").len(), 2);
        for (name, figure) in configuration["figures"].as_object().expect("figures") {
            // Each is known here but those of a dark region, which the picture has not, and of gloss, which these probes have not.
            // Its mean lies between its ends.
            if ["leak_dark_region", "error_gltf", "relmse_gltf", "glossy_shade_ms", "glossy_bytes_per_probe"]
                .contains(&name.as_str())
            {
                continue;
            }
            let [min, mean, max] = ["min", "mean", "max"].map(|part| number(&figure[part]));
            let rounding = 1e-12 * mean.abs();
            assert!(min <= mean + rounding && mean <= max + rounding, "{name}: {figure}");
        }
        let (noise, bias) = (number(&configuration["noise_rms"]), number(&configuration["bias_rms"]));
        let ruled = if noise > bias { "noise" } else { "bias" };
        assert_eq!(configuration["ruled_by"], ruled);
        // Noise and bias make up the mean of the squared errors: with two seeds exactly, but for what is clamped at 0.
        let squares: Vec<f64> =
            list(configuration, "runs").iter().map(|run| number(&run["methods"][1]["error"]["rmse"]).powi(2)).collect();
        let mean = squares.iter().sum::<f64>() / 2.0;
        assert!(((noise * noise + bias * bias) / mean - 1.0).abs() < 1e-3, "{noise} {bias} {mean}");
    }
    let of = |i: usize, figure: &str| number(&configurations[i]["figures"][figure]["mean"]);
    for cost in ["bake_s", "bytes"] {
        let levels = report["cheapest"][cost].as_array().expect("levels");
        assert!(!levels.is_empty());
        for level in levels {
            let (limit, chosen) = (number(&level["error_relative"]), level["configuration"].as_u64().unwrap() as usize);
            assert!(of(chosen, "error_relative") <= limit);
            assert!((0..4).all(|i| of(i, "error_relative") > limit || of(i, cost) >= of(chosen, cost)), "{level}");
        }
    }
    let ladders = list(&report, "ladders");
    let best = ladders[0]["best"].as_u64().expect("a best") as usize;
    assert!((0..4).all(|i| of(i, "error_relative") >= of(best, "error_relative")));
    let floor = &list(&report, "floor")[0];
    let causes: Vec<&str> = list(floor, "causes").iter().map(|c| c["cause"].as_str().unwrap()).collect();
    let expected = ["angular_resolution", "bounces", "leaks_in_shading", "encoding", "bake", "interpolation"];
    assert_eq!(causes, expected);
    for cause in list(floor, "causes") {
        let (all, share) = (number(&floor["error_relative"]), number(&cause["share"]));
        match cause["error_relative"].as_f64() {
            Some(left) => assert!((share - (1.0 - (left / all).powi(2))).abs() < 1e-9, "{cause}"),
            None => assert!(cause["cause"] == "interpolation" && share > 1.0, "{cause}"),
        }
    }

    let table = std::fs::read_to_string(out.join("sweep.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len(), 1 + 4 * 2 * 3);
    assert!(rows.iter().skip(1).all(|row| row.starts_with("tiny,physical,")), "{table}");
    for name in ["error_time", "error_bytes", "error_shading", "leak_bytes"] {
        let svg = std::fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("sans-serif") && svg.contains("tiny"), "{name}");
        let picture = lightprobe::image::Picture8::read_png(&out.join(format!("{name}.png"))).unwrap();
        assert_eq!((picture.width, picture.height), (900, 540));
    }
    assert!(!names_in(&out.join("runs")).iter().any(|name| name.ends_with(".probes")), "scratch files are gone");
}

#[test]
fn an_interrupted_sweep_goes_on_to_the_same_report() {
    let folder = Folder::new();
    let words = format!("{COMMON} --ladder {}", text(&ladder(&folder, LADDER)));
    let straight = {
        sweep(&folder, "straight", &words);
        timeless(report(&folder, "straight"))
    };
    let mut child = command()
        .args(arguments(&folder, "killed", &words))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    // Until two runs are whole; a sweep that ends before has an exit status, which fails below.
    while runs(&folder, "killed").len() < 2 && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("SIGKILL");
    assert_eq!(child.wait().expect("a child").code(), None, "it ended before it was killed");
    let before = runs(&folder, "killed");
    assert!(before.len() >= 2 && !folder.path().join("killed/sweep.json").exists());

    let shown = sweep(&folder, "killed", &words);
    assert!(shown.stdout.contains(&format!("{} runs kept", before.len())), "{}", shown.stdout);
    let after = runs(&folder, "killed");
    assert!(before.iter().all(|(name, bytes)| after.get(name) == Some(bytes)), "kept runs stay as they were");
    assert_eq!(timeless(report(&folder, "killed")), straight);
    assert_eq!(after.keys().collect::<Vec<_>>(), runs(&folder, "straight").keys().collect::<Vec<_>>());
}

#[test]
fn changed_inputs_make_anew_what_depends_on_them_and_nothing_else() {
    let folder = Folder::new();
    let ladder = ladder(&folder, LADDER);
    // All four causes of a floor are runs of their own: with a fit one is not measured.
    let words = format!("--size 32x18 --preset physical --ladder {}", text(&ladder));
    let first = format!("{words} --reference 32 --seeds 1");
    sweep(&folder, "out", &first);
    let (before, straight) = (runs(&folder, "out"), timeless(report(&folder, "out")));
    let new = |before: &BTreeMap<String, Vec<u8>>| -> usize {
        let after = runs(&folder, "out");
        assert!(before.iter().all(|(name, bytes)| after.get(name) == Some(bytes)), "old runs stay");
        after.keys().collect::<BTreeSet<_>>().difference(&before.keys().collect()).count()
    };
    // Nothing changed.
    assert!(sweep(&folder, "out", &first).stdout.contains("4 runs kept"));
    assert_eq!(new(&before), 0);
    assert_eq!(timeless(report(&folder, "out")), straight);
    // Another seed: a run more of each configuration, and no other floor, which is that of the first seed; unless the mean of both
    // makes another configuration the best, whose four runs then come to it.
    sweep(&folder, "out", &format!("{words} --reference 32 --seeds 2"));
    assert!([4, 8].contains(&new(&before)), "{}", new(&before));
    // Another value at the end of an axis.
    let before = runs(&folder, "out");
    folder.write("ladder.ron", LADDER.replace("[4, 8]", "[4, 8, 6]"));
    let shown = sweep(&folder, "out", &first);
    assert!(shown.stdout.contains("4 runs kept"), "{}", shown.stdout);
    assert!([2, 6].contains(&new(&before)), "{}", new(&before));
    folder.write("ladder.ron", LADDER);

    // A better reference: it gets more samples, and all runs are compared with it anew.
    let before = runs(&folder, "out");
    let shown = sweep(&folder, "out", &format!("{words} --reference 48 --seeds 1"));
    assert!(!shown.stdout.contains("kept") && shown.stderr.is_empty(), "{} {}", shown.stdout, shown.stderr);
    assert_eq!((new(&before), &report(&folder, "out")["reference"]["spp"]), (8, &48.into()));
    // A sky: another scene, another reference.
    let before = runs(&folder, "out");
    let shown = sweep(&folder, "out", &format!("{first} --env 1,1,1"));
    assert!(shown.stderr.contains("reference anew") && !shown.stdout.contains("kept"), "{}", shown.stderr);
    assert_eq!(new(&before), 8);
}

#[test]
fn damaged_runs_are_made_anew_with_a_warning() {
    let folder = Folder::new();
    let words = format!("--size 32x18 --reference 32 --seeds 1 --ladder {}", text(&ladder(&folder, LADDER)));
    sweep(&folder, "out", &words);
    let straight = timeless(report(&folder, "out"));
    let pictures = folder.path().join("out/runs");
    let picture = names_in(&pictures).into_iter().find(|name| name.ends_with(".exr")).expect("a picture");
    std::fs::write(pictures.join(&picture), "cut off").unwrap();
    let json = picture.replace(".exr", ".json");
    let other = names_in(&pictures).into_iter().find(|n| n.ends_with(".json") && *n != json).expect("another run");
    std::fs::write(pictures.join(&other), "{").unwrap();
    let shown = sweep(&folder, "out", &words);
    for name in [json, other] {
        assert!(shown.stderr.contains(&name), "{}", shown.stderr);
    }
    assert_eq!(shown.stderr.lines().count(), 2, "{}", shown.stderr);
    assert_eq!(timeless(report(&folder, "out")), straight);
}

#[test]
fn methods_are_compared_at_equal_cost() {
    let folder = Folder::new();
    let plain =
        folder.write("plain.ron", "(query: (visibility: none), placement: (rays: 32), solver: (max_bounces: 2))");
    // Maps of 18² texels of 12 bytes: ten times the bytes of the other and more.
    let fine = "(query: (visibility: surface(voxels_per_cell: 4)), grid: (spacing_m: 0.1), solver: (max_bounces: 2),
        store: (irradiance: octahedral(format: f32, resolution: 16)))";
    let fine = folder.write("fine.ron", fine);
    let axis = "(ladders: [(name: \"grid\", set: [\"capture.resolution=4\"], axes: [(key: \"grid.spacing_m\", values: [2.5, 2.0])])])";
    let words = format!(
        "--size 32x18 --reference 32 --seeds 1 --config {} --config {} --ladder {}",
        text(&plain),
        text(&fine),
        text(&ladder(&folder, axis))
    );
    let shown = sweep(&folder, "out", &format!("{words} --equal bytes"));
    assert!(shown.stdout.contains("at equal bytes") && shown.stdout.contains("does not fit"), "{}", shown.stdout);
    let by_bytes = report(&folder, "out");
    let names: Vec<&Value> = list(&by_bytes, "ladders").iter().map(|l| &l["name"]).collect();
    assert_eq!(names, ["plain: grid", "fine: grid"]);
    let budgets = list(&by_bytes["equal"], "budgets");
    for entry in budgets.iter().flat_map(|budget| list(budget, "entries")) {
        assert_eq!(entry["fits"] == true, !entry["error_relative"].is_null(), "{entry}");
    }
    let least = |ladder: u64| {
        let of = list(&by_bytes, "configurations").iter().filter(|c| c["ladder"] == ladder);
        of.map(|c| number(&c["figures"]["bytes"]["mean"])).fold(f64::INFINITY, f64::min)
    };
    for budget in budgets {
        for ladder in 0..2 {
            let fits = least(ladder) <= number(&budget["bytes"]);
            assert_eq!(budget["entries"][ladder as usize]["fits"], fits, "{budget}");
        }
    }

    // The second takes the placement of the first, all else stays its own.
    sweep(&folder, "out", &format!("{words} --equal positions"));
    let by_positions = report(&folder, "out");
    let sets = list(&by_positions["equal"], "sets");
    assert_eq!(sets.len(), 2);
    for set in sets {
        let [a, b] = &list(set, "entries")[..] else { panic!("{set}") };
        assert_eq!(a["same_probes"], true);
        let config = |entry: &Value| {
            let index = entry["configuration"].as_u64().unwrap() as usize;
            let text = by_positions["configurations"][index]["config"].as_str().unwrap().to_owned();
            lightprobe::config::Config::parse(&text, "report").unwrap()
        };
        let (a, b) = (config(a), config(b));
        // Bounds and spacing are shared; placement is each method's own.
        assert_eq!(a.grid, b.grid);
        assert_ne!(a.query, b.query);
    }
}

/// Every preset that is a method has a row and a picture; `path` has none.
#[test]
fn all_methods_are_compared_in_one_table_and_one_picture() {
    let folder = Folder::new();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes/two_rooms_open.ron");
    // Few probes: presets that store much are quick too.
    let words = format!("--preset all --config {} --set grid.spacing_m=3 --equal positions", text(&config));
    let shown = sweep(&folder, "out", &format!("{words} --size 32x18 --reference 32 --seeds 1"));
    for part in ["in corners", "dark region", "memory per probe", "at equal positions"] {
        assert!(shown.stdout.contains(part), "no '{part}' in {}", shown.stdout);
    }
    let report = report(&folder, "out");
    let labels: Vec<&str> = list(&report, "configurations").iter().map(|c| c["label"].as_str().unwrap()).collect();
    let names: Vec<&str> = lightprobe::config::presets::methods().map(|preset| preset.name).collect();
    assert!(
        labels == names && ["default", "physical"].iter().all(|name| names.contains(name)) && !names.contains(&"path"),
        "{labels:?}"
    );
    assert!(list(&report, "floor").is_empty());
    for configuration in list(&report, "configurations") {
        let figures = &configuration["figures"];
        for figure in
            ["error_nrmse", "error_corner", "error_flat", "leak_blocks", "outside_hull", "air_error", "air_black"]
        {
            assert!(number(&figures[figure]["mean"]) >= 0.0, "{figure}: {figures}");
        }
        assert_eq!(figures["error_nrmse"]["mean"], figures["error_relative"]["mean"]);
    }
    // Pictures of 32×18, ten times as large, in rows of at most four below labels of 40 px and above their maps.
    let sheet = lightprobe::image::Picture8::read_png(&folder.path().join("out/contact.png")).unwrap();
    let rows = (names.len() as u32 + 1).div_ceil(4);
    assert_eq!(sheet.height, rows * (40 + 2 * 180 + 12) + 82);
    assert!(sheet.width >= 2 * (320 + 12) + 12, "{}", sheet.width);
}

#[test]
fn offsets_shift_the_grid_and_give_geometric_means() {
    let folder = Folder::new();
    let words =
        "--size 32x18 --reference 32 --set placement.rays=32 --set solver.max_bounces=2 --set capture.resolution=4";
    let words = format!("{words} --set grid.spacing_m=1.5 --seeds 2 --offsets 3");
    let shown = sweep(&folder, "out", &words);
    assert!(shown.stdout.contains("geometric means over 3 offsets"), "{}", shown.stdout);
    let report = report(&folder, "out");
    let offsets = list(&report, "offsets");
    assert_eq!(offsets.len(), 3);
    let configuration = &list(&report, "configurations")[0];
    let runs = list(configuration, "runs");
    // Two seeds on each of three grids, whose probes stand elsewhere.
    let places: BTreeSet<&str> = runs.iter().map(|run| run["probes_blake3"].as_str().unwrap()).collect();
    assert!(runs.len() == 6 && places.len() >= 3, "{places:?}");
    for (i, run) in runs.iter().enumerate() {
        assert_eq!(run["offset"], offsets[i / 2]);
    }
    let errors: Vec<f64> = runs.iter().map(|run| number(&run["methods"][1]["error_relative"])).collect();
    let geometric = (errors.iter().map(|e| e.ln()).sum::<f64>() / 6.0).exp();
    let figure = &configuration["figures"]["error_relative"];
    assert!((number(&figure["geometric_mean"]) / geometric - 1.0).abs() < 1e-9, "{figure}");
    assert!((number(&figure["mean"]) / (errors.iter().sum::<f64>() / 6.0) - 1.0).abs() < 1e-9, "{figure}");
    // Another sweep goes on with more grids, and keeps what it has.
    let more = sweep(&folder, "out", &words.replace("--offsets 3", "--offsets 4"));
    assert!(more.stdout.contains("6 runs kept"), "{}", more.stdout);
}

#[test]
fn what_cannot_be_swept_is_refused_before_any_work() {
    let folder = Folder::new();
    let with = |name: &str, words: &str| arguments(&folder, name, &format!("{words} --size 32x18"));
    let ladder_of = |name: &str, content: &str| text(&folder.write(name, content)).to_owned();
    let unknown = ladder_of("a.ron", "(ladders: [(name: \"x\", axes: [(key: \"grid.spacing\", values: [1])])])");
    let unlike =
        ladder_of("b.ron", "(ladders: [(name: \"x\", axes: [(key: \"solver.albedo_max\", values: [0.5, 0.9])])])");
    let large = ladder_of("c.ron", "(ladders: [(name: \"x\", axes: [(key: \"grid.spacing_m\", values: [1, 0.001])])])");
    let own = ladder_of("d.ron", "(ladders: [(name: \"x\", preset: \"default\")])");
    for (words, parts) in [
        (format!("--ladder {unknown}"), &["a.ron", "'x'", "'spacing_m'"][..]),
        (format!("--ladder {unlike}"), &["materials.albedo_max", "0.5", "0.9", "reference"]),
        (format!("--ladder {large}"), &["x spacing_m=0.001", "spacing_m"]),
        (format!("--ladder {own} --preset default"), &["--preset", "leave them out"]),
        ("--ladder /nowhere/a.ron".to_owned(), &["/nowhere/a.ron"]),
        ("--preset defualt".to_owned(), &["default"]),
        ("--preset default --preset default".to_owned(), &["'default'"]),
        ("--camera all".to_owned(), &["--camera all"]),
    ] {
        let message = refuse(&with("refused", &words));
        assert!(parts.iter().all(|part| message.contains(part)), "{words}: {message}");
    }
    assert!(!folder.path().join("refused").exists(), "nothing is written");
    // The ladder may not be one of the files that are written.
    let inside = folder.path().join("inside");
    std::fs::create_dir(&inside).unwrap();
    std::fs::write(inside.join("sweep.json"), LADDER).unwrap();
    let message = refuse(&with("inside", &format!("--ladder {}", text(&inside.join("sweep.json")))));
    assert!(message.contains("the ladder"), "{message}");
    let usage = run(&with("refused", "--seeds 0"));
    assert_eq!(usage.code, Some(2), "{}", usage.stderr);
}

/// Every ladder of the project fits its program: expanded, checked, one configuration of each kind named.
#[test]
fn the_ladders_of_the_project_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/sweeps");
    let method = || [lightprobe::sweep::method::Method::new(None, &[]).unwrap()];
    let mut most = 0;
    for name in names_in(&folder) {
        let file = lightprobe::sweep::ladder::LadderFile::read(&folder.join(&name)).unwrap_or_else(|e| panic!("{e}"));
        let ladders =
            lightprobe::sweep::ladder::expand(Some(&file), &method(), &[], |_| {}).unwrap_or_else(|e| panic!("{e}"));
        let rungs: Vec<_> = ladders.iter().flat_map(|ladder| &ladder.rungs).collect();
        let configurations: BTreeSet<String> = rungs.iter().map(|rung| rung.config.to_ron()).collect();
        // Only the default's own place may be met by several ladders.
        assert!(rungs.len() >= 4 && rungs.len() - configurations.len() < ladders.len(), "{name}");
        most = most.max(configurations.len());
    }
    assert!(most >= 24, "{most}");
}
