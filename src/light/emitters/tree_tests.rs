//! The light tree on lights strewn at random: draws follow what it says, and nothing that reaches a point is ruled out.

use glam::Vec3;
use proptest::prelude::*;

use super::bounds::LightBounds;
use super::cone::Cone;
use super::receiver::Receiver;
use super::tree::LightTree;
use crate::math::random::{Purpose, Random};

const ORIGIN: Receiver = Receiver { position: Vec3::ZERO, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO };

/// A tree over small lights strewn at random, some of which shine to one side, some to both, some all around.
fn strewn(count: usize) -> (Vec<LightBounds>, LightTree) {
    let mut random = Random::new(1, Purpose::Capture, 11, 0);
    let mut number = move |low: f32, high: f32| low + (high - low) * random.uniform();
    let mut vector = move || Vec3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0));
    let light = |i: usize| {
        let (corner, size) = (vector() * 10.0, vector().abs() * 0.1);
        let normals = match i % 3 {
            0 => Cone::SPHERE,
            _ => Cone { axis: vector().normalize(), angle: 0.0 },
        };
        LightBounds {
            low: corner,
            high: corner + size,
            power: 1.0 + (i % 7) as f32,
            normals,
            cos_reach: 0.0,
            two_sided: i % 3 == 1,
            range_m: f32::INFINITY,
        }
    };
    let lights: Vec<LightBounds> = (0..count).map(light).collect();
    let tree = LightTree::new(&lights);
    (lights, tree)
}

#[test]
fn the_tree_draws_every_light_as_often_as_it_says() {
    for count in [1, 2, 5, 300, 1000] {
        let (_, tree) = strewn(count);
        let up = Receiver { normal: Vec3::Y, geometric_normal: Vec3::Y, ..ORIGIN };
        for receiver in [ORIGIN, up] {
            let stated: Vec<f32> = (0..count).map(|light| tree.probability(light, &receiver)).collect();
            for group in 0..tree.groups() {
                let lights = || (0..count).filter(|&light| tree.group_of(light) == group);
                let sum: f32 = lights().map(|light| stated[light]).sum();
                let reached = tree.importance(group, &receiver) > 0.0;
                // All of a group's draws, a few roundings apart; none where one half of it is reached by a hair and its
                // halves are not.
                assert!((sum - 1.0).abs() < 1e-5 || (sum < 1.0 && count > 1) || !reached, "{sum} in group {group}");
                // Even numbers give each light its probability, to within one number's for every turn on its path.
                let n = 4096;
                let mut drawn = vec![0; count];
                for i in 0..n {
                    if let Some((light, probability)) = tree.draw(group, &receiver, f64::from(i) / f64::from(n)) {
                        assert!(
                            (probability / stated[light] - 1.0).abs() < 1e-4,
                            "{probability} and {}",
                            stated[light]
                        );
                        drawn[light] += 1;
                    }
                }
                for light in lights() {
                    let expected = stated[light] * n as f32;
                    assert!((drawn[light] as f32 - expected).abs() <= 2.0 + 1e-4 * n as f32, "{light}: {expected}");
                }
            }
        }
    }
}

#[test]
fn groups_are_disjoint_and_bounded() {
    let (_, tree) = strewn(1000);
    assert_eq!(tree.groups(), 128);
    let mut count = vec![0; 128];
    (0..1000).for_each(|light| count[tree.group_of(light)] += 1);
    assert!(count.iter().all(|&n| n > 0), "{count:?}");
    assert_eq!(LightTree::new(&[]).groups(), 0);
}

proptest! {
    /// What reaches a point is not ruled out: bounds err on one side only.
    #[test]
    fn no_light_that_reaches_a_point_is_ruled_out(x in -9.0f32..9.0, y in -9.0f32..9.0, z in -9.0f32..9.0) {
        let (lights, tree) = strewn(300);
        let receiver = Receiver { position: Vec3::new(x, y, z), normal: Vec3::Y, geometric_normal: Vec3::Y };
        for (i, light) in lights.iter().enumerate() {
            let to_light = (light.low + light.high) * 0.5 - receiver.position;
            let at_light = if light.two_sided { 1.0 } else { -light.normals.axis.dot(to_light) };
            let all_around = light.normals == Cone::SPHERE;
            if to_light.y > 1e-3 && (all_around || at_light > 1e-3) {
                prop_assert!(tree.probability(i, &receiver) > 0.0, "light {i} at {to_light}");
            }
        }
    }
}
