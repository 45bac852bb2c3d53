//! Placement and survey in scenes whose walls are known.

use std::collections::HashMap;

use glam::Vec3;

use super::need::far_probes;
use super::settle::settle_all;
use super::surveyor::Surveyor;
use super::*;
use crate::light::World;
use crate::math::random::{Purpose, Random};
use crate::probe::lattice::grid::{GridSettings, ProbeIndex};
use crate::probe::lattice::{Grid, ProbeState};
use crate::probe::store::OcclusionStore;
use crate::probe::store::regions::Rank;
use crate::probe::store::surface::{Facing, SurfaceStore, SurfaceVisibility};
use crate::scene::{self, LoadOptions, Scene};
use crate::trace::Ray;

fn scene(name: &str) -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
    scene::load(&path, &LoadOptions::default()).unwrap()
}

fn grid(scene: &Scene, spacing_m: f64) -> Grid {
    Grid::new(&GridSettings { spacing_m: Some(spacing_m), ..Default::default() }, scene).unwrap()
}

fn settle(settings: SettleSettings) -> PlacementSettings {
    PlacementSettings { rule: PlacementRule::Settle(settings), ..Default::default() }
}

fn placed(world: &World, grid: &Grid, settings: &PlacementSettings) -> Placement {
    let occlusion = OcclusionStore::default();
    place(world, &PlacementTask { grid, settings, occlusion: &occlusion, reach: 0.0 }, || {})
}

/// Whether something lies between two points, from either end.
fn blocked(world: &World, from: Vec3, to: Vec3) -> bool {
    world.tracer.occluded(Ray::segment(from, to, 0)) && world.tracer.occluded(Ray::segment(to, from, 0))
}

#[test]
fn probes_settle_in_the_open_and_near_their_grid_points() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 0.25);
    let rule = SettleSettings::default();
    let settings = settle(rule.clone());
    let occlusion = OcclusionStore::None;
    let task = PlacementTask { grid: &grid, settings: &settings, occlusion: &occlusion, reach: 0.0 };
    let placement = settle_all(&world, &task);
    let settler = Settler { world: &world, grid: &grid, settings: &rule };
    let mut moved = 0;
    for (probe, (&state, &position)) in placement.states.iter().zip(&placement.positions).enumerate() {
        let grid_point = grid.grid_point(ProbeIndex(probe as u32));
        let distance = position.distance(grid_point);
        // A rounding beside the bound.
        assert!(distance <= rule.max_move * 0.25 + 1e-6, "probe {probe} moved by {distance} m");
        match state {
            ProbeState::Active => assert!(!settler.is_inside(&settler.look(position)), "probe {probe} is inside"),
            _ => assert_eq!(distance, 0.0, "probe {probe} is not baked and stands elsewhere"),
        }
        moved += usize::from(distance > 0.0);
    }
    assert_eq!(moved, placement.relocated);
    assert!(moved > 0 && placement.count(ProbeState::InsideGeometry) > 0, "the blocks hold some, and touch others");
}

#[test]
fn rules_that_move_nothing_leave_probes_at_their_grid_points() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 0.25);
    let still = settle(SettleSettings { relocate: false, ..Default::default() });
    let points = PlacementSettings { rule: PlacementRule::GridPoints, keep_unsampled: true, ..Default::default() };
    for settings in [&still, &points] {
        let placement = placed(&world, &grid, settings);
        assert!(grid.probes().all(|p| placement.positions[p.0 as usize] == grid.grid_point(p)));
        assert_eq!((placement.relocated, settings.rule.moves()), (0, false));
    }
    // Grid points count wherever they are: inside a block too.
    let inside = placed(&world, &grid, &still).count(ProbeState::InsideGeometry);
    assert!(inside > 0);
    assert_eq!(placed(&world, &grid, &points).count(ProbeState::Active), grid.probe_count());
}

/// The wall at x = 0 is whole: no entry on one side of it sees a probe on the other.
#[test]
fn no_surface_sees_through_a_wall() {
    let scene = scene("two_rooms_sealed");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 1.0);
    let placement = placed(&world, &grid, &PlacementSettings::default());
    let table = placement.survey.as_ref().unwrap();
    let (low_wall, high_wall) = scene.mesh.bounds().unwrap();
    let (mut seen, mut hidden) = (0, 0);
    for cell in grid.cells() {
        let (low, sides) = grid.cell_box(cell);
        let probes = grid.corners(cell);
        for entry in table.entries(cell) {
            let middle = low + (entry.voxel.as_vec3() + 0.5) / table.voxels_per_cell as f32 * sides;
            // The room that the surface faces: the wall is 0.1 m thick, a voxel 0.125 m.
            let before = middle + entry.facing * 0.2;
            let facing = before.x;
            // Not the outsides of the rooms' shell, past which probes below and beside it see each other.
            let within = before.cmpgt(low_wall + 0.2).all() && before.cmplt(high_wall - 0.2).all();
            if facing.abs() < 0.15 || !within {
                continue;
            }
            for (i, probe) in probes.iter().enumerate() {
                let position = placement.positions[probe.0 as usize];
                let across = position.x * facing < 0.0;
                let visible = entry.mask >> i & 1 == 1;
                assert!(!(across && visible), "{middle} facing {} sees {position}", entry.facing);
                seen += usize::from(visible);
                hidden += usize::from(across);
            }
        }
    }
    assert!(seen > 1000 && hidden > 1000, "{seen} seen, {hidden} behind the wall");
}

/// Entries that see none of their eight probes get one that they see, from the cells around.
#[test]
fn far_probes_are_seen_and_not_too_far() {
    let scene = scene("office");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 1.5);
    let settings = PlacementSettings::default();
    let placement = placed(&world, &grid, &settings);
    let survey = Surveyor::new(&world, &grid, 8, &settings.survey).survey(&placement, None);
    let (table, far) = (&survey.table, far_probes(&world, &grid, &placement, &survey, &settings.survey));
    assert!(!far.is_empty());
    let mut entry_of = vec![None; table.keys.len()];
    for cell in grid.cells() {
        table.entries(cell).for_each(|entry| entry_of[entry.index] = Some((cell, entry)));
    }
    let mut met = 0;
    for &(index, probe) in &far {
        let (cell, entry) = entry_of[index as usize].unwrap();
        assert_eq!(entry.mask, 0);
        assert_eq!(placement.states[probe as usize], ProbeState::Active);
        let near = (1..=settings.survey.far_rings).any(|ring| grid.ring(cell, ring).any(|p| p.0 == probe));
        assert!(near, "probe {probe} of {cell:?}");
        // Some point of the voxel sees it: its middle off the surface, or one of the corners of its open face.
        let (low, sides) = grid.cell_box(cell);
        let voxel = sides / table.voxels_per_cell as f32;
        let middle = low + (entry.voxel.as_vec3() + 0.5) * voxel;
        let offsets = (0..27).map(|i| Vec3::new((i % 3) as f32 - 1.0, (i / 3 % 3) as f32 - 1.0, (i / 9) as f32 - 1.0));
        let position = placement.positions[probe as usize];
        met += usize::from(offsets.into_iter().any(|o| !blocked(&world, middle + o * voxel * 0.5, position)));
    }
    // The voxel's 27 points need not include the one that the survey found; nearly always they do.
    assert!(met * 10 >= far.len() * 9, "{met} of {}", far.len());
    // The same every time.
    assert_eq!(far_probes(&world, &grid, &placement, &survey, &settings.survey), far);
}

/// Surfaces in slits and behind drawers that see no probe get what those see that they see: few are left without an answer,
/// and what surfaces see themselves stays as it is.
#[test]
fn open_surfaces_that_see_no_probe_are_lent_what_others_see() {
    let scene = scene("office");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 1.0);
    let settings = PlacementSettings::default();
    let occlusion = OcclusionStore::None;
    let task = PlacementTask { grid: &grid, settings: &settings, occlusion: &occlusion, reach: 0.0 };
    let placement = settle_all(&world, &task);
    let mut survey = Surveyor::new(&world, &grid, 12, &settings.survey).survey(&placement, None);
    survey.table.far = far_probes(&world, &grid, &placement, &survey, &settings.survey);
    let (seen, _) = air::seen(&world, &grid, &placement, &survey.table);
    let own = survey.table.masks.clone();
    let blind = |survey: &super::survey::Survey| {
        let table = &survey.table;
        let is_blind = |&i: &usize| table.masks[i] == 0 && survey.open[i].is_some() && table.far_probe(i).is_none();
        (0..own.len()).filter(is_blind).count()
    };
    let before = blind(&survey);
    super::lend::lend(&world, &grid, &mut survey, &seen);
    let after = blind(&survey);
    assert!(before > 1000 && after * 3 < before, "{before} before, {after} after");
    let ranks = survey.ranks();
    assert!((0..own.len()).all(|i| own[i] == survey.table.masks[i] || own[i] == 0 && ranks[i] == Rank::Lent));
}

#[test]
fn few_points_find_what_many_do() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 0.5);
    let placement = placed(&world, &grid, &PlacementSettings::default());
    let survey = |settings: SurveySettings| Surveyor::new(&world, &grid, 8, &settings).survey(&placement, None);
    let few = survey(SurveySettings::default());
    let many = survey(SurveySettings { first_points: 64, all_points: 255, search_points: 255, ..Default::default() });
    let (a, b) = (&few.table, &many.table);
    assert!(few.rays * 5 < many.rays, "{} {}", few.rays, many.rays);
    // Other points, the same surfaces: keys agree, and most masks.
    let of = |table: &SurfaceVisibility| -> HashMap<_, u8> {
        grid.cells().flat_map(|c| table.range(c).map(move |i| ((c, table.keys[i]), table.masks[i]))).collect()
    };
    let (a_by_key, b_by_key) = (of(a), of(b));
    let shared: Vec<(u8, u8)> = a_by_key.iter().filter_map(|(key, &mask)| Some((mask, *b_by_key.get(key)?))).collect();
    assert!(shared.len() * 100 >= a.keys.len() * 97, "{} of {}", shared.len(), a.keys.len());
    let bits: u32 = shared.iter().map(|(a, b)| (a ^ b).count_ones()).sum();
    // Voxels that an edge of shadow crosses may go either way: 1 % of bits.
    assert!(f64::from(bits) < 0.01 * 8.0 * shared.len() as f64, "{bits} of {} bits", 8 * shared.len());
    assert!(&survey(SurveySettings::default()).table == a, "another time, another table");
}

/// Where some probes moved, the surfaces around them are looked at again; the others are as they were.
#[test]
fn a_survey_is_renewed_where_probes_moved() {
    let scene = scene("two_rooms_open");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 1.0);
    let mut placement = placed(&world, &grid, &PlacementSettings::default());
    let settings = SurveySettings::default();
    let surveyor = Surveyor::new(&world, &grid, 8, &settings);
    let before = surveyor.survey(&placement, None);
    // Two in the middle of the lit room.
    let middle = Vec3::new(-2.0, 1.5, 0.0) - scene.origin_world.as_vec3();
    let mut nearest: Vec<usize> = (0..grid.probe_count()).collect();
    nearest.sort_by(|&a, &b| {
        let distance = |p: usize| placement.positions[p].distance(middle);
        distance(a).total_cmp(&distance(b))
    });
    let moved = [nearest[0], nearest[1]];
    // Behind the walls.
    let outside = scene.mesh.bounds().unwrap().0 - Vec3::ONE;
    placement.move_to(world.scene, moved.iter().map(|&probe| (probe, outside)));
    let (renewed, anew) = (surveyor.survey(&placement, Some((&before, &moved))), surveyor.survey(&placement, None));
    assert!(renewed.table == anew.table, "the tables differ");
    assert_eq!(renewed.fronts, anew.fronts);
    assert!(renewed.table != before.table, "nothing changed");
    assert!(renewed.rays * 4 < anew.rays, "{} {}", renewed.rays, anew.rays);
}

/// A sheet that has only a front stands at x = 1. What is before it sees the probes on its own side, though the sheet's other side,
/// which faces the same way in the same voxel, sees those beyond.
#[test]
fn things_beside_a_sheet_see_the_probes_on_their_side() {
    let scene = scene("thin_wall");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 0.75);
    let occlusion = OcclusionStore::Surface(SurfaceStore { voxels_per_cell: 12 });
    let settings = PlacementSettings { keep_unsampled: true, ..Default::default() };
    let task = PlacementTask { grid: &grid, settings: &settings, occlusion: &occlusion, reach: 0.0 };
    let regions = place(&world, &task, || {}).regions.unwrap();
    let mut random = Random::new(1, Purpose::FitPoints, 0, 0);
    for x in [0.945, 0.97, 0.99, 1.01, 1.03, 1.055] {
        let own = if x < 1.0 { 0x55 } else { 0xaa };
        for _ in 0..200 {
            let at = Vec3::new(x, 0.5 + 2.0 * random.uniform(), -1.5 + 3.0 * random.uniform())
                - scene.origin_world.as_vec3();
            let mask = |normal| regions.look_up(&grid, &grid.cell(at), at, Facing::of(normal)).mask;
            let seen = [mask(Vec3::X), mask(Vec3::NEG_X)];
            assert!(seen.iter().all(|mask| mask & own != 0 && mask & !own == 0), "{x} {at}: {seen:?}");
        }
    }
}

#[test]
fn memory_is_estimated_from_above() {
    let scene = scene("two_rooms_open");
    let grid = grid(&scene, 1.0);
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let placement = placed(&world, &grid, &PlacementSettings::default());
    let table = placement.survey.unwrap();
    let estimate = survey::estimated_bytes(&scene.mesh, &grid, 8);
    // At least what the table's own entries took on the way, and no wild guess.
    assert!(estimate > table.bytes() && estimate < 1000 * table.bytes(), "{estimate} for {}", table.bytes());
}

/// Relocation and classification judged by rays of the test's own.
#[test]
fn ddgi_leaves_walls_and_retires_what_stays_inside() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let grid = grid(&scene, 0.25);
    let rule = DdgiSettings::default();
    let settings = PlacementSettings { rule: PlacementRule::Ddgi(rule.clone()), ..Default::default() };
    let still = DdgiSettings { relocate: false, ..rule.clone() };
    let still = PlacementSettings { rule: PlacementRule::Ddgi(still), ..Default::default() };
    let (moved, still) = (placed(&world, &grid, &settings), placed(&world, &grid, &still));
    let is_inside = |position: Vec3| {
        let ray = |i| Ray::new(position, crate::math::fibonacci::direction(i, rule.rays), i as u32);
        let backs = (0..rule.rays).filter_map(|i| world.surface(ray(i))).filter(|s| s.is_back()).count();
        // A quarter of 32.
        backs > 8
    };
    let (mut freed, mut retired) = (0, 0);
    for probe in grid.probes() {
        let p = probe.0 as usize;
        let (from, to) = (grid.grid_point(probe), moved.positions[p]);
        assert_eq!(still.positions[p], from);
        // Rounding of a difference of positions beside the bound.
        assert!(
            ((to - from) / grid.spacing()).length() < rule.max_offset + 1e-5,
            "probe {p} moved from {from} to {to}"
        );
        for (placement, at) in [(&moved, to), (&still, from)] {
            match placement.states[p] {
                ProbeState::Active => assert!(!is_inside(at), "probe {p} is active inside something, at {at}"),
                state => assert_eq!(state, ProbeState::NeverSampled),
            }
        }
        freed += usize::from(is_inside(from) && moved.states[p] == ProbeState::Active);
        retired += usize::from(is_inside(to) && moved.states[p] == ProbeState::NeverSampled);
    }
    // The blocks hold some that come free and some that do not; the outermost lie behind the walls.
    assert!(freed > 0 && retired > 0, "{freed} came free, {retired} stayed inside");
    assert!(moved.relocated > 0 && still.relocated == 0);
}

/// A probe in the open with nothing within one spacing is not asked for.
#[test]
fn ddgi_retires_probes_far_from_everything() {
    let scene = scene("furnace");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let middle = scene.mesh.bounds().map(|(low, high)| 0.5 * (low + high)).unwrap();
    let active = |spacing: f32| {
        let grid = Grid::from_parts(middle.as_dvec3(), Vec3::splat(spacing), glam::UVec3::ONE).unwrap();
        let (grid, _) = grid.relative_to(glam::DVec3::ZERO);
        let settings = PlacementSettings { rule: PlacementRule::Ddgi(DdgiSettings::default()), ..Default::default() };
        placed(&world, &grid, &settings).count(ProbeState::Active) == 1
    };
    // The walls of the room are 1 m away.
    assert!(active(1.2) && !active(0.5));
}
