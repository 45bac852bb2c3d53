//! Capturing all probes, and keeping what fits into memory.

use std::collections::BTreeMap;

use glam::Vec2;
use rayon::prelude::*;

use super::log::Log;
use super::memory::surfels_bytes;
use super::prepared::Prepared;
use super::saving::{Kind, Saving};
use crate::math::random::Purpose;
use crate::probe::Volume;
use crate::probe::capture::{Capture, ProbeCapture, bytes, frame_rotation};
use crate::probe::store::Occlusion;
use crate::probe::transport::operator::{Captures, Filters, Frame, Scenery};
use crate::probe::transport::rows;
use crate::system::journal::{Place, Reader};

/// Probes that are traced before the next are begun: bounds the memory of what is not kept, and of replay's logs.
pub const CHUNK: usize = 256;
/// The same in bytes, where captures are large; but never fewer than there are threads.
pub const CHUNK_BYTES: u64 = 256 << 20;
/// They take at most this part of the budget.
const CHUNK_SHARE: u64 = 8;

/// Captures in memory as far as the budget goes. The others are read from the file that saves the work, or traced again where
/// there is none, whenever they are asked for.
pub struct Budgeted<'p> {
    pub stored: Vec<Option<ProbeCapture>>,
    filed: Filed,
    /// Of all captures, wherever they are.
    pub bytes: u64,
    pub prepared: &'p Prepared<'p, 'p>,
    pub capture: &'p Capture<'p, 'p>,
}

/// Captures in a file.
#[derive(Default)]
struct Filed {
    reader: Option<Reader>,
    places: BTreeMap<usize, Place>,
}

impl Filed {
    /// `None` where it is not there, or not as it was written.
    fn read(&self, probe: usize) -> Option<ProbeCapture> {
        let place = *self.places.get(&probe)?;
        Some(bytes::unpack(&self.reader.as_ref()?.read(place).ok()?)?.0)
    }
}

impl<'p> Budgeted<'p> {
    /// Of captures in memory; others are traced again.
    pub fn new(
        stored: Vec<Option<ProbeCapture>>,
        prepared: &'p Prepared<'p, 'p>,
        capture: &'p Capture<'p, 'p>,
    ) -> Budgeted<'p> {
        Budgeted { stored, filed: Filed::default(), bytes: 0, prepared, capture }
    }
}

impl Captures for Budgeted<'_> {
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        if let Some(capture) = &self.stored[probe] {
            return visit(capture);
        }
        match self.filed.read(probe) {
            Some(capture) => visit(&capture),
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

/// One probe's capture with its filtered distances, and where a file has both.
struct Made {
    capture: ProbeCapture,
    filtered: Vec<Vec2>,
    place: Option<Place>,
}

/// Captures every active probe, or takes up what was saved of it; filters distances on the way, as their texels are not kept.
/// At most `budget` bytes of captures stay in memory, with the rows that are worked out of them.
pub fn gather<'p>(
    prepared: &'p Prepared<'p, 'p>,
    capture: &'p Capture<'p, 'p>,
    budget: u64,
    saving: &mut Saving,
    log: &mut Log,
) -> (Budgeted<'p>, Occlusion) {
    let config = prepared.config;
    let kind = if capture.purpose == Purpose::Pilot { Kind::Pilot } else { Kind::Capture };
    let probes = prepared.grid.probe_count();
    let mut captures = Budgeted::new((0..probes).map(|_| None).collect(), prepared, capture);
    let mut occlusion = prepared.occlusion_builder();
    let once = config.transport.captures_once();
    let has_rows = rows::are_kept(&config.transport, &config.store.irradiance);
    let active = if once || occlusion.has_rays() { prepared.active() } else { Vec::new() };
    let at_once = (CHUNK_BYTES.min(budget / CHUNK_SHARE) / surfels_bytes(config).max(1)) as usize;
    let at_once = at_once.clamp(rayon::current_num_threads().min(CHUNK), CHUNK);
    let (mut rays, mut outside, mut non_finite, mut light_clamped, mut bytes) = ((0, 0), 0, 0, 0, 0);
    // Captures in memory that a file will take in when there is one, with their filtered distances.
    let mut unsaved: Vec<(usize, Vec<Vec2>)> = Vec::new();
    log.stage(
        |times| &mut times.capture,
        "capturing",
        active.len(),
        |bar| {
            for chunk in active.chunks(at_once) {
                let make = |&probe: &usize| {
                    let made = match saving.capture(kind, probe).filter(|_| once) {
                        Some((capture, filtered, place)) => Made { capture, filtered, place: Some(place) },
                        None => {
                            let mut capture =
                                if once { prepared.trace(capture, probe) } else { ProbeCapture::default() };
                            let filtered = prepared.look(&occlusion, probe, &mut capture);
                            Made { capture, filtered, place: None }
                        }
                    };
                    bar.inc(1);
                    made
                };
                let mut made: Vec<Made> = chunk.par_iter().map(make).collect();
                let kept = |c: &ProbeCapture| c.bytes() + if has_rows { rows::most_bytes(c) } else { 0 };
                let sizes: Vec<u64> = made.iter().map(|made| kept(&made.capture)).collect();
                let is_full = bytes + sizes.iter().sum::<u64>() > budget;
                if once && (saving.is_open() || (is_full || saving.is_due()) && saving.begin()) {
                    for (probe, filtered) in unsaved.drain(..) {
                        let packed = captures.stored[probe].as_ref().map(|capture| bytes::pack(capture, &filtered));
                        packed.and_then(|packed| saving.add_capture(kind, probe, &packed));
                    }
                    save(kind, chunk, &mut made, saving);
                }
                for ((&probe, made), size) in chunk.iter().zip(made).zip(sizes) {
                    let Made { capture, filtered, place } = made;
                    rays.0 += capture.rays.primary;
                    rays.1 += capture.rays.shadow;
                    outside += capture.hits_outside_volume;
                    non_finite += capture.non_finite;
                    light_clamped += capture.light_clamped;
                    occlusion.set(probe, &filtered);
                    bytes += size;
                    if !once {
                        continue;
                    }
                    if bytes <= budget {
                        captures.stored[probe] = Some(capture);
                        if place.is_none() && saving.is_wanted() {
                            unsaved.push((probe, filtered));
                        }
                    } else if let Some(place) = place {
                        captures.filed.places.insert(probe, place);
                    }
                }
            }
        },
    );
    captures.filed.reader = saving.reader();
    captures.bytes = bytes;
    log.rays.primary += rays.0;
    log.rays.shadow += rays.1;
    log.numerics.hits_outside_volume += outside;
    log.numerics.non_finite += non_finite;
    log.numerics.light_clamped += light_clamped;
    (captures, occlusion.finish())
}

/// Adds to the file what it does not have yet.
fn save(kind: Kind, probes: &[usize], made: &mut [Made], saving: &mut Saving) {
    let pack = |made: &Made| made.place.is_none().then(|| bytes::pack(&made.capture, &made.filtered));
    let packed: Vec<Option<Vec<u8>>> = made.par_iter().map(pack).collect();
    for ((&probe, made), packed) in probes.iter().zip(made).zip(packed) {
        if let Some(packed) = packed {
            made.place = saving.add_capture(kind, probe, &packed);
        }
    }
}
