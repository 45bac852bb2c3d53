//! The light of one punctual light, as `KHR_lights_punctual` defines it.

use glam::Vec3;

use crate::scene::light::LIGHT_MAX;
use crate::scene::{LightKind, PunctualLight};

/// Least difference of the cosines of inner and outer cone, from the formula of the extension. It avoids a division by
/// zero for equal cones.
const MIN_CONE_WIDTH: f32 = 0.001;

/// The light that arrives at a point from one punctual light without occluders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Unit, towards the light.
    pub direction: Vec3,
    /// Distance to the light, metres. Infinite for directional lights.
    pub distance: f32,
    /// Irradiance on a surface that faces the light, W·m⁻², at most [`LIGHT_MAX`].
    pub irradiance: Vec3,
}

/// The light that arrives at `position` from one punctual light. `None` if the position is out of range, outside the
/// cone, or at the light itself.
pub fn incident(light: &PunctualLight, position: Vec3) -> Option<Incident> {
    let from = |light_position: Vec3, range_m: f32| {
        let to_light = light_position - position;
        let distance_squared = to_light.length_squared();
        let distance = distance_squared.sqrt();
        let window = if range_m.is_finite() { (1.0 - (distance / range_m).powi(4)).clamp(0.0, 1.0) } else { 1.0 };
        let falloff = window / distance_squared;
        (falloff > 0.0 && falloff.is_finite()).then(|| (to_light / distance, distance, falloff))
    };
    match light.kind {
        LightKind::Directional { direction } => {
            Some(Incident { direction: -direction, distance: f32::INFINITY, irradiance: light.intensity })
        }
        LightKind::Point { position, range_m } => {
            let (direction, distance, falloff) = from(position, range_m)?;
            Some(Incident { direction, distance, irradiance: bounded(light.intensity * falloff) })
        }
        LightKind::Spot { position, direction: axis, range_m, inner_cone_rad, outer_cone_rad } => {
            let (direction, distance, falloff) = from(position, range_m)?;
            let (cos_inner, cos_outer) = (inner_cone_rad.cos(), outer_cone_rad.cos());
            let scale = 1.0 / (cos_inner - cos_outer).max(MIN_CONE_WIDTH);
            let cone = ((axis.dot(-direction) - cos_outer) * scale).clamp(0.0, 1.0);
            let irradiance = bounded(light.intensity * (falloff * cone * cone));
            (cone > 0.0).then_some(Incident { direction, distance, irradiance })
        }
    }
}

/// Light that is at most [`LIGHT_MAX`] per channel: near a light the inverse square of the distance has no bound.
#[inline]
pub fn bounded(light: Vec3) -> Vec3 {
    light.min(Vec3::splat(LIGHT_MAX))
}

/// Whether light has reached [`LIGHT_MAX`] in a channel, and so may have been clamped to it.
#[inline]
pub fn at_bound(light: Vec3) -> bool {
    light.max_element() >= LIGHT_MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: LightKind) -> PunctualLight {
        PunctualLight { name: String::new(), kind, intensity: Vec3::ONE }
    }

    #[test]
    fn range_window_follows_the_extension() {
        let at = |d: f32| {
            incident(&light(LightKind::Point { position: Vec3::ZERO, range_m: 10.0 }), Vec3::X * d)
                .map_or(0.0, |i| i.irradiance.x)
        };
        assert!((at(5.0) - (1.0 - 0.5f32.powi(4)) / 25.0).abs() < 1e-7);
        assert_eq!(at(10.0), 0.0);
        assert_eq!(at(0.0), 0.0);
    }

    #[test]
    fn light_has_a_bound_and_cones_of_no_width_light_nothing() {
        let bright = |kind| PunctualLight { intensity: Vec3::splat(LIGHT_MAX), ..light(kind) };
        let point = bright(LightKind::Point { position: Vec3::ZERO, range_m: f32::INFINITY });
        // The squares of these distances are 10⁻³⁸ and, as a denormal number, 10⁻⁴⁴.
        for distance in [1e-19, 1e-22] {
            let irradiance = incident(&point, Vec3::X * distance).map_or(Vec3::ZERO, |i| i.irradiance);
            assert!(irradiance == Vec3::splat(LIGHT_MAX) || irradiance == Vec3::ZERO, "{irradiance}");
        }
        let spot = |cone: f32| LightKind::Spot {
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            range_m: f32::INFINITY,
            inner_cone_rad: cone,
            outer_cone_rad: cone,
        };
        for cone in [0.0, 1e-6, 1e-3] {
            // 0.01 off the axis lies outside.
            assert_eq!(incident(&bright(spot(cone)), Vec3::new(0.01, 0.0, -1.0)), None);
            let irradiance = incident(&bright(spot(cone)), Vec3::NEG_Z).map_or(Vec3::ZERO, |i| i.irradiance);
            assert!(irradiance.is_finite());
        }
    }

    #[test]
    fn spot_cone_follows_the_extension() {
        let kind = LightKind::Spot {
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            range_m: f32::INFINITY,
            inner_cone_rad: 0.3,
            outer_cone_rad: 0.6,
        };
        let at = |angle: f32| {
            incident(&light(kind), Vec3::new(angle.sin(), 0.0, -angle.cos())).map_or(0.0, |i| i.irradiance.x)
        };
        assert!((at(0.2) - 1.0).abs() < 1e-6);
        let expected = ((0.45f32.cos() - 0.6f32.cos()) / (0.3f32.cos() - 0.6f32.cos())).powi(2);
        assert!((at(0.45) - expected).abs() < 1e-5);
        assert_eq!(at(0.61), 0.0);
    }
}
