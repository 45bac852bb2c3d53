//! Punctual lights (`KHR_lights_punctual`).

use glam::Vec3;

#[derive(Debug, Clone)]
pub struct PunctualLight {
    pub name: String,
    pub kind: LightKind,
    /// Point and spot: radiant intensity, W·sr⁻¹. Directional: irradiance on a facing surface, W·m⁻².
    pub intensity: Vec3,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// `range_m` is infinite where the file gives none.
    Point { position: Vec3, range_m: f32 },
    /// `direction` is the unit vector that the light shines along.
    Spot { position: Vec3, direction: Vec3, range_m: f32, inner_cone_rad: f32, outer_cone_rad: f32 },
    /// `direction` is the unit vector that the light shines along.
    Directional { direction: Vec3 },
}
