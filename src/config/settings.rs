//! The sections of a configuration.

use serde::{Deserialize, Serialize};

use super::ron_text::ron_options;
use crate::probe::capture::CaptureSettings;
use crate::probe::file::{LightRecord, QueryRecord};
use crate::probe::fit::Fit;
use crate::probe::lattice::grid::GridSettings;
use crate::probe::place::PlacementSettings;
use crate::probe::query::QuerySettings;
use crate::probe::store::StoreSettings;
use crate::probe::transport::Transport;
use crate::scene::Unassigned;

/// All settings of a bake. Its default is the ground that presets lie on, the preset `physical`, and what is meant by a key
/// that a probe file's configuration leaves out; a run without `--preset` uses [`Layers::of`](super::Layers::of).
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
    /// Files and reports of before there were fits have none.
    pub fit: Fit,
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
    /// The material of meshes that have none.
    pub unassigned: Unassigned,
}

impl Default for MaterialSettings {
    fn default() -> Self {
        MaterialSettings { albedo_max: 0.999, unassigned: Unassigned::default() }
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

/// Lines of a configuration that say nothing, see [`Config::to_ron`].
const SILENT: &[&str] = &[
    "\n            centred: false,",
    "\n        prefilter: halved,",
    "\n        least_weight: 0.0,",
    "\n        glossy: none,",
    "\n        diffuse: stored,",
];

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
    pub fn keeps_everything(&self) -> bool {
        self.mode == PlanMode::KeepEverything
    }

    /// Whether a stage is computed and stored even where the scene does not need it.
    pub fn keeps(&self, stage: &str) -> bool {
        self.keeps_everything() || self.keep.iter().any(|kept| kept == stage)
    }
}

impl Config {
    /// The whole configuration as RON with every key, so that it means the same over any preset; without keys that say nothing
    /// and that files and results of before do not have.
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().indentor("    ").new_line("\n");
        // Plain records of numbers and enums: nothing in them can fail to serialise.
        let text = ron_options().to_string_pretty(self, pretty).unwrap_or_default();
        SILENT.iter().fold(text, |text, line| text.replace(line, ""))
    }

    /// What tells it from others where results are kept: [`Self::to_ron`], in which a fit that is none is not named, so that
    /// results of before there were fits stay.
    pub fn identity(&self) -> String {
        self.to_ron().replace("\n    fit: none,", "")
    }

    /// The same with so many times as many samples of what gives the probes their light: rows of a fit where there is one,
    /// else rays.
    pub fn with_samples(&self, times: u32) -> Config {
        let capture = if self.fit.is_none() { self.capture.with_samples(times) } else { self.capture.clone() };
        Config { fit: self.fit.with_samples(times), capture, ..self.clone() }
    }

    /// What a probe file says about asking its probes.
    pub fn query_record(&self) -> QueryRecord {
        QueryRecord {
            version: QueryRecord::version_of(&self.query),
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
            unassigned: self.materials.unassigned,
        }
    }
}
