//! Coefficients in memory, in the file and on their way to shading.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};
use safetensors::Dtype;

use super::*;
use crate::math::fibonacci;
use crate::math::octahedral::oct_from_direction;
use crate::probe::container::EncodingLosses;
use crate::probe::store::{Irradiance, IrradianceStore};

fn store(format: ColorFormat, presampled: Option<usize>) -> IrradianceStore {
    IrradianceStore::Sh9(ShStore { format, presampled, gradient: false })
}

/// Two probes: even light of π, and light from one side.
fn two_probes(store: &IrradianceStore) -> Irradiance {
    let mut irradiance = store.zeros(2, 1);
    irradiance.set_each(|probe, _| {
        let mut unknowns = vec![Vec3A::ZERO; COUNT];
        unknowns[0] = Vec3A::splat(PI);
        if probe == 1 {
            // Coefficient of y.
            unknowns[1] = Vec3A::new(1.0, 0.5, -0.25);
        }
        Some((unknowns, ()))
    });
    irradiance
}

/// What two_probes' second probe holds around a direction: E = π + u/Y₀·√(3/4π)·y, and √(3/4π)/Y₀ = √3.
fn exact(direction: Vec3) -> Vec3 {
    Vec3::splat(PI) + Vec3::new(1.0, 0.5, -0.25) * 3f32.sqrt() * direction.y
}

#[test]
fn a_look_up_adds_the_functions() {
    for presampled in [None, Some(8), Some(32)] {
        let irradiance = two_probes(&store(ColorFormat::F32, presampled));
        // Bilinear error is of second order in a texel's size but at the folds of the map, where it is of first: measured, and
        // up to 0.7 ÷ n and rounded up; none without maps.
        let tolerance = presampled.map_or(1e-5, |n| 1.0 / n as f32);
        for i in 0..100 {
            let d = fibonacci::direction(i, 100);
            assert!((irradiance.of(0, d) / PI - 1.0).abs().max_element() < 1e-6);
            let off = (irradiance.of(1, d) - exact(d)).abs().max_element();
            assert!(off < tolerance, "{presampled:?} {d}: {}, {}", irradiance.of(1, d), exact(d));
        }
        // A weighted sum of both.
        let oct = oct_from_direction(Vec3::Y);
        let sum = irradiance.sum(oct, [(0, 0.25), (1, 0.75)].into_iter(), |_| Vec3::ZERO, |e| e);
        let expected = Vec3::splat(0.25 * PI)
            + 0.75 * Vec3::from(irradiance.sum(oct, [(1, 1.0)].into_iter(), |_| Vec3::ZERO, |e| e));
        assert!((Vec3::from(sum) - expected).abs().max_element() < 1e-5);
    }
}

#[test]
fn unknowns_come_back() {
    let mut irradiance = two_probes(&store(ColorFormat::F32, Some(8)));
    let before: Vec<Vec3> = irradiance.probe(1).collect();
    assert!((before[0].x - PI).abs() < 1e-6 && (before[1] - Vec3::new(1.0, 0.5, -0.25)).length() < 1e-6);
    let other: Vec<Vec3A> = (0..COUNT).map(|j| Vec3A::splat(j as f32 - 3.0)).collect();
    let mut each = irradiance.clone();
    irradiance.set_probe(1, &other);
    each.set_each(|probe, _| (probe == 1).then(|| (other.clone(), ())));
    assert_eq!(irradiance, each);
    let stored: Vec<Vec3> = irradiance.stored().collect();
    let mut restored = store(ColorFormat::F32, Some(8)).zeros(2, 1);
    assert!(restored.restore(&stored) && !restored.restore(&stored[1..]));
    assert_eq!(restored, irradiance);
}

#[test]
fn samples_of_light_become_their_irradiance() {
    // Ten thousand samples of radiance 1, each of 4π/10⁴ sr: π, and nothing in the bands above.
    let n = 10_000;
    let light = Vec3::splat(4.0 * PI / n as f32);
    let samples: Vec<(Vec3, Vec3)> = (0..n).map(|i| (fibonacci::direction(i, n), light)).collect();
    let unknowns = ShIrradiance::of_samples(&samples);
    assert!((unknowns[0].x / PI - 1.0).abs() < 1e-4, "{unknowns:?}");
    assert!(unknowns[1..].iter().all(|u| u.abs().max_element() < 5e-3), "{unknowns:?}");
    // One direction: the cosine up to band 2 around itself, 1/4 + 1/2 + 5/16 of it.
    let single = ShIrradiance::of_samples(&[(Vec3::Y, Vec3::ONE)]);
    let along: Vec<Vec3A> = ShIrradiance::along(&single, &[Vec3::Y, Vec3::NEG_Y]).collect();
    assert!((along[0].x - 1.0625).abs() < 1e-5 && (along[1].x - 0.0625).abs() < 1e-5, "{along:?}");
}

#[test]
fn the_file_holds_what_was_written() {
    for (format, tolerance) in [(ColorFormat::F32, 0.0), (ColorFormat::F16, 2e-3)] {
        for presampled in [None, Some(8)] {
            for scale in [1.0, 1e9, 1e-12] {
                let mut irradiance = two_probes(&store(format, presampled));
                irradiance.set_each(|_, before| Some((before.map(|u| u * scale).collect(), ())));
                let mut container = Container::default();
                let mut losses = EncodingLosses::default();
                irradiance.write(&mut container, &mut losses);
                assert_eq!(losses.clamped["sh"], 0);
                let tensor = &container.tensors["sh"];
                assert_eq!((tensor.shape.as_slice(), tensor.dtype), (&[2, 9, 3][..], format.dtype()));
                let read = Irradiance::read(&container, 2, 1).unwrap();
                for probe in 0..2 {
                    for (a, b) in irradiance.probe(probe).zip(read.probe(probe)) {
                        let off = (a - b).abs().max_element();
                        assert!(off <= tolerance * PI * scale, "{a} came back as {b}, {format:?} at {scale}");
                    }
                }
                let seen = read.of(0, Vec3::X) / (PI * scale);
                // Half a step of the five mantissa bits of the shortest channel.
                let step = if presampled.is_some() { 1.0 / 64.0 } else { 2e-3 };
                assert!((seen - 1.0).abs().max_element() <= step, "{seen}");
                assert_eq!(read.runtime_bytes(), irradiance.runtime_bytes());
                assert!(Irradiance::read(&container, 3, 1).is_err());
            }
        }
    }
    assert_eq!(store(ColorFormat::F32, Some(8)).runtime_bytes(1), 400);
    assert_eq!(store(ColorFormat::F16, None).runtime_bytes(1), 54);
}

#[test]
fn what_shading_reads_is_nowhere_negative() {
    let mut irradiance = store(ColorFormat::F32, Some(8)).zeros(1, 1);
    let unknowns = ShIrradiance::of_samples(&[(Vec3::Z, Vec3::ONE)]);
    irradiance.set_each(|_, _| Some((unknowns.clone(), ())));
    let mut container = Container::default();
    irradiance.write(&mut container, &mut EncodingLosses::default());
    let read = Irradiance::read(&container, 1, 1).unwrap();
    let oct = |i| oct_from_direction(fibonacci::direction(i, 500));
    let least = |of: &Irradiance| {
        (0..500).map(|i| of.sum(oct(i), [(0, 1.0)].into_iter(), |_| Vec3::ZERO, |e| e).x).fold(f32::INFINITY, f32::min)
    };
    assert!(least(&irradiance) < -0.01 && least(&read) >= 0.0, "{} {}", least(&irradiance), least(&read));
}

#[test]
fn damaged_coefficients_are_refused() {
    let written = |change: fn(&mut Container)| {
        let mut container = Container::default();
        two_probes(&store(ColorFormat::F32, Some(8))).write(&mut container, &mut EncodingLosses::default());
        change(&mut container);
        Irradiance::read(&container, 2, 1)
    };
    assert!(written(|_| {}).is_ok());
    for (change, words) in [
        ((|c| c.put_json("sh.presampled", &1_000_000)) as fn(&mut Container), "sh.presampled"),
        (|c| c.put_json("sh.presampled", &0), "sh.presampled"),
        (|c| c.put_json("scale.irradiance", &-1.0), "scale.irradiance"),
        (|c| drop(c.metadata.remove("scale.irradiance")), "scale.irradiance"),
        (|c| c.put("sh", Dtype::F32, &[2, 9, 3], (0..54).map(|_| f32::NAN.to_le_bytes())), "sh"),
        (|c| c.put("sh", Dtype::F32, &[2, 4, 3], (0..24).map(|_| 0f32.to_le_bytes())), "sh"),
    ] {
        let error = written(change).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}
