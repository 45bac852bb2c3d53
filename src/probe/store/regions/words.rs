//! The words of trees, see [`super`].

use glam::Vec3;

use crate::probe::store::surface::Facing;

/// Bit of a word that ends.
pub const LEAF: u16 = 1 << 15;
/// Bit of a word that ends: a probe farther away follows.
pub const FAR: u16 = 1 << 14;
pub const AXIS_SHIFT: u32 = 13;
pub const THRESHOLD_SHIFT: u32 = 8;
/// Bits of the distance, and of the mask.
pub const LOW: u16 = 0xff;
/// Axis of facings.
pub const FACINGS: usize = 3;
/// Thresholds between facings end below; those from here on are walls across the axes x, y and z.
pub const WALLS: u16 = 8;
/// Most walls on the way to any part.
pub const MOST_WALLS: u8 = 4;
/// Words of a number of 32 bits.
pub const NUMBER: usize = 2;

/// A number of two words.
pub fn number(words: &[u16]) -> u32 {
    u32::from(words[0]) | u32::from(words[1]) << 16
}

pub fn words_of(number: u32) -> [u16; NUMBER] {
    [number as u16, (number >> 16) as u16]
}

/// The axis of a word that divides, and its threshold.
pub fn plane_of(word: u16) -> (usize, u16) {
    (usize::from(word >> AXIS_SHIFT), word >> THRESHOLD_SHIFT & 31)
}

/// The axis that the wall of a word lies across; `None` where it is another plane.
pub fn wall_axis(word: u16) -> Option<usize> {
    let (axis, threshold) = plane_of(word);
    (word & LEAF == 0 && axis == FACINGS && threshold >= WALLS).then(|| usize::from(threshold - WALLS))
}

/// Words before the number of a word that divides: itself, and the place of a wall.
pub fn head(word: u16) -> usize {
    1 + usize::from(wall_axis(word).is_some())
}

/// Words up to the next one that divides or ends.
pub fn length(word: u16) -> usize {
    let (head, has_number) = if word & LEAF != 0 { (1, word & FAR != 0) } else { (head(word), word & LOW == 0) };
    head + if has_number { NUMBER } else { 0 }
}

/// From a word that divides to the part at and beyond its threshold. `behind` are the words after it.
pub fn distance(word: u16, behind: &[u16]) -> usize {
    match word & LOW {
        0 => number(&behind[head(word) - 1..]) as usize,
        distance => usize::from(distance),
    }
}

/// A thin wall across a cell: what is before it sees otherwise than what is behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    pub axis: usize,
    /// Share of the cell's side, times 2¹⁶.
    pub place: u16,
}

impl Plane {
    /// Shares of a cell's side that points of the wall itself may be off its middle: rounding, and half a thickness of paper.
    pub const THICKNESS: f32 = 1.0 / 1024.0;

    pub fn share(self) -> f32 {
        f32::from(self.place) / 65536.0
    }

    /// Whether a point of the cell, in shares of its sides, is on the lower side. On the wall its facing tells.
    #[inline]
    pub fn is_below(self, point: Vec3, facing: Facing) -> bool {
        let beyond = point[self.axis] - self.share();
        let own = usize::from(facing.index()) / 2 == self.axis;
        if beyond.abs() <= Plane::THICKNESS && own { facing.index() % 2 == 1 } else { beyond < 0.0 }
    }

    /// The layer of voxels that it lies in.
    pub fn layer(self, voxels_per_cell: u32) -> u8 {
        ((u32::from(self.place) * voxels_per_cell) >> 16) as u8
    }

    pub fn words(self) -> [u16; 2] {
        [(FACINGS as u16) << AXIS_SHIFT | (WALLS + self.axis as u16) << THRESHOLD_SHIFT, self.place]
    }
}

/// A box of voxels and facings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub low: [u8; 4],
    /// One beyond the last.
    pub high: [u8; 4],
    /// Walls that may still divide it.
    pub walls: u8,
}

impl Part {
    /// A cell.
    pub fn whole(voxels_per_cell: u32) -> Part {
        let n = voxels_per_cell as u8;
        Part { low: [0; 4], high: [n, n, n, Facing::ALL.len() as u8], walls: MOST_WALLS }
    }

    /// Below and beyond the plane of a word with those behind it; `None` where the plane does not divide the box, or there are too
    /// many walls. The voxels at a wall are on both sides: those that it passes through, and the next, for it may lie between.
    pub fn divided(self, word: u16, behind: &[u16], voxels_per_cell: u32) -> Option<[Part; 2]> {
        let (mut below, mut beyond) = (self, self);
        let Some(axis) = wall_axis(word) else {
            let (axis, threshold) = (plane_of(word).0, plane_of(word).1 as u8);
            (below.high[axis], beyond.low[axis]) = (threshold, threshold);
            return (self.low[axis] < threshold && threshold < self.high[axis]).then_some([below, beyond]);
        };
        let layer = Plane { axis, place: *behind.first()? }.layer(voxels_per_cell);
        let left = self.walls.checked_sub(1).filter(|_| axis < FACINGS)?;
        (below.walls, beyond.walls) = (left, left);
        // A wall that lies beyond the part leaves all of it on either side: what is in the wall itself is on both.
        if (self.low[axis]..self.high[axis]).contains(&layer) {
            below.high[axis] = below.high[axis].min(layer + 2);
            beyond.low[axis] = beyond.low[axis].max(layer.saturating_sub(1));
        }
        Some([below, beyond])
    }

    pub fn places(self) -> u64 {
        (0..4).map(|axis| u64::from(self.high[axis] - self.low[axis])).product()
    }
}
