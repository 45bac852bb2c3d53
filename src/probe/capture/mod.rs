//! The G-buffer of a probe: what it sees, with the light that reaches what it sees.
//!
//! Rays are stratified over the texels of an octahedral map, jittered within each. Of every hit the capture keeps a
//! [`Surfel`] — enough to compute its outgoing radiance again and again as bounces are added — and of every texel the
//! emitted radiance and the distance. Traced once; a bounce costs queries only.

mod rays;
pub mod surfel;

use glam::{DVec3, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use self::rays::{Layout, TexelRay};
pub use self::rays::{OctahedralRays, Rays};
use self::surfel::Surfel;
use crate::light::World;
use crate::light::lambert::reflected_radiance;
use crate::light::path::PathSettings;
use crate::light::sampled::{Allocation, RayCount};
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::math::statistics::Moments;
use crate::trace::Ray;

/// How the light of emissive surfaces and the sky reaches the surfaces that probes see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EmissionTransport {
    /// Emitters are sampled with shadow rays at every hit and from every probe centre.
    Sampled,
    /// Emission is what capture rays happen to hit, and reaches surfaces through the probes.
    Gathered,
}

/// How much of the light on a captured hit is found when it is captured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HitLight {
    /// None: hits are not even kept.
    None,
    /// That which did not come from another surface.
    Direct,
    /// All, by this many paths from every hit.
    Paths(u32),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    pub rays: Rays,
    pub emission: EmissionTransport,
    /// Emitter samples at every hit (with `emission: sampled`).
    pub emitter_samples: u32,
    /// Emitter samples from every probe centre (with `emission: sampled`).
    pub probe_emitter_samples: u32,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        CaptureSettings {
            rays: Rays::default(),
            emission: EmissionTransport::Sampled,
            emitter_samples: 4,
            probe_emitter_samples: 64,
        }
    }
}

impl CaptureSettings {
    /// Whether surfaces find emission through the probes, and not by samples of their own.
    pub fn gathers_emission(&self) -> bool {
        self.emission == EmissionTransport::Gathered
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        self.rays.check(most_texels, rule);
        let emitter = self.emitter_samples;
        rule("capture.emitter_samples", emitter.to_string(), (1..=65_536).contains(&emitter), "use 1 to 65536");
        let probe = self.probe_emitter_samples;
        rule("capture.probe_emitter_samples", probe.to_string(), probe <= 1 << 20, "use 0 to 1048576");
    }
}

/// One probe's G-buffer.
#[derive(Debug, Clone, Default)]
pub struct ProbeCapture {
    /// Number of texels.
    pub texels: usize,
    pub surfels: Vec<Surfel>,
    /// Texels in which surfaces or the sky emit, with the radiance, weighted against `emitter_samples`, W·m⁻²·sr⁻¹; a
    /// texel may come more than once.
    pub emitted: Vec<(u32, Vec3)>,
    /// Directions towards sampled emitters, each with radiance ÷ density, W·m⁻².
    pub emitter_samples: Vec<(Vec3, Vec3)>,
    /// Per texel: distances, clamped, metres; empty where no one asks for them.
    pub distances: Vec<Moments>,
    pub rays: RayCount,
    /// Hits outside the hull of the probes.
    pub hits_outside_volume: u64,
    /// Non-finite values found and replaced by zero.
    pub non_finite: u64,
}

/// What capturing needs besides the probe.
pub struct Capture<'w, 's> {
    pub world: &'w World<'s>,
    pub settings: &'w CaptureSettings,
    /// Distances beyond count as this, and so do misses, metres; `None` where no one asks for distances.
    pub distance_clamp_m: Option<f32>,
    pub hit_light: HitLight,
    /// Share of directions in which emitters are seen.
    pub emitter_coverage: f32,
    pub seed: u64,
}

impl Capture<'_, '_> {
    fn samples_emitters(&self) -> bool {
        self.settings.emission == EmissionTransport::Sampled && self.world.has_emitters()
    }

    /// Emitter samples at every hit.
    fn surface_allocation(&self) -> Option<Allocation> {
        // A sky of one radiance is sampled best by the cosine alone.
        let coverage = if self.world.emitters.is_uniform_sky() { 1.0 } else { self.emitter_coverage };
        self.samples_emitters().then(|| Allocation::by_coverage(self.settings.emitter_samples, coverage))
    }

    /// Emitter samples at a probe centre: fewer, the more of the sphere emits, for the capture's own rays find it then.
    fn probe_samples(&self) -> u32 {
        // The capture's own rays are even denser samples of a sky of one radiance.
        if !self.samples_emitters() || self.world.emitters.is_uniform_sky() {
            return 0;
        }
        Allocation::by_coverage(self.settings.probe_emitter_samples, self.emitter_coverage).light
    }

    /// Captures the probe at `position`. Depends on nothing but the arguments and `self`.
    pub fn probe(&self, index: usize, position: Vec3, contains: impl Fn(Vec3) -> bool) -> ProbeCapture {
        let (texels, count) = (self.settings.rays.texels(), self.settings.rays.count());
        let (allocation, light_samples) = (self.surface_allocation(), self.probe_samples());
        let world = self.world;
        let mut out = ProbeCapture {
            texels,
            distances: vec![Moments::default(); if self.distance_clamp_m.is_some() { texels } else { 0 }],
            surfels: Vec::with_capacity(if self.hit_light == HitLight::None { 0 } else { count }),
            ..Default::default()
        };
        let layout = self.settings.rays.layout();
        let mut random = Random::new(self.seed, Purpose::Capture, index as u64, 0);
        // A row of texels at a time, in short loops whose turns do not wait for one another: hits are scattered over
        // memory, and one long loop would wait for each in its turn.
        let (mut rays, mut hits, mut lit) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..layout.rows() {
            rays.clear();
            layout.rays(row, &mut random, &mut rays);
            hits.clear();
            hits.extend(rays.iter().map(|r| world.tracer.closest(Ray::new(position, r.direction, random.bits()))));
            lit.clear();
            for (ray, hit) in rays.iter().zip(&hits) {
                match hit {
                    None => self.meet_sky(ray, light_samples, &mut out),
                    Some(hit) => {
                        let surface = world.surface_at(*hit, ray.direction);
                        self.meet_surface(position, ray, &surface, light_samples, &mut out);
                        out.hits_outside_volume += u64::from(!contains(surface.position));
                        // What reflects nothing no bounce will ever ask for.
                        if surface.albedo != Vec3::ZERO {
                            lit.push((*ray, surface));
                        }
                    }
                }
            }
            for (ray, surface) in &lit {
                match self.hit_light {
                    HitLight::None => {}
                    HitLight::Direct => self.light(ray, surface, allocation, &mut random, &mut out),
                    HitLight::Paths(paths) => self.light_by_paths(index, ray, surface, paths, &mut out),
                }
            }
        }
        out.rays.primary += count as u64;
        self.sample_emitters(index, position, light_samples, &layout, &mut out);
        out.surfels.shrink_to_fit();
        out
    }

    /// Share of the radiance along a capture ray that counts, beside `light_samples` emitter samples drawn from the
    /// probe's centre with `light_density` (balance heuristic).
    fn gathered_share(&self, ray: &TexelRay, light_samples: u32, light_density: f32) -> f32 {
        ray.density / (ray.density + light_samples as f32 * light_density)
    }

    /// A capture ray that leaves the scene.
    fn meet_sky(&self, ray: &TexelRay, light_samples: u32, out: &mut ProbeCapture) {
        let (scene, emitters) = (self.world.scene, &self.world.emitters);
        let radiance = scene.environment.radiance(ray.direction);
        if radiance != Vec3::ZERO {
            let gathered =
                self.gathered_share(ray, light_samples, emitters.density_of_sky(scene, ray.direction)) * ray.share;
            out.emitted.push((ray.texel, radiance * gathered));
        }
        if let Some(clamp) = self.distance_clamp_m {
            out.distances[ray.texel as usize].add(f64::from(clamp), f64::from(ray.share));
        }
    }

    /// Distance and emission of what a capture ray hits.
    #[inline]
    fn meet_surface(
        &self,
        position: Vec3,
        ray: &TexelRay,
        surface: &SurfacePoint,
        light_samples: u32,
        out: &mut ProbeCapture,
    ) {
        if let Some(clamp) = self.distance_clamp_m {
            out.distances[ray.texel as usize].add(f64::from(surface.hit.t.min(clamp)), f64::from(ray.share));
        }
        if surface.emission != Vec3::ZERO {
            let light_density = self.world.emitters.density_of_hit(position, ray.direction, &surface.hit);
            let gathered = self.gathered_share(ray, light_samples, light_density) * ray.share;
            out.emitted.push((ray.texel, surface.emission * gathered));
        }
    }

    /// Lights a hit and keeps it.
    #[inline]
    fn light(
        &self,
        ray: &TexelRay,
        surface: &SurfacePoint,
        allocation: Option<Allocation>,
        random: &mut Random,
        out: &mut ProbeCapture,
    ) {
        let world = self.world;
        let normal = surface.shading_normal;
        let (punctual, shadow_rays) = world.punctual_irradiance(surface, normal, random.bits());
        out.rays.shadow += u64::from(shadow_rays);
        let sampled = match allocation {
            Some(allocation) => world.emitter_irradiance(surface, normal, allocation, random, &mut out.rays),
            None => Vec3::ZERO,
        };
        let mut direct = reflected_radiance(surface.albedo, punctual + sampled);
        if !direct.is_finite() {
            out.non_finite += 1;
            direct = Vec3::ZERO;
        }
        out.surfels.push(Surfel::new(surface, direct, ray.texel, ray.share));
    }

    /// Lights a hit with all light there is and keeps it, as a surface that reflects none of the probes' light.
    fn light_by_paths(&self, probe: usize, ray: &TexelRay, surface: &SurfacePoint, paths: u32, out: &mut ProbeCapture) {
        let world = self.world;
        let normal = surface.shading_normal;
        let settings = PathSettings::default();
        let hit = out.surfels.len() as u64;
        let block = |i: u32| Block::new(self.seed, Purpose::ProbePaths, probe as u64, hit << 32 | u64::from(i / BLOCK));
        let mut sum = DVec3::ZERO;
        for i in 0..paths {
            let mut numbers = block(i).sample(i % BLOCK);
            let gathered = world.gather(surface, normal, -ray.direction, &settings, &mut numbers, &mut out.rays);
            if gathered.irradiance.is_finite() {
                sum += gathered.irradiance.as_dvec3();
            } else {
                out.non_finite += 1;
            }
        }
        let (punctual, shadow_rays) = world.punctual_irradiance(surface, normal, block(0).sample(0).salt());
        out.rays.shadow += u64::from(shadow_rays);
        let irradiance = punctual + (sum / f64::from(paths.max(1))).as_vec3();
        let radiance = reflected_radiance(surface.albedo, irradiance);
        out.surfels.push(Surfel::new(&SurfacePoint { albedo: Vec3::ZERO, ..*surface }, radiance, ray.texel, ray.share));
    }

    /// Draws emitters from the probe's centre.
    fn sample_emitters(&self, index: usize, position: Vec3, count: u32, layout: &Layout, out: &mut ProbeCapture) {
        let world = self.world;
        let mut random = Random::new(self.seed, Purpose::ProbeEmission, index as u64, 0);
        for bits in KroneckerSequence::new(&mut random).take(count as usize) {
            let Some(sample) = world.emitters.sample(world.scene, position, bits) else { continue };
            if sample.radiance == Vec3::ZERO {
                continue;
            }
            out.rays.shadow += 1;
            if world.reaches(position, &sample, bits[0]) {
                let density = layout.density(sample.direction) + count as f32 * sample.density;
                out.emitter_samples.push((sample.direction, sample.radiance / density));
            }
        }
    }
}

impl ProbeCapture {
    /// Memory that it takes.
    pub fn bytes(&self) -> u64 {
        (self.surfels.capacity() * size_of::<Surfel>()
            + self.emitted.capacity() * size_of::<(u32, Vec3)>()
            + self.emitter_samples.capacity() * size_of::<(Vec3, Vec3)>()
            + self.distances.capacity() * size_of::<Moments>()
            + size_of::<ProbeCapture>()) as u64
    }

    /// Emitted radiance in every texel.
    pub fn emitted_radiance(&self) -> Vec<Vec3A> {
        let mut radiance = vec![Vec3A::ZERO; self.texels];
        self.emitted.iter().for_each(|&(texel, emitted)| radiance[texel as usize] += Vec3A::from(emitted));
        radiance
    }

    /// Irradiance around `normal` from the emitters sampled at the probe's centre, W·m⁻².
    pub fn sampled_emitter_irradiance(&self, normal: Vec3) -> Vec3 {
        self.emitter_samples.iter().map(|(direction, light)| *light * normal.dot(*direction).max(0.0)).sum()
    }
}
