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

/// Lines of at most `width` columns; all but the first begin with `hanging` blanks.
pub fn wrapped(text: &str, width: usize, hanging: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if line.trim().is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(std::mem::replace(&mut line, format!("{:hanging$}{word}", "")));
        }
    }
    lines.push(line);
    lines
}

/// Text whose lines are wrapped between words to the width of the terminal that standard output goes to, if it does.
pub fn fitted(text: &str) -> String {
    width().map_or_else(|| text.to_owned(), |width| fitted_to(text, width))
}

fn fitted_to(text: &str, width: usize) -> String {
    /// Blanks before what belongs to the line above.
    const HANGING: usize = 2;
    let of_line = |line: &str| match line.chars().count() > width {
        true => wrapped(line, width, HANGING),
        false => vec![line.to_owned()],
    };
    text.lines().flat_map(of_line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_long_lines_are_wrapped() {
        assert_eq!(fitted_to("a  b\n  c\none two three", 8), "a  b\n  c\none two\n  three");
        assert_eq!(fitted_to("unbreakable", 8), "unbreakable");
    }
}
