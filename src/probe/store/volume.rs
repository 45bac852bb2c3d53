//! Probes ready to be asked: decoded to floats, in memory.

use glam::Vec3;

use super::layout::LayoutSettings;
use super::radiance::Radiance;
use super::{Irradiance, Occlusion};
use crate::probe::lattice::{Grid, ProbeIndex, ProbeState};

#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    pub grid: Grid,
    pub states: Vec<ProbeState>,
    /// Relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    pub irradiance: Irradiance,
    pub occlusion: Occlusion,
    pub radiance: Radiance,
    /// How its bytes are counted.
    pub layout: LayoutSettings,
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
        let head = self.layout.head_bytes(moved) + self.irradiance.runtime_bytes();
        let (field, levels) = self.radiance.runtime_bytes(self.layout.g_buffer);
        let own = (head + field + levels) as f64 + self.grid.runtime_bytes(moved);
        own + self.occlusion.runtime_bytes(self.states.len(), &self.layout)
    }
}
