//! The report of a reference, as JSON.

use serde::Serialize;

use super::header::Header;

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-reference/1";

#[derive(Debug, Clone, Serialize)]
pub struct ReferenceReport {
    #[serde(flatten)]
    pub header: Header,
    pub camera: String,
    pub width: u32,
    pub height: u32,
    pub transport: String,
    pub max_bounces: Option<u32>,
    /// With it the result is biased.
    pub firefly_clamp: Option<f32>,
    /// Samples per pixel in the file.
    pub spp: u32,
    /// Of them those that were there before this run.
    pub spp_resumed: u32,
    /// Along paths (`primary`) and towards lights (`shadow`), of all samples.
    pub rays: Rays,
    /// Of this run.
    pub time_s: ReferenceTimes,
    /// Rays of this run ÷ `time_s.trace`; `null` where there was nothing to add.
    pub rays_per_s: Option<f64>,
    /// Of `irradiance_indirect`, W·m⁻²; absent below two blocks of 16 samples.
    pub noise: Option<NoiseReport>,
    /// Samples that were not finite and count as 0.
    pub non_finite: u64,
    pub peak_memory_bytes: u64,
}

#[derive(Debug, Clone, Copy, Serialize)]
pub struct Rays {
    pub primary: u64,
    pub shadow: u64,
}

#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct ReferenceTimes {
    pub load: f64,
    pub accel_build: f64,
    pub trace: f64,
    pub write: f64,
    pub total: f64,
}

#[derive(Debug, Clone, Copy, Serialize)]
pub struct NoiseReport {
    /// Mean of the irradiance over pixels and channels.
    pub mean: f64,
    /// Mean over pixels and channels of the standard error of the pixel's mean.
    pub mean_standard_error: f64,
    /// That ÷ `mean`; `null` in the dark.
    pub relative: Option<f64>,
    /// Root of the mean variance: the RMSE that noise alone makes.
    pub rms_standard_error: f64,
}
