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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn map_and_inverse_agree(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let d = Vec3::new(x, y, z);
            prop_assume!(d.length() > 1e-3);
            let d = d.normalize();
            let back = EnvironmentMap::direction(EnvironmentMap::uv(d));
            // `acos` near the poles turns a rounding of 6e-8 into an angle of 3.5e-4.
            prop_assert!(back.distance(d) < 1e-3, "{d} came back as {back}");
        }
    }

    #[test]
    fn directions_lie_where_the_documentation_says() {
        let at = |d: Vec3| EnvironmentMap::uv(d);
        assert!(at(Vec3::NEG_Z).distance(Vec2::new(0.5, 0.5)) < 1e-6);
        assert!(at(Vec3::X).distance(Vec2::new(0.75, 0.5)) < 1e-6);
        assert_eq!(at(Vec3::Y).y, 0.0);
        assert_eq!(at(Vec3::NEG_Y).y, 1.0);
        let map = EnvironmentMap { width: 4, height: 2, texels: (0..8).map(|i| Vec3::splat(i as f32)).collect() };
        assert_eq!(map.radiance(Vec3::new(1.0, 0.1, -0.1).normalize()).x, 2.0);
        // The lower pole belongs to the last row.
        assert!((4..8).contains(&map.texel_index(Vec3::NEG_Y)));
    }
}
