//! Progress bars on standard error. They appear only on a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

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

    /// A bar for one stage of `length` steps. `finish_and_clear` removes it.
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
