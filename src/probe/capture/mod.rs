//! The G-buffer of a probe: what it sees, with the light that reaches what it sees.
//!
//! Rays go through the texels of a map, at random within each. Of every hit the capture keeps a
//! [`Surfel`] — enough to compute its outgoing radiance again and again as bounces are added — and of every texel the
//! emitted radiance and the distance. Traced once; a bounce costs queries only.

mod backs;
pub mod bytes;
mod captured;
mod cube;
pub mod guide;
mod lit;
mod pattern;
mod rays;
mod settings;
pub mod surfel;
#[cfg(test)]
mod tests;

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

pub use self::backs::{BackRadiance, Backs};
pub use self::captured::{ProbeCapture, Seen};
pub use self::cube::Resampling;
use self::guide::Guide;
use self::pattern::{Pattern, TexelRay};
pub use self::rays::{CubeRays, FibonacciRays, OctahedralRays, Rays};
pub use self::settings::{CaptureSettings, EmissionTransport};
use crate::light::World;
use crate::light::emitters::receiver::Receiver;
use crate::light::expected::Expected;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::math::statistics::Moments;
use crate::probe::lattice::Grid;
use crate::trace::Ray;

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

/// What capturing needs besides the probe.
pub struct Capture<'w, 's> {
    pub world: &'w World<'s>,
    pub settings: &'w CaptureSettings,
    /// Distances beyond count as this, and so do misses, metres; `None` where no one asks for distances.
    pub distance_clamp_m: Option<f32>,
    pub hit_light: HitLight,
    /// What places are expected to receive, which paths from hits go by; `None`: unknown.
    pub expected: Option<&'w Expected>,
    /// The grid that hits look probes up in, and the number of voxels along each axis of its cells, in each of which surfaces
    /// of one facing see the same probes; `None` where no hits are to share a surfel.
    pub voxels: Option<(&'w Grid, u32)>,
    /// Whether geometric normals of hits are kept.
    pub keeps_geometric: bool,
    /// Whether normals and distances of the surfaces are asked for.
    pub sees: bool,
    /// Whether someone looks at the radiance: emission is kept in full, too, where it is weighted.
    pub shows: bool,
    /// Of [`Rays::resampling`].
    pub resampling: Option<&'w Resampling>,
    /// Where guided rays go; `None`: there are none.
    pub guide: Option<&'w Guide>,
    /// What it says of the probe that is captured.
    pub counts: Option<&'w [u16]>,
    /// What its random numbers are for.
    pub purpose: Purpose,
    pub seed: u64,
}

/// A frame's own rays: everything turned, and random numbers of its own.
struct Turn {
    rotation: Option<Quat>,
    stream: u64,
}

impl Capture<'_, '_> {
    fn samples_emitters(&self) -> bool {
        self.settings.emission == EmissionTransport::Sampled && self.world.has_emitters()
    }

    /// Emitter samples at every hit.
    fn surface_samples(&self) -> Option<u32> {
        self.samples_emitters().then_some(self.settings.emitter_samples)
    }

    /// Emitter samples at a probe's centre, as its surroundings have taught it. `None` where there are none.
    fn centre(&self, index: usize, position: Vec3) -> Option<Centre> {
        // The capture's own rays are even denser samples of a sky of one radiance.
        let samples = self.settings.probe_emitter_samples;
        if samples == 0
            || !self.samples_emitters()
            || !self.world.emitters.has_radiance()
            || self.world.emitters.is_uniform_sky()
        {
            return None;
        }
        let receiver = Receiver::in_space(position);
        let mut random = Random::new(self.seed, Purpose::Places, index as u64, 1);
        let emitters = &self.world.emitters;
        let (shares, ..) = self.world.learn(&[receiver], |group| emitters.is_found_by_rays(group), &mut random);
        if shares.cosine >= 1.0 {
            return None;
        }
        let draws = (0..self.world.emitters.groups()).map(|group| {
            let expected = samples as f32 * shares.of(group);
            let count = (expected + random.uniform()) as u32;
            // Where there is at least one draw, the estimate may know how many there were.
            Draws { count, expected: if expected >= 1.0 { count as f32 } else { expected } }
        });
        Some(Centre { receiver, draws: draws.collect() })
    }

    /// Captures the probe at `position`. Depends on nothing but the arguments and `self`.
    pub fn probe(&self, index: usize, position: Vec3, contains: impl Fn(Vec3) -> bool) -> ProbeCapture {
        self.resampled(self.cast(index, position, contains, &Turn { rotation: None, stream: 0 }))
    }

    /// Captures the probe in one of many frames, its rays turned by [`frame_rotation`].
    pub fn frame(&self, index: usize, position: Vec3, contains: impl Fn(Vec3) -> bool, frame: u32) -> ProbeCapture {
        let turn = Turn { rotation: Some(frame_rotation(self.seed, frame)), stream: 1 + u64::from(frame) };
        self.resampled(self.cast(index, position, contains, &turn))
    }

    fn resampled(&self, capture: ProbeCapture) -> ProbeCapture {
        match self.resampling {
            Some(resampling) => capture.resampled(resampling),
            None => capture,
        }
    }

    fn cast(&self, index: usize, position: Vec3, contains: impl Fn(Vec3) -> bool, turn: &Turn) -> ProbeCapture {
        let layout = self.settings.rays.pattern(self.counts);
        let texels = layout.texels();
        let count = match self.counts {
            Some(counts) => counts.iter().map(|&n| usize::from(n)).sum(),
            None => self.settings.rays.unguided().count(),
        };
        let (surface_samples, centre) = (self.surface_samples(), self.centre(index, position));
        let centre = centre.as_ref();
        let world = self.world;
        let mut out = ProbeCapture {
            texels,
            distances: vec![Moments::default(); if self.distance_clamp_m.is_some() { texels } else { 0 }],
            seen: vec![Seen::default(); if self.sees { texels } else { 0 }],
            surfels: Vec::with_capacity(if self.hit_light == HitLight::None { 0 } else { count }),
            ..Default::default()
        };
        let mut random = Random::new(self.seed, self.purpose, index as u64, turn.stream);
        // A row of texels at a time, in short loops whose turns do not wait for one another: hits are scattered over
        // memory, and one long loop would wait for each in its turn.
        let (mut rays, mut hits, mut lit) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..layout.rows() {
            rays.clear();
            layout.rays(row, &mut random, &mut rays);
            if let Some(rotation) = turn.rotation {
                rays.iter_mut().for_each(|ray| ray.direction = (rotation * ray.direction).normalize());
            }
            hits.clear();
            hits.extend(rays.iter().map(|r| world.tracer.closest(Ray::new(position, r.direction, random.bits()))));
            lit.clear();
            for (ray, hit) in rays.iter().zip(&hits) {
                match hit {
                    None => self.meet_sky(ray, centre, &mut out),
                    Some(hit) => {
                        let surface = world.surface_at(*hit, ray.direction);
                        self.meet_surface(ray, &surface, centre, &mut out);
                        out.hits_outside_volume += u64::from(!contains(surface.position));
                        // What reflects nothing no bounce will ever ask for.
                        if surface.albedo != Vec3::ZERO && !self.leaves_out(&surface) {
                            lit.push((*ray, surface));
                        }
                    }
                }
            }
            // Rays through one texel lie beside each other.
            let mut of_texel = 0;
            for (i, (ray, surface)) in lit.iter().enumerate() {
                of_texel = if i > 0 && lit[i - 1].0.texel == ray.texel { of_texel + 1 } else { 0 };
                match self.hit_light {
                    HitLight::None => {}
                    HitLight::Direct => self.light(ray, surface, surface_samples, &mut random, &mut out),
                    HitLight::Paths(paths) => {
                        let (tile, place) = layout.tile(ray.texel);
                        // Paths of a tile's hits share blocks, so that together they cover what single ones leave to chance:
                        // 0.9 × the variance of a probe's light with one path a hit (veach_ajar), as much with four.
                        let sample = |path: u32| {
                            let number = place * paths + path;
                            let name = of_texel << 48 | u64::from(tile) << 24 | u64::from(number / BLOCK);
                            Block::new(self.seed, Purpose::ProbePaths, index as u64, name).sample(number % BLOCK)
                        };
                        self.light_by_paths((ray, surface), paths, sample, &mut random, &mut out);
                    }
                }
            }
        }
        out.rays.primary += count as u64;
        if let Some(centre) = centre {
            self.sample_emitters(index, centre, &layout, &mut out);
        }
        out.surfels.shrink_to_fit();
        out.geometric.shrink_to_fit();
        out
    }

    /// A capture ray that leaves the scene.
    fn meet_sky(&self, ray: &TexelRay, centre: Option<&Centre>, out: &mut ProbeCapture) {
        let scene = self.world.scene;
        let (radiance, expected) = match centre {
            Some(centre) => match self.world.emitters.sky_group_along(scene, ray.direction) {
                Some((radiance, group, density)) => (radiance, centre.draws[group].expected * density),
                None => (Vec3::ZERO, 0.0),
            },
            None => (scene.environment.radiance(ray.direction), 0.0),
        };
        if radiance != Vec3::ZERO {
            self.keep_emitted(ray, radiance, expected, centre, out);
        }
        if let Some(clamp) = self.distance_clamp_m {
            out.distances[ray.texel as usize].add(f64::from(clamp), f64::from(ray.share));
        }
    }

    fn leaves_out(&self, surface: &SurfacePoint) -> bool {
        self.settings.backs.are_left_out() && surface.is_back()
    }

    /// Distance and emission of what a capture ray hits.
    #[inline]
    fn meet_surface(&self, ray: &TexelRay, surface: &SurfacePoint, centre: Option<&Centre>, out: &mut ProbeCapture) {
        if let Some(clamp) = self.distance_clamp_m {
            let factor = if surface.is_back() { self.settings.backs.distance_factor } else { 1.0 };
            let distance = (surface.hit.t * factor).min(clamp);
            out.distances[ray.texel as usize].add(f64::from(distance), f64::from(ray.share));
        }
        if self.sees {
            out.seen[ray.texel as usize].add(surface.shading_normal, surface.hit.t, ray.share);
        }
        if self.leaves_out(surface) {
            out.backs.push(ray.texel);
            return;
        }
        if surface.emission != Vec3::ZERO {
            let emitters = &self.world.emitters;
            let expected = centre.map_or(0.0, |Centre { receiver, draws }| {
                let found = emitters.group_of_hit(receiver, ray.direction, &surface.hit);
                found.map_or(0.0, |(group, density)| draws[group].expected * density)
            });
            self.keep_emitted(ray, surface.emission, expected, centre, out);
        }
    }

    /// Keeps what is emitted along a ray, where this many emitter samples per solid angle are expected in its direction, sr⁻¹.
    fn keep_emitted(
        &self,
        ray: &TexelRay,
        radiance: Vec3,
        expected: f32,
        centre: Option<&Centre>,
        out: &mut ProbeCapture,
    ) {
        out.emitted.push((ray.texel, radiance * (gathered_share(ray, expected) * ray.share)));
        if self.shows && centre.is_some() {
            out.shown.push((ray.texel, radiance * ray.share));
        }
    }

    /// Draws emitters from the probe's centre.
    fn sample_emitters(&self, index: usize, centre: &Centre, layout: &Pattern, out: &mut ProbeCapture) {
        let world = self.world;
        let Centre { receiver, draws } = centre;
        let mut random = Random::new(self.seed, Purpose::ProbeEmission, index as u64, 0);
        for (group, Draws { count, expected }) in draws.iter().enumerate().filter(|(_, draws)| draws.count > 0) {
            for bits in KroneckerSequence::new(&mut random).take(*count as usize) {
                let Some(sample) = world.emitters.sample_group(world.scene, group, receiver, bits) else { continue };
                if sample.radiance == Vec3::ZERO {
                    continue;
                }
                out.rays.shadow += 1;
                if world.reaches(receiver.position, &sample, bits[0]) {
                    let density = layout.density(sample.direction) + expected * sample.density;
                    out.emitter_samples.push((sample.direction, sample.radiance / density));
                }
            }
        }
    }
}

/// The random rotation of a frame's rays, the same for all probes. Uniform (Shoemake 1992).
pub fn frame_rotation(seed: u64, frame: u32) -> Quat {
    let mut random = Random::new(seed, Purpose::FrameRotation, u64::from(frame), 0);
    let (u, a, b) = (random.uniform(), TAU * random.uniform(), TAU * random.uniform());
    let (r, s) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(r * a.sin(), r * a.cos(), s * b.sin(), s * b.cos())
}

/// A probe's centre, from which emitters are sampled.
struct Centre {
    receiver: Receiver,
    /// Per group of emitters.
    draws: Vec<Draws>,
}

/// Draws from one group.
struct Draws {
    count: u32,
    /// Their number as the estimate counts it: its mean is that of `count`.
    expected: f32,
}

/// Share of the radiance along a capture ray that counts, where this many emitter samples per solid angle are expected in
/// its direction, sr⁻¹ (balance heuristic).
fn gathered_share(ray: &TexelRay, expected: f32) -> f32 {
    ray.density / (ray.density + expected)
}
