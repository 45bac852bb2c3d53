//! The report of a reference, as JSON.

use serde::Serialize;

use super::header::Header;

/// Version of the layout of the report.
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
    /// See [`crate::light::path::PathSettings::firefly_clamp`]. If it is set, the result is biased.
    pub firefly_clamp: Option<f32>,
    /// Samples per pixel in the file.
    pub spp: u32,
    /// Samples per pixel that an earlier run had traced.
    pub spp_resumed: u32,
    /// Rays of all samples along paths (`primary`) and towards lights (`shadow`).
    pub rays: Rays,
    /// Times of this run, seconds.
    pub time_s: ReferenceTimes,
    /// Rays of this run ÷ `time_s.trace`. `null` if this run added no samples.
    pub rays_per_s: Option<f64>,
    /// Mean of `irradiance_indirect` over pixels and channels, W·m⁻².
    pub irradiance_indirect_mean: Option<f64>,
    /// Noise of `irradiance_indirect`, W·m⁻². `null` below two blocks of 16 samples.
    pub noise: Option<NoiseReport>,
    /// Number of samples that were not finite. They count as 0.
    pub non_finite: u64,
    /// Lights, emissive materials and sky texels of the scene, and points of the picture lit by punctual lights, whose light
    /// exceeds the largest that is computed with, 10³⁰ per channel, and is clamped to it.
    pub light_clamped: u64,
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
    /// Standard error of a pixel's mean, averaged over pixels and channels.
    pub mean_standard_error: f64,
    /// `mean_standard_error` ÷ `mean`. `null` if the picture is black.
    pub relative: Option<f64>,
    /// Root of the mean variance. This is the RMSE that noise alone causes.
    pub rms_standard_error: f64,
}
