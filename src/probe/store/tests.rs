//! What is stored and asked, on tables and maps made by hand.

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};
use proptest::prelude::*;

use super::encode::ColorFormat;
use super::irradiance::{IrradianceCurve, IrradianceStore, OctahedralStore};
use super::layout::LayoutSettings;
use super::map::OctahedralMaps;
use super::moments::chebyshev;
use super::surface::{Facing, Seen, SurfaceVisibility, TableTest, key, voxel_of_key};
use super::{Irradiance, Occlusion};
use crate::probe::container::{Container, EncodingLosses};
use crate::probe::lattice::Grid;
use crate::probe::lattice::grid::ProbeIndex;

fn grid() -> Grid {
    Grid::from_parts(DVec3::ZERO, Vec3::ONE, UVec3::new(3, 2, 2)).unwrap()
}

fn facing(normal: Vec3) -> Facing {
    Facing::of(normal)
}

/// Two cells of 4³ voxels; the first knows three voxels of surfaces that face up, the second nothing.
fn table() -> SurfaceVisibility {
    let up = |x: u32, y: u32, z: u32| key(UVec3::new(x, y, z), facing(Vec3::Y), 4);
    let mut entries = [(up(0, 0, 0), 0b0000_0011u8), (up(1, 0, 0), 0), (up(3, 3, 3), 0b1000_0000)];
    entries.sort_by_key(|entry| entry.0);
    let unseen = entries.iter().position(|entry| entry.1 == 0).unwrap() as u32;
    SurfaceVisibility {
        voxels_per_cell: 4,
        cell_start: vec![0, 3, 3],
        keys: entries.iter().map(|entry| entry.0).collect(),
        masks: entries.iter().map(|entry| entry.1).collect(),
        far: vec![(unseen, 11)],
    }
}

fn look_up(table: &SurfaceVisibility, at: Vec3, normal: Vec3) -> Seen {
    let grid = grid();
    table.look_up(&grid, &grid.cell(at), at, facing(normal), &TableTest::default())
}

#[test]
fn a_surface_sees_what_its_voxel_says() {
    let table = table();
    let mask = |at: [f32; 3]| look_up(&table, Vec3::from(at), Vec3::Y).mask;
    assert_eq!(mask([0.1, 0.1, 0.1]), 0b0000_0011);
    assert_eq!(mask([0.9, 0.9, 0.9]), 0b1000_0000);
    // The nearest voxel that faces the same way, as far as it reaches.
    assert_eq!(mask([0.1, 0.1, 0.6]), 0b0000_0011);
    assert_eq!(mask([0.1, 0.9, 0.9]), 0b1000_0000);
    let near = TableTest { reach_voxels: 1, strip: 0.25 };
    let (at, grid) = (Vec3::new(0.1, 0.1, 0.6), grid());
    assert_eq!(table.look_up(&grid, &grid.cell(at), at, facing(Vec3::Y), &near).mask, 0);
    // No surface of that facing is known, but others are.
    assert_eq!(look_up(&table, Vec3::splat(0.1), Vec3::X).mask, 0);
    // Nothing is known at all.
    assert_eq!(look_up(&table, Vec3::new(1.5, 0.5, 0.5), Vec3::Y), Seen { mask: u8::MAX, far: None });
    // Beyond the hull the nearest entry counts, however far it is.
    assert_eq!(look_up(&table, Vec3::new(0.1, -5.0, 0.6), Vec3::Y).mask, 0b0000_0011);
}

#[test]
fn a_surface_that_sees_nothing_asks_beside_and_farther() {
    let table = table();
    // Voxel (1,0,0): its last quarter towards voxel 0 may use that one.
    assert_eq!(look_up(&table, Vec3::new(0.26, 0.1, 0.1), Vec3::Y), Seen { mask: 0b0000_0011, far: None });
    assert_eq!(look_up(&table, Vec3::new(0.40, 0.1, 0.1), Vec3::Y), Seen { mask: 0, far: Some(ProbeIndex(11)) });
    let at = Vec3::new(0.26, 0.1, 0.1);
    let narrow = TableTest { strip: 0.0, ..Default::default() };
    let seen = table.look_up(&grid(), &grid().cell(at), at, facing(Vec3::Y), &narrow);
    assert_eq!(seen.far, Some(ProbeIndex(11)));
}

#[test]
fn every_point_sees_what_the_nearest_surface_that_faces_it_sees() {
    let (table, grid) = (table(), grid());
    let seen = |at: [f32; 3], normal: Vec3| {
        let at = Vec3::from(at);
        table.everywhere(&grid, &grid.cell(at), at, facing(normal), &TableTest::default())
    };
    let mask = |at: [f32; 3]| seen(at, Vec3::X).mask;
    // Voxel centres at 1/8 and 7/8: the first faces up to the middle of the cell, the last faces away from it.
    assert_eq!(mask([0.5, 0.5, 0.5]), 0b0000_0011);
    assert_eq!(mask([0.95, 0.7, 0.95]), 0b0000_0011);
    // Half a voxel below its centre a surface may still lie below the point; above it does.
    assert_eq!(mask([0.9, 0.8, 0.9]), 0b1000_0000);
    assert_eq!(mask([0.9, 0.99, 0.9]), 0b1000_0000);
    // An entry that sees nothing has no answer, and a cell without surfaces hides nothing.
    assert_eq!(mask([0.4, 0.2, 0.1]), 0b0000_0011);
    assert_eq!(mask([1.5, 0.5, 0.5]), u8::MAX);
    // Where there is an entry of its own, it counts, with the probe farther away of one that sees no other.
    assert_eq!(seen([0.1, 0.1, 0.1], Vec3::Y).mask, 0b0000_0011);
    assert_eq!(seen([0.40, 0.1, 0.1], Vec3::Y), Seen { mask: 0, far: Some(ProbeIndex(11)) });
    // The plain look-up takes the nearest entry of the same facing, although it faces away from the point.
    let at = [0.95, 0.7, 0.95];
    assert_eq!(look_up(&table, Vec3::from(at), Vec3::Y).mask, 0b1000_0000);
    assert_eq!(seen(at, Vec3::Y).mask, 0b0000_0011);
}

#[test]
fn keys_and_voxels_are_inverse() {
    for n in [1, 4, 22] {
        for voxel in [UVec3::ZERO, UVec3::new(n - 1, 0, n / 2), UVec3::splat(n - 1)] {
            for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
                let key = key(voxel, facing(normal), n);
                assert_eq!(voxel_of_key(key, n), voxel);
                let table = SurfaceVisibility {
                    voxels_per_cell: n,
                    cell_start: vec![0, 1],
                    keys: vec![key],
                    masks: vec![7],
                    far: Vec::new(),
                };
                let entry = table.entries(crate::probe::lattice::grid::CellIndex(0)).next().unwrap();
                assert_eq!((entry.voxel, entry.facing, entry.mask), (voxel, normal, 7));
            }
        }
    }
}

/// Random irradiance of two probes.
fn irradiance(format: ColorFormat, curve: IrradianceCurve, border: usize, values: &[f32]) -> Irradiance {
    let store = IrradianceStore::Octahedral(OctahedralStore { resolution: 3, format, curve });
    let mut irradiance = store.zeros(2, border);
    irradiance.set_each(|p, _| Some(((0..9).map(|o| Vec3A::splat(values[9 * p + o])).collect(), ())));
    irradiance
}

proptest! {
    #[test]
    fn irradiance_comes_back_from_the_file(values in prop::collection::vec(0.01f32..50.0, 18), border in 0usize..2) {
        for curve in [IrradianceCurve::Linear, IrradianceCurve::Gamma5Over2Pi] {
            for format in [ColorFormat::F32, ColorFormat::F16, ColorFormat::R11G11B10F] {
                let stored = irradiance(format, curve, border, &values);
                let mut container = Container::default();
                stored.write(&mut container, &mut EncodingLosses::default());
                let read = Irradiance::read(&container, 2, border).unwrap();
                // The curve is a fifth power; rounding of the curve itself beside it.
                let tolerance = (1.0 + format.rounding() as f32).powi(5) - 1.0 + 2e-6;
                for p in 0..2 {
                    for (a, b) in stored.probe(p).zip(read.probe(p)) {
                        prop_assert!((a - b).abs().max_element() <= tolerance * a.max_element(), "{a} {b} {format:?}");
                    }
                }
                prop_assert_eq!(read.runtime_bytes(), stored.runtime_bytes());
            }
        }
    }

    /// Chebyshev's bound is 1 before the mean, falls behind it, and never leaves 0 to 1.
    #[test]
    fn the_bound_falls_behind_the_mean(mean in 0.1f32..10.0, deviation in 0.0f32..5.0, a in 0.0f32..20.0, b in 0.0f32..20.0) {
        let maps = OctahedralMaps::new(1, 2, 1, Vec2::new(mean, deviation));
        let at = |distance: f32| chebyshev(&maps, 0, Vec3::new(0.6, 0.0, 0.8) * distance);
        let (near, far) = (at(a.min(b)), at(a.max(b)));
        prop_assert!((0.0..=1.0).contains(&near) && (0.0..=1.0).contains(&far));
        // Rounding of the distance and of the mean beside the comparison.
        prop_assert!(far <= near + 1e-5, "{near} at {}, {far} at {}", a.min(b), a.max(b));
    }
}

#[test]
fn the_layout_counts_every_byte() {
    let store = IrradianceStore::default();
    // 10² texels of 4 bytes with the border.
    assert_eq!(store.runtime_bytes(1), 400);
    assert_eq!(store.zeros(3, 1).runtime_bytes(), 400);
    let layout = LayoutSettings::default();
    assert_eq!(layout.head_bytes(true) + layout.head_bytes(false), 14);
    let table = table();
    // 3 starts of 4 bytes, 3 keys of 2, 3 masks, one pair of 8.
    assert_eq!(table.bytes(), 12 + 6 + 3 + 8);
    let occlusion = Occlusion::Surface(table);
    let mut container = Container::default();
    occlusion.write(&mut container, &mut EncodingLosses::default());
    let written: usize = container.tensors.values().map(|t| t.bytes.len()).sum();
    assert_eq!(occlusion.runtime_bytes(1, &layout), written as f64);
    assert_eq!(Occlusion::read(&container, &grid(), 1).unwrap(), occlusion);
}

#[test]
fn tables_that_point_nowhere_are_refused() {
    let written = |change: fn(&mut SurfaceVisibility)| {
        let mut table = table();
        change(&mut table);
        let mut container = Container::default();
        Occlusion::Surface(table).write(&mut container, &mut EncodingLosses::default());
        Occlusion::read(&container, &grid(), 1)
    };
    assert!(written(|_| {}).is_ok());
    for (change, words) in [
        ((|t| t.cell_start[1] = 9) as fn(&mut SurfaceVisibility), "visibility_start"),
        (|t| t.cell_start[0] = 1, "visibility_start"),
        (|t| t.far = vec![(99, 0)], "visibility_far"),
        (|t| t.far = vec![(0, 99)], "visibility_far"),
        (|t| t.voxels_per_cell = 23, "voxels_per_cell"),
        (|t| t.cell_start.truncate(2), "visibility_start"),
    ] {
        let error = written(change).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}
