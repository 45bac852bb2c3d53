//! How a surface scatters light, as one value for every model of transport.

use std::f32::consts::PI;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::World;
use super::surface::SurfacePoint;
use crate::math::random::Numbers;
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};

/// Which model of reflection paths follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transport {
    /// Every surface Lambertian with its diffuse albedo: what probes hold.
    #[default]
    Lambert,
}

/// A surface's BRDF around one normal, for one viewer.
#[derive(Debug, Clone, Copy)]
pub enum Bsdf {
    Lambert { normal: Vec3, albedo: Vec3 },
}

/// BRDF × cosine towards one direction, sr⁻¹, in its two parts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Scattered {
    pub diffuse: Vec3,
    pub glossy: Vec3,
}

impl Scattered {
    pub fn total(&self) -> Vec3 {
        self.diffuse + self.glossy
    }
}

impl Bsdf {
    /// `normal` is the shading normal; `view` the unit direction towards the viewer.
    #[inline]
    pub fn new(_world: &World, point: &SurfacePoint, normal: Vec3, _view: Vec3, transport: Transport) -> Bsdf {
        match transport {
            Transport::Lambert => Bsdf::Lambert { normal, albedo: point.albedo },
        }
    }

    /// The shading normal.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => *normal,
        }
    }

    /// Whether nothing is reflected, whatever arrives.
    #[inline]
    pub fn is_black(&self) -> bool {
        match self {
            Bsdf::Lambert { albedo, .. } => *albedo == Vec3::ZERO,
        }
    }

    /// BRDF × cosine for light from unit `direction`; `cosine` > 0 is that to the normal.
    #[inline]
    pub fn scattered(&self, _direction: Vec3, cosine: f32) -> Scattered {
        match self {
            Bsdf::Lambert { albedo, .. } => Scattered { diffuse: *albedo * (cosine / PI), glossy: Vec3::ZERO },
        }
    }

    /// Density with which [`Self::sample`] draws `direction`, sr⁻¹; `cosine` > 0 is that to the normal.
    #[inline]
    pub fn density(&self, _direction: Vec3, cosine: f32) -> f32 {
        match self {
            Bsdf::Lambert { .. } => cosine_hemisphere_density(cosine),
        }
    }

    /// A direction in which much is reflected; its density is [`Self::density`]. It may lie below the surface.
    #[inline]
    pub fn sample(&self, numbers: &mut impl Numbers) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => cosine_hemisphere(*normal, numbers.pair()),
        }
    }
}
