//! Glossy light of the probes, from levels of radiance and from rays that are traced in them.

use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::program::{Bake, bake, method, refuse, render, run, scene, succeed, text};
use crate::shapes::{add, diffuse, room, save};

const SIZE: &str = "64x36";

/// Small maps of published methods: what they are asked is what counts here, not what they answer.
const LEVELS: &str = "--preset irradiance-2022 --set capture.rays.cube.face=32 --set capture.rays.cube.resolution=32 \
                      --set store.irradiance.octahedral.resolution=8 --set store.prefiltered=[32,16,8,4]";
const MARCH: &str = "--preset mcguire-2017 --set capture.rays.octahedral.resolution=64 --set store.light_field=march(lowest:8) \
                     --set store.irradiance.octahedral.resolution=8 --set store.occlusion.moments.resolution=8";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn plan_line(baked: &Bake) -> Value {
    let lines = baked.report["plan"].as_array().unwrap();
    lines.iter().find(|line| line["stage"] == "radiance_levels").unwrap().clone()
}

/// A closed room of emission 1 that reflects no diffuse light: levels hold 1 everywhere, and what is reflected is what the
/// table says of F0 = 0.04 and roughness 1, between its value along the normal and at grazing views.
#[test]
fn constant_light_is_reflected_as_the_table_says() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.0; 3], [1.0; 3]));
    gltf.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = serde_json::json!(0.5);
    let room = save(gltf, &folder, "room");
    let inside = "--set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.5,-0.5,-0.5],\"max\":[0.5,0.5,0.5]}";
    let baked = bake(&folder, &room, &format!("{LEVELS} {inside}"));
    assert_eq!(plan_line(&baked)["kept"], true);
    let look = format!("--look-at 0,0,0,0,0,-1 --size {SIZE}");
    let reference = folder.path().join("glossy.exr");
    let traced = ["reference", text(&room), "-o", text(&reference), "--spp", "32", "--transport", "gltf", "-q"];
    succeed(&[&traced[..], &look.split(' ').collect::<Vec<_>>()].concat());
    let words = format!("{look} --reference-image {}", text(&reference));
    let report = render(&folder, &room, &baked.path, "constant", &words);
    for name in ["visibility_off", "visibility_on", "visibility_ray"] {
        let glossy = &method(&report, name)["glossy"];
        // Levels of 32², 16², 8² and 4² texels of 4 bytes.
        assert_eq!(number(&glossy["bytes_per_probe"]), (4 * (32 * 32 + 16 * 16 + 8 * 8 + 4 * 4)) as f64);
        let mean = number(&glossy["radiance_mean"]);
        assert!((0.02..0.12).contains(&mean), "{name}: {mean}");
        // What the walls reflect as gloss themselves, 5 % of the light, the probes do not have; and Schlick's shadowing with
        // k = α/2 leaves 5 % less than Smith's.
        let error = &glossy["error_gltf"];
        assert!((-0.2..0.0).contains(&(number(&error["bias"]) / mean)), "{name}: {error}");
    }
    let parts = method(&report, "visibility_on")["glossy"]["parts"].as_array().unwrap().clone();
    let names: Vec<&str> = parts.iter().map(|part| part["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["without_parallax", "exact_visibility", "exact_parallax", "exact_light"]);
    assert!(folder.path().join("constant").join("glossy.png").is_file());
}

/// Scenes without a glossy material have no levels in the file, no layer and no figures.
#[test]
fn what_no_surface_reflects_is_left_out() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("cornell"), &format!("{LEVELS} --set grid.divisions=(2,2,2)"));
    let line = plan_line(&baked);
    assert_eq!((&line["kept"], &line["reason"]), (&Value::from(false), &Value::from("no glossy material")));
    assert_eq!(number(&line["saved_bytes"]), (8 * 4 * (32 * 32 + 16 * 16 + 8 * 8 + 4 * 4)) as f64);
    assert!(!baked.file.tensors.contains_key("prefiltered.0"));
    let report = render(&folder, &scene("cornell"), &baked.path, "run", &format!("--size {SIZE}"));
    assert!(method(&report, "visibility_on").get("glossy").is_none());
    assert!(!folder.path().join("run").join("glossy.png").exists());
}

/// Rays in the probes: figures of what they cost, the same bytes for any threads, and a picture of one.
#[test]
fn rays_are_traced_in_the_probes() {
    let folder = Folder::new();
    // Within the room: of probes behind its walls all rays would be lost.
    let inside = "--set grid.bounds={\"min\":[-2,0.5,-1.5],\"max\":[2,2.5,1.5]}";
    let words = format!("{MARCH} --set grid.divisions=(3,2,2) {inside}");
    let baked = bake(&folder, &scene("glossy_room"), &format!("{words} --threads 1"));
    assert!(bake(&folder, &scene("glossy_room"), &format!("{words} --threads 2")).bytes == baked.bytes);
    assert_eq!(baked.file.tensors["lowest_distance"].shape, [12, 8, 8]);
    assert_eq!(baked.file.tensors["normal"].shape, [12, 64, 64, 2]);
    let report = render(&folder, &scene("glossy_room"), &baked.path, "run", &format!("--size {SIZE}"));
    let glossy = &method(&report, "visibility_on")["glossy"];
    assert!(number(&glossy["radiance_mean"]) > 0.0);
    let traced = &glossy["traced"];
    assert!(
        number(&traced["probes"]) >= 1.0 && number(&traced["reads"]) > 1.0 && number(&traced["lost"]) < 0.5,
        "{traced}"
    );
    let picture = folder.path().join("ray.png");
    let trace = |more: &[&str]| {
        let ray = ["inspect", text(&baked.path), "--trace=0,1,0,1,-0.2,0.1", "-o", text(&picture)];
        run(&[&ray[..], more].concat())
    };
    for more in [&[][..], &["--probe", "5"]] {
        let done = trace(more);
        assert!(done.code == Some(0) && done.stdout.contains("lowest distances"), "{}{}", done.stdout, done.stderr);
        assert!(picture.is_file());
    }
    let other = bake(&folder, &scene("cornell"), &format!("{LEVELS} --set grid.divisions=(2,2,2)"));
    let error = refuse(&["inspect", text(&other.path), "--trace", "0,1,0,1,0,0", "-o", text(&picture)]);
    assert!(error.contains("mcguire-2017"), "{error}");
}

/// What cannot be asked is refused before anything is traced.
#[test]
fn gloss_that_is_not_stored_is_refused() {
    let folder = Folder::new();
    let refused = |words: &str| {
        let (scene, output) = (scene("cornell"), folder.path().join("x.probes"));
        let arguments = ["bake", text(&scene), "-o", text(&output)];
        refuse(&[&arguments[..], &words.split_whitespace().collect::<Vec<_>>()].concat())
    };
    for (words, expected) in [
        ("--set query.glossy=prefiltered(parallax:volume)", "store.prefiltered must hold levels"),
        ("--set query.glossy=light_field()", "store.light_field must be march"),
        ("--preset mcguire-2017 --set store.border=1", "store.border must be 0"),
        ("--preset mcguire-2017 --set store.light_field=march(lowest:60)", "lowest must divide"),
        ("--preset mcguire-2017 --set query.glossy=light_field(thinnest:-1)", "thinnest"),
    ] {
        let error = refused(words);
        assert!(error.contains(expected), "{words}: {error}");
    }
}
