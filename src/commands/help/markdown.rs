//! Markdown of the READMEs as text for a terminal: wrapped, tables set or taken apart, pictures left out.

use crate::system::terminal::wrapped;

/// Columns between the cells of a table.
const GAP: usize = 2;

/// Blanks before code, and before what belongs to the line above.
const INDENT: usize = 4;

/// Text of at most `width` columns, but for code and words that are longer.
pub fn text(markdown: &str, width: usize) -> String {
    let mut out = Vec::new();
    let mut lines = markdown.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with("```") {
            out.extend(lines.by_ref().take_while(|l| !l.starts_with("```")).map(|l| format!("{:INDENT$}{l}", "")));
        } else if line.starts_with('|') {
            let mut rows = vec![cells(line)];
            while let Some(row) = lines.next_if(|l| l.starts_with('|')) {
                rows.push(cells(row));
            }
            out.extend(table(&rows, width));
        } else if line.starts_with('#') {
            let title = plain(line.trim_start_matches('#').trim());
            let rule = if line.starts_with("##") { "-" } else { "=" };
            let rule = rule.repeat(title.chars().count());
            out.extend([title, rule]);
        } else if line.starts_with("![") || line.starts_with("<!--") {
            // What a terminal does not show leaves no gap either.
            lines.next_if(|next| next.is_empty());
        } else {
            let hanging = if line.starts_with("* ") { 2 } else { number_of_list(line) };
            out.extend(wrapped(&plain(line), width, hanging));
        }
    }
    out.join("\n")
}

/// Columns of a list's number with its point and blank, 0 where the line has none.
fn number_of_list(line: &str) -> usize {
    let digits = line.chars().take_while(char::is_ascii_digit).count();
    if digits > 0 && line[digits..].starts_with(". ") { digits + 2 } else { 0 }
}

/// Without the marks of bold text, emphasis and links; names keep their quotes.
fn plain(text: &str) -> String {
    let text = text.replace("**", "").replace("\\|", "|");
    let (mut out, mut rest) = (String::new(), text.as_str());
    while let Some(found) = link(rest) {
        let (before, name, target, after) = found;
        out.push_str(before);
        out.push_str(name);
        if target.starts_with("http") {
            out.push_str(&format!(" ({target})"));
        }
        rest = after;
    }
    out + rest
}

/// Text before the first link, its name, its target, and the text behind it.
fn link(text: &str) -> Option<(&str, &str, &str, &str)> {
    let middle = text.find("](")?;
    let start = text[..middle].rfind('[')?;
    let length = text[middle..].find(')')?;
    let target = &text[middle + 2..middle + length];
    Some((&text[..start], &text[start + 1..middle], target, &text[middle + length + 1..]))
}

/// The cells of a row; `\|` is no border.
fn cells(row: &str) -> Vec<String> {
    const HELD: &str = "\u{0}";
    let row = row.trim().trim_start_matches('|').replace("\\|", HELD);
    let row = row.strip_suffix('|').unwrap_or(&row);
    row.split('|').map(|cell| plain(&cell.trim().replace(HELD, "|"))).collect()
}

/// Columns where they fit; else each row as its first cell with the others below it.
fn table(rows: &[Vec<String>], width: usize) -> Vec<String> {
    let is_rule = |row: &[String]| row.iter().all(|cell| !cell.is_empty() && cell.chars().all(|c| "-:".contains(c)));
    let rows: Vec<&Vec<String>> = rows.iter().filter(|row| !is_rule(row)).collect();
    let Some((head, body)) = rows.split_first() else { return Vec::new() };
    let widest = |i: usize| rows.iter().filter_map(|r| r.get(i)).map(|c| c.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(widest).collect();
    if widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1) <= width {
        let set = |row: &Vec<String>| {
            let cells = row.iter().zip(&widths).map(|(cell, &w)| format!("{cell:w$}"));
            cells.collect::<Vec<_>>().join(&" ".repeat(GAP)).trim_end().to_owned()
        };
        return rows.iter().map(|row| set(row)).collect();
    }
    let mut out = Vec::new();
    for row in body {
        let mut cells = row.iter().zip(head.iter());
        let Some((first, _)) = cells.next() else { continue };
        out.extend(wrapped(first, width, INDENT));
        for (cell, name) in cells.filter(|(cell, _)| !cell.is_empty()) {
            let cell = if row.len() > 2 { format!("{name}: {cell}") } else { cell.clone() };
            let lines = wrapped(&cell, width.saturating_sub(INDENT), 0);
            out.extend(lines.into_iter().map(|line| format!("{:INDENT$}{line}", "")));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_lists_and_code() {
        let markdown = "# Title\n\n* **Bold** words that [wrap](a.md) here.\n\n```sh\na very long line of code\n```\n![](a.png)\n\nEnd";
        let expected = "Title\n=====\n\n* Bold words\n  that wrap\n  here.\n\n    a very long line of code\nEnd";
        assert_eq!(text(markdown, 12), expected);
    }

    #[test]
    fn tables_are_set_or_taken_apart() {
        let markdown = "| a \\| b | c |\n|---|--:|\n| long words | 1 |\n";
        assert_eq!(text(markdown, 20), "a | b       c\nlong words  1");
        assert_eq!(text(markdown, 10), "long words\n    1");
        let markdown = "| a | b | c | d |\n|-|-|-|-|\n| x | 10 | 20 | 30 |";
        assert_eq!(text(markdown, 13), "a  b   c   d\nx  10  20  30");
        assert_eq!(text(markdown, 10), "x\n    b: 10\n    c: 20\n    d: 30");
    }
}
