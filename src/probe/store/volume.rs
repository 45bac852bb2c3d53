//! Probes ready to be asked: decoded to floats, in memory.

use glam::Vec3;

use super::{Irradiance, Occlusion, head_bytes};
use crate::probe::lattice::{Grid, ProbeIndex, ProbeState};

#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    pub grid: Grid,
    pub states: Vec<ProbeState>,
    /// Relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    pub irradiance: Irradiance,
    pub occlusion: Occlusion,
}

impl Volume {
    pub fn is_active(&self, probe: ProbeIndex) -> bool {
        self.states[probe.0 as usize] == ProbeState::Active
    }

    pub fn active_count(&self) -> usize {
        self.active().count()
    }

    /// Indices of the probes that hold light, in their order.
    pub fn active(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.states.len()).filter(|&p| self.states[p] == ProbeState::Active)
    }

    pub fn position(&self, probe: ProbeIndex) -> Vec3 {
        self.positions[probe.0 as usize]
    }

    /// A probe's irradiance around a unit normal, W·m⁻².
    pub fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        self.irradiance.of(probe.0 as usize, normal)
    }

    /// Bytes per probe in the layout that shading uses; `moved`: whether positions are stored beside the grid's.
    pub fn runtime_bytes(&self, moved: bool) -> f64 {
        let own = (head_bytes(moved) + self.irradiance.runtime_bytes()) as f64;
        own + self.grid.runtime_bytes(moved) + self.occlusion.runtime_bytes(self.states.len())
    }
}
