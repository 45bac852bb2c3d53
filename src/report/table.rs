//! Tables on standard output: lined ones on a terminal, plain columns in a pipe.
//!
//! On a terminal no word and no number is broken. A table that is too wide is wrapped between words; where that is not
//! enough rows become columns, and where that is not enough either it is set as several tables below each other.

use std::fmt;

use comfy_table::presets::{NOTHING, UTF8_FULL_CONDENSED};
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table as Renderer, Width};

use crate::system::terminal;

/// How a column is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    /// Words, from the left.
    Text,
    /// Numbers, to the right.
    Number,
}

/// Columns that lines and blanks take around each cell, and the last line.
const CELL_FRAME: usize = 3;
const LAST_LINE: usize = 1;

/// More rows than this make no readable columns.
const MOST_TRANSPOSED: usize = 6;

/// Rows of ready strings: [`crate::system::format`] makes them from numbers.
#[derive(Debug, Clone)]
pub struct Table {
    columns: Vec<(String, Column)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(columns: &[(&str, Column)]) -> Table {
        let columns = columns.iter().map(|(name, kind)| ((*name).to_owned(), *kind)).collect();
        Table { columns, rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it does not have a cell for each column.
    pub fn push<S: Into<String>>(&mut self, row: impl IntoIterator<Item = S>) {
        let row: Vec<String> = row.into_iter().map(Into::into).collect();
        assert_eq!(row.len(), self.columns.len(), "cells in a row");
        self.rows.push(row);
    }

    /// The whole table, without a line end behind it; `width` is that of the terminal, if it goes to one.
    pub fn render(&self, width: Option<usize>) -> String {
        let Some(width) = width else { return self.plain() };
        let is_narrow = |text: &String| text.lines().all(|line| line.chars().count() <= width);
        let natural = self.lined(None);
        if is_narrow(&natural) {
            return natural;
        }
        if self.least_width() <= width {
            return self.lined(Some(width));
        }
        if self.rows.len() <= MOST_TRANSPOSED {
            let transposed = self.transposed();
            if transposed.least_width() <= width {
                return transposed.lined(Some(width));
            }
        }
        let parts: Vec<String> = self.parts(width).iter().map(|part| part.lined(Some(width))).collect();
        parts.join("\n")
    }

    fn plain(&self) -> String {
        let mut renderer = self.renderer();
        renderer.load_style(NOTHING).force_no_tty();
        // Lines that start with a blank are a nuisance to cut and sort.
        renderer.column_iter_mut().take(1).for_each(|first| {
            first.set_padding((0, 1));
        });
        renderer.trim_fmt()
    }

    /// With lines, wrapped between words to a width.
    fn lined(&self, width: Option<usize>) -> String {
        let mut renderer = self.renderer();
        renderer.load_style(UTF8_FULL_CONDENSED.with_rounded_corners()).force_no_tty();
        if let Some(width) = width {
            let columns = u16::try_from(width).unwrap_or(u16::MAX);
            renderer.set_width(columns).set_content_arrangement(ContentArrangement::Dynamic);
            let least: Vec<usize> = (0..self.columns.len()).map(|i| self.least_width_of(i)).collect();
            for (column, least) in renderer.column_iter_mut().zip(least) {
                // With the blanks on both sides.
                let least = u16::try_from(least + CELL_FRAME - LAST_LINE).unwrap_or(u16::MAX);
                column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(least)));
            }
        }
        renderer.trim_fmt()
    }

    fn renderer(&self) -> Renderer {
        let mut renderer = Renderer::new();
        renderer.set_header(self.columns.iter().map(|(name, _)| name));
        for (column, (_, kind)) in renderer.column_iter_mut().zip(&self.columns) {
            column.set_cell_alignment(match kind {
                Column::Text => CellAlignment::Left,
                Column::Number => CellAlignment::Right,
            });
        }
        self.rows.iter().for_each(|row| {
            renderer.add_row(row);
        });
        renderer
    }

    /// The narrowest that a column can be set: the longest word of a text and of the head, the longest number.
    fn least_width_of(&self, column: usize) -> usize {
        let (head, kind) = &self.columns[column];
        let longest_word = |text: &str| text.split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0);
        let of_cell = |row: &Vec<String>| match kind {
            Column::Text => longest_word(&row[column]),
            Column::Number => row[column].chars().count(),
        };
        self.rows.iter().map(of_cell).chain([longest_word(head)]).max().unwrap_or(0)
    }

    fn least_width(&self) -> usize {
        (0..self.columns.len()).map(|i| self.least_width_of(i) + CELL_FRAME).sum::<usize>() + LAST_LINE
    }

    /// Rows as columns; the first cells are the head.
    fn transposed(&self) -> Table {
        let kind = if self.columns.iter().skip(1).any(|(_, kind)| *kind == Column::Number) {
            Column::Number
        } else {
            Column::Text
        };
        let Some(((first, _), others)) = self.columns.split_first() else { return self.clone() };
        let head = |row: &Vec<String>| (row[0].clone(), kind);
        let columns = [(first.clone(), Column::Text)].into_iter().chain(self.rows.iter().map(head)).collect();
        let row = |(i, (name, _)): (usize, &(String, Column))| {
            [name.clone()].into_iter().chain(self.rows.iter().map(|row| row[i + 1].clone())).collect()
        };
        Table { columns, rows: others.iter().enumerate().map(row).collect() }
    }

    /// Tables of the first column and as many others as fit.
    fn parts(&self, width: usize) -> Vec<Table> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for column in 1..self.columns.len() {
            match groups.last_mut() {
                Some(group) if self.of_columns(&[&group[..], &[column]].concat()).least_width() <= width => {
                    group.push(column)
                }
                _ => groups.push(vec![0, column]),
            }
        }
        groups.iter().map(|group| self.of_columns(group)).collect()
    }

    fn of_columns(&self, which: &[usize]) -> Table {
        let columns = which.iter().map(|&i| self.columns[i].clone()).collect();
        let rows = self.rows.iter().map(|row| which.iter().map(|&i| row[i].clone()).collect()).collect();
        Table { columns, rows }
    }
}

/// As standard output wants it.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(terminal::width()))
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

    /// Methods with so many figures.
    fn wide(rows: usize, figures: usize) -> Table {
        let names: Vec<String> = (0..figures).map(|i| format!("figure number {i}")).collect();
        let columns: Vec<(&str, Column)> =
            [("method", Column::Text)].into_iter().chain(names.iter().map(|n| (n.as_str(), Column::Number))).collect();
        let mut table = Table::new(&columns);
        for row in 0..rows {
            let cells = (0..figures).map(|i| format!("{row}.{i:03} %"));
            table.push([format!("method-{row} of some words")].into_iter().chain(cells));
        }
        table
    }

    #[test]
    fn plain_in_a_pipe() {
        let expected = "method             time\nvisibility off  1.25 ms\non                    –";
        assert_eq!(table().render(None), expected);
    }

    #[test]
    fn lined_on_a_terminal() {
        let rendered = table().render(Some(80));
        let lines: Vec<&str> = rendered.lines().collect();
        assert_eq!(lines.len(), 6, "{rendered}");
        assert!(lines[0].starts_with('╭') && lines[0].ends_with('╮'));
        assert!(lines[1].ends_with("   time │"), "{rendered}");
        assert!(lines.iter().all(|line| line.chars().count() == lines[0].chars().count()), "{rendered}");
    }

    /// Every figure stands in one piece, whatever is done to make it fit.
    #[test]
    fn nothing_is_broken_and_nothing_too_wide() {
        for (rows, figures) in [(3, 4), (3, 12), (4, 14), (8, 14), (40, 9)] {
            for width in [60, 80, 120] {
                let table = wide(rows, figures);
                let rendered = table.render(Some(width));
                let widest = rendered.lines().map(|line| line.chars().count()).max().unwrap();
                assert!(widest <= width, "{rows} × {figures} at {width}: {widest}\n{rendered}");
                for cell in table.rows.iter().flat_map(|row| &row[1..]) {
                    assert!(rendered.contains(cell), "{rows} × {figures} at {width}: {cell}\n{rendered}");
                }
                for word in ["method-0", "figure", "number"] {
                    assert!(rendered.contains(word), "{word}\n{rendered}");
                }
            }
        }
    }
}
