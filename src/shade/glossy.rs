//! What the surfaces of a picture reflect as gloss of the light that probes hold: the layer `glossy`.
//!
//! A point reflects the light that the probes around it have for its lobe, times the table of [`split_sum`]. Where a method
//! traces rays, each pixel sends one ([`super::traced`]).

use glam::Vec3;
use rayon::prelude::*;

use super::block_mean::BlockMean;
use super::develop::direct_radiance;
use super::points::{ImagePoint, View};
use super::traced::{RayFigures, Rays};
use super::visibility_modes::VisibilityMode;
use crate::light::World;
use crate::light::bsdf::{Bsdf, ReflectionModel};
use crate::light::ggx::Ggx;
use crate::light::lambert::reflected_radiance;
use crate::light::layered::gloss;
use crate::light::path::PathSettings;
use crate::light::sampled::RayCount;
use crate::light::split_sum;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{Numbers, Purpose, Random};
use crate::plan::glossy_materials;
use crate::probe::query::{Query, Source};
use crate::trace::Ray;

/// A point as its gloss needs it.
#[derive(Debug, Clone, Copy)]
pub struct Gloss {
    /// Reflectance along the normal.
    pub f0: Vec3,
    pub roughness: f32,
    /// Between the normal and the direction to the viewer.
    pub cosine: f32,
    /// Unit, of the viewer's direction mirrored at the normal.
    pub reflected: Vec3,
}

/// Cosines between view and normal are taken to be at least this: normal maps can make them negative.
const LEAST_COSINE: f32 = 1e-3;

/// The gloss of every point, `None` where it reflects nothing; `None` in all where no material of the scene is glossy, and so
/// nothing is shaded.
pub fn glosses(world: &World, view: &View) -> Option<Vec<Option<Gloss>>> {
    if glossy_materials(world.scene) == 0 {
        return None;
    }
    let of_point = |point: &ImagePoint| {
        let (f0, roughness) = gloss(world, &point.surface)?;
        let (normal, view) = (point.query.normal, point.query.view);
        let cosine = normal.dot(view);
        let reflected = (normal * (2.0 * cosine) - view).normalize_or(normal);
        Some(Gloss { f0, roughness, cosine: cosine.max(LEAST_COSINE), reflected })
    };
    Some(view.points.par_iter().map(of_point).collect())
}

/// What of a method's shading is exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Reflected rays end where the method takes them to.
    Proxy,
    /// They end where Embree says.
    Exact,
    /// They end infinitely far away.
    Far,
}

/// A view whose gloss is shaded.
#[derive(Clone, Copy)]
pub struct Glossy<'a, 's> {
    pub world: &'a World<'s>,
    pub view: &'a View,
    pub glosses: &'a [Option<Gloss>],
    pub seed: u64,
}

impl Glossy<'_, '_> {
    fn each(&self, value: impl Fn(usize, &ImagePoint, &Gloss) -> Vec3 + Sync) -> Vec<Vec3> {
        let points = self.view.points.par_iter().zip(self.glosses).enumerate();
        points.map(|(i, (point, gloss))| gloss.as_ref().map_or(Vec3::ZERO, |gloss| value(i, point, gloss))).collect()
    }

    /// Radiance that every point reflects, W·m⁻²·sr⁻¹, and what rays were traced for it.
    pub fn shade(&self, query: &Query, masks: &[u8], mode: VisibilityMode, ends: Ends) -> (Vec<Vec3>, RayFigures) {
        if let (Some(tracing), Some(settings)) = (query.tracing(), query.settings.glossy.traced()) {
            return self.trace(&Rays { view: self.view, tracing, settings, seed: self.seed });
        }
        let shaded = self.each(|i, point, gloss| {
            let weights = query.weights(&point.query, mode.visibility(masks[i]));
            let origin = point.surface.position;
            let source = match ends {
                Ends::Proxy => query.source(origin, gloss.reflected),
                Ends::Far => Source::Direction(gloss.reflected),
                Ends::Exact => {
                    let from = point.surface.ray_origin();
                    match self.world.tracer.closest(Ray::new(from, gloss.reflected, point.pixel)) {
                        Some(hit) => Source::Point(from + gloss.reflected * hit.t),
                        None => Source::Direction(gloss.reflected),
                    }
                }
            };
            query.prefiltered(&weights, source, gloss.roughness) * reflected(gloss)
        });
        (shaded, RayFigures::default())
    }

    /// One ray a pixel through a facet that the viewer sees, and the filter over them.
    fn trace(&self, rays: &Rays) -> (Vec<Vec3>, RayFigures) {
        let direction = |i: usize, point: &ImagePoint, random: &mut Random| {
            let gloss = self.glosses[i].as_ref()?;
            let (normal, view) = (point.query.normal, point.query.view);
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            let local = Ggx::view(Vec3::new(view.dot(tangent), view.dot(bitangent), view.dot(normal)));
            let light = Ggx::new(gloss.roughness, Vec3::ONE).sample(local, random.pair());
            Some((tangent * light.x + bitangent * light.y + normal * light.z).normalize_or(gloss.reflected))
        };
        let roughness = |i: usize| self.glosses[i].as_ref().map_or(0.0, |gloss| gloss.roughness);
        let (radiance, figures) = rays.trace(Purpose::GlossyRays, direction, roughness);
        (self.each(|i, _, gloss| radiance[i] * reflected(gloss)), figures)
    }

    /// What the model itself makes of exact light: at every point the mean of the radiance over GGX's lobe around the reflected
    /// direction, as prefiltered levels hold it, by at least `paths` paths, times the table.
    pub fn model(&self, paths: u32) -> Vec<BlockMean> {
        let of_point = |(point, gloss): (&ImagePoint, &Option<Gloss>)| {
            let mut mean = BlockMean::default();
            let Some(gloss) = gloss else { return mean };
            for b in 0..paths.div_ceil(BLOCK).max(2) {
                let block = Block::new(self.seed, Purpose::GlossyPaths, u64::from(point.pixel), u64::from(b));
                mean.push((self.lobe_radiance(point, gloss, &block) * reflected(gloss)).as_dvec3());
            }
            mean
        };
        self.view.points.par_iter().zip(self.glosses).map(of_point).collect()
    }

    /// A block of samples of the mean radiance within the lobe, weighted by the cosine.
    fn lobe_radiance(&self, point: &ImagePoint, gloss: &Gloss, block: &Block) -> Vec3 {
        let axis = gloss.reflected;
        let (tangent, bitangent) = axis.any_orthonormal_pair();
        let lobe = Ggx::new(gloss.roughness, Vec3::ONE);
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for i in 0..BLOCK {
            let mut numbers = block.sample(i);
            // Facets that are seen along the normal are distributed as D·cos.
            let light = lobe.sample(Vec3::Z, numbers.pair());
            if light.z <= 0.0 {
                continue;
            }
            let direction = tangent * light.x + bitangent * light.y + axis * light.z;
            let radiance = self.radiance(point.surface.ray_origin(), direction, &mut numbers);
            if radiance.is_finite() {
                sum += radiance * light.z;
                total += light.z;
            }
        }
        if total > 0.0 { sum / total } else { Vec3::ZERO }
    }

    /// A sample of the radiance that comes along a ray, surfaces being glossy as the reference's are.
    fn radiance(&self, origin: Vec3, direction: Vec3, numbers: &mut crate::math::blocks::BlockSample) -> Vec3 {
        let (world, transport) = (self.world, ReflectionModel::Gltf);
        let Some(surface) = world.surface(Ray::new(origin, direction, numbers.salt())) else {
            return world.scene.environment.radiance(direction);
        };
        let (normal, view) = (surface.shading_normal, -direction);
        let bsdf = Bsdf::new(world, &surface, normal, view, transport);
        let punctual = world.punctual_radiance(&surface, &bsdf, numbers.salt());
        let settings = PathSettings { transport, ..PathSettings::default() };
        let mut rays = RayCount::default();
        surface.emission + punctual + world.gather(&surface, normal, view, &settings, numbers, &mut rays).radiance
    }

    /// Radiance towards the viewer with gloss, W·m⁻²·sr⁻¹: a base reflects what the lobe above it leaves.
    pub fn beauty(&self, i: usize, irradiance_indirect: Vec3, glossy: Vec3) -> Vec3 {
        let point = &self.view.points[i];
        let direct = direct_radiance(self.world, point, ReflectionModel::Gltf, point.pixel);
        let left = self.glosses[i].as_ref().map_or(Vec3::ONE, |gloss| Vec3::ONE - reflected(gloss));
        let base = reflected_radiance(point.surface.albedo, irradiance_indirect) * left.max(Vec3::ZERO);
        point.surface.emission + direct + base + glossy
    }
}

/// Share of the light in its lobe that a point reflects.
#[inline]
fn reflected(gloss: &Gloss) -> Vec3 {
    split_sum::reflected(gloss.f0, gloss.roughness, gloss.cosine)
}
