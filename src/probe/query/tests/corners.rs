//! Which probes are asked, and which of them are left out: cells, masks, states. The case is that of [`super::by_hand`].

use glam::Vec3;

use super::by_hand::{P, asking, assert_close, check, check_at, eight, irradiance, trilinear};
use super::fixture::{Fixture, ORIGIN, SPACING, point};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{QueryPoint, Visibility};

#[test]
fn probes_are_the_corners_of_the_second_cell() {
    let fixture = Fixture::new([3, 2, 2], irradiance);
    // Fractions (1/4, 3/8, 3/4) of the cell that begins at probe (1, 0, 0); probe (x, y, z) has the index x + 3·(y + 2·z).
    let at = QueryPoint { position: P + Vec3::new(SPACING.x, 0.0, 0.0), ..asking() };
    let (probes, weights) = fixture.weights(&at, Visibility::Stored);
    assert_eq!(probes, [1, 2, 4, 5, 7, 8, 10, 11]);
    assert_close(weights, trilinear(0xFF), "weight");
    // (15·2² + 5·3² + 9·5² + 3·6² + 45·8² + 15·9² + 27·11² + 9·12²)/128.
    assert_close([fixture.look_up(&at, Visibility::Stored)[1]], [71.0625], "channel");
}

#[test]
fn points_beyond_the_hull_use_its_face() {
    // Below along x, above along z: fractions (0, 3/8, 1) leave corners 4 and 6, with 5/8 and 3/8.
    let at = QueryPoint { position: Vec3::new(ORIGIN.x - 7.0, P.y, ORIGIN.z + 9.0), ..asking() };
    // (5·4⁴ + 3·4⁶)/8, (5·25 + 3·49)/8, (5·36 + 3·16)/8.
    let weights = [0.0, 0.0, 0.0, 0.0, 0.625, 0.0, 0.375, 0.0];
    check_at(&eight(), &at, Visibility::Stored, weights, [1696.0, 34.0, 28.5]);
}

#[test]
fn exact_masks_hide_corners() {
    let fixture = eight();
    let masked = |mask, irradiance| check_at(&fixture, &asking(), Visibility::Exact(mask), trilinear(mask), irradiance);
    masked(0b0110_1011, [1941.21538, 29.9384615, 43.9846154]);
    masked(0b0001_0110, [198.033898, 20.779661, 44.0847458]);
    masked(0b1001_0001, [2304.21739, 24.8695652, 46.3913043]);
    // Where no probe counts there is no light.
    masked(0, [0.0; 3]);
}

#[test]
fn inactive_probes_weigh_nothing() {
    let mut fixture = eight();
    fixture.deactivate(2, ProbeState::InsideGeometry);
    fixture.deactivate(4, ProbeState::NeverSampled);
    fixture.deactivate(7, ProbeState::InsideGeometry);
    check(&fixture, trilinear(0b0110_1011), [1941.21538, 29.9384615, 43.9846154]);
    // An exact mask hides more, and brings none back.
    check_at(
        &fixture,
        &asking(),
        Visibility::Exact(0b1110_0111),
        trilinear(0b0110_0011),
        [2032.04839, 30.6129032, 43.7419355],
    );
}

#[test]
fn surfaces_mask_corners_by_voxel_and_facing() {
    let mut fixture = Fixture::new([3, 2, 2], |probe| irradiance(if probe == 5 { 9 } else { probe }));
    // P lies in voxel (0, 0, 1) of its cell: number 0 + 2·(0 + 2·1) = 4; facing +z is 4, −z is 5: keys 28 and 29. Its
    // neighbour (1, 0, 1) has number 5, key 34.
    let first: &[(u16, u8)] = &[(26, 0b0000_0001), (28, 0b0110_1011), (29, 0), (34, 0b1001_0001)];
    // The second cell, where the same voxel says something else.
    let second: &[(u16, u8)] = &[(28, 0b0001_0110)];
    // Entry 2, which sees none, has probe 5, (2, 1, 0), to stand in.
    fixture.surface(&[first, second], &[(2, 5)]);
    let up = QueryPoint { position: P, ..point(P, Vec3::Z, Vec3::Z) };
    assert_close(fixture.weights(&up, Visibility::Stored).1, trilinear(0b0110_1011), "weight");
    let next = QueryPoint { position: P + Vec3::new(SPACING.x, 0.0, 0.0), ..up };
    assert_close(fixture.weights(&next, Visibility::Stored).1, trilinear(0b0001_0110), "weight");
    // The facing decides, not the shading normal.
    let leaning = QueryPoint { normal: Vec3::new(6.0, 2.0, 3.0) / 7.0, ..up };
    assert_close(fixture.weights(&leaning, Visibility::Stored).1, trilinear(0b0110_1011), "weight");
    // The far probe alone, whole.
    let down = point(P, Vec3::NEG_Z, Vec3::Z);
    assert_close(fixture.look_up(&down, Visibility::Stored), irradiance(9).map(f64::from), "channel");
    // Where visibility is exact or off, the table does not count.
    assert_close(fixture.weights(&down, Visibility::Exact(0b1001_0001)).1, trilinear(0b1001_0001), "weight");
    assert_close(fixture.weights(&down, Visibility::Off).1, trilinear(0xFF), "weight");
}
