//! The surfaces of a scene by the voxels that they pass through.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::overlap::triangle_meets_box;
use super::settings::SurveySettings;
use crate::light::World;
use crate::probe::lattice::grid::{CellIndex, Grid, block};
use crate::probe::store::surface::{Facing, key};
use crate::scene::{Mesh, TriangleIndex};

/// A triangle in one voxel. Small, for there are millions and they are sorted.
#[derive(Debug, Clone, Copy)]
pub struct Met {
    pub cell: CellIndex,
    pub triangle: u32,
    /// Of the voxel with [`Facing::ALL`]'s first facing.
    pub voxel_key: u16,
    /// Of the front.
    pub facing: Facing,
}

impl Met {
    /// By cell, voxel and triangle. As one number, which compares without a branch.
    fn order(&self) -> u128 {
        u128::from(self.cell.0) << 48 | u128::from(self.voxel_key) << 32 | u128::from(self.triangle)
    }
}

/// The surfaces in every voxel of a grid.
pub struct Surveyor<'a, 's> {
    pub world: &'a World<'s>,
    pub grid: &'a Grid,
    /// Voxels along each axis of a cell.
    pub n: u32,
    pub settings: &'a SurveySettings,
    /// By cell, voxel and triangle.
    pub met: Vec<Met>,
}

impl<'a, 's> Surveyor<'a, 's> {
    /// Sorts every surface within the grid's hull into `voxels_per_cell` voxels along each axis of a cell.
    pub fn new(world: &'a World<'s>, grid: &'a Grid, voxels_per_cell: u32, settings: &'a SurveySettings) -> Self {
        let mut surveyor = Surveyor { world, grid, n: voxels_per_cell, settings, met: Vec::new() };
        // One triangle may be a whole floor: its cells are work for all threads.
        let triangles = world.scene.mesh.triangles.len() as u32;
        let cells_of = |t: u32| surveyor.cells_of(t).map(move |cell| (t, cell));
        let in_cells: Vec<(u32, CellIndex)> = (0..triangles).into_par_iter().flat_map_iter(cells_of).collect();
        surveyor.met = in_cells.par_iter().flat_map_iter(|&(t, cell)| surveyor.met_in(t, cell)).collect();
        surveyor.met.par_sort_unstable_by_key(Met::order);
        surveyor
    }

    pub fn mesh(&self) -> &'a Mesh {
        &self.world.scene.mesh
    }

    /// Voxels' margin in cells.
    fn margin(&self) -> f32 {
        self.settings.voxel_margin / self.n as f32
    }

    /// Cells that a triangle meets.
    fn cells_of(&self, triangle: u32) -> impl Iterator<Item = CellIndex> {
        let corners = self.mesh().corners(TriangleIndex(triangle));
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let margin = self.margin();
        let (beyond, _) = self.grid.is_beyond(low, high, margin);
        let cells = (!beyond).then(|| self.grid.cells_near(low, high, margin)).into_iter().flatten();
        // The box of a small triangle is in one cell, and so is it.
        let within = cells.clone().nth(1).is_none();
        cells.filter(move |&cell| {
            let local = || corners.map(|c| self.grid.cell_from_scene(cell, c) - 0.5);
            within || triangle_meets_box(local(), Vec3::splat(0.5 + margin))
        })
    }

    /// A triangle in every voxel of a cell that it meets.
    fn met_in(&self, triangle: u32, cell: CellIndex) -> impl Iterator<Item = Met> {
        let margin = self.settings.voxel_margin;
        let scaled = self.mesh().corners(TriangleIndex(triangle)).map(|c| self.in_voxels(cell, c));
        let low = scaled[0].min(scaled[1]).min(scaled[2]) - margin;
        let high = scaled[0].max(scaled[1]).max(scaled[2]) + margin;
        let last = UVec3::splat(self.n - 1);
        let (low, high) = (low.max(Vec3::ZERO).as_uvec3().min(last), high.max(Vec3::ZERO).as_uvec3().min(last));
        let facing = Facing::of(self.mesh().geometric_normal(TriangleIndex(triangle)));
        // Small triangles are wholly in one voxel.
        let within = low == high;
        let meets = move |voxel: &UVec3| {
            let centre = voxel.as_vec3() + 0.5;
            within || triangle_meets_box(scaled.map(|c| c - centre), Vec3::splat(0.5 + margin))
        };
        let n = self.n;
        block(low, high).filter(meets).map(move |voxel| Met {
            cell,
            triangle,
            voxel_key: key(voxel, Facing::ALL[0], n),
            facing,
        })
    }

    /// A position in units of a cell's voxels.
    pub fn in_voxels(&self, cell: CellIndex, position: Vec3) -> Vec3 {
        self.grid.cell_from_scene(cell, position) * self.n as f32
    }
}
