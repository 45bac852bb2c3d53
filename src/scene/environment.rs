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

    /// The map turned about +Y by an angle in degrees, counterclockwise as seen from above (right-hand rule): after 90° its
    /// centre is the direction −X.
    ///
    /// Texels stay what they are where the angle is a multiple of `360 / width`. Otherwise each texel takes from the two
    /// that it overlaps in proportion, which keeps the sum of every row.
    pub fn turned(self, degrees: f64) -> EnvironmentMap {
        // Turning by φ about +Y lowers the longitude `2π (u − ½)` of every direction by φ.
        let shift = (degrees.rem_euclid(360.0) / 360.0) * self.width as f64;
        let (whole, part) = (shift.floor() as usize, shift.fract() as f32);
        if shift == 0.0 {
            return self;
        }
        let turned_row = |row: &[Vec3]| -> Vec<Vec3> {
            let old = |x: usize| row[x % row.len()];
            (0..row.len()).map(|x| old(x + whole) * (1.0 - part) + old(x + whole + 1) * part).collect()
        };
        let texels = self.texels.chunks_exact(self.width).flat_map(turned_row).collect();
        EnvironmentMap { texels, ..self }
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

    #[test]
    fn maps_turn_counterclockwise_from_above() {
        let (width, height) = (16, 8);
        let bright = EnvironmentMap { width, height, texels: vec![Vec3::ZERO; width * height] };
        let with_bright = |direction: Vec3| {
            let mut map = bright.clone();
            let index = map.texel_index(direction);
            map.texels[index] = Vec3::ONE;
            map
        };
        // Off the borders between texels.
        let off = Vec3::new(0.05, 0.1, 0.05);
        for (degrees, from, to) in [
            (90.0, Vec3::NEG_Z, Vec3::NEG_X),
            (90.0, Vec3::X, Vec3::NEG_Z),
            (-90.0, Vec3::NEG_Z, Vec3::X),
            (180.0, Vec3::NEG_Z, Vec3::Z),
            (450.0, Vec3::Z, Vec3::X),
            (0.0, Vec3::X, Vec3::X),
        ] {
            let rotation = glam::Quat::from_rotation_y((degrees as f32).to_radians());
            let start = (from + off).normalize();
            let turned = with_bright(start).turned(degrees);
            let found = turned.texels.iter().position(|&texel| texel == Vec3::ONE);
            assert_eq!(found, Some(turned.texel_index(rotation * start)), "{from} by {degrees}°");
            // The documentation's own directions.
            assert!((rotation * from).abs_diff_eq(to, 1e-6), "{from} by {degrees}°");
        }
    }

    #[test]
    fn turns_between_texels_keep_the_light() {
        let texels: Vec<Vec3> = (0..8).map(|i| Vec3::splat((i * i) as f32)).collect();
        let map = EnvironmentMap { width: 4, height: 2, texels };
        // A quarter of a texel.
        let turned = map.clone().turned(360.0 / 4.0 * 0.25);
        assert_eq!(turned.texels[0], map.texels[0] * 0.75 + map.texels[1] * 0.25);
        assert_eq!(turned.texels[7], map.texels[7] * 0.75 + map.texels[4] * 0.25);
        for row in 0..2 {
            let sum = |map: &EnvironmentMap| map.texels[4 * row..4 * row + 4].iter().sum::<Vec3>();
            assert_eq!(sum(&turned), sum(&map));
        }
    }
}
