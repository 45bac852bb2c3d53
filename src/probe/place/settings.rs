//! What a method says about placing its probes.
//!
//! Where a constant has no source, its doc says what other values change: of `leak.light` and `leak.dark`, as shares of the
//! light, of `leak.unseen`, or of the survey's rays, over two_rooms_open 1 m, office 1.5 m, courtyard 2 m, thin_wall 0.75 m,
//! cornell 0.25 m and glossy_room 0.75 m. Changes below 1e-4 count as none. Those of the
//! survey's points were measured when every triangle had points of its own; now all surfaces of a voxel's side share them.

use serde::{Deserialize, Serialize};

use super::ddgi::DdgiSettings;
use crate::probe::lattice::Refine;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementSettings {
    /// Where the grid is finer than elsewhere.
    pub refine: Refine,
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
    /// It moves and is classified as Majercik et al. 2021 do, see [`super::ddgi`].
    Ddgi(DdgiSettings),
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
            PlacementRule::Ddgi(settings) => settings.relocate,
        }
    }

    /// Whether it tells by itself which probes count, whatever surfaces are near.
    pub fn classifies(&self) -> bool {
        matches!(self, PlacementRule::Ddgi(settings) if settings.classify)
    }

    /// Rays of a probe's own that it needs in every frame, and that so bring no light.
    pub fn reserved_rays(&self) -> usize {
        match self {
            PlacementRule::Ddgi(settings) if settings.relocate || settings.classify => settings.rays,
            _ => 0,
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            PlacementRule::GridPoints => {}
            PlacementRule::Settle(settings) => settings.check(rule),
            PlacementRule::Ddgi(settings) => settings.check(rule),
        }
    }
}

/// Lengths are in spacings: the smallest of the grid's three.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SettleSettings {
    /// Rays that decide about one probe. 32 or 512: at most 2e-4.
    pub rays: u32,
    /// A probe counts as inside geometry (or outside the world) when more than this share of what its rays meet are
    /// backs of surfaces, 0 to 1. Beside a sheet that has only a front nearly half of them are.
    /// 0.25 or 0.75: at most 1e-3 (thin_wall).
    pub back_face_share: f32,
    /// Move probes that are inside geometry, or touch it, into the open where it is near.
    pub relocate: bool,
    /// Farthest that a probe is moved from its grid point. Beyond half a spacing it would be nearer to a neighbour's place
    /// than to its own; 0.45 is the bound of Majercik et al. 2021.
    pub max_move: f32,
    /// Nearer to a surface than this, a probe is moved away from it: a wall one spacing wide fills 46 % of what a probe at
    /// this distance before its middle sees.
    pub min_clearance: f32,
    /// How far from a surface a moved probe comes to lie: beyond `min_clearance`, so that it is not moved again, and within
    /// 0.125, the width of a voxel of the default table. 0.06: `unseen` +0.0016 in glossy_room; 0.2: −0.0011.
    pub clearance: f32,
    /// Moves tried before a probe stays as it was. 1: `dark` +0.003 in courtyard; 8: none.
    pub max_moves: u32,
    /// How far from a surface that sees no probe one is put; half the free space where that is less.
    /// 0.1 or 0.4: none.
    pub need_distance: f32,
    /// Surfaces in need tried for one probe, nearest first. 3 or 48: none.
    pub need_tries: u32,
}

impl Default for SettleSettings {
    fn default() -> Self {
        SettleSettings {
            rays: 128,
            back_face_share: 0.5,
            relocate: true,
            max_move: 0.45,
            min_clearance: 0.05,
            clearance: 0.12,
            max_moves: 4,
            need_distance: 0.2,
            need_tries: 12,
        }
    }
}

impl SettleSettings {
    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        rule("placement.rule.settle.rays", self.rays.to_string(), (1..=65_536).contains(&self.rays), "use 1 to 65536");
        for (key, value) in [
            ("placement.rule.settle.back_face_share", self.back_face_share),
            ("placement.rule.settle.max_move", self.max_move),
            ("placement.rule.settle.min_clearance", self.min_clearance),
            ("placement.rule.settle.clearance", self.clearance),
            ("placement.rule.settle.need_distance", self.need_distance),
        ] {
            rule(key, value.to_string(), (0.0..=1.0).contains(&value), "use a number from 0 to 1");
        }
        for (key, value) in
            [("placement.rule.settle.max_moves", self.max_moves), ("placement.rule.settle.need_tries", self.need_tries)]
        {
            rule(key, value.to_string(), value <= 1024, "use 0 to 1024");
        }
    }
}

/// How closely surfaces are looked at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurveySettings {
    /// Points tried on a surface within one voxel at first, where it sees otherwise than the voxels around or is not the only
    /// one; elsewhere one point is enough. 1: `light` +0.002 in office, `dark` +0.003 in thin_wall, for 0.63
    /// to 0.87 × the rays; 4: at most 0.0013, for 1.2 to 1.7 ×.
    pub first_points: u32,
    /// Points tried in all where the first ones disagree. 4 or 16: at most 5e-4.
    pub all_points: u32,
    /// Points tried on the outside of a surface until one sees any probe: where walls meet, most of a voxel's surface may
    /// lie inside the other wall, and the strip that does not must still be found. 8: `dark` +3e-4 in office, for 0.73 to 0.93 ×
    /// the rays; 128: none, for 1.1 to 1.7 ×. Where no one around sees any, the first points have to do.
    pub search_points: u32,
    /// Voxels are taken larger by this share of their side on every side when surfaces are sorted into them, so that a
    /// surface on the border of two is known in both, on whichever side of it rounding puts the point that asks. 0: at most
    /// 2e-4, for 0.73 to 0.91 × the rays; 0.1: `dark` +0.005 in cornell.
    pub voxel_margin: f32,
    /// Layers of probes around a cell that are searched for a probe where a surface sees none of its eight.
    /// 1 or 5: none.
    pub far_rings: u32,
}

impl Default for SurveySettings {
    fn default() -> Self {
        SurveySettings { first_points: 2, all_points: 8, search_points: 16, voxel_margin: 0.03, far_rings: 3 }
    }
}

impl SurveySettings {
    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        for (key, value) in [
            ("placement.survey.first_points", self.first_points),
            ("placement.survey.all_points", self.all_points),
            ("placement.survey.search_points", self.search_points),
        ] {
            // Votes are counted in 8 bits.
            rule(key, value.to_string(), (1..=255).contains(&value), "use 1 to 255");
        }
        let margin = self.voxel_margin;
        rule("placement.survey.voxel_margin", margin.to_string(), (0.0..=0.5).contains(&margin), "use 0 to 0.5");
        rule("placement.survey.far_rings", self.far_rings.to_string(), self.far_rings <= 16, "use 0 to 16");
    }
}
