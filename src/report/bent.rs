//! Figures of bent normals: what surfaces with normal maps get, at points of the picture.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::error::at_points::error_at_points;
use crate::shade::point_truth::PointTruth;

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BentFigures {
    /// Points of the picture with bent normals.
    pub points: usize,
    /// Root mean square difference from paths at the same points and normals, all channels, ÷ the mean luminance of these: as
    /// `error.nrmse`. The paths' own noise is subtracted. `null` without a traced reference, and in the dark.
    pub error: Option<f64>,
    pub standard_error: BentErrors,
}

/// What the noise of the paths leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BentErrors {
    /// Of `error`; `null` where the noise is not known.
    pub error: Option<f64>,
}

impl BentFigures {
    /// Those that need no truth.
    pub fn of(irradiance: &[Vec3]) -> BentFigures {
        BentFigures { points: irradiance.len(), ..BentFigures::default() }
    }

    /// Adds the error.
    pub fn compare(&mut self, irradiance: &[Vec3], truth: &PointTruth) {
        let Some((error, standard_error)) = error_at_points(irradiance, truth) else { return };
        self.error = Some(error);
        self.standard_error.error = standard_error;
    }
}
