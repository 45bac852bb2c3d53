//! Where all probes hold the same irradiance, every way of asking them returns it: weights are shares of a whole.

use std::f32::consts::PI;

use glam::Vec3;

use super::fixture::{Fixture, ORIGIN, SPACING, point};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Blend, DirectionWeight, QueryPoint, Visibility};
use crate::probe::store::irradiance::IrradianceCurve;

/// Stored in every texel: one value for each channel, W·m⁻², and its image under the curve.
const IRRADIANCE: [f32; 3] = [3.0, 0.7, 0.02];

/// Roundings that may add up, each half a step of f32, 2⁻²⁴ of the value: 8 for the bilinear mean (4 products, their
/// sum, weights that sum to 1 within 3), 5 times that where the fifth power is taken of it, 4 for the power itself and 10
/// for the fifth root; 24 for the mean (8 products, their sum, 8 roundings of the weights' total), twice that where roots
/// are taken and squared, 2 for root and square.
const ROUNDINGS: f32 = 5.0 * 8.0 + 4.0 + 10.0 + 2.0 * 24.0 + 2.0;
const TOLERANCE: f32 = ROUNDINGS / (1 << 24) as f32;

/// Corners 0, 3, 5 and 6: at least one of them on every face and on every edge of the cell.
const TETRAHEDRON: u8 = 0b0110_1001;

const DIRECTIONS: [DirectionWeight; 5] = [
    DirectionWeight::Uniform,
    DirectionWeight::Cosine { floor: 0.05 },
    DirectionWeight::Wrap { offset: 0.0 },
    DirectionWeight::Wrap { offset: 0.2 },
    DirectionWeight::Eccentric { kappa: 0.9 },
];

/// Points in and around the hull of `divisions` probes, with normals and views of all kinds.
fn points(divisions: [u32; 3]) -> Vec<QueryPoint> {
    let cells = divisions.map(|n| n as f32 - 1.0);
    // Shares of the hull: within cells, on probes, edges and faces, beyond one face, beyond an edge, beyond corner 0.
    let places = [
        [0.13, 0.27, 0.81],
        [0.5, 0.5, 0.5],
        [0.74, 0.49, 0.02],
        [0.0, 0.0, 0.0],
        [0.0, 0.3, 0.0],
        [0.6, 1.0, 0.4],
        [0.31, 0.62, 1.7],
        [-0.4, 0.58, 0.33],
        [1.3, -0.2, 0.45],
        [-0.1, -3.0, -0.2],
        [40.0, 0.5, 0.25],
    ];
    let normals = [Vec3::X, Vec3::NEG_Y, Vec3::new(2.0, 3.0, 6.0) / 7.0, Vec3::new(-6.0, 2.0, -3.0) / 7.0];
    let views = [Vec3::Z, Vec3::new(-1.0, 2.0, 2.0) / 3.0];
    let mut points = Vec::new();
    for (i, place) in places.into_iter().enumerate() {
        let position = ORIGIN + SPACING * Vec3::from_array(place) * Vec3::from_array(cells).max(Vec3::ONE);
        points.extend(normals.map(|normal| point(position, normal, views[i % 2])));
    }
    points
}

/// Probes that hold the same irradiance but differ in everything else: place, distances, state.
fn furnace(divisions: [u32; 3]) -> Fixture {
    let mut fixture = Fixture::new(divisions, |_| IRRADIANCE);
    for p in 0..fixture.volume.positions.len() {
        let shift = Vec3::new((p % 3) as f32 - 1.0, (p % 5) as f32 - 2.0, (p % 7) as f32 - 3.0);
        fixture.place(p, fixture.volume.positions[p] + SPACING * shift * 0.06);
    }
    // Corner 4 of the first cell and of no other, so that a tetrahedron of active probes remains in every cell.
    if divisions[2] > 1 {
        fixture.deactivate((divisions[0] * divisions[1]) as usize, ProbeState::InsideGeometry);
    }
    fixture
}

/// Sets one of the visibility tests: none, moments, tiles, or the table of surfaces.
fn set_test(fixture: &mut Fixture, test: usize, cells: usize) {
    // Where there is one layer, only the lower four corners weigh.
    let least = if fixture.volume.grid.divisions().z == 1 { 0b0000_1111 } else { TETRAHEDRON };
    let mask = |voxel: u16, facing: u16| least | ((voxel * 6 + facing) as u8).wrapping_mul(37);
    let table: Vec<(u16, u8)> =
        (0..8).flat_map(|v| (0..6).map(move |facing| (v * 6 + facing, mask(v, facing)))).collect();
    match test {
        0 => {}
        1 => fixture.moments(3.0, 0.05, |p, c, r| [0.3 + 0.1 * (p + c) as f32, 0.2 + 0.05 * r as f32]),
        3 => fixture.tiles(1.0, 0.0, |p, c, r| [0.9 - 0.1 * (p + r) as f32 / 8.0, 0.4 + 0.02 * c as f32]),
        2 => fixture.moments(1.0, 0.0, |p, c, r| [2.5 - 0.1 * (p + r) as f32, 0.4 + 0.02 * c as f32]),
        _ => fixture.surface(&vec![&table[..]; cells], &[]),
    }
}

/// Every combination of the factors but direction and test.
fn for_every_other_setting(fixture: &mut Fixture, mut check: impl FnMut(&Fixture)) {
    for blend in [Blend::Linear, Blend::SquareRoot] {
        for trilinear_floor in [0.0, 0.001, 0.3] {
            for weight_floor in [0.0, 1e-6, 0.1] {
                for crush_below in [0.0, 0.2, 0.9] {
                    for (normal_bias, view_bias) in [(0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.045, 0.18)] {
                        for biased_cell in [false, true] {
                            let settings = &mut fixture.settings;
                            settings.blend = blend;
                            settings.trilinear_floor = trilinear_floor;
                            settings.weight_floor = weight_floor;
                            settings.crush_below = crush_below;
                            settings.normal_bias = normal_bias;
                            settings.view_bias = view_bias;
                            settings.biased_cell = biased_cell;
                            check(fixture);
                        }
                    }
                }
            }
        }
    }
}

fn assert_irradiance(fixture: &Fixture, point: &QueryPoint, visibility: Visibility) {
    let found = fixture.look_up(point, visibility);
    for (found, expected) in found.into_iter().zip(IRRADIANCE) {
        let off = (found / expected - 1.0).abs();
        assert!(off <= TOLERANCE, "{found} instead of {expected} at {point:?}, {visibility:?}, {:?}", fixture.settings);
    }
}

#[test]
fn every_combination_of_settings_returns_what_all_probes_hold() {
    let fifth_roots = IRRADIANCE.map(|e| (e / (2.0 * PI)).powf(0.2));
    for (divisions, cells) in [([2, 2, 2], 1), ([3, 2, 2], 2), ([2, 3, 1], 2)] {
        let points = points(divisions);
        for (curve, stored) in [(IrradianceCurve::Linear, IRRADIANCE), (IrradianceCurve::Gamma5Over2Pi, fifth_roots)] {
            for test in 0..5 {
                let mut fixture = furnace(divisions);
                fixture.store(curve, |_, _, _| stored);
                set_test(&mut fixture, test, cells);
                for direction in DIRECTIONS {
                    fixture.settings.direction = direction;
                    for_every_other_setting(&mut fixture, |fixture| {
                        for point in &points {
                            assert_irradiance(fixture, point, Visibility::Stored);
                        }
                        if fixture.settings.biased_cell {
                            return;
                        }
                        // Within the hull every exact mask with an active corner of it does as well.
                        assert_irradiance(fixture, &points[0], Visibility::Off);
                        assert_irradiance(fixture, &points[0], Visibility::Exact(TETRAHEDRON));
                        assert_irradiance(fixture, &points[0], Visibility::Exact(0b0000_0001));
                    });
                }
            }
        }
    }
}
