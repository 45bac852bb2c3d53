//! Bounces: light goes from probes to the surfaces they captured and back, until nothing changes.
//!
//! With B the outgoing radiance at every captured hit, `Bᵏ = B⁰ + ρ/π·Q[G[Bᵏ⁻¹]]`, G the irradiance filter and Q the
//! query with the method's own weights: Jacobi's iteration for (I − T)B = B⁰, whose error shrinks by about the mean
//! albedo per sweep.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::capture::{ProbeCapture, Surfel};
use super::filter::Kernel;
use super::map::fill_with_border;
use super::placement::ProbeState;
use super::query::{Query, QueryPoint, QuerySettings, Visibility};
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounce {
    pub index: u32,
    /// Largest change of any irradiance texel ÷ largest irradiance texel.
    pub residual: f64,
    /// Mean luminance of all active probes' irradiance, W·m⁻².
    pub energy: f64,
}

#[derive(Debug, Clone, Default)]
pub struct Solution {
    pub bounces: Vec<Bounce>,
    pub converged: bool,
    /// Ratio of the last two changes; `None` before there are two.
    pub spectral_radius_estimate: Option<f64>,
    pub non_finite: u64,
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
    /// Of every surfel: the corners of its cell that it sees. Neither moves, so the first sweep looks them up for all;
    /// empty where the method does not store visibility at surfaces.
    masks: Vec<u8>,
}

impl<C: Captures> Solver<'_, C> {
    /// Fills the volume's irradiance. Its positions, states and visibility must stand already.
    pub fn solve(&self, volume: &mut Volume, on_bounce: impl Fn(&Bounce)) -> Solution {
        let settings = self.settings;
        let mut solution = Solution::default();
        let mut previous_change = None;
        let mut masks: Option<Vec<Vec<u8>>> = None;
        for index in 0..=settings.max_bounces {
            let mut swept = self.sweep(volume, masks.as_deref());
            solution.non_finite += swept.iter().map(|s| s.non_finite).sum::<u64>();
            let bounce = measure(volume, &swept, index);
            store(volume, &swept);
            masks.get_or_insert_with(|| swept.iter_mut().map(|s| std::mem::take(&mut s.masks)).collect());
            on_bounce(&bounce.0);
            solution.bounces.push(bounce.0);
            let change = bounce.1;
            if index > 0 {
                if let Some(previous) = previous_change.filter(|&p| p > 0.0) {
                    solution.spectral_radius_estimate = Some(change / previous);
                }
                // What is still to come is a geometric series in the ratio of the changes.
                let ratio = solution.spectral_radius_estimate.unwrap_or(f64::from(settings.albedo_max));
                let missing = if ratio < 1.0 { bounce.0.residual * ratio / (1.0 - ratio) } else { f64::INFINITY };
                previous_change = Some(change);
                if change == 0.0 || missing <= f64::from(settings.tolerance) {
                    solution.converged = true;
                    break;
                }
            }
        }
        if !self.gathers_emission {
            self.add_emission(volume);
        }
        solution
    }

    /// Irradiance of every probe from the outgoing radiance that the present irradiance gives. `masks` are those that
    /// the first sweep returned; without them nothing is asked of the probes, for there is nothing in them yet.
    fn sweep(&self, volume: &Volume, masks: Option<&[Vec<u8>]>) -> Vec<Swept> {
        let kernel = self.kernel;
        let query = Query { volume, settings: self.query };
        let probe = |p: usize| {
            if volume.states[p] != ProbeState::Active {
                return Swept::default();
            }
            self.captures.with(p, |capture| {
                let mut radiance =
                    if self.gathers_emission { capture.emitted_radiance() } else { vec![Vec3A::ZERO; capture.texels] };
                let mut non_finite = 0;
                for (i, surfel) in capture.surfels.iter().enumerate() {
                    let mut outgoing = surfel.direct_radiance;
                    if let Some(masks) = masks {
                        let visibility = masks[p].get(i).map_or(Visibility::Stored, |&mask| Visibility::Exact(mask));
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
                let masks = match (masks, &volume.surface_visibility) {
                    (None, Some(surface)) => {
                        capture.surfels.iter().map(|s| surface.mask(&volume.grid, s.position, s.facing)).collect()
                    }
                    _ => Vec::new(),
                };
                Swept { irradiance, non_finite, masks }
            })
        };
        (0..volume.states.len()).into_par_iter().map(probe).collect()
    }

    /// How a probe asks for the light at a surfel. What the method does not look at is left zero.
    fn query_point(&self, surfel: &Surfel, probe: Vec3) -> QueryPoint {
        let normal = if self.query.weighs_by_normal() { direction_from_oct(surfel.oct()) } else { Vec3::ZERO };
        let view = if self.query.view_bias != 0.0 { (probe - surfel.position).normalize_or_zero() } else { Vec3::ZERO };
        QueryPoint { position: surfel.position, normal, facing: surfel.facing, view }
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
                let mut emitted = vec![Vec3A::ZERO; kernel.rows()];
                kernel.irradiance(&capture.emitted_radiance(), &mut emitted);
                for (o, value) in emitted.iter_mut().enumerate() {
                    let at = (o / resolution + border) * side + o % resolution + border;
                    let normal = texel_direction(o % resolution, o / resolution, resolution);
                    *value += curve.decode(out[at]) + Vec3A::from(capture.sampled_emitter_irradiance(normal));
                    *value = curve.encode(*value);
                }
                fill_with_border(&emitted, resolution, border, out);
            });
        });
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
