//! Closed rooms that emit and reflect the same everywhere.
//!
//! Light sampling alone has no finite variance in a room with corners (the estimate grows with 1/r² near them), so its
//! furnace is a sphere, where cos·cos′/r² is the same between any two points.

use std::f64::consts::PI;

use glam::Vec3;
use lightprobe::light::path::Strategy;
use lightprobe::shade::reference::ReferenceSettings;

use super::lights::sphere;
use super::{Check, STRATEGIES, camera, load, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::shapes::{add, diffuse, room, save};

const EMISSION: [f64; 3] = [1.0, 3.0, 0.25];

/// Nine comparisons of furnaces × three channels, five of partial sums × three strategies × three channels.
fn furnace(albedo: [f64; 3], spp: u32, bounces: Option<u32>, strategy: Strategy) {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let walls = if strategy == Strategy::LightOnly { sphere(32).0 } else { room(1) };
    add(&mut gltf, &walls, diffuse(albedo, EMISSION));
    let scene = load(&save(gltf, &folder, "room"));
    let world = world(&scene);
    let camera = camera(&scene, [0.3, -0.2, 0.4], [-0.1, 0.1, -1.0], 80.0);
    let reference = small(&world, &camera, &ReferenceSettings { max_bounces: bounces, ..settings(spp, strategy) });
    let expected = std::array::from_fn(|c| {
        let sum = match bounces {
            None => 1.0 / (1.0 - albedo[c]),
            Some(most) => (0..=most).map(|k| albedo[c].powi(k as i32)).sum(),
        };
        PI * EMISSION[c] * sum
    });
    let what = format!("albedo {albedo:?}, {bounces:?} bounces, {strategy:?}");
    Check::indirect(&reference).against_constant(expected, &what);
    assert_eq!(reference.non_finite, 0);
    // What leaves the walls is what arrives anywhere: emission and ρE/π.
    let beauty = std::array::from_fn(|c| EMISSION[c] + albedo[c] * expected[c] / PI);
    let variance = reference.beauty_variance().expect("two blocks");
    Check { found: reference.beauty(), variance, floor: super::ROUNDING }.against_constant(beauty, &what);
}

#[test]
fn furnaces_of_all_albedos() {
    for strategy in STRATEGIES {
        furnace([0.0, 0.3, 0.5], 512, None, strategy);
        // Long paths have rare bright samples: with few their mean is not yet normally distributed.
        furnace([0.8, 0.95, 0.9], 2048, None, strategy);
        furnace([0.5; 3], 512, None, strategy);
    }
}

#[test]
fn bounces_are_the_terms_of_the_geometric_series() {
    for strategy in STRATEGIES {
        for bounces in 0..=4 {
            furnace([0.3, 0.8, 0.95], 256, Some(bounces), strategy);
        }
    }
}

#[test]
fn rays_alone_have_no_noise_in_a_furnace() {
    // Every ray meets the same radiance: up to Russian roulette, which begins at the second bounce, nothing is random.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(3), diffuse([0.5; 3], [1.0; 3]));
    let scene = load(&save(gltf, &folder, "room"));
    let world = world(&scene);
    let camera = camera(&scene, [0.0; 3], [0.1, 0.2, -1.0], 60.0);
    let reference =
        small(&world, &camera, &ReferenceSettings { max_bounces: Some(1), ..settings(32, Strategy::BsdfOnly) });
    let expected = (PI * 1.5) as f32;
    for e in reference.irradiance_indirect() {
        assert!((*e - Vec3::splat(expected)).abs().max_element() < 1e-4, "{e}");
    }
}

#[test]
fn albedos_of_one_end() {
    // Clamped to 0.999: a thousand bounces on average, and a finite result.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([1.0; 3], [1.0; 3]));
    let scene = load(&save(gltf, &folder, "room"));
    let world = world(&scene);
    let camera = camera(&scene, [0.0; 3], [0.1, 0.2, -1.0], 60.0);
    let reference = small(&world, &camera, &settings(128, Strategy::Mis));
    // Rounding adds up over a thousand bounces: each is off by some 1e-7, and 1/(1 − 0.999) in f32 by 6e-5.
    Check::indirect(&reference).floor(5e-4).against_constant([PI / (1.0 - 0.999); 3], "albedo 1");
    assert_eq!(reference.non_finite, 0);
}

#[test]
fn the_clamp_only_darkens() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    let scene = load(&save(gltf, &folder, "room"));
    let world = world(&scene);
    let camera = camera(&scene, [0.0; 3], [0.1, 0.2, -1.0], 60.0);
    let clamped = ReferenceSettings { firefly_clamp: Some(2.0), ..settings(64, Strategy::Mis) };
    let reference = small(&world, &camera, &clamped);
    assert!(reference.irradiance_indirect().iter().all(|e| e.max_element() <= 2.0 + 1e-5));
}
