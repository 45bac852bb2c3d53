//! The weights of Three.V8, worked out outside the code for the eight probes of [`super::by_hand`].
//!
//! The way from probe i to its box of (2, 4, 1) is 3/2, 3, 3/2, 3, 7/6, 7/3, 7/3, 3/2 towards P. With the shares below, mean
//! and deviation are products of these.

use glam::{Vec2, Vec3};

use super::by_hand::{P, asking, check, check_at, eight, trilinear};
use super::fixture::{Fixture, ORIGIN, SPACING};
use crate::math::octahedral::oct_from_direction;
use crate::probe::lattice::ProbeIndex;
use crate::probe::query::{DirectionWeight, LookUp, QueryPoint, Visibility, WeightNormal};
use crate::probe::store::irradiance::IrradianceCurve;

const MEANS: [f32; 8] = [0.5, 0.9, 1.0, 0.25, 0.5, 0.75, 0.9, 0.2];
const DEVIATIONS: [f32; 8] = [0.25, 0.5, 0.1, 0.5, 0.3, 0.2, 0.4, 1.0];

fn tiles() -> Fixture {
    let mut fixture = eight();
    fixture.tiles(1.0, 0.0, |i, _, _| [MEANS[i], DEVIATIONS[i]]);
    fixture
}

#[test]
fn the_radius_of_a_circle_seen_from_within() {
    let mut fixture = eight();
    fixture.settings.direction = DirectionWeight::Eccentric { kappa: 0.9 };
    // (0.9c + √(1 − (1 − c²)·0.81))/1.9 · trilinear, with the cosines of the table.
    let weights = [
        0.00674305642,
        0.00435270732,
        0.00556033027,
        0.0078924799,
        0.19048408,
        0.0654246111,
        0.0701076996,
        0.0673058228,
    ];
    check(&fixture, weights, [3604.64706, 36.0415586, 28.6930451]);
    // At 0 it is 1, at 1 it is c in front and 0 behind.
    fixture.settings.direction = DirectionWeight::Eccentric { kappa: 0.0 };
    check(&fixture, trilinear(0xFF), [2228.89844, 29.125, 40.125]);
    fixture.settings.direction = DirectionWeight::Eccentric { kappa: 1.0 };
    let (_, weights) = fixture.weights(&asking(), Visibility::Off);
    let behind = [0, 1, 2].map(|i| weights[i]);
    assert!(behind.iter().all(|w| w.abs() < 1e-6) && (weights[7] / (9.0 / 128.0) - 20.0 / 21.0).abs() < 1e-5);
}

#[test]
fn shares_of_the_way_to_the_box() {
    // σ²/(σ² + (d − μ)²) with d 3 or 7: 1/37, 25/26, 1/101, 4/13, 0.00296638, 0.00783929, 0.0350109, 25/106.
    let weights = [
        0.00316722973,
        0.0375600962,
        0.000696163366,
        0.00721153846,
        0.00104286833,
        0.00091866732,
        0.00738512035,
        0.0165831368,
    ];
    check(&tiles(), weights, [4074.05716, 23.5686624, 54.7836188]);
    check_at(&tiles(), &asking(), Visibility::Off, trilinear(0xFF), [2228.89844, 29.125, 40.125]);
}

#[test]
fn all_factors_together_are_crushed() {
    let mut fixture = tiles();
    fixture.settings.direction = DirectionWeight::Eccentric { kappa: 0.9 };
    fixture.settings.crush_below = 0.2;
    // w³/0.04 below 0.2, w the product of both factors, times the trilinear weight.
    let weights = [
        1.10190116e-8,
        0.00120115297,
        8.43747643e-10,
        0.000651790175,
        3.64915048e-8,
        2.45601951e-7,
        8.30885e-6,
        0.0158740148,
    ];
    check(&fixture, weights, [14668.8721, 58.1648995, 15.3498836]);
}

#[test]
fn the_geometric_normal_weighs_and_shifts() {
    let mut fixture = tiles();
    fixture.settings.direction = DirectionWeight::Eccentric { kappa: 0.9 };
    (fixture.settings.normal_bias, fixture.settings.biased_cell) = (0.05, true);
    let shading = Vec3::new(-0.6, 0.0, 0.8);
    let plain = fixture.weights(&QueryPoint { normal: shading, geometric: Vec3::X, ..asking() }, Visibility::Stored);
    let swapped = QueryPoint { normal: Vec3::X, geometric: shading, ..asking() };
    fixture.settings.weight_normal = WeightNormal::Geometric;
    assert_eq!(fixture.weights(&swapped, Visibility::Stored), plain);
    assert_ne!(fixture.weights(&QueryPoint { geometric: Vec3::X, ..swapped }, Visibility::Stored), plain);
}

#[test]
fn light_may_be_looked_up_where_it_comes_from() {
    let mut fixture = tiles();
    fixture.store(IrradianceCurve::Linear, |i, c, r| [(i + 1) as f32, c as f32, r as f32]);
    fixture.settings.look_up = LookUp::Towards;
    let point = asking();
    for (probe, mean) in MEANS.into_iter().enumerate() {
        // Along n = (2, 3, 6)/7 the way to the box is min(2·7/2, 4·7/3, 1·7/6) = 7/6.
        let mean = mean * 7.0 / 6.0;
        let target = P + mean * point.normal - fixture.volume.positions[probe];
        let expected = fixture.volume.irradiance.of(probe, target.normalize());
        let found = Vec3::from(fixture.look_up(&point, Visibility::Exact(1 << probe)));
        assert!((found - expected).abs().max_element() < 1e-4, "probe {probe}: {found} instead of {expected}");
    }
    // A probe in its own target, with nothing to tell a direction by, is asked around the normal.
    let mut fixture = Fixture::new([1, 1, 1], |_| [1.0; 3]);
    fixture.store(IrradianceCurve::Linear, |_, c, r| [1.0, c as f32, r as f32]);
    fixture.tiles(1.0, 0.0, |_, _, _| [0.0, 0.1]);
    fixture.settings.look_up = LookUp::Towards;
    let at = QueryPoint { position: ORIGIN, ..point };
    let around = fixture.volume.irradiance.of(0, point.normal);
    assert!((Vec3::from(fixture.look_up(&at, Visibility::Off)) - around).abs().max_element() < 1e-5);
}

#[test]
fn coarse_tiles_are_steeper() {
    let fixture = tiles();
    let tiles = fixture.volume.occlusion.tiles().unwrap();
    assert_eq!(fixture.volume.grid.width(ProbeIndex(3)), 1);
    // Four cells wide: the box is four times as large, and so are mean and deviation at the same shares; what lies behind
    // the mean counts four times. Along x: way 2·4 = 8, μ = 2, σ = 4; at 3: 16/(16 + (4·1)²).
    let at = |distance: f32| tiles.visibility(3, Vec3::X * distance, SPACING * 4.0, 4.0, 0.0);
    assert_eq!((at(1.9), at(2.0), at(0.0)), (1.0, 1.0, 1.0));
    assert!((at(3.0) - 0.5).abs() < 1e-6, "{}", at(3.0));
    assert_eq!(tiles.maps.sample(3, &tiles.maps.taps(oct_from_direction(Vec3::X))), Vec2::new(0.25, 0.5));
}
