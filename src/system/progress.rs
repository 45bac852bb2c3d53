//! Progress bars on standard error, only where a person watches.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Whether and how progress is shown.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    visible: bool,
}

impl Progress {
    /// Shown on terminals unless the user said no.
    pub fn new(wanted: bool) -> Progress {
        Progress { visible: wanted && std::io::stderr().is_terminal() }
    }

    pub fn hidden() -> Progress {
        Progress { visible: false }
    }

    /// A bar for one stage of `length` steps; it goes away with `finish_and_clear`.
    pub fn stage(&self, name: &'static str, length: usize) -> ProgressBar {
        if !self.visible {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(length as u64), ProgressDrawTarget::stderr());
        let style =
            ProgressStyle::with_template("{prefix:>12} {bar:40} {percent:>3} %  {elapsed_precise}, {eta} left {msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.set_prefix(name);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}
