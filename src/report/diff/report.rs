//! All that a comparison tells: the layout of `diff.json`.

use serde::Serialize;

use super::figures::Figure;
use super::images::ImageReport;
use super::probes::ProbesReport;
use super::thresholds::Thresholds;
use crate::report::gate::Gate;
use crate::report::page::{Command, ConfigChange};

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-diff/1";

/// What a side is.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SideReport {
    pub path: String,
    pub kind: String,
    pub items: usize,
    /// Of the first report or probe file that has one.
    pub seed: Option<u64>,
    pub config: Option<String>,
    pub scene_blake3: Option<String>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Verdict {
    pub passed: bool,
    pub gates: usize,
    pub failed: usize,
    pub waived: usize,
    /// The gate that is farthest beyond its threshold.
    pub first: Option<String>,
    pub sentence: String,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DiffReport {
    pub schema: &'static str,
    pub version: &'static str,
    pub base: SideReport,
    pub candidate: SideReport,
    pub verdict: Verdict,
    /// What fails first, then by margin.
    pub gates: Vec<Gate>,
    pub images: Vec<ImageReport>,
    pub probes: Vec<ProbesReport>,
    pub figures: Vec<Figure>,
    /// Items that only the candidate, or only the base has.
    pub added: Vec<String>,
    pub missing: Vec<String>,
    /// Keys of the configuration that differ; `null` where they cannot be compared.
    pub config_changes: Option<Vec<ConfigChange>>,
    pub thresholds: Thresholds,
    pub notes: Vec<String>,
    /// What gives this report again: the comparison, then what made its sides, as far as their reports tell.
    pub commands: Vec<Command>,
}

impl Verdict {
    /// Of sorted gates.
    pub fn of(gates: &[Gate]) -> Verdict {
        let count = |is: fn(&Gate) -> bool| gates.iter().filter(|gate| is(gate)).count();
        let (failed, waived, judged) = (count(Gate::fails), count(|gate| gate.waived), count(Gate::is_judged));
        let first = gates.iter().find(|gate| gate.fails()).map(Gate::title);
        let allowed = if waived > 0 { format!(", {waived} waived") } else { String::new() };
        let sentence = match &first {
            Some(first) => format!("Beyond thresholds: {failed} of {judged} gates fail{allowed}, first {first}."),
            None => format!("Within thresholds: all {judged} gates pass{allowed}."),
        };
        Verdict { passed: failed == 0, gates: judged, failed, waived, first, sentence }
    }
}
