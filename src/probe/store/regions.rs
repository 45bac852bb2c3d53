//! The table of visibility at surfaces as a tree per cell: what places next to one another see alike is said once.
//!
//! A [`SurfaceVisibility`] names the mask of every voxel and facing that has a surface. Neighbours mostly agree, so each cell
//! is divided instead by planes between voxels, and between facings, until every part holds entries of one mask alone. What
//! an entry answers stays the same. Every other voxel and facing gets the answer of the part it lies in, so that none is
//! without one; places in the air, from which rays tell what they see, decide about the rest of the planes. [`grow`] divides.
//!
//! Storage: u16 words, `roots[c]` the first of cell c's tree; cells with the same tree share it. A word below 2¹⁵ divides:
//! bits 13–14 axis (x, y, z, facing), bits 8–12 threshold t, bits 0–7 how many words farther on the part at and beyond t
//! begins. The part below t follows. Where 8 bits are too few they are 0, and two words with the distance (low, high) come
//! between. Thresholds of facings from 8 on are thin walls across x, y and z (8, 9, 10), and the word that follows is where:
//! 2¹⁶ times the share of the cell's side. Points on such a wall, within 1/1024 of the side, go by the way that they face. A word with bit 15 ends: bits 0–7 mask. Where the mask is 0 and bit 14 is set, two words follow, low and high, of
//! the number of a probe farther away that the surface sees.

mod grow;
#[cfg(test)]
mod tests;
mod words;

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;
use safetensors::Dtype;

pub use self::grow::{BELOW, BEYOND, CellAir, Rank, Wall, air_places, middle};
use self::words::{FACINGS, FAR, LEAF, LOW, Part, WALLS, distance, length, number, plane_of};
pub use self::words::{MOST_WALLS, Plane};
use super::surface::{Facing, MAX_VOXELS_PER_CELL, Seen, SurfaceVisibility, voxel_of};
use crate::probe::container::Container;
use crate::probe::lattice::grid::{Cell, CellIndex, Grid, ProbeIndex};

#[derive(Debug, Clone, PartialEq, Default)]
pub struct Regions {
    pub voxels_per_cell: u32,
    /// One a cell.
    roots: Vec<u32>,
    words: Vec<u16>,
}

impl Regions {
    /// The trees of a table. Entries answer as they do there, according to their `ranks`. The air answers about as `air` says of each
    /// cell, if anything. `walls` are those of each cell, or none.
    pub fn new(
        grid: &Grid,
        table: &SurfaceVisibility,
        ranks: &[Rank],
        air: &[CellAir],
        walls: &[Vec<Wall>],
    ) -> Regions {
        let unknown = CellAir::default();
        let air = |cell: u32| air.get(cell as usize).unwrap_or(&unknown);
        let walls = |cell: u32| walls.get(cell as usize).map_or(&[][..], Vec::as_slice);
        let trees: Vec<Vec<u16>> = (0..grid.cell_count() as u32)
            .into_par_iter()
            .map_init(grow::Grower::default, |grower, cell| {
                grower.tree(table, CellIndex(cell), ranks, air(cell), walls(cell))
            })
            .collect();
        let (mut roots, mut words) = (Vec::with_capacity(trees.len()), Vec::new());
        let mut known: HashMap<Vec<u16>, u32> = HashMap::new();
        for tree in trees {
            let next = words.len() as u32;
            let root = *known.entry(tree).or_insert_with_key(|tree| {
                words.extend(tree);
                next
            });
            roots.push(root);
        }
        Regions { voxels_per_cell: table.voxels_per_cell, roots, words }
    }

    /// What a point of a cell sees. `at` is a point of the cell, or stands for its nearest one; `facing` is the surface's main
    /// direction.
    #[inline]
    pub fn look_up(&self, grid: &Grid, cell: &Cell, at: Vec3, facing: Facing) -> Seen {
        let root = self.roots[grid.cell_index(cell).0 as usize] as usize;
        let leaf = self.leaf(root, grid.fraction_in(cell, at), facing);
        Seen { mask: self.mask(leaf), far: self.far(leaf) }
    }

    /// The word that ends at a point of a cell, in shares of its sides.
    #[inline]
    fn leaf(&self, root: usize, point: Vec3, facing: Facing) -> usize {
        let voxel = voxel_of(point, self.voxels_per_cell);
        let at = [voxel.x as u16, voxel.y as u16, voxel.z as u16, u16::from(facing.index())];
        let mut i = root;
        loop {
            let word = self.words[i];
            if word & LEAF != 0 {
                return i;
            }
            let (axis, threshold) = plane_of(word);
            let is_below = if axis == FACINGS && threshold >= WALLS {
                let wall = Plane { axis: usize::from(threshold - WALLS), place: self.words[i + 1] };
                wall.is_below(point, facing)
            } else {
                at[axis] < threshold
            };
            i += if is_below { length(word) } else { distance(word, &self.words[i + 1..]) };
        }
    }

    #[inline]
    fn mask(&self, leaf: usize) -> u8 {
        (self.words[leaf] & LOW) as u8
    }

    fn far(&self, leaf: usize) -> Option<ProbeIndex> {
        (self.words[leaf] & FAR != 0).then(|| ProbeIndex(number(&self.words[leaf + 1..])))
    }

    /// Roots and words, as the file has them.
    pub fn numbers(&self) -> (&[u32], &[u16]) {
        (&self.roots, &self.words)
    }

    /// Parts that all cells are divided into, shared ones once.
    pub fn parts(&self) -> usize {
        let mut parts = 0;
        let mut i = 0;
        while let Some(&word) = self.words.get(i) {
            parts += usize::from(word & LEAF != 0);
            i += length(word);
        }
        parts
    }

    /// Mean number of probes seen, over all voxels and facings of all cells.
    pub fn mean_visible(&self) -> f64 {
        let whole = Part::whole(self.voxels_per_cell);
        let mut known: HashMap<u32, f64> = HashMap::new();
        let of_cell = |&root: &u32| {
            *known.entry(root).or_insert_with(|| {
                let (seen, places) = self.seen(root as usize, whole);
                seen as f64 / places.max(1) as f64
            })
        };
        self.roots.iter().map(of_cell).sum::<f64>() / self.roots.len().max(1) as f64
    }

    /// Number of probes seen, summed over the places of a part, and these; those in a wall count on both sides.
    fn seen(&self, i: usize, part: Part) -> (u64, u64) {
        let (word, behind) = (self.words[i], &self.words[i + 1..]);
        if word & LEAF != 0 {
            return (part.places() * u64::from(self.mask(i).count_ones()), part.places());
        }
        part.divided(word, behind, self.voxels_per_cell).map_or((0, 0), |[below, beyond]| {
            let sides = [self.seen(i + length(word), below), self.seen(i + distance(word, behind), beyond)];
            (sides[0].0 + sides[1].0, sides[0].1 + sides[1].1)
        })
    }

    /// Bytes of its tensors.
    pub fn bytes(&self) -> u64 {
        (self.roots.len() * 4 + self.words.len() * 2) as u64
    }
}

/// Names in the file.
const TREES: &str = "visibility_tree";
const ROOTS: &str = "visibility_root";
const VOXELS_KEY: &str = "visibility.voxels_per_cell";

/// Whether a file holds trees.
pub fn is_in(container: &Container) -> bool {
    container.has(TREES) || container.has(ROOTS)
}

/// Writes the trees.
pub fn write(regions: &Regions, container: &mut Container) {
    let (roots, words) = (&regions.roots, &regions.words);
    container.put(ROOTS, Dtype::U32, &[roots.len()], roots.iter().map(|r| r.to_le_bytes()));
    container.put(TREES, Dtype::U16, &[words.len()], words.iter().map(|w| w.to_le_bytes()));
    container.put_json(VOXELS_KEY, &regions.voxels_per_cell);
}

/// Reads the trees; inverse of [`write`].
///
/// # Errors
/// What is missing, or points to what is not there.
pub fn read(container: &Container, grid: &Grid) -> Result<Regions, String> {
    let voxels_per_cell: u32 = container.json(VOXELS_KEY)?;
    if !(1..=MAX_VOXELS_PER_CELL).contains(&voxels_per_cell) {
        return Err(format!("metadata '{VOXELS_KEY}' is {voxels_per_cell}"));
    }
    let words: Vec<u16> = container.tensor(TREES, &[Dtype::U16], &[None])?.u16s().collect();
    let roots: Vec<u32> = container.tensor(ROOTS, &[Dtype::U32], &[Some(grid.cell_count())])?.u32s().collect();
    let firsts = firsts(&words, voxels_per_cell, grid.probe_count())
        .map_err(|word| format!("tensor '{TREES}' holds no tree at word {word}"))?;
    if roots.iter().any(|root| firsts.binary_search(root).is_err()) {
        return Err(format!("tensor '{ROOTS}' names words of '{TREES}' at which no tree begins"));
    }
    Ok(Regions { voxels_per_cell, roots, words })
}

/// Where each of the trees begins that the words are, one after another. Parts follow one another without gaps, and each plane
/// divides its part, so that no path comes back to where it was or is longer than a cell has planes.
///
/// # Errors
/// The first word that does not fit in, or names a probe that does not exist.
fn firsts(words: &[u16], voxels_per_cell: u32, probes: usize) -> Result<Vec<u32>, usize> {
    let whole = Part::whole(voxels_per_cell);
    let mut firsts = Vec::new();
    // Where the parts at and beyond the thresholds have to begin.
    let mut expected: Vec<(usize, Part)> = Vec::new();
    let (mut i, mut part, mut is_first) = (0, whole, true);
    while let Some(&word) = words.get(i) {
        if is_first {
            firsts.push(i as u32);
            is_first = false;
        }
        let end = i + length(word);
        let behind = words.get(i + 1..end).ok_or(i)?;
        if word & LEAF == 0 {
            let [below, beyond] = part.divided(word, behind, voxels_per_cell).ok_or(i)?;
            expected.push((i + distance(word, behind), beyond));
            part = below;
        } else {
            if !behind.is_empty() && (number(behind) as usize >= probes || word & LOW != 0) {
                return Err(i);
            }
            match expected.pop() {
                Some((begins, _)) if begins != end => return Err(end),
                Some((_, beyond)) => part = beyond,
                None => (part, is_first) = (whole, true),
            }
        }
        i = end;
    }
    if is_first { Ok(firsts) } else { Err(i) }
}
