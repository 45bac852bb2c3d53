//! The pilot: a first capture and a rough solution of it, which say where guided rays are worth most.

use rayon::prelude::*;

use super::circumstances::Circumstances;
use super::gather::gather;
use super::log::Log;
use super::prepared::Prepared;
use super::saving::Saving;
use crate::light::sampled::RayCount;
use crate::math::random::Purpose;
use crate::probe::capture::guide::{Guide, Pilot};
use crate::probe::capture::{Capture, CaptureSettings, ProbeCapture};
use crate::probe::lattice::ProbeState;
use crate::probe::store::Occlusion;
use crate::probe::transport::operator::{Captures, Masks, Operator, store};
use crate::probe::{ProbeIndex, Volume};
use crate::system::progress::Progress;

/// A probe that is to get so many rays a texel in the mean is looked at a second time with these rays before they count: its
/// pilot has seen that it sees something small, and little of what that is. In office at 2 m (seven of forty lit probes see
/// light through slits only) the deviation of probes falls from 3.4 to 2.4 % (24² texels, 2 guided rays).
const UNSURE: f32 = 8.0;

impl Prepared<'_, '_> {
    /// Where guided rays go; `None` where there are none.
    pub(super) fn pilot(
        &self,
        circumstances: &Circumstances,
        budget: u64,
        saving: &mut Saving,
        log: &mut Log,
    ) -> Option<Guide> {
        let (side, per_texel, guided) = self.capture.rays.guided()?;
        let bounces = self.config.transport.rough_bounces();
        if bounces == 0 {
            return None;
        }
        let rays = self.capture.rays.unguided();
        let settings = CaptureSettings { rays, emitter_samples: 1, ..self.capture.clone() };
        let capture = Capture { settings: &settings, purpose: Purpose::Pilot, ..self.capture(circumstances) };
        // What breaks here breaks again in the captures that count.
        let mut own = Log::new(Progress::hidden());
        let (captures, occlusion) = gather(self, &capture, budget, saving, &mut own);
        let mut volume = self.volume(if self.plan.visibility { occlusion } else { Occlusion::None });
        let kernel = self.kernel(&volume);
        let operator = Operator {
            captures: &captures,
            kernel: &kernel,
            query: &self.config.query,
            gathers_emission: self.config.capture.gathers_emission(),
        };
        let masks = own.time(|times| &mut times.bounces, || solve_roughly(&operator, bounces, &mut volume));
        let solid_angles: Vec<f32> =
            self.capture.rays.directions().texel_means().into_iter().map(|(_, angle)| angle).collect();
        // What surfels see of their probes need not be looked up where that is known.
        let read = |p: usize, capture: &ProbeCapture, masks: &[u8]| {
            let mask = |i: usize| Some(masks.get(i).copied().unwrap_or(0));
            let radiance = operator.outgoing(&volume, p, capture, mask, true).0;
            (self.grid.stream(ProbeIndex(p as u32)) as usize, Pilot::new(&radiance, &solid_angles, side))
        };
        let is_active = |p: usize| self.placement.states[p] == ProbeState::Active;
        let read_all = || {
            let of_probe = |p: usize| is_active(p).then(|| captures.with(p, |capture| read(p, capture, masks.of(p))));
            (0..self.grid.probe_count()).into_par_iter().map(of_probe).collect::<Vec<_>>()
        };
        let mut pilots = own.time(|times| &mut times.bounces, read_all);
        let guide = |pilots: &[_]| Guide::new(pilots, &self.placement.asked, per_texel, guided, circumstances.seed);
        let first = guide(&pilots);
        let unsure: Vec<usize> = (0..pilots.len()).filter(|&p| first.mean(p) >= UNSURE * per_texel as f32).collect();
        let again = Capture { guide: Some(&first), purpose: Purpose::SecondPilot, ..capture };
        let look_again = |&p: &usize| {
            let capture = self.trace(&again, p);
            (p, read(p, &capture, &[]), capture.rays)
        };
        let second: Vec<(usize, (usize, Pilot), RayCount)> =
            own.time(|times| &mut times.capture, || unsure.par_iter().map(look_again).collect());
        for (p, pilot, rays) in second {
            pilots[p] = Some(pilot);
            own.rays.primary += rays.primary;
            own.rays.shadow += rays.shadow;
        }
        log.times.capture += own.times.capture;
        log.times.bounces += own.times.bounces;
        log.rays.primary += own.rays.primary;
        log.rays.shadow += own.rays.shadow;
        Some(guide(&pilots))
    }
}

/// A few plain bounces; what surfels see of their probes.
fn solve_roughly<C: Captures>(operator: &Operator<C>, bounces: u32, volume: &mut Volume) -> Masks {
    let direct = operator.apply(volume, None).0;
    store(volume, &direct);
    let masks = operator.masks(volume);
    for _ in 1..bounces {
        let next = operator.apply(volume, Some(&masks)).0;
        store(volume, &next);
    }
    masks
}
