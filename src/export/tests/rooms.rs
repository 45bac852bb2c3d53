//! Volumes of rooms in scenes of the repository.

use std::path::Path;

use glam::Vec3;

use crate::export::rooms::{self, Room};
use crate::light::World;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::GridSettings;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::probe::{Grid, Volume};
use crate::scene::{self, LoadOptions, Scene};

/// Every active probe at its grid point.
fn in_scene(name: &str, spacing: f64) -> (Scene, Volume) {
    let path = format!("{}/scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
    let scene = scene::load(Path::new(&path), &LoadOptions::default()).unwrap();
    let settings = GridSettings { spacing_m: Some(spacing), ..Default::default() };
    let grid = Grid::new(&settings, &scene).unwrap();
    let count = grid.probe_count();
    let positions: Vec<Vec3> = grid.probes().map(|probe| grid.grid_point(probe)).collect();
    // The walls are 0.1 m thick.
    let (low, high) = scene.mesh.bounds().unwrap();
    let is_inside = |p: &Vec3| p.cmpgt(low + 0.1).all() && p.cmplt(high - 0.1).all();
    let state = |p| if is_inside(p) { ProbeState::Active } else { ProbeState::NeverSampled };
    let own = Volume {
        states: positions.iter().map(state).collect(),
        positions,
        irradiance: IrradianceStore::Sh9(ShStore::default()).zeros(count, 1),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    };
    (scene, own)
}

#[test]
fn closed_rooms_get_a_volume_each() {
    let rooms_of = |name: &str| {
        let (scene, own) = in_scene(name, 0.8);
        let world = World::new(&scene, 1.0, 0.9).unwrap();
        rooms::rooms(&world, &own)
    };
    let sealed = rooms_of("two_rooms_sealed");
    let [a, b] = sealed[..] else { panic!("two rooms: {sealed:?}") };
    // 4 × 3 × 4 m each, up to the walls: 0.1 m of wall lie between them. Rays end at surfaces to 0.1 mm.
    for room in [a, b] {
        assert!((room.high - room.low - Vec3::new(4.0, 3.0, 4.0)).abs().max_element() < 2e-4, "{room:?}");
    }
    assert!(((a.low.x - b.low.x).abs() - 4.1).abs() < 2e-4, "{sealed:?}");
    let (scene, own) = in_scene("two_rooms_sealed", 0.8);
    let world = World::new(&scene, 1.0, 0.9).unwrap();
    assert!(rooms::shared(&world, &own).is_some_and(|warning| warning.contains("two rooms")));
}

#[test]
fn rooms_end_at_doors_which_get_a_volume_of_their_own() {
    let (scene, own) = in_scene("two_rooms_open", 0.8);
    let world = World::new(&scene, 1.0, 0.9).unwrap();
    let open = rooms::rooms(&world, &own);
    let [a, b] = open[..] else { panic!("two rooms: {open:?}") };
    for room in [a, b] {
        assert!((room.high - room.low - Vec3::new(4.0, 3.0, 4.0)).abs().max_element() < 2e-4, "{room:?}");
    }
    let spacing = own.grid.spacing();
    let openings = rooms::openings(&world, &open, spacing);
    let [door] = openings[..] else { panic!("one opening: {openings:?}") };
    // The wall of 0.1 m ends 1.2 m before the side wall, from floor to ceiling; rays stand an eighth of a spacing apart.
    let (left, right) = if a.low.x < b.low.x { (a, b) } else { (b, a) };
    let step = spacing / 8.0;
    let size = door.high - door.low;
    assert!((size.x - (2.0 * spacing.x + 0.1)).abs() < 1e-3 && (size.y - 3.0).abs() < step.y, "{door:?}");
    assert!((1.199..1.2 + 2.0 * step.z).contains(&size.z), "{door:?}");
    assert!(left.high.x - door.low.x > 0.0 && door.high.x - right.low.x > 0.0, "{door:?}");
}

#[test]
fn open_air_and_cupboards_are_no_rooms() {
    let room = |low: [f32; 3], high: [f32; 3]| Room { low: Vec3::from(low), high: Vec3::from(high), probes: 9 };
    let (air, a) = (room([-0.5; 3], [9.5, 3.5, 4.5]), room([0.0; 3], [5.0, 3.0, 4.0]));
    let (b, cupboard) = (room([5.2, 0.0, 0.0], [9.0, 3.0, 4.0]), room([1.0, 0.0, 1.0], [2.0, 2.0, 2.0]));
    // The two rooms are 105.6 of the 200 m³ of the air around them; the cupboard is 2 of the 60 m³ of its room.
    assert_eq!(rooms::without_shells(&[air, a, b, cupboard]), [a, b, cupboard]);
    assert_eq!(rooms::without_pockets(&[a, b, cupboard]), [a, b]);
}
