//! Rooms beside a room: light that cannot enter adds no noise to it.

use glam::{DVec3, Vec3};
use lightprobe::light::sampled::RayCount;
use lightprobe::math::random::{Purpose, Random};
use lightprobe::scene::{self, EnvironmentSource, LoadOptions};
use lightprobe::trace::Ray;

use super::world;
use crate::common::{Folder, Gltf};
use crate::shapes::{add, diffuse, quad, room, save};

/// `side`² closed rooms of 2 m, 2.5 m apart, each with a lamp under its ceiling; those beside the first emit `others`.
fn rooms(side: u32, others: f64) -> Gltf {
    let mut gltf = Gltf::new();
    for i in 0..side * side {
        let (x, z) = ((i % side) as f32 * 2.5, (i / side) as f32 * 2.5);
        let walls: Vec<[f32; 3]> = room(1).iter().map(|p| [p[0] + x, p[1], p[2] + z]).collect();
        add(&mut gltf, &walls, diffuse([0.5; 3], [0.0; 3]));
        let lamp = quad([x - 0.2, 0.9, z - 0.2], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4], 1);
        add(&mut gltf, &lamp, diffuse([0.0; 3], [if i == 0 { 1.0 } else { others }; 3]));
    }
    gltf
}

/// Relative deviation of the irradiance of a point of the first room's floor, from four samples: the root of the mean
/// relative variance over 100 points and 100 estimates each. Also the mean.
fn noise(gltf: Gltf, sky: Option<&str>) -> (f64, f64) {
    let folder = Folder::new();
    let environment = sky.map(|sky| sky.parse::<EnvironmentSource>().expect("a constant sky"));
    let options = LoadOptions { environment, ..LoadOptions::default() };
    let scene = scene::load(&save(gltf, &folder, "rooms"), &options).expect("a scene of the tests' own");
    let world = world(&scene);
    let (mut variance, mut sum) = (0.0, 0.0);
    for i in 0..100u32 {
        let place = DVec3::new(f64::from(i % 10) * 0.19 - 0.855, 0.0, f64::from(i / 10) * 0.19 - 0.855);
        let ray = Ray::new((place - scene.origin_world).as_vec3(), Vec3::NEG_Y, 0);
        let point = world.surface(ray).expect("the floor");
        let mut random = Random::new(3, Purpose::Capture, u64::from(i), 0);
        let mut estimate = || {
            let irradiance = world.emitter_irradiance(&point, Vec3::Y, 4, &mut random, &mut RayCount::default());
            f64::from(irradiance.x)
        };
        let estimates: Vec<f64> = (0..100).map(|_| estimate()).collect();
        let mean = estimates.iter().sum::<f64>() / 100.0;
        variance += estimates.iter().map(|e| (e / mean - 1.0).powi(2)).sum::<f64>() / 99.0 / 100.0;
        sum += mean / 100.0;
    }
    (variance.sqrt(), sum)
}

/// By power over the scene, one draw in 16, in 100, or in a million would go to the room's own lamp.
#[test]
fn light_of_other_rooms_adds_no_noise() {
    let (alone, expected) = noise(rooms(1, 0.0), None);
    let cases = [(4, 1.0, None), (10, 1.0, None), (2, 1e6, None), (1, 0.0, Some("100,100,100")), (4, 1e-6, None)];
    for (side, others, sky) in cases {
        let (found, mean) = noise(rooms(side, others), sky);
        // A twentieth of the four draws goes elsewhere, by chance; a tenth for the noise's own error.
        let most = 1.1 * (alone.powi(2) + 0.05 / 0.95 / 4.0).sqrt();
        assert!(found < most, "{side}² rooms, {others}, {sky:?}: {found} beside {alone}, more than {most}");
        // 10,000 estimates of this noise each: five standard errors of the difference.
        let error = 5.0 * (found.powi(2) + alone.powi(2)).sqrt() / 100.0;
        assert!((mean / expected - 1.0).abs() < error, "{side}² rooms: {mean} instead of {expected} ± {error}");
    }
}
