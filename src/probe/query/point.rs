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

impl Visibility {
    /// What is known of a point that sees these corners; of 0 nothing is known.
    #[inline]
    pub fn of_mask(mask: u8) -> Visibility {
        if mask == 0 { Visibility::Stored } else { Visibility::Exact(mask) }
    }
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

    /// The corners whose probes count, each with its share of all weights; `None` where there are none.
    #[inline]
    pub fn shares(&self) -> Option<impl Iterator<Item = (usize, f32)>> {
        let total = self.total();
        if total <= 0.0 {
            return None;
        }
        // Crushed weights may be so small that the reciprocal of their sum overflows; their shares are the same.
        let lift = if total < f32::MIN_POSITIVE { 1.0 / f32::MIN_POSITIVE } else { 1.0 };
        let per_total = 1.0 / (total * lift);
        let counted = self.weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0);
        Some(counted.map(move |(corner, weight)| (corner, weight * lift * per_total)))
    }
}
