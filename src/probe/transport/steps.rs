//! How far iterations have come, for who watches them.

use super::settings::Transport;
use crate::system::progress::{FINE_STEPS, steps_of_decay};

impl Transport {
    /// Of [`FINE_STEPS`], after so many iterations, whose residual has fallen from `first` to `now`.
    pub fn steps_done(&self, first: f64, now: f64, iterations: usize) -> u64 {
        let of_most = || FINE_STEPS * iterations as u64 / u64::from(self.most().max(1));
        let tolerance = match self {
            Transport::Frames(_) => return of_most(),
            Transport::Tracing(settings) => settings.tolerance,
            Transport::Bounces(_) | Transport::InOrder(_) | Transport::Paths { .. } => self.iteration().tolerance,
        };
        // Whichever ends them first.
        steps_of_decay(first, now, f64::from(tolerance)).max(of_most()).min(FINE_STEPS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::transport::BounceSettings;

    #[test]
    fn the_residual_or_the_limit_decides() {
        let bounces = |tolerance, max_bounces| {
            Transport::Bounces(BounceSettings { tolerance, max_bounces, ..BounceSettings::default() })
        };
        // The logarithms of f32 fall short of halfway by less than a step.
        assert!((FINE_STEPS / 2 - 1..=FINE_STEPS / 2).contains(&bounces(1e-4, None).steps_done(1.0, 1e-2, 3)));
        assert_eq!(bounces(1e-4, Some(4)).steps_done(1.0, 0.9, 3), 3 * FINE_STEPS / 4);
        assert_eq!(bounces(1e-4, None).steps_done(0.0, 0.0, 0), 0);
    }
}
