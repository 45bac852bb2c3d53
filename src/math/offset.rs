//! Offsets of ray ends from surfaces. Without them a ray could hit the surface that it leaves or ends at.

use glam::Vec3;

/// Offset in units of ε·c, where ε is f32's relative spacing and c the largest coordinate of the triangle.
///
/// Two errors add up. A hit point computed from its triangle is off by about two roundings of c. Embree's distance to
/// the triangle is off by about six, because it sums three products of edge lengths ≤ 2c. The sum is 8; 32 leaves a
/// factor of four. At c = 4 m the offset is 15 µm.
const OFFSET_ULPS: f32 = 32.0;

/// Least distance, metres, between the end of a ray from `origin` and a surface that the ray must not hit. It depends
/// on the ray's origin, because Embree first translates every triangle by that origin and rounds the result.
pub fn end_offset(origin: Vec3) -> f32 {
    OFFSET_ULPS * f32::EPSILON * origin.abs().max_element()
}

/// Distance, metres, between the start of a ray and the triangle with these corners that it leaves. It scales with the
/// scene and contains no absolute length.
pub fn ray_offset(corners: &[Vec3; 3]) -> f32 {
    let largest = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max);
    // The offset is never 0, even if all corners lie exactly at the origin.
    (OFFSET_ULPS * f32::EPSILON * largest).max(f32::MIN_POSITIVE)
}
