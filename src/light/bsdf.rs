//! Reflection at a surface. One type, [`Bsdf`], covers both reflection models.

use std::f32::consts::PI;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::World;
use super::layered::{Layered, Scattered};
use super::surface::SurfacePoint;
use crate::math::random::Numbers;
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};

/// The reflection model of paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReflectionModel {
    /// Every surface is Lambertian with its diffuse albedo. Probes store this light.
    #[default]
    Lambert,
    /// The metallic-roughness model of glTF, [`Layered`].
    Gltf,
}

/// The BRDF of a surface for one normal and one view direction.
#[derive(Debug, Clone, Copy)]
pub enum Bsdf {
    Lambert { normal: Vec3, albedo: Vec3 },
    Gltf(Layered),
}

impl Bsdf {
    /// `normal` is the shading normal; `view` the unit direction towards the viewer.
    #[inline]
    pub fn new(world: &World, point: &SurfacePoint, normal: Vec3, view: Vec3, transport: ReflectionModel) -> Bsdf {
        match transport {
            ReflectionModel::Lambert => Bsdf::Lambert { normal, albedo: point.albedo },
            ReflectionModel::Gltf => Bsdf::Gltf(Layered::new(world, point, normal, view)),
        }
    }

    /// The same BRDF with other sampling: at least half of the samples are cosine-distributed. Estimates of irradiance
    /// need this. Irradiance counts all directions, and the weights of its samples must stay bounded.
    #[inline]
    pub fn covering(self) -> Bsdf {
        match self {
            Bsdf::Lambert { .. } => self,
            Bsdf::Gltf(layered) => Bsdf::Gltf(layered.covering()),
        }
    }

    /// The shading normal.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => *normal,
            Bsdf::Gltf(layered) => layered.normal(),
        }
    }

    /// Whether the surface reflects nothing.
    #[inline]
    pub fn is_black(&self) -> bool {
        match self {
            Bsdf::Lambert { albedo, .. } => *albedo == Vec3::ZERO,
            Bsdf::Gltf(layered) => layered.is_black(),
        }
    }

    /// BRDF × cosine for light from unit `direction`. `cosine` > 0 is the cosine between `direction` and the normal.
    #[inline]
    pub fn scattered(&self, direction: Vec3, cosine: f32) -> Scattered {
        match self {
            Bsdf::Lambert { albedo, .. } => Scattered { diffuse: *albedo * (cosine / PI), glossy: Vec3::ZERO },
            Bsdf::Gltf(layered) => layered.scattered(direction, cosine),
        }
    }

    /// Density with which [`Self::sample`] draws `direction`, sr⁻¹. `cosine` > 0 is the cosine between `direction` and
    /// the normal.
    #[inline]
    pub fn density(&self, direction: Vec3, cosine: f32) -> f32 {
        match self {
            Bsdf::Lambert { .. } => cosine_hemisphere_density(cosine),
            Bsdf::Gltf(layered) => layered.density(direction, cosine),
        }
    }

    /// A random light direction, preferably one from which much light is reflected. Its density is [`Self::density`].
    /// It may lie below the surface.
    #[inline]
    pub fn sample(&self, numbers: &mut impl Numbers) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => cosine_hemisphere(*normal, numbers.pair()),
            Bsdf::Gltf(layered) => layered.sample(numbers),
        }
    }
}
