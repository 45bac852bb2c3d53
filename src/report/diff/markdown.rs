//! The comparison as a comment under a pull request.

use std::fmt::Write;

use super::DiffReport;
use super::gate::Gate;
use crate::report::words::{in_unit, margin, of_side, outcome};
use crate::system::format;

/// GitHub takes comments of 65,536 characters; this leaves room for what a job writes around it.
const MAX_BYTES: usize = 60_000;

/// Gates that are shown although they pass, the closest first.
const CLOSEST: usize = 10;

/// Rows of any one table: beyond them the files say more.
const MOST_ROWS: usize = 60;

const GATES: &str =
    "| gate | of | base | candidate | difference | threshold | margin | from |\n|---|---|--:|--:|--:|--:|--:|---|\n";

/// The whole text.
pub fn text(report: &DiffReport) -> String {
    let mark = if report.verdict.passed { "✅" } else { "❌" };
    let mut out = format!("## {mark} lightprobe: {}\n\n", words(&report.verdict.sentence));
    let side = |path: &str, kind: &str| format!("{} ({kind})", code(path));
    let _ = writeln!(
        out,
        "{} → {}\n",
        side(&report.base.path, &report.base.kind),
        side(&report.candidate.path, &report.candidate.kind)
    );
    let failing: Vec<&Gate> = report.gates.iter().filter(|g| g.fails() || g.waived).collect();
    let passing: Vec<&Gate> = report.gates.iter().filter(|g| !g.fails() && !g.waived && g.is_judged()).collect();
    if !failing.is_empty() {
        out += GATES;
        rows(&mut out, &failing);
        for gate in failing.iter().take(CLOSEST) {
            let _ = writeln!(out, "* **{}**: {}", words(&gate.title()), words(&gate.explanation));
        }
        out.push('\n');
    }
    let (closest, rest) = passing.split_at(passing.len().min(CLOSEST));
    if !closest.is_empty() {
        let _ = writeln!(out, "Closest to their thresholds:\n");
        out += GATES;
        rows(&mut out, closest);
    }
    let mut folded: Vec<(String, String)> = Vec::new();
    if !rest.is_empty() {
        let mut body = GATES.to_owned();
        rows(&mut body, rest);
        folded.push((format!("{} more gates that pass", rest.len()), body));
    }
    let shown: Vec<&Gate> = report.gates.iter().filter(|g| !g.is_judged()).collect();
    if !shown.is_empty() {
        let mut body = GATES.to_owned();
        rows(&mut body, &shown);
        folded.push((format!("{} figures that are shown and not judged", shown.len()), body));
    }
    folded.extend(images(report));
    folded.extend(probes(report));
    folded.extend(changes(report));
    let commands: String = report.commands.iter().map(|c| format!("    {}\n", c.line)).collect();
    folded.push(("How to get this again".to_owned(), commands));
    for (title, body) in folded {
        let block = format!("<details><summary>{title}</summary>\n\n{body}\n</details>\n\n");
        // Whole blocks only: half a table is none.
        if out.len() + block.len() <= MAX_BYTES {
            out += &block;
        }
    }
    out
}

fn rows(out: &mut String, gates: &[&Gate]) {
    for gate in gates.iter().take(MOST_ROWS) {
        let error = gate.standard_error.filter(|_| gate.value.is_some());
        let error = error.map_or(String::new(), |e| format!(" ± {}", format::significant(e, 2)));
        let _ = writeln!(
            out,
            "| {} {} | {} | {} | {} | {}{error} | {} | {} | {} |",
            outcome(gate),
            code(&gate.name),
            cell(&gate.item),
            of_side(gate.base, gate.unit),
            of_side(gate.candidate, gate.unit),
            in_unit(gate.value, gate.unit),
            in_unit(gate.threshold, gate.unit),
            margin(gate),
            cell(&gate.source),
        );
    }
    if gates.len() > MOST_ROWS {
        let _ = writeln!(out, "\n… and {} more, in `diff.json`.", gates.len() - MOST_ROWS);
    }
    out.push('\n');
}

fn images(report: &DiffReport) -> Option<(String, String)> {
    if report.images.is_empty() {
        return None;
    }
    let mut body = "| image | mean | rmse | psnr | FLIP | worst pixel |\n|---|--:|--:|--:|--:|---|\n".to_owned();
    for image in report.images.iter().take(MOST_ROWS) {
        let number = |value| format::or_undefined(value, |v| format::significant(v, 3));
        let worst = image.worst.map_or(format::UNDEFINED.to_owned(), |w| format!("({}, {})", w.x, w.y));
        let _ = writeln!(
            body,
            "| {} | {} → {} | {} | {} | {} | {worst} |",
            cell(&image.item),
            number(image.mean_base),
            number(image.mean_candidate),
            number(image.rmse),
            format::or_undefined(image.psnr_db, |v| format!("{} dB", format::significant(v, 3))),
            number(image.flip.map(|f| f.mean)),
        );
    }
    Some((format!("{} images", report.images.len()), body))
}

fn probes(report: &DiffReport) -> Option<(String, String)> {
    let mut body = String::new();
    for probes in &report.probes {
        let _ = writeln!(
            body,
            "{}{} probes compared, {} added, {} removed, {} moved, {} flipped. The worst:\n",
            if probes.item.is_empty() { String::new() } else { format!("{}: ", cell(&probes.item)) },
            probes.compared,
            probes.added,
            probes.removed,
            probes.moved,
            probes.flipped
        );
        body += "| probe | at, m | base | candidate | changed by |\n|--:|---|--:|--:|--:|\n";
        for row in &probes.worst {
            let [x, y, z] = row.position_m;
            let _ = writeln!(
                body,
                "| {} | {x:.2}, {y:.2}, {z:.2} | {} | {} | {} |",
                row.index,
                format::significant(row.irradiance_base, 3),
                format::significant(row.irradiance_candidate, 3),
                format::percent(row.irradiance_difference_relative),
            );
        }
        body.push('\n');
    }
    (!body.is_empty()).then(|| ("Probes".to_owned(), body))
}

fn changes(report: &DiffReport) -> Option<(String, String)> {
    if report.config_changes.is_empty() {
        return None;
    }
    let mut body = "| configuration | base | candidate |\n|---|---|---|\n".to_owned();
    let value = |v: &Option<String>| v.as_deref().map_or(format::UNDEFINED.to_owned(), code);
    for change in report.config_changes.iter().take(MOST_ROWS) {
        let _ = writeln!(body, "| {} | {} | {} |", code(&change.key), value(&change.base), value(&change.candidate));
    }
    Some(("What the configurations differ in".to_owned(), body))
}

/// Words in running text: names come from files, and files from anywhere.
fn words(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '&' => out += "&amp;",
            '\n' | '\r' => out.push(' '),
            '*' | '_' | '`' | '[' | ']' | '\\' | '|' | '@' | '#' => {
                out.push('\\');
                out.push(c);
            }
            _ => out.push(c),
        }
    }
    out
}

fn cell(text: &str) -> String {
    if text.is_empty() { "all".to_owned() } else { words(text) }
}

/// Text as it stands.
fn code(text: &str) -> String {
    // Neither a fence nor a column may end in it.
    format!("`{}`", text.replace('`', "'").replace('|', "¦").replace(['\n', '\r'], " "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hostile_names_stay_words() {
        assert_eq!(words("<script>*a|b@c"), "&lt;script&gt;\\*a\\|b\\@c");
        assert_eq!(code("a`b|c\n"), "`a'b¦c `");
    }
}
