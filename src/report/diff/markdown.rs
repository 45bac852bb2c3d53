//! The comparison as a comment under a pull request, by the template `assets/diff.md`.

use minijinja::value::Serde;
use minijinja::{Environment, Value, context};

use super::report::DiffReport;
use crate::report::gate::Gate;
use crate::report::words::{in_unit, margin, of_side, outcome, value};
use crate::system::format;

const TEMPLATE: &str = include_str!("../assets/diff.md");

/// GitHub takes comments of 65,536 characters; this leaves room for what a job writes around it.
const MAX_BYTES: usize = 60_000;

/// Gates that are shown although they pass, the closest first.
const CLOSEST: usize = 10;

/// Rows of any one table: beyond them the files say more.
const MOST_ROWS: usize = 60;

/// What ends a block that the text can do without.
const END: &str = "</details>\n";

/// The whole text.
///
/// # Errors
/// None in practice: the template is part of the program.
pub fn text(report: &DiffReport) -> Result<String, minijinja::Error> {
    let mut environment = Environment::new();
    environment.add_filter("words", words);
    environment.add_filter("code", code);
    environment.add_filter("cell", |text: &str| if text.is_empty() { "all".to_owned() } else { words(text) });
    environment.add_filter("short", |number: Option<f64>| format::or_undefined(number, |v| format::significant(v, 3)));
    let gates = |is: fn(&Gate) -> bool| report.gates.iter().filter(|gate| is(gate)).map(view).collect::<Vec<_>>();
    let text = environment.render_str(
        TEMPLATE,
        context! {
            report => Value::from(Serde(report)),
            failing => gates(|gate| gate.fails() || gate.waived),
            passing => gates(|gate| gate.is_judged() && gate.passed),
            unjudged => gates(|gate| !gate.is_judged()),
            rows => MOST_ROWS,
            closest => CLOSEST,
        },
    )?;
    // Whole blocks only: half a table is none.
    let mut short = String::new();
    for block in text.split_inclusive(END) {
        if short.len() + block.len() <= MAX_BYTES {
            short += block;
        }
    }
    Ok(short + "\n")
}

fn view(gate: &Gate) -> Value {
    let error = gate.standard_error.filter(|_| gate.value.is_some());
    let error = error.map_or(String::new(), |error| format!(" ± {}", format::significant(error, 2)));
    context! {
        outcome => outcome(gate),
        title => gate.title(),
        base => of_side(gate.base, gate.side_unit),
        candidate => of_side(gate.candidate, gate.side_unit),
        value => value(gate) + &error,
        threshold => in_unit(gate.threshold, gate.unit),
        margin => margin(gate),
        ..Value::from(Serde(gate))
    }
}

/// Words in running text: names come from files, and files from anywhere.
fn words(text: &str) -> String {
    let word = |c: char| match c {
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '&' => "&amp;".to_owned(),
        '\n' | '\r' => " ".to_owned(),
        '*' | '_' | '`' | '[' | ']' | '\\' | '|' | '@' | '#' => format!("\\{c}"),
        _ => c.to_string(),
    };
    text.chars().map(word).collect()
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
