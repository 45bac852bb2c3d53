//! What asks, and which weights it gets.

use glam::{Vec2, Vec3};

use crate::probe::lattice::ProbeIndex;
use crate::probe::store::surface::Facing;

/// A point that asks for irradiance.
#[derive(Debug, Clone, Copy)]
pub struct QueryPoint {
    /// Relative to the scene's origin, metres.
    pub position: Vec3,
    /// Shading normal, unit: irradiance is asked for around it.
    pub normal: Vec3,
    /// Geometric normal on the viewer's side, unit.
    pub geometric: Vec3,
    /// Its main direction.
    pub facing: Facing,
    /// Unit, towards the viewer; in the bake towards the probe.
    pub view: Vec3,
}

/// Where the visibility factor comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visibility {
    /// 1 for every probe.
    Off,
    /// What the method stores.
    Stored,
    /// Bit i: whether corner i of the point's cell, see [`Query::cell`](super::Query::cell), is visible.
    Exact(u8),
}

/// The eight probes of a point, in the order of [`Grid::corners_around`](crate::probe::Grid::corners_around), with their weights, not normalised.
#[derive(Debug, Clone, Copy)]
pub struct CornerWeights {
    pub probes: [ProbeIndex; 8],
    pub weights: [f32; 8],
}

/// What one probe adds to a look-up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub probe: ProbeIndex,
    /// All shares of a look-up sum to 1.
    pub share: f32,
    /// Direction that the probe's irradiance is read around.
    pub oct: Vec2,
    /// From the probe to the point, in the probe's spacings, clipped.
    pub offset: Vec3,
}

impl CornerWeights {
    #[inline]
    pub fn total(&self) -> f32 {
        self.weights.iter().sum()
    }
}
