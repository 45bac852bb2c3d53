//! What the points of a survey's voxel see together.

use glam::Vec3;

/// What points of a voxel's surfaces see.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// At most eight for each point.
    pub rays: u64,
    /// Points that see any probe at all. The others mostly lie inside solids where walls meet, and have no vote.
    pub points: u32,
    /// Off one of the others that lies in the open: what it faces is no back, nor so close that no one can be there.
    pub open: Option<Vec3>,
    /// How many points see each corner.
    pub visible: [u32; 8],
}

impl Tally {
    pub fn agrees(&self) -> bool {
        self.visible.iter().all(|&v| v == 0 || v == self.points)
    }

    /// Corners that more than half of the points see, or else those that the most see.
    pub fn majority(&self) -> u8 {
        let most = self.visible.into_iter().max().unwrap_or(0);
        let enough = most.min(self.points / 2 + 1);
        (0..8).fold(0, |mask, i| mask | u8::from(enough > 0 && self.visible[i] >= enough) << i)
    }
}
