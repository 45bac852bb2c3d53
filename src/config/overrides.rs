//! `--set key=value`: a path of keys with dots, and a value.

use ron::error::SpannedError;
use serde_json::Value;

use super::{Config, ConfigError, messages};

/// Applies `key=value` assignments in order. Values are RON as in a configuration file, for example `0.5`, `f32`,
/// `(3, 4, 5)` or `surface(voxels_per_cell: 4)`.
pub fn apply(mut config: Config, assignments: &[String]) -> Result<Config, ConfigError> {
    // Plain records of numbers and enums: nothing in them can fail to serialise.
    let mut tree = serde_json::to_value(&config).unwrap_or_default();
    // Checked one by one, so that the message names the assignment that does not fit.
    for assignment in assignments {
        let error = |what: String| ConfigError::Override { assignment: assignment.clone(), what };
        let place = format!("--set {assignment}");
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| error("write it as key=value, for example grid.spacing_m=0.5".into()))?;
        let (path, value) = (path.trim(), value.trim());
        let alone = from_ron(path, value);
        if let Ok(alone) = &alone {
            // Before JSON makes `null` of NaN and infinities, and so the default of a key that may be left out.
            alone.check(&place)?;
        }
        let parsed = match &alone {
            Ok(alone) => at_path(alone, path),
            // Paths into a choice (`query.visibility.moments.power`), and mistakes, which get their message below.
            Err(_) => None,
        };
        set(&mut tree, path, parsed.unwrap_or_else(|| plain(value))).map_err(error)?;
        config = serde_json::from_value::<Config>(tree.clone()).map_err(|e| error(explain(&e, &alone, value)))?;
        config.check(&place)?;
        if config.grid.spacing_m.is_some() && config.grid.divisions.is_some() {
            let key = if path.ends_with("divisions") { "spacing_m" } else { "divisions" };
            return Err(error(format!("grid.{key} is given too; remove one, or put --set grid.{key}=None before")));
        }
    }
    Ok(config)
}

/// What is wrong with a value: RON knows it better where it is about names.
fn explain(error: &serde_json::Error, alone: &Result<Config, SpannedError>, value: &str) -> String {
    if let Some(message) = messages::without_parameters(value) {
        return message;
    }
    match alone.as_ref().map_err(|e| &e.code) {
        Err(code @ (ron::Error::NoSuchEnumVariant { .. } | ron::Error::NoSuchStructField { .. })) => {
            messages::of_value(code, value)
        }
        _ => error.to_string(),
    }
}

fn set(tree: &mut Value, path: &str, value: Value) -> Result<(), String> {
    let mut node = tree;
    for key in path.split('.') {
        let Value::Object(map) = node else {
            return Err(format!("'{key}' cannot be set: what stands before it has no keys"));
        };
        if !map.contains_key(key) {
            return Err(messages::unknown_key(key, map.keys().map(String::as_str)));
        }
        node = &mut map[key];
    }
    *node = value;
    Ok(())
}

/// A configuration file with nothing but this key.
fn from_ron(path: &str, value: &str) -> Result<Config, SpannedError> {
    let text = path.rsplit('.').fold(value.to_owned(), |inner, key| format!("({key}: {inner})"));
    super::ron_options().from_str(&text)
}

/// What a configuration has at a path of keys.
fn at_path(config: &Config, path: &str) -> Option<Value> {
    let tree = serde_json::to_value(config).ok()?;
    path.split('.').try_fold(&tree, |node, key| node.get(key)).cloned()
}

/// A number, `true`, JSON, or else the name of a choice.
fn plain(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::query::VisibilitySettings;
    use crate::probe::store::encode::ColorFormat;

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
            ("encoding.irradiance=f61", "did you mean 'f16'"),
            ("query.visibility=surface", "surface(voxels_per_cell: 8)"),
            ("query.direction=cosine", "cosine(floor: 0.05)"),
            ("query.visibility=surface(voxels: 8)", "did you mean 'voxels_per_cell'"),
            ("grid.spacing_m=NaN", "positive"),
            ("grid=(spacing_m: inf)", "positive"),
            ("query.visibility=moments(power: 1e39, floor: 0)", "finite"),
        ] {
            let error = with(&[assignment]).unwrap_err().to_string();
            assert!(error.contains(expected), "{assignment}: {error}");
        }
    }
    /// NaN and infinities are no numbers of metres, shares or anything else, and no way of writing a default.
    #[test]
    fn no_key_takes_what_is_not_finite() {
        fn leaves(node: &Value, path: String, out: &mut Vec<String>) {
            match node {
                Value::Object(map) => {
                    map.iter().for_each(|(key, node)| leaves(node, format!("{path}.{key}"), out));
                }
                Value::Number(_) => out.push(path.trim_start_matches('.').to_owned()),
                _ => {}
            }
        }
        let mut paths = Vec::new();
        leaves(&serde_json::to_value(Config::default()).unwrap(), String::new(), &mut paths);
        assert!(paths.len() > 15, "{paths:?}");
        for odd in ["NaN", "inf", "-inf", "1e400"] {
            let optional = ["grid.spacing_m=X", "lights.sky=(X,0,0)", "grid.bounds=(min: (0,0,0), max: (1,X,1))"];
            let assignments = paths.iter().map(|path| format!("{path}=X")).chain(optional.map(String::from));
            for assignment in assignments.map(|a| a.replace('X', odd)) {
                assert!(with(&[&assignment]).is_err(), "{assignment}");
            }
            let file = format!("(grid: (spacing_m: {odd}))");
            assert!(Config::parse(&file, "a.ron").unwrap_err().to_string().contains("a.ron"), "{file}");
        }
    }

    #[test]
    fn a_spacing_gives_way_to_divisions_on_request() {
        let error = with(&["grid.spacing_m=1", "grid.divisions=(2,2,2)"]).unwrap_err().to_string();
        assert!(error.contains("--set grid.spacing_m=None"), "{error}");
        let config = with(&["grid.spacing_m=1", "grid.spacing_m=None", "grid.divisions=(2,2,2)"]).unwrap();
        assert_eq!((config.grid.spacing_m, config.grid.divisions), (None, Some((2, 2, 2))));
    }
}
