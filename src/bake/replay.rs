//! The capture's rays once more, with nothing but Embree.

use std::time::Instant;

use rayon::prelude::*;

use super::circumstances::Circumstances;
use super::gather::CHUNK;
use super::prepared::Prepared;
use crate::probe::capture::Capture;

impl Prepared<'_, '_> {
    /// Rays per second of bare Embree over the rays of the capture, in its order.
    pub fn raw_rays_per_s(&self, circumstances: &Circumstances) -> Option<f64> {
        let expected = self.expected();
        let capture = Capture { expected: expected.as_ref(), ..self.capture(circumstances) };
        let active = self.active();
        let bar = circumstances.progress.stage("raw rays", active.len());
        let (mut rays, mut seconds) = (0usize, 0.0);
        for chunk in active.chunks(CHUNK) {
            self.world.tracer.set_recording(true);
            let record = |&probe: &usize| self.world.tracer.record(|| drop(self.trace(&capture, probe)));
            let logs: Vec<_> = chunk.par_iter().map(record).collect();
            self.world.tracer.set_recording(false);
            let started = Instant::now();
            logs.par_iter().for_each(|log| self.world.tracer.replay(log));
            seconds += started.elapsed().as_secs_f64();
            rays += logs.iter().map(|l| l.len()).sum::<usize>();
            bar.inc(chunk.len() as u64);
        }
        bar.finish_and_clear();
        (seconds > 0.0).then(|| rays as f64 / seconds)
    }
}
