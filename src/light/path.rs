//! Path tracing for the reference: unidirectional paths with next-event estimation at every vertex.
//!
//! Each vertex sends three rays: a shadow ray towards an emitter (an emissive triangle or the sky), a shadow ray
//! towards a punctual light, and a ray along the BRDF that finds the next vertex. The first and the third find the same
//! emission. Multiple importance sampling (Veach & Guibas 1995) weights them, so that each path counts once. No ray can
//! hit a punctual light, so the second needs no weight.
//!
//! Surfaces and emission follow [`super::surface`] and [`super::sampled`], as in the bake.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::World;
use super::bsdf::{Bsdf, ReflectionModel};
use super::emitters::receiver::Receiver;
use super::emitters::shares::Shares;
use super::expected::{Expected, Light};
use super::incident::{Incident, incident};
use super::irradiance_cache::IrradianceCache;
use super::lambert::reflected_radiance;
use super::roulette::survival;
use super::sampled::RayCount;
use super::surface::SurfacePoint;
use crate::math::blocks::BlockSample;
use crate::math::color::luminance;
use crate::math::random::Numbers;
use crate::trace::Ray;

/// The technique that finds emission. All of them give the same mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Both techniques, weighted by the power heuristic (Veach & Guibas 1995, exponent 2).
    #[default]
    Mis,
    /// Only the rays that continue paths.
    BsdfOnly,
    /// Only rays towards emitters. Emission that these can never sample is found by the rays that continue paths.
    LightOnly,
}

/// Settings of a path.
#[derive(Debug, Clone, Copy, Default)]
pub struct PathSettings<'e> {
    pub transport: ReflectionModel,
    pub strategy: Strategy,
    /// Most bounces, where bounces are the reflections between a light and the surface in the picture. `None` allows
    /// any number. 0 keeps only the light that arrives directly from emissive surfaces and the sky. 1 adds light that
    /// one other surface has reflected, including light of punctual lights.
    pub max_bounces: Option<u32>,
    /// Largest irradiance of one sample in any channel, W·m⁻². Larger samples are scaled down to it. This hides rare
    /// bright samples but makes the result too dark. `None` keeps all samples, so the result is unbiased.
    pub firefly_clamp: Option<f32>,
    /// What places are expected to receive: paths are then followed for as long as they are worth it.
    pub expected: Option<&'e Expected>,
    /// Indirect light that is known, of Lambertian surfaces: paths end there. The result is right in the mean over patches, no
    /// longer at every point.
    pub cache: Option<&'e IrradianceCache>,
}

/// One sample of the light that arrives at a surface point, without the direct light of punctual lights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gathered {
    /// W·m⁻².
    pub irradiance: Vec3,
    /// Radiance that the surface reflects from this light towards the viewer, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// The glossy part of `radiance`.
    pub glossy: Vec3,
}

/// Number of pairs of dimensions of [`BlockSample`] that belong to a vertex. The constants below assign them.
const PAIRS_PER_VERTEX: u32 = 8;
const PAIR_SCATTER: u32 = 0;
const PAIR_ROULETTE: u32 = 2;
const PAIR_PUNCTUAL: u32 = 3;
const PAIR_EMITTER: u32 = 4;
const PAIR_WHETHER_EMITTER: u32 = 6;

/// Least probability of a ray towards an emitter. A place that was not seen to be lit, or that is lit from so many
/// directions that the path's own ray finds the light, has little use for more. Light that the place has missed then has at
/// most four times its weight.
const LEAST_EMITTER_RAYS: f32 = 0.25;

impl World<'_> {
    /// One sample of the light at `point` as [`Gathered`] defines it. `view` is the unit direction towards the viewer,
    /// and `normal` the shading normal.
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
        let vertex = self.vertex(point, &bsdf, settings);
        let mut gathered = Gathered::default();
        if let Some((direction, cosine, radiance)) = self.emitter_sample(&vertex, &bsdf, settings, 0, numbers, rays) {
            let scattered = bsdf.scattered(direction, cosine);
            gathered.irradiance += radiance * cosine;
            gathered.radiance += radiance * scattered.total();
            gathered.glossy += radiance * scattered.glossy;
        }
        numbers.seek(PAIR_SCATTER);
        if let Some(step) = Step::sample(point, &bsdf, numbers) {
            let radiance = self.incoming(vertex, &step, settings, numbers, rays) * step.density.recip();
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

    /// One sample of the irradiance at a point but for what rays towards emitters find there, W·m⁻²: that by which a path goes on.
    pub fn onward(
        &self,
        point: &SurfacePoint,
        view: Vec3,
        settings: &PathSettings,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Vec3 {
        let bsdf = Bsdf::new(self, point, point.shading_normal, view, settings.transport).covering();
        let vertex = self.vertex(point, &bsdf, settings);
        numbers.seek(PAIR_SCATTER);
        let Some(step) = Step::sample(point, &bsdf, numbers) else { return Vec3::ZERO };
        self.incoming(vertex, &step, settings, numbers, rays) * (step.cosine / step.density)
    }

    /// A surface point of a path.
    #[inline]
    fn vertex(&self, point: &SurfacePoint, bsdf: &Bsdf, settings: &PathSettings) -> Vertex<'_> {
        let receiver = point.receiver(bsdf.normal());
        let all_behind = || self.emitters.all_behind(receiver.position, receiver.geometric_normal);
        let without = settings.strategy == Strategy::BsdfOnly || self.emitters.is_empty() || all_behind();
        if without && settings.expected.is_none() {
            return Vertex { receiver, shares: None, expected: None };
        }
        let key = self.places.key_of(point);
        let expected = settings.expected.and_then(|expected| expected.at(key));
        if without {
            return Vertex { receiver, shares: None, expected };
        }
        let shares = &self.learnt(key).shares;
        let emitter_rays = match settings.strategy {
            Strategy::LightOnly => 1.0,
            // Light is even: the path's own rays have no noise.
            _ if shares.cosine >= 1.0 => 0.0,
            _ if !shares.lit => LEAST_EMITTER_RAYS,
            _ => (2.0 * (1.0 - shares.cosine)).clamp(LEAST_EMITTER_RAYS, 1.0),
        };
        Vertex { receiver, shares: (emitter_rays > 0.0).then_some((shares, emitter_rays)), expected }
    }

    /// One sample of the radiance that arrives at `vertex` along `step`: the reflected light, and the emission with the
    /// weight of this technique.
    fn incoming(
        &self,
        vertex: Vertex,
        step: &Step,
        settings: &PathSettings,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Vec3 {
        let start = vertex.expected;
        let mut sum = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        let (mut vertex, mut step) = (vertex, *step);
        let mut bounce = 0;
        loop {
            rays.primary += 1;
            let hit = self.tracer.closest(Ray::new(vertex.receiver.position, step.direction, numbers.salt()));
            let Some(hit) = hit else {
                let (sky, light_density) = match vertex.shares {
                    Some((shares, rays)) => {
                        let (sky, density) = self.emitters.sky_along(self.scene, shares, step.direction);
                        (sky, rays * density)
                    }
                    None => (self.scene.environment.radiance(step.direction), 0.0),
                };
                if sky != Vec3::ZERO {
                    sum += throughput * sky * settings.strategy.weight_of_hit(step.density, light_density);
                }
                return sum;
            };
            let point = self.surface_at(hit, step.direction);
            if point.emission != Vec3::ZERO {
                let light_density = vertex.shares.map_or(0.0, |(shares, rays)| {
                    rays * self.emitters.density_of_hit(shares, &vertex.receiver, step.direction, &hit)
                });
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
            vertex = self.vertex(&point, &bsdf, settings);
            if let Some((direction, cosine, radiance)) =
                self.emitter_sample(&vertex, &bsdf, settings, bounce, numbers, rays)
            {
                sum += throughput * radiance * bsdf.scattered(direction, cosine).total();
            }
            if let (Some(cache), Bsdf::Lambert { albedo, .. }) = (settings.cache, &bsdf)
                && let Some(irradiance) = cache.at(self, &point, numbers.salt())
            {
                return sum + throughput * reflected_radiance(*albedo, irradiance);
            }
            numbers.seek(bounce * PAIRS_PER_VERTEX + PAIR_SCATTER);
            let Some(next) = Step::sample(&point, &bsdf, numbers) else { return sum };
            throughput *= bsdf.scattered(next.direction, next.cosine).total() * next.density.recip();
            let survival = survival(vertex.expected, start, throughput, bounce);
            if survival < 1.0 {
                numbers.seek(bounce * PAIRS_PER_VERTEX + PAIR_ROULETTE);
                let survives = numbers.uniform() < survival;
                if !survives {
                    return sum;
                }
                throughput *= survival.recip();
            }
            step = next;
        }
    }

    /// Emission found by sampling an emitter from a vertex: its direction, the cosine of the direction to the normal,
    /// and radiance × weight ÷ density.
    #[inline]
    fn emitter_sample(
        &self,
        vertex: &Vertex,
        bsdf: &Bsdf,
        settings: &PathSettings,
        index: u32,
        numbers: &mut BlockSample,
        rays: &mut RayCount,
    ) -> Option<(Vec3, f32, Vec3)> {
        let Vertex { receiver, shares: Some((shares, emitter_rays)), .. } = vertex else { return None };
        if *emitter_rays < 1.0 {
            numbers.seek(index * PAIRS_PER_VERTEX + PAIR_WHETHER_EMITTER);
            if numbers.uniform() >= *emitter_rays {
                return None;
            }
        }
        numbers.seek(index * PAIRS_PER_VERTEX + PAIR_EMITTER);
        let bits = std::array::from_fn(|_| numbers.bits());
        let sample = self.emitters.sample(self.scene, shares, receiver, bits)?;
        let cosine = receiver.cosine(sample.direction);
        // Direct light of punctual lights is not asked for at the first vertex.
        let is_direct = index == 0 && sample.is_punctual();
        if cosine <= 0.0 || sample.radiance == Vec3::ZERO || is_direct {
            return None;
        }
        rays.shadow += 1;
        if !self.reaches(receiver.position, &sample, numbers.salt()) {
            return None;
        }
        let density = sample.density * emitter_rays;
        let weight = match settings.strategy {
            Strategy::Mis if !sample.is_punctual() => power_heuristic(density, bsdf.density(sample.direction, cosine)),
            _ => 1.0,
        };
        Some((sample.direction, cosine, sample.radiance * (weight / density)))
    }

    /// An estimate of the radiance that a vertex reflects from all punctual lights. It tests one light, which is chosen
    /// in proportion to the luminance that it would add without occluders.
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
        // Many are sampled as emitters.
        if lights.is_empty() || self.emitters.has_lamps() {
            return Vec3::ZERO;
        }
        numbers.seek(vertex * PAIRS_PER_VERTEX + PAIR_PUNCTUAL);
        let mut number = numbers.uniform();
        // Reservoir sampling with a single random number. After each decision the number is rescaled and is uniform
        // again.
        let mut total = 0.0;
        let mut chosen: Option<(usize, Incident, Vec3, f32)> = None;
        for (index, light) in lights.iter().enumerate() {
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
                chosen = Some((index, incident, radiance, importance));
            } else {
                number = (number - probability) / (1.0 - probability);
            }
        }
        let Some((index, incident, radiance, importance)) = chosen else { return Vec3::ZERO };
        rays.shadow += 1;
        let reaches = self.light_reaches(index, &incident, point.ray_origin(), numbers.salt());
        if reaches { radiance * (self.punctual_scale * (total / importance)) } else { Vec3::ZERO }
    }
}

/// A surface point of a path, as light sampling sees it.
#[derive(Clone, Copy)]
struct Vertex<'w> {
    receiver: Receiver,
    /// What its place has learnt, and the probability of a ray towards an emitter. `None` where there are no such rays.
    shares: Option<(&'w Shares, f32)>,
    /// What its place is expected to receive, if that is known.
    expected: Option<Light>,
}

/// The next ray of a path.
#[derive(Debug, Clone, Copy)]
struct Step {
    direction: Vec3,
    /// Cosine between direction and shading normal.
    cosine: f32,
    /// Density with which this direction was drawn, sr⁻¹.
    density: f32,
}

impl Step {
    /// Samples the BSDF. `None` if the direction lies below the shading or the geometric horizon, because no light
    /// arrives from there.
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
    /// Weight of emission that a path's ray has hit. `density` is that of the ray; `light_density` is that of drawing
    /// the same direction by sampling emitters.
    #[inline]
    fn weight_of_hit(self, density: f32, light_density: f32) -> f32 {
        match self {
            Strategy::BsdfOnly => 1.0,
            // Sampling emitters never draws this emission, so it counts fully here.
            _ if light_density <= 0.0 => 1.0,
            Strategy::LightOnly => 0.0,
            Strategy::Mis => power_heuristic(density, light_density),
        }
    }
}

/// Weight of a technique of density `this` that is combined with one of density `other`, both in sr⁻¹.
#[inline]
fn power_heuristic(this: f32, other: f32) -> f32 {
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}
