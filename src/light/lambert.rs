//! The diffuse surface.

use std::f32::consts::PI;

use glam::Vec3;

/// Radiance that a Lambertian surface reflects under this irradiance: ρE/π. All code that needs this factor 1/π calls
/// this function.
pub fn reflected_radiance(albedo: Vec3, irradiance: Vec3) -> Vec3 {
    albedo * irradiance * (1.0 / PI)
}
