//! The report of a render, as JSON.

use serde::Serialize;

use super::air::AirFigures;
use super::baked::BakedReport;
use super::bent::BentFigures;
use super::error::ErrorReport;
use super::glossy::GlossyReport;
use super::header::Header;
use super::leak::Leak;
pub use super::timing::Timing;

/// Version of the report's layout.
pub const SCHEMA: &str = "lightprobe-render/1";

#[derive(Debug, Clone, Serialize)]
pub struct RenderReport {
    /// Its configuration is that of the bake.
    #[serde(flatten)]
    pub header: Header,
    /// Of the probes' bake; `null` where their file does not say.
    pub bake_seed: Option<u64>,
    /// Whether the probes were baked from other bytes than the scene now has (`--allow-scene-change`).
    pub scene_changed: bool,
    pub camera: String,
    pub width: u32,
    pub height: u32,
    /// Image points that show a surface.
    pub points: usize,
    /// As `light_clamped` of a reference.
    pub light_clamped: u64,
    /// Of all of the run's PNG pictures: they show radiance × 2^this.
    pub exposure_ev: f32,
    pub probes: usize,
    pub probes_active: usize,
    pub time_s: RenderTimes,
    pub peak_memory_bytes: u64,
    /// What the methods' `error` compares with.
    pub reference: Option<ReferenceSummary>,
    /// The file's probes against the same probes lit by full paths; `null` without a traced reference.
    pub baked: Option<BakedReport>,
    /// Whether the probes hold fitted values: then `visibility_off` says nothing of the method, for they were fitted with its
    /// visibility. Absent where they do not.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
    /// Why `baked` is `null` although it was asked for; absent where it was not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baked_reason: Option<&'static str>,
    /// The engine whose export was shaded in place of a probe file: all methods look up as it does. Absent for probe files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub export: Option<&'static str>,
    pub methods: Vec<MethodReport>,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct ReferenceSummary {
    /// As it was given; `null` where the reference was traced.
    pub file: Option<String>,
    /// Samples per pixel; `null` where a file does not say.
    pub spp: Option<u32>,
    /// Spent on tracing it, in the run that did.
    pub time_s: Option<f64>,
    /// Mean over the pixels that show a surface, luminance, W·m⁻².
    pub irradiance_indirect_mean: Option<f64>,
    /// Mean over these pixels of the standard error of that luminance, W·m⁻²; `null` where the noise is not known.
    pub standard_error_mean: Option<f64>,
}

#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct RenderTimes {
    pub load: f64,
    pub accel_build: f64,
    /// Primary rays and shadow rays of punctual lights.
    pub primary: f64,
    pub total: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct MethodReport {
    pub name: &'static str,
    /// Queries and shading of the whole picture, all threads, without rays.
    pub shade_ms: Timing,
    /// Rays that this method needs besides the queries: primary and shadow rays, with `visibility_ray` also those to
    /// the probes.
    pub ray_ms: f64,
    /// One query on one thread.
    pub lookup_ns: Option<f64>,
    /// The same, with how far its runs differ.
    pub lookup_spread_ns: Option<Timing>,
    /// At run time, after the plan.
    pub bytes_per_probe: f64,
    /// Mean over the pixels that show a surface, luminance, W·m⁻².
    pub irradiance_indirect_mean: Option<f64>,
    pub leak: Leak,
    /// Share of the image's points that lie outside the probes' hull. They use the cells at its rim. `null` without
    /// points.
    pub outside_hull: Option<f64>,
    /// At random points of free air.
    pub air: AirFigures,
    /// At points of the picture with bent normals.
    pub bent: BentFigures,
    /// Against a reference of diffuse transport, as probes have it; `null` without one.
    pub error: Option<ErrorReport>,
    /// Against a reference with glossy transport, which probes do not have; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_gltf: Option<ErrorReport>,
    /// The light that surfaces reflect as gloss; absent where the probes hold none for it, and where the scene has no glossy
    /// material.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glossy: Option<GlossyReport>,
}
