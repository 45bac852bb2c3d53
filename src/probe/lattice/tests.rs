//! The grid against what counting says.

mod mixed;

use glam::{DVec3, UVec3, Vec3};
use proptest::prelude::*;

use super::Grid;
use super::grid::{CellIndex, ProbeIndex};

fn grid(divisions: [u32; 3]) -> Grid {
    Grid::from_parts(DVec3::new(10.0, -5.0, 3.0), Vec3::new(1.0, 0.5, 2.0), UVec3::from(divisions)).unwrap()
}

const SHAPES: [[u32; 3]; 5] = [[4, 3, 5], [2, 2, 2], [1, 1, 4], [1, 1, 1], [3, 1, 2]];

proptest! {
    /// Trilinear weights reproduce a linear function, in every cell, along every axis that has more than one layer.
    #[test]
    fn weights_of_the_corners_meet_the_point(x in 0.0f32..3.0, y in 0.0f32..1.0, z in 0.0f32..8.0) {
        let grid = grid([4, 3, 5]);
        let point = Vec3::new(x, y, z);
        let cell = grid.cell(point);
        let weight = |i: usize| {
            let along = |bit: usize, f: f32| if i >> bit & 1 == 1 { f } else { 1.0 - f };
            along(0, cell.fraction.x) * along(1, cell.fraction.y) * along(2, cell.fraction.z)
        };
        let corners = grid.corners_around(&cell);
        let met: Vec3 = (0..8).map(|i| grid.grid_point(corners[i]) * weight(i)).sum();
        // A few roundings of coordinates up to 8.
        prop_assert!((met - point).abs().max_element() < 1e-5, "{met} instead of {point}");
        prop_assert!(grid.is_within(point));
    }

    /// Points outside use the nearest cell, at its face.
    #[test]
    fn points_outside_use_the_rim(x in -9.0f32..9.0, y in -9.0f32..9.0, z in -20.0f32..20.0) {
        let grid = grid([4, 3, 5]);
        let point = Vec3::new(x, y, z);
        let (low, high) = grid.hull(0.0);
        let nearest = point.clamp(low, high);
        prop_assert_eq!(grid.cell(point).fraction, grid.cell(nearest).fraction);
        prop_assert_eq!(grid.cell_index(&grid.cell(point)), grid.cell_index(&grid.cell(nearest)));
        prop_assert_eq!(grid.is_within(point), nearest == point);
    }
}

#[test]
fn cells_and_probes_find_each_other() {
    for shape in SHAPES {
        let grid = grid(shape);
        assert_eq!(grid.probes().count(), grid.probe_count());
        for probe in grid.probes() {
            let found: Vec<CellIndex> = grid.cells_of(probe).collect();
            let expected: Vec<CellIndex> = grid.cells().filter(|&cell| grid.corners(cell).contains(&probe)).collect();
            assert_eq!(found, expected, "{probe:?} of {shape:?}");
            let coordinate = grid.coordinate(probe);
            let at_rim = (0..3).any(|axis| coordinate[axis] == 0 || coordinate[axis] + 1 == shape[axis]);
            assert_eq!(grid.is_at_rim(probe), at_rim);
            assert_eq!(grid.grid_point(probe), coordinate.as_vec3() * Vec3::new(1.0, 0.5, 2.0));
        }
    }
}

#[test]
fn rings_are_layers_around_a_cell() {
    for shape in SHAPES {
        let grid = grid(shape);
        for cell in grid.cells() {
            let corners = grid.corners(cell).map(|probe| grid.coordinate(probe).as_ivec3());
            let (low, high) = (corners[0], corners[7]);
            // Steps along the axis on which a probe is farthest from the cell. A cell of one layer is as wide as any other.
            let layer = |probe: &ProbeIndex| {
                let c = grid.coordinate(*probe).as_ivec3();
                (low - c).max(c - high.max(low + 1)).max_element().max(0)
            };
            for ring in 0..4 {
                let found: Vec<ProbeIndex> = grid.ring(cell, ring).collect();
                let expected: Vec<ProbeIndex> = grid.probes().filter(|p| layer(p) == ring as i32).collect();
                assert_eq!(found, expected, "ring {ring} around {cell:?} of {shape:?}");
            }
        }
    }
}

#[test]
fn boxes_meet_the_cells_that_they_overlap() {
    let grid = grid([4, 3, 5]);
    for (low, high, margin) in [
        (Vec3::new(0.2, 0.1, 0.3), Vec3::new(1.4, 0.2, 5.0), 0.0),
        (Vec3::new(0.9, 0.6, 1.0), Vec3::new(0.95, 0.7, 1.1), 0.2),
        (Vec3::splat(-9.0), Vec3::splat(-8.0), 0.0),
        (Vec3::splat(-9.0), Vec3::splat(99.0), 0.5),
    ] {
        let (grid_low, grid_high) = grid.hull(0.0);
        let reach = grid.spacing() * margin;
        // Beyond the hull the cells at the rim are met.
        let (low_met, high_met) = ((low - reach).clamp(grid_low, grid_high), (high + reach).clamp(grid_low, grid_high));
        let overlaps = |cell: &CellIndex| {
            let (corner, sides) = grid.cell_box(*cell);
            // The upper face of the last cell belongs to it.
            let past = (corner + sides).cmpgt(low_met) | (corner + sides).cmpeq(grid_high);
            corner.cmple(high_met).all() && past.all()
        };
        let found: Vec<CellIndex> = grid.cells_near(low, high, margin).collect();
        let expected: Vec<CellIndex> = grid.cells().filter(overlaps).collect();
        assert_eq!(found, expected, "{low} to {high}");
        let outside = (high + reach).cmplt(grid_low).any() || (low - reach).cmpgt(grid_high).any();
        let in_part = (low - reach).cmplt(grid_low).any() || (high + reach).cmpgt(grid_high).any();
        assert_eq!(grid.is_beyond(low, high, margin), (outside, in_part));
    }
}

#[test]
fn cells_have_coordinates_of_their_own() {
    let grid = grid([4, 3, 5]);
    for cell in grid.cells() {
        let (corner, sides) = grid.cell_box(cell);
        assert!(grid.cell_from_scene(cell, corner).abs().max_element() < 1e-6);
        assert!((grid.cell_from_scene(cell, corner + sides) - 1.0).abs().max_element() < 1e-6);
        assert_eq!(grid.cell_index(&grid.cell(corner + 0.5 * sides)), cell);
        assert_eq!(grid.fraction_in(&grid.cell(corner + 0.5 * sides), corner - sides), Vec3::ZERO);
    }
}

#[test]
fn a_moved_origin_moves_everything() {
    let grid = grid([2, 2, 2]);
    let (moved, shift) = grid.relative_to(DVec3::new(9.0, -5.0, 0.0));
    assert_eq!(shift, Vec3::new(1.0, 0.0, 3.0));
    assert_eq!(moved.grid_point(ProbeIndex(7)), grid.grid_point(ProbeIndex(7)) + shift);
    assert_eq!(moved.origin_world(), grid.origin_world());
}

#[test]
fn numbers_that_make_no_grid_are_refused() {
    let make = |spacing: Vec3, divisions: UVec3| Grid::from_parts(DVec3::ZERO, spacing, divisions);
    assert!(make(Vec3::ONE, UVec3::ONE).is_some());
    for (spacing, divisions) in [
        (Vec3::ONE, UVec3::new(2, 0, 2)),
        (Vec3::new(1.0, 0.0, 1.0), UVec3::ONE),
        (Vec3::new(1.0, f32::NAN, 1.0), UVec3::ONE),
        (Vec3::new(1.0, f32::INFINITY, 1.0), UVec3::ONE),
        (Vec3::ONE, UVec3::splat(u32::MAX)),
    ] {
        assert_eq!(make(spacing, divisions), None, "{spacing} {divisions}");
    }
    assert_eq!(Grid::from_parts(DVec3::NAN, Vec3::ONE, UVec3::ONE), None);
}
