//! Probes ready to be asked: decoded to floats, in memory.

use glam::{Vec2, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::{Grid, ProbeIndex};
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::surface::SurfaceVisibility;
use std::f32::consts::PI;

/// The domain in which irradiance is stored and bilinearly filtered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IrradianceCurve {
    Linear,
    /// (E/2π)^(1/5), which spends its bits where the eye does (Majercik et al. 2019).
    #[serde(rename = "gamma5_over_2pi")]
    Gamma5Over2Pi,
}

impl IrradianceCurve {
    /// Stored value of an irradiance, W·m⁻²; inverse of [`Self::decode`].
    pub fn encode(self, irradiance: Vec3A) -> Vec3A {
        match self {
            IrradianceCurve::Linear => irradiance,
            IrradianceCurve::Gamma5Over2Pi => (irradiance.max(Vec3A::ZERO) / (2.0 * PI)).powf(0.2),
        }
    }

    /// Irradiance, W·m⁻², of a stored value; inverse of [`Self::encode`].
    #[inline]
    pub fn decode(self, stored: Vec3A) -> Vec3A {
        match self {
            IrradianceCurve::Linear => stored,
            IrradianceCurve::Gamma5Over2Pi => {
                let squared = stored * stored;
                squared * squared * stored * (2.0 * PI)
            }
        }
    }

    /// Name in the file's metadata.
    pub fn name(self) -> &'static str {
        match self {
            IrradianceCurve::Linear => "linear",
            IrradianceCurve::Gamma5Over2Pi => "gamma5_over_2pi",
        }
    }
}

#[derive(Debug, Clone)]
pub struct Volume {
    pub grid: Grid,
    pub states: Vec<ProbeState>,
    /// Relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    /// In the domain of `curve`; four floats a texel, so that a look-up adds whole registers.
    pub irradiance: OctahedralMaps<Vec3A>,
    pub curve: IrradianceCurve,
    /// Mean and standard deviation of distance, metres.
    pub distance: Option<OctahedralMaps<Vec2>>,
    pub surface_visibility: Option<SurfaceVisibility>,
}

impl Volume {
    pub fn is_active(&self, probe: ProbeIndex) -> bool {
        self.states[probe.0 as usize] == ProbeState::Active
    }

    pub fn active_count(&self) -> usize {
        self.states.iter().filter(|&&s| s == ProbeState::Active).count()
    }

    pub fn position(&self, probe: ProbeIndex) -> Vec3 {
        self.positions[probe.0 as usize]
    }

    /// Irradiance stored in one probe around the direction of these taps, W·m⁻².
    pub fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        let taps = self.irradiance.taps(crate::math::octahedral::oct_from_direction(normal));
        self.curve.decode(self.irradiance.sample(probe.0 as usize, &taps)).into()
    }
}
