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
//! a probe farther away that it does see. So the survey leaves it, and files of before query version 4 hold it; what is
//! asked and stored since is [`super::regions`].

use glam::{UVec3, Vec3};
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

use crate::probe::container::Container;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::{Cell, CellIndex, Grid, ProbeIndex};

/// Most voxels per cell and axis: 22³·6 keys fit 16 bits.
pub const MAX_VOXELS_PER_CELL: u32 = 22;

/// How finely visibility is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceStore {
    /// Voxels along each axis of a cell.
    pub voxels_per_cell: u32,
}

impl Default for SurfaceStore {
    fn default() -> Self {
        SurfaceStore { voxels_per_cell: 8 }
    }
}

/// How a look-up reads the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TableTest {
    /// Of a file that holds entries alone: where the survey found no surface of this facing in a point's own voxel, the
    /// nearest entry within this many voxels stands in. 1 or 6: no change of leaks above 1e-4 in the six scenes of
    /// [`crate::probe::place`]'s settings.
    pub reach_voxels: u32,
    /// Of such a file: points nearer to a voxel's border than this share of its side may use the voxel beyond, where their own sees no
    /// probe: where walls meet, the survey may miss a strip much narrower than a voxel. 0.1 or 0.5: at most 3e-4 (thin_wall).
    pub strip: f32,
}

impl Default for TableTest {
    fn default() -> Self {
        TableTest { reach_voxels: 3, strip: 0.25 }
    }
}

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

impl SurfaceVisibility {
    /// What a point of a cell sees: everything where no surface is known, nothing where only others are. `at` is a point
    /// of the cell, or stands for its nearest one; `facing` is the surface's main direction.
    pub fn look_up(&self, grid: &Grid, cell: &Cell, at: Vec3, facing: Facing, test: &TableTest) -> Seen {
        let n = self.voxels_per_cell;
        let fraction = grid.fraction_in(cell, at);
        let index = grid.cell_index(cell).0 as usize;
        let first = self.cell_start[index] as usize;
        let keys = &self.keys[first..self.cell_start[index + 1] as usize];
        let wanted = key(voxel_of(fraction, n), facing, n);
        // The survey covers the grid's hull; beyond it the nearest surface of the rim has to do.
        let surveyed = grid.is_within(at) && !keys.is_empty();
        let found = match keys.binary_search(&wanted) {
            Ok(found) => Some(found),
            Err(_) => nearest_entry(keys, wanted, n, if surveyed { test.reach_voxels } else { 2 * n }),
        };
        let Some(found) = found else {
            return Seen { mask: if surveyed { 0 } else { u8::MAX }, far: None };
        };
        let mask = self.masks[first + found];
        if mask != 0 {
            return Seen { mask, far: None };
        }
        let entry = |voxel| keys.binary_search(&key(voxel, facing, n));
        let beside = beside(fraction, n, test.strip, |voxel| entry(voxel).map_or(0, |found| self.masks[first + found]));
        Seen { mask: beside, far: if beside == 0 { self.far_probe(first + found) } else { None } }
    }

    /// What any point of a cell sees, roughly where the survey has met no surface there. Instead of an entry that faces the same
    /// way anywhere near, which may be the far side of a wall, it takes the nearest entry that faces the point: first of its
    /// own facing within the reach, then of any. Nothing stands between the two but other surfaces that face it, which are
    /// nearer. Without one, the point sees all.
    pub fn everywhere(&self, grid: &Grid, cell: &Cell, at: Vec3, facing: Facing, test: &TableTest) -> Seen {
        let own = self.look_up(grid, cell, at, facing, &TableTest { reach_voxels: 0, ..*test });
        if own.mask != 0 || own.far.is_some() {
            return own;
        }
        let place = grid.fraction_in(cell, at) * self.voxels_per_cell as f32;
        let reach = (test.reach_voxels * test.reach_voxels) as f32;
        let candidate = |entry: Entry| {
            let way = place - (entry.voxel.as_vec3() + 0.5);
            // Within a voxel the surface may lie on either side.
            let faces = entry.mask != 0 && way.dot(entry.facing) >= -0.5;
            let is_other = Facing::of(entry.facing) != facing || way.length_squared() > reach;
            faces.then(|| (is_other, way.length_squared(), entry.index, entry.mask))
        };
        let candidates = self.entries(grid.cell_index(cell)).filter_map(candidate);
        let nearest = candidates.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        Seen { mask: nearest.map_or(u8::MAX, |(.., mask)| mask), far: None }
    }

    /// The probe beyond its own cell that stands in for an entry which sees none of its eight.
    pub fn far_probe(&self, entry: usize) -> Option<ProbeIndex> {
        let found = self.far.binary_search_by_key(&(entry as u32), |f| f.0).ok()?;
        Some(ProbeIndex(self.far[found].1))
    }

    /// Whether no entry hides an active probe: then the table says nothing.
    pub fn all_visible(&self, grid: &Grid, states: &[ProbeState]) -> bool {
        grid.cells().all(|cell| {
            let active = active_corners(grid, states, cell);
            self.masks[self.range(cell)].iter().all(|mask| mask & active == active)
        })
    }

    /// What is known about one cell.
    pub fn entries(&self, cell: CellIndex) -> impl Iterator<Item = Entry> + '_ {
        let n = self.voxels_per_cell;
        self.range(cell).map(move |i| {
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

    /// Where a cell's entries are.
    pub fn range(&self, CellIndex(cell): CellIndex) -> std::ops::Range<usize> {
        self.cell_start[cell as usize] as usize..self.cell_start[cell as usize + 1] as usize
    }

    /// Bytes of its tensors.
    pub fn bytes(&self) -> u64 {
        (self.cell_start.len() * 4 + self.keys.len() * 3 + self.far.len() * 8) as u64
    }
}

/// First mask that is not 0 of the voxels across a border that a point is close to, within its cell of n³; 0 where there is
/// none.
///
/// Where walls meet, the survey may miss a strip much narrower than a voxel; it continues in the next one.
pub fn beside(fraction: Vec3, n: u32, strip: f32, mask: impl Fn(UVec3) -> u8) -> u8 {
    let voxel = voxel_of(fraction, n);
    let inside = fraction * n as f32 - voxel.as_vec3();
    // Along each axis: towards the nearer border, if near enough and within the cell.
    let last = n - 1;
    let step = |axis: usize| match inside[axis] {
        x if x < strip && voxel[axis] > 0 => Some(voxel[axis] - 1),
        x if x > 1.0 - strip && voxel[axis] < last => Some(voxel[axis] + 1),
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
            Some(mask(neighbour))
        })
        .find(|&mask| mask != 0)
        .unwrap_or(0)
}

#[inline]
pub fn voxel_of(fraction: Vec3, n: u32) -> UVec3 {
    (fraction * n as f32).as_uvec3().min(UVec3::splat(n - 1))
}

/// Whether two points lie in the same voxel of the same cell, `n` voxels along each axis of a cell: where both face the same way
/// they see the same probes.
pub fn are_in_one_voxel(grid: &Grid, n: u32, points: [Vec3; 2]) -> bool {
    let [a, b] = points.map(|point| grid.cell(point));
    grid.cell_index(&a) == grid.cell_index(&b) && voxel_of(a.fraction, n) == voxel_of(b.fraction, n)
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
    pub const ALL: [Facing; 6] = [Facing(0), Facing(1), Facing(2), Facing(3), Facing(4), Facing(5)];

    pub fn of(normal: Vec3) -> Facing {
        let axis = normal.abs().max_position();
        Facing(2 * axis as u8 + u8::from(normal[axis] < 0.0))
    }

    pub fn opposite(self) -> Facing {
        Facing(self.0 ^ 1)
    }

    #[inline]
    pub fn index(self) -> u8 {
        self.0
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
pub fn active_corners(grid: &Grid, states: &[ProbeState], cell: CellIndex) -> u8 {
    let corners = grid.corners(cell);
    (0..8).fold(0, |mask, i| mask | u8::from(states[corners[i].0 as usize] == ProbeState::Active) << i)
}

/// Names in the file.
const MASKS: &str = "visibility";
const KEYS: &str = "visibility_key";
const STARTS: &str = "visibility_start";
const FAR: &str = "visibility_far";
const VOXELS_KEY: &str = "visibility.voxels_per_cell";

/// Whether a file holds a table.
pub fn is_in(container: &Container) -> bool {
    [MASKS, KEYS, STARTS].into_iter().any(|name| container.has(name))
}

/// Writes the table.
pub fn write(table: &SurfaceVisibility, container: &mut Container) {
    let n = table.keys.len();
    let starts = table.cell_start.iter().map(|s| s.to_le_bytes());
    container.put(STARTS, Dtype::U32, &[table.cell_start.len()], starts);
    container.put(KEYS, Dtype::U16, &[n], table.keys.iter().map(|k| k.to_le_bytes()));
    container.put_bytes(MASKS, Dtype::U8, &[n], table.masks.clone());
    if !table.far.is_empty() {
        let far = table.far.iter().flat_map(|&(entry, probe)| [entry, probe]).map(u32::to_le_bytes);
        container.put(FAR, Dtype::U32, &[table.far.len(), 2], far);
    }
    container.put_json(VOXELS_KEY, &table.voxels_per_cell);
}

/// Reads the table; inverse of [`write`].
///
/// # Errors
/// What is missing, or points to what is not there.
pub fn read(container: &Container, grid: &Grid) -> Result<SurfaceVisibility, String> {
    let voxels_per_cell: u32 = container.json(VOXELS_KEY)?;
    if !(1..=MAX_VOXELS_PER_CELL).contains(&voxels_per_cell) {
        return Err(format!("metadata '{VOXELS_KEY}' is {voxels_per_cell}"));
    }
    let masks = container.tensor(MASKS, &[Dtype::U8], &[None])?.bytes.clone();
    let keys = container.tensor(KEYS, &[Dtype::U16], &[Some(masks.len())])?.u16s().collect();
    let cells = grid.cell_count();
    let cell_start: Vec<u32> = container.tensor(STARTS, &[Dtype::U32], &[Some(cells + 1)])?.u32s().collect();
    let ordered = cell_start.is_sorted() && cell_start.last().is_some_and(|&n| n as usize == masks.len());
    if !ordered || cell_start[0] != 0 {
        return Err(format!("tensor '{STARTS}' does not divide the entries among the cells"));
    }
    let mut far = Vec::new();
    if container.has(FAR) {
        let numbers: Vec<u32> = container.tensor(FAR, &[Dtype::U32], &[None, Some(2)])?.u32s().collect();
        far = numbers.as_chunks::<2>().0.iter().map(|pair| (pair[0], pair[1])).collect();
        let in_range = |f: &(u32, u32)| (f.0 as usize) < masks.len() && (f.1 as usize) < grid.probe_count();
        if !far.is_sorted() || !far.iter().all(in_range) {
            return Err(format!("tensor '{FAR}' names entries or probes that do not exist"));
        }
    }
    Ok(SurfaceVisibility { voxels_per_cell, cell_start, keys, masks, far })
}
