//! Files written and read back, and what they say about asking their probes.

use std::path::Path;

use glam::{DVec3, UVec3, Vec2, Vec3};
use serde_json::json;

use super::*;
use crate::probe::query::{Blend, DirectionWeight, QuerySettings, VisibilityTest};
use crate::probe::store::IrradianceStore;
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::surface::TableTest;
use crate::scene::Unassigned;

fn volume() -> Volume {
    let grid = Grid::from_parts(DVec3::new(1e6, 0.0, -2.0), Vec3::new(1.0, 2.0, 3.0), UVec3::new(2, 1, 2)).unwrap();
    let mut irradiance = IrradianceStore::default().zeros(4, 1);
    irradiance.set_each(|p, _| Some((vec![glam::Vec3A::splat(p as f32); 64], ())));
    Volume {
        states: vec![ProbeState::Active, ProbeState::InsideGeometry, ProbeState::NeverSampled, ProbeState::Active],
        positions: grid.probes().map(|p| grid.grid_point(p) + 0.25).collect(),
        irradiance,
        occlusion: Occlusion::Moments(OctahedralMaps::new(4, 2, 1, Vec2::new(1.5, 0.5))),
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

fn record() -> QueryRecord {
    QueryRecord {
        version: QUERY_VERSION,
        weights: QuerySettings {
            test: VisibilityTest::Chebyshev { power: 3.0, floor: 0.05 },
            normal_bias: 0.1,
            ..Default::default()
        },
        moved: true,
        light: LightRecord {
            punctual_scale: 2.0,
            sky: Some((1.0, 2.0, 3.0)),
            albedo_max: 0.9,
            unassigned: Unassigned::Diffuse { albedo: 0.5 },
        },
    }
}

fn written(visibility: bool) -> Container {
    let scene = SceneRecord { name: "a".into(), blake3: "b".into() };
    let (query, plan) = (record(), json!({ "visibility": visibility, "lines": [] }));
    let provenance =
        Provenance { config: "()", query: &query, scene: &scene, seed: 7, plan: &plan, fit: None, border: 1 };
    encode(&volume(), &provenance).0
}

fn read_back(container: &Container) -> Result<ProbeFile, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.probes");
    container.write(&path).unwrap();
    read(&path)
}

#[test]
fn a_volume_comes_back_with_the_way_to_ask_it() {
    let file = read_back(&written(true)).unwrap();
    let (before, after) = (volume(), file.volume_in_grid());
    assert_eq!((&after.grid, &after.states, &after.positions), (&before.grid, &before.states, &before.positions));
    // Whole numbers below 64 are exact in packed floats.
    assert!(after.irradiance.stored().eq(before.irradiance.stored()));
    // 16 bits of the largest value.
    let difference = after.occlusion.distance_difference(0, &before.occlusion, 0).unwrap();
    assert!(difference < 1.5 / 65_535.0, "{difference}");
    assert_eq!((file.query.clone(), file.seed, file.config.as_str()), (record(), Some(7), "()"));
    // Relative to a scene, everything moves with the grid's origin.
    let moved = file.volume(DVec3::new(1e6 - 4.0, 0.0, 0.0));
    assert_eq!(moved.positions[0], after.positions[0] + Vec3::new(4.0, 0.0, -2.0));
}

#[test]
fn what_the_plan_left_out_is_not_asked() {
    let file = read_back(&written(false)).unwrap();
    assert_eq!(file.volume_as_planned(DVec3::ZERO).occlusion, Occlusion::None);
    // 16 texels of 4 bytes and a scale.
    let kept = read_back(&written(true)).unwrap();
    assert_eq!(kept.runtime_bytes() - file.runtime_bytes(), (16 * 4 + 4) as f64);
}

#[test]
fn newer_files_are_told_from_damaged_ones() {
    let mut container = written(true);
    let mut query = serde_json::to_value(record()).unwrap();
    query["version"] = json!(QUERY_VERSION + 1);
    query["what is to come"] = json!(1);
    container.put_json("query", &query);
    let error = read_back(&container).unwrap_err();
    assert!(matches!(error, FileError::Version { .. }), "{error}");
    for (key, value) in [("query", json!({ "version": 1 })), ("query", json!([])), ("grid", json!({}))] {
        let mut container = written(true);
        container.put_json(key, &value);
        let error = read_back(&container).unwrap_err();
        assert!(matches!(&error, FileError::Damaged { what, .. } if what.contains(key)), "{error}");
    }
    let mut container = written(true);
    container.put_bytes("state", Dtype::U8, &[4], vec![0, 1, 2, 3]);
    assert!(read_back(&container).unwrap_err().to_string().contains("unknown state"));
}

/// Files from before the key `query` hold only a configuration of then, with all its keys.
#[test]
fn older_files_are_asked_as_they_were() {
    let old = "(\n    grid: (\n        spacing_m: Some(2.0),\n    ),\n    placement: (relocate: false),\n    lights: (punctual_scale: \
               0.5, sky: Some((1.0, 2.0, 3.0))),\n    capture: (reflected: path_traced(paths: 3)),\n    filter: (distance_exponent: \
               50.0),\n    query: (direction: wrap(offset: 0.2), visibility: moments(power: 3.0, floor: 0.05), crush_below: 0.2, \
               blend: square_root, normal_bias: 0.25, view_bias: 0.5),\n    solver: (max_bounces: Some(4), albedo_max: 0.9),\n    \
               plan: leave_out,\n)";
    let record = legacy::query(old).unwrap();
    let expected = QuerySettings {
        direction: DirectionWeight::Wrap { offset: 0.2 },
        test: VisibilityTest::Chebyshev { power: 3.0, floor: 0.05 },
        crush_below: 0.2,
        blend: Blend::SquareRoot,
        normal_bias: 0.25,
        view_bias: 0.5,
        // Only the test saw the shifted point.
        biased_cell: false,
        ..Default::default()
    };
    assert_eq!(record.weights, expected);
    let light =
        LightRecord { punctual_scale: 0.5, sky: Some((1.0, 2.0, 3.0)), albedo_max: 0.9, unassigned: Unassigned::Gltf };
    assert_eq!((record.moved, record.light), (false, light));
    // And not even that under a table.
    let table = legacy::query("(query: (normal_bias: 0.25))").unwrap();
    let test = VisibilityTest::Table(TableTest { reach_voxels: 3, strip: 0.25 });
    assert_eq!(table.weights, QuerySettings { test, biased_cell: false, ..Default::default() });
    assert!(table.moved);
    // A file without the key is read by it.
    let mut container = written(true);
    container.metadata.remove("query");
    container.metadata.insert("config".into(), old.into());
    assert_eq!(read_back(&container).unwrap().query, record);
}

#[test]
fn files_of_before_the_query_record_open() {
    for name in ["surface", "moments"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/before_query/{name}.probes"));
        let file = read(&path).unwrap();
        assert!(!Container::read(&path).unwrap().metadata.contains_key("query"));
        assert_eq!(matches!(file.query.weights.test, VisibilityTest::Table(_)), name == "surface");
        assert_eq!(file.volume_in_grid().occlusion.rank(), if name == "surface" { 2 } else { 1 });
    }
}
