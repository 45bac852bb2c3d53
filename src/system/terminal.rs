//! The terminal that standard output goes to.

use std::io::IsTerminal;

/// Columns that a terminal is taken to have where it does not say.
const USUAL_WIDTH: usize = 80;

/// Columns of the terminal; `None` where standard output is a file or a pipe.
pub fn width() -> Option<usize> {
    let output = std::io::stdout();
    if !output.is_terminal() {
        return None;
    }
    let size = terminal_size::terminal_size_of(&output);
    Some(size.map_or(USUAL_WIDTH, |(terminal_size::Width(columns), _)| usize::from(columns)))
}
