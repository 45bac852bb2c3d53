//! Tables on standard output: lined ones on a terminal, plain columns in a pipe.

use std::fmt;
use std::io::IsTerminal;

use comfy_table::presets::{NOTHING, UTF8_FULL_CONDENSED};
use comfy_table::{CellAlignment, ContentArrangement, Table as Renderer};

/// How a column is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    /// Words, from the left.
    Text,
    /// Numbers, to the right.
    Number,
}

/// Rows of ready strings: [`crate::system::format`] makes them from numbers.
#[derive(Debug, Clone)]
pub struct Table(Renderer);

impl Table {
    pub fn new(columns: &[(&str, Column)]) -> Table {
        let mut renderer = Renderer::new();
        renderer.set_header(columns.iter().map(|(name, _)| *name));
        for (column, (_, kind)) in renderer.column_iter_mut().zip(columns) {
            column.set_cell_alignment(match kind {
                Column::Text => CellAlignment::Left,
                Column::Number => CellAlignment::Right,
            });
        }
        Table(renderer)
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it does not have a cell for each column.
    pub fn push<S: Into<String>>(&mut self, row: impl IntoIterator<Item = S>) {
        let row: Vec<String> = row.into_iter().map(Into::into).collect();
        assert_eq!(row.len(), self.0.column_count(), "cells in a row");
        self.0.add_row(row);
    }

    /// The whole table, without a line end behind it. On a terminal cells are wrapped where it is too narrow.
    pub fn render(&self, on_terminal: bool) -> String {
        let mut renderer = self.0.clone();
        if on_terminal {
            renderer
                .load_style(UTF8_FULL_CONDENSED.with_rounded_corners())
                .set_content_arrangement(ContentArrangement::Dynamic);
        } else {
            renderer.load_style(NOTHING).force_no_tty();
            // Lines that start with a blank are a nuisance to cut and sort.
            renderer.column_iter_mut().take(1).for_each(|first| {
                first.set_padding((0, 1));
            });
        }
        renderer.trim_fmt()
    }
}

/// As standard output wants it.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(std::io::stdout().is_terminal()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(&[("method", Column::Text), ("time", Column::Number)]);
        table.push(["visibility off", "1.25 ms"]);
        table.push(["on", "–"]);
        table
    }

    #[test]
    fn plain_in_a_pipe() {
        let expected = "method             time\nvisibility off  1.25 ms\non                    –";
        assert_eq!(table().render(false), expected);
    }

    #[test]
    fn lined_on_a_terminal() {
        let rendered = table().render(true);
        let lines: Vec<&str> = rendered.lines().collect();
        assert_eq!(lines.len(), 6, "{rendered}");
        assert!(lines[0].starts_with('╭') && lines[0].ends_with('╮'));
        assert!(lines[1].ends_with("   time │"), "{rendered}");
        assert!(lines.iter().all(|line| line.chars().count() == lines[0].chars().count()), "{rendered}");
    }
}
