//! The look-up of Majercik et al. 2019 and 2021 in the words of its papers, worked out in f64 beside the code; biases of
//! distances, and blanks.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::by_hand::{P, asking, assert_close, check, eight, trilinear};
use super::fixture::{Fixture, ORIGIN, SPACING};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{BiasSpacing, Blend, DirectionWeight, QueryPoint, QuerySettings, Visibility};
use crate::probe::store::irradiance::IrradianceCurve;

/// Mean and deviation of every probe's distance, the same in all directions.
const MEANS: [f32; 8] = [2.0, 1.0, 3.0, 2.5, 6.0, 5.0, 3.0, 2.0];
const DEVIATIONS: [f32; 8] = [1.0, 1.0, 1.0, 0.1, 2.0, 3.0, 5.0, 0.3];

fn stored(i: usize) -> f64 {
    (i + 1) as f64 / 4.0
}

fn fixture() -> Fixture {
    let mut fixture = eight();
    fixture.settings = QuerySettings {
        direction: DirectionWeight::Wrap { offset: 0.2 },
        trilinear_floor: 0.001,
        weight_floor: 1e-6,
        crush_below: 0.2,
        blend: Blend::SquareRoot,
        normal_bias: 0.045,
        view_bias: 0.18,
        biased_cell: true,
        bias_spacing: BiasSpacing::Smallest,
        ..fixture.settings
    };
    fixture.moments(3.0, 0.05, |i, _, _| [MEANS[i], DEVIATIONS[i]]);
    fixture.store(IrradianceCurve::Gamma5Over2Pi, |i, _, _| [stored(i) as f32; 3]);
    fixture
}

/// Weights and irradiance as the papers write them. Positions are the relocated ones, the cell is of the unmoved grid.
fn by_the_papers(fixture: &Fixture, at: &QueryPoint) -> ([f64; 8], f64) {
    let (p, n, v) = (at.position.as_dvec3(), at.normal.as_dvec3(), at.view.as_dvec3());
    let smallest = f64::from(SPACING.min_element());
    let biased = p + (n * 0.045 + v * 0.18) * smallest;
    let fraction = ((biased - ORIGIN.as_dvec3()) / SPACING.as_dvec3()).clamp(DVec3::ZERO, DVec3::ONE);
    let mut weights = [0.0; 8];
    for (i, weight) in weights.iter_mut().enumerate() {
        if fixture.volume.states[i] != ProbeState::Active {
            continue;
        }
        let probe = fixture.volume.positions[i].as_dvec3();
        let mut w = ((((probe - p).normalize().dot(n)) + 1.0) / 2.0).powi(2) + 0.2;
        let (d, mean) = (biased.distance(probe), f64::from(MEANS[i]));
        let variance = f64::from(DEVIATIONS[i]).powi(2);
        let bound = if d > mean { variance / (variance + (d - mean).powi(2)) } else { 1.0 };
        w *= bound.powi(3).max(0.05);
        w = w.max(1e-6);
        if w < 0.2 {
            w *= w * w / 0.04;
        }
        for k in 0..3 {
            let t = if i >> k & 1 == 1 { fraction[k] } else { 1.0 - fraction[k] };
            w *= t.max(0.001);
        }
        *weight = w;
    }
    let total: f64 = weights.iter().sum();
    // Decoded values are fifth powers of what is stored.
    let sum: f64 = weights.iter().enumerate().map(|(i, w)| w * stored(i).powi(5).sqrt()).sum();
    (weights, 2.0 * PI * (sum / total).powi(2))
}

fn compare(fixture: &Fixture, at: &QueryPoint) {
    let (weights, irradiance) = by_the_papers(fixture, at);
    assert_close(fixture.weights(at, Visibility::Stored).1, weights, "weight");
    assert_close(fixture.look_up(at, Visibility::Stored), [irradiance; 3], "channel");
}

#[test]
fn the_published_look_up() {
    let mut fixture = fixture();
    compare(&fixture, &asking());
    // Where no bias reaches, beyond the grid, and with a probe that does not count.
    for shift in [Vec3::ZERO, Vec3::new(-0.4, 1.5, 0.1), Vec3::new(5.0, -7.0, 0.3)] {
        compare(&fixture, &QueryPoint { position: P + shift, ..asking() });
    }
    fixture.deactivate(5, ProbeState::NeverSampled);
    compare(&fixture, &asking());
}

#[test]
fn distances_count_as_shorter_by_their_bias() {
    let mut fixture = eight();
    // Probes 0 to 3 and 7 are 3 m away, 4 to 6 are 7 m: one quarter of the largest spacing, 4 m, takes 1 m of it.
    fixture.settings.distance_bias = 0.25;
    fixture.moments(1.0, 0.0, |i, _, _| if i < 4 { [2.0, 1.0] } else { [1.0, 1.0] });
    let weights = trilinear(0xFF);
    // d − μ: 0; 5; 1 for probe 7. σ²/(σ² + (d − μ)²): 1, 1/26, 1/2.
    let expected: [f64; 8] = std::array::from_fn(|i| match i {
        0..4 => weights[i],
        7 => weights[i] / 2.0,
        _ => weights[i] / 26.0,
    });
    assert_close(fixture.weights(&asking(), Visibility::Stored).1, expected, "weight");
    // Of the smallest spacing, 1 m, it takes 1/4 m: 1/(1 + (3/4)²) = 16/25, 1/(1 + (23/4)²) = 16/545, 1/(1 + (7/4)²) = 16/65.
    fixture.settings.bias_spacing = BiasSpacing::Smallest;
    let expected: [f64; 8] = std::array::from_fn(|i| match i {
        0..4 => weights[i] * 16.0 / 25.0,
        7 => weights[i] * 16.0 / 65.0,
        _ => weights[i] * 16.0 / 545.0,
    });
    assert_close(fixture.weights(&asking(), Visibility::Stored).1, expected, "weight");
}

#[test]
fn weights_that_are_all_small_are_none() {
    let mut fixture = eight();
    // The largest trilinear weight is 45/128 = 0.352.
    fixture.settings.blank_below = 0.35;
    check(&fixture, trilinear(0xFF), [2228.89844, 29.125, 40.125]);
    fixture.settings.blank_below = 0.36;
    check(&fixture, [0.0; 8], [0.0; 3]);
}
