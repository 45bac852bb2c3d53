//! The uniform grid of probes.
//!
//! Probe (x, y, z) has the index `x + nx·(y + ny·z)` and lies at `origin + (x, y, z)·spacing` before relocation.

use glam::{DVec3, UVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::scene::{Mesh, Scene};

/// Index of a probe in the file's tensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ProbeIndex(pub u32);

/// Cells along the longest side of the bounds where neither spacing nor divisions are given.
const DEFAULT_CELLS: f64 = 16.0;

/// More probes than this are taken for a slip of the spacing.
pub const MAX_PROBES: u64 = 1 << 26;

/// The volume of scenes without extent along all axes, metres per side.
const POINT_SCENE_SIZE_M: f64 = 1.0;

/// What the user may say about the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct GridSettings {
    /// Box that the probes must cover, world space, metres; the scene's bounding box where not given.
    pub bounds: Option<Bounds>,
    /// Distance between neighbours, metres, the same along all axes.
    pub spacing_m: Option<f64>,
    /// Number of probes along x, y and z; excludes `spacing_m`.
    pub divisions: Option<(u32, u32, u32)>,
    /// Margin around the scene's own bounding box as a share of the spacing, so that hits on its walls stay inside.
    pub padding: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    pub min: (f64, f64, f64),
    pub max: (f64, f64, f64),
}

impl Default for GridSettings {
    fn default() -> Self {
        GridSettings { bounds: None, spacing_m: None, divisions: None, padding: 0.05 }
    }
}

/// Why there is no such grid. Each message names the setting.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum GridError {
    #[error("grid.spacing_m is {0}: it must be a positive number of metres")]
    Spacing(f64),
    #[error("grid.divisions is {0:?}: every axis needs at least one probe")]
    Divisions((u32, u32, u32)),
    #[error("grid.spacing_m and grid.divisions are both given: remove one")]
    Both,
    #[error("grid.padding is {0}: it must be a number from 0 to 1")]
    Padding(f64),
    #[error("grid.bounds: min {min} must be finite and not above max {max}")]
    Bounds { min: DVec3, max: DVec3 },
    #[error("the grid would have {} probes, more than 2^26: raise grid.spacing_m or lower grid.divisions", in_words(*.0))]
    TooMany(f64),
}

/// A number of probes; rounded where no one counts.
fn in_words(count: f64) -> String {
    if count < 1e9 { count.to_string() } else { format!("about {count:.0e}") }
}

/// Where probes stand. What others ask — cells, corners, neighbours — they ask by methods: only this file knows that the
/// lattice is uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Probe (0,0,0) in world space, metres: what positions in the file are relative to.
    origin_world: DVec3,
    /// The same relative to the scene's origin.
    origin: Vec3,
    /// Metres along each axis.
    spacing: Vec3,
    /// Probes along each axis, at least one.
    divisions: UVec3,
}

/// Index of a cell, x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CellIndex(pub u32);

/// The cell of a point. Along an axis with a single layer of probes both corners are the same and the second weighs 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Lowest corner.
    base: UVec3,
    /// Place within the cell, each in [0,1].
    pub fraction: Vec3,
}

impl Grid {
    pub fn new(settings: &GridSettings, scene: &Scene) -> Result<Grid, GridError> {
        if settings.spacing_m.is_some() && settings.divisions.is_some() {
            return Err(GridError::Both);
        }
        if !(0.0..=1.0).contains(&settings.padding) {
            return Err(GridError::Padding(settings.padding));
        }
        // Relative to the scene's origin, so that a moved scene gives the same grid bit by bit.
        let (low, high) = match settings.bounds {
            Some(bounds) => {
                let (min, max) = (DVec3::from(bounds.min), DVec3::from(bounds.max));
                if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
                    return Err(GridError::Bounds { min, max });
                }
                (min - scene.origin_world, max - scene.origin_world)
            }
            None => scene_bounds(scene),
        };
        let padding = if settings.bounds.is_some() { 0.0 } else { settings.padding };
        let (spacing, divisions) = match (settings.spacing_m, settings.divisions) {
            (_, Some(divisions)) => {
                if divisions.0 == 0 || divisions.1 == 0 || divisions.2 == 0 {
                    return Err(GridError::Divisions(divisions));
                }
                let (low_scene, high_scene) = scene_bounds(scene);
                let usual = (high_scene - low_scene).max_element() / DEFAULT_CELLS;
                spread(high - low, UVec3::from(divisions), padding, usual)
            }
            (Some(spacing), None) => {
                if !(spacing > 0.0 && spacing.is_finite()) {
                    return Err(GridError::Spacing(spacing));
                }
                cover(high - low, spacing, padding)?
            }
            (None, None) => {
                let spacing = (high - low).max_element() / DEFAULT_CELLS;
                cover(high - low, spacing, padding)?
            }
        };
        // Exact as far as it is compared, and beyond that not wrapped.
        let count: f64 = divisions.to_array().iter().map(|&n| f64::from(n)).product();
        if count > MAX_PROBES as f64 {
            return Err(GridError::TooMany(count));
        }
        let origin = (low + high) / 2.0 - spacing * (divisions - UVec3::ONE).as_dvec3() / 2.0;
        Ok(Grid {
            origin_world: scene.origin_world + origin,
            origin: origin.as_vec3(),
            spacing: spacing.as_vec3(),
            divisions,
        })
    }

    /// The grid of these numbers, relative to its own origin; `None` where they make none that can be asked.
    pub fn from_parts(origin_world: DVec3, spacing: Vec3, divisions: UVec3) -> Option<Grid> {
        let count = divisions.to_array().iter().map(|&n| u64::from(n)).try_fold(1, u64::checked_mul)?;
        let usable = (1..=MAX_PROBES).contains(&count) && spacing.is_finite() && spacing.min_element() > 0.0;
        (usable && origin_world.is_finite()).then_some(Grid { origin_world, origin: Vec3::ZERO, spacing, divisions })
    }

    /// The same grid relative to another origin, and how far everything moves by it.
    pub fn relative_to(&self, origin_world: DVec3) -> (Grid, Vec3) {
        let origin = (self.origin_world - origin_world).as_vec3();
        (Grid { origin, ..self.clone() }, origin - self.origin)
    }

    /// Probe (0,0,0) in world space, metres.
    pub fn origin_world(&self) -> DVec3 {
        self.origin_world
    }

    /// Probe (0,0,0) relative to the scene's origin, metres.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Distance of neighbours along each axis, metres.
    pub fn spacing(&self) -> Vec3 {
        self.spacing
    }

    /// Largest distance of neighbours, metres: what relative lengths of a look-up refer to.
    #[inline]
    pub fn spacing_max(&self) -> f32 {
        self.spacing.max_element()
    }

    /// Smallest distance of neighbours, metres: what relative lengths of placement refer to.
    pub fn spacing_min(&self) -> f32 {
        self.spacing.min_element()
    }

    /// Probes along each axis.
    pub fn divisions(&self) -> UVec3 {
        self.divisions
    }

    pub fn probe_count(&self) -> usize {
        self.divisions.to_array().iter().map(|&n| n as usize).product()
    }

    pub fn probes(&self) -> impl DoubleEndedIterator<Item = ProbeIndex> + Clone + use<> {
        (0..self.probe_count() as u32).map(ProbeIndex)
    }

    /// Place of a probe before relocation, relative to the scene's origin, metres.
    pub fn grid_point(&self, probe: ProbeIndex) -> Vec3 {
        self.origin + self.coordinate(probe).as_vec3() * self.spacing
    }

    /// Number of a probe along each axis.
    pub fn coordinate(&self, probe: ProbeIndex) -> UVec3 {
        let (nx, ny) = (self.divisions.x, self.divisions.y);
        UVec3::new(probe.0 % nx, probe.0 / nx % ny, probe.0 / (nx * ny))
    }

    #[inline]
    fn index(&self, coordinate: UVec3) -> ProbeIndex {
        ProbeIndex(coordinate.x + self.divisions.x * (coordinate.y + self.divisions.y * coordinate.z))
    }

    /// Whether a probe lies at the rim of the grid.
    pub fn is_at_rim(&self, probe: ProbeIndex) -> bool {
        let coordinate = self.coordinate(probe);
        coordinate.cmpeq(UVec3::ZERO).any() || coordinate.cmpeq(self.divisions - UVec3::ONE).any()
    }

    /// Corners of the probes' hull relative to the scene's origin, enlarged by `tolerance` spacings.
    pub fn hull(&self, tolerance: f32) -> (Vec3, Vec3) {
        let margin = self.spacing * tolerance;
        let last = (self.divisions - UVec3::ONE).as_vec3();
        (self.origin - margin, self.origin + last * self.spacing + margin)
    }

    /// Whether a point lies in the probes' hull.
    pub fn is_within(&self, position: Vec3) -> bool {
        let g = self.grid_from_scene(position);
        g.cmpge(Vec3::ZERO).all() && g.cmple((self.divisions - UVec3::ONE).as_vec3()).all()
    }

    /// Whether the probes' hull covers all of a mesh; surfaces beyond it use the cells at its rim.
    pub fn covers(&self, mesh: &Mesh) -> bool {
        mesh.bounds().is_none_or(|(low, high)| self.is_within(low) && self.is_within(high))
    }

    /// Grid coordinates of a point: probe (x,y,z) is at exactly (x,y,z).
    #[inline]
    fn grid_from_scene(&self, position: Vec3) -> Vec3 {
        (position - self.origin) / self.spacing
    }

    /// Cells along each axis; a single layer of probes makes one layer of cells.
    #[inline]
    fn cells_along(&self) -> UVec3 {
        (self.divisions - UVec3::ONE).max(UVec3::ONE)
    }

    pub fn cell_count(&self) -> usize {
        self.cells_along().to_array().iter().map(|&n| n as usize).product()
    }

    pub fn cells(&self) -> impl DoubleEndedIterator<Item = CellIndex> + Clone + use<> {
        (0..self.cell_count() as u32).map(CellIndex)
    }

    /// The cell of a point; points outside use the nearest cell, at its face.
    #[inline]
    pub fn cell(&self, position: Vec3) -> Cell {
        let g = self.grid_from_scene(position);
        // `as` truncates, saturates and sends NaN to 0: any point has a cell.
        let base = g.max(Vec3::ZERO).as_uvec3().min(self.cells_along() - UVec3::ONE);
        Cell { base, fraction: self.fraction(g, base) }
    }

    /// Place in a cell, 0 along axes with a single layer of probes.
    #[inline]
    fn fraction(&self, in_grid: Vec3, base: UVec3) -> Vec3 {
        let layered = (self.divisions.min(UVec3::splat(2)) - UVec3::ONE).as_vec3();
        (in_grid - base.as_vec3()).clamp(Vec3::ZERO, Vec3::ONE) * layered
    }

    /// A point's place in a cell that need not be its own, each in [0,1]: the nearest of the cell's points.
    #[inline]
    pub fn fraction_in(&self, cell: &Cell, position: Vec3) -> Vec3 {
        self.fraction(self.grid_from_scene(position), cell.base)
    }

    #[inline]
    pub fn cell_index(&self, cell: &Cell) -> CellIndex {
        self.index_of_cell(cell.base)
    }

    #[inline]
    fn index_of_cell(&self, base: UVec3) -> CellIndex {
        let n = self.cells_along();
        CellIndex(base.x + n.x * (base.y + n.y * base.z))
    }

    /// Lowest corner of a cell; inverse of [`Self::index_of_cell`].
    fn base(&self, CellIndex(cell): CellIndex) -> UVec3 {
        let n = self.cells_along();
        UVec3::new(cell % n.x, cell / n.x % n.y, cell / (n.x * n.y))
    }

    /// The eight corners of the cell of a point: bit 0 of a corner's number is +x, bit 1 is +y, bit 2 is +z.
    #[inline]
    pub fn corners_around(&self, cell: &Cell) -> [ProbeIndex; 8] {
        // From a corner to the next along each axis; none where there is a single layer.
        let layered = self.divisions.min(UVec3::splat(2)) - UVec3::ONE;
        let UVec3 { x, y, z } = layered * UVec3::new(1, self.divisions.x, self.divisions.x * self.divisions.y);
        let (lowest, steps) = (self.index(cell.base).0, [[0, x], [0, y], [0, z]]);
        std::array::from_fn(|i| ProbeIndex(lowest + steps[0][i & 1] + steps[1][i >> 1 & 1] + steps[2][i >> 2]))
    }

    /// The eight corners of a cell, in the same order.
    pub fn corners(&self, cell: CellIndex) -> [ProbeIndex; 8] {
        self.corners_around(&Cell { base: self.base(cell), fraction: Vec3::ZERO })
    }

    /// A point in units of a cell: the cell is the unit box.
    pub fn cell_from_scene(&self, cell: CellIndex, position: Vec3) -> Vec3 {
        self.grid_from_scene(position) - self.base(cell).as_vec3()
    }

    /// Lowest corner of a cell relative to the scene's origin, and its sides, metres.
    pub fn cell_box(&self, cell: CellIndex) -> (Vec3, Vec3) {
        (self.origin + self.base(cell).as_vec3() * self.spacing, self.spacing)
    }

    /// Cells that a box meets, x fastest; `margin` in cells is added on every side. A box beyond the hull meets the cells
    /// at its rim, which points there use.
    pub fn cells_near(&self, low: Vec3, high: Vec3, margin: f32) -> impl Iterator<Item = CellIndex> + '_ {
        let last = self.cells_along() - UVec3::ONE;
        let cell = |g: Vec3| g.floor().max(Vec3::ZERO).as_uvec3().min(last);
        let (low, high) = (self.grid_from_scene(low) - margin, self.grid_from_scene(high) + margin);
        block(cell(low), cell(high)).map(|base| self.index_of_cell(base))
    }

    /// Whether a box, larger by `margin` cells on every side, lies wholly outside the hull, and whether a part of it does.
    pub fn is_beyond(&self, low: Vec3, high: Vec3, margin: f32) -> (bool, bool) {
        let (low, high) = (self.grid_from_scene(low) - margin, self.grid_from_scene(high) + margin);
        let last = self.cells_along().as_vec3();
        let wholly = high.cmplt(Vec3::ZERO).any() || low.cmpgt(last).any();
        (wholly, low.cmplt(Vec3::ZERO).any() || high.cmpgt(last).any())
    }

    /// Cells that a probe is a corner of.
    pub fn cells_of(&self, probe: ProbeIndex) -> impl Iterator<Item = CellIndex> + '_ {
        let last = self.cells_along() - UVec3::ONE;
        let high = self.coordinate(probe).min(last);
        let low = self.coordinate(probe).saturating_sub(UVec3::ONE).min(last);
        block(low, high).map(|base| self.index_of_cell(base))
    }

    /// The `ring`-th layer of probes around the eight corners of a cell; the corners are layer 0.
    pub fn ring(&self, cell: CellIndex, ring: u32) -> impl Iterator<Item = ProbeIndex> + '_ {
        let base = self.base(cell);
        let past = base + UVec3::splat(1 + ring);
        let low = base.saturating_sub(UVec3::splat(ring));
        let inner = move |c: UVec3| ring > 0 && (c + ring).cmpgt(base).all() && c.cmplt(past).all();
        block(low, past.min(self.divisions - UVec3::ONE)).filter(move |&c| !inner(c)).map(|c| self.index(c))
    }
}

/// All coordinates from `low` to `high`, both included, x fastest.
fn block(low: UVec3, high: UVec3) -> impl Iterator<Item = UVec3> {
    (low.z..=high.z)
        .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| UVec3::new(x, y, z))))
}

/// The scene's box; scenes that are flat or empty get some depth.
fn scene_bounds(scene: &Scene) -> (DVec3, DVec3) {
    let (low, high) = scene.mesh.bounds().unwrap_or((Vec3::ZERO, Vec3::ZERO));
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    if high == low {
        let half = DVec3::splat(POINT_SCENE_SIZE_M / 2.0);
        return (low - half, high + half);
    }
    (low, high)
}

/// Enough probes at this spacing that their hull covers the extent and the padding, as many on either side.
fn cover(extent: DVec3, spacing: f64, padding: f64) -> Result<(DVec3, UVec3), GridError> {
    let cells = (extent / spacing + 2.0 * padding).ceil().max(DVec3::ONE);
    // Before a long side is cut down to u32.
    if cells.max_element() > MAX_PROBES as f64 {
        return Err(GridError::TooMany((cells + 1.0).element_product()));
    }
    Ok((DVec3::splat(spacing), cells.as_uvec3() + UVec3::ONE))
}

/// The spacing at which this many probes cover the extent and the padding; `usual` where there is no extent.
fn spread(extent: DVec3, divisions: UVec3, padding: f64, usual: f64) -> (DVec3, UVec3) {
    let cells = (divisions - UVec3::ONE).as_dvec3();
    let room = (cells - 2.0 * padding).max(DVec3::splat(0.5));
    // A single layer needs a spacing too, for what is measured in spacings; so do axes along which the scene is flat.
    let layered = DVec3::select(divisions.cmpgt(UVec3::ONE), extent / room, extent);
    let fallback = if layered.max_element() > 0.0 { layered.max_element() } else { usual };
    (DVec3::select(layered.cmpgt(DVec3::splat(fallback * 1e-6)), layered, DVec3::splat(fallback)), divisions)
}
