//! Bounces: light goes from probes to the surfaces they captured and back, until nothing changes.
//!
//! With B the outgoing radiance at every captured hit, `Bᵏ = B⁰ + ρ/π·Q[G[Bᵏ⁻¹]]`, G the irradiance filter and Q the
//! query with the method's own weights: Jacobi's iteration for (I − T)B = B⁰, whose error shrinks by about the mean
//! albedo per sweep.

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::capture::ProbeCapture;
use super::filter::Kernel;
use super::grid::ProbeIndex;
use super::map::fill_with_border;
use super::placement::ProbeState;
use super::query::{Query, QueryPoint, QuerySettings, Visibility};
use super::volume::Volume;
use crate::light::lambert::reflected_radiance;
use crate::math::color::luminance;
use crate::math::octahedral::texel_direction;

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
    /// Mean luminance of all active probes' irradiance, W·m⁻².
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
        for index in progress.bounces.len() as u32..=settings.max_bounces {
            if progress.converged {
                break;
            }
            let (irradiance, non_finite) = self.sweep(volume, index);
            progress.non_finite += non_finite;
            let (bounce, change) = measure(volume, &irradiance, index);
            store(volume, &irradiance);
            progress.bounces.push(bounce);
            if index > 0 {
                progress.judge(change, bounce.residual, settings);
            }
            on_bounce(&progress, volume);
        }
        if !self.gathers_emission {
            self.add_emission(volume);
        }
        progress
    }

    /// Irradiance of every probe (interior texels) from the outgoing radiance that the present irradiance gives.
    fn sweep(&self, volume: &Volume, index: u32) -> (Vec<Vec<Vec3>>, u64) {
        let kernel = self.kernel;
        let query = Query { volume, settings: self.query };
        let probe = |p: usize| {
            if volume.states[p] != ProbeState::Active {
                return (Vec::new(), 0);
            }
            let position = volume.position(ProbeIndex(p as u32));
            self.captures.with(p, |capture| {
                let mut radiance = if self.gathers_emission {
                    capture.emitted.clone()
                } else {
                    vec![Vec3::ZERO; capture.emitted.len()]
                };
                let mut non_finite = 0;
                for surfel in &capture.surfels {
                    let mut outgoing = surfel.direct_radiance;
                    // Before the first sweep there is nothing in the probes to ask for.
                    if index > 0 {
                        let point = QueryPoint {
                            position: surfel.position,
                            normal: surfel.normal,
                            geometric_normal: surfel.geometric_normal,
                            view: (position - surfel.position).normalize_or_zero(),
                        };
                        outgoing += reflected_radiance(surfel.albedo, query.irradiance(&point, Visibility::Stored));
                    }
                    if outgoing.is_finite() {
                        radiance[surfel.texel as usize] += outgoing * surfel.weight;
                    } else {
                        non_finite += 1;
                    }
                }
                let mut irradiance = vec![Vec3::ZERO; kernel.rows()];
                kernel.irradiance(&radiance, &mut irradiance);
                (irradiance, non_finite)
            })
        };
        let found: Vec<(Vec<Vec3>, u64)> = (0..volume.states.len()).into_par_iter().map(probe).collect();
        let non_finite = found.iter().map(|f| f.1).sum();
        (found.into_iter().map(|f| f.0).collect(), non_finite)
    }

    /// Adds the emitted light that probes see themselves: from their rays and from the emitters sampled at their centres.
    fn add_emission(&self, volume: &mut Volume) {
        let kernel = self.kernel;
        let (resolution, border) = (volume.irradiance.resolution, volume.irradiance.border);
        let side = volume.irradiance.side();
        let curve = volume.curve;
        let n = volume.irradiance.texels_per_probe();
        let states = &volume.states;
        volume.irradiance.texels.par_chunks_mut(n).enumerate().for_each(|(p, out)| {
            if states[p] != ProbeState::Active {
                return;
            }
            self.captures.with(p, |capture| {
                let mut emitted = vec![Vec3::ZERO; kernel.rows()];
                kernel.irradiance(&capture.emitted, &mut emitted);
                for (o, value) in emitted.iter_mut().enumerate() {
                    let at = (o / resolution + border) * side + o % resolution + border;
                    let normal = texel_direction(o % resolution, o / resolution, resolution);
                    *value += curve.decode(out[at]) + capture.sampled_emitter_irradiance(normal);
                    *value = curve.encode(*value);
                }
                fill_with_border(&emitted, resolution, border, out);
            });
        });
    }
}

/// The sweep's figures, and its largest change in W·m⁻².
fn measure(volume: &Volume, irradiance: &[Vec<Vec3>], index: u32) -> (Bounce, f64) {
    let maps = &volume.irradiance;
    let (resolution, border, side) = (maps.resolution, maps.border, maps.side());
    let per_probe = |(p, new): (usize, &Vec<Vec3>)| {
        let old = maps.probe(p);
        let (mut change, mut largest, mut energy) = (0.0f32, 0.0f32, 0.0f64);
        for (o, value) in new.iter().enumerate() {
            let at = (o / resolution + border) * side + o % resolution + border;
            change = change.max((*value - volume.curve.decode(old[at])).abs().max_element());
            largest = largest.max(value.max_element());
            energy += f64::from(luminance(*value));
        }
        (change, largest, energy, new.len())
    };
    // Collected in order and summed on one thread: the same energy for any number of threads.
    let found: Vec<_> = irradiance.par_iter().enumerate().map(per_probe).collect();
    let change = f64::from(found.iter().map(|f| f.0).fold(0.0, f32::max));
    let largest = f64::from(found.iter().map(|f| f.1).fold(0.0, f32::max));
    let texels: usize = found.iter().map(|f| f.3).sum();
    let energy = found.iter().map(|f| f.2).sum::<f64>() / texels.max(1) as f64;
    (Bounce { index, residual: if largest > 0.0 { change / largest } else { 0.0 }, energy }, change)
}

fn store(volume: &mut Volume, irradiance: &[Vec<Vec3>]) {
    let (resolution, border) = (volume.irradiance.resolution, volume.irradiance.border);
    let curve = volume.curve;
    let n = volume.irradiance.texels_per_probe();
    volume.irradiance.texels.par_chunks_mut(n).zip(irradiance).for_each(|(out, interior)| {
        if !interior.is_empty() {
            let encoded: Vec<Vec3> = interior.iter().map(|&e| curve.encode(e)).collect();
            fill_with_border(&encoded, resolution, border, out);
        }
    });
}
