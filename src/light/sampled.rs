//! Irradiance from emissive surfaces and the sky, found by sampling: at surfaces (next-event estimation and cosine
//! rays combined) and the parts that a probe's own capture needs.
//!
//! The two techniques are combined by the balance heuristic (Veach & Guibas 1995). How the samples are divided between
//! them follows [`Allocation`]: unbiased for any division.

use glam::{Vec2, Vec3};

use super::World;
use super::emitters::LightSample;
use super::surface::SurfacePoint;
use crate::math::random::Random;
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};
use crate::trace::Ray;

/// How many samples go along cosine-distributed rays and how many towards emitters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allocation {
    pub cosine: u32,
    pub light: u32,
}

impl Allocation {
    /// Divides `samples` by `coverage`, the share of all directions in which an emitter is seen: light samples find
    /// what is small, cosine rays what is large, and where all directions emit these alone have no noise at all.
    pub fn by_coverage(samples: u32, coverage: f32) -> Allocation {
        let cosine = ((samples as f32 * coverage).round() as u32).clamp(1, samples.max(1));
        Allocation { cosine, light: samples.max(1) - cosine }
    }
}

/// Rays spent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCount {
    pub primary: u64,
    pub shadow: u64,
}

impl RayCount {
    pub fn total(&self) -> u64 {
        self.primary + self.shadow
    }
}

impl World<'_> {
    /// Whether the light of `sample` reaches `origin`.
    pub fn reaches(&self, origin: Vec3, sample: &LightSample, salt: u32) -> bool {
        let ray = match sample.target {
            Some(target) => Ray::segment(origin, target, salt),
            None => Ray::new(origin, sample.direction, salt),
        };
        !self.tracer.occluded(ray)
    }

    /// One estimate of the irradiance from emitters at a surface with shading normal `normal`, W·m⁻².
    pub fn emitter_irradiance(
        &self,
        point: &SurfacePoint,
        normal: Vec3,
        allocation: Allocation,
        random: &mut Random,
        rays: &mut RayCount,
    ) -> Vec3 {
        let origin = point.ray_origin();
        if self.emitters.all_behind(origin, point.geometric_normal) {
            return Vec3::ZERO;
        }
        let (n_cosine, n_light) = (allocation.cosine as f32, allocation.light as f32);
        let mut sum = Vec3::ZERO;
        for i in 0..allocation.cosine {
            // Stratified along one axis; the other is free.
            let u = Vec2::new((i as f32 + random.uniform()) / n_cosine, random.uniform());
            let direction = cosine_hemisphere(normal, u);
            let cosine = normal.dot(direction);
            if point.geometric_normal.dot(direction) <= 0.0 || cosine <= 0.0 {
                continue;
            }
            rays.shadow += 1;
            let ray = Ray::new(origin, direction, random.bits());
            let (radiance, light_density) = self.emitted_along(ray);
            if radiance != Vec3::ZERO {
                let density = n_cosine * cosine_hemisphere_density(cosine) + n_light * light_density;
                sum += radiance * (cosine / density);
            }
        }
        for _ in 0..allocation.light {
            let Some(sample) = self.emitters.sample(self.scene, origin, random) else { continue };
            let cosine = normal.dot(sample.direction);
            if cosine <= 0.0 || point.geometric_normal.dot(sample.direction) <= 0.0 || sample.radiance == Vec3::ZERO {
                continue;
            }
            rays.shadow += 1;
            if self.reaches(origin, &sample, random.bits()) {
                let density = n_cosine * cosine_hemisphere_density(cosine) + n_light * sample.density;
                sum += sample.radiance * (cosine / density);
            }
        }
        sum
    }

    /// Radiance emitted towards the ray's origin by what the ray meets first, and the density of finding it by light
    /// sampling. The ray's direction has unit length.
    fn emitted_along(&self, ray: Ray) -> (Vec3, f32) {
        let Some(hit) = self.tracer.closest(ray) else {
            let radiance = self.scene.environment.radiance(ray.direction);
            return (radiance, self.emitters.density_of_sky(self.scene, ray.direction));
        };
        let radiance = self.emission_towards(&hit, ray.direction);
        if radiance == Vec3::ZERO {
            return (radiance, 0.0);
        }
        (radiance, self.emitters.density_of_hit(ray.origin, ray.direction, &hit))
    }
}
