//! The words of trees, see [`super`].

use crate::probe::store::surface::Facing;

/// Bit of a word that ends.
pub const LEAF: u16 = 1 << 15;
/// Bit of a word that ends: a probe farther away follows.
pub const FAR: u16 = 1 << 14;
pub const AXIS_SHIFT: u32 = 13;
pub const THRESHOLD_SHIFT: u32 = 8;
/// Bits of the distance, and of the mask.
pub const LOW: u16 = 0xff;
/// Words of a number of 32 bits.
pub const NUMBER: usize = 2;

/// A number of two words.
pub fn number(words: &[u16]) -> u32 {
    u32::from(words[0]) | u32::from(words[1]) << 16
}

pub fn words_of(number: u32) -> [u16; NUMBER] {
    [number as u16, (number >> 16) as u16]
}

/// Words up to the next one that divides or ends.
pub fn length(word: u16) -> usize {
    let has_number = if word & LEAF != 0 { word & FAR != 0 } else { word & LOW == 0 };
    1 + if has_number { NUMBER } else { 0 }
}

/// Words from one that divides to the part at and beyond its threshold. `number` is that of the words behind it.
pub fn distance(word: u16, number: impl FnOnce() -> u32) -> usize {
    match word & LOW {
        0 => number() as usize,
        distance => usize::from(distance),
    }
}

/// A box of voxels and facings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub low: [u8; 4],
    /// One beyond the last.
    pub high: [u8; 4],
}

impl Part {
    /// A cell.
    pub fn whole(voxels_per_cell: u32) -> Part {
        let n = voxels_per_cell as u8;
        Part { low: [0; 4], high: [n, n, n, Facing::ALL.len() as u8] }
    }

    /// Below and beyond the plane of a word; `None` where the plane does not divide the box.
    pub fn divided(self, word: u16) -> Option<[Part; 2]> {
        let (axis, threshold) = (usize::from(word >> AXIS_SHIFT), (word >> THRESHOLD_SHIFT & 31) as u8);
        let (mut below, mut beyond) = (self, self);
        (below.high[axis], beyond.low[axis]) = (threshold, threshold);
        (self.low[axis] < threshold && threshold < self.high[axis]).then_some([below, beyond])
    }

    pub fn places(self) -> u64 {
        (0..4).map(|axis| u64::from(self.high[axis] - self.low[axis])).product()
    }
}
