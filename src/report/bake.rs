//! The report of a bake, as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::header::Header;
use super::target::TargetReport;
use crate::bake::figures::{Numerics, Rays, Times};
use crate::plan::Line;
use crate::probe::transport::solver::{Bounce, Solution, Stopped};

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-bake/1";

#[derive(Debug, Clone, Serialize)]
pub struct BakeReport {
    #[serde(flatten)]
    pub header: Header,
    pub probes: usize,
    pub probes_active: usize,
    pub rays: Rays,
    pub time_s: Times,
    /// (primary + shadow) ÷ `time_s.capture`.
    pub rays_per_s: Option<f64>,
    /// The same rays replayed bare in the same order, with `--measure-raw`.
    pub raw_embree_rays_per_s: Option<f64>,
    pub peak_memory_bytes: u64,
    pub bytes_per_probe: BytesPerProbe,
    pub bounces: Vec<Bounce>,
    pub converged: bool,
    /// Largest Ritz value of the bounce operator, or the ratio of the last two changes where sweeps are not combined.
    pub spectral_radius_estimate: Option<f64>,
    pub solver: SolverReport,
    /// See [`FitFigures`](crate::probe::fit::FitFigures); absent without a fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<Value>,
    /// Absent where no error was to be reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetReport>,
    pub numerics: Numerics,
    pub plan: Vec<Line>,
}

#[derive(Debug, Clone, Serialize)]
pub struct BytesPerProbe {
    /// The method's GPU layout in full, borders included.
    pub runtime: f64,
    /// The same after the plan.
    pub runtime_kept: f64,
    /// What the method's source says instead, where it differs from what its own formats give and no one knows why.
    pub published: Option<u64>,
    /// File size ÷ probes.
    pub file: f64,
    /// Tensor size ÷ probes.
    pub tensors: BTreeMap<String, f64>,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct SolverReport {
    /// Sweeps over all probes, the first without a bounce.
    pub operator_applications: usize,
    /// Of these, from a combination of earlier sweeps.
    pub accelerated: usize,
    /// Largest texel that a sweep makes of irradiance 1 everywhere: a bound of the spectral radius, at most the largest
    /// albedo.
    pub operator_norm: Option<f64>,
    /// No texel is farther than this from the solution of the bounces' equations, W·m⁻²; storage apart.
    pub error_bound: Option<f64>,
    /// The same ÷ largest irradiance texel.
    pub error_bound_relative: Option<f64>,
    /// How often a colour channel went on without combining iterations, because combining had made its residual larger.
    pub plain_fallbacks: u64,
    /// Texels that a combination had left negative. A plain iteration went on from them as 0.
    pub negative_texels: u64,
    /// Why frames or traced iterations ended: settled, or limit.
    pub stopped: Option<Stopped>,
}

impl SolverReport {
    pub fn of(solution: &Solution) -> SolverReport {
        SolverReport {
            operator_applications: solution.bounces.len() + solution.probing_applications,
            accelerated: solution.bounces.iter().filter(|bounce| bounce.accelerated).count(),
            operator_norm: solution.norm_bound(),
            error_bound: solution.error_bound,
            error_bound_relative: solution.error_bound_relative,
            plain_fallbacks: solution.plain_fallbacks,
            negative_texels: solution.negative_texels,
            stopped: solution.stopped,
        }
    }
}
