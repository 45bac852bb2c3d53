//! Published methods: what they make of a furnace, the same bytes for any threads, and their tensors read by others.

use std::f64::consts::PI;

use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::probe_file::{Vector, direction_of};
use crate::program::{bake, scene, succeed, text};
use crate::shapes::{add, diffuse, dot, room, save};

/// Cubes and maps of a quarter of the published sides, so that the tests are quick. The lobe is as wide against them.
const SMALL: &str = "--set capture.rays.cube.face=64 --set capture.rays.cube.sharpness=128";

fn small(preset: &str) -> String {
    match preset {
        "ddgi-2019" => "--preset ddgi-2019".to_owned(),
        "irradiance-2022" => format!(
            "--preset irradiance-2022 {SMALL} --set capture.rays.cube.resolution=32 \
             --set store.irradiance.octahedral.resolution=32 --set store.prefiltered=[32,16,8]"
        ),
        _ => format!(
            "--preset lightfield-2022 {SMALL} --set capture.rays.cube.resolution=30 \
             --set store.irradiance.octahedral.resolution=30 --set store.occlusion.moments.resolution=30"
        ),
    }
}

/// Probes within the furnace of the repository, 0.2 m and more from its walls.
const INSIDE: &str = "--set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.8,0.2,-0.8],\"max\":[0.8,1.8,0.8]}";

/// Emission 1, albedo 1/2: π/(1 − 1/2) with all bounces, π·(1 + 1/2) with one.
#[test]
fn furnaces() {
    let folder = Folder::new();
    // Half a step of 5 bits of mantissa.
    const STEP: f64 = 1.0 / 64.0;
    for (preset, expected, lost, gained) in [
        // Stored as 1, whose fifth power is exact; the frames end within 10⁻⁴ of it.
        ("ddgi-2019", 2.0 * PI, 1e-3, 1e-3),
        // Noise of one sample at each of 24,576 hits.
        ("irradiance-2022", 1.5 * PI, STEP + 0.005, STEP + 0.005),
        // Rays that end where walls meet and a texel's distance is the mean of both find all probes' distances too short, and
        // bring nothing: 10 % of them at this resolution and 2 % at the published one, which is 4.2 and 1.0 % of the light.
        // What lies below a thousandth in the last iteration is 0.1 % of it.
        ("lightfield-2022", 2.0 * PI, STEP + 0.05, STEP),
    ] {
        let baked = bake(&folder, &scene("furnace"), &format!("{} {INSIDE}", small(preset)));
        assert_eq!(baked.file.active().len(), 8, "{preset}");
        for probe in baked.file.active() {
            for channel in baked.file.mean_irradiance(probe) {
                let off = channel / expected - 1.0;
                assert!((-lost..gained).contains(&off), "{preset}, probe {probe}: {channel} instead of {expected}");
            }
        }
        let stopped = &baked.report["solver"]["stopped"];
        match preset {
            "irradiance-2022" => {
                assert_eq!((stopped, baked.report["bounces"].as_array().map(Vec::len)), (&Value::Null, Some(1)));
            }
            _ => assert_eq!((stopped, &baked.report["converged"]), (&Value::from("settled"), &Value::from(true))),
        }
    }
}

#[test]
fn published_sizes_are_reported() {
    let folder = Folder::new();
    let bytes = |preset: &str, more: &str| {
        let words = format!("--preset {preset} {INSIDE} --set grid.divisions=(1,1,1) {more}");
        bake(&folder, &scene("furnace"), &words).report["bytes_per_probe"].clone()
    };
    let ddgi = bytes("ddgi-2019", "");
    assert_eq!((ddgi["runtime"].as_f64(), ddgi["runtime_kept"].as_f64()), (Some(1288.0), Some(1288.0)));
    assert_eq!(ddgi["published"], Value::Null);
    // Nothing in the furnace is glossy: its levels are left out of what is kept, not of the layout.
    let few = "--set capture.rays.cube.face=32";
    let irradiance = bytes("irradiance-2022", few);
    assert_eq!(
        (irradiance["runtime"].as_f64(), irradiance["runtime_kept"].as_f64()),
        (Some(152_832.0), Some(65_536.0))
    );
    let kept = bytes("irradiance-2022", &format!("{few} --set plan.keep=[\"radiance_levels\"]"));
    assert_eq!(kept["runtime_kept"].as_f64(), Some(152_832.0));
    assert_eq!(kept["tensors"]["prefiltered.0"].as_f64(), Some(65_536.0));
    assert_eq!(kept["tensors"]["prefiltered.4"].as_f64(), Some(256.0));
}

#[test]
fn threads_and_memory_change_no_byte() {
    let folder = Folder::new();
    for (preset, more) in [
        ("ddgi-2019", "--set transport.frames.most=70"),
        ("irradiance-2022", "--set transport=bounces(max_bounces:Some(2))"),
        ("lightfield-2022", "--set transport.tracing.iterations=3"),
    ] {
        let words = format!("{} --set grid.spacing_m=2.5 {more}", small(preset));
        let one = bake(&folder, &scene("two_rooms_open"), &format!("{words} --threads 1"));
        assert!(one.file.active().iter().any(|&p| one.file.mean_irradiance(p)[0] > 0.0), "{preset} is dark");
        for other in ["--threads 2", "--threads 3 --memory-budget 0B"] {
            let two = bake(&folder, &scene("two_rooms_open"), &format!("{words} {other}"));
            assert!(one.bytes == two.bytes, "{preset}: {other} changes the file");
        }
        let seed = bake(&folder, &scene("two_rooms_open"), &format!("{words} --seed 1"));
        assert!(one.bytes != seed.bytes, "{preset}: the seed has no effect");
    }
}

/// A plan of every method, before anything is traced.
#[test]
fn plans_know_the_methods() {
    for preset in ["ddgi-2019", "irradiance-2022", "lightfield-2022"] {
        let words = format!("{} {INSIDE} --dry-run --json", small(preset));
        let scene = scene("furnace");
        let arguments: Vec<&str> = ["bake", text(&scene)].into_iter().chain(words.split_whitespace()).collect();
        let plan = succeed(&arguments).json();
        assert_eq!(plan["probes_active"], 8, "{preset}");
        let number = |key: &str| plan[key].as_f64().unwrap_or_else(|| panic!("{preset}: no {key}"));
        assert!(number("predicted_time_s") > 0.0 && number("predicted_memory_bytes") > 0.0);
        assert!(number("predicted_bounces") >= if preset == "ddgi-2019" { 64.0 } else { 1.0 }, "{preset}: {plan}");
        // As in a bake's report, all that frames take is capture.
        assert!(
            number("predicted_capture_s") > 0.0 && (preset == "ddgi-2019") == (number("predicted_bounce_s") == 0.0)
        );
    }
}

/// Probes in the cube [−1, 1]³ of emission 1 and no albedo: what they see is known in closed form.
#[test]
fn light_fields_are_read_by_others() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.0; 3], [1.0; 3]));
    gltf.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = serde_json::json!(0.5);
    let scene = save(gltf, &folder, "room");
    let words = format!(
        "{} --set store.prefiltered=[30,15] --set grid.divisions=(2,1,1) \
         --set grid.bounds={{\"min\":[-0.3,0,0],\"max\":[0.3,0,0]}}",
        small("lightfield-2022")
    );
    let file = bake(&folder, &scene, &words).file;
    let (n, side) = (30, 32);
    for name in ["radiance", "normal", "radial_distance", "distance", "irradiance"] {
        assert_eq!(file.tensors[name].shape[..3], [2, side, side], "{name}");
    }
    let mut flat = 0;
    for probe in 0..2 {
        let position = file.position(probe);
        for i in 0..n * n {
            let (row, column) = (i / n, i % n);
            let centre = |k: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            let direction = direction_of([centre(column), centre(row)]).0;
            let at = (probe * side + row + 1) * side + column + 1;
            // Radiance is 1, whichever wall it is.
            assert_eq!(file.color("radiance", probe, row + 1, column + 1), [1.0; 3]);
            assert_eq!(file.color("prefiltered.0", probe, row + 1, column + 1), [1.0; 3]);
            let to_wall = |k: usize| (direction[k].signum() - position[k]) / direction[k];
            let wall = (0..3).min_by(|&a, &b| to_wall(a).total_cmp(&to_wall(b))).unwrap();
            let mut inwards: Vector = [0.0; 3];
            inwards[wall] = -direction[wall].signum();
            let normal = direction_of([file.half("normal", 2 * at), file.half("normal", 2 * at + 1)]).0;
            // Texels whose lobe, of 0.09 rad, lies on one wall: some of its widths from the next.
            let others = (0..3).filter(|&k| k != wall).map(to_wall).fold(f64::INFINITY, f64::min);
            if others < 1.5 * to_wall(wall) {
                continue;
            }
            flat += 1;
            assert!(dot(normal, inwards) > 0.99, "{direction:?}: {normal:?}");
            // The lobe's mean over a flat wall is farther by 0.09²·(1 + tan²) of it, 1.6 % at 45°.
            let off = file.half("radial_distance", at) / to_wall(wall) - 1.0;
            assert!((-0.01..0.05).contains(&off), "{direction:?}: off by {off}");
        }
    }
    assert!(flat > n * n / 3, "{flat} texels on one wall");
    assert_eq!(file.tensors["prefiltered.1"].shape, [2, 17, 17]);
}
