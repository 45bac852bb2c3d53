//! A case is a row of the table: what was checked, the figure, its bound, and whether it holds.

use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex};

use libtest_mimic::{Failed, Trial};
use serde::Serialize;

/// What a figure must be.
#[derive(Debug, Clone, Copy)]
pub enum Bound {
    AtMost(f64),
    AtLeast(f64),
}

impl Bound {
    fn holds(self, figure: f64) -> bool {
        match self {
            // A figure that is no number holds nowhere.
            Bound::AtMost(bound) => figure <= bound,
            Bound::AtLeast(bound) => figure >= bound,
        }
    }
}

/// What a case found.
pub struct Found {
    pub figure: f64,
    /// More to say about it than the figure; empty where there is nothing.
    pub note: String,
}

impl From<f64> for Found {
    fn from(figure: f64) -> Found {
        Found { figure, note: String::new() }
    }
}

/// One row.
pub struct Case {
    /// What is extreme.
    pub group: &'static str,
    pub name: String,
    /// What the figure is.
    pub checked: &'static str,
    pub unit: &'static str,
    pub bound: Bound,
    pub measure: Box<dyn FnOnce() -> Found + Send>,
}

impl Case {
    pub fn new<F: Into<Found>>(
        group: &'static str,
        name: impl Into<String>,
        checked: &'static str,
        bound: Bound,
        measure: impl FnOnce() -> F + Send + 'static,
    ) -> Case {
        Case { group, name: name.into(), checked, unit: "", bound, measure: Box::new(|| measure().into()) }
    }

    pub fn in_unit(self, unit: &'static str) -> Case {
        Case { unit, ..self }
    }
}

/// A result that several rows look at, made when the first asks for it.
pub type Shared<T> = Arc<LazyLock<T, Box<dyn FnOnce() -> T + Send>>>;

pub fn shared<T>(make: impl FnOnce() -> T + Send + 'static) -> Shared<T> {
    Arc::new(LazyLock::new(Box::new(make)))
}

#[derive(Debug, Clone, Serialize)]
struct Row {
    group: &'static str,
    name: String,
    checked: &'static str,
    /// Absent where it could not be found, for a panic.
    figure: Option<f64>,
    unit: &'static str,
    relation: &'static str,
    bound: f64,
    note: String,
    holds: bool,
}

/// The rows as they are found.
#[derive(Default)]
pub struct Table(Arc<Mutex<Vec<Row>>>);

impl Table {
    /// The case as a test that enters its row.
    pub fn trial(&self, case: Case) -> Trial {
        let Case { group, name, checked, unit, bound, measure } = case;
        let (relation, limit) = match bound {
            Bound::AtMost(limit) => ("≤", limit),
            Bound::AtLeast(limit) => ("≥", limit),
        };
        let title = format!("{group} · {name} · {checked}");
        let blank =
            Row { group, name, checked, figure: None, unit, relation, bound: limit, note: String::new(), holds: false };
        let rows = Arc::clone(&self.0);
        let place = {
            let mut rows = rows.lock().expect("no other panics while it holds the table");
            rows.push(blank);
            rows.len() - 1
        };
        Trial::test(title, move || {
            let Found { figure, note } = measure();
            let holds = bound.holds(figure);
            let mut rows = rows.lock().expect("no other panics while it holds the table");
            let row = &mut rows[place];
            (row.figure, row.note, row.holds) = (figure.is_finite().then_some(figure), note.clone(), holds);
            if holds {
                Ok(())
            } else {
                Err(Failed::from(format!("{figure:.4e}{unit} is not {relation} {limit}{unit} {note}")))
            }
        })
    }

    /// Writes the rows as JSON.
    pub fn write(&self, path: &Path) {
        let rows = self.0.lock().expect("no other panics while it holds the table");
        let table = serde_json::json!({ "schema": "lightprobe-stability/1", "cases": *rows });
        let text = serde_json::to_string_pretty(&table).expect("plain records");
        std::fs::write(path, text + "\n").unwrap_or_else(|e| panic!("cannot write {}: {e}", path.display()));
    }
}
