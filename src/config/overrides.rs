//! `--set key=value`: a path of keys with dots, and a value.

use serde_json::Value;

use super::{Config, ConfigError, unknown_key};

/// Applies `key=value` assignments in order. Values are RON or JSON as far as the two agree: numbers, `true`, names
/// of choices (`f32`), lists in round or square brackets, and `{"choice": {"key": 1}}` for choices with keys.
pub fn apply(config: Config, assignments: &[String]) -> Result<Config, ConfigError> {
    // Plain records of numbers and enums: nothing in them can fail to serialise.
    let mut tree = serde_json::to_value(&config).unwrap_or_default();
    for assignment in assignments {
        let error = |what: String| ConfigError::Override { assignment: assignment.clone(), what };
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| error("write it as key=value, for example grid.spacing_m=0.5".into()))?;
        set(&mut tree, path.trim(), parse(value.trim())).map_err(error)?;
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

fn parse(text: &str) -> Value {
    let bracketed = text.strip_prefix('(').and_then(|t| t.strip_suffix(')')).map(|inner| format!("[{inner}]"));
    match (text, bracketed) {
        ("None", _) => Value::Null,
        (_, Some(list)) => serde_json::from_str(&list).unwrap_or_else(|_| Value::String(text.to_owned())),
        _ => serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned())),
    }
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
            r#"query.visibility={"moments": {"power": 3, "floor": 0.05}}"#,
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
