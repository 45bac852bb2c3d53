//! Faults put in on purpose: each must be found, by exit code 1 and the gate that is about it; the same without the fault
//! must pass.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::Vec3;
use lightprobe::probe::container::Container;
use serde_json::{Value, json};

use crate::common::Folder;
use crate::made::{Made, diff, edited, failing, make, report, shift, text, with_pictures};
use crate::program::{scene, succeed};

const ROOMS: &str = "--set grid.spacing_m=1";

/// The same by the preset physical: maps, whose values all bounces make.
const PHYSICAL: &str = "--preset physical --set grid.spacing_m=1";

type Once = OnceLock<(Folder, Made)>;

/// Made once: the rooms as they are.
fn rooms() -> &'static (Folder, Made) {
    static MADE: Once = Once::new();
    made_once(&MADE, ROOMS)
}

fn physical_rooms() -> &'static (Folder, Made) {
    static MADE: Once = Once::new();
    made_once(&MADE, PHYSICAL)
}

fn made_once(made: &'static Once, words: &str) -> &'static (Folder, Made) {
    made.get_or_init(|| {
        let folder = Folder::new();
        let made = make(&folder, "base", &scene("two_rooms_open"), words);
        (folder, made)
    })
}

/// The comparison fails and names this gate.
fn caught(folder: &Folder, base: &Path, candidate: &Path, words: &[&str], gate: &str) {
    let (code, found) = report(&diff(folder, base, candidate, words));
    let failing = failing(&found);
    assert!(failing.iter().any(|name| name == gate), "{gate} is not among {failing:?}");
    assert_eq!(code, Some(1));
    assert_eq!(found["verdict"]["passed"], false);
    let markdown = std::fs::read_to_string(folder.path().join("out/diff.md")).unwrap();
    let junit = std::fs::read_to_string(folder.path().join("out/junit.xml")).unwrap();
    assert!(markdown.contains(&format!("FAIL `{gate}`")), "{markdown}");
    assert!(junit.contains("<failure") && junit.contains(gate), "{junit}");
    assert!(markdown.len() < 60_000);
}

fn passes(folder: &Folder, base: &Path, candidate: &Path, words: &[&str]) {
    let (code, found) = report(&diff(folder, base, candidate, words));
    assert_eq!((code, failing(&found)), (Some(0), vec![]), "{}", found["gates"]);
}

/// All three results of a bake, against those of another with this flag.
fn bake_fault(words: &str, gates: [&str; 3]) {
    fault_of(&rooms().1, &format!("{ROOMS} {words}"), gates);
}

fn fault_of(base: &Made, words: &str, gates: [&str; 3]) {
    let folder = Folder::new();
    let fault = make(&folder, "fault", &scene("two_rooms_open"), words);
    caught(&folder, &base.run, &fault.run, &[], gates[0]);
    caught(&folder, &base.probes, &fault.probes, &[], gates[1]);
    caught(&folder, &base.report, &fault.report, &[], gates[2]);
}

#[test]
fn without_a_fault_everything_passes() {
    let folder = Folder::new();
    let (_, base) = rooms();
    let again = make(&folder, "again", &scene("two_rooms_open"), ROOMS);
    passes(&folder, &base.run, &again.run, &[]);
    passes(&folder, &base.probes, &again.probes, &[]);
    passes(&folder, &base.report, &again.report, &[]);
}

#[test]
fn noise_between_seeds_passes() {
    let folder = Folder::new();
    let (_, base) = rooms();
    for seed in 1..4 {
        let other = make(&folder, &format!("s{seed}"), &scene("two_rooms_open"), &format!("{ROOMS} --seed {seed}"));
        passes(&folder, &base.run, &other.run, &[]);
        passes(&folder, &base.probes, &other.probes, &[]);
        passes(&folder, &base.report, &other.report, &[]);
    }
}

/// Few probes, and few that light what a picture shows: the mean of a picture may change by percents, and single probes by half.
#[test]
fn noise_between_seeds_passes_where_it_is_large() {
    let folder = Folder::new();
    for (name, spacing) in [("courtyard", 4), ("two_rooms_sealed", 2), ("office", 2)] {
        let bake = |seed: u32| {
            let words = format!("--set grid.spacing_m={spacing} --seed {seed}");
            make(&folder, &format!("{name}{seed}"), &scene(name), &words)
        };
        let (base, other) = (bake(0), bake(1));
        passes(&folder, &base.run, &other.run, &[]);
        passes(&folder, &base.probes, &other.probes, &[]);
        passes(&folder, &base.report, &other.report, &[]);
    }
}

#[test]
fn visibility_off() {
    bake_fault("--set query.visibility=none", ["leak.fraction", "probes.visibility", "irradiance.energy"]);
    // However unequally light changed: with the same seed that is no noise.
    bake_fault("--set query.visibility=none", ["image.mean", "irradiance.mean", "irradiance.energy"]);
}

#[test]
fn visibility_off_in_spite_of_noise() {
    bake_fault("--set query.visibility=none --seed 5", ["leak.fraction", "probes.visibility", "irradiance.energy"]);
}

#[test]
fn border_dropped() {
    fault_of(&physical_rooms().1, &format!("{PHYSICAL} --set encoding.border=0"), ["probes.border"; 3]);
}

#[test]
fn coarser_encoding() {
    let folder = Folder::new();
    let (_, coarse) = physical_rooms();
    let fine = make(&folder, "f16", &scene("two_rooms_open"), &format!("{PHYSICAL} --set encoding.irradiance=f16"));
    caught(&folder, &fine.run, &coarse.run, &[], "probes.precision");
    caught(&folder, &fine.probes, &coarse.probes, &[], "probes.precision");
    caught(&folder, &fine.report, &coarse.report, &[], "probes.precision");
    // The other way costs bytes.
    caught(&folder, &coarse.probes, &fine.probes, &[], "memory.file_bytes");
}

#[test]
fn one_bounce_less() {
    let folder = Folder::new();
    let bounces = |n: u32| {
        // Rows of a fit have all bounces, whatever the probes had before it.
        let words = format!("{PHYSICAL} --set solver.max_bounces={n}");
        make(&folder, &format!("b{n}"), &scene("two_rooms_open"), &words)
    };
    let (three, two) = (bounces(3), bounces(2));
    caught(&folder, &three.run, &two.run, &[], "image.mean");
    caught(&folder, &three.probes, &two.probes, &[], "irradiance.mean");
    caught(&folder, &three.report, &two.report, &[], "irradiance.energy");
}

#[test]
fn bias_doubled() {
    let folder = Folder::new();
    let biased = |bias: f32| {
        let words =
            format!("{PHYSICAL} --set query.visibility=moments(power:3,floor:0.05) --set query.normal_bias={bias}");
        make(&folder, &format!("bias{bias}"), &scene("two_rooms_open"), &words)
    };
    let (once, twice) = (biased(0.05), biased(0.1));
    caught(&folder, &once.run, &twice.run, &[], "image.mean");
    caught(&folder, &once.probes, &twice.probes, &[], "irradiance.mean");
}

#[test]
fn albedo_one_percent_up() {
    let brighter = |json: &mut Value| {
        for material in json["materials"].as_array_mut().unwrap() {
            for channel in &mut material["pbrMetallicRoughness"]["baseColorFactor"].as_array_mut().unwrap()[..3] {
                *channel = json!(channel.as_f64().unwrap() * 1.01);
            }
        }
    };
    let folder = Folder::new();
    let (_, base) = rooms();
    let changed = edited(&folder, &scene("two_rooms_open"), "albedo", brighter);
    let fault = make(&folder, "fault", &changed, ROOMS);
    scene_fault(&folder, base, &fault, ["image.mean", "irradiance.mean"]);
}

#[test]
fn one_light_removed() {
    let folder = Folder::new();
    let with_bulb = |json: &mut Value| {
        json["extensions"]["KHR_lights_punctual"] = json!({"lights": [{"type": "point", "intensity": 2.0}]});
        json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_lights_punctual"));
        let bulb = json!({"translation": [2.0, 2.0, 0.0], "extensions": {"KHR_lights_punctual": {"light": 0}}});
        let index = json["nodes"].as_array().unwrap().len();
        json["nodes"].as_array_mut().unwrap().push(bulb);
        json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
    };
    let lit = make(&folder, "lit", &edited(&folder, &scene("two_rooms_open"), "bulb", with_bulb), ROOMS);
    scene_fault(&folder, &lit, &rooms().1, ["image.rmse", "probes.changed"]);
}

/// By the gate `scene`; and by the light alone where the scene may change.
fn scene_fault(folder: &Folder, base: &Made, fault: &Made, [pictures, probes]: [&str; 2]) {
    for (a, b, light) in [
        (&base.run, &fault.run, pictures),
        (&base.probes, &fault.probes, probes),
        (&base.report, &fault.report, "irradiance.energy"),
    ] {
        caught(folder, a, b, &[], "scene");
        caught(folder, a, b, &["--allow-scene-change"], light);
        let (_, found) = report(&diff(folder, a, b, &["--allow-scene-change"]));
        assert!(!failing(&found).contains(&"scene".to_owned()));
        let (_, strict) = report(&diff(folder, a, b, &[]));
        assert_eq!(strict["gates"][0]["name"], "scene", "it explains the rest");
        let waived = found["gates"].as_array().unwrap().iter().find(|g| g["name"] == "scene").unwrap();
        assert_eq!((&waived["waived"], &waived["source"]), (&json!(true), &json!("--allow-scene-change")));
    }
}

/// 512 probes, of which most are active.
const OF_512: &str = "--preset physical --set grid.divisions=(8,8,8) --set encoding.irradiance=f32";

/// A copy of a file of [`OF_512`] in which one probe is four times as bright, and that probe.
fn with_bright_probe(folder: &Folder, made: &Made) -> (PathBuf, usize) {
    let mut container = Container::read(&made.probes).unwrap();
    let map = container.tensors["irradiance"].bytes.len() / 512;
    let states = container.tensors["state"].bytes.clone();
    let probe = (200..512).find(|&p| states[p] == 0).unwrap();
    let bytes = &mut container.tensors.get_mut("irradiance").unwrap().bytes[probe * map..(probe + 1) * map];
    for number in bytes.as_chunks_mut::<4>().0 {
        *number = (4.0 * f32::from_le_bytes(*number)).to_le_bytes();
    }
    let path = folder.path().join("corrupt.probes");
    container.write(&path).unwrap();
    (path, probe)
}

#[test]
fn one_probe_of_five_hundred() {
    let folder = Folder::new();
    let base = make(&folder, "base", &scene("cornell"), OF_512);
    let (path, probe) = with_bright_probe(&folder, &base);
    caught(&folder, &base.probes, &path, &[], "probes.worst");
    let (_, found) = report(&diff(&folder, &base.probes, &path, &[]));
    assert_eq!(found["probes"][0]["worst"][0]["index"], probe, "{}", found["probes"][0]["worst"]);
}

#[test]
fn one_probe_of_five_hundred_in_spite_of_noise() {
    let folder = Folder::new();
    let seeds = folder.path().join("seeds");
    std::fs::create_dir(&seeds).unwrap();
    let bake = |seed: u32| make(&folder, &format!("s{seed}"), &scene("cornell"), &format!("{OF_512} --seed {seed}"));
    for seed in 0..8 {
        std::fs::copy(bake(seed).probes, seeds.join(format!("{seed}.probes"))).unwrap();
    }
    let other = bake(20);
    passes(&folder, &seeds, &other.probes, &[]);
    let (_, found) = report(&diff(&folder, &seeds, &other.probes, &[]));
    assert!(found["notes"].to_string().contains("The base has 8 seeds"), "{}", found["notes"]);
    // Less than where the base has one seed only.
    let mean = found["gates"].as_array().unwrap().iter().find(|g| g["name"] == "irradiance.mean").unwrap();
    assert!(mean["threshold"].as_f64().unwrap() < 10.0, "{mean}");
    let (path, _) = with_bright_probe(&folder, &other);
    caught(&folder, &seeds, &path, &[], "probes.worst");
    // The noise of an equal seed is no noise: the bounds are narrow.
    let (_, found) = report(&diff(&folder, &seeds, &seeds.join("3.probes"), &[]));
    let mean = found["gates"].as_array().unwrap().iter().find(|g| g["name"] == "irradiance.mean").unwrap();
    assert_eq!((&mean["value"], &mean["threshold"]), (&json!(0.0), &json!(0.2)));
    // Two of one seed tell of no noise.
    std::fs::copy(seeds.join("3.probes"), seeds.join("again.probes")).unwrap();
    let message = crate::program::one_error(&diff(&folder, &seeds, &other.probes, &[]));
    assert!(message.contains("one seed") && message.contains("again.probes"), "{message}");
}

#[test]
fn a_picture_shifted_by_a_pixel() {
    let folder = Folder::new();
    let (_, base) = rooms();
    let shifted = with_pictures(&folder, &base.run, "shifted", shift);
    caught(&folder, &base.run, &shifted, &[], "image.surface");
    let single = |run: &Path| run.join("visibility_on.exr");
    caught(&folder, &single(&base.run), &single(&shifted), &[], "image.changed");
}

#[test]
fn a_pixel_that_is_no_number() {
    let folder = Folder::new();
    let (_, base) = rooms();
    let broken = with_pictures(&folder, &base.run, "nan", |width, height, pixels| {
        assert_eq!(pixels.len(), (width * height) as usize);
        pixels[100] = Vec3::new(0.5, f32::NAN, 0.5);
    });
    caught(&folder, &base.run, &broken, &[], "image.non_finite");
    // Not a number on both sides is no change.
    passes(&folder, &broken, &broken.join("."), &[]);
}

/// A render with the look-up of an engine is judged by that too.
#[test]
fn an_engine_that_leaks_more() {
    let folder = Folder::new();
    let (_, rooms) = rooms();
    let (base, candidate) = (folder.path().join("base"), folder.path().join("candidate"));
    let scene = scene("two_rooms_open");
    let render =
        ["render", text(&scene), text(&rooms.probes), "-q", "-o", text(&base), "--size", "96x54", "--as", "bevy"];
    succeed(&render);
    std::fs::create_dir(&candidate).unwrap();
    for entry in std::fs::read_dir(&base).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), candidate.join(entry.file_name())).unwrap();
    }
    passes(&folder, &base, &candidate, &[]);
    let path = candidate.join("report.json");
    let mut changed: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    let methods = changed["methods"].as_array_mut().unwrap();
    let own = methods.iter_mut().find(|method| method["name"] == "as_bevy").unwrap();
    let leak = own["leak"]["light"].as_f64().unwrap();
    own["leak"]["light"] = json!(1.3 * leak + 0.01);
    std::fs::write(&path, changed.to_string()).unwrap();
    caught(&folder, &base, &candidate, &[], "leak.light");
    let (_, found) = report(&diff(&folder, &base, &candidate, &[]));
    assert_eq!(failing(&found), ["leak.light"]);
    let gates = found["gates"].as_array().unwrap();
    let item = gates.iter().find(|gate| gate["passed"] == false).unwrap()["item"].as_str().unwrap();
    assert!(item.ends_with("as_bevy"), "{item}");
}
