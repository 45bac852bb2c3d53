//! Irradiance from emissive surfaces and the sky, by sampling.
//!
//! Two techniques find this light: rays towards sampled emitters, and cosine-distributed rays. The balance heuristic
//! (Veach & Guibas 1995) combines them. The place's [`Shares`] divides the samples between them; the estimate is unbiased
//! for any division.

use std::iter::Sum;
use std::ops::Add;

use glam::{Vec2, Vec3};

use super::World;
use super::emitters::receiver::Receiver;
use super::emitters::shares::Shares;
use super::emitters::{LightSample, Origin};
use super::surface::SurfacePoint;
use crate::math::random::{KroneckerSequence, Random};
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};
use crate::trace::{Hit, Ray};

/// Numbers of rays traced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCount {
    /// Rays that find the next surface.
    pub primary: u64,
    /// Rays that test whether light arrives.
    pub shadow: u64,
}

impl Add for RayCount {
    type Output = RayCount;

    fn add(self, other: RayCount) -> RayCount {
        RayCount { primary: self.primary + other.primary, shadow: self.shadow + other.shadow }
    }
}

impl Sum for RayCount {
    fn sum<I: Iterator<Item = RayCount>>(all: I) -> RayCount {
        all.fold(RayCount::default(), Add::add)
    }
}

impl RayCount {
    pub fn total(&self) -> u64 {
        self.primary + self.shadow
    }
}

/// Emission that a ray found.
#[derive(Debug, Clone, Copy)]
pub struct Emission {
    /// Towards the ray's origin, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    pub group: usize,
    /// Density within the group, sr⁻¹.
    pub density: f32,
}

impl World<'_> {
    /// Whether the light of `sample` reaches `origin`.
    pub fn reaches(&self, origin: Vec3, sample: &LightSample, salt: u32) -> bool {
        match sample.origin {
            Origin::Surface(target) => !self.tracer.occluded(Ray::segment(origin, target, salt)),
            Origin::Sky => !self.tracer.occluded(Ray::new(origin, sample.direction, salt)),
            Origin::Punctual { index, incident } => self.light_reaches(index, &incident, origin, salt),
        }
    }

    /// One estimate of the irradiance from emitters at a surface with shading normal `normal`, W·m⁻², from this many
    /// samples, at least one.
    pub fn emitter_irradiance(
        &self,
        point: &SurfacePoint,
        normal: Vec3,
        samples: u32,
        random: &mut Random,
        rays: &mut RayCount,
    ) -> Vec3 {
        if self.emitters.all_behind(point.ray_origin(), point.geometric_normal) {
            return Vec3::ZERO;
        }
        let shares = self.shares_at(point);
        // Rounded by chance, so that the mean is as the place asks for.
        let cosine = ((samples.max(1) as f32 * shares.cosine + random.uniform()) as u32).min(samples.max(1));
        self.irradiance_by(&point.receiver(normal), shares, [cosine, samples.max(1) - cosine], random, rays)
    }

    /// The same with these numbers of cosine-distributed rays and of rays towards sampled emitters.
    pub fn irradiance_by(
        &self,
        receiver: &Receiver,
        shares: &Shares,
        [cosine_rays, light_rays]: [u32; 2],
        random: &mut Random,
        rays: &mut RayCount,
    ) -> Vec3 {
        let counts = [cosine_rays as f32, light_rays as f32];
        let mut sum = Vec3::ZERO;
        for i in 0..cosine_rays {
            // Stratified along the first axis only.
            let u = Vec2::new((i as f32 + random.uniform()) / counts[0], random.uniform());
            let direction = cosine_hemisphere(receiver.normal, u);
            let cosine = receiver.cosine(direction);
            if cosine <= 0.0 {
                continue;
            }
            rays.shadow += 1;
            if let Some(found) = self.emission_along(receiver, Ray::new(receiver.position, direction, random.bits())) {
                let light_density = shares.of(found.group) * found.density;
                let density = counts[0] * cosine_hemisphere_density(cosine) + counts[1] * light_density;
                sum += found.radiance * (cosine / density);
            }
        }
        for bits in KroneckerSequence::new(random).take(light_rays as usize) {
            let Some(sample) = self.emitters.sample(self.scene, shares, receiver, bits) else { continue };
            let cosine = receiver.cosine(sample.direction);
            if cosine <= 0.0 || sample.radiance == Vec3::ZERO {
                continue;
            }
            rays.shadow += 1;
            if self.reaches(receiver.position, &sample, bits[0]) {
                let of_cosine = if sample.is_punctual() { 0.0 } else { counts[0] * cosine_hemisphere_density(cosine) };
                sum += sample.radiance * (cosine / (of_cosine + counts[1] * sample.density));
            }
        }
        sum
    }

    /// What the ray's first hit, or the sky, emits towards the ray's origin. `None` where that is nothing. The ray's direction
    /// has unit length.
    pub fn emission_along(&self, receiver: &Receiver, ray: Ray) -> Option<Emission> {
        if self.emitters.triangle_count() == 0 {
            // No surface emits, so any hit means no light.
            return if self.tracer.occluded(ray) { None } else { self.emission_of(receiver, ray.direction, None) };
        }
        self.emission_of(receiver, ray.direction, self.tracer.closest(ray))
    }

    /// What the first hit of a ray, or the sky, emits towards the receiver. `None` where that is nothing.
    #[inline]
    pub fn emission_of(&self, receiver: &Receiver, direction: Vec3, hit: Option<Hit>) -> Option<Emission> {
        let Some(hit) = hit else {
            let (radiance, group, density) = self.emitters.sky_group_along(self.scene, direction)?;
            return (radiance != Vec3::ZERO).then_some(Emission { radiance, group, density });
        };
        let radiance = self.emission_towards(&hit, direction);
        if radiance == Vec3::ZERO {
            return None;
        }
        let (group, density) = self.emitters.group_of_hit(receiver, direction, &hit)?;
        Some(Emission { radiance, group, density })
    }
}
