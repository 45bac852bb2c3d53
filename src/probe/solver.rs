//! Bounces: light goes from probes to the surfaces they captured and back, until nothing changes.
//!
//! With B the outgoing radiance at every captured hit, `Bᵏ = B⁰ + ρ/π·Q[G[Bᵏ⁻¹]]`, G the irradiance filter and Q the
//! query with the method's own weights: Jacobi's iteration for (I − T)B = B⁰, whose error shrinks by about the mean
//! albedo per sweep.

use std::time::Instant;

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::capture::ProbeCapture;
use super::filter::Kernel;
use super::map::fill_with_border;
use super::placement::ProbeState;
use super::query::{Query, QueryPoint, QuerySettings, Visibility};
use super::surfel::Surfel;
use super::volume::Volume;
use crate::light::lambert::reflected_radiance;
use crate::math::color::luminance;
use crate::math::octahedral::{direction_from_oct, texel_direction};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverSettings {
    /// Most bounces between probes; 0 leaves only light that reaches the captured surfaces directly.
    pub max_bounces: u32,
    /// Stop when the bounces still missing are estimated below this share of the largest irradiance.
    pub tolerance: f32,
    /// Albedos are clamped to this.
    pub albedo_max: f32,
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings { max_bounces: 64, tolerance: 1e-4, albedo_max: 0.999 }
    }
}

/// One sweep.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounce {
    pub index: u32,
    /// Largest change of any irradiance texel ÷ largest irradiance texel.
    pub residual: f64,
    /// Mean luminance of the irradiance that would be stored after this sweep: over all interior texels of active probes,
    /// with the emission that probes see themselves, before encoding, W·m⁻². Known when all sweeps are done: until then
    /// without emission that is sampled.
    pub energy: f64,
}

/// How far the iteration has come; at its end, the result's figures.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    pub bounces: Vec<Bounce>,
    pub converged: bool,
    /// Ratio of the last two changes; `None` before there are two.
    pub spectral_radius_estimate: Option<f64>,
    /// Largest change of any irradiance texel in the last sweep, W·m⁻²; `None` before there was a second sweep.
    pub last_change: Option<f64>,
    pub non_finite: u64,
}

impl Solution {
    /// Takes the largest change of a sweep into account.
    fn judge(&mut self, change: f64, residual: f64, settings: &SolverSettings) {
        if let Some(previous) = self.last_change.filter(|&p| p > 0.0) {
            self.spectral_radius_estimate = Some(change / previous);
        }
        // What is still to come is a geometric series in the ratio of the changes.
        let ratio = self.spectral_radius_estimate.unwrap_or(f64::from(settings.albedo_max));
        let missing = if ratio < 1.0 { residual * ratio / (1.0 - ratio) } else { f64::INFINITY };
        self.last_change = Some(change);
        self.converged = change == 0.0 || missing <= f64::from(settings.tolerance);
    }
}

/// Where the captures of all probes come from: memory, or traced again.
pub trait Captures: Sync {
    /// Calls `visit` on one probe's capture.
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R;
}

impl Captures for Vec<ProbeCapture> {
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        visit(&self[probe])
    }
}

/// The parts that stay the same from sweep to sweep.
pub struct Solver<'a, C> {
    pub captures: &'a C,
    pub kernel: &'a Kernel,
    pub query: &'a QuerySettings,
    pub settings: &'a SolverSettings,
    /// Whether emission takes part in the bounces (with emission sampled at the surfaces it must not: each path counts once).
    pub gathers_emission: bool,
}

/// What a sweep finds at one probe; empty where it is not active.
#[derive(Debug, Default)]
struct Swept {
    /// Interior texels, W·m⁻².
    irradiance: Vec<Vec3A>,
    non_finite: u64,
}

impl<C: Captures> Solver<'_, C> {
    /// Fills the volume's irradiance. Its positions, states and visibility must stand already; after an interruption its
    /// irradiance too, as it was when `progress` was reported.
    pub fn solve(
        &self,
        volume: &mut Volume,
        mut progress: Solution,
        mut on_bounce: impl FnMut(&Solution, &Volume),
    ) -> Solution {
        let settings = self.settings;
        let mut masks = None;
        for index in progress.bounces.len() as u32..=settings.max_bounces {
            if progress.converged {
                break;
            }
            // Before the first sweep there is nothing in the probes to ask for.
            let masks = (index > 0).then(|| &*masks.get_or_insert_with(|| self.masks(volume)));
            let swept = self.sweep(volume, masks.map(Vec::as_slice));
            progress.non_finite += swept.iter().map(|s| s.non_finite).sum::<u64>();
            let (bounce, change) = measure(volume, &swept, index);
            store(volume, &swept);
            progress.bounces.push(bounce);
            if index > 0 {
                progress.judge(change, bounce.residual, settings);
            }
            on_bounce(&progress, volume);
        }
        if !self.gathers_emission {
            let emitted = self.add_emission(volume);
            progress.bounces.iter_mut().for_each(|bounce| bounce.energy += emitted);
        }
        progress
    }

    /// Of every probe's surfels: the corners of its cell that it sees, 0 where it must be looked up again. Neither
    /// surfels nor probes move, so once is enough; empty where the method does not store visibility at surfaces.
    fn masks(&self, volume: &Volume) -> Vec<Vec<u8>> {
        let of_probe = |p: usize| match volume.states[p] {
            ProbeState::Active => self.masks_of(volume, p),
            _ => Vec::new(),
        };
        (0..volume.states.len()).into_par_iter().map(of_probe).collect()
    }

    fn masks_of(&self, volume: &Volume, p: usize) -> Vec<u8> {
        let Some(surface) = &volume.surface_visibility else { return Vec::new() };
        self.captures.with(p, |capture| {
            capture.surfels.iter().map(|s| surface.look_up(&volume.grid, s.position, s.facing).mask).collect()
        })
    }

    /// Irradiance of every probe from the outgoing radiance that the present irradiance gives; without `masks` from the
    /// direct radiance alone.
    fn sweep(&self, volume: &Volume, masks: Option<&[Vec<u8>]>) -> Vec<Swept> {
        let probe = |p: usize| match volume.states[p] {
            ProbeState::Active => self.sweep_probe(volume, p, masks.map(|masks| masks[p].as_slice())),
            _ => Swept::default(),
        };
        (0..volume.states.len()).into_par_iter().map(probe).collect()
    }

    /// The same of one active probe, with the masks of its own surfels.
    fn sweep_probe(&self, volume: &Volume, p: usize, masks: Option<&[u8]>) -> Swept {
        let kernel = self.kernel;
        let query = Query { volume, settings: self.query };
        self.captures.with(p, |capture| {
            let mut radiance =
                if self.gathers_emission { capture.emitted_radiance() } else { vec![Vec3A::ZERO; capture.texels] };
            let mut non_finite = 0;
            for (i, surfel) in capture.surfels.iter().enumerate() {
                let mut outgoing = surfel.direct_radiance;
                if let Some(masks) = masks {
                    let visibility = match masks.get(i) {
                        None | Some(0) => Visibility::Stored,
                        Some(&mask) => Visibility::Exact(mask),
                    };
                    let weights = query.weights(&self.query_point(surfel, volume.positions[p]), visibility);
                    outgoing += reflected_radiance(surfel.albedo(), query.blend(&weights, surfel.oct()));
                }
                if outgoing.is_finite() {
                    radiance[surfel.texel as usize] += Vec3A::from(outgoing);
                } else {
                    non_finite += 1;
                }
            }
            let mut irradiance = vec![Vec3A::ZERO; kernel.rows()];
            kernel.irradiance(&radiance, &mut irradiance);
            Swept { irradiance, non_finite }
        })
    }

    /// Seconds that a sweep over these probes takes.
    pub fn time_sweep(&self, volume: &Volume, probes: &[usize]) -> f64 {
        let masks: Vec<Vec<u8>> = probes.par_iter().map(|&p| self.masks_of(volume, p)).collect();
        let started = Instant::now();
        let sweep = |(&p, masks): (&usize, &Vec<u8>)| self.sweep_probe(volume, p, Some(masks));
        std::hint::black_box(probes.par_iter().zip(&masks).map(sweep).collect::<Vec<_>>());
        started.elapsed().as_secs_f64()
    }

    /// How a probe asks for the light at a surfel. What the method does not look at is left zero.
    fn query_point(&self, surfel: &Surfel, probe: Vec3) -> QueryPoint {
        let normal = if self.query.weighs_by_normal() { direction_from_oct(surfel.oct()) } else { Vec3::ZERO };
        let view = if self.query.view_bias != 0.0 { (probe - surfel.position).normalize_or_zero() } else { Vec3::ZERO };
        QueryPoint { position: surfel.position, normal, facing: surfel.facing, view }
    }

    /// Adds the emitted light that probes see themselves: from their rays and from the emitters sampled at their centres.
    /// Returns the mean luminance of the irradiance added, over all interior texels of active probes.
    fn add_emission(&self, volume: &mut Volume) -> f64 {
        let kernel = self.kernel;
        let (resolution, border) = (volume.irradiance.resolution, volume.irradiance.border);
        let side = volume.irradiance.side();
        let curve = volume.curve;
        let n = volume.irradiance.texels_per_probe();
        let states = &volume.states;
        let add = |(p, out): (usize, &mut [Vec3A])| {
            if states[p] != ProbeState::Active {
                return None;
            }
            self.captures.with(p, |capture| {
                let mut emitted = vec![Vec3A::ZERO; kernel.rows()];
                let mut energy = 0.0;
                kernel.irradiance(&capture.emitted_radiance(), &mut emitted);
                for (o, value) in emitted.iter_mut().enumerate() {
                    let at = (o / resolution + border) * side + o % resolution + border;
                    let normal = texel_direction(o % resolution, o / resolution, resolution);
                    *value += Vec3A::from(capture.sampled_emitter_irradiance(normal));
                    energy += f64::from(luminance((*value).into()));
                    *value = curve.encode(*value + curve.decode(out[at]));
                }
                fill_with_border(&emitted, resolution, border, out);
                Some(energy)
            })
        };
        // Summed in order, on one thread: the same for any number of threads.
        let energies: Vec<Option<f64>> = volume.irradiance.texels.par_chunks_mut(n).enumerate().map(add).collect();
        let texels = energies.iter().flatten().count() * kernel.rows();
        energies.iter().flatten().sum::<f64>() / texels.max(1) as f64
    }
}

/// The sweep's figures, and its largest change in W·m⁻².
fn measure(volume: &Volume, swept: &[Swept], index: u32) -> (Bounce, f64) {
    let maps = &volume.irradiance;
    let (resolution, border, side) = (maps.resolution, maps.border, maps.side());
    let per_probe = |(p, swept): (usize, &Swept)| {
        let new = &swept.irradiance;
        let old = maps.probe(p);
        let (mut change, mut largest, mut energy) = (0.0f32, 0.0f32, 0.0f64);
        for (o, value) in new.iter().enumerate() {
            let at = (o / resolution + border) * side + o % resolution + border;
            change = change.max((*value - volume.curve.decode(old[at])).abs().max_element());
            largest = largest.max(value.max_element());
            energy += f64::from(luminance((*value).into()));
        }
        (change, largest, energy, new.len())
    };
    // Collected in order and summed on one thread: the same energy for any number of threads.
    let found: Vec<_> = swept.par_iter().enumerate().map(per_probe).collect();
    let change = f64::from(found.iter().map(|f| f.0).fold(0.0, f32::max));
    let largest = f64::from(found.iter().map(|f| f.1).fold(0.0, f32::max));
    let texels: usize = found.iter().map(|f| f.3).sum();
    let energy = found.iter().map(|f| f.2).sum::<f64>() / texels.max(1) as f64;
    (Bounce { index, residual: if largest > 0.0 { change / largest } else { 0.0 }, energy }, change)
}

fn store(volume: &mut Volume, swept: &[Swept]) {
    let (resolution, border) = (volume.irradiance.resolution, volume.irradiance.border);
    let curve = volume.curve;
    let n = volume.irradiance.texels_per_probe();
    volume.irradiance.texels.par_chunks_mut(n).zip(swept).for_each(|(out, swept)| {
        if !swept.irradiance.is_empty() {
            let encoded: Vec<Vec3A> = swept.irradiance.iter().map(|&e| curve.encode(e)).collect();
            fill_with_border(&encoded, resolution, border, out);
        }
    });
}
