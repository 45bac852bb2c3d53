//! What a capture leaves of a probe's surroundings, and its resampling.

use glam::{Vec3, Vec3A};

use super::cube::Resampling;
use super::surfel::{PackedNormal, Surfel};
use crate::light::incident::{at_bound, bounded};
use crate::light::sampled::RayCount;
use crate::math::statistics::Moments;

/// The surfaces in a texel: sums over the rays that met one, each times its share.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seen {
    normal: Vec3,
    distance_m: f32,
    weight: f32,
}

impl Seen {
    pub fn add(&mut self, normal: Vec3, distance_m: f32, weight: f32) {
        self.normal += normal * weight;
        self.distance_m += distance_m * weight;
        self.weight += weight;
    }

    fn add_scaled(&mut self, other: &Seen, weight: f32) {
        self.normal += other.normal * weight;
        self.distance_m += other.distance_m * weight;
        self.weight += other.weight * weight;
    }

    /// All that it is. Inverse: [`Self::of_numbers`].
    pub(super) fn numbers(&self) -> [f32; 5] {
        let [x, y, z] = self.normal.to_array();
        [x, y, z, self.distance_m, self.weight]
    }

    pub(super) fn of_numbers([x, y, z, distance_m, weight]: [f32; 5]) -> Seen {
        Seen { normal: Vec3::new(x, y, z), distance_m, weight }
    }

    /// Mean normal, unit, towards the probe, and mean distance, metres; `None` where there is no surface.
    pub fn surface(&self) -> Option<(Vec3, f32)> {
        (self.weight > 0.0).then(|| (self.normal.normalize_or(Vec3::Z), self.distance_m / self.weight))
    }
}

/// One probe's G-buffer.
#[derive(Debug, Clone, Default)]
pub struct ProbeCapture {
    /// Number of texels.
    pub texels: usize,
    pub surfels: Vec<Surfel>,
    /// Geometric normals of the surfels, towards the probe; empty where no one asks for them.
    pub geometric: Vec<PackedNormal>,
    /// Texels in which surfaces or the sky emit, with the radiance, weighted against `emitter_samples`, W·m⁻²·sr⁻¹; a
    /// texel may come more than once.
    pub emitted: Vec<(u32, Vec3)>,
    /// The same in full, for those who look at what the probe sees; empty where no one does, and where nothing is weighted.
    pub shown: Vec<(u32, Vec3)>,
    /// Directions towards sampled emitters, each with radiance ÷ density, W·m⁻².
    pub emitter_samples: Vec<(Vec3, Vec3)>,
    /// Per texel: distances, clamped, metres; empty where no one asks for them.
    pub distances: Vec<Moments>,
    /// Per texel: what surfaces are there; empty where no one asks for it.
    pub seen: Vec<Seen>,
    /// Texels whose rays met the back of a surface and are left out for it, ascending.
    pub backs: Vec<u32>,
    pub rays: RayCount,
    /// Hits outside the hull of the probes.
    pub hits_outside_volume: u64,
    /// Non-finite values found and replaced by zero.
    pub non_finite: u64,
    /// Hits whose irradiance reaches what light is [`bounded`] to, and is clamped to it.
    pub light_clamped: u64,
}

impl ProbeCapture {
    /// Irradiance as [`bounded`]; counted where it reaches the bound.
    pub(super) fn bounded(&mut self, irradiance: Vec3) -> Vec3 {
        let is_clamped = at_bound(irradiance);
        self.light_clamped += u64::from(is_clamped);
        if is_clamped { bounded(irradiance) } else { irradiance }
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> u64 {
        (self.surfels.capacity() * size_of::<Surfel>()
            + self.geometric.capacity() * size_of::<PackedNormal>()
            + (self.emitted.capacity() + self.shown.capacity()) * size_of::<(u32, Vec3)>()
            + self.emitter_samples.capacity() * size_of::<(Vec3, Vec3)>()
            + self.distances.capacity() * size_of::<Moments>()
            + self.seen.capacity() * size_of::<Seen>()
            + self.backs.capacity() * size_of::<u32>()
            + size_of::<ProbeCapture>()) as u64
    }

    /// Emitted radiance in every texel, weighted against the emitters that are sampled: part of what adds up to irradiance.
    pub fn emitted_radiance(&self) -> Vec<Vec3A> {
        self.in_texels(&self.emitted)
    }

    /// The same in full: what is there to be seen.
    pub fn shown_radiance(&self) -> Vec<Vec3A> {
        self.in_texels(if self.shown.is_empty() { &self.emitted } else { &self.shown })
    }

    fn in_texels(&self, light: &[(u32, Vec3)]) -> Vec<Vec3A> {
        let mut radiance = vec![Vec3A::ZERO; self.texels];
        light.iter().for_each(|&(texel, light)| radiance[texel as usize] += Vec3A::from(light));
        radiance
    }

    /// Irradiance around `normal` from the emitters sampled at the probe's centre, W·m⁻².
    pub fn sampled_emitter_irradiance(&self, normal: Vec3) -> Vec3 {
        self.emitter_samples.iter().map(|(direction, light)| *light * normal.dot(*direction).max(0.0)).sum()
    }

    /// Normal and distance of the surface in a texel, where that was asked for and there is one.
    pub fn surface_in(&self, texel: usize) -> Option<(Vec3, f32)> {
        self.seen.get(texel).and_then(Seen::surface)
    }

    /// The same in the texels of the map that `resampling` leads to. Radiance, albedo, normals and distances are weighted
    /// means; a surfel stands where the nearest surface of the old texels does.
    pub(super) fn resampled(self, resampling: &Resampling) -> ProbeCapture {
        let kernel = &resampling.kernel;
        let mut surfel_of = vec![u32::MAX; self.texels];
        self.surfels.iter().enumerate().for_each(|(i, s)| surfel_of[s.texel as usize] = i as u32);
        let light_of = [&self.emitted, &self.shown].map(|light| self.in_texels(light));
        let asked = |list: usize| if list > 0 { kernel.rows() } else { 0 };
        let mut out = ProbeCapture {
            texels: kernel.rows(),
            surfels: Vec::with_capacity(kernel.rows()),
            geometric: Vec::with_capacity(asked(self.geometric.len())),
            distances: vec![Moments::default(); asked(self.distances.len())],
            seen: vec![Seen::default(); asked(self.seen.len())],
            emitter_samples: self.emitter_samples,
            emitted: Vec::new(),
            shown: Vec::new(),
            backs: Vec::new(),
            rays: self.rays,
            hits_outside_volume: self.hits_outside_volume,
            non_finite: self.non_finite,
            light_clamped: self.light_clamped,
        };
        for o in 0..kernel.rows() {
            let (mut direct, mut albedo) = (Vec3::ZERO, Vec3::ZERO);
            let mut nearest = (0.0, u32::MAX);
            for &(t, w) in kernel.row(o) {
                let t = t as usize;
                if let Some(surfel) = self.surfels.get(surfel_of[t] as usize) {
                    direct += surfel.direct_radiance * w;
                    albedo += surfel.albedo() * w;
                    if w > nearest.0 {
                        nearest = (w, surfel_of[t]);
                    }
                }
                if let (Some(to), Some(from)) = (out.distances.get_mut(o), self.distances.get(t)) {
                    to.add_set(from.mean(), from.variance(), f64::from(w));
                }
                if let (Some(to), Some(from)) = (out.seen.get_mut(o), self.seen.get(t)) {
                    to.add_scaled(from, w);
                }
            }
            for (light, of) in [&mut out.emitted, &mut out.shown].into_iter().zip(&light_of) {
                let mean = kernel.row(o).iter().map(|&(t, w)| of[t as usize] * w).sum::<Vec3A>();
                if mean != Vec3A::ZERO {
                    light.push((o as u32, mean.into()));
                }
            }
            if let Some(surfel) = self.surfels.get(nearest.1 as usize) {
                out.surfels.push(surfel.in_texel(o as u32, albedo, direct));
                out.geometric.extend(self.geometric.get(nearest.1 as usize));
            }
        }
        out
    }
}
