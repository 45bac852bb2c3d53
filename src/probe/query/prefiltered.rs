//! The light that glossy surfaces ask of probes: prefiltered radiance, by the same eight probes and the same weights as
//! irradiance.
//!
//! A probe is asked in the direction from its centre to where the reflected ray ends. That is known where the ray meets a
//! proxy of the scene, a box (Lagarde & Zanuttini, *Local Image-based Lighting With Parallax-corrected Cubemaps*, 2012);
//! without one it is taken to be infinitely far.

use glam::{DVec3, Vec3};

use super::glossy::{Glossy, Parallax};
use super::look_up::Query;
use super::point::CornerWeights;
use crate::math::octahedral::oct_from_direction;

/// Where the light of a reflected ray comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// From infinitely far, unit.
    Direction(Vec3),
    /// From this point, relative to the scene's origin.
    Point(Vec3),
}

impl Query<'_> {
    /// Where a ray ends, by the method's proxy.
    #[inline]
    pub fn source(&self, origin: Vec3, direction: Vec3) -> Source {
        let Glossy::Prefiltered { parallax: Parallax::Box { min, max } } = self.settings.glossy else {
            return Source::Direction(direction);
        };
        // World space to that of the scene.
        let shift = self.volume.grid.origin_world() - self.volume.grid.origin().as_dvec3();
        let (low, high) = ((DVec3::from(min) - shift).as_vec3(), (DVec3::from(max) - shift).as_vec3());
        match leaves_box(origin, direction, low, high) {
            Some(t) => Source::Point(origin + direction * t),
            None => Source::Direction(direction),
        }
    }

    /// Mean radiance within the lobe of a surface of this roughness, 0 to 1, W·m⁻²·sr⁻¹, by these weights: of each probe from
    /// the two levels around roughness × (levels − 1). Zero where no probe counts.
    pub fn prefiltered(&self, weights: &CornerWeights, source: Source, roughness: f32) -> Vec3 {
        let (levels, positions) = (&self.volume.radiance.prefiltered, &self.volume.positions);
        let (Some(last), Some(shares)) = (levels.len().checked_sub(1), weights.shares()) else { return Vec3::ZERO };
        let level = roughness.clamp(0.0, 1.0) * last as f32;
        let fine = (level as usize).min(last);
        let coarse = (fine + 1).min(last);
        let within = level - fine as f32;
        let of_probe = |(corner, share): (usize, f32)| {
            let probe = weights.probes[corner].0 as usize;
            let direction = match source {
                Source::Direction(direction) => direction,
                Source::Point(point) => point - positions[probe],
            };
            if direction == Vec3::ZERO {
                return Vec3::ZERO;
            }
            let oct = oct_from_direction(direction);
            let of_level = |k: usize| levels[k].sample(probe, &levels[k].taps(oct));
            let radiance = match within > 0.0 {
                true => of_level(fine).lerp(of_level(coarse), within),
                false => of_level(fine),
            };
            radiance * share
        };
        shares.map(of_probe).sum()
    }
}

/// Distance at which a ray leaves a box, in lengths of its direction; `None` where it does not, being outside of it.
#[inline]
fn leaves_box(origin: Vec3, direction: Vec3, low: Vec3, high: Vec3) -> Option<f32> {
    let mut leaves = f32::INFINITY;
    for axis in 0..3 {
        if direction[axis] != 0.0 {
            let face = if direction[axis] > 0.0 { high[axis] } else { low[axis] };
            leaves = leaves.min((face - origin[axis]) / direction[axis]);
        }
    }
    (leaves > 0.0 && leaves.is_finite()).then_some(leaves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_leave_the_box_at_its_nearest_face() {
        let (low, high) = (Vec3::new(-1.0, -2.0, -3.0), Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(leaves_box(Vec3::ZERO, Vec3::X, low, high), Some(1.0));
        assert_eq!(leaves_box(Vec3::ZERO, Vec3::new(-0.5, 2.0, 0.0), low, high), Some(1.0));
        assert_eq!(leaves_box(Vec3::new(0.0, 0.0, 2.5), Vec3::new(0.1, 0.0, 1.0), low, high), Some(0.5));
        // Beyond the face that it goes to.
        assert_eq!(leaves_box(Vec3::new(1.5, 0.0, 0.0), Vec3::X, low, high), None);
        assert_eq!(leaves_box(Vec3::ZERO, Vec3::ZERO, low, high), None);
    }
}
