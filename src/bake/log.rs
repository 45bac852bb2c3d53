//! What a bake writes down about itself while it runs: times, rays, numbers that broke.

use std::time::Instant;

use indicatif::ProgressBar;

use super::figures::{Numerics, Rays, Times};
use crate::system::progress::Progress;

pub struct Log {
    pub times: Times,
    pub rays: Rays,
    pub numerics: Numerics,
    progress: Progress,
}

impl Log {
    pub fn new(progress: Progress) -> Log {
        Log { times: Times::default(), rays: Rays::default(), numerics: Numerics::default(), progress }
    }

    /// Runs a stage with a bar of `length` steps and adds its seconds to the time that `time` picks.
    pub fn stage<T>(
        &mut self,
        time: impl FnOnce(&mut Times) -> &mut f64,
        name: &'static str,
        length: usize,
        run: impl FnOnce(&ProgressBar) -> T,
    ) -> T {
        let bar = self.progress.stage(name, length);
        let result = self.time(time, || run(&bar));
        bar.finish_and_clear();
        result
    }

    /// Runs something short and adds its seconds to the time that `time` picks.
    pub fn time<T>(&mut self, time: impl FnOnce(&mut Times) -> &mut f64, run: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = run();
        *time(&mut self.times) += started.elapsed().as_secs_f64();
        result
    }
}
