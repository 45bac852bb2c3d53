//! What a bake says that was to reach an error.

use serde::Serialize;

/// Errors are relative RMSE of the indirect irradiance over the scene's surfaces, by look-ups of the file as it is written.
#[derive(Debug, Clone, Serialize)]
pub struct TargetReport {
    /// What was asked for.
    pub error: f64,
    /// Of the file that was written; `null` where no light arrives or there is no surface to judge it by.
    pub reached: Option<f64>,
    pub standard_error: Option<f64>,
    /// Whether `reached` with its standard error is at most `error`.
    pub met: bool,
    /// The same error over what each camera sees, as `error.nrmse` of `render`: surfaces count by the pixels they fill.
    pub seen: Vec<SeenReport>,
    /// Points on surfaces that bakes were judged at, and paths from each for the truth.
    pub points: usize,
    pub paths: u32,
    /// Bakes that may be made, without that for `noise`, and probes × `samples_factor` that each may have.
    pub most_bakes: usize,
    pub most_probes: u64,
    /// All bakes in their order.
    pub steps: Vec<StepReport>,
    /// Share of the first bake's error that its own random numbers have, from the same bake with another seed; `null` where
    /// none was made.
    pub noise: Option<NoiseReport>,
    pub stopped_because: StoppedBecause,
    /// The same in words.
    pub message: String,
    /// `null` where there is no such grid.
    pub next: Option<NextReport>,
    /// Of points, truth and all bakes.
    pub time_s: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct SeenReport {
    pub camera: String,
    /// `null` where the camera sees no light.
    pub error: Option<f64>,
    pub standard_error: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub struct StepReport {
    pub spacing_m: f64,
    /// Rows of the fit, or rays without one, ÷ those of the configuration.
    pub samples_factor: u32,
    pub probes: usize,
    pub error: Option<f64>,
    pub standard_error: Option<f64>,
    /// Of the file.
    pub bytes: u64,
    pub time_s: f64,
}

#[derive(Debug, Clone, Copy, Serialize)]
pub struct NoiseReport {
    pub error: f64,
    pub time_s: f64,
}

/// The bake that would come next.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct NextReport {
    pub spacing_m: f64,
    pub samples_factor: u32,
    pub predicted_error: f64,
    pub predicted_bytes: u64,
    pub predicted_time_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StoppedBecause {
    Reached,
    /// The next grid, or one that the error asks for at the pace so far, has more probes than allowed.
    Probes,
    /// The next bake needs more memory than there is.
    Memory,
    /// As many bakes were made as may be.
    Steps,
    /// Finer grids and more samples did not help.
    NotFalling,
    /// No light arrives at the surfaces, so that nothing is relative to it.
    Dark,
    /// No surface to judge a bake by.
    NoSurface,
}
