//! What a bake counts and times.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Rays {
    pub primary: u64,
    pub shadow: u64,
    /// Rays that classified the probes and surveyed visibility at the surfaces.
    pub survey: u64,
}

#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Times {
    pub load: f64,
    pub accel_build: f64,
    /// Classifying probes and surveying visibility at the surfaces.
    pub survey: f64,
    pub capture: f64,
    pub bounces: f64,
    /// Choosing, tracing and solving the rows of a fit.
    pub fit: f64,
    pub filter: f64,
    pub encode: f64,
    pub write: f64,
    pub total: f64,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct Numerics {
    pub non_finite: u64,
    /// Values outside the storage format's range, per tensor.
    pub clamped: BTreeMap<String, u64>,
    /// Values above 0 that are too small for the storage format, and stored as 0, per tensor.
    pub underflowed: BTreeMap<String, u64>,
    pub variance_floor_hits: u64,
    pub hits_outside_volume: u64,
    pub probes_inside_geometry: usize,
    pub dropped_triangles: u64,
    /// Materials whose albedo can exceed `materials.albedo_max`, and is clamped to it.
    pub albedo_clamped: u64,
    /// Lights, emissive materials and sky texels of the scene, and captured hits, whose light exceeds the largest that is
    /// computed with, 10³⁰ per channel, and is clamped to it.
    pub light_clamped: u64,
}
