//! Mixed grids against counting, against every segment tried on every triangle, and against uniform ones.

use std::collections::HashSet;
use std::path::Path;

use glam::{DVec3, UVec3, Vec3};

use super::super::Refine;
use super::super::grid::{CellIndex, GridSettings, ProbeIndex};
use super::super::tree::Tree;
use crate::probe::lattice::Grid;
use crate::scene::{self, LoadOptions, Scene, TriangleIndex};

const LEVELS: u32 = 3;
const BASE: UVec3 = UVec3::new(2, 1, 3);

/// Cells of a made-up subdivision: irregular, and of every level.
fn divides(level: u32, cell: UVec3) -> bool {
    !(cell.x * 7 + cell.y * 5 + cell.z * 3 + level).is_multiple_of(3)
}

fn points() -> Grid {
    let spacing = Vec3::new(0.5, 0.25, 1.0);
    Grid::from_parts(DVec3::new(10.0, -5.0, 3.0), spacing, BASE << LEVELS).unwrap()
}

fn mixed(divides: impl Fn(u32, UVec3) -> bool) -> Grid {
    let tree = Tree::new(BASE, LEVELS, divides);
    points().with_index(LEVELS, tree.index().to_vec()).unwrap()
}

fn all(divisions: UVec3) -> impl Iterator<Item = UVec3> {
    (0..divisions.element_product())
        .map(move |i| UVec3::new(i % divisions.x, i / divisions.x % divisions.y, i / (divisions.x * divisions.y)))
}

#[test]
fn every_finest_cell_finds_its_probe() {
    for tree in [
        Tree::new(BASE, LEVELS, divides),
        Tree::new(BASE, LEVELS, |_, _| true),
        Tree::new(BASE, LEVELS, |_, _| false),
        Tree::new(BASE, LEVELS, |level, _| level < 2),
    ] {
        let (n, base) = (tree.probe_count(), tree.base_count());
        assert_eq!((n - base) % 7, 0);
        assert_eq!(tree.node_count(), (n - base) / 7);
        assert_eq!(tree.index().len(), n + tree.node_count());
        let mut cells = vec![0; n];
        for cell in all(BASE << LEVELS) {
            let probe = tree.probe(cell);
            let (low, width) = (tree.low(probe), tree.width(probe));
            assert!(cell.cmpge(low).all() && cell.cmplt(low + width).all(), "{cell} in {low}, {width} wide");
            cells[probe as usize] += 1;
        }
        assert!((0..n).all(|p| cells[p] == tree.width(p as u32).pow(3)), "every probe has its cells, and no other");
    }
}

#[test]
fn the_index_is_breadth_first() {
    // Two base cells, the second of which is subdivided, and of its children the first and the last.
    let tree = Tree::new(UVec3::new(2, 1, 1), 2, |level, cell| match level {
        0 => cell.x == 1,
        _ => cell == UVec3::new(2, 0, 0) || cell == UVec3::new(3, 1, 1),
    });
    // 1 + 6 + 16 probes. Base cells; children of node 0, of node 1, of node 2.
    let expected: Vec<i32> = [0, 23].into_iter().chain([24]).chain(1..7).chain([25]).chain(7..23).collect();
    assert_eq!(tree.index(), expected);
    assert_eq!((tree.low(0), tree.width(0)), (UVec3::ZERO, 4));
    // Child 1 of the first node is +x; its first child's first cell.
    assert_eq!((tree.low(1), tree.width(1)), (UVec3::new(6, 0, 0), 2));
    assert_eq!((tree.low(7), tree.width(7)), (UVec3::new(4, 0, 0), 1));
    assert_eq!((tree.low(22), tree.width(22)), (UVec3::new(7, 3, 3), 1));
}

#[test]
fn indices_of_no_subdivision_are_refused() {
    let index = Tree::new(BASE, LEVELS, divides).index().to_vec();
    let read = |levels, index: Vec<i32>| points().with_index(levels, index);
    assert_eq!(read(LEVELS, index.clone()).unwrap(), mixed(divides));
    let changed = |change: fn(&mut Vec<i32>)| {
        let mut index = index.clone();
        change(&mut index);
        read(LEVELS, index).is_err()
    };
    assert!(changed(|i| i.truncate(3)) && changed(|i| i.truncate(i.len() - 1)) && changed(|i| i.extend([0; 8])));
    assert!(changed(|i| i[0] = -1) && changed(|i| i[0] = i32::MAX) && changed(|i| i.rotate_right(1)));
    assert!(changed(|i| i.iter_mut().for_each(|entry| *entry = 0)));
    for levels in [0, 1, 2, 4, 9, u32::MAX] {
        assert!(read(levels, index.clone()).is_err(), "{levels} levels");
    }
}

#[test]
fn cells_and_probes_find_each_other() {
    let grid = mixed(divides);
    for probe in grid.probes() {
        let found: HashSet<CellIndex> = grid.cells_of(probe).collect();
        let expected = grid.cells().filter(|&cell| grid.corners(cell).contains(&probe)).collect();
        assert_eq!(found, expected, "{probe:?}");
        // At the middle of its points.
        let width = grid.width(probe) as f32;
        let middle = (grid.coordinate(probe).as_vec3() + 0.5 * (width - 1.0)) * grid.spacing();
        assert_eq!(grid.grid_point(probe), middle);
        let (low, high) = (grid.coordinate(probe), grid.coordinate(probe) + grid.width(probe));
        let at_rim = low.cmpeq(UVec3::ZERO).any() || high.cmpeq(BASE << LEVELS).any();
        assert_eq!(grid.is_at_rim(probe), at_rim);
    }
    for cell in grid.cells().step_by(7) {
        let corners: HashSet<ProbeIndex> = grid.corners(cell).into_iter().collect();
        assert_eq!(grid.ring(cell, 0).collect::<HashSet<_>>(), corners);
    }
}

#[test]
fn a_grid_subdivided_everywhere_is_the_uniform_one() {
    let (fine, uniform) = (mixed(|_, _| true), points());
    assert_eq!(fine.probe_count(), uniform.probe_count());
    let point = |grid: &Grid, probe| grid.grid_point(probe).to_array().map(f32::to_bits);
    let streams: HashSet<u64> = fine.probes().map(|p| fine.stream(p)).collect();
    assert_eq!(streams, uniform.probes().map(|p| u64::from(p.0)).collect());
    for cell in uniform.cells() {
        for (a, b) in fine.corners(cell).into_iter().zip(uniform.corners(cell)) {
            assert_eq!(point(&fine, a), point(&uniform, b));
            assert_eq!((fine.stream(a), fine.width(a)), (uniform.stream(b), 1));
        }
    }
    // Streams of probes of other sizes are their own.
    let grid = mixed(divides);
    assert_eq!(grid.probes().map(|p| grid.stream(p)).collect::<HashSet<_>>().len(), grid.probe_count());
}

/// Whether a triangle meets the segment from `a` (left out) to `b` (Möller and Trumbore 1997).
fn crosses(triangle: &[DVec3; 3], a: DVec3, b: DVec3) -> bool {
    let (e1, e2, d) = (triangle[1] - triangle[0], triangle[2] - triangle[0], b - a);
    let p = d.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return false;
    }
    let s = a - triangle[0];
    let u = s.dot(p) / determinant;
    let q = s.cross(e1);
    let v = d.dot(q) / determinant;
    let t = e2.dot(q) / determinant;
    // As wide as the edges of the subdivision.
    u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && t > 0.0 && t <= 1.0
}

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
    scene::load(&path, &LoadOptions::default()).unwrap()
}

#[test]
fn trying_every_segment_on_every_triangle_gives_the_same_cells() {
    // Spacings that put no wall of these scenes, made of round numbers, on a point.
    for (name, spacing, levels) in [("two_rooms_open", 0.4319, 2), ("cornell", 0.1013, 3), ("courtyard", 0.9173, 2)] {
        let scene = load(name);
        let settings = GridSettings { spacing_m: Some(spacing), ..Default::default() };
        let grid = Grid::refined(&settings, Refine::Mixed { levels }, &scene).unwrap();
        let n = grid.divisions();
        let triangles: Vec<[DVec3; 3]> = (0..scene.mesh.triangles.len() as u32)
            .map(|t| scene.mesh.corners(TriangleIndex(t)).map(|c| c.as_dvec3()))
            .collect();
        let point = |c: UVec3| grid.origin().as_dvec3() + c.as_dvec3() * grid.spacing().as_dvec3();
        // Cells, by level and coordinate, that hold both ends of a crossed segment.
        let mut crossed: HashSet<(u32, UVec3)> = HashSet::new();
        for end in all(n) {
            for axis in 0..3 {
                if end[axis] == 0 {
                    continue;
                }
                let mut start = end;
                start[axis] -= 1;
                let within: Vec<u32> = (0..levels).filter(|l| start >> (levels - l) == end >> (levels - l)).collect();
                // Segments whose larger cells are known to be crossed tell nothing new.
                let is_new = within.iter().any(|&level| !crossed.contains(&(level, end >> (levels - level))));
                if is_new && triangles.iter().any(|t| crosses(t, point(start), point(end))) {
                    crossed.extend(within.into_iter().map(|level| (level, end >> (levels - level))));
                }
            }
        }
        let expected = Tree::new(n >> levels, levels, |level, cell| crossed.contains(&(level, cell)));
        let found = grid.tree().unwrap();
        assert_eq!(found, &expected, "{name}");
        assert!(found.probe_count() > found.base_count(), "{name}: nothing is subdivided");
        assert!(found.probe_count() < n.element_product() as usize, "{name}: everything is subdivided");
    }
}

#[test]
fn base_cells_cover_the_uniform_grid_at_its_spacing() {
    let scene = load("two_rooms_open");
    for settings in [
        GridSettings { spacing_m: Some(0.7), ..Default::default() },
        GridSettings { divisions: Some((9, 4, 6)), ..Default::default() },
    ] {
        let uniform = Grid::new(&settings, &scene).unwrap();
        let grid = Grid::refined(&settings, Refine::Mixed { levels: 2 }, &scene).unwrap();
        assert_eq!(grid.spacing(), uniform.spacing());
        assert_eq!(grid.divisions() % 4, UVec3::ZERO);
        let more = grid.divisions() - uniform.divisions();
        assert!(more.cmplt(UVec3::splat(4)).all(), "{more}");
        // Its points are among those of the mixed grid.
        let steps = (uniform.origin_world() - grid.origin_world()) / grid.spacing().as_dvec3();
        assert!((steps - (more / 2).as_dvec3()).abs().max_element() < 1e-6, "{steps}");
        let ((low, high), (inner_low, inner_high)) = (grid.hull(1e-3), uniform.hull(0.0));
        assert!(low.cmple(inner_low).all() && high.cmpge(inner_high).all());
    }
}
