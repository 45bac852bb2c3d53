//! The atlases of RTXGI.

use std::f32::consts::PI;

use glam::{DVec3, UVec3, Vec2, Vec3};

use super::fixture::{origin, points, untested, volume};
use crate::export::ddgi::{self, Ddgi};
use crate::export::{Export, Written};
use crate::math::octahedral::texel_direction;
use crate::probe::Volume;
use crate::probe::lattice::ProbeState;
use crate::probe::query::Visibility;
use crate::probe::store::Occlusion;
use crate::probe::store::map::OctahedralMaps;

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
