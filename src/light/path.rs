//! The reference's estimators: unidirectional paths, with next-event estimation at every vertex.
//!
//! At each vertex one shadow ray goes towards an emitter (emissive triangles by power, the sky), one towards a punctual
//! light, and one ray along the BRDF finds the next vertex. Emission found by both the first and the last is weighted
//! by multiple importance sampling (Veach & Guibas 1995), so each path counts once. Punctual lights cannot be hit, so
//! theirs needs no weight.
//!
//! Surfaces, emission and what lies below the horizon are as everywhere else: [`super::surface`], [`super::sampled`].

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::World;
use super::bsdf::{Bsdf, Transport};
use super::punctual::{Incident, incident};
use super::sampled::RayCount;
use super::surface::SurfacePoint;
use crate::math::blocks::BlockSample;
use crate::math::color::luminance;
use crate::math::random::Numbers;
use crate::trace::Ray;

/// How emission is found. All have the same mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// By both techniques, weighted by the power heuristic (Veach & Guibas 1995, exponent 2).
    #[default]
    Mis,
    /// Only by the rays that continue paths.
    BsdfOnly,
    /// Only by rays towards emitters (but for emission that these can never find).
    LightOnly,
}

/// What a path is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PathSettings {
    pub transport: Transport,
    pub strategy: Strategy,
    /// Most reflections between a light and the surface at which it arrives; `None` for all. 0 leaves what arrives
    /// straight from emitters, 1 adds the first bounce, that of punctual lights included.
    pub max_bounces: Option<u32>,
    /// Largest irradiance, W·m⁻² in any channel, that one sample may bring: larger ones are scaled down to it. It hides
    /// rare bright samples at the price of a result that is too dark; `None` for the truth.
    pub firefly_clamp: Option<f32>,
}

/// One sample of the light that arrives at a surface point: all but punctual lights' own.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gathered {
    /// W·m⁻².
    pub irradiance: Vec3,
    /// Of it the radiance reflected towards the viewer, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// The glossy part of `radiance`.
    pub glossy: Vec3,
}

/// Reflections before Russian roulette begins: these carry most of the light, and paths are not worth ending there.
const ROULETTE_FROM: u32 = 3;

/// Pairs of dimensions of [`BlockSample`] that belong to a vertex, and what each is for.
const PAIRS_PER_VERTEX: u32 = 8;
const PAIR_SCATTER: u32 = 0;
const PAIR_ROULETTE: u32 = 2;
const PAIR_PUNCTUAL: u32 = 3;
const PAIR_EMITTER: u32 = 4;

impl World<'_> {
    /// One sample of the indirect light at `point`, seen from unit `view`, with `normal` for shading.
    pub fn gather(
        &self,
        point: &SurfacePoint,
        normal: Vec3,
        view: Vec3,
        settings: &PathSettings,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Gathered {
        let bsdf = Bsdf::new(self, point, normal, view, settings.transport).covering();
        let mut gathered = Gathered::default();
        if let Some((direction, cosine, radiance)) = self.emitter_sample(point, &bsdf, settings, 0, numbers, rays) {
            let scattered = bsdf.scattered(direction, cosine);
            gathered.irradiance += radiance * cosine;
            gathered.radiance += radiance * scattered.total();
            gathered.glossy += radiance * scattered.glossy;
        }
        numbers.seek(PAIR_SCATTER);
        if let Some(step) = Step::sample(point, &bsdf, numbers) {
            let radiance = self.incoming(point.ray_origin(), &step, settings, numbers, rays) * step.density.recip();
            let scattered = bsdf.scattered(step.direction, step.cosine);
            gathered.irradiance += radiance * step.cosine;
            gathered.radiance += radiance * scattered.total();
            gathered.glossy += radiance * scattered.glossy;
        }
        match settings.firefly_clamp {
            Some(most) if gathered.irradiance.max_element() > most => {
                let factor = most / gathered.irradiance.max_element();
                Gathered {
                    irradiance: gathered.irradiance * factor,
                    radiance: gathered.radiance * factor,
                    glossy: gathered.glossy * factor,
                }
            }
            _ => gathered,
        }
    }

    /// One sample of the radiance that arrives at `origin` along `step`: of emission the part that this technique
    /// answers for, and all that is reflected.
    fn incoming(
        &self,
        origin: Vec3,
        step: &Step,
        settings: &PathSettings,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let (mut origin, mut step) = (origin, *step);
        let mut bounce = 0;
        loop {
            rays.primary += 1;
            let hit = self.tracer.closest(Ray::new(origin, step.direction, numbers.salt()));
            let Some(hit) = hit else {
                let sky = self.scene.environment.radiance(step.direction);
                if sky != Vec3::ZERO {
                    let light_density = self.emitters.density_of_sky(self.scene, step.direction);
                    sum += throughput * sky * settings.strategy.weight_of_hit(step.density, light_density);
                }
                return sum;
            };
            let point = self.surface_at(hit, step.direction);
            if point.emission != Vec3::ZERO {
                let light_density = self.emitters.density_of_hit(origin, step.direction, &hit);
                sum += throughput * point.emission * settings.strategy.weight_of_hit(step.density, light_density);
            }
            bounce += 1;
            if settings.max_bounces.is_some_and(|most| bounce > most) {
                return sum;
            }
            let bsdf = Bsdf::new(self, &point, point.shading_normal, -step.direction, settings.transport);
            if bsdf.is_black() {
                return sum;
            }
            sum += throughput * self.punctual_sample(&point, &bsdf, bounce, numbers, rays);
            if let Some((direction, cosine, radiance)) =
                self.emitter_sample(&point, &bsdf, settings, bounce, numbers, rays)
            {
                sum += throughput * radiance * bsdf.scattered(direction, cosine).total();
            }
            numbers.seek(bounce * PAIRS_PER_VERTEX + PAIR_SCATTER);
            let Some(next) = Step::sample(&point, &bsdf, numbers) else { return sum };
            throughput *= bsdf.scattered(next.direction, next.cosine).total() * next.density.recip();
            if bounce >= ROULETTE_FROM {
                // Paths survive in proportion to what they carry: those that do carry the same afterwards, so the
                // spread of their weights stays bounded however close albedos are to 1.
                let survival = throughput.max_element().min(1.0);
                numbers.seek(bounce * PAIRS_PER_VERTEX + PAIR_ROULETTE);
                let survives = numbers.uniform() < survival;
                if !survives {
                    return sum;
                }
                throughput *= survival.recip();
            }
            origin = point.ray_origin();
            step = next;
        }
    }

    /// Emission found by sampling emitters from a vertex: direction, its cosine, and radiance ÷ density × weight.
    #[inline]
    fn emitter_sample(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        settings: &PathSettings,
        vertex: u32,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Option<(Vec3, f32, Vec3)> {
        if settings.strategy == Strategy::BsdfOnly || self.emitters.is_empty() {
            return None;
        }
        let origin = point.ray_origin();
        if self.emitters.all_behind(origin, point.geometric_normal) {
            return None;
        }
        numbers.seek(vertex * PAIRS_PER_VERTEX + PAIR_EMITTER);
        let bits = std::array::from_fn(|_| numbers.bits());
        let sample = self.emitters.sample(self.scene, origin, bits)?;
        let cosine = bsdf.normal().dot(sample.direction);
        if cosine <= 0.0 || point.geometric_normal.dot(sample.direction) <= 0.0 || sample.radiance == Vec3::ZERO {
            return None;
        }
        rays.shadow += 1;
        if !self.reaches(origin, &sample, numbers.salt()) {
            return None;
        }
        let weight = match settings.strategy {
            Strategy::Mis => power_heuristic(sample.density, bsdf.density(sample.direction, cosine)),
            _ => 1.0,
        };
        Some((sample.direction, cosine, sample.radiance * (weight / sample.density)))
    }

    /// Radiance reflected at a vertex from punctual lights: one of them, chosen in proportion to what it would bring if
    /// nothing were in between.
    #[inline]
    fn punctual_sample(
        &self,
        point: &SurfacePoint,
        bsdf: &Bsdf,
        vertex: u32,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Vec3 {
        let lights = &self.scene.lights;
        if lights.is_empty() {
            return Vec3::ZERO;
        }
        numbers.seek(vertex * PAIRS_PER_VERTEX + PAIR_PUNCTUAL);
        let mut number = numbers.uniform();
        // Reservoir sampling with one number: what is left of it after each decision is uniform again.
        let mut total = 0.0;
        let mut chosen: Option<(Incident, Vec3, f32)> = None;
        for light in lights {
            let Some(incident) = incident(light, point.position) else { continue };
            let cosine = bsdf.normal().dot(incident.direction);
            if cosine <= 0.0 || point.geometric_normal.dot(incident.direction) <= 0.0 {
                continue;
            }
            let radiance = bsdf.scattered(incident.direction, cosine).total() * incident.irradiance;
            let importance = luminance(radiance);
            let brings_light = importance > 0.0;
            if !brings_light {
                continue;
            }
            total += importance;
            let probability = importance / total;
            if number < probability {
                number /= probability;
                chosen = Some((incident, radiance, importance));
            } else {
                number = (number - probability) / (1.0 - probability);
            }
        }
        let Some((incident, radiance, importance)) = chosen else { return Vec3::ZERO };
        rays.shadow += 1;
        let ray = Ray { t_max: incident.distance, ..Ray::new(point.ray_origin(), incident.direction, numbers.salt()) };
        if self.tracer.occluded(ray) { Vec3::ZERO } else { radiance * (self.punctual_scale * (total / importance)) }
    }
}

/// The next ray of a path.
#[derive(Debug, Clone, Copy)]
struct Step {
    direction: Vec3,
    /// To the shading normal.
    cosine: f32,
    /// Of having drawn this direction, sr⁻¹.
    density: f32,
}

impl Step {
    /// `None` below the shading or the geometric horizon: nothing arrives from there.
    #[inline]
    fn sample(point: &SurfacePoint, bsdf: &Bsdf, numbers: &mut BlockSample) -> Option<Step> {
        let direction = bsdf.sample(numbers);
        let cosine = bsdf.normal().dot(direction);
        if cosine <= 0.0 || point.geometric_normal.dot(direction) <= 0.0 {
            return None;
        }
        let density = bsdf.density(direction, cosine);
        (density > 0.0).then_some(Step { direction, cosine, density })
    }
}

impl Strategy {
    /// Weight of emission that a path's ray has met, given the densities of the ray and of sampling the same emission.
    #[inline]
    fn weight_of_hit(self, density: f32, light_density: f32) -> f32 {
        match self {
            Strategy::BsdfOnly => 1.0,
            // What light sampling never draws must be counted here.
            _ if light_density <= 0.0 => 1.0,
            Strategy::LightOnly => 0.0,
            Strategy::Mis => power_heuristic(density, light_density),
        }
    }
}

/// Weight of a technique of density `this` beside one of density `other`, both in sr⁻¹.
#[inline]
fn power_heuristic(this: f32, other: f32) -> f32 {
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}
