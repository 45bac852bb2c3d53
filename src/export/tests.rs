//! Layouts by hand-computed texels, and look-ups against the engines' shaders, written down a second time.

use std::f32::consts::PI;

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};
use proptest::prelude::*;

use super::ddgi::{self, Ddgi};
use super::made::one_block;
use super::record::{Notes, Number};
use super::{Block, Export, Grids, Origin, Rules, Written, bevy, record, rooms, three};
use crate::light::World;
use crate::math::harmonics::{COSINE, COUNT, Y0};
use crate::math::octahedral::texel_direction;
use crate::math::random::{Purpose, Random};
use crate::math::sampling::uniform_sphere;
use crate::probe::file::{LightRecord, SceneRecord};
use crate::probe::fit::Fitted;
use crate::probe::fit::points::asked_in_air;
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Answers, Query, QueryPoint, QuerySettings, Visibility, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::probe::{Grid, Volume};
use crate::scene::{self, LoadOptions, Unassigned};

/// Spacings differ, so that a swap of axes shows.
const SPACING: Vec3 = Vec3::new(2.0, 4.0, 1.0);

fn grid(divisions: UVec3) -> Grid {
    let grid = Grid::from_parts(DVec3::new(1.0, -1.0, 3.0), SPACING, divisions).unwrap();
    grid.relative_to(DVec3::ZERO).0
}

/// Blocks of the lattice's size, each beside the one before, with random values.
fn grids(rules: Rules, divisions: UVec3, count: u32) -> Grids {
    let grid = grid(divisions);
    let block = |k: u32| Block {
        first: grid.origin() + k as f32 * Vec3::new(1.5, 0.0, 0.0) * SPACING,
        spacing: SPACING,
        divisions,
        start: k * divisions.element_product(),
    };
    let blocks = (0..count).map(block).collect();
    let mut grids = Grids::new(rules, grid, blocks);
    let mut random = Random::new(3, Purpose::FitPoints, 7, 0);
    let mean = |i: usize| rules == Rules::Bevy || i % COUNT == 0;
    for i in 0..grids.values.len() {
        let value = Vec3A::new(random.uniform(), random.uniform(), random.uniform());
        // The mean is so large that no sum is negative.
        grids.values[i] = if mean(i) { value + 8.0 } else { value };
    }
    grids
}

fn origin() -> Origin {
    let (name, blake3) = ("scene".to_owned(), "0".repeat(64));
    let unassigned = Unassigned::default();
    Origin {
        scene: SceneRecord { name, blake3 },
        light: LightRecord { punctual_scale: 1.0, sky: None, albedo_max: 0.9, unassigned },
        environment: None,
        seed: Some(0),
        probes_fitted: false,
        config: "()".to_owned(),
    }
}

fn export(grids: &Grids) -> Export {
    Export::of_grids(grids, &vec![Notes::default(); grids.blocks.len()], &origin(), None)
}

fn reread(grids: &Grids) -> Grids {
    let Written::Grids(read) = export(grids).as_read().unwrap() else { panic!("no grids") };
    read.relative_to(DVec3::ZERO)
}

/// Points in and around a box, with normals.
fn points(low: Vec3, high: Vec3, count: u64) -> Vec<QueryPoint> {
    let of = |i: u64| {
        let mut random = Random::new(4, Purpose::FitPoints, 8, i);
        let share = Vec3::new(random.uniform(), random.uniform(), random.uniform()) * 1.2 - 0.1;
        let normal = uniform_sphere(Vec2::new(random.uniform(), random.uniform()));
        asked_in_air(low + share * (high - low), normal).query
    };
    (0..count).map(of).collect()
}

/// Trilinear filtering with clamped addresses, as textures have it; `uvw` from 0 to 1.
fn filtered<const N: usize>(size: UVec3, texel: impl Fn(UVec3) -> [f32; N], uvw: Vec3) -> [f32; N] {
    let last = size.as_vec3() - 1.0;
    let place = uvw * size.as_vec3() - 0.5;
    let (base, fraction) = (place.floor(), place - place.floor());
    let mut sum = [0.0; N];
    for corner in 0..8u32 {
        let bit = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2).as_vec3();
        let weight = (bit * fraction + (1.0 - bit) * (1.0 - fraction)).element_product();
        let at = (base + bit).clamp(Vec3::ZERO, last).as_uvec3();
        sum.iter_mut().zip(texel(at)).for_each(|(sum, t)| *sum += weight * t);
    }
    sum
}

#[test]
fn coefficients_of_three_lie_where_its_shader_unpacks_them() {
    let divisions = UVec3::new(2, 1, 2);
    let mut own = grids(Rules::Three, divisions, 1);
    // Radiance coefficient j, channel k of probe p: 100·p + 3·j + k.
    for p in 0..4 {
        for j in 0..COUNT {
            let c = Vec3A::new(0.0, 1.0, 2.0) + (100 * p + 3 * j) as f32;
            own.values[p * COUNT + j] = c * (Y0 * COSINE[j]);
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

#[test]
fn rows_of_a_fit_are_the_look_up() {
    for rules in [Rules::Three, Rules::Bevy] {
        let own = grids(rules, UVec3::new(3, 2, 4), 2);
        let (low, high) = (own.blocks[0].bounds().0, own.blocks[1].bounds().1);
        for query in points(low, high, 200) {
            let asked = asked_in_air(query.position, query.normal);
            let row = own.row(&asked, Vec3::ZERO);
            let mut sum = Vec3A::ZERO;
            for part in &row.parts {
                rules.factors().each(part.oct, part.offset, |unknown, factor| {
                    sum += own.of_probe(part.probe.0 as usize)[unknown] * factor * part.share;
                });
            }
            let found = own.irradiance(&asked.query, Visibility::Stored);
            assert!((Vec3::from(sum) - found).abs().max_element() < 1e-4, "{rules:?}: {sum} {found}");
        }
    }
}

/// Active probes of coefficients at the points of a grid, without visibility, each with a mean irradiance.
fn volume(divisions: UVec3, mean: impl Fn(usize) -> f32) -> Volume {
    let grid = grid(divisions);
    let count = grid.probe_count();
    let store = ShStore { format: ColorFormat::F32, ..ShStore::default() };
    let mut irradiance = IrradianceStore::Sh9(store).zeros(count, 1);
    for probe in 0..count {
        let mut values = [Vec3A::ZERO; COUNT];
        values[0] = Vec3A::splat(mean(probe));
        values[1] = Vec3A::splat(0.1 * mean(probe));
        irradiance.set_probe(probe, &values);
    }
    Volume {
        states: vec![ProbeState::Active; count],
        positions: grid.probes().map(|probe| grid.grid_point(probe)).collect(),
        irradiance,
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

fn untested() -> QuerySettings {
    QuerySettings { test: VisibilityTest::None, ..QuerySettings::default() }
}

#[test]
fn holes_get_what_the_look_up_gives_around_them() {
    let mut own = volume(UVec3::new(3, 3, 3), |_| 2.0);
    own.states[13] = ProbeState::InsideGeometry;
    own.positions[0] += Vec3::new(0.5, 0.0, 0.0);
    for rules in [Rules::Three, Rules::Bevy] {
        let (grids, notes) = one_block(&own, &untested(), rules);
        let moved: Vec<(u32, [f32; 3])> = notes[0].moved.iter().map(|moved| (moved.probe, moved.offset)).collect();
        assert_eq!((&notes[0].holes[..], &moved[..]), (&[13][..], &[(0, [0.5, 0.0, 0.0])][..]));
        for (hole, neighbour) in grids.of_probe(13).iter().zip(grids.of_probe(12)) {
            // Coefficients are made anew of 48 directions.
            assert!((*hole - *neighbour).abs().max_element() < 1e-4, "{rules:?}: {hole} {neighbour}");
        }
    }
    // Where nothing is known around, the nearest counts.
    let mut lone = volume(UVec3::new(4, 1, 1), |_| 3.0);
    lone.states[1..].fill(ProbeState::InsideGeometry);
    let (grids, _) = one_block(&lone, &untested(), Rules::Three);
    assert!((grids.of_probe(3)[0].x - 3.0).abs() < 1e-4);
}

#[test]
fn what_is_written_answers_as_the_volume_does() {
    let own = volume(UVec3::new(3, 4, 2), |probe| 1.0 + probe as f32);
    let settings = untested();
    let query = Query { volume: &own, settings: &settings };
    let (grids, notes) = one_block(&own, &settings, Rules::Three);
    let made = Export::of_grids(&grids, &notes, &origin(), None);
    let folder = tempfile::tempdir().unwrap();
    made.write(folder.path()).unwrap();
    let read = Export::read(folder.path()).unwrap();
    assert_eq!(read.record, made.record);
    // Four halves of 3 × 4 × 7·(2 + 2) texels.
    assert_eq!((read.bytes(), read.probes()), (8 * 3 * 4 * 28, 24));
    let Written::Grids(written) = read.as_read().unwrap() else { panic!("no grids") };
    let written = written.relative_to(DVec3::ZERO);
    let (low, high) = own.grid.hull(0.0);
    for point in points(low + 0.5 * SPACING, high - 0.5 * SPACING, 100) {
        // Half a cell along the normal, of the same linear weights.
        let shifted = QueryPoint { position: point.position + point.normal * 0.5 * SPACING, ..point };
        let (found, expected) =
            (written.irradiance(&point, Visibility::Stored), query.irradiance(&shifted, Visibility::Off));
        // A half has eleven bits; values reach 24.
        assert!((found - expected).abs().max_element() < 24.0 / 1024.0, "{point:?}: {found} {expected}");
    }
}

#[test]
fn damaged_exports_are_refused() {
    let made = export(&grids(Rules::Three, UVec3::new(2, 2, 2), 1));
    let refused = |change: &dyn Fn(&mut Export)| {
        let mut made = made.clone();
        change(&mut made);
        made.as_read().map(|_| ()).unwrap_err()
    };
    let short = refused(&|made| made.files[0].bytes.truncate(100));
    assert!(short.contains("100"), "{short}");
    let huge = refused(&|made| made.record.volumes[0].resolution = [60_000, 60_000, 60_000]);
    assert!(huge.contains("60000"), "{huge}");
    let flat = refused(&|made| made.record.volumes[0].max = made.record.volumes[0].min);
    assert!(flat.contains("no box"), "{flat}");
    let lost = refused(&|made| made.record.volumes[0].file = "other.bin".to_owned());
    assert!(lost.contains("other.bin"), "{lost}");
    // Behind the first slice of 2 × 2 texels, which only repeats the second.
    let infinite = refused(&|made| made.files[0].bytes[32..34].copy_from_slice(&half::f16::INFINITY.to_le_bytes()));
    assert!(infinite.contains("not finite"), "{infinite}");
    let folder = tempfile::tempdir().unwrap();
    let mut outside = made.clone();
    outside.record.volumes[0].file = "../x".to_owned();
    let text = serde_json::to_string(&outside.record).unwrap();
    std::fs::write(folder.path().join(record::RECORD), text).unwrap();
    assert!(Export::read(folder.path()).unwrap_err().to_string().contains("no name of a file"));
}

/// Distances that differ from direction to direction.
fn with_distances(mut volume: Volume) -> Volume {
    let mut maps = OctahedralMaps::new(volume.states.len(), 14, 1, Vec2::ZERO);
    maps.texels.iter_mut().enumerate().for_each(|(i, t)| *t = Vec2::new(1.0 + (i % 7) as f32, 0.25 * (i % 3) as f32));
    volume.occlusion = Occlusion::Moments(maps);
    volume
}

#[test]
fn atlases_of_ddgi_hold_what_rtxgi_reads() {
    let mut own = with_distances(volume(UVec3::new(3, 2, 4), |probe| 1.0 + probe as f32));
    own.positions[7] += Vec3::new(0.5, 0.0, -0.25);
    own.states[4] = ProbeState::InsideGeometry;
    let (made, notes) = Ddgi::of(&own, &untested(), None).unwrap();
    let export = Export::of_ddgi(&made, &notes, &origin());
    let bytes = |kind: &str| {
        let name = format!("probes.0.{kind}.dds");
        &export.files.iter().find(|file| file.name == name).unwrap().bytes[148..]
    };
    // Probe 7 = (1, 0, 1) of plane 0, whose row z = 1 has squares of 8 texels, three of them.
    let half = |data: &[u8], i: usize| half::f16::from_le_bytes([data[2 * i], data[2 * i + 1]]).to_f32();
    let texel = (8 + 3) * 24 + 8 + 2;
    let direction = texel_direction(1, 2, 6);
    let expected = (own.irradiance.of(7, direction).x / (2.0 * PI)).powf(0.2);
    // Eleven bits.
    assert!((half(bytes("irradiance"), 4 * texel) - expected).abs() < expected / 1024.0);
    // Data: one texel a probe, offset ÷ spacing and state.
    let data = |probe: usize| [0, 1, 2, 3].map(|i| half(bytes("data"), 4 * probe + i));
    // Row z = 1, column 1 of the first plane.
    assert_eq!(data(3 + 1), [0.25, 0.0, -0.25, 0.0]);
    // Probe 4 = (1, 1, 0) lies in the second plane, of 12 probes.
    assert_eq!(data(12 + 1)[3], 1.0);
    let number = |i: usize| f32::from_le_bytes(bytes("distance")[4 * i..4 * i + 4].try_into().unwrap());
    let texel = (16 + 1) * 48 + 16 + 1;
    let m = made.volume.occlusion.moments().unwrap().probe(7)[17];
    assert_eq!([number(2 * texel), number(2 * texel + 1)], [0.5 * m.x, 0.5 * (m.x * m.x + m.y * m.y)]);
    // And all of it comes back.
    let Written::Ddgi(read) = export.as_read().unwrap() else { panic!("no volume of DDGI") };
    let read = read.relative_to(DVec3::ZERO);
    assert_eq!(read.volume.states, made.volume.states);
    assert_eq!(read.settings, ddgi::look_up());
    for (a, b) in read.volume.positions.iter().zip(&made.volume.positions) {
        assert!(a.distance(*b) < 1e-3);
    }
    let (low, high) = own.grid.hull(0.0);
    for point in points(low, high, 100) {
        let [a, b] = [&read, &made].map(|ddgi| ddgi.query().irradiance(&point, Visibility::Stored));
        // Halves of fifth roots are right to 5 times 2⁻¹¹; deviations near 0 lose digits in means of squares, as they do in RTXGI.
        assert!((a - b).abs().max_element() < 0.02 * b.max_element(), "{a} {b}");
    }
}

/// Every active probe at its grid point.
fn in_scene(name: &str, spacing: f64) -> (crate::scene::Scene, Volume) {
    let path = format!("{}/scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
    let scene = scene::load(std::path::Path::new(&path), &LoadOptions::default()).unwrap();
    let settings = crate::probe::lattice::grid::GridSettings { spacing_m: Some(spacing), ..Default::default() };
    let grid = Grid::new(&settings, &scene).unwrap();
    let count = grid.probe_count();
    let positions: Vec<Vec3> = grid.probes().map(|probe| grid.grid_point(probe)).collect();
    // The walls are 0.1 m thick.
    let (low, high) = scene.mesh.bounds().unwrap();
    let is_inside = |p: &Vec3| p.cmpgt(low + 0.1).all() && p.cmplt(high - 0.1).all();
    let state = |p| if is_inside(p) { ProbeState::Active } else { ProbeState::NeverSampled };
    let own = Volume {
        states: positions.iter().map(state).collect(),
        positions,
        irradiance: IrradianceStore::Sh9(ShStore::default()).zeros(count, 1),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    };
    (scene, own)
}

#[test]
fn closed_rooms_get_a_volume_each() {
    let rooms_of = |name: &str| {
        let (scene, own) = in_scene(name, 0.8);
        let world = World::new(&scene, 1.0, 0.9).unwrap();
        rooms::rooms(&world, &own).0
    };
    let sealed = rooms_of("two_rooms_sealed");
    let [a, b] = sealed[..] else { panic!("two rooms: {sealed:?}") };
    // 4 × 3 × 4 m each, up to the walls: 0.1 m of wall lie between them. Rays end at surfaces to 0.1 mm.
    for room in [a, b] {
        assert!((room.high - room.low - Vec3::new(4.0, 3.0, 4.0)).abs().max_element() < 2e-4, "{room:?}");
    }
    assert!(((a.low.x - b.low.x).abs() - 4.1).abs() < 2e-4, "{sealed:?}");
    let (scene, own) = in_scene("two_rooms_sealed", 0.8);
    let world = World::new(&scene, 1.0, 0.9).unwrap();
    assert!(rooms::shared(&world, &own).is_some_and(|warning| warning.contains("two rooms")));
    let open = rooms_of("two_rooms_open");
    assert_eq!(open.len(), 1, "one room through the door: {open:?}");
}
