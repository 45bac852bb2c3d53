//! The report of a sweep, as JSON.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::air::AirFigures;
use super::baked::BakedFigures;
use super::bent::BentFigures;
use super::error::Figures;
use super::header::Header;
use super::leak::Leak;
use super::render::ReferenceSummary;
use crate::bake::figures::Rays;
use crate::math::statistics::Moments;

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-sweep/1";

/// What "error" is short for in a sweep.
pub const ERROR_FIGURE: &str =
    "root mean square error of irradiance_indirect with the method's own visibility ÷ the reference's mean";

#[derive(Debug, Clone, Serialize)]
pub struct SweepReport {
    /// Its configuration is that of the first entry of `configurations`; its seed the first of `seeds`.
    #[serde(flatten)]
    pub header: Header,
    pub camera: String,
    pub width: u32,
    pub height: u32,
    /// Image points that show a surface.
    pub points: usize,
    pub exposure_ev: f32,
    pub seeds: Vec<u64>,
    /// Shifts of the grids along x, y and z, cells; empty where they stay.
    pub offsets: Vec<[f64; 3]>,
    pub error_figure: &'static str,
    pub reference: ReferenceSummary,
    pub time_s: SweepTimes,
    pub ladders: Vec<LadderReport>,
    pub configurations: Vec<ConfigurationReport>,
    pub cheapest: Cheapest,
    pub floor: Vec<FloorReport>,
    /// With `--equal`.
    pub equal: Option<EqualReport>,
}

/// Common to all configurations and part of no configuration's time.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct SweepTimes {
    pub load: f64,
    pub accel_build: f64,
    pub reference: f64,
    pub total: f64,
}

/// One curve. Configurations are named by their place in `configurations`.
#[derive(Debug, Clone, Serialize)]
pub struct LadderReport {
    pub name: String,
    pub method: String,
    pub configurations: Vec<usize>,
    /// What of its own nothing beats.
    pub fronts: PerFront<Vec<usize>>,
    /// The configuration of least error.
    pub best: Option<usize>,
    /// Smallest `bias_relative` of its configurations that bias rules.
    pub floor_relative: Option<f64>,
}

/// Of the front of error against each cost, and of that of leaks against bytes.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct PerFront<T> {
    pub bake_s: T,
    pub bytes: T,
    pub shade_ms: T,
    pub leak_light: T,
}

#[derive(Debug, Clone, Serialize)]
pub struct ConfigurationReport {
    pub label: String,
    /// Place in `ladders`.
    pub ladder: usize,
    pub axes: Vec<AxisValue>,
    /// Effective configuration, RON.
    pub config: String,
    pub probes: usize,
    /// Over the seeds, with the method's own visibility.
    pub figures: BTreeMap<&'static str, Aggregate>,
    /// What one bake scatters around the mean of all seeds, W·m⁻², and ÷ the reference's mean; `null` with one seed.
    pub noise_rms: Option<f64>,
    pub noise_relative: Option<f64>,
    /// What no number of seeds takes away.
    pub bias_rms: Option<f64>,
    pub bias_relative: Option<f64>,
    /// "noise" or "bias".
    pub ruled_by: Option<&'static str>,
    /// Whether nothing beats it in the whole sweep.
    pub on_front: PerFront<bool>,
    pub runs: Vec<RunRecord>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AxisValue {
    pub key: String,
    pub value: String,
}

/// A figure over the seeds, and over the offsets where there are any; all `null` where it is undefined with any of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Aggregate {
    pub mean: Option<f64>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    /// Of the mean, from the spread between the runs; `null` with one.
    pub standard_error: Option<f64>,
    /// Over shifted grids; `null` without such, and where the figure is not positive on all of them.
    pub geometric_mean: Option<f64>,
}

impl Aggregate {
    pub fn of(values: &[Option<f64>]) -> Aggregate {
        let values: Option<Vec<f64>> = values.iter().map(|v| v.filter(|v| v.is_finite())).collect();
        let Some(values) = values.filter(|v| !v.is_empty()) else { return Aggregate::default() };
        let moments: Moments = values.iter().copied().collect();
        Aggregate {
            mean: Some(moments.mean()),
            min: values.iter().copied().reduce(f64::min),
            max: values.iter().copied().reduce(f64::max),
            standard_error: (values.len() > 1).then(|| (moments.variance() / (moments.weight() - 1.0)).sqrt()),
            geometric_mean: None,
        }
    }

    /// The same with the geometric mean, of runs on several grids.
    pub fn over_grids(values: &[Option<f64>]) -> Aggregate {
        let logarithms: Option<Moments> = values.iter().map(|v| v.filter(|v| *v > 0.0).map(f64::ln)).collect();
        let all = Aggregate::of(values);
        Aggregate { geometric_mean: all.mean.and(logarithms).map(|moments| moments.mean().exp()), ..all }
    }

    /// What stands for the figure in tables, plots and fronts: the geometric mean where there is one.
    pub fn typical(&self) -> Option<f64> {
        self.geometric_mean.or(self.mean)
    }
}

/// One bake: kept in `runs/` too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    pub seed: u64,
    /// Shift of the grid along x, y and z, cells; `null` where it stays.
    #[serde(default)]
    pub offset: Option<[f64; 3]>,
    pub probes: usize,
    pub probes_active: usize,
    /// Of positions and states.
    pub probes_blake3: String,
    /// At run time, after the plan.
    pub bytes_per_probe: f64,
    /// That × probes.
    pub bytes: f64,
    pub file_bytes: u64,
    /// Sum of `time_s`: all of the bake but loading, the acceleration structure and writing.
    pub bake_s: f64,
    pub time_s: BakeTimes,
    pub rays: Rays,
    pub bounces: usize,
    pub converged: bool,
    /// `visibility_off`, `visibility_on`, `visibility_ray`.
    pub methods: Vec<MethodFigures>,
}

impl RunRecord {
    pub fn method(&self, name: &str) -> Option<&MethodFigures> {
        self.methods.iter().find(|m| m.name == name)
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BakeTimes {
    pub survey: f64,
    pub capture: f64,
    pub bounces: f64,
    #[serde(default)]
    pub fit: f64,
    pub filter: f64,
    pub encode: f64,
}

impl BakeTimes {
    pub fn total(&self) -> f64 {
        self.survey + self.capture + self.bounces + self.fit + self.filter + self.encode
    }
}

/// As in a render's report, of all pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodFigures {
    pub name: String,
    /// Median.
    pub shade_ms: f64,
    pub lookup_ns: Option<f64>,
    pub irradiance_indirect_mean: Option<f64>,
    pub leak: Leak,
    pub outside_hull: Option<f64>,
    pub air: AirFigures,
    pub bent: BentFigures,
    /// `error.nrmse`.
    pub error_relative: Option<f64>,
    /// `error.by_region.corner.nrmse`, `error.by_region.flat.nrmse`.
    pub error_corner: Option<f64>,
    pub error_flat: Option<f64>,
    pub error: Figures,
    /// From the reference's noise.
    pub standard_error: Figures,
    pub verdict: Option<String>,
    /// Of glossy light; `None` where the probes hold none or the scene has no glossy material.
    #[serde(default)]
    pub glossy: Option<GlossyFigures>,
}

/// The light that surfaces reflect as gloss.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GlossyFigures {
    /// Median.
    pub shade_ms: f64,
    pub bytes_per_probe: f64,
    /// `error_gltf.nrmse`.
    pub error_gltf: Option<f64>,
    /// `error_gltf.relmse`: says of all pixels alike what `error_gltf` says of the few that mirror lamps.
    #[serde(default)]
    pub relmse_gltf: Option<f64>,
}

/// A configuration's probes lit by full paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthRecord {
    pub visibility_on: MethodFigures,
    pub visibility_ray: MethodFigures,
    pub baked: BakedFigures,
}

/// For each level of error the cheapest configuration by time and by bytes.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Cheapest {
    pub bake_s: Vec<CheapestAt>,
    pub bytes: Vec<CheapestAt>,
}

#[derive(Debug, Clone, Serialize)]
pub struct CheapestAt {
    /// At most this relative error.
    pub error_relative: f64,
    pub configuration: usize,
    pub label: String,
    pub cost: f64,
}

/// What limits a ladder's best configuration.
#[derive(Debug, Clone, Serialize)]
pub struct FloorReport {
    pub ladder: String,
    pub configuration: usize,
    pub label: String,
    /// Of the bakes that are compared.
    pub seed: u64,
    /// With nothing switched off.
    pub error_relative: Option<f64>,
    pub causes: Vec<FloorCause>,
}

#[derive(Debug, Clone, Serialize)]
pub struct FloorCause {
    pub cause: &'static str,
    /// How it is switched off.
    pub how: String,
    /// What is left of the error without it.
    pub error_relative: Option<f64>,
    /// Share of the squared error that goes with it; negative where it hid another.
    pub share: Option<f64>,
}

/// Methods at equal cost.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "held", rename_all = "snake_case")]
pub enum EqualReport {
    /// Sets of configurations on the same grid.
    Positions { sets: Vec<EqualSet> },
    /// Each method's error along its front at some budgets.
    Bytes { budgets: Vec<EqualBudget> },
}

#[derive(Debug, Clone, Serialize)]
pub struct EqualSet {
    /// Values of the ladder's axes; empty where there are none.
    pub axes: Vec<AxisValue>,
    pub entries: Vec<EqualEntry>,
}

#[derive(Debug, Clone, Serialize)]
pub struct EqualEntry {
    pub method: String,
    pub configuration: usize,
    /// Whether probes stand and are active as those of the first entry, with every seed: a method's visibility decides which probes
    /// are moved and which are seen.
    pub same_probes: bool,
    pub error_relative: Option<f64>,
    pub leak_light: Option<f64>,
    pub bytes: Option<f64>,
    pub bake_s: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub struct EqualBudget {
    pub bytes: f64,
    pub entries: Vec<BudgetEntry>,
}

#[derive(Debug, Clone, Serialize)]
pub struct BudgetEntry {
    pub method: String,
    /// Whether any of its configurations is that small.
    pub fits: bool,
    /// Between its configurations on logarithmic axes; `null` where it does not fit.
    pub error_relative: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aggregates_have_the_closed_form() {
        let all = Aggregate::of(&[Some(1.0), Some(2.0), Some(6.0)]);
        assert_eq!((all.mean, all.min, all.max), (Some(3.0), Some(1.0), Some(6.0)));
        // Σ(x − 3)² = 14; ÷ (3·2), root.
        assert!((all.standard_error.unwrap() - (14.0f64 / 6.0).sqrt()).abs() < 1e-12);
        assert_eq!(Aggregate::of(&[Some(1.0)]).standard_error, None);
        assert_eq!(all.typical(), Some(3.0));
        let grids = Aggregate::over_grids(&[Some(1.0), Some(2.0), Some(4.0)]);
        assert!((grids.typical().unwrap() - 2.0).abs() < 1e-12 && (grids.mean.unwrap() - 7.0 / 3.0).abs() < 1e-12);
        // A leak of 0 on one grid has no logarithm.
        assert_eq!(Aggregate::over_grids(&[Some(0.0), Some(2.0)]).typical(), Some(1.0));
        assert_eq!(Aggregate::over_grids(&[None, Some(2.0)]), Aggregate::default());
        for odd in [&[][..], &[Some(1.0), None], &[Some(f64::NAN)]] {
            assert_eq!(Aggregate::of(odd), Aggregate::default());
        }
    }
}
