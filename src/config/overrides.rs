//! `--set key=value`: a path of keys with dots, and a value.

use serde_json::Value;

use super::{Config, ConfigError, unknown_key};

/// Applies `key=value` assignments in order. Values are RON as in a configuration file, for example `0.5`, `f32`,
/// `(3, 4, 5)` or `surface(voxels_per_cell: 4)`.
pub fn apply(config: Config, assignments: &[String]) -> Result<Config, ConfigError> {
    // Plain records of numbers and enums: nothing in them can fail to serialise.
    let mut tree = serde_json::to_value(&config).unwrap_or_default();
    for assignment in assignments {
        let error = |what: String| ConfigError::Override { assignment: assignment.clone(), what };
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| error("write it as key=value, for example grid.spacing_m=0.5".into()))?;
        let (path, value) = (path.trim(), value.trim());
        let parsed = match from_ron(path, value) {
            Some(parsed) => parsed,
            // Paths into a choice (`query.visibility.moments.power`), and mistakes, which get their message below.
            None => plain(value),
        };
        set(&mut tree, path, parsed).map_err(error)?;
        // Checked one by one, so that the message names the assignment that does not fit.
        serde_json::from_value::<Config>(tree.clone()).map_err(|e| error(e.to_string()))?;
    }
    serde_json::from_value(tree)
        .map_err(|e| ConfigError::Override { assignment: assignments.join(" "), what: e.to_string() })
}

fn set(tree: &mut Value, path: &str, value: Value) -> Result<(), String> {
    let mut node = tree;
    for key in path.split('.') {
        let Value::Object(map) = node else {
            return Err(format!("'{key}' cannot be set: what stands before it has no keys"));
        };
        if !map.contains_key(key) {
            return Err(unknown_key(key, map.keys().map(String::as_str)));
        }
        node = &mut map[key];
    }
    *node = value;
    Ok(())
}

/// The value as a configuration file with nothing but this key would have it.
fn from_ron(path: &str, value: &str) -> Option<Value> {
    let keys: Vec<&str> = path.split('.').collect();
    let text = keys.iter().rev().fold(value.to_owned(), |inner, key| format!("({key}: {inner})"));
    let config: Config = super::ron_options().from_str(&text).ok()?;
    let tree = serde_json::to_value(config).ok()?;
    keys.iter().try_fold(&tree, |node, key| node.get(key)).cloned()
}

/// A number, `true`, JSON, or else the name of a choice.
fn plain(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::encode::ColorFormat;
    use crate::probe::query::VisibilitySettings;

    fn with(assignments: &[&str]) -> Result<Config, ConfigError> {
        Config::default().with_overrides(&assignments.iter().map(|s| s.to_string()).collect::<Vec<_>>())
    }

    #[test]
    fn values_of_every_kind() {
        let config = with(&[
            "grid.divisions=(3,4,5)",
            "encoding.irradiance=f32",
            "solver.tolerance=1e-3",
            "query.visibility=moments(power: 3, floor: 0.05)",
            "query.visibility.moments.power=2",
        ])
        .unwrap();
        assert_eq!(config.grid.divisions, Some((3, 4, 5)));
        assert_eq!(config.encoding.irradiance, ColorFormat::F32);
        assert_eq!(config.solver.tolerance, 1e-3);
        assert_eq!(config.query.visibility, VisibilitySettings::Moments { power: 2.0, floor: 0.05 });
    }

    #[test]
    fn mistakes_are_named() {
        for (assignment, expected) in [
            ("grid.spacing=1", "did you mean 'spacing_m'"),
            ("grid.spacing_m", "key=value"),
            ("grid.spacing_m=wide", "wide"),
            ("encoding.irradiance=f64", "f64"),
            ("solver.albedo_max=2", "not including 1"),
            ("grid.spacing_m.x=1", "has no keys"),
        ] {
            let error = with(&[assignment]).unwrap_err().to_string();
            assert!(error.contains(expected), "{assignment}: {error}");
        }
    }
}
