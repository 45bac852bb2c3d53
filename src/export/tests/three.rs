//! The layout and the look-up of three.js.

use glam::{UVec3, Vec3, Vec3A};

use super::fixture::{filtered, grids, points, reread};
use crate::export::record::Number;
use crate::export::{Block, Grids, Rules, three};
use crate::math::harmonics::{COSINE, COUNT, Y0};
use crate::probe::query::{Answers, QueryPoint, Visibility};

#[test]
fn coefficients_of_three_lie_where_its_shader_unpacks_them() {
    let divisions = UVec3::new(2, 1, 2);
    let mut own = grids(Rules::Three, divisions, 1);
    // Radiance coefficient j, channel k of probe p: 100·p + 3·j + k.
    for p in 0..4 {
        for (j, cosine) in COSINE.iter().enumerate() {
            let c = Vec3A::new(0.0, 1.0, 2.0) + (100 * p + 3 * j) as f32;
            own.values[p * COUNT + j] = c * (Y0 * cosine);
        }
    }
    let numbers = three::pack(&own, &own.blocks[0]);
    // Four numbers of 2 × 1 × 7·(2 + 2) texels.
    assert_eq!(numbers.len(), 4 * 2 * 28);
    let texel = |x: usize, slice: usize| {
        let at = 4 * (slice * 2 + x);
        [0, 1, 2, 3].map(|i| numbers[at + i].round() as i32)
    };
    // Probe 3 = (1, 0, 1): c0 and the red of c1; the blue of c2 and c3; c8 and nothing.
    assert_eq!(texel(1, 2), [300, 301, 302, 303]);
    assert_eq!(texel(1, 2 * 4 + 2), [308, 309, 310, 311]);
    assert_eq!(texel(1, 6 * 4 + 2), [324, 325, 326, 0]);
    for t in 0..7 {
        for x in 0..2 {
            assert_eq!(texel(x, 4 * t), texel(x, 4 * t + 1), "the first slice repeats the second");
            assert_eq!(texel(x, 4 * t + 3), texel(x, 4 * t + 2), "the last slice repeats the one before");
        }
    }
}

/// `getLightProbeGridIrradiance` of three.js with its rounded constants, over the numbers of the texture.
fn shader_of_three(numbers: &[f32], divisions: UVec3, (low, high): (Vec3, Vec3), point: &QueryPoint) -> Vec3 {
    let res = divisions.as_vec3();
    let range = high - low;
    let normal = point.normal;
    let sample = point.position + normal * (range / res) * 0.5;
    let uvw = ((sample - low) / range).clamp(0.5 / res, 1.0 - 0.5 / res);
    let (padded, base) = (res.z + 2.0, uvw.z * res.z + 1.0);
    let size = UVec3::new(divisions.x, divisions.y, 7 * (divisions.z + 2));
    let texel = |at: UVec3| {
        let at = 4 * (at.x + size.x * (at.y + size.y * at.z)) as usize;
        [0, 1, 2, 3].map(|i| numbers[at + i])
    };
    let s: Vec<f32> = (0..7)
        .flat_map(|t| filtered(size, texel, Vec3::new(uvw.x, uvw.y, (base + t as f32 * padded) / (7.0 * padded))))
        .collect();
    let c = |j: usize| Vec3::new(s[3 * j], s[3 * j + 1], s[3 * j + 2]);
    let Vec3 { x, y, z } = normal;
    let result = c(0) * 0.886227
        + c(1) * (2.0 * 0.511664 * y)
        + c(2) * (2.0 * 0.511664 * z)
        + c(3) * (2.0 * 0.511664 * x)
        + c(4) * (2.0 * 0.429043 * x * y)
        + c(5) * (2.0 * 0.429043 * y * z)
        + c(6) * (0.743125 * z * z - 0.247708)
        + c(7) * (2.0 * 0.429043 * x * z)
        + c(8) * (0.429043 * (x * x - y * y));
    result.max(Vec3::ZERO)
}

#[test]
fn the_look_up_of_three_is_its_shaders() {
    let divisions = UVec3::new(3, 2, 4);
    let own = reread(&grids(Rules::Three, divisions, 1));
    let numbers = three::pack(&own, &own.blocks[0]);
    let bounds = own.blocks[0].bounds();
    let mut inside = 0;
    for point in points(bounds.0, bounds.1, 500) {
        let found = own.irradiance(&point, Visibility::Stored);
        let spacing = (bounds.1 - bounds.0) / divisions.as_vec3();
        let (sample, margin) = (point.position + point.normal * spacing * 0.5, spacing * 0.01);
        let is_inside = sample.cmpge(bounds.0 - margin).all() && sample.cmple(bounds.1 + margin).all();
        let expected = if is_inside { shader_of_three(&numbers, divisions, bounds, &point) } else { Vec3::ZERO };
        inside += usize::from(is_inside);
        // The shader's constants have six digits, texture coordinates the rounding of f32 times 42 slices.
        assert!((found - expected).abs().max_element() < 2e-3, "{point:?}: {found} {expected}");
    }
    assert!((100..450).contains(&inside), "points on both sides of the rim: {inside}");
}

#[test]
fn the_last_grid_of_three_counts_alone() {
    let own = reread(&grids(Rules::Three, UVec3::new(2, 2, 2), 2));
    let (first, second) = (&own.blocks[0], &own.blocks[1]);
    let alone = |block: &Block| Grids {
        blocks: vec![Block { start: 0, ..block.clone() }],
        values: own.values[block.start as usize * COUNT..][..8 * COUNT].to_vec(),
        ..own.clone()
    };
    let (of_first, of_second) = (alone(first), alone(second));
    let (mut counts, (low, _), (_, high)) = ([0; 2], first.bounds(), second.bounds());
    for point in points(low, high, 300) {
        let place = own.rules.place(second, point.position, point.normal);
        let is_second = own.rules.share(second, place) > 0.0;
        let expected = if is_second { &of_second } else { &of_first };
        counts[usize::from(is_second)] += 1;
        let found = own.irradiance(&point, Visibility::Stored);
        assert_eq!(found, expected.irradiance(&point, Visibility::Stored));
    }
    assert!(counts[0] > 30 && counts[1] > 30, "{counts:?}");
}

#[test]
fn halves_give_way_to_floats_where_they_do_not_reach() {
    for (largest, number) in
        [(1.0, Number::Half), (65_504.0, Number::Half), (1e5, Number::Float), (1e-5, Number::Float)]
    {
        let (found, bytes) = three::encode(&[0.0, -largest]);
        assert_eq!(found, number, "{largest}");
        assert_eq!(bytes.len(), if number == Number::Half { 4 } else { 8 });
    }
}
