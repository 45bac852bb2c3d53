//! The pilot: a first capture and a rough solution of it, which say where guided rays are worth most.

use rayon::prelude::*;

use super::circumstances::Circumstances;
use super::gather::gather;
use super::log::Log;
use super::prepared::Prepared;
use crate::math::random::Purpose;
use crate::probe::capture::guide::{Guide, Pilot};
use crate::probe::capture::{Capture, CaptureSettings};
use crate::probe::lattice::ProbeState;
use crate::probe::store::Occlusion;
use crate::probe::transport::operator::{Captures, Operator, store};
use crate::probe::{ProbeIndex, Volume};
use crate::system::progress::Progress;

impl Prepared<'_, '_> {
    /// Where guided rays go; `None` where no rays are guided.
    pub(super) fn pilot(&self, circumstances: &Circumstances, log: &mut Log) -> Option<Guide> {
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
        let (captures, occlusion) = gather(self, &capture, circumstances, &mut own);
        let mut volume = self.volume(if self.plan.visibility { occlusion } else { Occlusion::None });
        let solve = || {
            let kernel = self.kernel(&volume);
            let operator = Operator {
                captures: &captures,
                kernel: &kernel,
                query: &self.config.query,
                gathers_emission: self.config.capture.gathers_emission(),
            };
            let direct = operator.apply(&volume, None).0;
            store(&mut volume, &direct);
            let masks = operator.masks(&volume);
            for _ in 1..bounces {
                let next = operator.apply(&volume, Some(&masks)).0;
                store(&mut volume, &next);
            }
            self.pilots(&operator, &volume, side)
        };
        let pilots = log.time(|times| &mut times.bounces, solve);
        log.times.capture += own.times.capture;
        log.rays.primary += own.rays.primary;
        log.rays.shadow += own.rays.shadow;
        Some(Guide::new(pilots, &self.placement.asked, per_texel, guided, circumstances.seed))
    }

    /// What every active probe's texels hold, with what numbers the probe's random sequences.
    fn pilots<C: Captures>(&self, operator: &Operator<C>, volume: &Volume, side: usize) -> Vec<Option<(usize, Pilot)>> {
        let solid_angles: Vec<f32> =
            self.capture.rays.directions().texel_means().into_iter().map(|(_, angle)| angle).collect();
        let of_probe = |p: usize| {
            (self.placement.states[p] == ProbeState::Active).then(|| {
                let radiance =
                    operator.captures.with(p, |capture| operator.outgoing(volume, p, capture, |_| Some(0), true).0);
                (self.grid.stream(ProbeIndex(p as u32)) as usize, Pilot::new(&radiance, &solid_angles, side))
            })
        };
        (0..self.grid.probe_count()).into_par_iter().map(of_probe).collect()
    }
}
