//! Figures of glossy light: the layer `glossy` against that of a reference of glossy transport.

use glam::Vec3;
use serde::Serialize;

use super::error::{self, ErrorReport};
use super::reference_layers::{ReferenceLayers, ReferenceNoise};
use super::timing::Timing;
use crate::shade::regions::Region;
use crate::shade::traced::RayFigures;

/// What a method's gloss costs, and how far it is off.
#[derive(Debug, Clone, Serialize)]
pub struct GlossyReport {
    /// Queries and shading of the gloss alone, all threads.
    pub shade_ms: Timing,
    /// What of a probe's bytes is there for gloss.
    pub bytes_per_probe: f64,
    /// Mean over the pixels that show a surface, luminance, W·m⁻²·sr⁻¹.
    pub radiance_mean: Option<f64>,
    /// Of the reflected radiance, W·m⁻²·sr⁻¹; `null` without a reference of glossy transport.
    pub error_gltf: Option<ErrorReport>,
    /// What error is left when parts are made exact, one more with each entry, or where a part is left out; empty without a
    /// reference.
    pub parts: Vec<GlossyPart>,
    /// Of rays that were traced in the probes; absent where none were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traced: Option<TracedRays>,
}

#[derive(Debug, Clone, Serialize)]
pub struct GlossyPart {
    pub name: &'static str,
    pub error_gltf: ErrorReport,
}

/// Per ray, in the mean.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct TracedRays {
    pub probes: f64,
    pub reads: f64,
    /// Share of the rays whose end no probe knows.
    pub lost: f64,
}

impl TracedRays {
    /// `None` without rays.
    pub fn of(figures: &RayFigures) -> Option<TracedRays> {
        let rays = figures.rays as f64;
        let per_ray = |x: u64| x as f64 / rays;
        let RayFigures { probes, reads, lost, .. } = *figures;
        (figures.rays > 0).then(|| TracedRays { probes: per_ray(probes), reads: per_ray(reads), lost: per_ray(lost) })
    }
}

/// The error of a layer of reflected radiance; `own_variance`: of the layer itself, per channel, where it has noise of its own.
pub fn measure(
    reference: &ReferenceLayers,
    radiance: &[Vec3],
    own_variance: Option<&[Vec3]>,
    regions: &[Option<Region>],
) -> ErrorReport {
    let Some((own, noise)) = own_variance.zip(reference.noise.as_ref()) else {
        return error::measure(reference, radiance, regions, None);
    };
    // Noise of either side of a difference counts alike.
    let variance = noise.variance.iter().zip(own).map(|(a, b)| *a + *b).collect();
    let noise = Some(ReferenceNoise { variance, covariance: None, blocks: noise.blocks });
    error::measure(&ReferenceLayers { noise, ..reference.clone() }, radiance, regions, None)
}
