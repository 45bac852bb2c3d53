//! The light on what capture rays hit.

use glam::{DVec3, Vec3};

use super::pattern::TexelRay;
use super::surfel::{PackedNormal, Surfel};
use super::{Capture, ProbeCapture};
use crate::light::lambert::reflected_radiance;
use crate::light::path::PathSettings;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::BlockSample;
use crate::math::random::Random;
use crate::probe::store::surface::are_in_one_voxel;

impl Capture<'_, '_> {
    /// Lights a hit and keeps it.
    #[inline]
    pub(super) fn light(
        &self,
        ray: &TexelRay,
        surface: &SurfacePoint,
        samples: Option<u32>,
        random: &mut Random,
        out: &mut ProbeCapture,
    ) {
        let world = self.world;
        let normal = surface.shading_normal;
        // Many lights are sampled as emitters.
        let (punctual, shadow_rays) = match samples {
            Some(_) if world.emitters.has_lamps() => (Vec3::ZERO, 0),
            _ => world.punctual_irradiance(surface, normal, random.bits()),
        };
        out.rays.shadow += u64::from(shadow_rays);
        let sampled = match samples {
            Some(samples) => world.emitter_irradiance(surface, normal, samples, random, &mut out.rays),
            None => Vec3::ZERO,
        };
        let mut direct = reflected_radiance(surface.albedo, out.bounded(punctual + sampled));
        if !direct.is_finite() {
            out.non_finite += 1;
            direct = Vec3::ZERO;
        }
        self.keep(surface, direct, ray, random, out);
    }

    /// Lights a hit with all light there is and keeps it, as a surface that reflects none of the probes' light.
    pub(super) fn light_by_paths(
        &self,
        (ray, surface): (&TexelRay, &SurfacePoint),
        paths: u32,
        sample: impl Fn(u32) -> BlockSample,
        random: &mut Random,
        out: &mut ProbeCapture,
    ) {
        let world = self.world;
        let normal = surface.shading_normal;
        let settings = PathSettings { expected: self.expected, ..PathSettings::default() };
        let mut sum = DVec3::ZERO;
        for i in 0..paths {
            let mut numbers = sample(i);
            let gathered = world.gather(surface, normal, -ray.direction, &settings, &mut numbers, &mut out.rays);
            if gathered.irradiance.is_finite() {
                sum += gathered.irradiance.as_dvec3();
            } else {
                out.non_finite += 1;
            }
        }
        let (punctual, shadow_rays) = world.punctual_irradiance(surface, normal, sample(0).salt());
        out.rays.shadow += u64::from(shadow_rays);
        let irradiance = punctual + (sum / f64::from(paths.max(1))).as_vec3();
        let radiance = reflected_radiance(surface.albedo, out.bounded(irradiance));
        self.keep(&SurfacePoint { albedo: Vec3::ZERO, ..*surface }, radiance, ray, random, out);
    }

    /// Keeps a hit: as a surfel of its own, or with another ray's of the same texel where both look the same probes up. Bounces
    /// then ask for the probes' light, which changes little there, less often than rays ask for direct light.
    #[inline]
    fn keep(
        &self,
        surface: &SurfacePoint,
        radiance: Vec3,
        ray: &TexelRay,
        random: &mut Random,
        out: &mut ProbeCapture,
    ) {
        let surfel = Surfel::new(surface, radiance, ray.texel, ray.share);
        let of_texel = out.surfels.iter_mut().enumerate().rev().take_while(|(_, known)| known.texel == ray.texel);
        let asks_alike = |known: &Surfel| {
            let in_one = |(grid, n)| are_in_one_voxel(grid, n, [known.position, surfel.position]);
            known.is_like(&surfel) && self.voxels.is_some_and(in_one)
        };
        let known = of_texel.into_iter().find(|(_, known)| asks_alike(known));
        let geometric = || PackedNormal::of(surface.geometric_normal);
        match known {
            None => {
                out.surfels.push(surfel);
                out.geometric.extend(self.keeps_geometric.then(geometric));
            }
            Some((i, known)) => {
                if known.join(&surfel, random.uniform()) && self.keeps_geometric {
                    out.geometric[i] = geometric();
                }
            }
        }
    }
}
