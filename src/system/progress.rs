//! Progress bars on standard error. They appear only on a terminal, and are never wider than it.

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Steps of a stage whose end is known by another measure than a count, see [`Progress::stage`].
pub const FINE_STEPS: u64 = 1000;

/// What is left is told from this share and this time on: before, it is a guess.
const LEAST_SHARE: f32 = 0.05;
const LEAST_TIME: Duration = Duration::from_secs(2);

/// Whether progress bars are shown.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    visible: bool,
}

impl Progress {
    /// Bars are shown if they are `wanted` and standard error is a terminal.
    pub fn new(wanted: bool) -> Progress {
        Progress { visible: wanted && std::io::stderr().is_terminal() }
    }

    pub fn hidden() -> Progress {
        Progress { visible: false }
    }

    /// A bar for one stage of `length` steps. `finish_and_clear` removes it. A stage of one step tells nothing while it runs:
    /// it gets a clock and no bar, until `set_length` says how much there is.
    pub fn stage(&self, name: &'static str, length: usize) -> ProgressBar {
        if !self.visible {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(length as u64), ProgressDrawTarget::stderr());
        let template = if length > 1 { BAR } else { CLOCK };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.with_key("left", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                // Writing to the bar's own text cannot fail.
                let _ = out.write_str(&left(state.fraction(), state.elapsed(), state.eta()));
            }));
        }
        bar.set_prefix(name);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}

const BAR: &str = "{prefix:>12} {wide_bar} {percent:>3} %  {elapsed_precise}{left} {msg}";
const CLOCK: &str = "{prefix:>12} {spinner} {elapsed_precise} {wide_msg}";

/// What is left in words, where that is known.
fn left(share: f32, elapsed: Duration, eta: Duration) -> String {
    if !(LEAST_SHARE..1.0).contains(&share) || elapsed < LEAST_TIME {
        return String::new();
    }
    let seconds = eta.as_secs();
    let mut text = ", ".to_owned();
    // Writing to a string cannot fail.
    let _ = match seconds {
        // What takes no time is not worth a word.
        0 => return String::new(),
        1..60 => write!(text, "{seconds} s left"),
        60..3600 => write!(text, "{} min left", seconds.div_ceil(60)),
        _ => write!(text, "{:.1} h left", seconds as f64 / 3600.0),
    };
    text
}

/// How far a quantity has come that falls by factors from `first` to `last`, of [`FINE_STEPS`].
pub fn steps_of_decay(first: f64, now: f64, last: f64) -> u64 {
    let whole = (first / last).ln();
    let done = (first / now).ln();
    let share = if whole > 0.0 && done.is_finite() { done / whole } else { 0.0 };
    (share.clamp(0.0, 1.0) * FINE_STEPS as f64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_foretold_early() {
        let second = Duration::from_secs;
        assert_eq!(left(0.01, second(10), second(990)), "");
        assert_eq!(left(0.5, second(1), second(1)), "");
        assert_eq!(left(0.5, second(30), second(30)), ", 30 s left");
        assert_eq!(left(0.5, second(90), second(61)), ", 2 min left");
        assert_eq!(left(1.0, second(90), second(0)), "");
    }

    #[test]
    fn a_residual_falls_in_equal_steps_by_equal_factors() {
        assert_eq!(steps_of_decay(1.0, 1.0, 1e-4), 0);
        assert_eq!(steps_of_decay(1.0, 1e-2, 1e-4), FINE_STEPS / 2);
        assert_eq!(steps_of_decay(1.0, 1e-9, 1e-4), FINE_STEPS);
        assert_eq!((steps_of_decay(0.0, 0.0, 1e-4), steps_of_decay(1e-5, 1e-6, 1e-4)), (0, 0));
    }
}
