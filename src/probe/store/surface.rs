//! Visibility measured where it is asked for: at the surfaces.
//!
//! Depth maps answer "is there something between this probe and that point" by comparing distances, and err where
//! depth changes within a texel: behind thin walls and around every edge. But the points that ask lie on surfaces that
//! are known. So every cell is divided into n³ voxels, and for each voxel that a surface passes through, and each of the
//! six main directions that the surface faces there, rays to the cell's eight probes decide which of them are visible:
//! one bit each. The two faces of a wall have entries of their own however thin it is.
//!
//! Storage: `key = voxel·6 + facing` (u16, voxel = x + n·(y + n·z), facing = 2·axis + (1 where negative)), sorted
//! within each cell, with the mask (u8, bit i = corner i) beside it; `cell_start[c]..cell_start[c + 1]` are cell c's.
//! Where a surface sees none of its eight probes — under a table, behind a pillar — a pair of u32 names its entry and
//! a probe farther away that it does see.

use glam::{UVec3, Vec3};

use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::{Grid, ProbeIndex};

/// Most voxels per cell and axis: 22³·6 keys fit 16 bits.
pub const MAX_VOXELS_PER_CELL: u32 = 22;

#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceVisibility {
    pub voxels_per_cell: u32,
    /// One more than there are cells.
    pub cell_start: Vec<u32>,
    pub keys: Vec<u16>,
    pub masks: Vec<u8>,
    /// Entries that see none of their eight probes, each with a probe of the cells around that they do see; sorted.
    pub far: Vec<(u32, u32)>,
}

/// What a point sees of its eight probes, bit i for corner i; of none, a farther one may stand in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    pub mask: u8,
    pub far: Option<ProbeIndex>,
}

/// One entry of the table, decoded.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub voxel: UVec3,
    /// Main direction that the surface faces, unit.
    pub facing: Vec3,
    /// Bit i: whether corner i is visible.
    pub mask: u8,
    /// Index in the table.
    pub index: usize,
}

/// Where the survey found no surface of this facing in a point's own voxel, one this many voxels away may stand in.
const MISSED_REACH: u32 = 3;

/// Points nearer to a voxel's border than this share of its side may use the voxel beyond.
const STRIP: f32 = 0.25;

impl SurfaceVisibility {
    /// What a surface point sees: everything where no surface is known, nothing where only others are.
    pub fn look_up(&self, grid: &Grid, position: Vec3, facing: Facing) -> Seen {
        let cell = grid.cell(position);
        let n = self.voxels_per_cell;
        let index = grid.cell_index(cell.base);
        let first = self.cell_start[index] as usize;
        let keys = &self.keys[first..self.cell_start[index + 1] as usize];
        let wanted = key(voxel_of(cell.fraction, n), facing, n);
        // The survey covers the grid's hull; beyond it the nearest surface of the rim has to do.
        let surveyed = grid.is_within(position) && !keys.is_empty();
        let found = match keys.binary_search(&wanted) {
            Ok(found) => Some(found),
            Err(_) => nearest_entry(keys, wanted, n, if surveyed { MISSED_REACH } else { 2 * n }),
        };
        let Some(found) = found else {
            return Seen { mask: if surveyed { 0 } else { u8::MAX }, far: None };
        };
        let mask = self.masks[first + found];
        if mask != 0 {
            return Seen { mask, far: None };
        }
        let beside = self.beside(keys, first, cell.fraction, facing);
        Seen { mask: beside, far: if beside == 0 { self.far_probe(first + found) } else { None } }
    }

    /// Mask of the voxel across a border that the point is close to, 0 where there is none.
    ///
    /// Where walls meet, the survey may miss a strip much narrower than a voxel; it continues in the next one.
    fn beside(&self, keys: &[u16], first: usize, fraction: Vec3, facing: Facing) -> u8 {
        let n = self.voxels_per_cell;
        let voxel = voxel_of(fraction, n);
        let inside = fraction * n as f32 - voxel.as_vec3();
        // Along each axis: towards the nearer border, if near enough and within the cell.
        let last = n - 1;
        let step = |axis: usize| match inside[axis] {
            x if x < STRIP && voxel[axis] > 0 => Some(voxel[axis] - 1),
            x if x > 1.0 - STRIP && voxel[axis] < last => Some(voxel[axis] + 1),
            _ => None,
        };
        let steps = [step(0), step(1), step(2)];
        // One axis at a time first, then two, then all three.
        [0b001, 0b010, 0b100, 0b011, 0b101, 0b110, 0b111u32]
            .into_iter()
            .filter_map(|axes| {
                let mut neighbour = voxel;
                for axis in (0..3).filter(|axis| axes >> axis & 1 == 1) {
                    neighbour[axis] = steps[axis]?;
                }
                let found = keys.binary_search(&key(neighbour, facing, n)).ok()?;
                Some(self.masks[first + found])
            })
            .find(|&mask| mask != 0)
            .unwrap_or(0)
    }

    /// The probe beyond its own cell that stands in for an entry which sees none of its eight.
    fn far_probe(&self, entry: usize) -> Option<ProbeIndex> {
        let found = self.far.binary_search_by_key(&(entry as u32), |f| f.0).ok()?;
        Some(ProbeIndex(self.far[found].1))
    }

    /// Whether no entry hides an active probe: then the table says nothing.
    pub fn all_visible(&self, grid: &Grid, states: &[ProbeState]) -> bool {
        (0..self.cell_start.len().saturating_sub(1)).all(|c| {
            let range = self.cell_start[c] as usize..self.cell_start[c + 1] as usize;
            let active = active_corners(grid, states, grid.cell_base(c));
            self.masks[range].iter().all(|mask| mask & active == active)
        })
    }

    /// What is known about one cell.
    pub fn entries(&self, cell: usize) -> impl Iterator<Item = Entry> + '_ {
        let n = self.voxels_per_cell;
        let range = self.cell_start[cell] as usize..self.cell_start[cell + 1] as usize;
        range.map(move |i| {
            let facing = u32::from(self.keys[i]) % 6;
            let sign = if facing.is_multiple_of(2) { 1.0 } else { -1.0 };
            Entry {
                voxel: voxel_of_key(self.keys[i], n),
                facing: Vec3::AXES[facing as usize / 2] * sign,
                mask: self.masks[i],
                index: i,
            }
        })
    }

    /// Bytes of its tensors.
    pub fn bytes(&self) -> u64 {
        (self.cell_start.len() * 4 + self.keys.len() * 3 + self.far.len() * 8) as u64
    }
}

fn voxel_of(fraction: Vec3, n: u32) -> UVec3 {
    (fraction * n as f32).as_uvec3().min(UVec3::splat(n - 1))
}

pub fn key(voxel: UVec3, facing: Facing, n: u32) -> u16 {
    ((voxel.x + n * (voxel.y + n * voxel.z)) * 6) as u16 + u16::from(facing.0)
}

/// Voxel within its cell; with [`Facing`] the inverse of [`key`].
pub fn voxel_of_key(key: u16, n: u32) -> UVec3 {
    let v = u32::from(key) / 6;
    UVec3::new(v % n, v / n % n, v / (n * n))
}

/// Main direction of a normal: 2·axis + (1 where negative).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facing(u8);

impl Facing {
    pub fn of(normal: Vec3) -> Facing {
        let axis = normal.abs().max_position();
        Facing(2 * axis as u8 + u8::from(normal[axis] < 0.0))
    }

    pub fn opposite(self) -> Facing {
        Facing(self.0 ^ 1)
    }
}

/// The entry that faces the same way in the nearest voxel, at most `reach` voxels away.
fn nearest_entry(keys: &[u16], wanted: u16, n: u32, reach: u32) -> Option<usize> {
    let voxel = |key: u16| voxel_of_key(key, n).as_ivec3();
    let target = voxel(wanted);
    (0..keys.len())
        .filter(|&i| keys[i] % 6 == wanted % 6)
        .map(|i| (voxel(keys[i]).distance_squared(target), i))
        .filter(|(distance_squared, _)| *distance_squared as u32 <= reach * reach)
        .min()
        .map(|(_, i)| i)
}

/// Bit i: whether corner i of the cell is an active probe.
pub fn active_corners(grid: &Grid, states: &[ProbeState], base: UVec3) -> u8 {
    (0..8).fold(0, |mask, i| {
        let probe = grid.corner(base, i).0 as usize;
        mask | u8::from(states[probe] == ProbeState::Active) << i
    })
}
