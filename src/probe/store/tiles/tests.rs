//! Tiles of surroundings whose distances are known.

use glam::{DVec3, UVec3};

use super::*;
use crate::math::fibonacci;
use crate::probe::lattice::tree::Tree;
use crate::probe::store::Occlusion;

const SPACING: Vec3 = Vec3::new(1.0, 2.0, 0.5);

fn grid() -> Grid {
    Grid::from_parts(DVec3::ZERO, SPACING, UVec3::splat(2)).unwrap()
}

/// One probe for all eight points.
fn coarse() -> Grid {
    let tree = Tree::new(UVec3::ONE, 1, |_, _| false);
    grid().with_index(1, tree.index().to_vec()).unwrap()
}

/// Probe 0's tile where surfaces lie at these distances.
fn tile(grid: &Grid, resolution: usize, distance: impl Fn(Vec3) -> f32) -> Tiles {
    let mut builder = TilesBuilder::new(&TileStore { resolution, exponent: 50.0 }, grid, 1);
    let rays = builder.rays(0);
    let clamped = |(direction, most): (Vec3, f32)| [f64::from(distance(direction).min(most))].into_iter().collect();
    let distances: Vec<Moments> = rays.into_iter().map(clamped).collect();
    let filtered = builder.filter(0, &distances);
    builder.set(0, &filtered);
    builder.finish()
}

#[test]
fn the_box_has_its_faces_one_spacing_away() {
    assert_eq!(way_to_box(Vec3::X, SPACING), 1.0);
    assert_eq!(way_to_box(Vec3::NEG_Y, SPACING), 2.0);
    // Towards a corner: all three faces at once.
    let way = way_to_box(SPACING.normalize(), SPACING);
    assert!((way - SPACING.length()).abs() < 1e-6);
    assert_eq!(box_sides(&grid(), ProbeIndex(0)), SPACING);
    assert_eq!(box_sides(&coarse(), ProbeIndex(0)), 2.0 * SPACING);
}

#[test]
fn a_sphere_of_surfaces_is_found_everywhere() {
    for (grid, farther) in [(grid(), 1.0), (coarse(), 2.0)] {
        // Nearer than the nearest face.
        let radius = 0.4 * farther;
        let tiles = tile(&grid, 32, |_| radius);
        let sides = box_sides(&grid, ProbeIndex(0));
        for i in 0..200 {
            let direction = fibonacci::direction(i, 200);
            let mean = tiles.distance(0, direction, sides).x;
            // Shares of a way that bends at the edges of the box are bilinear among texels of up to 0.15 rad.
            assert!((mean / radius - 1.0).abs() < 0.12, "{direction}: {mean}");
        }
        let at = |share: f32| tiles.visibility(0, Vec3::new(0.6, 0.64, 0.48) * radius * share, sides, farther, 0.0);
        assert_eq!(at(0.8), 1.0);
        assert!(at(1.3) < 1e-3, "{}", at(1.3));
        // A point that counts as nearer by as much is before the surface again.
        let direction = Vec3::new(0.6, 0.64, 0.48);
        assert_eq!(tiles.visibility(0, direction * radius * 1.3, sides, farther, 0.5 * radius), 1.0);
    }
}

#[test]
fn what_meets_nothing_reaches_the_box() {
    let tiles = tile(&grid(), 16, |_| f32::INFINITY);
    let Tiles { maps, .. } = &tiles;
    // Means over 3×3 texels under the lobe of what lies up to an edge of the box nearer.
    assert!(maps.probe(0).iter().all(|t| t.x <= 1.0 && t.x > 0.4), "{:?}", maps.probe(0));
    // Probes that were not captured hold nothing.
    assert!(maps.probe(1).iter().all(|t| *t == Vec2::ZERO));
}

#[test]
fn a_mean_is_that_of_the_lobe() {
    // Texel (1, 1) of 4² and its neighbours, by hand: 1 on one side of the plane x = 0, the way to the box on the other.
    let half = |d: Vec3| if d.x > 0.0 { 0.3 } else { f32::INFINITY };
    let tiles = tile(&grid(), 4, half);
    let directions = texel_directions(4);
    let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (row, column) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
        let d = directions[row * 4 + column];
        let w = f64::from(directions[5].dot(d)).max(0.0).powf(50.0);
        let r = f64::from(half(d).min(way_to_box(d, SPACING)));
        (weight, sum, squares) = (weight + w, sum + w * r, squares + w * r * r);
    }
    let mean = sum / weight;
    let deviation = (squares / weight - mean * mean).sqrt();
    let way = f64::from(way_to_box(directions[5], SPACING));
    // Interior texel (1, 1) with a border of one, six texels a row.
    let found = tiles.maps.probe(0)[2 * 6 + 2];
    assert!((f64::from(found.x) - (mean / way).min(1.0)).abs() < 1e-5, "{found} {}", mean / way);
    assert!((f64::from(found.y) - deviation / way).abs() < 1e-4, "{found} {}", deviation / way);
}

#[test]
fn files_hold_shares() {
    let tiles = tile(&grid(), 16, |d| 0.2 + 0.1 * d.x);
    let mut container = Container::default();
    let mut losses = EncodingLosses::default();
    Occlusion::Tiles(tiles.clone()).write(&mut container, &mut losses);
    assert_eq!(container.metadata["encoding.distance"], "cell_box");
    assert!(!container.has("distance_scale"));
    assert_eq!(container.tensors["distance"].shape, [8, 18, 18, 2]);
    assert_eq!(container.tensors["distance"].bytes.len(), 8 * TileStore::default().runtime_bytes(1));
    let read = Occlusion::read(&container, &grid(), 1).unwrap();
    let back = read.tiles().unwrap();
    for (a, b) in tiles.maps.texels.iter().zip(&back.maps.texels) {
        // Half a step.
        assert!((*a - *b).abs().max_element() <= 0.51 / 65_535.0, "{a} came back as {b}");
    }
    // No deviation of a captured tile is stored as 0.
    assert!(back.maps.probe(0).iter().all(|t| t.y >= LEAST_DEVIATION));
    assert_eq!((read.test(), read.rank()), (Some("chebyshev"), 1));
    assert!(Tiles::read(&container, 7, 1).is_err());
    container.put_json("distance.exponent", &f32::MAX);
    assert!(Tiles::read(&container, 8, 1).is_err());
}
