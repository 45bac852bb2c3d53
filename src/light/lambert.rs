//! The diffuse surface.

use std::f32::consts::PI;

use glam::Vec3;

/// Radiance that a Lambertian surface reflects under this irradiance: ρE/π. The one place where this π lives.
pub fn reflected_radiance(albedo: Vec3, irradiance: Vec3) -> Vec3 {
    albedo * irradiance * (1.0 / PI)
}
