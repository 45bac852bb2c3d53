//! The layout and the look-up of Bevy.

use std::f32::consts::PI;

use glam::{UVec3, Vec3, Vec3A};
use proptest::prelude::*;

use super::fixture::{export, filtered, grids, points, reread};
use crate::export::{Block, Grids, Rules, bevy};
use crate::probe::fit::points::asked_in_air;
use crate::probe::query::{Answers, QueryPoint, Visibility};

/// `irradiance_volume_light` of Bevy over the bytes of the file.
fn shader_of_bevy(texels: &[u32], divisions: UVec3, (low, high): (Vec3, Vec3), point: &QueryPoint) -> Vec3 {
    let resolution = divisions.as_vec3();
    let size = divisions * UVec3::new(1, 2, 3);
    let unit = (point.position - low) / (high - low) - 0.5;
    let stp = ((unit + 0.5) * resolution).clamp(Vec3::splat(0.5), resolution - 0.5);
    let uvw = stp / size.as_vec3();
    let texel = |at: UVec3| bevy::from_rgb9e5(texels[(at.x + size.x * (at.y + size.y * at.z)) as usize]).to_array();
    let mut sum = Vec3::ZERO;
    for axis in 0..3 {
        // The second half of y is the negative one.
        let half = if point.normal[axis] < 0.0 { 0.5 } else { 0.0 };
        let rgb = filtered(size, texel, uvw + Vec3::new(0.0, half, axis as f32 / 3.0));
        sum += Vec3::from(rgb) * point.normal[axis] * point.normal[axis];
    }
    sum
}

#[test]
fn the_look_up_of_bevy_is_its_shaders_and_irradiance_is_divided_by_pi() {
    let divisions = UVec3::new(3, 2, 4);
    let source = grids(Rules::Bevy, divisions, 1);
    let file = &export(&source).files[0];
    assert_eq!(file.name, "probes.0.vxgi.ktx2");
    let own = reread(&source);
    let data = &file.bytes[file.bytes.len() - 4 * 6 * 24..];
    let texels: Vec<u32> = data.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
    let bounds = own.blocks[0].bounds();
    for point in points(bounds.0, bounds.1, 500) {
        let found = own.irradiance(&point, Visibility::Stored);
        let is_inside = point.position.cmpgt(bounds.0).all() && point.position.cmplt(bounds.1).all();
        let expected = if is_inside { shader_of_bevy(&texels, divisions, bounds, &point) * PI } else { Vec3::ZERO };
        // Rounding of f32 in texture coordinates of 12 slices and 4 rows.
        assert!((found - expected).abs().max_element() < 1e-3, "{point:?}: {found} {expected}");
    }
    // Nine bits of mantissa, shared with the largest of three numbers from 8 to 9.
    for (a, b) in own.values.iter().zip(&source.values) {
        assert!((*a - *b).abs().max_element() < PI * 4.0 / 512.0, "{a} {b}");
    }
}

#[test]
fn the_faces_of_bevy_lie_by_axis_along_z_and_by_sign_along_y() {
    let mut own = grids(Rules::Bevy, UVec3::new(2, 2, 1), 1);
    // Probe 3 = (1, 1, 0), its faces +x, −x, +y, −y, +z, −z.
    for face in 0..6 {
        own.values[3 * 6 + face] = Vec3A::splat((1 << face) as f32 * PI);
    }
    let bytes = &export(&own).files[0].bytes;
    let texel = |x: usize, y: usize, z: usize| {
        let at = bytes.len() - 4 * 24 + 4 * (x + 2 * (y + 4 * z));
        bevy::from_rgb9e5(u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())).x
    };
    for axis in 0..3 {
        assert_eq!(texel(1, 1, axis), (1 << (2 * axis)) as f32, "positive, axis {axis}");
        assert_eq!(texel(1, 3, axis), (2 << (2 * axis)) as f32, "negative, axis {axis}");
    }
}

#[test]
fn ktx2_says_what_it_holds() {
    let bytes = bevy::ktx2(UVec3::new(2, 4, 3), &[7; 24]);
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!(&bytes[..12], b"\xABKTX 20\xBB\r\n\x1A\n");
    // Format E5B9G9R9, words of four bytes, size, no layers, one face, one level, not compressed.
    assert_eq!([12, 16, 20, 24, 28, 32, 36, 40, 44].map(word), [123, 4, 2, 4, 3, 0, 1, 1, 0]);
    // The descriptor follows the index of the one level; its length is in its first word; data end the file, in fours.
    assert_eq!([word(48), word(52), word(104)], [104, 124, 124]);
    let (at, length) = (word(80) as usize, word(88) as usize);
    assert_eq!((at % 4, length, at + length), (0, 96, bytes.len()));
    // RGB, Rec. 709, linear; mantissas of nine bits at 0, 9 and 18, the exponent of five bits at 27.
    assert_eq!(word(116), 1 | 1 << 8 | 1 << 16);
    let samples: Vec<u32> = (0..6).map(|i| word(132 + 16 * i) & 0x00FF_FFFF).collect();
    let (mantissa, exponent) = (8 << 16, 27 | 4 << 16);
    assert_eq!(samples, [mantissa, exponent, 9 | mantissa, exponent, 18 | mantissa, exponent]);
}

#[test]
fn rgb9e5_rounds_to_nine_bits() {
    // 1 = 256 · 2^(16 − 24).
    assert_eq!(bevy::rgb9e5(Vec3::ONE), 256 | 256 << 9 | 256 << 18 | 16 << 27);
    assert_eq!(bevy::rgb9e5(Vec3::ZERO), 0);
    assert_eq!(bevy::from_rgb9e5(bevy::rgb9e5(Vec3::splat(1e9))), Vec3::splat(65_408.0));
    // A mantissa that rounds up to 512 takes the next exponent.
    assert_eq!(bevy::from_rgb9e5(bevy::rgb9e5(Vec3::splat(1.9999))), Vec3::splat(2.0));
}

proptest! {
    #[test]
    fn rgb9e5_comes_back(x in 0.0f32..6e4, y in 0.0f32..1.0, z in 0.0f32..1e-3) {
        let color = Vec3::new(x, y, z);
        let back = bevy::from_rgb9e5(bevy::rgb9e5(color));
        // Half a step of nine bits, of which the largest number uses at least eight.
        prop_assert!((back - color).abs().max_element() <= color.max_element() / 512.0 + 6e-8, "{} {}", color, back);
    }

    #[test]
    fn bevy_takes_the_mean_of_its_volumes(x in 0.0f32..1.0, y in 0.1f32..0.9, z in 0.1f32..0.9) {
        let own = grids(Rules::Bevy, UVec3::new(2, 2, 2), 2);
        let (low, _) = own.blocks[0].bounds();
        let (_, high) = own.blocks[1].bounds();
        let point = asked_in_air(low + Vec3::new(x, y, z) * (high - low), Vec3::new(0.6, -0.8, 0.0)).query;
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for block in &own.blocks {
            let share = own.rules.share(block, point.position);
            let values = own.values[block.start as usize * 6..][..48].to_vec();
            let alone = Grids { blocks: vec![Block { start: 0, ..block.clone() }], values, ..own.clone() };
            sum += alone.irradiance(&point, Visibility::Stored) * share;
            total += share;
        }
        let found = own.irradiance(&point, Visibility::Stored);
        prop_assert!(total == 0.0 || (found - sum / total).abs().max_element() < 1e-4);
    }
}
