//! Punctual lights (`KHR_lights_punctual`).

use glam::Vec3;

/// Most light that is computed with: radiance, irradiance and intensity per channel. Larger values are clamped to it and
/// counted.
///
/// It lies 8.5 decades below the end of f32, which leaves room for all factors between a light and a stored irradiance:
/// π, the sum over bounces (10³ at the default largest albedo of 0.999) and `lights.punctual_scale`.
pub const LIGHT_MAX: f32 = 1e30;

#[derive(Debug, Clone)]
pub struct PunctualLight {
    pub name: String,
    pub kind: LightKind,
    /// For point and spot lights the radiant intensity, W·sr⁻¹. For directional lights the irradiance on a surface that
    /// faces the light, W·m⁻².
    pub intensity: Vec3,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// `range_m` is infinite if the file gives no range.
    Point { position: Vec3, range_m: f32 },
    /// `direction` is the unit vector that the light shines along.
    Spot { position: Vec3, direction: Vec3, range_m: f32, inner_cone_rad: f32, outer_cone_rad: f32 },
    /// `direction` is the unit vector that the light shines along.
    Directional { direction: Vec3 },
}
