//! Times of several runs of the same work.

use serde::Serialize;

#[derive(Debug, Clone, Copy, Serialize)]
pub struct Timing {
    pub min: f64,
    pub median: f64,
    pub max: f64,
    pub runs: usize,
}

impl Timing {
    /// Of at least one value.
    pub fn of(mut values: Vec<f64>) -> Timing {
        values.sort_by(f64::total_cmp);
        let at = |i: usize| values.get(i).copied().unwrap_or(f64::NAN);
        Timing { min: at(0), median: at(values.len() / 2), max: at(values.len().saturating_sub(1)), runs: values.len() }
    }
}
