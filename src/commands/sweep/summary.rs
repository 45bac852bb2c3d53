//! From runs to the report.

use std::collections::BTreeMap;

use crate::cli::{EqualName, SweepArgs};
use crate::commands::session::Session;
use crate::config::Config;
use crate::report::render::ReferenceSummary;
use crate::report::sweep::{
    Aggregate, AxisValue, Cheapest, CheapestAt, ConfigurationReport, ERROR_FIGURE, FloorReport, LadderReport,
    MethodFigures, PerFront, RunRecord, SCHEMA, SweepReport, SweepTimes,
};
use crate::scene::Camera;
use crate::shade::points::View;
use crate::shade::visibility_modes::VisibilityMode;
use crate::sweep::equal;
use crate::sweep::front::{cheapest, levels, pareto};
use crate::sweep::ladder::{Ladder, Rung};
use crate::sweep::split::Split;

/// A configuration after all its runs.
pub struct Outcome {
    /// Of its first run.
    pub config: Config,
    pub report: ConfigurationReport,
}

/// A figure of a run; of a method where it differs between them.
type Figure = fn(&RunRecord, &MethodFigures) -> Option<f64>;

/// Figures over the seeds, by the names that the report has.
const FIGURES: &[(&str, Figure)] = &[
    ("bake_s", |r, _| Some(r.bake_s)),
    ("bytes", |r, _| Some(r.bytes)),
    ("bytes_per_probe", |r, _| Some(r.bytes_per_probe)),
    ("file_bytes", |r, _| Some(r.file_bytes as f64)),
    ("shade_ms", |_, m| Some(m.shade_ms)),
    ("lookup_ns", |_, m| m.lookup_ns),
    ("leak_light", |_, m| m.leak.light),
    ("leak_dark", |_, m| m.leak.dark),
    ("leak_fraction", |_, m| m.leak.fraction),
    ("leak_unseen", |_, m| Some(m.leak.unseen)),
    ("leak_blocks", |_, m| m.leak.blocks),
    ("leak_dark_region", |_, m| m.leak.dark_region),
    ("outside_hull", |_, m| m.outside_hull),
    ("air_error", |_, m| m.air.error),
    ("air_leak_light", |_, m| m.air.leak_light),
    ("air_leak_dark", |_, m| m.air.leak_dark),
    ("air_black", |_, m| m.air.black),
    ("error_relative", |_, m| m.error_relative),
    ("error_corner", |_, m| m.error_corner),
    ("error_flat", |_, m| m.error_flat),
    ("error_bent", |_, m| m.bent.error),
    ("error_mae", |_, m| m.error.mae),
    ("error_rmse", |_, m| m.error.rmse),
    ("error_nrmse", |_, m| m.error.nrmse),
    ("error_relmse", |_, m| m.error.relmse),
    ("error_bias", |_, m| m.error.bias),
    ("error_flip", |_, m| m.error.flip),
    ("error_gltf", |_, m| m.glossy?.error_gltf),
    ("relmse_gltf", |_, m| m.glossy?.relmse_gltf),
    ("glossy_shade_ms", |_, m| m.glossy.map(|glossy| glossy.shade_ms)),
    ("glossy_bytes_per_probe", |_, m| m.glossy.map(|glossy| glossy.bytes_per_probe)),
];

impl Outcome {
    pub fn new(ladder: usize, rung: &Rung, runs: Vec<RunRecord>, split: Split, reference_mean: Option<f64>) -> Outcome {
        let value = |figure: Figure| -> Vec<Option<f64>> {
            runs.iter().map(|run| figure(run, run.method(VisibilityMode::On.name())?)).collect()
        };
        let over_runs = if rung.shifted.is_empty() { Aggregate::of } else { Aggregate::over_grids };
        let figures: BTreeMap<&'static str, Aggregate> =
            FIGURES.iter().map(|(name, figure)| (*name, over_runs(&value(*figure)))).collect();
        let relative = |value: Option<f64>| Some(value? / reference_mean?);
        let first = rung.configs().first().map_or(&rung.config, |(_, config)| config).clone();
        let report = ConfigurationReport {
            label: rung.label.clone(),
            ladder,
            axes: rung.axes.iter().map(|(key, value)| AxisValue { key: key.clone(), value: value.clone() }).collect(),
            config: rung.config.to_ron(),
            probes: runs.first().map_or(0, |run| run.probes),
            figures,
            noise_rms: split.noise_rms,
            noise_relative: relative(split.noise_rms),
            bias_rms: split.bias_rms,
            bias_relative: relative(split.bias_rms),
            ruled_by: split.ruled_by(),
            on_front: PerFront::default(),
            runs,
        };
        Outcome { config: first, report }
    }

    /// NaN where it is undefined, which is on no front.
    fn mean(&self, figure: &str) -> f64 {
        self.report.figures.get(figure).and_then(Aggregate::typical).unwrap_or(f64::NAN)
    }
}

/// Which of these are on the front of two figures.
fn front(outcomes: &[Outcome], which: &[usize], cost: &str, error: &str) -> Vec<usize> {
    let points: Vec<(f64, f64)> = which.iter().map(|&i| (outcomes[i].mean(cost), outcomes[i].mean(error))).collect();
    which.iter().zip(pareto(&points)).filter(|(_, on)| *on).map(|(i, _)| *i).collect()
}

fn fronts(outcomes: &[Outcome], which: &[usize]) -> PerFront<Vec<usize>> {
    PerFront {
        bake_s: front(outcomes, which, "bake_s", "error_relative"),
        bytes: front(outcomes, which, "bytes", "error_relative"),
        shade_ms: front(outcomes, which, "shade_ms", "error_relative"),
        leak_light: front(outcomes, which, "bytes", "leak_light"),
    }
}

/// The curves.
pub fn ladders(ladders: &[Ladder], outcomes: &[Outcome]) -> Vec<LadderReport> {
    let report = |(at, ladder): (usize, &Ladder)| {
        let configurations: Vec<usize> = (0..outcomes.len()).filter(|&i| outcomes[i].report.ladder == at).collect();
        let errors = configurations.iter().map(|&i| (i, outcomes[i].mean("error_relative")));
        let best = errors.filter(|(_, e)| e.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
        let of_bias = configurations.iter().map(|&i| &outcomes[i].report).filter(|c| c.ruled_by == Some("bias"));
        LadderReport {
            name: ladder.name.clone(),
            method: ladder.method.clone(),
            fronts: fronts(outcomes, &configurations),
            best,
            floor_relative: of_bias.filter_map(|c| c.bias_relative).reduce(f64::min),
            configurations,
        }
    };
    ladders.iter().enumerate().map(report).collect()
}

/// All that a report is made of.
pub struct Parts<'a> {
    pub args: &'a SweepArgs,
    pub session: &'a Session<'a>,
    pub camera: &'a Camera,
    pub view: &'a View,
    pub reference: ReferenceSummary,
    pub exposure_ev: f32,
    pub times: SweepTimes,
    pub offsets: Vec<[f64; 3]>,
    pub ladders: Vec<LadderReport>,
    pub outcomes: Vec<Outcome>,
    pub floor: Vec<FloorReport>,
}

pub fn report(parts: Parts) -> SweepReport {
    let Parts { args, mut outcomes, ladders, .. } = parts;
    let all: Vec<usize> = (0..outcomes.len()).collect();
    let whole = fronts(&outcomes, &all);
    for (i, m) in outcomes.iter_mut().enumerate() {
        m.report.on_front = PerFront {
            bake_s: whole.bake_s.contains(&i),
            bytes: whole.bytes.contains(&i),
            shade_ms: whole.shade_ms.contains(&i),
            leak_light: whole.leak_light.contains(&i),
        };
    }
    let errors: Vec<f64> = outcomes.iter().map(|m| m.mean("error_relative")).collect();
    let cheapest_by = |cost: &str| -> Vec<CheapestAt> {
        let points: Vec<(f64, f64)> = outcomes.iter().map(|m| (m.mean(cost), m.mean("error_relative"))).collect();
        let at = |level: f64| {
            let i = cheapest(&points, level)?;
            let label = outcomes[i].report.label.clone();
            Some(CheapestAt { error_relative: level, configuration: i, label, cost: points[i].0 })
        };
        levels(&errors).into_iter().filter_map(at).collect()
    };
    let cheapest = Cheapest { bake_s: cheapest_by("bake_s"), bytes: cheapest_by("bytes") };
    let config = outcomes.first().map(|m| m.report.config.clone()).unwrap_or_default();
    let configurations: Vec<ConfigurationReport> = outcomes.into_iter().map(|m| m.report).collect();
    let equal = args.equal.map(|held| match held {
        EqualName::Positions => equal::positions(&ladders, &configurations),
        EqualName::Bytes => equal::bytes(&ladders, &configurations),
    });
    let seed = args.trace.seed;
    SweepReport {
        header: parts.session.header(SCHEMA, "sweep", config),
        camera: parts.camera.name.clone(),
        width: parts.view.width,
        height: parts.view.height,
        points: parts.view.points.len(),
        exposure_ev: parts.exposure_ev,
        seeds: (0..u64::from(args.seeds)).map(|k| seed.wrapping_add(k)).collect(),
        offsets: parts.offsets,
        error_figure: ERROR_FIGURE,
        reference: parts.reference,
        time_s: parts.times,
        ladders,
        configurations,
        cheapest,
        floor: parts.floor,
        equal,
    }
}
