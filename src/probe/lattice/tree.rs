//! Which probe stands for which of a mixed grid's finest cells.
//!
//! Every cell that is not subdivided has a probe at its centre. `index[i]` holds, for the base cells (x fastest, then y, z)
//! and then for the children of subdivided cells breadth-first (child x + 2y + 4z), the number of the cell's probe, or the
//! number of probes plus that of the subdivided cell, whose children start at `base cells + 8 · its number`. Source: Fei
//! Yang, *Mixed-resolution Grid of Light Probes*, 2023.

use glam::UVec3;

use super::refine::MAX_LEVELS;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tree {
    /// Base cells along each axis.
    base: UVec3,
    levels: u32,
    index: Vec<i32>,
    probes: Vec<Leaf>,
}

/// A cell that has a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Leaf {
    /// Its lowest finest cell.
    low: UVec3,
    /// Finest cells along its side.
    width: u32,
}

impl Tree {
    /// Subdivides base cells at most `levels` times: the cell of a level and a coordinate in cells of that level where
    /// `divides` says so.
    pub fn new(base: UVec3, levels: u32, divides: impl Fn(u32, UVec3) -> bool) -> Tree {
        Tree::grow(base, levels, usize::MAX, |_, level, cell| divides(level, cell)).unwrap_or_else(|| Tree {
            base: UVec3::ZERO,
            levels,
            index: Vec::new(),
            probes: Vec::new(),
        })
    }

    /// The tree whose entries `divides` chooses by number, level and cell; `None` where it has more than `most` entries.
    fn grow(base: UVec3, levels: u32, most: usize, divides: impl Fn(usize, u32, UVec3) -> bool) -> Option<Tree> {
        let along = |n: u32| 0..n;
        let mut cells: Vec<(u32, UVec3)> = along(base.z)
            .flat_map(|z| along(base.y).flat_map(move |y| along(base.x).map(move |x| (0, UVec3::new(x, y, z)))))
            .collect();
        // Per cell the number of its probe, or −1 − that of its subdivision.
        let (mut found, mut probes, mut nodes) = (Vec::new(), Vec::new(), 0);
        let mut next = 0;
        while next < cells.len() {
            let (level, cell) = cells[next];
            if level < levels && divides(next, level, cell) {
                cells.extend((0..8).map(|i| (level + 1, cell * 2 + UVec3::new(i & 1, i >> 1 & 1, i >> 2))));
                if cells.len() > most {
                    return None;
                }
                nodes += 1;
                found.push(-nodes);
            } else {
                let width = 1 << (levels - level);
                found.push(probes.len() as i32);
                probes.push(Leaf { low: cell * width, width });
            }
            next += 1;
        }
        let count = probes.len() as i32;
        let index = found.into_iter().map(|entry| if entry < 0 { count - 1 - entry } else { entry }).collect();
        Some(Tree { base, levels, index, probes })
    }

    /// The tree of a file's index over so many finest cells.
    ///
    /// # Errors
    /// It is none of a grid of so many cells and levels.
    pub fn from_index(divisions: UVec3, levels: u32, index: Vec<i32>) -> Result<Tree, String> {
        let wrong = |what: &str| Err(format!("tensor 'grid_index' {what}"));
        let whole = 1u32 << levels.min(MAX_LEVELS);
        if !(1..=MAX_LEVELS).contains(&levels) || (divisions % whole).cmpne(UVec3::ZERO).any() {
            return wrong(&format!("does not fit {levels} levels of {divisions} cells"));
        }
        let base = divisions / whole;
        // The grid has counted its cells already: their product fits.
        let bases: usize = base.to_array().iter().map(|&n| n as usize).product();
        let Some(children) = index.len().checked_sub(bases).filter(|children| children % 8 == 0) else {
            return wrong(&format!("has {} entries for {bases} base cells", index.len()));
        };
        let probes = index.len() - children / 8;
        let divides = |i: usize, _, _| index.get(i).is_some_and(|&entry| entry as i64 >= probes as i64);
        match Tree::grow(base, levels, index.len(), divides) {
            Some(tree) if tree.index == index => Ok(tree),
            _ => wrong("is not that of a subdivided grid"),
        }
    }

    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Base cells.
    pub fn base_count(&self) -> usize {
        self.base.to_array().iter().map(|&n| n as usize).product()
    }

    pub fn probe_count(&self) -> usize {
        self.probes.len()
    }

    /// Subdivided cells.
    pub fn node_count(&self) -> usize {
        self.index.len() - self.probes.len()
    }

    /// What the file's index holds.
    pub fn index(&self) -> &[i32] {
        &self.index
    }

    /// The lowest finest cell of a probe's.
    pub fn low(&self, probe: u32) -> UVec3 {
        self.probes[probe as usize].low
    }

    /// Finest cells along the side of a probe's.
    #[inline]
    pub fn width(&self, probe: u32) -> u32 {
        self.probes[probe as usize].width
    }

    /// The probe whose cell covers a finest one.
    #[inline]
    pub fn probe(&self, cell: UVec3) -> u32 {
        let base = cell >> self.levels;
        let mut at = (base.x + self.base.x * (base.y + self.base.y * base.z)) as usize;
        let bases = self.base.x * self.base.y * self.base.z;
        let probes = self.probes.len() as u32;
        for level in (0..self.levels).rev() {
            let entry = self.index[at] as u32;
            if entry < probes {
                return entry;
            }
            let child = (cell >> level) & UVec3::ONE;
            at = (bases + (entry - probes) * 8 + child.x + 2 * child.y + 4 * child.z) as usize;
        }
        self.index[at] as u32
    }
}
