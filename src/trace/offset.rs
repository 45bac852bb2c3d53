//! How far a ray must start from the surface it leaves, lest it hits that surface again.

use glam::Vec3;

/// Offset in units of the floating-point spacing at the triangle's largest coordinate.
///
/// A hit point computed from its triangle is off by about two roundings of the largest coordinate c of the
/// triangle's vertices, Embree's distance to that triangle by about six (three products of edge lengths ≤ 2c, summed);
/// 32 leaves a factor of four, and is 15 µm at 4 m.
const OFFSET_ULPS: f32 = 32.0;

/// Distance, metres, by which a ray from `origin` must end short of a surface that it must not hit, however near the scene's
/// origin that surface lies: Embree moves every triangle by the ray's origin first, so that its rounding counts too.
pub fn end_offset(origin: Vec3) -> f32 {
    OFFSET_ULPS * f32::EPSILON * origin.abs().max_element()
}

/// Distance, metres, to start rays off a triangle with these corners. Scales with the scene: no absolute length in it.
pub fn ray_offset(corners: &[Vec3; 3]) -> f32 {
    let largest = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max);
    // Where everything lies at the origin exactly there is still the smallest normal number.
    (OFFSET_ULPS * f32::EPSILON * largest).max(f32::MIN_POSITIVE)
}
