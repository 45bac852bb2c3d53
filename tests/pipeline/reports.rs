//! Reports: every key of the contract, of its type, and figures that agree with each other.

use serde_json::{Value, json};

use crate::common::Folder;
use crate::program::{Bake, bake, bake_physical, render, scene, succeed, text};

/// Checks keys (dots separate levels) for numbers that are finite and not negative.
fn numbers(report: &Value, keys: &[&str]) {
    for key in keys {
        let value = report.pointer(&format!("/{}", key.replace('.', "/")));
        let number = value.unwrap_or_else(|| panic!("no key {key}")).as_f64();
        assert!(number.is_some_and(|x| x >= 0.0), "{key} is {value:?}");
    }
}

/// What every report carries.
fn common(report: &Value, command: &str) {
    for key in ["schema", "version", "command", "scene_blake3", "config"] {
        assert!(report[key].as_str().is_some_and(|s| !s.is_empty()), "{key} is {}", report[key]);
    }
    assert_eq!(report["command"], command);
    assert_eq!(report["scene_blake3"].as_str().unwrap().len(), 64);
    numbers(report, &["seed", "threads"]);
    lightprobe::config::Config::parse(report["config"].as_str().unwrap(), "report").expect("a configuration");
    // JSON has no NaN; a printer that lets one through prints a bare word, which would not have parsed.
}

fn tensor_bytes(baked: &Bake, names: &[&str]) -> f64 {
    let length = |name: &&str| baked.file.tensors.get(*name).map_or(0, |t| t.bytes.len());
    names.iter().map(length).sum::<usize>() as f64
}

#[test]
fn bake_reports() {
    let folder = Folder::new();
    let moments = "--set query.visibility={\"moments\":{\"power\":3,\"floor\":0}}";
    for (name, words) in [
        ("furnace", "--set grid.spacing_m=0.8".to_owned()),
        ("cornell", "--set grid.spacing_m=0.5 --set encoding.irradiance=f16".to_owned()),
        ("two_rooms_open", format!("--set grid.spacing_m=1.5 {moments}")),
        ("glossy_room", "--set grid.spacing_m=1.5 --set encoding.border=0 --seed 5 --measure-raw".to_owned()),
        ("cornell", "--set query.visibility=none --set grid.spacing_m=0.5 --set encoding.irradiance=f32".to_owned()),
    ] {
        let baked = bake_physical(&folder, &scene(name), &words);
        let report = &baked.report;
        common(report, "bake");
        numbers(
            report,
            &[
                "probes",
                "probes_active",
                "rays.primary",
                "rays.shadow",
                "time_s.load",
                "time_s.accel_build",
                "time_s.capture",
                "time_s.bounces",
                "time_s.filter",
                "time_s.encode",
                "time_s.write",
                "time_s.total",
                "rays_per_s",
                "peak_memory_bytes",
                "bytes_per_probe.runtime",
                "bytes_per_probe.runtime_kept",
                "bytes_per_probe.file",
                "bytes_per_probe.tensors.irradiance",
                "numerics.non_finite",
                "numerics.clamped.irradiance",
                "numerics.variance_floor_hits",
                "numerics.hits_outside_volume",
                "numerics.probes_inside_geometry",
                "numerics.dropped_triangles",
                "spectral_radius_estimate",
            ],
        );
        let number = |key: &str| report.pointer(&format!("/{}", key.replace('.', "/"))).unwrap().as_f64().unwrap();
        assert_eq!(report["converged"], true);
        assert_eq!(number("numerics.non_finite"), 0.0);
        assert_eq!(number("probes"), baked.file.states().len() as f64);
        assert_eq!(number("probes_active"), baked.file.active().len() as f64);
        let inside = baked.file.states().iter().filter(|&&s| s == 1).count();
        assert_eq!(number("numerics.probes_inside_geometry"), inside as f64);
        let rate = (number("rays.primary") + number("rays.shadow")) / number("time_s.capture");
        // The same two f64 divided.
        assert!((number("rays_per_s") / rate - 1.0).abs() < 1e-9);
        // 32² texels: one ray each of the pilot, one that is even and 1.25 that are guided, rounded by chance; unsure probes are
        // looked at again, and a probe gets no more than it may.
        let rays = number("rays.primary") / (1024.0 * number("probes_active"));
        assert!((2.2..4.5).contains(&rays), "{rays}");
        assert!(report["raw_embree_rays_per_s"].is_null() != words.contains("--measure-raw"));
        let parts = ["load", "accel_build", "capture", "bounces", "filter", "encode", "write"];
        let sum: f64 = parts.iter().map(|p| number(&format!("time_s.{p}"))).sum();
        assert!(sum <= number("time_s.total"), "the parts take {sum} s of {} s", number("time_s.total"));
        assert!(number("peak_memory_bytes") > 1e6);

        let probes = number("probes");
        // Printed with as many digits as f64 needs, read back by a parser that may err in the last.
        assert!((number("bytes_per_probe.file") * probes / baked.bytes.len() as f64 - 1.0).abs() < 1e-9);
        for (name, bytes) in report["bytes_per_probe"]["tensors"].as_object().unwrap() {
            let per_probe = tensor_bytes(&baked, &[name]) / probes;
            assert!((bytes.as_f64().unwrap() - per_probe).abs() <= 1e-9 * per_probe, "{name}");
        }
        assert_eq!(report["bytes_per_probe"]["tensors"].as_object().unwrap().len(), baked.file.tensors.len());
        // The formula for the layout at run time against the tensors themselves: all of them, as probes have moved.
        let stored: Vec<&str> = baked.file.tensors.keys().map(String::as_str).collect();
        let runtime = tensor_bytes(&baked, &stored) / probes;
        assert!((number("bytes_per_probe.runtime_kept") / runtime - 1.0).abs() < 1e-9, "{name} {words}");
        assert!(number("bytes_per_probe.runtime") >= number("bytes_per_probe.runtime_kept"));

        bounces(report);
        for line in report["plan"].as_array().unwrap() {
            assert!(line["stage"].is_string() && line["reason"].is_string() && line["kept"].is_boolean(), "{line}");
            for key in ["saved_bytes", "saved_s"] {
                let value = line.get(key).unwrap_or_else(|| panic!("{line} has no {key}"));
                assert!(value.is_null() || value.as_f64().is_some_and(|x| x >= 0.0), "{line}");
            }
        }
    }
}

/// Indices count reflections, residuals of plain iterations fall, and the solver's figures fit the iterations.
fn bounces(report: &Value) {
    let bounces = report["bounces"].as_array().unwrap();
    let figure = |i: usize, key: &str| bounces[i][key].as_f64().unwrap_or_else(|| panic!("{key} of bounce {i}"));
    let accelerated = |i: usize| bounces[i]["accelerated"].as_bool().unwrap();
    assert!(bounces.len() > 2);
    for i in 0..bounces.len() {
        assert_eq!(figure(i, "index"), (i + 1) as f64);
        if i > 0 && !accelerated(i) {
            assert!(figure(i, "residual") < figure(i - 1, "residual"), "the residual grows at bounce {i}");
            // Light only ever adds; f32 texels.
            assert!(figure(i, "energy") >= figure(i - 1, "energy") * (1.0 - 1e-6), "energy falls at bounce {i}");
        }
    }
    let solver = |key: &str| report["solver"][key].as_f64().unwrap_or_else(|| panic!("solver.{key}"));
    let combined = (0..bounces.len()).filter(|&i| accelerated(i)).count();
    assert_eq!(solver("accelerated"), combined as f64);
    // One application more, to even light, tells the spectral radius where iterations are combined.
    assert_eq!(solver("operator_applications"), (bounces.len() + usize::from(combined > 0)) as f64);
    let radius = report["spectral_radius_estimate"].as_f64().unwrap();
    let norm = solver("operator_norm");
    assert!(0.0 < radius && radius <= norm && norm < 1.0, "{radius} {norm}");
    // The last residual is relative to the largest texel, as is the bound that follows from it.
    let bound = figure(bounces.len() - 1, "residual") * norm / (1.0 - norm);
    // All three channels of these scenes have their largest change in the one with the largest norm, or nearly.
    assert!(solver("error_bound_relative") <= bound * (1.0 + 1e-6), "{bound}");
    assert!(solver("error_bound") >= 0.0 && solver("plain_fallbacks") >= 0.0 && solver("negative_texels") >= 0.0);
}

#[test]
fn plain_and_combined_iterations_find_the_same_light() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let baked = |how: &str| {
        let words = format!("--set grid.spacing_m=1.5 --set encoding.irradiance=f32 --set solver.acceleration={how}");
        bake_physical(&folder, &rooms, &words)
    };
    let (plain, combined) = (baked("never"), baked("always"));
    let iterations = |baked: &Bake| baked.report["bounces"].as_array().unwrap().len();
    assert!(iterations(&combined) < iterations(&plain), "{} {}", iterations(&combined), iterations(&plain));
    assert_eq!(plain.report["solver"]["accelerated"], 0);
    // Both stop at a ten-thousandth of the largest texel, by an estimate.
    let texels = |baked: &Bake| -> Vec<f64> {
        baked.file.active().iter().flat_map(|&p| baked.file.texels(p)).map(|(_, _, e)| e[0]).collect()
    };
    let (plain, combined) = (texels(&plain), texels(&combined));
    let largest = plain.iter().copied().fold(0.0, f64::max);
    let worst = plain.iter().zip(&combined).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst <= 3e-4 * largest, "{worst} of {largest}");
}

#[test]
fn the_spectral_radius_of_a_furnace_is_its_albedo() {
    let folder = Folder::new();
    let report = bake_physical(&folder, &scene("furnace"), "--set grid.spacing_m=0.5").report;
    let radius = report["spectral_radius_estimate"].as_f64().unwrap();
    // From changes near the solver's tolerance of 1e-4, after a dozen bounces that leave other modes behind.
    assert!((radius - 0.5).abs() < 0.02, "{radius}");
}

#[test]
fn the_report_file_is_the_printed_report() {
    let folder = Folder::new();
    let path = folder.path().join("report.json");
    let baked = bake(&folder, &scene("furnace"), &format!("--set grid.spacing_m=1 --report {}", text(&path)));
    let written: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(written, baked.report);
}

#[test]
fn render_reports() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_open"), "--set grid.spacing_m=1.5 --set solver.max_bounces=4");
    let report = render(&folder, &scene("two_rooms_open"), &baked.path, "run", "--size 96x54 --exposure 1.5 --seed 3");
    common(&report, "render");
    assert_eq!(report["seed"], 3);
    assert_eq!(report["exposure_ev"], 1.5);
    assert_eq!((&report["width"], &report["height"]), (&json!(96), &json!(54)));
    // Indoors every pixel shows a wall.
    assert_eq!(report["points"], 96 * 54);
    let written: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("run/report.json")).unwrap()).unwrap();
    assert_eq!(written, report);
    let methods = report["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["visibility_off", "visibility_on", "visibility_ray"]);
    for method in methods {
        numbers(
            method,
            &[
                "shade_ms.min",
                "shade_ms.median",
                "shade_ms.max",
                "shade_ms.runs",
                "ray_ms",
                "lookup_ns",
                "lookup_spread_ns.min",
                "lookup_spread_ns.median",
                "lookup_spread_ns.max",
                "bytes_per_probe",
                "leak.light",
                "leak.dark",
                "leak.fraction",
                "leak.weight",
                "leak.unseen",
                "leak.blocks",
                "outside_hull",
                "air.points",
                "air.leak_light",
                "air.leak_dark",
                "air.black",
                "air.unseen",
                "bent.points",
            ],
        );
        let shade = |key: &str| method["shade_ms"][key].as_f64().unwrap();
        assert!(shade("min") <= shade("median") && shade("median") <= shade("max"), "{method}");
        for share in ["fraction", "weight", "unseen", "blocks"] {
            assert!(method["leak"][share].as_f64().unwrap() <= 1.0, "{method}");
        }
        assert_eq!(method["bytes_per_probe"], baked.report["bytes_per_probe"]["runtime_kept"]);
    }
    // Exact visibility is what the others are measured against.
    for key in ["leak_light", "leak_dark"] {
        assert_eq!(methods[2]["air"][key], 0.0, "{key}");
    }
    let exact = &methods[2]["leak"];
    for key in ["light", "dark", "fraction", "weight", "blocks"] {
        assert_eq!(exact[key], 0.0, "{key}");
    }
}

#[test]
fn pictures_hold_their_layers_and_these_add_up() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_open"), "--set grid.spacing_m=1.5 --set solver.max_bounces=4");
    render(&folder, &scene("two_rooms_open"), &baked.path, "run", "--size 64x36");
    let run = folder.path().join("run");
    for name in ["visibility_off", "visibility_on", "visibility_ray"] {
        assert!(run.join(format!("{name}.png")).is_file());
        let image = lightprobe::image::LayeredImage::read_exr(&run.join(format!("{name}.exr"))).unwrap();
        let layer = |layer: &str| image.layer(layer).unwrap_or_else(|| panic!("{name} has no layer {layer}"));
        let all = [
            "beauty",
            "emission",
            "direct",
            "indirect",
            "irradiance_direct",
            "irradiance_indirect",
            "albedo",
            "normal",
            "depth",
        ];
        assert!(all.iter().all(|l| layer(l).iter().all(|p| p.is_finite())), "{name}");
        for i in 0..64 * 36 {
            let sum = layer("emission")[i] + layer("direct")[i] + layer("indirect")[i];
            // f32 sums of three.
            assert!((layer("beauty")[i] - sum).length() <= 1e-5 * sum.length() + 1e-7);
            let reflected = layer("albedo")[i] * layer("irradiance_indirect")[i] / std::f32::consts::PI;
            assert!((layer("indirect")[i] - reflected).length() <= 1e-5 * reflected.length() + 1e-7);
            assert!((layer("normal")[i].length() - 1.0).abs() < 1e-4);
            assert!(layer("depth")[i].x > 0.0);
        }
    }
    for file in ["leak.png", "leak.exr", "probes.png", "report.json"] {
        assert!(run.join(file).is_file(), "{file}");
    }
}

#[test]
fn inspect_tells_what_the_file_holds() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("cornell"), "--set grid.spacing_m=0.6");
    let shown = succeed(&["inspect", text(&baked.path), "--json"]).json();
    assert_eq!(shown["probes"], baked.report["probes"]);
    assert_eq!(shown["probes_active"], baked.report["probes_active"]);
    assert_eq!(shown["hashes"], "match");
    assert_eq!(shown["file_bytes"], baked.bytes.len());
    assert_eq!(shown["config"], baked.report["config"]);
    assert_eq!(shown["scene"]["blake3"], baked.report["scene_blake3"]);
    let names: Vec<&String> = shown["tensors"].as_object().unwrap().keys().collect();
    assert_eq!(names, baked.file.tensors.keys().collect::<Vec<_>>());
    for (name, tensor) in &baked.file.tensors {
        let entry = &shown["tensors"][name];
        assert_eq!(entry["dtype"], tensor.dtype.as_str());
        assert_eq!(entry["shape"], json!(tensor.shape));
        assert_eq!(entry["bytes"], tensor.bytes.len());
    }
    // Hashes as the format says: every tensor's own.
    let hashes: Value = serde_json::from_str(&baked.file.metadata["blake3"]).unwrap();
    for (name, tensor) in &baked.file.tensors {
        assert_eq!(hashes[name], blake3::hash(&tensor.bytes).to_hex().as_str(), "{name}");
    }
    let text = succeed(&["inspect", text(&baked.path), "--probe", "0"]).stdout;
    for word in ["irradiance", "grid", "plan", "probe 0 at", "spacing_m"] {
        assert!(text.contains(word), "no '{word}' in {text}");
    }
}
