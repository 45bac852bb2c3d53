//! Methods at equal cost: on the same grid, or along their ladders at the same number of bytes.

use super::front::interpolate;
use super::ladder::Ladder;
use crate::report::sweep::{
    AxisValue, BudgetEntry, ConfigurationReport, EqualBudget, EqualEntry, EqualReport, EqualSet, LadderReport,
};

/// Gives every configuration the grid of the first one with the same values of the axes; placement and refinement are the
/// method's own.
pub fn share_positions(ladders: &mut [Ladder]) {
    for at in 1..ladders.len() {
        let (before, rest) = ladders.split_at_mut(at);
        for rung in &mut rest[0].rungs {
            let model = before.iter().flat_map(|ladder| &ladder.rungs).find(|model| model.axes == rung.axes);
            if let Some(model) = model {
                rung.config.grid = model.config.grid.clone();
            }
        }
    }
}

fn mean(configuration: &ConfigurationReport, figure: &str) -> Option<f64> {
    configuration.figures.get(figure)?.typical()
}

/// Configurations with the same values of the axes beside each other.
pub fn positions(ladders: &[LadderReport], configurations: &[ConfigurationReport]) -> EqualReport {
    let mut sets: Vec<EqualSet> = Vec::new();
    for (i, configuration) in configurations.iter().enumerate() {
        let axes: &[AxisValue] = &configuration.axes;
        let at = match sets.iter().position(|set| set.axes == axes) {
            Some(at) => at,
            None => {
                sets.push(EqualSet { axes: axes.to_vec(), entries: Vec::new() });
                sets.len() - 1
            }
        };
        let first = sets[at].entries.first().map_or(i, |entry| entry.configuration);
        let hashes = |k: usize| configurations[k].runs.iter().map(|run| &run.probes_blake3);
        sets[at].entries.push(EqualEntry {
            method: ladders[configuration.ladder].name.clone(),
            configuration: i,
            same_probes: hashes(first).eq(hashes(i)),
            error_relative: mean(configuration, "error_relative"),
            leak_light: mean(configuration, "leak_light"),
            bytes: mean(configuration, "bytes"),
            bake_s: mean(configuration, "bake_s"),
        });
    }
    EqualReport::Positions { sets }
}

/// Each ladder's error at powers of two of bytes, from the smallest configuration of all to the largest.
pub fn bytes(ladders: &[LadderReport], configurations: &[ConfigurationReport]) -> EqualReport {
    let point = |c: &ConfigurationReport| Some((mean(c, "bytes")?, mean(c, "error_relative")?));
    let all = || configurations.iter().filter_map(point).map(|p| p.0).filter(|b| *b >= 1.0);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    // Without any, none: ∞ becomes the largest number and 0's logarithm the least.
    let exponents = low.log2().ceil() as i32..=high.log2().ceil() as i32;
    let budget = |exponent: i32| {
        let bytes = 2f64.powi(exponent);
        let entry = |ladder: &LadderReport| {
            let points: Vec<(f64, f64)> =
                ladder.configurations.iter().filter_map(|&i| point(&configurations[i])).collect();
            let fits = points.iter().any(|p| p.0 <= bytes);
            BudgetEntry { method: ladder.name.clone(), fits, error_relative: interpolate(&points, bytes) }
        };
        EqualBudget { bytes, entries: ladders.iter().map(entry).collect() }
    };
    EqualReport::Bytes { budgets: exponents.map(budget).collect() }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::report::sweep::{Aggregate, PerFront};

    fn configuration(ladder: usize, bytes: f64, error: f64) -> ConfigurationReport {
        let of = |value: f64| Aggregate::of(&[Some(value)]);
        ConfigurationReport {
            label: String::new(),
            ladder,
            axes: vec![AxisValue { key: "a".to_owned(), value: "1".to_owned() }],
            config: String::new(),
            probes: 1,
            figures: BTreeMap::from([("bytes", of(bytes)), ("error_relative", of(error))]),
            noise_rms: None,
            noise_relative: None,
            bias_rms: None,
            bias_relative: None,
            ruled_by: None,
            on_front: PerFront::default(),
            runs: Vec::new(),
        }
    }

    fn ladder(name: &str, configurations: &[usize]) -> LadderReport {
        LadderReport {
            name: name.to_owned(),
            method: name.to_owned(),
            configurations: configurations.to_vec(),
            fronts: PerFront::default(),
            best: None,
            floor_relative: None,
        }
    }

    /// error = 1/bytes and 8/bytes, from 4 and from 32 bytes on.
    #[test]
    fn what_does_not_fit_is_said() {
        let configurations = [(0, 4.0, 0.25), (0, 64.0, 1.0 / 64.0), (1, 32.0, 0.25), (1, 64.0, 0.125)]
            .map(|(l, b, e)| configuration(l, b, e));
        let EqualReport::Bytes { budgets } = bytes(&[ladder("a", &[0, 1]), ladder("b", &[2, 3])], &configurations)
        else {
            panic!("bytes were asked for")
        };
        assert_eq!(budgets.iter().map(|b| b.bytes).collect::<Vec<_>>(), [4.0, 8.0, 16.0, 32.0, 64.0]);
        for budget in &budgets {
            let [a, b] = &budget.entries[..] else { panic!("two methods") };
            assert!((a.error_relative.unwrap() * budget.bytes - 1.0).abs() < 1e-12);
            assert_eq!((b.fits, b.error_relative.is_some()), (budget.bytes >= 32.0, budget.bytes >= 32.0));
        }
        let EqualReport::Positions { sets } = positions(&[ladder("a", &[0, 1]), ladder("b", &[2, 3])], &configurations)
        else {
            panic!("positions were asked for")
        };
        assert_eq!((sets.len(), sets[0].entries.len()), (1, 4));
    }
}
