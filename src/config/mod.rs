//! The configuration of a bake: a method of the literature, or ours, as a value.
//!
//! RON, with every key optional and an unknown key an error. Precedence: built-in defaults, then `--preset` or
//! `--config`, then `--set key=value` in the order given. [`Config::default`] is the preset `default`.

mod overrides;
pub mod presets;

use std::path::{Path, PathBuf};

use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};

use crate::probe::capture::{CaptureSettings, ReflectedLight};
use crate::probe::encode::EncodingSettings;
use crate::probe::filter::FilterSettings;
use crate::probe::grid::GridSettings;
use crate::probe::placement::PlacementSettings;
use crate::probe::query::{DirectionWeight, QuerySettings, VisibilitySettings};
use crate::probe::solver::SolverSettings;
use crate::probe::surface_visibility::MAX_VOXELS_PER_CELL;

/// Largest resolution of any octahedral map, texels per side.
const MAX_RESOLUTION: usize = 1024;

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
        let config: Config = ron_options().from_str(text).map_err(|e| ConfigError::Invalid {
            place: format!("{place}, line {} column {}", e.span.start.line, e.span.start.col),
            what: describe(&e.code),
        })?;
        config.check(place)?;
        Ok(config)
    }

    pub fn load(path: &Path) -> Result<Config, ConfigError> {
        let text =
            std::fs::read_to_string(path).map_err(|cause| ConfigError::Unreadable { path: path.to_owned(), cause })?;
        Config::parse(&text, &path.display().to_string())
    }

    /// Applies `key=value` assignments in order.
    pub fn with_overrides(self, assignments: &[String]) -> Result<Config, ConfigError> {
        let config = overrides::apply(self, assignments)?;
        config.check("--set")?;
        Ok(config)
    }

    /// The whole configuration as RON that [`Config::parse`] reads back.
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().indentor("    ").new_line("\n");
        // Plain records of numbers and enums: nothing in them can fail to serialise.
        ron::ser::to_string_pretty(self, pretty).unwrap_or_default()
    }

    /// Refuses what no stage could work with.
    fn check(&self, place: &str) -> Result<(), ConfigError> {
        let mut first_error = Ok(());
        let mut rule = |key: &'static str, value: String, holds: bool, rule: &'static str| {
            if !holds && first_error.is_ok() {
                first_error = Err(ConfigError::OutOfRange { place: place.to_owned(), key, value, rule });
            }
        };
        let size = |n: usize| (1..=MAX_RESOLUTION).contains(&n);
        let not_negative = |x: f32| x.is_finite() && x >= 0.0;
        let unit = |x: f32| (0.0..=1.0).contains(&x);
        let (c, f, q, s) = (&self.capture, &self.filter, &self.query, &self.solver);
        rule("capture.resolution", c.resolution.to_string(), size(c.resolution), SIZE_RULE);
        let samples = c.samples_per_texel;
        rule("capture.samples_per_texel", samples.to_string(), (1..=65_536).contains(&samples), "use 1 to 65536");
        let emitter = c.emitter_samples;
        rule("capture.emitter_samples", emitter.to_string(), (1..=65_536).contains(&emitter), "use 1 to 65536");
        if let ReflectedLight::PathTraced { paths } = c.reflected {
            rule(
                "capture.reflected.path_traced.paths",
                paths.to_string(),
                (1..=1 << 20).contains(&paths),
                "use 1 to 1048576",
            );
        }
        let probe = c.probe_emitter_samples;
        rule("capture.probe_emitter_samples", probe.to_string(), probe <= 1 << 20, "use 0 to 1048576");
        rule(
            "filter.irradiance_resolution",
            f.irradiance_resolution.to_string(),
            size(f.irradiance_resolution),
            SIZE_RULE,
        );
        rule("filter.distance_resolution", f.distance_resolution.to_string(), size(f.distance_resolution), SIZE_RULE);
        let exponent = f.distance_exponent;
        rule("filter.distance_exponent", exponent.to_string(), (1.0..=1e4).contains(&exponent), "use 1 to 10000");
        let clamp = f.distance_clamp;
        rule("filter.distance_clamp", clamp.to_string(), (1.0..=1e3).contains(&clamp), "use 1 to 1000 cell diagonals");
        rule(
            "placement.rays",
            self.placement.rays.to_string(),
            (1..=65_536).contains(&self.placement.rays),
            "use 1 to 65536",
        );
        let share = self.placement.back_face_share;
        rule("placement.back_face_share", share.to_string(), unit(share), UNIT_RULE);
        let scale = self.lights.punctual_scale;
        rule("lights.punctual_scale", scale.to_string(), not_negative(scale), POSITIVE_RULE);
        if let Some(sky) = self.lights.sky {
            let holds = not_negative(sky.0) && not_negative(sky.1) && not_negative(sky.2);
            rule("lights.sky", format!("{sky:?}"), holds, POSITIVE_RULE);
        }
        rule("solver.tolerance", s.tolerance.to_string(), not_negative(s.tolerance), POSITIVE_RULE);
        rule("solver.max_bounces", s.max_bounces.to_string(), s.max_bounces <= 1 << 20, "use 0 to 1048576");
        let albedo = s.albedo_max;
        rule(
            "solver.albedo_max",
            albedo.to_string(),
            (0.0..1.0).contains(&albedo),
            "use a number from 0 up to but not including 1",
        );
        rule("encoding.border", self.encoding.border.to_string(), self.encoding.border <= 1, "use 0 or 1");
        for (key, value) in [
            ("query.trilinear_floor", q.trilinear_floor),
            ("query.weight_floor", q.weight_floor),
            ("query.crush_below", q.crush_below),
            ("query.normal_bias", q.normal_bias),
            ("query.view_bias", q.view_bias),
        ] {
            rule(key, value.to_string(), unit(value), UNIT_RULE);
        }
        match q.direction {
            DirectionWeight::Uniform => {}
            DirectionWeight::Cosine { floor } => {
                rule("query.direction.cosine.floor", floor.to_string(), unit(floor), UNIT_RULE)
            }
            DirectionWeight::Wrap { offset } => {
                rule("query.direction.wrap.offset", offset.to_string(), unit(offset), UNIT_RULE)
            }
        }
        match q.visibility {
            VisibilitySettings::None => {}
            VisibilitySettings::Moments { power, floor } => {
                rule("query.visibility.moments.power", power.to_string(), not_negative(power), POSITIVE_RULE);
                rule("query.visibility.moments.floor", floor.to_string(), unit(floor), UNIT_RULE);
            }
            VisibilitySettings::Surface { voxels_per_cell: n } => {
                let holds = (1..=MAX_VOXELS_PER_CELL).contains(&n);
                rule("query.visibility.surface.voxels_per_cell", n.to_string(), holds, "use 1 to 22");
            }
        }
        first_error
    }
}

/// RON in which optional values are written without `Some`.
fn ron_options() -> ron::Options {
    ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

const SIZE_RULE: &str = "use 1 to 1024 texels";
const UNIT_RULE: &str = "use a number from 0 to 1";
const POSITIVE_RULE: &str = "use a finite number, not negative";

/// RON's complaint in words, with the nearest known name where a name is wrong.
fn describe(error: &ron::Error) -> String {
    match error {
        ron::Error::NoSuchStructField { expected, found, .. } => unknown_key(found, expected.iter().copied()),
        ron::Error::NoSuchEnumVariant { expected, found, .. } => {
            let nearest = nearest(found, expected.iter().copied());
            format!("there is no choice '{found}'; did you mean '{nearest}'? The choices are {}", expected.join(", "))
        }
        other => other.to_string(),
    }
}

/// Message for a key that does not exist.
fn unknown_key<'k>(found: &str, known: impl Iterator<Item = &'k str> + Clone) -> String {
    let nearest = nearest(found, known.clone());
    let known: Vec<&str> = known.collect();
    format!("there is no key '{found}'; did you mean '{nearest}'? The keys here are {}", known.join(", "))
}

fn nearest<'k>(found: &str, known: impl Iterator<Item = &'k str>) -> &'k str {
    known.min_by_key(|k| strsim::damerau_levenshtein(k, found)).unwrap_or("")
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
    fn options_need_no_some() {
        assert_eq!(Config::parse("(grid: (spacing_m: 0.5))", "a.ron").unwrap().grid.spacing_m, Some(0.5));
    }
}
