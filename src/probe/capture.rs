//! The G-buffer of a probe: what it sees, with the light that reaches what it sees.
//!
//! Rays are stratified over the texels of an octahedral map, jittered within each. Of every hit the capture keeps a
//! [`Surfel`] — enough to compute its outgoing radiance again and again as bounces are added — and of every texel the
//! emitted radiance and the distance. Traced once; a bounce costs queries only.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::light::World;
use crate::light::lambert::reflected_radiance;
use crate::light::sampled::{Allocation, RayCount};
use crate::math::octahedral::{direction_and_density, oct_from_direction, solid_angle_density};
use crate::math::random::{Purpose, Random};
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

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    /// Texels per side of the octahedral G-buffer.
    pub resolution: usize,
    /// Stratified rays per texel.
    pub samples_per_texel: usize,
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
            emission: EmissionTransport::Sampled,
            emitter_samples: 4,
            probe_emitter_samples: 64,
        }
    }
}

/// A captured hit.
#[derive(Debug, Clone, Copy)]
pub struct Surfel {
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// Shading normal, unit, towards the probe.
    pub normal: Vec3,
    /// Unit, towards the probe.
    pub geometric_normal: Vec3,
    pub albedo: Vec3,
    /// B⁰: radiance reflected from light that did not pass through probes, W·m⁻²·sr⁻¹.
    pub direct_radiance: Vec3,
    pub texel: u32,
    /// Share of its texel's solid angle.
    pub weight: f32,
}

/// One probe's G-buffer.
#[derive(Debug, Clone, Default)]
pub struct ProbeCapture {
    pub surfels: Vec<Surfel>,
    /// Per texel: radiance emitted by surfaces and the sky, weighted against `emitter_samples`, W·m⁻²·sr⁻¹.
    pub emitted: Vec<Vec3>,
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
        self.samples_emitters().then(|| Allocation::by_coverage(self.settings.emitter_samples, self.emitter_coverage))
    }

    /// Emitter samples at a probe centre: fewer, the more of the sphere emits, for the capture's own rays find it then.
    fn probe_samples(&self) -> u32 {
        if !self.samples_emitters() {
            return 0;
        }
        Allocation::by_coverage(self.settings.probe_emitter_samples, self.emitter_coverage).light
    }

    /// Captures the probe at `position`. Depends on nothing but the arguments and `self`.
    pub fn probe(&self, index: usize, position: Vec3, contains: impl Fn(Vec3) -> bool) -> ProbeCapture {
        let (resolution, samples) = (self.settings.resolution, self.settings.samples_per_texel.max(1));
        let probe_samples = self.probe_samples();
        let mut out = ProbeCapture {
            emitted: vec![Vec3::ZERO; self.texels()],
            distances: vec![Moments::default(); if self.distance_clamp_m.is_some() { self.texels() } else { 0 }],
            surfels: Vec::with_capacity(self.texels() * samples),
            ..Default::default()
        };
        let strata = strata(samples);
        let mut random = Random::new(self.seed, Purpose::Capture, index as u64, 0);
        for texel in 0..self.texels() {
            let corner = Vec2::new((texel % resolution) as f32, (texel / resolution) as f32);
            let mut weight_sum = 0.0;
            let first = out.surfels.len();
            for sample in 0..samples {
                let stratum = Vec2::new((sample % strata.0) as f32, (sample / strata.0) as f32);
                let jitter = Vec2::new(random.uniform(), random.uniform());
                let inside = (stratum + jitter) / Vec2::new(strata.0 as f32, strata.1 as f32);
                let oct = (corner + inside) / resolution as f32 * 2.0 - 1.0;
                let (direction, weight) = direction_and_density(oct);
                weight_sum += weight;
                // Density of capture rays in this direction, sr⁻¹: their number per area of the square ÷ dω/dA.
                let density = samples as f32 * (resolution * resolution) as f32 / (4.0 * weight);
                self.ray(
                    position,
                    direction,
                    density,
                    probe_samples,
                    (texel, weight),
                    &mut random,
                    &contains,
                    &mut out,
                );
            }
            out.emitted[texel] /= weight_sum;
            for surfel in &mut out.surfels[first..] {
                surfel.weight /= weight_sum;
            }
        }
        self.sample_emitters(index, position, probe_samples, samples, &mut out);
        out
    }

    /// One capture ray.
    #[allow(clippy::too_many_arguments)]
    fn ray(
        &self,
        position: Vec3,
        direction: Vec3,
        density: f32,
        probe_samples: u32,
        (texel, weight): (usize, f32),
        random: &mut Random,
        contains: impl Fn(Vec3) -> bool,
        out: &mut ProbeCapture,
    ) {
        let world = self.world;
        out.rays.primary += 1;
        let ray = Ray::new(position, direction, random.bits());
        let n_light = probe_samples as f32;
        // Balance heuristic between this ray and the emitter samples drawn from the probe's centre.
        let gathered_share = |light_density: f32| density / (density + n_light * light_density);
        let Some(surface) = world.surface(ray) else {
            let radiance = world.scene.environment.radiance(direction);
            if radiance != Vec3::ZERO {
                let share = gathered_share(world.emitters.density_of_sky(world.scene, direction));
                out.emitted[texel] += radiance * (share * weight);
            }
            if let Some(clamp) = self.distance_clamp_m {
                out.distances[texel].add(f64::from(clamp), f64::from(weight));
            }
            return;
        };
        if let Some(clamp) = self.distance_clamp_m {
            out.distances[texel].add(f64::from(surface.hit.t.min(clamp)), f64::from(weight));
        }
        if surface.emission != Vec3::ZERO {
            let light_density = world.emitters.density_of_hit(position, direction, &surface.hit);
            out.emitted[texel] += surface.emission * (gathered_share(light_density) * weight);
        }
        let normal = surface.shading_normal;
        out.hits_outside_volume += u64::from(!contains(surface.position));
        if surface.albedo == Vec3::ZERO {
            // Reflects nothing: no bounce will ever ask for it.
            return;
        }
        let (punctual, shadow_rays) = world.punctual_irradiance(&surface, normal, random.bits());
        out.rays.shadow += u64::from(shadow_rays);
        let sampled = match self.surface_allocation() {
            Some(allocation) => world.emitter_irradiance(&surface, normal, allocation, random, &mut out.rays),
            None => Vec3::ZERO,
        };
        let mut direct = reflected_radiance(surface.albedo, punctual + sampled);
        if !direct.is_finite() {
            out.non_finite += 1;
            direct = Vec3::ZERO;
        }
        out.surfels.push(Surfel {
            position: surface.position,
            normal,
            geometric_normal: surface.geometric_normal,
            albedo: surface.albedo,
            direct_radiance: direct,
            texel: texel as u32,
            weight,
        });
    }

    /// Draws emitters from the probe's centre.
    fn sample_emitters(&self, index: usize, position: Vec3, count: u32, per_texel: usize, out: &mut ProbeCapture) {
        let world = self.world;
        let mut random = Random::new(self.seed, Purpose::ProbeEmission, index as u64, 0);
        for _ in 0..count {
            let Some(sample) = world.emitters.sample(world.scene, position, &mut random) else { continue };
            if sample.radiance == Vec3::ZERO {
                continue;
            }
            out.rays.shadow += 1;
            if world.reaches(position, &sample, random.bits()) {
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
            + self.emitted.capacity() * size_of::<Vec3>()
            + self.emitter_samples.capacity() * size_of::<(Vec3, Vec3)>()
            + self.distances.capacity() * size_of::<Moments>()
            + size_of::<ProbeCapture>()) as u64
    }

    /// Irradiance around `normal` from the emitters sampled at the probe's centre, W·m⁻².
    pub fn sampled_emitter_irradiance(&self, normal: Vec3) -> Vec3 {
        self.emitter_samples.iter().map(|(direction, light)| *light * normal.dot(*direction).max(0.0)).sum()
    }
}

/// Columns and rows of strata for this many samples: as square as its divisors allow.
fn strata(samples: usize) -> (usize, usize) {
    let columns = (1..=samples).take_while(|c| c * c <= samples).filter(|c| samples.is_multiple_of(*c)).last();
    let columns = columns.unwrap_or(1);
    (columns, samples / columns)
}
