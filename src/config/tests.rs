//! Layers, keys of before, ranges and messages.

use serde_json::Value;

use super::*;
use crate::probe::query::VisibilityTest;
use crate::probe::store::OcclusionStore;
use crate::probe::store::moments::MomentsStore;
use crate::probe::transport::{BounceSettings, Transport};
use crate::scene::Unassigned;

fn with(assignments: &[&str]) -> Result<Config, ConfigError> {
    Config::default().with_overrides(&assignments.iter().map(|s| s.to_string()).collect::<Vec<_>>())
}

fn preset(name: &str) -> Config {
    Layers::default().preset(name).unwrap().config().unwrap()
}

fn moments(resolution: usize) -> OcclusionStore {
    OcclusionStore::Moments(MomentsStore { resolution, ..Default::default() })
}

#[test]
fn ron_round_trip() {
    for config in [Config::default(), with(&["query.visibility=moments(power: 3, floor: 0.05)"]).unwrap()] {
        assert_eq!(Config::parse(&config.to_ron(), "itself").unwrap(), config, "{}", config.to_ron());
    }
    let path = preset("path");
    assert_eq!(Config::parse(&path.to_ron(), "itself").unwrap(), path);
    // A whole file means the same over what a run without a preset begins with, which has a fit where others have none.
    for one in presets::PRESETS.iter().map(|p| preset(p.name)) {
        let again = Layers::of(None).unwrap().text(&one.to_ron(), "whole.ron").unwrap().config().unwrap();
        assert_eq!(again, one);
    }
    let named = |config: &Config| [config.to_ron(), config.identity()].map(|text| text.contains("\n    fit: "));
    assert_eq!((named(&Config::default()), named(&preset("default"))), ([true, false], [true, true]));
}

#[test]
fn every_preset_parses_and_physical_is_the_ground() {
    for preset in presets::PRESETS {
        super::Layers::default().preset(preset.name).unwrap().config().unwrap();
    }
    assert_eq!(preset("physical"), Config::default());
    assert_eq!(Layers::of(None).unwrap().config().unwrap(), preset("default"));
    assert_ne!(preset("default"), Config::default());
    assert!(Layers::default().preset("defualt").unwrap_err().to_string().contains("default"));
}

/// A preset says how, a scene's configuration where.
#[test]
fn presets_say_nothing_about_a_scene() {
    for preset in presets::PRESETS.iter().filter(|preset| preset.name != presets::PHYSICAL) {
        for assignment in assignments::of_text(preset.text, preset.name).unwrap() {
            let section = assignment.path.split('.').next().unwrap();
            assert!(!["grid", "lights", "materials"].contains(&section), "{}: {}", preset.name, assignment.path);
        }
    }
}

#[test]
fn layers_lie_on_each_other() {
    let scene = "(grid: (spacing_m: 0.75), transport: paths(paths: 8))";
    let layers = Layers::default().preset("path").unwrap().text(scene, "scene.ron").unwrap();
    let config = layers.config().unwrap();
    // The scene's file says only what stands there: all else of the preset stays.
    let preset = preset("path");
    assert_eq!(config.grid.spacing_m, Some(0.75));
    assert_eq!(config.transport, Transport::Paths { paths: 8 });
    assert_eq!(config.store, preset.store);
    assert_ne!(config.store, Config::default().store);
    let set = layers.set(&["transport.paths.paths=2".to_owned()]).unwrap().config().unwrap();
    assert_eq!(set.transport, Transport::Paths { paths: 2 });
    // The settings of a choice that are not named stay as the layers below have them.
    let config = Layers::default()
        .text("(store: (occlusion: moments(resolution: 6)), query: (test: chebyshev(power: 1, floor: 0)))", "a")
        .unwrap();
    let config = config.text("(store: (occlusion: moments(exponent: 20)))", "b").unwrap().config().unwrap();
    let expected = MomentsStore { resolution: 6, exponent: 20.0, ..Default::default() };
    assert_eq!(config.store.occlusion, OcclusionStore::Moments(expected));
}

#[test]
fn keys_of_before_mean_what_they_are_called_now() {
    for (old, new) in [
        ("capture.resolution=9", &["capture.rays.octahedral.resolution=9"][..]),
        ("capture.samples_per_texel=3", &["capture.rays=octahedral(per_texel: 3)"]),
        ("capture.reflected=path_traced(paths: 7)", &["transport=paths(paths: 7)"]),
        ("capture.reflected=through_probes", &[]),
        ("encoding.irradiance=f32", &["store.irradiance.octahedral.format=f32"]),
        ("encoding.curve=gamma5_over_2pi", &["store.irradiance.octahedral.curve=gamma5_over_2pi"]),
        ("encoding.border=0", &["store.border=0"]),
        ("filter.irradiance_resolution=6", &["store.irradiance.octahedral.resolution=6"]),
        ("filter=(irradiance_resolution: 6)", &["store.irradiance.octahedral.resolution=6"]),
        ("placement.rays=64", &["placement.rule.settle.rays=64"]),
        ("placement.back_face_share=0.3", &["placement.rule.settle.back_face_share=0.3"]),
        ("placement.relocate=false", &["placement.rule.settle.relocate=false"]),
        ("query.visibility=none", &["store.occlusion=none", "query.test=none"]),
        (
            "query.visibility=moments(power: 2, floor: 0.1)",
            &["store.occlusion=moments()", "query.test=chebyshev(power: 2, floor: 0.1)"],
        ),
        (
            "query.visibility={\"moments\":{\"power\":2,\"floor\":0.1}}",
            &["store.occlusion=moments()", "query.test=chebyshev(power: 2, floor: 0.1)"],
        ),
        ("query.visibility=surface(voxels_per_cell: 5)", &["store.occlusion.surface.voxels_per_cell=5"]),
        ("query.visibility.surface.voxels_per_cell=5", &["store.occlusion.surface.voxels_per_cell=5"]),
        ("solver.max_bounces=3", &["transport.bounces.max_bounces=3"]),
        ("solver.max_sweeps=9", &["transport.bounces.max_iterations=9"]),
        ("solver.acceleration=never", &["transport.bounces.acceleration=never"]),
        ("solver.tolerance=0.01", &["transport=bounces(tolerance: 0.01)"]),
        ("solver.albedo_max=0.5", &["materials.albedo_max=0.5"]),
        ("plan=keep_everything", &["plan.mode=keep_everything"]),
    ] {
        assert_eq!(with(&[old]).unwrap(), with(new).unwrap(), "{old}");
    }
}

/// The distance maps' keys stood beside the visibility that they belong to, in any order, and also where there was none.
#[test]
fn old_keys_of_distance_maps_wait_for_their_choice() {
    let visibility = "query.visibility=moments(power: 3, floor: 0)";
    for order in [["filter.distance_resolution=6", visibility], [visibility, "filter.distance_resolution=6"]] {
        assert_eq!(with(&order).unwrap().store.occlusion, moments(6));
    }
    let whole = "(filter: (irradiance_resolution: 6, distance_resolution: 7), query: (visibility: moments(power: 1, \
                 floor: 0.0), blend: linear), solver: (max_bounces: Some(2)), plan: leave_out)";
    let config = Config::parse(whole, "old.ron").unwrap();
    assert_eq!(config.store.occlusion, moments(7));
    assert_eq!(config.query.test, VisibilityTest::Chebyshev { power: 1.0, floor: 0.0 });
    let bounces = BounceSettings { max_bounces: Some(2), ..Default::default() };
    assert_eq!(config.transport, Transport::Bounces(bounces));
}

#[test]
fn values_of_every_kind() {
    let config = with(&[
        "grid.divisions=(3,4,5)",
        "transport.bounces.max_bounces=None",
        "transport.bounces.tolerance=1e-3",
        "store.occlusion=moments(resolution: 5)",
        "query.test=chebyshev(power: 3, floor: 0.05)",
        "query.test.chebyshev.power=2",
        "plan.keep=[\"visibility\"]",
        "materials.unassigned=gltf",
        "materials.unassigned=diffuse(albedo: 0.3)",
        "materials.unassigned.diffuse.albedo=0.4",
    ])
    .unwrap();
    assert_eq!(config.grid.divisions, Some((3, 4, 5)));
    assert_eq!(config.transport, Transport::Bounces(BounceSettings { tolerance: 1e-3, ..Default::default() }));
    assert_eq!(config.query.test, VisibilityTest::Chebyshev { power: 2.0, floor: 0.05 });
    assert_eq!(config.materials.unassigned, Unassigned::Diffuse { albedo: 0.4 });
    assert_eq!(with(&["materials.unassigned=gltf"]).unwrap().materials.unassigned, Unassigned::Gltf);
    assert!(config.plan.keeps("visibility") && !config.plan.keeps("sky"));
}

#[test]
fn mistakes_are_named() {
    for (assignment, expected) in [
        ("grid.spacing=1", "did you mean 'spacing_m'"),
        ("grid.spacing_m", "key=value"),
        ("grid.spacing_m=wide", "wide"),
        ("encoding.irradiance=f64", "f64"),
        ("solver.albedo_max=2", "not including 1"),
        ("grid.spacing_m.x=1", "has no keys"),
        ("encoding.irradiance=f61", "did you mean 'f16'"),
        ("query.visibility=moments", "chebyshev(power: 3, floor: 0.05)"),
        ("query.direction=cosine", "cosine(floor: 0.05)"),
        ("query.test=chebyshev", "chebyshev(power: 3, floor: 0.05)"),
        ("store.occlusion=surface(voxels: 8)", "did you mean 'voxels_per_cell'"),
        ("store.occlusion=moments()", "query.test must be chebyshev"),
        ("query.test=none", "query.test must be table() or everywhere(); or make store.occlusion none"),
        ("query.test=chebyshev(power: 1, floor: 0)", "or make store.occlusion moments() or tiles()"),
        ("query.test=everwhere", "did you mean 'everywhere'"),
        ("query.direction=eccentric", "eccentric(kappa: 0.9)"),
        ("grid.padding=1e300", "grid.padding is 1e300:"),
        ("grid.spacing_m=NaN", "positive"),
        ("grid=(spacing_m: inf)", "positive"),
        ("query.visibility=moments(power: 1e39, floor: 0)", "finite"),
        ("plan.keep=[\"visible\"]", "plan.keep is visible"),
        ("materials.unassigned=diffuse", "diffuse(albedo: 0.8)"),
        ("materials.unassigned=diffuse(albedo: 1.5)", "materials.unassigned.diffuse.albedo"),
        ("materials.unassigned=metal", "the choices are diffuse, gltf"),
        ("lights.punctual_scale=1e7", "1e6"),
        ("lights.sky=(1e31, 0, 0)", "1e30"),
    ] {
        let error = with(&[assignment]).map(|c| c.to_ron()).unwrap_err().to_string();
        assert!(error.contains(expected), "{assignment}: {error}");
    }
}

/// NaN and infinities are no numbers of metres, shares or anything else, and no way of writing a default.
#[test]
fn no_key_takes_what_is_not_finite() {
    fn leaves(node: &Value, path: String, out: &mut Vec<String>) {
        match node {
            Value::Object(map) => map.iter().for_each(|(key, node)| leaves(node, format!("{path}.{key}"), out)),
            Value::Number(_) => out.push(path.trim_start_matches('.').to_owned()),
            _ => {}
        }
    }
    let mut paths = Vec::new();
    leaves(&serde_json::to_value(Config::default()).unwrap(), String::new(), &mut paths);
    assert!(paths.len() > 25, "{paths:?}");
    for odd in ["NaN", "inf", "-inf", "1e400"] {
        let optional = ["grid.spacing_m=X", "lights.sky=(X,0,0)", "grid.bounds=(min: (0,0,0), max: (1,X,1))"];
        let assignments = paths.iter().map(|path| format!("{path}=X")).chain(optional.map(String::from));
        for assignment in assignments.map(|a| a.replace('X', odd)) {
            assert!(with(&[&assignment]).is_err(), "{assignment}");
        }
        let file = format!("(grid: (spacing_m: {odd}))");
        assert!(Config::parse(&file, "a.ron").unwrap_err().to_string().contains("a.ron"), "{file}");
    }
}

#[test]
fn a_spacing_gives_way_to_divisions_on_request() {
    let error = with(&["grid.spacing_m=1", "grid.divisions=(2,2,2)"]).unwrap_err().to_string();
    assert!(error.contains("--set grid.spacing_m=None"), "{error}");
    let config = with(&["grid.spacing_m=1", "grid.spacing_m=None", "grid.divisions=(2,2,2)"]).unwrap();
    assert_eq!((config.grid.spacing_m, config.grid.divisions), (None, Some((2, 2, 2))));
}

#[test]
fn unknown_keys_name_the_nearest_one_and_the_place() {
    let error = Config::parse("(grid: (\n  spacing: 1.0))", "a.ron").unwrap_err().to_string();
    assert!(error.contains("a.ron, line 2") && error.contains("'spacing_m'"), "{error}");
}

#[test]
fn out_of_range_values_name_key_and_range() {
    let error = Config::parse("(capture: (resolution: 0))", "a.ron").unwrap_err().to_string();
    assert!(error.contains("octahedral.resolution is 0") && error.contains("1 to 1024"), "{error}");
    assert!(Config::parse("(materials: (albedo_max: 1.0))", "a.ron").is_err());
}

#[test]
fn files_that_say_nothing_and_marks_before_them() {
    assert_eq!(Config::parse("\u{feff}()", "a.ron").unwrap(), Config::default());
    for (text, words) in [("", "it is empty"), ("\u{feff}\n", "it is empty"), ("// nothing", "() changes nothing")] {
        let error = Config::parse(text, "a.ron").unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let error = Config::parse("(query: (\n test: chebyshev,\n))", "a.ron").unwrap_err().to_string();
    assert!(error.contains("chebyshev(power: 3, floor: 0.05)") && error.contains("line 2"), "{error}");
    let error = Config::parse("(grid: (spacing_m: 1, divisions: (2, 2, 2)))", "a.ron").unwrap_err().to_string();
    assert!(error.contains("a.ron") && error.contains("remove one"), "{error}");
}

#[test]
fn options_need_no_some() {
    assert_eq!(Config::parse("(grid: (spacing_m: 0.5))", "a.ron").unwrap().grid.spacing_m, Some(0.5));
}

#[test]
fn keys_of_choices_that_are_not_taken_are_refused() {
    for (assignments, words) in [
        (&["transport.paths.paths=4"][..], &["transport is bounces", "transport=paths(...)"][..]),
        (&["transport=paths(paths: 2)", "transport.bounces.max_bounces=3"], &["transport is paths"]),
        (&["transport=paths(paths: 2)", "solver.max_bounces=3"], &["transport is paths", "--set solver.max_bounces=3"]),
        (&["placement.rule=grid_points", "placement.rays=8"], &["placement.rule is grid_points"]),
        (&["filter.distance_resolution=8"], &["store.occlusion is surface"]),
        (&["query.visibility=foo"], &["query.visibility takes none, moments"]),
        (
            &["capture.rays.fibonacci.guided=1"],
            &[
                "capture.rays is octahedral (keys: centred, guided, per_texel, resolution)",
                "fibonacci has no such key, only count; did you mean capture.rays.octahedral.guided?",
            ],
        ),
        (
            &["query.test.chebyshev.far=1"],
            &["query.test is table (keys: ", "chebyshev has no such key, only power, floor"],
        ),
        (
            &["query.test.everwhere.strip=1"],
            &["query.test is table", "did you mean 'everywhere'", "none, chebyshev, table"],
        ),
        (&["materials.unassigned.gltf.albedo=1"], &["gltf has no keys: write materials.unassigned=gltf"]),
        (&["fit.rows.bar=1"], &["fit is none (no keys)", "rows has no such key"]),
        (
            &["transport.tracing.filter.bilateral.width=1"],
            &["transport is bounces (keys: ", "write transport=tracing(...)"],
        ),
        (&["transport=paths()"], &["paths(paths: 16)"]),
        (&["query.test=chebyshev(power: 3)"], &["chebyshev(power: 3, floor: 0.05)"]),
        (&["grid.divisions=(4,4)"], &["three numbers"]),
        (&["grid=1"], &["keys in parentheses"]),
        (&["plan.keep=[visibility]"], &["list of texts"]),
    ] {
        let error = with(assignments).map(|c| c.to_ron()).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{assignments:?}: {error}");
    }
    // Whole files of before hold keys of all choices; their ranges still count.
    let file = |value: &str| Config::parse(&format!("(filter: (distance_resolution: {value}))"), "old.ron");
    assert_eq!(file("8").unwrap(), Config::default());
    assert!(file("-8").is_err() && file("hello").is_err());
}

#[test]
fn choices_need_no_empty_parentheses() {
    for (bare, written) in [
        ("transport=bounces", "transport=bounces()"),
        ("query.test=table", "query.test=table()"),
        ("store.occlusion=surface", "store.occlusion=surface()"),
        ("placement.rule=grid_points()", "placement.rule=grid_points"),
    ] {
        assert_eq!(with(&[bare]).unwrap(), with(&[written]).unwrap(), "{bare}");
    }
}

/// Bounds beside those of before: neither corner alone would do.
#[test]
fn a_whole_value_takes_the_place_of_another() {
    let first = "grid.bounds=(min:(0,0,0),max:(1,1,1))";
    let far = "grid.bounds=(min: (5, 5, 5), max: (6, 6, 6))";
    for bounds in [far, "grid.bounds=(max:(6,6,6),min:(5,5,5))", "grid=(bounds: (min: (5, 5, 5), max: (6, 6, 6)))"] {
        assert_eq!(with(&[first, bounds]).unwrap(), with(&[far]).unwrap(), "{bounds}");
    }
    assert_eq!(with(&[far, first]).unwrap(), with(&[first]).unwrap());
    // A corner alone leaves the other where it is.
    let config = with(&[first, "grid.bounds=(max:(2,2,2))"]).unwrap();
    assert_eq!(config.grid.bounds.map(|b| (b.min, b.max)), Some(((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))));
    assert!(with(&[first, "grid.bounds=(min:(3,0,0),max:(2,2,2))"]).unwrap_err().to_string().contains("grid.bounds"));
    assert!(with(&[first, "grid.bounds=(min:(0,0,0),max:(2,2,2),mid:(1,1,1))"]).is_err());
}

#[test]
fn messages_name_the_place_that_decides() {
    let layers = Layers::default().text("(query: (\n  test: none))", "a.ron").unwrap();
    let error = layers.set(&["grid.spacing_m=2".to_owned()]).unwrap().config().unwrap_err().to_string();
    assert!(error.contains("a.ron, line 2") && !error.contains("--set"), "{error}");
    let twice = Config::parse("(grid: (spacing_m: 2.0,\n spacing_m: 1.0))", "a.ron").unwrap_err().to_string();
    assert!(twice.contains("a.ron, line 2") && twice.contains("twice"), "{twice}");
}

/// The bytes of each published layout, from the code that counts them.
#[test]
fn published_layouts_have_their_published_sizes() {
    let bytes = |name: &str| {
        let config = preset(name);
        let (store, side) = (&config.store, config.capture.rays.side().unwrap_or(0));
        let (field, levels) = store.radiance().runtime_bytes(side, store.layout.g_buffer);
        let head = store.layout.head_bytes(config.placement.rule.moves());
        let occlusion = store.occlusion.runtime_bytes(store.border, None, 1, &store.layout);
        [head, store.irradiance.runtime_bytes(store.border), occlusion as usize, field, levels]
    };
    assert_eq!(bytes("ddgi-2019"), [8, 256, 1024, 0, 0]);
    assert_eq!(bytes("irradiance-2022"), [0, 65_536, 0, 0, 87_296]);
    assert_eq!(bytes("irradiance-2022").iter().sum::<usize>(), 152_832);
    // 1024² texels of 8 bytes, 64² lowest distances of 2, and irradiance and moments of 128²: 8.13 MiB.
    assert_eq!(bytes("mcguire-2017"), [0, 65_536, 65_536, 8 * 1024 * 1024 + 2 * 64 * 64, 0]);
    // 192 KiB of what it names, and 576 KiB that its table says.
    assert_eq!(bytes("lightfield-2022"), [0, 65_536, 65_536, 65_536, 0]);
    // 8² + border of packed colours and 16² + border of two u16; places, levels and the index are the grid's.
    for name in ["threev8-uniform", "threev8-mixed"] {
        assert_eq!(bytes(name), [1, 400, 1296, 0, 0]);
        assert_eq!(preset(name).capture.rays.count(), 6 * 64 * 64);
        assert_eq!(preset(name).capture.rays.kept(), 6 * 64 * 64);
    }
    assert_eq!(preset("lightfield-2022").store.layout.published, Some(576 << 10));
}

#[test]
fn stages_that_do_not_go_together_are_refused() {
    let refused = |preset: &str, set: &[&str]| {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        Layers::default().preset(preset).unwrap().set(&set).unwrap().config().unwrap_err().to_string()
    };
    for (preset, set, words) in [
        ("ddgi-2019", &["capture.emission=sampled"][..], "must be gathered"),
        ("ddgi-2019", &["capture.rays.fibonacci.count=32"], "keeps 32 of them"),
        ("ddgi-2019", &["transport=bounces()"], "leave_out"),
        ("ddgi-2019", &["store.irradiance=sh9()"], "store.irradiance must be octahedral"),
        ("ddgi-2019", &["store.light_field=maps"], "cube with a resolution"),
        ("lightfield-2022", &["store.light_field=none"], "store.light_field must be maps"),
        ("irradiance-2022", &["store.prefiltered=[128, 32]"], "store.prefiltered"),
        ("physical", &["capture.rays=cube(sharpness: 0)"], "capture.rays.cube.sharpness"),
        ("physical", &["transport=frames(hysteresis: 1)"], "transport.frames.hysteresis"),
    ] {
        let error = refused(preset, set);
        assert!(error.contains(words), "{set:?}: {error}");
    }
}
