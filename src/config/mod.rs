//! The configuration of a bake: a method of the literature, or ours, as a value.
//!
//! RON, with every key optional and an unknown key an error. Precedence: built-in defaults, then `--preset` or
//! `--config`, then `--set key=value` in the order given. [`Config::default`] is the preset `default`.

mod check;
pub(crate) mod messages;
mod overrides;
pub mod presets;

use std::path::{Path, PathBuf};

use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};

use crate::probe::capture::CaptureSettings;
use crate::probe::lattice::grid::GridSettings;
use crate::probe::place::PlacementSettings;
use crate::probe::query::QuerySettings;
use crate::probe::store::encode::EncodingSettings;
use crate::probe::store::kernel::FilterSettings;
use crate::probe::transport::solver::SolverSettings;
use crate::system::input::read_file;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    pub grid: GridSettings,
    pub placement: PlacementSettings,
    pub lights: LightSettings,
    pub capture: CaptureSettings,
    pub filter: FilterSettings,
    pub query: QuerySettings,
    pub solver: SolverSettings,
    pub encoding: EncodingSettings,
    pub plan: PlanMode,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightSettings {
    /// Factor on all punctual lights; 1/683 undoes exporters that write lumens for watts.
    pub punctual_scale: f32,
    /// Constant sky radiance, linear RGB, W·m⁻²·sr⁻¹; `--env` overrides it.
    pub sky: Option<(f32, f32, f32)>,
}

impl Default for LightSettings {
    fn default() -> Self {
        LightSettings { punctual_scale: 1.0, sky: None }
    }
}

/// Whether the bake may leave out what the scene does not need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanMode {
    #[default]
    LeaveOut,
    /// Computes and stores everything; the result is the same.
    KeepEverything,
}

#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("cannot read the configuration {path}: {cause}; give the path of a RON file")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{place}: {what}")]
    Invalid { place: String, what: String },
    #[error("there is no preset '{name}'; there are: {known}")]
    NoPreset { name: String, known: String },
    #[error("--set {assignment}: {what}")]
    Override { assignment: String, what: String },
    #[error("{place}: {key} is {value}: {rule}")]
    OutOfRange { place: String, key: &'static str, value: String, rule: &'static str },
}

impl Config {
    /// Reads RON text; `place` names it in errors.
    pub fn parse(text: &str, place: &str) -> Result<Config, ConfigError> {
        let config: Config = from_ron(text, place)?;
        config.check(place)?;
        if config.grid.spacing_m.is_some() && config.grid.divisions.is_some() {
            let what = "grid.spacing_m and grid.divisions are both given; remove one".to_owned();
            return Err(ConfigError::Invalid { place: place.to_owned(), what });
        }
        Ok(config)
    }

    pub fn load(path: &Path) -> Result<Config, ConfigError> {
        let unreadable = |cause| ConfigError::Unreadable { path: path.to_owned(), cause };
        let bytes = read_file(path).map_err(unreadable)?;
        let text = String::from_utf8(bytes).map_err(|e| unreadable(std::io::Error::other(e.utf8_error())))?;
        Config::parse(&text, &path.display().to_string())
    }

    /// Applies `key=value` assignments in order.
    pub fn with_overrides(self, assignments: &[String]) -> Result<Config, ConfigError> {
        overrides::apply(self, assignments)
    }

    /// The whole configuration as RON that [`Config::parse`] reads back.
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().indentor("    ").new_line("\n");
        // Plain records of numbers and enums: nothing in them can fail to serialise.
        ron::ser::to_string_pretty(self, pretty).unwrap_or_default()
    }
}

/// Reads RON text as configurations are written; `place` names it in errors.
pub fn from_ron<T: serde::de::DeserializeOwned>(text: &str, place: &str) -> Result<T, ConfigError> {
    // Some editors write a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    ron_options().from_str(text).map_err(|e| ConfigError::Invalid {
        place: format!("{place}, line {} column {}", e.span.start.line, e.span.start.col),
        what: messages::of_file(&e, text),
    })
}

/// RON in which optional values are written without `Some`.
pub(crate) fn ron_options() -> ron::Options {
    ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ron_round_trip() {
        let config = Config::default();
        assert_eq!(Config::parse(&config.to_ron(), "itself").unwrap(), config);
    }

    #[test]
    fn unknown_keys_name_the_nearest_one_and_the_place() {
        let error = Config::parse("(grid: (\n  spacing: 1.0))", "a.ron").unwrap_err().to_string();
        assert!(error.contains("a.ron, line 2") && error.contains("'spacing_m'"), "{error}");
    }

    #[test]
    fn out_of_range_values_name_key_and_range() {
        let error = Config::parse("(capture: (resolution: 0))", "a.ron").unwrap_err().to_string();
        assert!(error.contains("capture.resolution is 0") && error.contains("1 to 1024"), "{error}");
        assert!(Config::parse("(solver: (albedo_max: 1.0))", "a.ron").is_err());
    }

    #[test]
    fn files_that_say_nothing_and_marks_before_them() {
        assert_eq!(Config::parse("\u{feff}()", "a.ron").unwrap(), Config::default());
        for (text, words) in [("", "it is empty"), ("\u{feff}\n", "it is empty"), ("// all defaults", "() gives")] {
            let error = Config::parse(text, "a.ron").unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        let error = Config::parse("(query: (\n visibility: surface,\n))", "a.ron").unwrap_err().to_string();
        assert!(error.contains("surface(voxels_per_cell: 8)") && error.contains("line 2"), "{error}");
        let error = Config::parse("(grid: (spacing_m: 1, divisions: (2, 2, 2)))", "a.ron").unwrap_err().to_string();
        assert!(error.contains("a.ron") && error.contains("remove one"), "{error}");
    }

    #[test]
    fn options_need_no_some() {
        assert_eq!(Config::parse("(grid: (spacing_m: 0.5))", "a.ron").unwrap().grid.spacing_m, Some(0.5));
    }
}
