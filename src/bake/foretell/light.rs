//! What capturing and bounces take, from some probes.

use std::hint::black_box;

use glam::Vec3A;
use rayon::prelude::*;

use super::parts::Part;
use crate::bake::circumstances::Circumstances;
use crate::bake::gather::{Budgeted, CHUNK_BYTES};
use crate::bake::memory::surfels_bytes;
use crate::bake::prepared::Prepared;
use crate::math::statistics::Moments;
use crate::probe::capture::ProbeCapture;
use crate::probe::store::Occlusion;
use crate::probe::store::kernel::Kernel;
use crate::probe::transport::operator::Operator;
use crate::probe::transport::rows;
use crate::system::processor::processor_seconds;

/// Probes captured.
const PILOT: usize = 24;
/// Rays of all these together.
const PILOT_RAYS: usize = 1 << 21;

/// What capturing and bounces take.
pub struct Light {
    pub capture_s: f64,
    pub bounce_s: f64,
    pub bounces: u32,
    /// Of all captures that are kept somewhere.
    pub bytes: f64,
}

/// Captures some probes of every part, and lights them once.
pub fn of(parts: &[Part], circumstances: &Circumstances, active: f64) -> Light {
    let Some(Part { prepared: first, .. }) = parts.first() else {
        return Light { capture_s: 0.0, bounce_s: 0.0, bounces: 0, bytes: 0.0 };
    };
    let config = first.config;
    let once = config.transport.captures_once();
    // Large captures are alike, and few of them fit into memory.
    let fitting = (CHUNK_BYTES / surfels_bytes(config).max(1)) as usize;
    let quick = PILOT_RAYS / first.capture.rays.count().max(1);
    let most = fitting.min(quick).clamp(1, PILOT);
    let pilots: Vec<Vec<usize>> =
        parts.iter().map(|part| part.prepared.some_probes(most.div_ceil(parts.len())).0).collect();
    let each: Vec<(usize, usize)> =
        pilots.iter().enumerate().flat_map(|(part, probes)| probes.iter().map(move |&probe| (part, probe))).collect();
    // Where parts are more than pilots, only every so manieth has one.
    let each: Vec<(usize, usize)> = each.iter().copied().step_by(each.len().div_ceil(most).max(1)).collect();
    let builders: Vec<_> = parts.iter().map(|part| part.prepared.occlusion_builder()).collect();
    let trace = |&(part, probe): &(usize, usize)| {
        let prepared = &parts[part].prepared;
        let capture = prepared.capture(circumstances);
        let mut captured = match once {
            true => prepared.trace(&capture, probe),
            false => prepared.frame(&capture, probe, 0),
        };
        // Filtered at once, and not kept.
        black_box(prepared.look(&builders[part], probe, &mut captured));
        captured
    };
    // At the first time places of the scene learn which emitters they see: most captures of a bake find that done.
    each.par_iter().map(trace).for_each(drop);
    let started = processor_seconds();
    let traced: Vec<ProbeCapture> = each.par_iter().map(trace).collect();
    let (share, threads) = (active / each.len().max(1) as f64, rayon::current_num_threads() as f64);
    let capture_s = (processor_seconds() - started) * share / threads;
    let has_rows = rows::are_kept(&config.transport, &config.store.irradiance);
    let kept = |c: &ProbeCapture| c.bytes() + if has_rows { rows::most_bytes(c) } else { 0 };
    let bytes = traced.iter().map(kept).sum::<u64>() as f64 * share;
    // Light that is lost at every bounce: what is not reflected, and what leaves the scene.
    let seen: usize = traced.iter().map(|c| c.texels).sum();
    let reflected: Vec3A = traced.iter().flat_map(|c| &c.surfels).map(|s| Vec3A::from(s.albedo())).sum();
    let ratio = f64::from((reflected / seen.max(1) as f32).max_element()).min(f64::from(config.materials.albedo_max));
    let bounces = config.transport.expected_iterations(ratio);

    let mut of_part: Vec<Vec<(usize, ProbeCapture)>> = parts.iter().map(|_| Vec::new()).collect();
    each.iter().zip(traced).for_each(|(&(part, probe), capture)| of_part[part].push((probe, capture)));
    let kernel = first.kernel(&first.volume(Occlusion::None));
    let mut seconds = Moments::default();
    for ((part, captures), builder) in parts.iter().zip(of_part).zip(builders) {
        if !captures.is_empty() {
            seconds.add(one_bounce(&part.prepared, captures, builder.finish(), &kernel, circumstances), 1.0);
        }
    }
    // Where rows fit, all passes together take about as long as asking the surfaces once.
    let passes = if has_rows && config.query.is_linear() && config.query.asks_one_direction() {
        f64::from(bounces.max(1))
    } else {
        1.0
    };
    let bounce_s = seconds.mean() * active / threads / passes;
    // A pilot is captured and solved beforehand; then there are more rays.
    let rough_bounces = config.transport.rough_bounces();
    let guided = first.capture.rays.guided().filter(|_| rough_bounces > 0);
    let (more, pilot_captures, pilot_bounces) = match guided {
        Some((_, per_texel, guided)) => (1.0 + f64::from(guided) / per_texel as f64, 1.0, f64::from(1 + rough_bounces)),
        None => (1.0, 0.0, 0.0),
    };
    Light {
        // Frames are captured anew, and none is kept; a bake counts all their time as capture.
        capture_s: match once {
            true => capture_s * (pilot_captures + more) + pilot_bounces * bounce_s,
            false => f64::from(bounces) * (capture_s + bounce_s),
        },
        bounce_s: if once { bounce_s * more } else { 0.0 },
        bounces,
        bytes: bytes * more,
    }
}

/// Seconds of the processor that one bounce takes at a probe.
fn one_bounce(
    prepared: &Prepared,
    captures: Vec<(usize, ProbeCapture)>,
    occlusion: Occlusion,
    kernel: &Kernel,
    circumstances: &Circumstances,
) -> f64 {
    let probes: Vec<usize> = captures.iter().map(|(probe, _)| *probe).collect();
    let mut stored: Vec<Option<ProbeCapture>> = (0..prepared.grid.probe_count()).map(|_| None).collect();
    captures.into_iter().for_each(|(probe, captured)| stored[probe] = Some(captured));
    let volume = prepared.volume(if prepared.stores_occlusion() { occlusion } else { Occlusion::None });
    let capture = prepared.capture(circumstances);
    let captures = Budgeted::new(stored, prepared, &capture);
    let operator = Operator { captures: &captures, kernel, query: &prepared.config.query, gathers_emission: false };
    operator.time(&volume, &probes) / probes.len().max(1) as f64
}
