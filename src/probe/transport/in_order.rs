//! Probes one after another: each is filled from all the others as they are then, and stands for the next ones at once
//! (Gauss and Seidel's iteration), until no probe changes much any more.
//!
//! The order is that of the probes' numbers, so the result is the same for any number of threads: they share the probes
//! whose [`rows`](super::rows) are worked out, and else the surfaces that one probe sees.

use glam::Vec3;

use super::operator::{Captures, Operator};
use super::rows::Rows;
use super::settings::InOrderSettings;
use super::solver::{Bounce, Progress, Solution};
use crate::math::color::luminance;
use crate::probe::Volume;

/// Probes darker than this share of the brightest are judged by that: what noise is left of them is not waited for.
const DARK_SHARE: f32 = 1e-3;

/// What one pass over all probes changed.
#[derive(Default)]
struct Pass {
    /// Per probe: largest change of an unknown and largest unknown, over all channels.
    probes: Vec<(f32, f32)>,
    largest_change: Vec3,
    /// 2-norm of all changes, squared.
    norm: f64,
    /// Sum of the luminance of irradiance, and of how many unknowns.
    energy: (f64, usize),
    non_finite: u64,
}

impl Pass {
    /// Largest relative change of any probe.
    fn relative(&self) -> f64 {
        let brightest = self.probes.iter().map(|(_, size)| *size).fold(0.0, f32::max);
        let of_probe = |&(change, size): &(f32, f32)| match size.max(DARK_SHARE * brightest) {
            scale if scale > 0.0 => f64::from(change) / f64::from(scale),
            _ => 0.0,
        };
        self.probes.iter().map(of_probe).fold(0.0, f64::max)
    }
}

/// Passes over the probes until none changes by more than the tolerance.
pub fn solve<C: Captures>(
    operator: &Operator<C>,
    settings: &InOrderSettings,
    volume: &mut Volume,
    mut progress: Progress,
    mut on_iteration: impl FnMut(&Progress, &Volume),
) -> Solution {
    let masks = operator.masks(volume);
    let rows = Rows::new(operator, volume, &masks);
    let done = progress.solution.bounces.len() as u32;
    if done == 0 {
        progress.solution.non_finite += rows.non_finite();
    }
    for index in done + 1..=settings.most {
        if progress.solution.converged {
            break;
        }
        let active: Vec<usize> = volume.active().collect();
        let group = volume.irradiance.signed().map_or(1, |(group, _)| group);
        let mut pass = Pass::default();
        for p in active {
            let before: Vec<Vec3> = volume.irradiance.probe(p).collect();
            let (after, non_finite) = rows.update(operator, volume, p, &masks);
            pass.non_finite += non_finite;
            let (mut change, mut size) = (Vec3::ZERO, Vec3::ZERO);
            for (o, (before, after)) in before.into_iter().zip(&after).enumerate() {
                let after = Vec3::from(*after);
                change = change.max((after - before).abs());
                size = size.max(after.abs());
                pass.norm += (after - before).as_dvec3().length_squared();
                if o % group == 0 {
                    pass.energy = (pass.energy.0 + f64::from(luminance(after)), pass.energy.1 + 1);
                }
            }
            pass.largest_change = pass.largest_change.max(change);
            pass.probes.push((change.max_element(), size.max_element()));
            volume.irradiance.set_probe(p, &after);
        }
        let (residual, norm) = (pass.relative(), pass.norm.sqrt());
        let energy = pass.energy.0 / pass.energy.1.max(1) as f64;
        let Progress { solution, control, .. } = &mut progress;
        solution.bounces.push(Bounce { index, residual, energy, accelerated: false });
        solution.non_finite += pass.non_finite;
        solution.last_change = Some(pass.largest_change.as_dvec3().to_array());
        if let Some(last) = control.last_norm.filter(|&last| last > 0.0) {
            solution.spectral_radius_estimate = Some(norm / last);
        }
        control.last_norm = Some(norm);
        solution.converged = residual < f64::from(settings.tolerance) || residual == 0.0;
        on_iteration(&progress, volume);
    }
    if !volume.radiance.is_empty() {
        operator.keep_radiance(volume, Some(&masks), true);
    }
    let mut solution = progress.solution;
    if !operator.gathers_emission {
        let emitted = operator.add_emission(volume);
        solution.bounces.iter_mut().for_each(|bounce| bounce.energy += emitted);
    }
    solution
}
