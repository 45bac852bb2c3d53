//! Irradiance from emissive surfaces and the sky, by sampling.
//!
//! Two techniques find this light: rays towards sampled emitters, and cosine-distributed rays. The balance heuristic
//! (Veach & Guibas 1995) combines them. [`Allocation`] divides the samples between them; the estimate is unbiased for
//! any division.

use glam::{Vec2, Vec3};

use super::World;
use super::emitters::{LightSample, Receiver};
use super::surface::SurfacePoint;
use crate::math::random::{KroneckerSequence, Random};
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};
use crate::trace::Ray;

/// The division of samples between the two techniques.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allocation {
    /// Number of cosine-distributed rays.
    pub cosine: u32,
    /// Number of rays towards sampled emitters.
    pub light: u32,
}

impl Allocation {
    /// Divides `samples` by `coverage`, the share of all directions in which an emitter is visible. Rays towards
    /// emitters suit small emitters, and cosine-distributed rays suit large ones. If one radiance arrives from all
    /// directions, the latter alone have no noise.
    pub fn by_coverage(samples: u32, coverage: f32) -> Allocation {
        let cosine = ((samples as f32 * coverage).round() as u32).clamp(1, samples.max(1));
        Allocation { cosine, light: samples.max(1) - cosine }
    }
}

/// Numbers of rays traced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCount {
    /// Rays that find the next surface.
    pub primary: u64,
    /// Rays that test whether light arrives.
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
        let receiver = Receiver { position: point.ray_origin(), normal, geometric_normal: point.geometric_normal };
        if self.emitters.all_behind(receiver.position, receiver.geometric_normal) {
            return Vec3::ZERO;
        }
        let counts = [allocation.cosine as f32, allocation.light as f32];
        let mut sum = Vec3::ZERO;
        for i in 0..allocation.cosine {
            // Stratified along the first axis only.
            let u = Vec2::new((i as f32 + random.uniform()) / counts[0], random.uniform());
            let direction = cosine_hemisphere(normal, u);
            let cosine = normal.dot(direction);
            if receiver.geometric_normal.dot(direction).min(cosine) <= 0.0 {
                continue;
            }
            rays.shadow += 1;
            let (radiance, light_density) = self.emitted_along(Ray::new(receiver.position, direction, random.bits()));
            if radiance != Vec3::ZERO {
                let density = counts[0] * cosine_hemisphere_density(cosine) + counts[1] * light_density;
                sum += radiance * (cosine / density);
            }
        }
        for bits in KroneckerSequence::new(random).take(allocation.light as usize) {
            if let Some(sample) = self.emitters.irradiance_sample(self.scene, &receiver, counts, bits) {
                rays.shadow += 1;
                let ray = match sample.target {
                    Ok(target) => Ray::segment(receiver.position, target, bits[0]),
                    Err(direction) => Ray::new(receiver.position, direction, bits[0]),
                };
                if !self.tracer.occluded(ray) {
                    sum += sample.irradiance;
                }
            }
        }
        sum
    }

    /// Radiance that the ray's first hit, or the sky, emits towards the ray's origin; and the density, sr⁻¹, with which
    /// sampling of emitters draws the same direction. The ray's direction has unit length.
    fn emitted_along(&self, ray: Ray) -> (Vec3, f32) {
        let sky = || {
            let radiance = self.scene.environment.radiance(ray.direction);
            (radiance, self.emitters.density_of_sky(self.scene, ray.direction))
        };
        if self.emitters.triangle_count() == 0 {
            // No surface emits, so any hit means no light.
            return if self.tracer.occluded(ray) { (Vec3::ZERO, 0.0) } else { sky() };
        }
        let Some(hit) = self.tracer.closest(ray) else { return sky() };
        let radiance = self.emission_towards(&hit, ray.direction);
        if radiance == Vec3::ZERO {
            return (radiance, 0.0);
        }
        (radiance, self.emitters.density_of_hit(ray.origin, ray.direction, &hit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allocations_keep_the_number_of_samples() {
        for samples in [1, 2, 7, 64] {
            for coverage in [0.0, 0.01, 0.3, 1.0] {
                let Allocation { cosine, light } = Allocation::by_coverage(samples, coverage);
                assert_eq!(cosine + light, samples);
                // At least one cosine-distributed ray finds what sampling emitters cannot.
                assert!(cosine >= 1);
            }
            assert_eq!(Allocation::by_coverage(samples, 1.0).light, 0);
        }
        assert_eq!(Allocation::by_coverage(64, 0.25), Allocation { cosine: 16, light: 48 });
        assert_eq!(Allocation::by_coverage(0, 0.5), Allocation { cosine: 1, light: 0 });
    }
}
