//! Capturing all probes, and keeping what fits into memory.

use glam::Vec2;
use rayon::prelude::*;

use super::circumstances::Circumstances;
use super::log::Log;
use super::memory::surfels_bytes;
use super::prepared::Prepared;
use crate::probe::Volume;
use crate::probe::capture::{Capture, ProbeCapture, frame_rotation};
use crate::probe::store::Occlusion;
use crate::probe::transport::operator::{Captures, Filters, Frame, Scenery};
use crate::probe::transport::rows;

/// Probes that are traced before the next are begun: bounds the memory of what is not kept, and of replay's logs.
pub const CHUNK: usize = 256;
/// The same in bytes, where captures are large; but never fewer than there are threads.
pub const CHUNK_BYTES: u64 = 256 << 20;

/// Captures in memory as far as the budget goes; the others are traced again whenever they are asked for.
pub struct Budgeted<'p> {
    pub stored: Vec<Option<ProbeCapture>>,
    pub prepared: &'p Prepared<'p, 'p>,
    pub capture: &'p Capture<'p, 'p>,
}

impl Captures for Budgeted<'_> {
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        match &self.stored[probe] {
            Some(capture) => visit(capture),
            None => visit(&self.prepared.trace(self.capture, probe)),
        }
    }

    fn keeps(&self, probe: usize) -> bool {
        self.stored[probe].is_some()
    }

    fn frame(&self, probe: usize, frame: u32) -> Option<Frame> {
        let capture = self.prepared.frame(self.capture, probe, frame);
        let settings = &self.prepared.capture;
        let counts = settings.backs.allow(capture.backs.len(), settings.rays.count());
        Some(Frame { capture, counts })
    }

    fn filters(&self, frame: u32, volume: &Volume) -> Option<Filters> {
        let rays = &self.prepared.capture.rays;
        let directions = rays.directions().turned(frame_rotation(self.capture.seed, frame));
        let stores = self.prepared.stores_occlusion();
        let distance = stores.then(|| self.prepared.config.store.occlusion.kernel(&directions)).flatten();
        Some(Filters { irradiance: volume.irradiance.kernel(&directions), distance })
    }

    fn scenery(&self) -> Option<Scenery<'_>> {
        Some(Scenery { world: self.prepared.world, seed: self.capture.seed })
    }
}

/// Captures every active probe; filters distances on the way, as their texels are not kept.
pub fn gather<'p>(
    prepared: &'p Prepared<'p, 'p>,
    capture: &'p Capture<'p, 'p>,
    circumstances: &Circumstances,
    log: &mut Log,
) -> (Budgeted<'p>, Occlusion) {
    let config = prepared.config;
    let probes = prepared.grid.probe_count();
    let mut stored: Vec<Option<ProbeCapture>> = (0..probes).map(|_| None).collect();
    let mut occlusion = prepared.occlusion_builder();
    let once = config.transport.captures_once();
    let has_rows = rows::are_kept(&config.transport, &config.store.irradiance);
    let active = if once || occlusion.has_rays() { prepared.active() } else { Vec::new() };
    let at_once = (CHUNK_BYTES / surfels_bytes(config).max(1)) as usize;
    let at_once = at_once.clamp(rayon::current_num_threads().min(CHUNK), CHUNK);
    let (mut rays, mut outside, mut non_finite, mut light_clamped, mut bytes) = ((0, 0), 0, 0, 0, 0);
    log.stage(
        |times| &mut times.capture,
        "capturing",
        active.len(),
        |bar| {
            for chunk in active.chunks(at_once) {
                let traced: Vec<(ProbeCapture, Vec<Vec2>)> = chunk
                    .par_iter()
                    .map(|&probe| {
                        let mut capture = match once {
                            true => prepared.trace(capture, probe),
                            false => ProbeCapture::default(),
                        };
                        let filtered = prepared.look(&occlusion, probe, &mut capture);
                        bar.inc(1);
                        (capture, filtered)
                    })
                    .collect();
                for (&probe, (capture, filtered)) in chunk.iter().zip(traced) {
                    rays.0 += capture.rays.primary;
                    rays.1 += capture.rays.shadow;
                    outside += capture.hits_outside_volume;
                    non_finite += capture.non_finite;
                    light_clamped += capture.light_clamped;
                    occlusion.set(probe, &filtered);
                    bytes += capture.bytes() + if has_rows { rows::most_bytes(&capture) } else { 0 };
                    if once && circumstances.memory_budget_bytes.is_none_or(|budget| bytes <= budget) {
                        stored[probe] = Some(capture);
                    }
                }
            }
        },
    );
    log.rays.primary += rays.0;
    log.rays.shadow += rays.1;
    log.numerics.hits_outside_volume += outside;
    log.numerics.non_finite += non_finite;
    log.numerics.light_clamped += light_clamped;
    (Budgeted { stored, prepared, capture }, occlusion.finish())
}
