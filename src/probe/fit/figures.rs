//! What a fit achieves at points that it has not seen.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::points::Asked;
use super::settings::Kind;
use super::targets::Target;
use crate::light::sampled::RayCount;
use crate::probe::query::Answers;

/// What a fit did. RMSE are ÷ the mean irradiance, of all channels, without the noise of the paths; `null` where nothing is
/// lit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitFigures {
    /// Points that the probes were fitted to.
    pub rows: usize,
    /// Points that were kept from the fit.
    pub rows_held_out: usize,
    /// Points without a row, because what is stored gives too much weight to hidden probes there, or knows none.
    pub rows_dropped: usize,
    /// From each of them, mean.
    pub paths: f64,
    /// Of the solver.
    pub iterations: u32,
    /// RMSE at the held-out points of surfaces, with their own normals, those without a row included.
    pub held_out_before: Option<f64>,
    pub held_out_after: Option<f64>,
    /// The same with bent normals, as normal maps have them; `None` where no row has one.
    pub held_out_bent_before: Option<f64>,
    pub held_out_bent_after: Option<f64>,
    /// RMSE at the held-out points of the air, with exact visibility.
    pub air_before: Option<f64>,
    pub air_after: Option<f64>,
    /// Share of the held-out points of surfaces at which the sum is not above 0 in a channel that is lit.
    pub negative_share: f64,
    /// Paths that were not finite, and count as 0.
    pub non_finite: u64,
    pub rays: RayCount,
    pub time_s: f64,
}

impl FitFigures {
    /// What a file says of it: no times, which differ from run to run.
    pub fn record(&self) -> Value {
        json!({
            "rows": self.rows,
            "rows_held_out": self.rows_held_out,
            "rows_dropped": self.rows_dropped,
            "paths": self.paths,
            "iterations": self.iterations,
            "held_out_before": self.held_out_before,
            "held_out_after": self.held_out_after,
            "held_out_bent_before": self.held_out_bent_before,
            "held_out_bent_after": self.held_out_bent_after,
            "air_before": self.air_before,
            "air_after": self.air_after,
            "negative_share": self.negative_share,
        })
    }

    /// The same for a report.
    pub fn report(&self) -> Value {
        let mut report = self.record();
        report["rays"] = json!({ "primary": self.rays.primary, "shadow": self.rays.shadow });
        report["time_s"] = json!(self.time_s);
        report
    }
}

/// Errors at the held-out points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Residuals {
    pub surface: Option<f64>,
    pub bent: Option<f64>,
    pub air: Option<f64>,
    pub negative: f64,
}

/// How far look-ups are from the targets.
pub fn residuals(look_up: &impl Answers, asked: &[Asked], targets: &[Target]) -> Residuals {
    let held: Vec<(&Asked, &Target)> = asked.iter().zip(targets).filter(|(asked, _)| asked.is_held_out).collect();
    let found: Vec<Vec3> =
        held.par_iter().map(|(asked, _)| look_up.irradiance(&asked.query, asked.visibility)).collect();
    let of_kind = |kind: Kind| {
        let own = || held.iter().zip(&found).filter(move |((asked, _), _)| asked.kind == kind);
        // Both runs have the same mean and independent noise.
        let square = |((_, target), found): (&(&Asked, &Target), &Vec3)| {
            let [first, second] = target.runs.map(|run| found.as_dvec3() - run.as_dvec3());
            first * second
        };
        let squares: DVec3 = own().map(square).sum();
        let light: DVec3 = own().map(|((_, target), _)| target.mean().as_dvec3()).sum();
        let count = 3.0 * own().count() as f64;
        let (mean, square) = (light.element_sum() / count, squares.element_sum() / count);
        (mean > 0.0).then(|| square.max(0.0).sqrt() / mean)
    };
    let surface = || held.iter().zip(&found).filter(|((asked, _), _)| asked.kind == Kind::Surface);
    let is_black = |((_, target), found): &(&(&Asked, &Target), &Vec3)| {
        (found.cmple(Vec3::ZERO) & target.mean().cmpgt(Vec3::ZERO)).any()
    };
    let negative = surface().filter(is_black).count() as f64 / (surface().count() as f64).max(1.0);
    let [surface, bent, air] = [Kind::Surface, Kind::Bent, Kind::Air].map(of_kind);
    Residuals { surface, bent, air, negative }
}
