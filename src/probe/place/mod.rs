//! Where probes stand, and what surfaces see of them: grid point → settling → survey → need.
//!
//! Probes that no surface can ever ask, and those inside geometry, are not worth baking.

pub mod need;
pub mod overlap;
mod sampled;
mod settle;
pub mod survey;

use glam::Vec3;
use serde::{Deserialize, Serialize};

pub use self::settle::{SettleSettings, Settler};
use self::survey::Survey;
pub use self::survey::SurveySettings;
use super::lattice::{Grid, ProbeState};
use super::store::OcclusionStore;
use super::store::surface::SurfaceVisibility;
use crate::light::World;
use crate::scene::Mesh;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementSettings {
    pub rule: PlacementRule,
    /// Bake probes that no surface can sample, for objects that move through the air.
    pub keep_unsampled: bool,
    pub survey: SurveySettings,
}

/// How a probe comes from its grid point to its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlacementRule {
    /// It stays there, and counts wherever that is.
    GridPoints,
    /// It moves into the open, and to surfaces that see no probe.
    Settle(SettleSettings),
}

impl Default for PlacementRule {
    fn default() -> Self {
        PlacementRule::Settle(SettleSettings::default())
    }
}

impl PlacementRule {
    /// Whether probes may stand elsewhere than at their grid points.
    pub fn moves(&self) -> bool {
        match self {
            PlacementRule::GridPoints => false,
            PlacementRule::Settle(settings) => settings.relocate,
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            PlacementRule::GridPoints => {}
            PlacementRule::Settle(settings) => settings.check(rule),
        }
    }
}

/// The probes before they are captured.
#[derive(Debug, Clone)]
pub struct Placement {
    pub states: Vec<ProbeState>,
    /// Relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    /// Whether any surface lies in the probe's cells.
    pub sampled: Vec<bool>,
    /// Probes moved from their grid points.
    pub relocated: usize,
    /// Share of the active probes' rays that end on an emitting surface or in the sky.
    pub emitter_coverage: f32,
    /// What surfaces see of their probes; `None` where the method does not ask.
    pub survey: Option<SurfaceVisibility>,
    pub rays: u64,
}

/// What placement looks at besides the scene.
pub struct PlacementTask<'a> {
    pub grid: &'a Grid,
    pub settings: &'a PlacementSettings,
    pub occlusion: &'a OcclusionStore,
    /// How far from a surface, in spacings, it may look probes up.
    pub reach: f32,
    pub seed: u64,
}

impl Placement {
    pub fn count(&self, state: ProbeState) -> usize {
        self.states.iter().filter(|&&s| s == state).count()
    }
}

/// Places every probe of the grid and surveys the surfaces; `surveying` is called in between.
pub fn place(world: &World, task: &PlacementTask, surveying: impl FnOnce()) -> Placement {
    let PlacementTask { grid, settings, occlusion, .. } = *task;
    let mut placement = settle::settle_all(world, task);
    surveying();
    let Some(voxels) = occlusion.survey_voxels() else { return placement };
    let survey = |placement: &mut Placement| {
        let survey = Survey::run(world, grid, placement, voxels, &settings.survey, task.seed);
        placement.rays += survey.rays;
        survey
    };
    let mut found = survey(&mut placement);
    if let PlacementRule::Settle(rule) = &settings.rule
        && rule.relocate
        && need::relocate(&Settler { world, grid, settings: rule }, &mut placement, &found) > 0
    {
        found = survey(&mut placement);
    }
    let mut table = found.table;
    // Only where shading asks this very table does it need a probe for every entry, and does a probe that no surface sees
    // weigh nothing.
    if occlusion.keeps_survey() {
        table.far = need::far_probes(world, grid, &placement, &table, &settings.survey);
        if !settings.keep_unsampled {
            retire_unseen(&world.scene.mesh, grid, &mut placement, &table);
        }
    }
    placement.survey = Some(table);
    placement
}

/// Active probes that no surface sees are not worth baking.
fn retire_unseen(mesh: &Mesh, grid: &Grid, placement: &mut Placement, table: &SurfaceVisibility) {
    let mut seen = need::seen_probes(mesh, grid, placement, table, |_| true);
    table.far.iter().for_each(|&(_, probe)| seen[probe as usize] = true);
    for (state, seen) in placement.states.iter_mut().zip(seen) {
        if *state == ProbeState::Active && !seen {
            *state = ProbeState::NeverSampled;
        }
    }
}
