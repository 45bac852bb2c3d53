//! What is written comes back, and levels hold means.

use super::*;

fn store(prefiltered: &[usize]) -> RadianceStore<'_> {
    RadianceStore {
        light_field: LightFieldStore::Maps,
        prefiltered,
        prefilter: Prefilter::Halved,
        format: ColorFormat::R11G11B10F,
        border: 1,
    }
}

#[test]
fn what_is_seen_comes_back_from_the_file() {
    let mut radiance = store(&[4, 2]).zeros(2, 4);
    let light: Vec<Vec3A> = (0..16).map(|o| Vec3A::splat(1.0 + o as f32)).collect();
    radiance.set(1, &light, |o| (o % 3 > 0).then_some((Vec3::Y, o as f32)));
    // Level 1: the means of 1, 2, 5, 6 and so on, exact in 6 bits.
    let coarse = &radiance.prefiltered[1];
    let means: Vec<f32> = [(1, 1), (2, 1), (1, 2), (2, 2)].map(|(c, r)| coarse.probe(1)[c + 4 * r].x).to_vec();
    assert_eq!(means, [3.5, 5.5, 11.5, 13.5]);
    let mut container = Container::default();
    radiance.write(&mut container, &mut EncodingLosses::default());
    let read = Radiance::read(&container, 2, 1).unwrap();
    let (a, b) = (radiance.light_field.as_ref().unwrap(), read.light_field.as_ref().unwrap());
    assert_eq!((&a.normal, &a.distance), (&b.normal, &b.distance));
    assert_eq!(read.prefiltered.len(), 2);
    // Half a step of 5 bits.
    let near = |a: &Vec3, b: &Vec3| (*a - *b).abs().max_element() <= a.max_element() / 64.0;
    assert!(a.radiance.texels.iter().zip(&b.radiance.texels).all(|(a, b)| near(a, b)));
    // What the layout counts is what the file holds.
    let bytes: usize = container.tensors.values().map(|t| t.bytes.len()).sum();
    let (field, levels) = store(&[4, 2]).runtime_bytes(4, true);
    assert_eq!(bytes, 2 * (field + levels));
    container.tensors.remove(NORMAL);
    assert!(Radiance::read(&container, 2, 1).unwrap_err().contains("normal"));
}

#[test]
fn light_fields_to_march_through_come_back() {
    let light_field = LightFieldStore::March { lowest: 2 };
    let store = RadianceStore { light_field, border: 0, ..store(&[]) };
    let mut radiance = store.zeros(1, 4);
    radiance.set(0, &[Vec3A::ONE; 16], |o| (o != 5).then_some((Vec3::Y, 1.0 + o as f32)));
    let field = radiance.light_field.as_ref().unwrap();
    // Blocks of 2×2; the texel without a surface lies in the first.
    assert_eq!(field.lowest.as_ref().unwrap().texels, [1.0, 3.0, 9.0, 11.0]);
    let mut container = Container::default();
    radiance.write(&mut container, &mut EncodingLosses::default());
    let read = Radiance::read(&container, 1, 0).unwrap();
    let again = read.light_field.as_ref().unwrap();
    assert_eq!((&field.distance, &field.lowest), (&again.distance, &again.lowest));
    // Half a step of 1/127.5.
    let near = |(a, b): (&Vec2, &Vec2)| (*a - *b).abs().max_element() <= 0.5 / 127.5 + 1e-6;
    assert!(field.normal.texels.iter().zip(&again.normal.texels).all(near));
    let bytes: usize = container.tensors.values().map(|t| t.bytes.len()).sum();
    assert_eq!(bytes, store.runtime_bytes(4, true).0);
    assert_eq!(read.runtime_bytes(true), store.runtime_bytes(4, true));
    for (side, border) in [(5, 0), (4, 1)] {
        assert!(RadianceStore { border, ..store }.mismatch(Some(side)).is_some());
    }
}

/// Odd sides: the mean over the area keeps constants and the sum.
#[test]
fn levels_are_made_of_light_fields() {
    let mut radiance = store(&[]).zeros(1, 63);
    let light: Vec<Vec3A> = (0..63 * 63).map(|o| Vec3A::splat((o % 63) as f32)).collect();
    radiance.set(0, &light, |_| None);
    radiance.make_levels();
    let sides: Vec<usize> = radiance.prefiltered.iter().map(|maps| maps.resolution).collect();
    assert_eq!(sides, [63, 31, 15, 7]);
    for maps in &radiance.prefiltered {
        let interior = interior_texel(maps.resolution, maps.border);
        let n = maps.resolution * maps.resolution;
        let mean = (0..n).map(|o| maps.probe(0)[interior(o)].x).sum::<f32>() / n as f32;
        assert!((mean - 31.0).abs() < 1e-3, "{} texels: {mean}", maps.resolution);
    }
}

#[test]
fn levels_halve_from_the_capture_on() {
    assert_eq!(store(&[8, 4, 2, 1]).mismatch(Some(8)), None);
    for (levels, side) in [(&[8, 2][..], Some(8)), (&[4], Some(8)), (&[9, 4], Some(9)), (&[8], None)] {
        assert!(store(levels).mismatch(side).is_some(), "{levels:?} of {side:?}");
    }
    let nothing = RadianceStore { light_field: LightFieldStore::None, ..store(&[]) };
    assert_eq!(nothing.mismatch(None), None);
}
