//! The G-buffer of a probe: what it sees, with the light that reaches what it sees.
//!
//! Rays are stratified over the texels of an octahedral map, jittered within each. Of every hit the capture keeps a
//! [`Surfel`] — enough to compute its outgoing radiance again and again as bounces are added — and of every texel the
//! emitted radiance and the distance. Traced once; a bounce costs queries only.

pub mod surfel;

use glam::{DVec3, UVec2, Vec2, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use crate::light::World;
use crate::light::lambert::reflected_radiance;
use crate::light::path::PathSettings;
use crate::light::sampled::{Allocation, RayCount};
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::octahedral::{direction_and_density, oct_from_direction, solid_angle_density};
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::math::statistics::Moments;
use crate::probe::capture::surfel::Surfel;
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

/// How light that surfaces have reflected reaches the surfaces that probes see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReflectedLight {
    /// The probes' own irradiance is asked at every hit, bounce after bounce.
    ThroughProbes,
    /// Paths are traced from every hit until they end: the truth at the probes, up to resolution and noise.
    PathTraced {
        /// At every hit.
        paths: u32,
    },
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    /// Texels per side of the octahedral G-buffer.
    pub resolution: usize,
    /// Stratified rays per texel.
    pub samples_per_texel: usize,
    pub reflected: ReflectedLight,
    pub emission: EmissionTransport,
    /// Emitter samples at every hit (with `emission: sampled`).
    pub emitter_samples: u32,
    /// Emitter samples from every probe centre (with `emission: sampled`).
    pub probe_emitter_samples: u32,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        CaptureSettings {
            resolution: 32,
            samples_per_texel: 1,
            reflected: ReflectedLight::ThroughProbes,
            emission: EmissionTransport::Sampled,
            emitter_samples: 4,
            probe_emitter_samples: 64,
        }
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
    /// Share of directions in which emitters are seen.
    pub emitter_coverage: f32,
    pub seed: u64,
}

impl Capture<'_, '_> {
    pub fn texels(&self) -> usize {
        self.settings.resolution * self.settings.resolution
    }

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
        let samples = self.settings.samples_per_texel.max(1);
        let (allocation, light_samples) = (self.surface_allocation(), self.probe_samples());
        let world = self.world;
        let mut out = ProbeCapture {
            texels: self.texels(),
            distances: vec![Moments::default(); if self.distance_clamp_m.is_some() { self.texels() } else { 0 }],
            surfels: Vec::with_capacity(self.texels() * samples),
            ..Default::default()
        };
        let strata = Strata::new(samples, self.settings.resolution as u32);
        let mut random = Random::new(self.seed, Purpose::Capture, index as u64, 0);
        // A row of texels at a time, in short loops whose turns do not wait for one another: hits are scattered over
        // memory, and one long loop would wait for each in its turn.
        let (mut rays, mut hits, mut lit) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..self.settings.resolution as u32 {
            rays.clear();
            strata.rays(row, &mut random, &mut rays);
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
                match self.settings.reflected {
                    ReflectedLight::ThroughProbes => self.light(ray, surface, allocation, &mut random, &mut out),
                    ReflectedLight::PathTraced { paths } => self.light_by_paths(index, ray, surface, paths, &mut out),
                }
            }
        }
        out.rays.primary += (self.texels() * samples) as u64;
        self.sample_emitters(index, position, light_samples, samples, &mut out);
        out.surfels.shrink_to_fit();
        out
    }

    /// Share of the radiance along a capture ray that counts, beside `light_samples` emitter samples drawn from the
    /// probe's centre with `light_density` (balance heuristic).
    fn gathered_share(&self, ray: &TexelRay, light_samples: u32, light_density: f32) -> f32 {
        // Density of capture rays in this direction, sr⁻¹: their number per area of the square ÷ dω/dA.
        let per_area = (self.settings.samples_per_texel.max(1) * self.texels()) as f32 / 4.0;
        let density = per_area / ray.solid_angle;
        density / (density + light_samples as f32 * light_density)
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
    fn sample_emitters(&self, index: usize, position: Vec3, count: u32, per_texel: usize, out: &mut ProbeCapture) {
        let world = self.world;
        let mut random = Random::new(self.seed, Purpose::ProbeEmission, index as u64, 0);
        for bits in KroneckerSequence::new(&mut random).take(count as usize) {
            let Some(sample) = world.emitters.sample(world.scene, position, bits) else { continue };
            if sample.radiance == Vec3::ZERO {
                continue;
            }
            out.rays.shadow += 1;
            if world.reaches(position, &sample, bits[0]) {
                let oct = oct_from_direction(sample.direction);
                let capture_density = per_texel as f32 * self.texels() as f32 / (4.0 * solid_angle_density(oct));
                let density = capture_density + count as f32 * sample.density;
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

/// One of the rays through a texel.
#[derive(Clone, Copy)]
struct TexelRay {
    texel: u32,
    /// Unit.
    direction: Vec3,
    /// Solid angle per area of the octahedral square there, sr.
    solid_angle: f32,
    /// Of its texel's solid angle, against the texel's other rays.
    share: f32,
}

/// How rays are laid out in the octahedral square.
struct Strata {
    resolution: u32,
    /// Of every stratum of a texel, relative to the texel's, in the octahedral square.
    corners: Vec<Vec2>,
    /// Of one stratum in the octahedral square.
    size: Vec2,
}

impl Strata {
    /// As square as the divisors of `samples` allow.
    fn new(samples: usize, resolution: u32) -> Strata {
        let columns = (1..=samples).take_while(|c| c * c <= samples).filter(|c| samples.is_multiple_of(*c)).last();
        let columns = columns.unwrap_or(1);
        let size = 2.0 / (resolution as f32 * Vec2::new(columns as f32, (samples / columns) as f32));
        let corner = |sample: usize| Vec2::new((sample % columns) as f32, (sample / columns) as f32) * size;
        Strata { resolution, corners: (0..samples).map(corner).collect(), size }
    }

    /// Rays through a row of texels, one at random in every stratum, appended to `rays`.
    fn rays(&self, row: u32, random: &mut Random, rays: &mut Vec<TexelRay>) {
        let texel_size = 2.0 / self.resolution as f32;
        for column in 0..self.resolution {
            let corner_of_texel = UVec2::new(column, row).as_vec2() * texel_size - 1.0;
            let first = rays.len();
            for stratum in &self.corners {
                let jitter = Vec2::new(random.uniform(), random.uniform());
                let (direction, solid_angle) = direction_and_density(corner_of_texel + stratum + jitter * self.size);
                rays.push(TexelRay { texel: row * self.resolution + column, direction, solid_angle, share: 1.0 });
            }
            if let [_, _, ..] = rays[first..] {
                let inverse_sum = 1.0 / rays[first..].iter().map(|r| r.solid_angle).sum::<f32>();
                rays[first..].iter_mut().for_each(|r| r.share = r.solid_angle * inverse_sum);
            }
        }
    }
}
