//! Time and memory of a bake, foretold from a few of its probes.

use std::time::Instant;

use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use super::circumstances::Circumstances;
use super::gather::{Budgeted, CHUNK_BYTES};
use super::memory::{EMITTED_BYTES, SURFEL_BYTES, kept_bytes, surfels_bytes};
use super::prepared::Prepared;
use crate::math::fibonacci;
use crate::probe::capture::ProbeCapture;
use crate::probe::store::Occlusion;
use crate::probe::transport::operator::Operator;
use crate::probe::transport::rows;
use crate::system::memory::{TooLittleMemory, peak_memory_bytes, resident_bytes};
use crate::trace::Ray;

/// Probes traced to predict.
const PILOT: usize = 32;

/// Rays of all these together.
const PILOT_RAYS: usize = 1 << 21;

/// What a bake would take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Done already.
    pub survey_s: f64,
    /// Where iterations capture anew, all of them.
    pub capture_s: f64,
    /// One bounce, where captures stand before.
    pub bounce_s: f64,
    /// As many as the mean albedo that the probes see asks for.
    pub bounces: u32,
    /// Captures kept in memory.
    pub capture_bytes: u64,
    /// Maps with their copies, filters, what is traced at the same time.
    pub map_bytes: u64,
    /// What the process takes now: scene, acceleration structure, survey's tables.
    pub resident_bytes: u64,
    /// The most that loading the scene and surveying it took: all of that is done.
    pub survey_bytes: u64,
}

impl Prediction {
    /// All stages but loading and writing.
    pub fn time_s(&self) -> f64 {
        self.survey_s + self.capture_s + f64::from(self.bounces) * self.bounce_s
    }

    pub fn memory_bytes(&self) -> u64 {
        (self.capture_bytes + self.map_bytes + self.resident_bytes).max(self.survey_bytes)
    }
}

impl Prepared<'_, '_> {
    /// Foretells time and memory from some of the probes, spread evenly.
    pub fn predict(&self, circumstances: &Circumstances) -> Prediction {
        // Before this estimate itself takes any.
        let (resident_bytes, survey_bytes) = (resident_bytes(), peak_memory_bytes());
        let config = self.config;
        let capture = self.capture(circumstances);
        // Large captures are alike, and few of them fit into memory.
        let fitting = (CHUNK_BYTES / surfels_bytes(config).max(1)) as usize;
        let quick = PILOT_RAYS / self.capture.rays.count().max(1);
        let (pilot, share) = self.some_probes(fitting.min(quick).clamp(1, PILOT));
        let occlusion = self.occlusion_builder();
        let started = Instant::now();
        let trace = |&probe: &usize| {
            let mut captured = match config.transport.captures_once() {
                true => self.trace(&capture, probe),
                false => self.frame(&capture, probe, 0),
            };
            // Filtered at once, and not kept.
            std::hint::black_box(self.look(&occlusion, probe, &mut captured));
            captured
        };
        let traced: Vec<ProbeCapture> = pilot.par_iter().map(trace).collect();
        let capture_s = started.elapsed().as_secs_f64() * share;
        let has_rows = rows::are_kept(&config.transport, &config.store.irradiance);
        let kept = |c: &ProbeCapture| c.bytes() + if has_rows { rows::most_bytes(c) } else { 0 };
        let bytes = traced.iter().map(kept).sum::<u64>() as f64 * share;

        // Light that is lost at every bounce: what is not reflected, and what leaves the scene.
        let seen: usize = traced.iter().map(|c| c.texels).sum();
        let reflected: Vec3A = traced.iter().flat_map(|c| &c.surfels).map(|s| Vec3A::from(s.albedo())).sum();
        let ratio =
            f64::from((reflected / seen.max(1) as f32).max_element()).min(f64::from(config.materials.albedo_max));

        let mut stored: Vec<Option<ProbeCapture>> = (0..self.grid.probe_count()).map(|_| None).collect();
        pilot.iter().zip(traced).for_each(|(&probe, capture)| stored[probe] = Some(capture));
        let occlusion = if self.plan.visibility { occlusion.finish() } else { Occlusion::None };
        let volume = self.volume(occlusion);
        let kernel = volume.irradiance.kernel(&self.capture.rays.directions());
        let operator = Operator {
            captures: &Budgeted { stored, prepared: self, capture: &capture },
            kernel: &kernel,
            query: &config.query,
            gathers_emission: false,
        };
        let mut retraced_s = 0.0;
        // A pilot is captured and solved beforehand; then there are more rays.
        let rough_bounces = config.transport.rough_bounces();
        let guided = self.capture.rays.guided().filter(|_| rough_bounces > 0);
        let (times, pilot_captures, pilot_bounces) = match guided {
            Some((_, per_texel, guided)) => {
                (1.0 + f64::from(guided) / per_texel as f64, 1.0, f64::from(1 + rough_bounces))
            }
            None => (1.0, 0.0, 0.0),
        };
        let bytes = bytes * times;
        let budget = circumstances.memory_budget_bytes.unwrap_or(u64::MAX);
        if bytes > 0.0 && bytes > budget as f64 {
            retraced_s = capture_s * (1.0 - budget as f64 / bytes);
        }
        let bounces = config.transport.expected_iterations(ratio);
        // Where rows fit, all passes together take about as long as asking the surfaces once.
        let asked = if has_rows && rows::fit(&operator, &volume) { f64::from(bounces.max(1)) } else { 1.0 };
        let bounce_s = operator.time(&volume, &pilot) * share / asked;
        // Frames are captured anew, and none is kept; a bake counts all their time as capture.
        let once = config.transport.captures_once();
        Prediction {
            survey_s: self.survey_s,
            capture_s: match once {
                true => capture_s * (pilot_captures + times) + pilot_bounces * bounce_s,
                false => f64::from(bounces) * (capture_s + bounce_s),
            },
            bounce_s: if once { bounce_s * times + retraced_s } else { 0.0 },
            bounces,
            capture_bytes: if once { (bytes as u64).min(budget) } else { 0 },
            map_bytes: self.memory.standing(),
            resident_bytes,
            survey_bytes,
        }
    }

    /// Refuses a bake whose captures do not fit beside its maps.
    pub fn check_memory(&self, circumstances: &Circumstances) -> Result<(), TooLittleMemory> {
        if !self.config.transport.captures_once() {
            return self.memory.check(self.config, 0);
        }
        let budget = circumstances.memory_budget_bytes.unwrap_or(u64::MAX);
        let most = (self.active().len() as u64).saturating_mul(kept_bytes(self.config));
        let checked = self.memory.check(self.config, most.min(budget));
        if checked.is_ok() {
            return checked;
        }
        // Rays that leave the scene keep little: some tell how many these are.
        self.memory.check(self.config, ((most as f64 * self.kept_share()) as u64).min(budget))
    }

    /// Share of the most memory that captures could take, from a few rays of some probes.
    fn kept_share(&self) -> f64 {
        /// Rays of each pilot: their share is known to some percent in all.
        const RAYS: usize = 256;
        let (pilot, _) = self.some_probes(PILOT);
        let kept = |&probe: &usize| -> f64 {
            let ray = |i| Ray::new(self.placement.positions[probe], fibonacci::direction(i, RAYS), i as u32);
            let bytes = |i| match self.world.surface(ray(i)) {
                Some(surface) => {
                    let surfel = if surface.albedo == Vec3::ZERO { 0 } else { SURFEL_BYTES };
                    surfel + if surface.emission == Vec3::ZERO { 0 } else { EMITTED_BYTES }
                }
                None if self.world.emitters.has_sky() => EMITTED_BYTES,
                None => 0,
            };
            (0..RAYS).map(bytes).sum::<u64>() as f64
        };
        let sum: f64 = pilot.iter().map(kept).sum();
        sum / (SURFEL_BYTES as f64 * (pilot.len() * RAYS).max(1) as f64)
    }

    /// At most `most` active probes, spread evenly, and how many each of them stands for.
    fn some_probes(&self, most: usize) -> (Vec<usize>, f64) {
        let active = self.active();
        let pilot: Vec<usize> = active.iter().copied().step_by(active.len().div_ceil(most).max(1)).collect();
        let share = active.len() as f64 / pilot.len().max(1) as f64;
        (pilot, share)
    }
}
