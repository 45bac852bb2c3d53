//! The environment: the light that arrives along rays that leave the scene.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

/// Radiance from infinitely far away, W·m⁻²·sr⁻¹.
#[derive(Debug, Clone, Default)]
pub enum Environment {
    #[default]
    None,
    Constant(Vec3),
    Map(EnvironmentMap),
}

/// An equirectangular map. Its centre is the direction −Z, its top row is +Y, and +X lies to the right of the centre.
#[derive(Debug, Clone)]
pub struct EnvironmentMap {
    pub width: usize,
    pub height: usize,
    /// Linear RGB radiance, rows from the top, finite and not negative.
    pub texels: Vec<Vec3>,
}

impl EnvironmentMap {
    /// Map coordinates ∈ [0,1)² of a unit direction. Inverse of [`Self::direction`].
    pub fn uv(direction: Vec3) -> Vec2 {
        let u = 0.5 + direction.x.atan2(-direction.z) / (2.0 * PI);
        let v = direction.y.clamp(-1.0, 1.0).acos() / PI;
        Vec2::new(u, v)
    }

    /// Unit direction of map coordinates. Inverse of [`Self::uv`].
    pub fn direction(uv: Vec2) -> Vec3 {
        let (sin_phi, cos_phi) = ((uv.x - 0.5) * 2.0 * PI).sin_cos();
        let (sin_theta, cos_theta) = (uv.y * PI).sin_cos();
        Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
    }

    /// Radiance along a unit direction: that of the texel which contains it. There is no interpolation, so the
    /// densities for sampling by texel are exact.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.texels[self.texel_index(direction)]
    }

    /// Index in [`Self::texels`] of the texel that contains a unit direction.
    pub fn texel_index(&self, direction: Vec3) -> usize {
        let uv = Self::uv(direction);
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        y * self.width + x
    }
}

impl Environment {
    /// Radiance along a unit direction.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match self {
            Environment::None => Vec3::ZERO,
            Environment::Constant(radiance) => *radiance,
            Environment::Map(map) => map.radiance(direction),
        }
    }

    pub fn is_black(&self) -> bool {
        match self {
            Environment::None => true,
            Environment::Constant(radiance) => *radiance == Vec3::ZERO,
            Environment::Map(map) => map.texels.iter().all(|&t| t == Vec3::ZERO),
        }
    }
}
