//! The grid of probes: uniform, or mixed.
//!
//! Point (x, y, z) of a uniform grid is the probe `x + nx·(y + ny·z)` and lies at `origin + (x, y, z)·spacing` before
//! relocation. In a mixed grid a [`Tree`] says which probe stands for each of these points: one of its own, or that of a
//! larger cell around it. Look-ups ask the eight points around them either way.

use std::sync::Arc;

use glam::{DVec3, UVec3, Vec3};

use super::crossings::Crossings;
use super::refine::{MAX_LEVELS, Refine};
use super::settings::Layout;
pub use super::settings::{Bounds, GridError, GridSettings, MAX_PROBES};
use super::tree::Tree;
use crate::scene::{Mesh, Scene};

/// Index of a probe in the file's tensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ProbeIndex(pub u32);

/// Where probes stand. What others ask — cells, corners, neighbours — they ask by methods: only this file knows whether
/// the lattice is uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Point (0,0,0) in world space, metres: what positions in the file are relative to.
    origin_world: DVec3,
    /// The same relative to the scene's origin.
    origin: Vec3,
    /// Metres along each axis.
    spacing: Vec3,
    /// Points along each axis, at least one.
    divisions: UVec3,
    /// Which probe stands for which point; `None`: each has its own.
    tree: Option<Arc<Tree>>,
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
    /// A uniform grid.
    ///
    /// # Errors
    /// The settings make none.
    pub fn new(settings: &GridSettings, scene: &Scene) -> Result<Grid, GridError> {
        Grid::refined(settings, Refine::Uniform, scene)
    }

    /// A grid that is refined where `refine` says so: its points are those of the uniform grid of the same settings, with so
    /// many more along each axis that they fill whole base cells.
    ///
    /// # Errors
    /// The settings make none.
    pub fn refined(settings: &GridSettings, refine: Refine, scene: &Scene) -> Result<Grid, GridError> {
        let Layout { origin, spacing, divisions } = settings.layout(scene, refine.base_cell())?;
        let uniform = Grid {
            origin_world: scene.origin_world + origin,
            origin: origin.as_vec3(),
            spacing: spacing.as_vec3(),
            divisions,
            tree: None,
        };
        Ok(match refine {
            Refine::Uniform => uniform,
            Refine::Mixed { levels } => {
                let levels = levels.min(MAX_LEVELS);
                let crossed = Crossings::of(&scene.mesh, uniform.origin, uniform.spacing, divisions, levels);
                let tree = Tree::new(divisions >> levels, levels, |level, cell| crossed.divides(level, cell));
                Grid { tree: Some(Arc::new(tree)), ..uniform }
            }
        })
    }

    /// The grid of these numbers, relative to its own origin; `None` where they make none that can be asked.
    pub fn from_parts(origin_world: DVec3, spacing: Vec3, divisions: UVec3) -> Option<Grid> {
        let count = divisions.to_array().iter().map(|&n| u64::from(n)).try_fold(1, u64::checked_mul)?;
        let usable = (1..=MAX_PROBES).contains(&count) && spacing.is_finite() && spacing.min_element() > 0.0;
        (usable && origin_world.is_finite()).then_some(Grid {
            origin_world,
            origin: Vec3::ZERO,
            spacing,
            divisions,
            tree: None,
        })
    }

    /// Some points of it, from `first` on, as a uniform grid of their own.
    pub fn part(&self, first: UVec3, divisions: UVec3) -> Grid {
        let shift = first.as_vec3() * self.spacing;
        let (origin_world, origin) = (self.origin_world + shift.as_dvec3(), self.origin + shift);
        Grid { origin_world, origin, divisions, spacing: self.spacing, tree: None }
    }

    /// The same points with a file's index of a mixed grid of so many levels.
    ///
    /// # Errors
    /// The index is none of these points.
    pub fn with_index(&self, levels: u32, index: Vec<i32>) -> Result<Grid, String> {
        let tree = Tree::from_index(self.divisions, levels, index)?;
        Ok(Grid { tree: Some(Arc::new(tree)), ..self.clone() })
    }

    /// The uniform grid of the same points.
    pub fn uniform(&self) -> Grid {
        Grid { tree: None, ..self.clone() }
    }

    /// Which probe stands for which point, where not each has its own.
    pub fn tree(&self) -> Option<&Tree> {
        self.tree.as_deref()
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

    /// Bytes per probe that a look-up reads to find probes, besides their places where these are stored anyway: in mixed grids
    /// the index, and every probe's level and place.
    pub fn runtime_bytes(&self, stores_places: bool) -> f64 {
        const ENTRY_BYTES: usize = 4;
        const LEVEL_BYTES: usize = 4;
        const PLACE_BYTES: usize = 12;
        let Some(tree) = &self.tree else { return 0.0 };
        let places = if stores_places { 0 } else { PLACE_BYTES };
        (ENTRY_BYTES * tree.index().len()) as f64 / tree.probe_count() as f64 + (LEVEL_BYTES + places) as f64
    }

    /// Kind and size in words.
    pub fn describe(&self) -> String {
        let [x, y, z] = self.divisions.to_array();
        match &self.tree {
            None => format!("uniform, {x} × {y} × {z} probes"),
            Some(tree) => format!(
                "mixed, {} probes for {x} × {y} × {z} cells, {} levels below {} base cells",
                tree.probe_count(),
                tree.levels(),
                tree.base_count()
            ),
        }
    }

    /// Points along each axis; those of the finest cells in a mixed grid.
    pub fn divisions(&self) -> UVec3 {
        self.divisions
    }

    pub fn probe_count(&self) -> usize {
        match &self.tree {
            None => self.divisions.to_array().iter().map(|&n| n as usize).product(),
            Some(tree) => tree.probe_count(),
        }
    }

    pub fn probes(&self) -> impl DoubleEndedIterator<Item = ProbeIndex> + Clone + use<> {
        (0..self.probe_count() as u32).map(ProbeIndex)
    }

    /// Place of a probe before relocation, relative to the scene's origin, metres: the middle of its points.
    pub fn grid_point(&self, probe: ProbeIndex) -> Vec3 {
        self.origin + self.steps(probe) * self.spacing
    }

    /// Place of a probe before relocation from point (0,0,0), in spacings: whole ones, or halves.
    pub fn steps(&self, probe: ProbeIndex) -> Vec3 {
        self.coordinate(probe).as_vec3() + 0.5 * (self.width(probe) - 1) as f32
    }

    /// Number along each axis of the lowest point that a probe stands for.
    pub fn coordinate(&self, probe: ProbeIndex) -> UVec3 {
        if let Some(tree) = &self.tree {
            return tree.low(probe.0);
        }
        let (nx, ny) = (self.divisions.x, self.divisions.y);
        UVec3::new(probe.0 % nx, probe.0 / nx % ny, probe.0 / (nx * ny))
    }

    /// Points along each axis that a probe stands for: 1, or a power of two in a mixed grid.
    #[inline]
    pub fn width(&self, probe: ProbeIndex) -> u32 {
        self.tree.as_ref().map_or(1, |tree| tree.width(probe.0))
    }

    /// What numbers a probe's random sequences: the same for probes of the same cell in uniform and mixed grids.
    pub fn stream(&self, probe: ProbeIndex) -> u64 {
        let low = self.coordinate(probe);
        u64::from(self.point_index(low)) | u64::from(self.width(probe) - 1) << 32
    }

    #[inline]
    fn point_index(&self, coordinate: UVec3) -> u32 {
        coordinate.x + self.divisions.x * (coordinate.y + self.divisions.y * coordinate.z)
    }

    /// The probe that stands for a point.
    #[inline]
    fn index(&self, coordinate: UVec3) -> ProbeIndex {
        match &self.tree {
            None => ProbeIndex(self.point_index(coordinate)),
            Some(tree) => ProbeIndex(tree.probe(coordinate)),
        }
    }

    /// Whether a probe lies at the rim of the grid.
    pub fn is_at_rim(&self, probe: ProbeIndex) -> bool {
        let coordinate = self.coordinate(probe);
        coordinate.cmpeq(UVec3::ZERO).any() || (coordinate + self.width(probe)).cmpeq(self.divisions).any()
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
    pub fn cells_along(&self) -> UVec3 {
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
        if let Some(tree) = &self.tree {
            let corner = |i: u32| tree.probe(cell.base + layered * UVec3::new(i & 1, i >> 1 & 1, i >> 2));
            return std::array::from_fn(|i| ProbeIndex(corner(i as u32)));
        }
        let UVec3 { x, y, z } = layered * UVec3::new(1, self.divisions.x, self.divisions.x * self.divisions.y);
        let (lowest, steps) = (self.point_index(cell.base), [[0, x], [0, y], [0, z]]);
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
    pub fn cells_near(&self, low: Vec3, high: Vec3, margin: f32) -> impl Iterator<Item = CellIndex> + Clone {
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
        let high = (self.coordinate(probe) + (self.width(probe) - 1)).min(last);
        let low = self.coordinate(probe).saturating_sub(UVec3::ONE).min(last);
        block(low, high).map(|base| self.index_of_cell(base))
    }

    /// The `ring`-th layer of points around the eight corners of a cell, by their probes; the corners are layer 0.
    pub fn ring(&self, cell: CellIndex, ring: u32) -> impl Iterator<Item = ProbeIndex> + '_ {
        let base = self.base(cell);
        let past = base + UVec3::splat(1 + ring);
        let low = base.saturating_sub(UVec3::splat(ring));
        let inner = move |c: UVec3| ring > 0 && (c + ring).cmpgt(base).all() && c.cmplt(past).all();
        block(low, past.min(self.divisions - UVec3::ONE)).filter(move |&c| !inner(c)).map(|c| self.index(c))
    }
}

/// All coordinates from `low` to `high`, both included, x fastest.
pub fn block(low: UVec3, high: UVec3) -> impl Iterator<Item = UVec3> + Clone {
    (low.z..=high.z)
        .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| UVec3::new(x, y, z))))
}
