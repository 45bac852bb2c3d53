//! Mixed grids and probes in order, baked in scenes built in code.

use std::collections::HashMap;

use glam::Vec3;
use serde_json::json;

use super::*;
use crate::config::Config;
use crate::light::World;
use crate::probe::file::SceneRecord;
use crate::probe::query::{Query, QueryPoint, Visibility};
use crate::probe::store::surface::Facing;
use crate::probe::{ProbeIndex, Volume};
use crate::scene::{self, LoadOptions, Scene};

/// A closed room of 4 m with points of a 4 × 4 × 4 grid at whole metres from 0 to 3, and in it sheets at x = 0.4 and 2.4 that
/// leave a slit at the top: they cross a segment of every base cell of 2 × 2 × 2 points, for which 4 m suffice. Everything
/// glows a little, and the sheets more.
fn crossed_room() -> Scene {
    let mut gltf = common::Gltf::new();
    let mut add = |triangles: &[[f32; 3]], emission: f64| {
        let material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [0.6, 0.5, 0.4, 1.0], "metallicFactor": 0.0 },
            "emissiveFactor": [emission, 0.5 * emission, 0.25 * emission],
        });
        let material = gltf.push("materials", material);
        let positions = gltf.vec3(triangles);
        let primitive = json!({ "attributes": { "POSITION": positions }, "material": material });
        let mesh = gltf.push("meshes", json!({ "primitives": [primitive] }));
        gltf.root(json!({ "mesh": mesh }));
    };
    let (low, high) = (-0.45f32, 3.55f32);
    let quad = |a: [f32; 3], u: [f32; 3], v: [f32; 3]| {
        let at = |s: f32, t: f32| std::array::from_fn(|k| a[k] + s * u[k] + t * v[k]);
        [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]
    };
    let side = high - low;
    for axis in 0..3 {
        let mut u = [0.0; 3];
        let mut v = [0.0; 3];
        (u[(axis + 1) % 3], v[(axis + 2) % 3]) = (side, side);
        let mut far = [low; 3];
        far[axis] = high;
        add(&quad([low; 3], u, v), 0.1);
        add(&quad(far, v, u), 0.1);
    }
    for x in [0.4, 2.4] {
        add(&quad([x, low, low], [0.0, side - 0.3, 0.0], [0.0, 0.0, side]), 1.0);
    }
    let folder = common::Folder::new();
    scene::load(&folder.write("scene.glb", gltf.glb()), &LoadOptions::default()).unwrap()
}

fn bake(scene: &Scene, words: &[&str]) -> Baked {
    let all = [
        "grid.divisions=(4,4,4)",
        "grid.bounds=(min:(0,0,0),max:(3,3,3))",
        "placement.rule=grid_points",
        "placement.keep_unsampled=true",
        "store.irradiance=sh9(presampled: 8)",
        "store.occlusion=tiles()",
        "query.test=chebyshev(power: 1, floor: 0)",
        "query.direction=eccentric(kappa: 0.9)",
        "query.weight_normal=geometric",
        "query.normal_bias=0.05",
        "query.view_bias=0.15",
        "query.crush_below=0.2",
        "capture.rays.octahedral.resolution=16",
    ];
    let words: Vec<String> = all.iter().chain(words).map(|w| (*w).to_owned()).collect();
    let config = Config::default().with_overrides(&words).unwrap();
    let world = World::new(scene, config.lights.punctual_scale, config.materials.albedo_max).unwrap();
    let circumstances = Circumstances::quiet(3);
    let record = SceneRecord { name: "crossed".into(), blake3: scene.blake3.clone() };
    prepare(&world, &config, &circumstances).unwrap().bake(&circumstances, &record).unwrap()
}

/// Points all over the room, with normals of all kinds.
fn points() -> impl Iterator<Item = QueryPoint> {
    (0..300).map(|i| {
        let spread = |step: f32| (i as f32 * step).fract();
        let position = Vec3::new(spread(0.618_034), spread(0.754_878), spread(0.569_84)) * 3.8 - 0.4;
        let geometric = Vec3::AXES[i % 3] * if i % 2 == 0 { 1.0 } else { -1.0 };
        let normal = (geometric + Vec3::new(0.2, -0.3, 0.1)).normalize();
        QueryPoint { position, normal, geometric, facing: Facing::of(geometric), view: geometric }
    })
}

fn config(words: &[&str]) -> Config {
    let words: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
    Config::default().with_overrides(&words).unwrap()
}

/// What a probe holds, as bits: its unknowns and its tile.
type Held = (Vec<[u32; 3]>, Vec<[u32; 2]>);

/// What probes hold, by their places.
fn held(volume: &Volume) -> HashMap<[u32; 3], Held> {
    let bits3 = |v: Vec3| v.to_array().map(f32::to_bits);
    let of = |p: usize| {
        let tile = volume.occlusion.tiles().unwrap().maps.probe(p);
        let tile = tile.iter().map(|t| t.to_array().map(f32::to_bits)).collect();
        (bits3(volume.positions[p]), (volume.irradiance.probe(p).map(bits3).collect(), tile))
    };
    (0..volume.states.len()).map(of).collect()
}

#[test]
fn a_grid_that_is_subdivided_everywhere_bakes_as_the_uniform_one() {
    let scene = crossed_room();
    // Plain bounces: an accelerated solver adds products up in the order of the probes.
    let words = ["transport.bounces.max_bounces=4", "capture.probe_emitter_samples=16"];
    let uniform = bake(&scene, &words).volume;
    let mixed = bake(&scene, &[&words[..], &["placement.refine=mixed(levels: 1)"]].concat()).volume;
    let tree = mixed.grid.tree().unwrap();
    assert_eq!((tree.base_count(), tree.node_count(), tree.probe_count()), (8, 8, 64), "all is subdivided");
    assert_ne!(mixed.positions, uniform.positions, "in another order");
    assert_eq!(held(&mixed), held(&uniform));
    let settings = config(&[
        "store.occlusion=tiles()",
        "query.test=chebyshev(power: 1, floor: 0)",
        "query.direction=eccentric(kappa: 0.9)",
        "query.crush_below=0.2",
    ])
    .query;
    for visibility in [Visibility::Off, Visibility::Stored, Visibility::Exact(0b0110_1001)] {
        for point in points() {
            let ask = |volume| Query { volume, settings: &settings }.irradiance(&point, visibility);
            assert_eq!(
                ask(&mixed).to_array().map(f32::to_bits),
                ask(&uniform).to_array().map(f32::to_bits),
                "{point:?}"
            );
        }
    }
}

#[test]
fn mixed_grids_bake_with_every_store_and_placement() {
    let scene = crossed_room();
    // One base cell stays whole where the sheets are not: three levels of 4 points make one base cell; two levels of points
    // beyond them make more.
    let wide = "grid.divisions=(8,4,4)";
    let bounds = "grid.bounds=(min:(0,0,0),max:(7,3,3))";
    for words in [
        vec![
            "store.occlusion=surface()",
            "query.test=table()",
            "placement.rule=settle()",
            "query.weight_normal=shading",
        ],
        vec!["store.occlusion=moments()", "placement.rule=settle()"],
        vec!["store.occlusion=tiles()", "store.irradiance=octahedral()"],
        vec!["store.occlusion=none", "query.test=none"],
        // Frames have no captures beforehand, and tiles rays of their own all the same.
        vec![
            "store.irradiance=octahedral()",
            "transport=frames(hysteresis: 0.5, least: 4, window: 4)",
            "capture.emission=gathered",
            "placement.rule=ddgi(rays: 16)",
        ],
        vec![
            "transport=in_order()",
            "capture.rays=cube(face: 24, resolution: 16)",
            "store.light_field=maps",
            "store.prefiltered=[16, 8]",
            "plan.keep=[\"radiance_levels\"]",
        ],
    ] {
        let words = [&words[..], &[wide, bounds, "placement.refine=mixed(levels: 2)"]].concat();
        // A store and its test are set together.
        let baked = bake(&scene, &words);
        let volume = &baked.volume;
        let (n, base) = (volume.states.len(), volume.grid.tree().unwrap().base_count());
        assert_eq!((n - base) % 7, 0);
        assert!(n < 128, "{words:?}: some cells stay whole");
        assert!(baked.numerics.non_finite == 0 && baked.solution.converged, "{words:?}");
        let settings = config(&[]).query;
        let settings =
            crate::probe::query::QuerySettings { test: crate::probe::query::VisibilityTest::None, ..settings };
        let lit = points()
            .filter(|p| Query { volume, settings: &settings }.irradiance(p, Visibility::Off).min_element() > 0.0);
        // Probes that see mostly backs of the sheets, which have one side, count as inside them where they settle.
        assert!(lit.count() > 150, "{words:?}: most points are lit");
        let active: Vec<usize> = volume.active().collect();
        if let Some(tiles) = volume.occlusion.tiles() {
            assert!(active.iter().all(|&p| tiles.maps.probe(p).iter().all(|t| t.x > 0.0)), "{words:?}");
        }
        assert_eq!(volume.radiance.light_field.is_some(), words.contains(&"store.light_field=maps"));
        if let Some(field) = &volume.radiance.light_field {
            // Within the room all that is seen glows or is lit.
            let mut within = active.iter().filter(|&&p| volume.positions[p].x < 3.5);
            assert!(within.all(|&p| field.radiance.probe(p).iter().all(|l| l.min_element() > 0.0)));
            let world = World::new(&scene, 1.0, 0.999).unwrap();
            assert!(convert::to_uniform(&world, volume).unwrap_err().contains("radiance"));
        }
    }
}

#[test]
fn probes_in_order_reach_the_same_light() {
    let scene = crossed_room();
    // The same rays.
    let bake = |words: &[&str]| bake(&scene, &[&["capture.rays.octahedral.guided=0"], words].concat());
    let whole = bake(&["transport.bounces.tolerance=1e-6"]);
    let in_order = bake(&["transport=in_order(tolerance: 1e-6)"]);
    assert!(in_order.solution.converged && whole.solution.converged);
    let (a, b) = (&whole.volume.irradiance, &in_order.volume.irradiance);
    for p in 0..whole.volume.states.len() {
        for axis in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
            let (a, b) = (a.of(p, axis), b.of(p, axis));
            // Both end when 1e-6 is missing or changes; the slowest mode shrinks by less than a half each time.
            assert!((a - b).abs().max_element() < 1e-4 * a.max_element(), "probe {p}: {a} {b}");
        }
    }
    // Fewer passes than plain bounces: new values count at once.
    let plain = bake(&["transport=bounces(acceleration: never, tolerance: 1e-6)"]);
    assert!(in_order.solution.bounces.len() < plain.solution.bounces.len());
    let residuals: Vec<f64> = in_order.solution.bounces.iter().map(|b| b.residual).collect();
    assert!(residuals.iter().rev().skip(1).all(|&r| r >= 1e-6) && residuals.last().is_some_and(|&r| r < 1e-6));
    // The published tolerance.
    let published = bake(&["transport=in_order()"]);
    let last = published.solution.bounces.last().map_or(1.0, |b| b.residual);
    assert!(published.solution.converged && last < 1e-3);
}

/// A checkpoint of few iterations, under the name of more of them, is what an interruption leaves.
#[test]
fn an_interrupted_bake_is_resumed() {
    let scene = crossed_room();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.resume");
    let config = |words: &[&str], most: &str| {
        let all = ["grid.divisions=(2,2,2)", "capture.rays.octahedral.resolution=8"];
        let words: Vec<String> = all.iter().chain(words).chain(&[most]).map(|w| (*w).to_owned()).collect();
        Config::default().with_overrides(&words).unwrap()
    };
    let run = |config: &Config, checkpoint: Option<Checkpoint>| {
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let circumstances = Circumstances { checkpoint, ..Circumstances::quiet(1) };
        let record = SceneRecord { name: "crossed".into(), blake3: scene.blake3.clone() };
        prepare(&world, config, &circumstances).unwrap().bake(&circumstances, &record).unwrap()
    };
    let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: std::time::Duration::ZERO };
    let tracing = ["store.light_field=maps", "transport=tracing(tolerance: 0)"];
    let in_order = ["store.irradiance=sh9()", "transport=in_order(tolerance: 0)"];
    let frames = ["capture.emission=gathered", "transport=frames()"];
    for (words, most) in [
        (&tracing, "transport.tracing.iterations"),
        (&in_order, "transport.in_order.most"),
        (&frames, "transport.frames.most"),
    ] {
        let [few, many] = [2, 5].map(|n| config(words, &format!("{most}={n}")));
        let whole = run(&many, None);
        assert_eq!(whole.solution.bounces.len(), 5);
        run(&few, Some(checkpoint(false)));
        let mut left = std::fs::read(&path).unwrap();
        let identity = saving::identity(&scene.blake3, 1, &many.to_ron());
        // The hash behind the first twenty bytes says whose it is.
        left[20..52].copy_from_slice(blake3::hash(identity.as_bytes()).as_bytes());
        std::fs::write(&path, left).unwrap();
        let resumed = run(&many, Some(checkpoint(true)));
        assert!(resumed.container == whole.container, "{most}: resumed, the file is another");
        assert_eq!(resumed.solution, whole.solution, "{most}");
    }
}

#[test]
fn a_mixed_volume_becomes_uniform() {
    let scene = crossed_room();
    let words = ["grid.divisions=(8,4,4)", "grid.bounds=(min:(0,0,0),max:(7,3,3))"];
    let mixed = bake(&scene, &[&words[..], &["placement.refine=mixed(levels: 2)"]].concat()).volume;
    let uniform = bake(&scene, &words).volume;
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let converted = convert::to_uniform(&world, &mixed).unwrap();
    assert_eq!(converted.grid, uniform.grid);
    assert_eq!(converted.positions, uniform.positions);
    // Rays through texel centres from the same places: the same tiles, copied or traced again.
    assert_eq!(converted.occlusion, uniform.occlusion);
    let tree = mixed.grid.tree().unwrap();
    for probe in converted.grid.probes() {
        let source = tree.probe(converted.grid.coordinate(probe)) as usize;
        assert!(converted.irradiance.probe(probe.0 as usize).eq(mixed.irradiance.probe(source)));
        assert_eq!(converted.is_active(probe), mixed.is_active(ProbeIndex(source as u32)));
    }
    assert!(convert::to_uniform(&world, &converted).unwrap_err().contains("uniform already"));
    let table = ["store.occlusion=surface()", "query.test=table()", "query.weight_normal=shading"];
    let table = bake(&scene, &[&table[..], &["placement.refine=mixed(levels: 2)"]].concat()).volume;
    assert!(convert::to_uniform(&world, &table).unwrap_err().contains("placement.refine"));
}
