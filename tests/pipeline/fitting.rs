//! The fit as users meet it: files, reports, refusals.

use std::f64::consts::PI;

use serde_json::Value;

use crate::common::Folder;
use crate::probe_file::ProbeFile;
use crate::program::{bake, bake_physical, method, refuse, render, scene, succeed, text};

/// Over the preset physical, so that each part of what the default has is asked for by itself.
/// So few rows tie maps down only where these are firm: with a lambda of 0.01 the air errs more after the fit than before.
const COARSE: &str = "--preset physical --set grid.spacing_m=1.5 --set fit=rows(rows_per_probe:30,paths:4,lambda:0.03)";
const SH: &str = "--set store.irradiance=sh9(format:f16,gradient:true)";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// Numbers of an f16 tensor.
fn halves(file: &ProbeFile, tensor: &str) -> Vec<f64> {
    let scale: f64 = file.metadata["scale.irradiance"].parse().unwrap();
    let numbers = file.tensors[tensor].bytes.as_chunks::<2>().0;
    numbers.iter().map(|b| f64::from(half::f16::from_le_bytes(*b)) * scale).collect()
}

#[test]
fn a_fit_brings_look_ups_nearer_to_the_truth_for_any_number_of_threads() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let plain = bake_physical(&folder, &rooms, "--set grid.spacing_m=1.5");
    assert!(plain.report["fit"].is_null() && !plain.file.metadata.contains_key("fit"));
    // Also where there is none: given as --config, the stored configuration lies over the preset default, which has one.
    assert!(plain.file.metadata["config"].contains("fit: none"));
    let error = |path: &std::path::Path, name: &str| {
        let report = render(&folder, &rooms, path, name, "--camera lit --size 48x27 --reference 64 --seed 9");
        number(&method(&report, "visibility_on")["error"]["nrmse"])
    };
    let before = error(&plain.path, "plain");
    for (store, name) in [("", "maps"), (SH, "sh")] {
        let fitted = bake(&folder, &rooms, &format!("{COARSE} {store} --threads 1"));
        let two = bake(&folder, &rooms, &format!("{COARSE} {store} --threads 2"));
        assert!(fitted.bytes == two.bytes, "threads change the file");
        let fit = &fitted.report["fit"];
        assert!(number(&fit["held_out_after"]) < 0.6 * number(&fit["held_out_before"]), "{fit}");
        assert!(number(&fit["held_out_bent_after"]) < 0.6 * number(&fit["held_out_bent_before"]), "{fit}");
        assert!(number(&fit["air_after"]) < number(&fit["air_before"]), "{fit}");
        assert!(number(&fit["rows"]) > 10.0 * number(&fitted.report["probes_active"]), "{fit}");
        // 4 and at most 10 where there are 150 rows a probe; here each stands for 5.
        assert!((20.0..50.0).contains(&number(&fit["paths"])), "{fit}");
        assert!(number(&fit["negative_share"]) < 0.01 && number(&fit["time_s"]) > 0.0, "{fit}");
        // In the report, and in the file without what differs from run to run.
        let recorded: Value = serde_json::from_str(&fitted.file.metadata["fit"]).unwrap();
        assert_eq!(recorded["held_out_after"], fit["held_out_after"]);
        assert_eq!(recorded["held_out_bent_after"], fit["held_out_bent_after"]);
        assert!(recorded["time_s"].is_null());
        // At points and by paths that the fit has not seen.
        let after = error(&fitted.path, name);
        assert!(after < 0.6 * before, "{name}: {before} became {after}");
    }
}

/// The gradient in the file, read by its description: Y₀·g·(x − q)/s is added beside a probe, nothing at it.
#[test]
fn gradients_are_stored_and_counted() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let plain = bake_physical(&folder, &rooms, &format!("--set grid.spacing_m=2 {SH}"));
    let maps = bake_physical(&folder, &rooms, "--set grid.spacing_m=2");
    let fitted = bake(&folder, &rooms, &format!("{COARSE} {SH} --set grid.spacing_m=2"));
    let probes = fitted.file.states().len();
    assert_eq!(fitted.file.tensors["gradient"].shape, [probes, 3, 3]);
    assert_eq!(fitted.file.tensors["sh"].shape, [probes, 9, 3]);
    let bytes = |bake: &crate::program::Bake| number(&bake.report["bytes_per_probe"]["runtime"]);
    // 72 bytes in place of 10² texels of 4.
    assert!((bytes(&maps) - bytes(&fitted) - (400.0 - 72.0)).abs() < 1e-6);
    assert!(halves(&plain.file, "gradient").iter().all(|g| *g == 0.0), "only a fit knows gradients");
    let active = fitted.file.active();
    let gradients = halves(&fitted.file, "gradient");
    assert!(active.iter().any(|p| gradients[9 * p] != 0.0));
    // `inspect` asks at the probes themselves.
    let coefficients = halves(&fitted.file, "sh");
    let probe = active[active.len() / 2];
    let listed = succeed(&["inspect", text(&fitted.path), "--json", "--probe", &probe.to_string()]).json();
    assert!(listed["encoding"]["irradiance"].as_str().unwrap().contains("gradient"));
    let own = &coefficients[27 * probe..][..27];
    // Around +Z the functions are 1, z and 3z² − 1.
    let [y0, y2, y6] = [(0.25 / PI).sqrt(), (0.75 / PI).sqrt(), 2.0 * (5.0 / (16.0 * PI)).sqrt()];
    let up = listed["probe"]["irradiance"].as_object().unwrap();
    let (_, up) = up.iter().find(|(name, _)| name.as_str() == "+z").expect("a direction");
    for channel in 0..3 {
        let expected = (y0 * own[channel] + y2 * own[6 + channel] + y6 * own[18 + channel]).max(0.0);
        assert!((number(&up[channel]) - expected).abs() < 1e-4 * expected.max(0.1), "{up} {expected}");
    }
}

#[test]
fn fitted_values_are_no_light_at_the_probes() {
    let folder = Folder::new();
    let rooms = scene("two_rooms_open");
    let view = "--camera lit --size 16x9 --bake-error";
    let set = "--set grid.spacing_m=2 --set capture.rays.octahedral.resolution=8";
    let fitted = bake(&folder, &rooms, &format!("{COARSE} {set}"));
    let report = render(&folder, &rooms, &fitted.path, "fitted", view);
    assert!(report["baked"].is_null() && method(&report, "visibility_on")["leak"]["baked"].is_null());
    assert!(report["baked_reason"].as_str().unwrap().contains("fitted"));
    let plain = bake_physical(&folder, &rooms, set);
    let report = render(&folder, &rooms, &plain.path, "plain", view);
    assert!(report["baked"]["light"].is_number() && report["baked_reason"].is_null());
}

#[test]
fn look_ups_that_are_no_sums_are_refused() {
    let refused = |set: &str| {
        let mut words = vec!["bake", "--print-config", "--preset", "physical", "--set", "fit=rows()", "--set", set];
        words.extend(["--set", "query.direction=uniform"]);
        refuse(&words)
    };
    for (set, key) in [
        ("query.blend=square_root", "query.blend must be linear"),
        ("store.irradiance.octahedral.curve=gamma5_over_2pi", "store.irradiance.octahedral.curve must be linear"),
        ("fit.rows.paths=0", "fit.rows.paths"),
        ("fit.rows.lambda=0", "fit.rows.lambda"),
        ("fit.rows.lambada=1", "lambda"),
        ("store.irradiance=sh9(presampled:8,gradient:true)", "store.irradiance.sh9.presampled"),
    ] {
        let message = refused(set);
        assert!(message.contains(key), "{set}: {message}");
    }
}
