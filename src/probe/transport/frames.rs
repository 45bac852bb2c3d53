//! Frames: every probe sends a few new rays, shades what they meet with the light that the probes had in the frame before,
//! and mixes the result into its own (Majercik et al. 2019, 2021).
//!
//! A texel's mean m of frames' samples s moves in the domain in which irradiance is stored: m ← h·m + (1 − h)·s, h = 0 in
//! the first frame and while the texel is black. Distances are mixed alike. The mean of a concave curve is below the curve of
//! the mean: the result is darker than the truth where few rays bring most of the light.
//!
//! *Variability* is the mean of √lum((s − m₀)(s − m₁))/lum(m₁) over the texels that had a sample, m₀ and m₁ the means before
//! and after; 0 where lum(m₁) is at most 1/1024. It falls while light spreads and stays where only noise is left: the
//! frames end when it has not fallen by a share within a number of frames.
//!
//! Left out: thresholds of change in brightness and irradiance, the least step of darkening, and saturation of samples.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use super::operator::{Captures, Filters, Operator};
use super::settings::FrameSettings;
use super::solver::{Bounce, Progress, Solution, Stopped};
use crate::light::sampled::RayCount;
use crate::math::color::luminance;
use crate::math::statistics::Moments;
use crate::probe::Volume;
use crate::probe::lattice::ProbeState;

/// Means of at most this luminance, in the domain in which they are stored, have no variability.
const DARK: f32 = 1.0 / 1024.0;

/// Name of the distances in a checkpoint.
const DISTANCES: &str = "distance";

/// What one probe found in one frame.
struct Found {
    /// `None` where it learns no light.
    irradiance: Option<Vec<Vec3A>>,
    rays: RayCount,
    non_finite: u64,
    outside: u64,
    clamped: u64,
}

/// What one probe's texels add up to in one frame.
#[derive(Default)]
struct Sums {
    variability: f64,
    energy: f64,
    texels: usize,
}

/// When to end, from the variability of all frames so far.
#[derive(Debug, Clone, Copy, Default)]
struct Watch {
    lowest: Option<f64>,
    frames_since: u32,
}

impl Watch {
    fn see(&mut self, variability: f64, fall: f32) {
        match self.lowest {
            Some(lowest) if variability > lowest * (1.0 - f64::from(fall)) || lowest == 0.0 => self.frames_since += 1,
            _ => (self.lowest, self.frames_since) = (Some(variability), 0),
        }
    }
}

/// Runs frames until the light has settled.
pub fn solve<C: Captures>(
    operator: &Operator<C>,
    settings: &FrameSettings,
    volume: &mut Volume,
    mut progress: Progress,
    mut on_iteration: impl FnMut(&Progress, &Volume),
) -> Solution {
    if let Some(distances) = progress.fields.remove(DISTANCES) {
        volume.occlusion.restore(&distances);
    }
    let mut watch = Watch::default();
    // The first frame is a mean of itself, and varies by nothing.
    progress.solution.bounces.iter().skip(1).for_each(|frame| watch.see(frame.residual, settings.fall));
    for frame in progress.solution.bounces.len() as u32..settings.most {
        if progress.solution.converged {
            break;
        }
        let Some(filters) = operator.captures.filters(frame, volume) else { break };
        let (found, distances) = shoot(operator, volume, frame, &filters);
        let kept = if frame == 0 { 0.0 } else { settings.hysteresis };
        let sums = blend(volume, &found, kept);
        volume.occlusion.blend_each(&distances, f64::from(kept));
        let solution = &mut progress.solution;
        for found in found.iter().flatten() {
            solution.rays.0 += found.rays.primary;
            solution.rays.1 += found.rays.shadow;
            solution.non_finite += found.non_finite;
            solution.hits_outside_volume += found.outside;
            solution.light_clamped += found.clamped;
        }
        let texels = sums.texels.max(1) as f64;
        let variability = sums.variability / texels;
        if frame > 0 {
            watch.see(variability, settings.fall);
        }
        let energy = sums.energy / texels;
        solution.bounces.push(Bounce { index: frame, residual: variability, energy, accelerated: false });
        let enough = frame + 1 >= settings.least;
        solution.converged = enough && watch.frames_since >= settings.window;
        progress.fields.insert(DISTANCES.to_owned(), volume.occlusion.stored());
        on_iteration(&progress, volume);
    }
    let solution = progress.solution;
    let stopped = if solution.converged { Stopped::Settled } else { Stopped::Limit };
    Solution { stopped: Some(stopped), ..solution }
}

/// Traces and shades one frame of all active probes, with the light and the distances of the frame before.
fn shoot<C: Captures>(
    operator: &Operator<C>,
    volume: &Volume,
    frame: u32,
    filters: &Filters,
) -> (Vec<Option<Found>>, Vec<Option<Vec<Moments>>>) {
    let of_probe = |p: usize| {
        if volume.states[p] != ProbeState::Active {
            return (None, None);
        }
        let Some(shot) = operator.captures.frame(p, frame) else { return (None, None) };
        let capture = &shot.capture;
        // Before the first there is nothing in the probes to ask for.
        let mask = |_| (frame > 0).then_some(0);
        let (radiance, non_finite) = operator.outgoing(volume, p, capture, mask, operator.gathers_emission);
        let light = || filters.irradiance.irradiance_without(&radiance, &capture.backs);
        let found = Found {
            irradiance: if shot.counts { light() } else { None },
            rays: capture.rays,
            non_finite: non_finite + capture.non_finite,
            outside: capture.hits_outside_volume,
            clamped: capture.light_clamped,
        };
        (Some(found), filters.distance.as_ref().map(|kernel| kernel.distance(&capture.distances)))
    };
    (0..volume.states.len()).into_par_iter().map(of_probe).unzip()
}

/// Mixes a frame's irradiance into the probes'.
fn blend(volume: &mut Volume, found: &[Option<Found>], kept: f32) -> Sums {
    let curve = volume.irradiance.curve();
    let mix = |p: usize, before: &mut dyn Iterator<Item = Vec3A>| {
        let samples = found[p].as_ref()?.irradiance.as_ref()?;
        let mut sums = Sums::default();
        let mut texel = |(before, sample): (Vec3A, &Vec3A)| {
            let (old, sample) = (curve.encode(before), curve.encode(*sample));
            let kept = if old == Vec3A::ZERO { 0.0 } else { kept };
            let new = old * kept + sample * (1.0 - kept);
            let brightness = luminance(new.into());
            if brightness > DARK {
                let product: Vec3 = ((sample - old) * (sample - new)).into();
                sums.variability += f64::from(luminance(product).max(0.0).sqrt() / brightness);
            }
            let mixed = curve.decode(new);
            sums.energy += f64::from(luminance(mixed.into()));
            sums.texels += 1;
            mixed
        };
        let values: Vec<Vec3A> = before.zip(samples).map(&mut texel).collect();
        Some((values, sums))
    };
    // Summed in order, on one thread: the same for any number of threads.
    let per_probe = volume.irradiance.set_each(mix);
    per_probe.into_iter().flatten().fold(Sums::default(), |a, b| Sums {
        variability: a.variability + b.variability,
        energy: a.energy + b.energy,
        texels: a.texels + b.texels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_end_where_variability_no_longer_falls() {
        let mut watch = Watch::default();
        // Falls by a hundredth and more.
        [1.0, 0.98, 0.96].iter().for_each(|&v| watch.see(v, 0.01));
        assert_eq!(watch.frames_since, 0);
        // By less than that, or not at all.
        [0.955, 0.97, 0.952].iter().for_each(|&v| watch.see(v, 0.01));
        assert_eq!((watch.lowest, watch.frames_since), (Some(0.96), 3));
        // Together it is enough.
        watch.see(0.95, 0.01);
        assert_eq!((watch.lowest, watch.frames_since), (Some(0.95), 0));
        // Nothing falls below zero.
        let mut still = Watch::default();
        (0..5).for_each(|_| still.see(0.0, 0.01));
        assert_eq!(still.frames_since, 4);
    }
}
