//! The configuration of a bake: where probes stand in a scene, and a method — of the literature, or ours — as a value.
//!
//! RON, with every key optional and an unknown key an error. A file is a list of assignments: only the keys that stand in
//! it count. Layers lie on each other in this order: built-in defaults, `--preset`, `--config`, `--set key=value`
//! ([`Layers`]). [`Config::default`] is the preset `default`.

mod aliases;
mod assignments;
mod check;
mod layers;
pub(crate) mod messages;
pub mod presets;

use std::path::PathBuf;

use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};

pub use self::layers::Layers;
use crate::probe::capture::CaptureSettings;
use crate::probe::file::{LightRecord, QUERY_VERSION, QueryRecord};
use crate::probe::lattice::grid::GridSettings;
use crate::probe::place::PlacementSettings;
use crate::probe::query::QuerySettings;
use crate::probe::store::StoreSettings;
use crate::probe::transport::Transport;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    pub grid: GridSettings,
    pub lights: LightSettings,
    pub materials: MaterialSettings,
    pub placement: PlacementSettings,
    pub capture: CaptureSettings,
    pub transport: Transport,
    pub store: StoreSettings,
    pub query: QuerySettings,
    pub plan: PlanSettings,
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

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaterialSettings {
    /// Albedos are clamped to this, 0 up to but not including 1: at 1 light would never end.
    pub albedo_max: f32,
}

impl Default for MaterialSettings {
    fn default() -> Self {
        MaterialSettings { albedo_max: 0.999 }
    }
}

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanSettings {
    pub mode: PlanMode,
    /// Stages that are never left out, by the names of the plan's lines.
    pub keep: Vec<String>,
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

/// Names of the stages that a plan can leave out.
pub const STAGES: &[&str] = &[
    "punctual_shadow_rays",
    "emissive_surfaces",
    "sky",
    "alpha_test",
    "textures",
    "radiance_levels",
    "unused_probes",
    VISIBILITY,
];

/// The stage that stores and asks what probes know about occlusion.
pub const VISIBILITY: &str = "visibility";

impl PlanSettings {
    /// Whether a stage is computed and stored even where the scene does not need it.
    pub fn keeps(&self, stage: &str) -> bool {
        self.mode == PlanMode::KeepEverything || self.keep.iter().any(|kept| kept == stage)
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("cannot read the configuration {path}: {cause}; give the path of a RON file")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{place}: {what}")]
    Invalid { place: String, what: String },
    #[error("there is no preset '{name}'; there are: {known}")]
    NoPreset { name: String, known: String },
    #[error("{place}: {key} is {value}: {rule}")]
    OutOfRange { place: String, key: &'static str, value: String, rule: &'static str },
}

impl Config {
    /// Reads RON text over the defaults; `place` names it in errors.
    ///
    /// # Errors
    /// The text is not RON, or has keys or values that a configuration does not take.
    pub fn parse(text: &str, place: &str) -> Result<Config, ConfigError> {
        Layers::default().text(text, place)?.config()
    }

    /// Applies `key=value` assignments in order.
    ///
    /// # Errors
    /// Keys or values that a configuration does not take.
    pub fn with_overrides(self, assignments: &[String]) -> Result<Config, ConfigError> {
        Layers::over(self).set(assignments)?.config()
    }

    /// The whole configuration as RON that [`Config::parse`] reads back.
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().indentor("    ").new_line("\n");
        // Plain records of numbers and enums: nothing in them can fail to serialise.
        ron_options().to_string_pretty(self, pretty).unwrap_or_default()
    }

    /// What a probe file says about asking its probes.
    pub fn query_record(&self) -> QueryRecord {
        QueryRecord {
            version: QUERY_VERSION,
            weights: self.query.clone(),
            moved: self.placement.rule.moves(),
            light: self.light(),
        }
    }

    /// The light and the materials that all methods of a scene share.
    pub fn light(&self) -> LightRecord {
        LightRecord {
            punctual_scale: self.lights.punctual_scale,
            sky: self.lights.sky,
            albedo_max: self.materials.albedo_max,
        }
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

/// RON in which optional values are written without `Some`, and the settings of a choice without a second pair of
/// parentheses.
pub(crate) fn ron_options() -> ron::Options {
    let extensions = Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES;
    ron::Options::default().with_default_extension(extensions)
}

#[cfg(test)]
mod tests;
